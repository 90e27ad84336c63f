"""Force curves of a specification's tests with its constants, with noise where it is wanted."""

from dataclasses import dataclass

import numpy as np

from implicit.solution import Solution
from kolsky.base.arrays import FloatArray
from kolsky.specimen.geometry import AXES
from kolsky.specimen.reading import Specification


@dataclass(frozen=True)
class Simulated:
    """A simulated test."""

    displacement: FloatArray
    """Of the ends, with its noise if there is any [m], shape [n, ends]."""
    force: FloatArray
    """On the ends, likewise [N], shape [n, ends]."""
    solution: Solution
    """Equilibria at the true displacements."""

    @property
    def columns(self) -> dict[str, FloatArray]:
        """Columns of its CSV file, which `[tests.NAME]` can name."""
        found = {}
        for end in range(self.displacement.shape[1]):
            found[f"displacement {AXES[end]} (mm)"] = 1e3 * self.displacement[:, end]
            found[f"force {AXES[end]} (N)"] = self.force[:, end]
        return found


def simulate_tests(spec: Specification, *, seed: int | None = None) -> dict[str, Simulated]:
    """Simulate every test of a specification with its declared constants.

    Parameters
    ----------
    spec
        The specification.
    seed
        Of the noise of displacements and forces; None: no noise.

    Raises
    ------
    ValueError
        If a simulation fails, with its reason.
    """
    rng = None if seed is None else np.random.default_rng(seed)
    solid = spec.constants.solid(spec.constants.start)
    made = {}
    for name, model in spec.models.items():
        section = spec.declared.tests[name]
        d = spec.schedule(name)
        solution = model.simulate(solid, d)
        if not solution.outcome.ok:
            raise ValueError(f"{name}: {solution.outcome.cause}; {solution.outcome.cure}")
        force = model.force(solution)
        if rng is not None:
            d = d + section.sigma_displacement * rng.standard_normal(d.shape)
            force = force + section.sigma_force * rng.standard_normal(force.shape)
        made[name] = Simulated(d, force, solution)
    return made
