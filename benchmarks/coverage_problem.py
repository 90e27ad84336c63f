"""Made-up experiments with a known answer: the benchmarks' test on a fine mesh, seen with open-01's noise.

The truth is another element, F-bar, on a finer mesh than any that the identification uses, driven by the
exact path of the flyer and the exact curve. What the instruments report of it has the noise of open-01.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import explicit
from benchmarks.problem import (
    DAMPING,
    DENSITY,
    LENGTH,
    POISSON,
    RADIUS,
    SECOND,
    SHEAR_MODULUS,
    THIRD,
    flyer,
    stroke,
)
from explicit.materials import marlow_from_curve
from kolsky.bars.flyer.front_path import BarForce
from kolsky.base.apparatus import Interface, Specimen
from kolsky.base.records import CentreLine, FlyerMotion, ForceHistory, MaterialCurve
from kolsky.inverse.observations import Observations, observe, predict
from kolsky.shot.records import ModelSettings, Shot

FloatArray = NDArray[np.float64]

FRAME = 1.0 / 120e3
"""Time from frame to frame [s]."""
STATIC = 12
"""Frames at rest, before the motion."""
END = 1.35e-3
"""Last time that is compared [s]."""
SAMPLE = 0.5e-6
"""Time from sample to sample of the force [s]."""
HEIGHTS = np.linspace(0.08, 0.92, 14)
"""Where the outline is seen, over the specimen's length at the time [-]."""
FORCE_SIGMA = 0.146
"""Noise of a sample of the force [N]; open-01's."""
FLYER_SIGMA = 1e-6
"""Noise of a displacement of the flyer [m]; open-01's."""
OUTLINE_SIGMA = 4e-6
"""Noise of a point of the outline [m]; open-01's."""
CURVE_SIGMA = 0.002
"""Noise of a stress of the quasi-static curve, relative to it [-]; open-01's."""
BONDED, SLIDING = "bonded", "coulomb"
FRICTION = 0.3
"""Where the interface slides and friction is not drawn [-]."""


@dataclass(frozen=True)
class Draws:
    """True parameters of the experiments."""

    values: Mapping[str, FloatArray]
    """Parameter name -> value of each experiment, shape [n]."""
    interface: str
    """Law of faces and side."""


RANGES = {"stiffness_factor": (0.9, 1.3), "friction": (0.15, 0.45), "damping": (1.5e-5, 3.5e-5)}
"""Where the true parameters are drawn from, uniformly."""


def draw(free: tuple[str, ...], n: int, rng: np.random.Generator) -> Draws:
    """True parameters: those that are free from `RANGES`, the others at the problem's values."""
    held = {"stiffness_factor": 1.0, "friction": FRICTION, "damping": DAMPING}
    interface = SLIDING if "friction" in free else BONDED
    return Draws(
        {
            name: rng.uniform(*RANGES[name], size=n) if name in free else np.full(n, value)
            for name, value in held.items()
        },
        interface,
    )


def times() -> tuple[FloatArray, FloatArray]:
    """Times of the frames, static ones included, and of the samples of the force [s]."""
    frames = FRAME * np.arange(-STATIC + 1, int(END / FRAME) + 1)
    return frames, SAMPLE * np.arange(int(END / SAMPLE) + 1)


def curve() -> tuple[FloatArray, FloatArray]:
    """Stretch and exact nominal stress [Pa] of the quasi-static test, from rest outward."""
    stretch = np.linspace(1.0, 0.36, 65)
    shift = stretch**2 + 2.0 / stretch - 3.0
    stress = (stretch - stretch**-2) * SHEAR_MODULUS * (1.0 + SECOND * shift + THIRD * shift**2)
    return stretch, stress


def template() -> Observations:
    """Where and when the instruments look; what they read there is of no account."""
    frames, samples = times()
    seen = frames[frames > 0.0]
    y = HEIGHTS * (LENGTH - stroke(seen)[:, None])
    number = np.repeat(np.arange(len(seen)) + STATIC, len(HEIGHTS))
    line = CentreLine(
        time=np.repeat(seen, len(HEIGHTS)),
        frame=number.astype(np.int64),
        y=y.ravel(),
        Z=np.full(y.size, RADIUS),
        sigma=np.full(y.size, OUTLINE_SIGMA),
    )
    force = ForceHistory(samples, np.zeros(len(samples)), np.full(len(samples), FORCE_SIGMA))
    return observe(force, line, window=(0.0, float(seen[-1])))


def truths(
    draws: Draws, observations: Observations, *, mesh: tuple[int, int], device: str
) -> tuple[FloatArray, FloatArray]:
    """Exact forces, shape [n, n_samples], and radii at the points, shape [n, n_points].

    Raises
    ------
    ValueError
        If a run does not complete, or does not reach a point.
    """
    model = explicit.Model(
        mesh=explicit.cylinder(RADIUS, LENGTH, n_radial=mesh[0], n_axial=mesh[1], grading=2.0),
        density=DENSITY,
        materials=(marlow_from_curve(*curve()),),
        motions=(flyer(),),
        faces=draws.interface,
        side=draws.interface,
        element="fbar",
    )
    response = explicit.run(
        model,
        explicit.Samples.of(**draws.values, poisson=POISSON),
        explicit.Sampling(
            force_times=observations.force.time, surface_times=observations.frame_times, ledger_every=16
        ),
        device=device,
    )
    seen = predict(response, observations)
    if not seen.inside.all():
        raise ValueError("a point of the outline lies outside the specimen: move HEIGHTS inward")
    return seen.force, seen.Z


def experiment(
    number: int, force: FloatArray, Z: FloatArray, interface: str, rng: np.random.Generator
) -> Shot:
    """One experiment: the truth with the instruments' noise, as a shot."""
    observations = template()
    line, (frames, _) = observations.centre_line, times()
    stretch, stress = curve()
    clean = np.where(frames > 0.0, stroke(frames), 0.0)
    return Shot(
        name=f"experiment {number}",
        folder=Path(),
        specimen=Specimen(diameter=2.0 * RADIUS, length=LENGTH, density=DENSITY),
        interface=Interface(faces=interface, side=interface, friction=FRICTION),
        support="rigid",
        transmission_bar=None,
        model=ModelSettings(POISSON, DAMPING, "deviatoric", 0.0),
        force=BarForce(
            ForceHistory(
                observations.force.time,
                force + FORCE_SIGMA * rng.standard_normal(force.shape),
                observations.force.sigma,
            ),
            sigma_gain=0.0,
        ),
        curve=MaterialCurve(
            stretch=stretch,
            stress=stress * (1.0 + CURVE_SIGMA * rng.standard_normal(stress.shape)),
            sigma=CURVE_SIGMA * np.abs(stress),
        ),
        inputs={},
        flyer=FlyerMotion(
            time=frames,
            displacement=clean + FLYER_SIGMA * rng.standard_normal(clean.shape),
            sigma=np.full(len(frames), FLYER_SIGMA),
        ),
        centre_line=CentreLine(
            time=line.time,
            frame=line.frame,
            y=line.y,
            Z=Z + OUTLINE_SIGMA * rng.standard_normal(Z.shape),
            sigma=line.sigma,
        ),
        window=(0.0, float(frames[-1])),
    )
