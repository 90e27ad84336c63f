"""A quasi-static compression by the explicit solver, slow enough for a wanted error.

Inertia, drag and damping make the force of a slow run wrong by an amount that falls at least as one over its
duration. So a run is repeated with a longer one: with the factor q between two durations, the longer run is
still wrong by the difference of the two forces over q - 1, or by less where it falls faster. The duration is
raised until that is the wanted error everywhere.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, pi
from pathlib import Path

import numpy as np

from explicit.materials import MaterialLaw
from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray
from kolsky.base.files import write_table
from kolsky.material.end_friction.slow_test import OUTSET, SlowNumerics, SlowTests, slow_tests

FIRST = 60.0
"""Duration of the first run, in passages of a bar wave along the specimen [-]."""
LONGEST = 8000.0
"""Longest duration that is tried [passages]."""
MARGIN = 1.2
"""Room that the next duration leaves beyond the one at which the error should be as wanted."""


@dataclass(frozen=True)
class SlowCompression:
    """A simulated quasi-static compression test."""

    strain: FloatArray
    """Nominal compressive strain [-], shape [n]."""
    force: FloatArray
    """Force [N], shape [n]."""
    stress: FloatArray
    """Force over the undeformed cross-section [Pa], shape [n]."""
    radius: FloatArray
    """Radius at mid-height [m], shape [n]."""
    error: FloatArray
    """What inertia, drag and damping leave in the force, relative to it [-], shape [n]."""
    durations: tuple[float, ...]
    """Durations that were run [passages of a wave], the last of them the answer's."""
    errors: tuple[float, ...]
    """Largest error from `OUTSET` on at each of them [-]; infinite for the first, which has nothing beside
    it."""
    test: SlowTests
    """The last run: kinetic energy, difference of the faces, share past the data."""


def slow_compression(
    law: MaterialLaw,
    specimen: Specimen,
    strain: FloatArray,
    *,
    faces: str,
    side: str | None = None,
    friction: float = 0.0,
    stiffness_factor: float = 1.0,
    error: float = 2e-3,
    numerics: SlowNumerics | None = None,
    progress: Callable[[float, float], None] = lambda duration, error: None,
) -> SlowCompression:
    """Compress a specimen slowly, with ramp, drag and duration chosen for a wanted error of the force.

    Parameters
    ----------
    law
        Any material law; what relaxes beside it has no part in a slow test.
    specimen
        Its undeformed size; the density has no part in it.
    strain
        Nominal compressive strains to record, ascending inside (0, 1) [-], shape [n].
    faces, side, friction
        Contact laws, that of the side as the faces' if left out, and Coulomb's coefficient [-].
    stiffness_factor
        Factor m on the law [-]: a static force is proportional to it.
    error
        Wanted relative error of the force from a strain of `OUTSET` on, in [1e-4, 0.1]. That of the mesh is
        not in it.
    numerics
        Mesh, Poisson's ratio and threads; its duration is where the search begins, `FIRST` if left out.
    progress
        Called with duration and largest error after each run.

    Raises
    ------
    ValueError
        If an argument is outside its range, a run does not complete, or the error is not reached with
        `LONGEST`.
    """
    if not 1e-4 <= error <= 0.1:
        raise ValueError(f"the wanted error of a slow run must be in [0.0001, 0.1], got {error:g}")
    if not stiffness_factor > 0.0:
        raise ValueError(f"stiffness_factor must be > 0, got {stiffness_factor:g}")
    numerics = numerics or SlowNumerics(passages=FIRST)
    durations, errors = [numerics.passages], [float("inf")]

    def run(passages: float) -> SlowTests:
        made = replace(numerics, passages=passages)
        return slow_tests([law], specimen, strain, faces=faces, side=side, friction=friction, numerics=made)

    before = run(durations[0])
    progress(durations[0], errors[0])
    factor = 2.0
    while True:
        durations.append(ceil(factor * durations[-1]))
        found = run(durations[-1])
        ratio = durations[-1] / durations[-2]
        left = np.abs(before.stress[0] / found.stress[0] - 1.0) / (ratio - 1.0)
        errors.append(float(left[strain >= min(OUTSET, strain[-1])].max()))
        progress(durations[-1], errors[-1])
        if errors[-1] <= error:
            break
        factor = max(2.0, MARGIN * errors[-1] / error)
        if factor * durations[-1] > LONGEST:
            raise ValueError(
                f"a duration of {durations[-1]:.0f} passages of a wave leaves an error of {errors[-1]:.2g}, "
                f"and {error:.2g} would take {factor * durations[-1]:.0f} of them, more than {LONGEST:.0f}: "
                "ask for a larger error, or less strain; with friction the edge may be unstable"
            )
        before = found
    stress = stiffness_factor * found.stress[0]
    return SlowCompression(
        strain=strain,
        force=stress * pi * specimen.radius**2,
        stress=stress,
        radius=found.bulge[0],
        error=left,
        durations=tuple(durations),
        errors=tuple(errors),
        test=found,
    )


def write_slow_compression(path: Path, found: SlowCompression) -> Path:
    """Write a table of strain, force, stress, radius and error, atomically."""
    return write_table(
        path,
        {
            "strain (1)": found.strain,
            "force (N)": found.force,
            "stress (Pa)": found.stress,
            "radius at mid-height (m)": found.radius,
            "error of the force (1)": found.error,
        },
    )
