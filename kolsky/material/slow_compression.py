"""Quasi-static compression by the explicit solver, slow enough for the declared error."""

from dataclasses import dataclass, replace
from math import ceil, pi, sqrt

import numpy as np

import explicit
from explicit.materials import MaterialLaw
from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray

DENSITY = 1000.0
"""Mass density used in all slow tests [kg/m^3]. The duration is given in passages of a wave."""
DRAG = 0.15
"""Mass-proportional damping times one passage of a wave [-]."""
_VISCOSITY = 0.03
"""Stiffness-proportional damping of the deviator over one passage of a wave [-]. Without it, sliding by
Coulomb's law oscillates."""
RISE = 0.5
"""Share of the duration in which the platen accelerates [-]."""
GRADING = 2.0
"""Size of the largest element divided by that of the smallest. The small ones lie at faces and side."""
LEAST_COMPARED_STRAIN = 0.02
"""Strain below which kinetic energy and face forces are not compared [-]. Both energies begin at zero."""


@dataclass(frozen=True)
class SlowNumerics:
    """Numerical choices of a slow test."""

    mesh: tuple[int, int] = (16, 22)
    """Elements across the radius and along the length."""
    passages: float = 250.0
    """Duration in passages of a bar wave along the specimen at rest [-]."""
    poisson: float = 0.499
    """Poisson's ratio of the initial state [-]. It is that of the shot for which the curve is used."""
    threads: int | None = None
    """CPU threads; default: all cores."""

    def __post_init__(self) -> None:
        if not self.passages >= 20.0:
            raise ValueError(f"a slow test lasts 20 passages of a wave or more, got {self.passages}")


@dataclass(frozen=True)
class SlowRun:
    """A simulated test at chosen strains."""

    stress: FloatArray
    """Mean force of both faces over the undeformed cross-section [Pa], shape [n]."""
    bulge: FloatArray
    """Radius at mid-height [m], shape [n]."""
    kinetic_share: float
    """Largest ratio of kinetic to elastic energy, from `LEAST_COMPARED_STRAIN` on [-]."""
    face_difference: float
    """Largest difference of the face forces divided by their mean, from `LEAST_COMPARED_STRAIN` on [-]."""
    past_data: float
    """Share of the specimen's volume that was strained past the curve [-]."""


def slow_run(
    law: MaterialLaw,
    specimen: Specimen,
    strain: FloatArray,
    *,
    faces: str,
    side: str | None = None,
    friction: float = 0.0,
    numerics: SlowNumerics,
) -> SlowRun:
    """Compress a specimen once; the arguments and errors are those of `slow_compression`."""
    if strain.size < 2 or strain[0] <= 0.0 or strain[-1] >= 1.0 or (np.diff(strain) <= 0.0).any():
        raise ValueError("strains of a slow test must ascend inside (0, 1), at least two of them")
    passage = specimen.length / sqrt(3.0 * law.initial_shear_modulus / DENSITY)
    duration = numerics.passages * passage
    motion = _motion(strain[-1] * specimen.length, duration)
    knots = np.linspace(0.0, duration, 20001)
    times = np.interp(strain * specimen.length, motion(knots), knots)
    n_radial, n_axial = numerics.mesh
    response = explicit.run(
        explicit.Model(
            mesh=explicit.cylinder(
                specimen.radius, specimen.length, n_radial=n_radial, n_axial=n_axial, grading=GRADING
            ),
            density=DENSITY,
            materials=(law,),
            motions=(motion,),
            faces=faces,
            side=faces if side is None else side,
        ),
        explicit.Samples.of(
            poisson=numerics.poisson,
            mass_damping=DRAG / passage,
            damping=_VISCOSITY * passage,
            friction=friction,
        ),
        explicit.Sampling(force_times=times, surface_times=times),
        threads=numerics.threads,
    )
    if not response.completed[0]:
        raise ValueError(f"the slow compression ended {response.describe(0)}")
    flyer, transmission = response.force_flyer[0], response.force_transmission[0]
    force = 0.5 * (flyer + transmission)
    seen = strain >= min(LEAST_COMPARED_STRAIN, strain[-1])
    energy = response.energy
    side_shapes = zip(response.surface_r[0], response.surface_y[0], strict=True)
    return SlowRun(
        stress=force / (pi * specimen.radius**2),
        bulge=np.array([np.interp(0.5 * (y[0] + y[-1]), y, r) for r, y in side_shapes]),
        kinetic_share=float((energy.kinetic[0, seen] / energy.elastic[0, seen]).max()),
        face_difference=float((np.abs(flyer - transmission)[seen] / np.abs(force[seen])).max()),
        past_data=float(response.extrapolated_share[0]),
    )


