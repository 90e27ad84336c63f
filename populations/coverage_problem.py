"""Synthetic experiments with a known answer, in groups of one specimen size and one frame rate.

The truth is the mean of both elements on a mesh at least 1.5 times finer than any mesh of the identification.
This mesh is refined further toward the faces' edges. It is computed with the exact path of the flyer and the
exact curve. Many inputs differ from experiment to experiment. Of the material these are curve, stiffness
factor, Poisson's ratio, damping and friction. Of the flyer they are speed, rise, shape and drag. The noise of
every instrument also differs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.special import betainc

import explicit
from explicit.materials import marlow_from_curve
from kolsky.bars.flyer.front_path import BarForce
from kolsky.base.apparatus import Interface, Specimen
from kolsky.base.arrays import FloatArray
from kolsky.base.records import CentreLine, FlyerMotion, ForceHistory, MaterialCurve
from kolsky.inverse.observations import Observations, observe, predict
from kolsky.shot.records import ModelSettings, Shot

GROUP = 10
"""Number of experiments in a group. They share specimen size, density and frame rate and are one batch."""
STATIC, MOVING = 12, 160
"""Number of frames at rest, and from the beginning of the motion to the end of the window."""
SAMPLES = 2700
"""Number of samples of the force from the beginning of the motion to the end of the window."""
HEIGHTS = np.linspace(0.08, 0.92, 14)
"""Heights of the outline's points over the current length of the specimen [-]."""
LEAST_INSIDE = 0.9
"""Smallest share of the outline's points that must be visible [-]. The other points have rolled onto a
platen."""
FORCE_SIGMA, FLYER_SIGMA, OUTLINE_SIGMA, CURVE_SIGMA = 0.146, 1e-6, 4e-6, 0.002
"""Noise of four readings of open-01: force sample [N], displacement of the flyer [m], point of the outline
[m], and relative noise of a stress of the quasi-static curve [-]. Each experiment has a random multiple of
it, see `NOISE`."""
NOISE = (0.6, 1.6)
"""Range of an instrument's noise over that of open-01, log-uniformly distributed [-]."""
TRUTH_ELEMENTS = ("fbar", "one_point")
"""The truth is the mean of these two elements. The outline of one converges from above, that of the other
from below."""
TRUTH_GRADING = 5.0
"""Ratio of the largest to the smallest element of the truth's mesh, twice that of the identification's mesh.
The edge of a bonded face is a singularity and causes most of the mesh error (`python -m
populations.truth_meshes`)."""
BONDED, SLIDING, RELEASED = "bonded", "coulomb", "bonded_release"
SURFACES = (BONDED, SLIDING, RELEASED)
"""Contact laws of faces and side."""
KNOTS = 4097
"""Number of knots of the flyer's exact path in the solver."""
STRETCH = np.linspace(1.0, 0.36, 65)
"""Stretches of the quasi-static test, beginning at rest [-]."""


@dataclass(frozen=True)
class Setup:
    """Common properties of the experiments of a group."""

    diameter: float
    """Diameter of the specimen [m]."""
    length: float
    """Length of the specimen [m]."""
    density: float
    """Density of the specimen [kg/m^3]."""
    speed: float
    """Speed of a flyer that reaches `strain` exactly at the end of the window [m/s]."""
    strain: float
    """Nominal compression at the end of the window under that flyer [-]."""

    @property
    def end(self) -> float:
        """Last time that is compared [s]."""
        return self.strain * self.length / self.speed

    @property
    def frames(self) -> FloatArray:
        """Times of the frames, static ones included [s], shape [STATIC + MOVING]."""
        return np.arange(1 - STATIC, MOVING + 1) / MOVING * self.end

    @property
    def samples(self) -> FloatArray:
        """Times of the samples of the force [s], shape [SAMPLES + 1]."""
        return np.linspace(0.0, self.end, SAMPLES + 1)


@dataclass(frozen=True)
class Truth:
    """One experiment's true values and its instruments' noise."""

    stiffness_factor: float
    poisson: float
    damping: float
    friction: float
    shear_modulus: float
    """mu_0 [Pa]."""
    second: float
    third: float
    """2 U' = mu_0 (1 + second (I1 - 3) + third (I1 - 3)^2) [-]."""
    speed: float
    """Speed of the flyer [m/s]."""
    rise: float
    """Time in which the flyer reaches it [s]."""
    start_power: float
    end_power: float
    """The incomplete beta function with these exponents a, b describes the rise of the velocity [-]."""
    drag: float
    """Share of its speed that the flyer loses over a path of the specimen's length [-]."""
    force_sigma: float
    flyer_sigma: float
    outline_sigma: float
    curve_sigma: float
    """Noise of the instruments, in the units of `FORCE_SIGMA` and its neighbours."""

    @property
    def release_stress(self) -> float:
        """Stress at which a surface releases [Pa]: 10 to 100 kPa, log-uniform. It is derived from the draw of
        friction."""
        low, high = RANGES["friction"]
        return float(1e4 * 10.0 ** ((self.friction - low) / (high - low)))


