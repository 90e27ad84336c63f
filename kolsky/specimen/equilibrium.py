"""Forces of a specimen's ends at given displacements, with their slopes: `implicit` behind the fit.

Samples are simulated in the order of their displacement, each from the one before. Derivatives by the law's
constants and by the displacements of the ends come from one factorisation a sample.
"""

from dataclasses import dataclass, replace

import numpy as np

from implicit.laws.solid import Solid
from implicit.sensitivity import direct
from implicit.solution import Solution
from implicit.solve import solve
from kolsky.base.arrays import FloatArray
from kolsky.specimen.constants import Constants
from kolsky.specimen.errors_in_variables import Linearised
from kolsky.specimen.geometry import AXES, Shape


@dataclass(frozen=True)
class SpecimenModel:
    """A specimen that can be simulated with any constants."""

    name: str
    """Name of the test."""
    shape: Shape
    """Form, bonds and mesh."""
    device: str = "cpu"
    """Where the element kernels run."""

    def simulate(self, solid: Solid, displacement: FloatArray) -> Solution:
        """Equilibria at the displacements of the ends.

        Parameters
        ----------
        solid
            The material.
        displacement
            Of one end relative to the other [m], shape [n, ends].
        """
        steps = {f"d_{AXES[axis]}": displacement[:, axis] for axis in range(self.shape.ends)}
        return solve(self.shape.model(solid, device=self.device), steps)

    def force(self, solution: Solution) -> FloatArray:
        """Force on each end, tension positive [N], shape [n, ends]."""
        return np.stack(
            [
                self.shape.multiplicity * solution.reaction(f"bond_{AXES[axis]}+")[:, axis]
                for axis in range(self.shape.ends)
            ],
            axis=-1,
        )

    def linearised(
        self, constants: Constants, free: FloatArray, displacement: FloatArray
    ) -> Linearised | str:
        """Forces and slopes at the displacements, or why there are none.

        Parameters
        ----------
        constants
            The law and what of it is free.
        free
            Values of the free constants, SI, shape [p].
        displacement
            [m], shape [n, ends]; in any order.
        """
        try:
            solid = constants.solid(free)
        except ValueError as error:
            return str(error)
        order = np.argsort(np.abs(displacement).sum(axis=1), kind="stable")
        solution = self.simulate(solid, displacement[order])
        if not solution.outcome.ok:
            worst = displacement[order][solution.reached]
            there = ", ".join(f"{1e3 * value:.4g} mm" for value in worst)
            return f"{self.name} at {there}: {solution.outcome.cause}; {solution.outcome.cure}"
        histories = tuple(f"d_{AXES[axis]}" for axis in range(self.shape.ends))
        slopes = direct(solution, histories=histories)
        back = np.argsort(order, kind="stable")
        n_own = slopes.displacements.shape[1] - len(histories)
        by_all = np.stack(
            [
                self.shape.multiplicity * slopes.reaction(f"bond_{AXES[axis]}+")[:, :, axis]
                for axis in range(self.shape.ends)
            ],
            axis=1,
        )[back]
        chain = constants.chain(free)
        return Linearised(self.force(solution)[back], by_all[..., :n_own] @ chain, by_all[..., n_own:])

    def shortened(self) -> "SpecimenModel":
        """The specimen with each bond one element shorter; see `Shape.shortened`."""
        return replace(self, shape=self.shape.shortened())


def strains(solution: Solution, step: int) -> tuple[FloatArray, FloatArray]:
    """Normal strains F_ii - 1 at the Gauss points along the coordinate axes, with their volumes.

    Parameters
    ----------
    solution
        Equilibria of a three-dimensional model.
    step
        Which.

    Returns
    -------
    strain
        F_ii - 1 [-], shape [m, g, 3].
    volume
        Of each point in the reference state [m^3], shape [m, g].
    """
    model = solution.model
    element = model.mesh.element
    points, weights = element.rule(model.gauss or element.gauss)
    gradients = element.gradients(points)
    corners = model.mesh.points[model.mesh.cells]
    jacobian = np.einsum("gkj,mki->mgij", gradients, corners)
    moved = np.einsum("gkj,mki->mgij", gradients, corners + solution.displacements[step][model.mesh.cells])
    deformation = moved @ np.linalg.inv(jacobian)
    strain = np.einsum("mgii->mgi", deformation) - 1.0
    return strain, np.abs(np.linalg.det(jacobian)) * weights