def _motion(stroke: float, duration: float) -> explicit.PlatenMotion:
    """Speed along the smooth step 10 s^3 - 15 s^4 + 6 s^5, then constant."""
    rise = RISE * duration
    speed = stroke / (duration - 0.5 * rise)

    def position(time: FloatArray) -> FloatArray:
        s = np.clip(time / rise, 0.0, 1.0)
        return np.asarray(speed * (rise * s**4 * (2.5 - 3.0 * s + s**2) + np.maximum(time - rise, 0.0)))

    def velocity(time: FloatArray) -> FloatArray:
        s = np.clip(time / rise, 0.0, 1.0)
        return np.asarray(speed * s**3 * (10.0 - 15.0 * s + 6.0 * s**2))

    return explicit.PlatenMotion.sampled(position, velocity, start=0.0, end=duration, n_knots=4001)


FIRST = 60.0
"""Duration of the first run, in passages of a bar wave along the specimen [-]."""
LONGEST = 8000.0
"""Largest duration of a run [passages]."""
MARGIN = 1.2
"""Safety factor on the predicted duration for the requested error."""


@dataclass(frozen=True)
class SlowCompression:
    """A simulated quasi-static compression test."""

    strain: FloatArray
    """Nominal compressive strain [-], shape [n]."""
    force: FloatArray
    """Force [N], shape [n]."""
    error: FloatArray
    """Relative error of the force from inertia, drag and damping [-], shape [n]."""
    durations: tuple[float, ...]
    """Durations of the runs [passages of a wave]. The last one is that of the result."""
    errors: tuple[float, ...]
    """Largest error from `LEAST_COMPARED_STRAIN` on in each run [-]. It is infinite for the first run, which
    has no earlier run for comparison."""
    test: SlowRun
    """The last run: stress, radius, kinetic energy, difference of the faces, share past the data."""

    @property
    def columns(self) -> dict[str, FloatArray]:
        """Columns of its CSV file."""
        return {
            "strain (1)": self.strain,
            "force (N)": self.force,
            "stress (Pa)": self.test.stress,
            "radius at mid-height (m)": self.test.bulge,
            "error of the force (1)": self.error,
        }


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
) -> SlowCompression:
    """Compress a specimen slowly.

    Ramp, drag and duration are chosen for the requested error of the force.

    Raises ValueError if an argument is outside its range, if a run does not complete, or if the error is not
    reached with `LONGEST`.

    Parameters
    ----------
    law
        Any material law. A slow test does not include relaxation.
    specimen
        Its undeformed size. The density is not used.
    strain
        Nominal compressive strains to record, ascending inside (0, 1) [-], shape [n].
    faces, side, friction
        Contact laws, and Coulomb's coefficient [-]. Default of the side: that of the faces.
    stiffness_factor
        Factor m on the law [-]. A static force is proportional to it.
    error
        Requested relative error of the force from a strain of `LEAST_COMPARED_STRAIN` on, in [1e-4, 0.1]. The
        error of the mesh is not included.
    numerics
        Mesh, Poisson's ratio and threads. Its duration is the start of the search; default: `FIRST`.
    """
    if not 1e-4 <= error <= 0.1:
        raise ValueError(f"the wanted error of a slow run must be in [0.0001, 0.1], got {error:g}")
    if not stiffness_factor > 0.0:
        raise ValueError(f"stiffness_factor must be > 0, got {stiffness_factor:g}")
    numerics = numerics or SlowNumerics(passages=FIRST)
    durations, errors = [numerics.passages], [float("inf")]

    def run(passages: float) -> SlowRun:
        made = replace(numerics, passages=passages)
        return slow_run(law, specimen, strain, faces=faces, side=side, friction=friction, numerics=made)

    before = run(durations[0])
    factor = 2.0
    while True:
        durations.append(ceil(factor * durations[-1]))
        found = run(durations[-1])
        ratio = durations[-1] / durations[-2]
        left = np.abs(before.stress / found.stress - 1.0) / (ratio - 1.0)
        errors.append(float(left[strain >= min(LEAST_COMPARED_STRAIN, strain[-1])].max()))
        if errors[-1] <= error:
            break
        factor = max(2.0, MARGIN * errors[-1] / error)
        if factor * durations[-1] > LONGEST:
            raise ValueError(
                f"a duration of {durations[-1]:.0f} passages of a wave leaves an error of "
                f"{errors[-1]:.2g}, and {error:.2g} needs about {factor * durations[-1]:.0f} of them, more "
                f"than {LONGEST:.0f}: give a larger error, or less strain; with friction the edge may be "
                "unstable"
            )
        before = found
    found = replace(found, stress=stiffness_factor * found.stress)
    force = found.stress * pi * specimen.radius**2
    return SlowCompression(strain, force, left, tuple(durations), tuple(errors), found)