RANGES = {
    "stiffness_factor": (0.9, 1.3),
    "poisson": (0.9985, 0.9993),  # twice the ratio
    "damping": (1.5e-5, 3.5e-5),
    "friction": (0.15, 0.45),
}
"""Ranges of the uniformly drawn true parameters. For Poisson's ratio it is the range of twice the ratio."""


def draw_setup(rng: np.random.Generator) -> Setup:
    """Specimen, camera and speed of a group."""
    diameter = rng.uniform(7e-3, 12e-3)
    return Setup(
        diameter=diameter,
        length=diameter * rng.uniform(0.5, 0.85),
        density=rng.uniform(820.0, 1100.0),
        speed=float(np.exp(rng.uniform(np.log(1.3), np.log(4.0)))),
        strain=rng.uniform(0.42, 0.5),
    )


def draw_truth(setup: Setup, rng: np.random.Generator) -> Truth:
    """True values of one experiment."""

    def noise(usual: float) -> float:
        return float(usual * np.exp(rng.uniform(*np.log(NOISE))))

    return Truth(
        stiffness_factor=rng.uniform(*RANGES["stiffness_factor"]),
        poisson=0.5 * rng.uniform(*RANGES["poisson"]),
        damping=rng.uniform(*RANGES["damping"]),
        friction=rng.uniform(*RANGES["friction"]),
        shear_modulus=float(np.exp(rng.uniform(np.log(15e3), np.log(45e3)))),
        second=rng.uniform(0.1, 0.3),
        third=rng.uniform(0.02, 0.1),
        speed=setup.speed * rng.uniform(0.9, 1.0),
        rise=rng.uniform(40e-6, 90e-6),
        start_power=rng.uniform(2.2, 4.0),
        end_power=rng.uniform(2.2, 4.0),
        drag=rng.uniform(0.0, 0.2),
        force_sigma=noise(FORCE_SIGMA),
        flyer_sigma=noise(FLYER_SIGMA),
        outline_sigma=noise(OUTLINE_SIGMA),
        curve_sigma=noise(CURVE_SIGMA),
    )


