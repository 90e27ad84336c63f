r"""A compression test between platens, run slowly by the explicit solver.

A static answer does not depend on the mass, so the specimen's density and the test's duration are chosen
together (mass scaling): the platen's speed rises smoothly over the first half of a duration of many passages
of a wave, and a drag on the nodes takes away what still swings. The force is the mean of both faces, in which
the drag's resultant cancels. What is left of inertia is in the answer: the share of the kinetic energy, and
how far the two faces differ.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

import explicit
from explicit.materials import MaterialLaw
from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray

DENSITY = 1000.0
"""Mass density that all slow tests are run with [kg/m^3]; the duration is counted in passages of a wave."""
DRAG = 0.15
"""Mass-proportional damping times one passage of a wave [-]."""
VISCOSITY = 0.03
"""Stiffness-proportional damping of the deviator over one passage of a wave [-]. Sliding by Coulomb's law
flutters without any."""
RISE = 0.5
"""Share of the duration in which the platen picks up speed [-]."""
OUTSET = 0.02
"""Strain below which kinetic energy and face forces are not compared: both energies begin at zero [-]."""


@dataclass(frozen=True)
class SlowNumerics:
    """Numerical choices of a slow test."""

    mesh: tuple[int, int] = (16, 22)
    """Elements across the radius and along the length."""
    grading: float = 2.0
    """Largest over smallest element; the small ones lie at faces and side."""
    passages: float = 250.0
    """Duration in passages of a bar wave along the specimen at rest [-]."""
    poisson: float = 0.499
    """Poisson's ratio of the initial state [-]; that of the shot the curve is meant for."""
    threads: int | None = None
    """CPU threads; all cores if left out."""

    def __post_init__(self) -> None:
        if not self.passages >= 20.0:
            raise ValueError(f"a slow test lasts 20 passages of a wave or more, got {self.passages}")


@dataclass(frozen=True)
class SlowTests:
    """Simulated tests at chosen strains; one row a test."""

    stress: FloatArray
    """Mean force of both faces over the undeformed cross-section [Pa], shape [n_tests, n]."""
    bulge: FloatArray
    """Radius at mid-height [m], shape [n_tests, n]."""
    kinetic_share: float
    """Largest kinetic over elastic energy from `OUTSET` on, any test [-]."""
    face_difference: float
    """Largest difference of the face forces over their mean from `OUTSET` on, any test [-]."""
    past_data: float
    """Largest share of the specimen's volume that was strained past the curve, any test [-]."""


def slow_tests(
    laws: Sequence[MaterialLaw],
    specimen: Specimen,
    strain: FloatArray,
    *,
    faces: str,
    side: str | None = None,
    friction: FloatArray | float = 0.0,
    numerics: SlowNumerics | None = None,
) -> SlowTests:
    """Compress one specimen of several materials slowly, in one batch.

    Parameters
    ----------
    laws
        A material for each test, all of one class, shape [n_tests].
    specimen
        Its undeformed size; the density has no part in it.
    strain
        Nominal compressive strains to record, ascending, > 0 [-], shape [n].
    faces
        Contact law of the faces, a name of `explicit.contact.CONTACT_LAWS`.
    side
        Contact law of the side surface; that of the faces if left out.
    friction
        Coulomb's coefficient where the law is "coulomb" [-], scalar or shape [n_tests].
    numerics
        Mesh and duration.

    Raises
    ------
    ValueError
        If the strains are not ascending inside (0, 1), or a simulation does not complete; the message says
        how, when and where it ended.
    """
    numerics = numerics or SlowNumerics()
    if strain.size < 2 or strain[0] <= 0.0 or strain[-1] >= 1.0 or (np.diff(strain) <= 0.0).any():
        raise ValueError("strains of a slow test must ascend inside (0, 1), at least two of them")
    modulus = 3.0 * min(law.initial_shear_modulus for law in laws)
    passage = specimen.length / sqrt(modulus / DENSITY)
    duration = numerics.passages * passage
    motion = _motion(strain[-1] * specimen.length, duration)
    knots = np.linspace(0.0, duration, 20001)
    times = np.interp(strain * specimen.length, motion(knots), knots)
    n_radial, n_axial = numerics.mesh
    response = explicit.run(
        explicit.Model(
            mesh=explicit.cylinder(
                specimen.radius, specimen.length, n_radial=n_radial, n_axial=n_axial, grading=numerics.grading
            ),
            density=DENSITY,
            materials=tuple(laws),
            motions=(motion,),
            faces=faces,
            side=faces if side is None else side,
        ),
        explicit.Samples.of(
            poisson=numerics.poisson,
            mass_damping=DRAG / passage,
            damping=VISCOSITY * passage,
            friction=friction,
            material=np.arange(len(laws)),
        ),
        explicit.Sampling(force_times=times, surface_times=times),
        threads=numerics.threads,
    )
    if not response.completed.all():
        first = int(np.argmin(response.completed))
        raise ValueError(f"the slow compression ended {response.describe(first)}")
    force = 0.5 * (response.force_flyer + response.force_transmission)
    seen = strain >= min(OUTSET, strain[-1])
    kinetic = response.energy.kinetic[:, seen] / response.energy.elastic[:, seen]
    apart = np.abs(response.force_flyer - response.force_transmission)[:, seen] / np.abs(force[:, seen])
    return SlowTests(
        stress=force / (pi * specimen.radius**2),
        bulge=_at_mid_height(response.surface_r, response.surface_y),
        kinetic_share=float(kinetic.max()),
        face_difference=float(apart.max()),
        past_data=float(response.extrapolated_share.max()),
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


def _at_mid_height(r: FloatArray, y: FloatArray) -> FloatArray:
    """Radius half-way between the platens, shape [n_tests, n]; both arrays [n_tests, n, n_nodes]."""
    found = np.empty(r.shape[:2])
    for place in np.ndindex(found.shape):
        heights = y[place]
        found[place] = np.interp(0.5 * (heights[0] + heights[-1]), heights, r[place])
    return found