def drawn(number: int, seed: int) -> tuple[Setup, Truth]:
    """Setup and truth of an experiment. They depend only on its number and the seed."""
    setup = draw_setup(np.random.default_rng([seed, 2, number // GROUP]))
    return setup, draw_truth(setup, np.random.default_rng([seed, 3, number]))


def stroke(t: FloatArray, setup: Setup, truth: Truth) -> FloatArray:
    """Displacement of the flyer toward the specimen [m] at times [s]; same shape as the times."""
    undragged = truth.speed * _risen(t, truth)
    if truth.drag == 0.0:
        return undragged
    way = setup.length / truth.drag
    return np.asarray(way * -np.expm1(-undragged / way))


def velocity(t: FloatArray, setup: Setup, truth: Truth) -> FloatArray:
    """Time derivative of `stroke` [m/s]."""
    s = np.clip(t / truth.rise, 0.0, 1.0)
    rising = truth.speed * betainc(truth.start_power, truth.end_power, s)
    return np.asarray(rising * np.exp(-truth.drag / setup.length * truth.speed * _risen(t, truth)))


def _risen(t: FloatArray, truth: Truth) -> FloatArray:
    """Integral of the relative velocity during its rise [s].

    The integral of the incomplete beta function I_s(a, b) is s I_s(a, b) - a / (a + b) I_s(a + 1, b).
    """
    a, b, s = truth.start_power, truth.end_power, np.clip(t / truth.rise, 0.0, 1.0)
    within = s * betainc(a, b, s) - a / (a + b) * betainc(a + 1.0, b, s)
    return np.asarray(truth.rise * within + np.maximum(t - truth.rise, 0.0))


def curve(truth: Truth) -> FloatArray:
    """Exact nominal stress of the quasi-static test [Pa] at `STRETCH`."""
    shift = STRETCH**2 + 2.0 / STRETCH - 3.0
    modulus = truth.shear_modulus * (1.0 + truth.second * shift + truth.third * shift**2)
    return np.asarray((STRETCH - STRETCH**-2) * modulus)


def template(setup: Setup, truth: Truth) -> Observations:
    """Observations with the times and heights of the instruments. The readings are arbitrary."""
    seen = setup.frames[setup.frames > 0.0]
    y = HEIGHTS * (setup.length - stroke(seen, setup, truth)[:, None])
    line = CentreLine(
        time=np.repeat(seen, len(HEIGHTS)),
        frame=np.repeat(np.arange(len(seen)) + STATIC, len(HEIGHTS)).astype(np.int64),
        y=y.ravel(),
        Z=np.full(y.size, 0.5 * setup.diameter),
        sigma=np.full(y.size, truth.outline_sigma),
    )
    samples = setup.samples
    force = ForceHistory(samples, np.zeros(len(samples)), np.full(len(samples), truth.force_sigma))
    width = setup.end / MOVING
    return observe(force, line, window=(0.0, float(setup.frames[-1])), bin_width=width)


def simulate(
    setup: Setup,
    truths: Sequence[Truth],
    *,
    mesh: tuple[int, int],
    device: str,
    element: str = "fbar",
    interface: str = BONDED,
    grading: float = 2.0,
) -> list[tuple[FloatArray, FloatArray]]:
    """Exact force at the samples [N] and radius at the points [m] of every experiment, in one batch.

    The radius is NaN where the surface at a point's height has rolled onto a platen. ValueError if a run does
    not complete, or more points lie on the platens than `LEAST_INSIDE` allows.
    """
    knots = np.linspace(0.0, setup.end, KNOTS)
    model = explicit.Model(
        mesh=explicit.cylinder(
            0.5 * setup.diameter, setup.length, n_radial=mesh[0], n_axial=mesh[1], grading=grading
        ),
        density=setup.density,
        materials=tuple(marlow_from_curve(STRETCH, curve(truth)) for truth in truths),
        motions=tuple(
            explicit.PlatenMotion(
                start=0.0,
                step=float(knots[1]),
                position=stroke(knots, setup, truth),
                velocity=velocity(knots, setup, truth),
            )
            for truth in truths
        ),
        faces=interface,
        side=interface,
        element=element,
    )
    names = ["stiffness_factor", "poisson", "damping"]
    names += {SLIDING: ["friction"], RELEASED: ["release_stress"]}.get(interface, [])
    response = explicit.run(
        model,
        explicit.Samples.of(
            **{name: np.array([getattr(truth, name) for truth in truths]) for name in names},
            motion=np.arange(len(truths)),
            material=np.arange(len(truths)),
        ),
        explicit.Sampling(
            force_times=setup.samples, surface_times=setup.frames[setup.frames > 0.0], ledger_every=16
        ),
        device=device,
    )
    found = []
    for row, truth in enumerate(truths):
        if not response.completed[row]:
            raise ValueError(f"the truth {truth} of {setup} ended {response.describe(row)}")
        seen = predict(response.select([row]), template(setup, truth))
        if np.mean(seen.inside) < LEAST_INSIDE:
            raise ValueError("too many points of the outline lie on the platens: move HEIGHTS inward")
        found.append((seen.force[0], np.where(seen.inside, seen.Z, np.nan)[0]))
    return found


def moved(truth: Truth, steps: Mapping[str, float]) -> list[Truth]:
    """The truth with each parameter moved by its step, up and down: the neighbours of central differences."""
    return [
        replace(truth, **{name: getattr(truth, name) + sign * step})
        for name, step in steps.items()
        for sign in (1.0, -1.0)
    ]


def differences(rows: Sequence[FloatArray], steps: Mapping[str, float]) -> FloatArray:
    """Derivatives by the parameters from the data at `moved`, shape [k, len(steps)]."""
    sizes = 2.0 * np.array(list(steps.values()))
    return np.asarray(((np.array(rows[::2]) - np.array(rows[1::2])) / sizes[:, None]).T)


def middle(
    one: tuple[FloatArray, FloatArray], other: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Means of the forces and radii of two elements."""
    force, Z = (0.5 * (one[i] + other[i]) for i in range(2))
    return force, Z


def experiment(
    number: int,
    setup: Setup,
    truth: Truth,
    seen: tuple[FloatArray, FloatArray],
    interface: str,
    rng: np.random.Generator,
) -> Shot:
    """One experiment: the truth with the instruments' noise, as a shot with exact declared inputs."""
    observations, (force, Z), frames = template(setup, truth), seen, setup.frames
    line, stress = observations.centre_line, curve(truth)
    clean = np.where(frames > 0.0, stroke(frames, setup, truth), 0.0)
    # The order of the draws must not change: a seed then has the same values.
    felt = force + truth.force_sigma * rng.standard_normal(force.shape)
    tested = stress * (1.0 + truth.curve_sigma * rng.standard_normal(stress.shape))
    flown = clean + truth.flyer_sigma * rng.standard_normal(clean.shape)
    measured = Z + truth.outline_sigma * rng.standard_normal(Z.shape)
    there = np.isfinite(measured)  # a point on a platen is not visible
    return Shot(
        name=f"experiment {number}",
        folder=Path(),
        specimen=Specimen(diameter=setup.diameter, length=setup.length, density=setup.density),
        interface=Interface(
            faces=interface,
            side=interface,
            friction=truth.friction,
            release_stress=truth.release_stress if interface == RELEASED else 0.0,
        ),
        support="rigid",
        transmission_bar=None,
        model=ModelSettings(truth.poisson, truth.damping, "deviatoric", 0.0),
        force=BarForce(ForceHistory(observations.force.time, felt, observations.force.sigma), sigma_gain=0.0),
        curve=MaterialCurve(stretch=STRETCH, stress=tested, sigma=truth.curve_sigma * np.abs(stress)),
        inputs={},
        flyer=FlyerMotion(time=frames, displacement=flown, sigma=np.full(len(frames), truth.flyer_sigma)),
        centre_line=CentreLine(
            time=line.time[there],
            frame=line.frame[there],
            y=line.y[there],
            Z=measured[there],
            sigma=line.sigma[there],
        ),
        window=(0.0, float(frames[-1])),
    )
