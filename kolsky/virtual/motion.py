"""The flyer's true motion (Mates et al. 2012).

It is a smooth ramp, a sampled motion, or that of the whole apparatus.
"""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicSpline

from explicit.bars import Apparatus, Joint, PulseShaper, Section
from explicit.bars.lines import SpecimenForce, integrate_test
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.readers.table import Column, read_table
from kolsky.virtual.schema import MotionTable, Specification

RADIUS = 7.5e-3
"""Radius of striker and bars [m]."""
YOUNG, STEEL = 190e9, 8048.0
"""Maraging steel [Pa], [kg/m^3]."""
_BAR_LENGTH = 1.5
"""Length of the incident and of the transmission bar [m]."""
SHAPER = (5.5e-3, 2e-3, 40e6)
"""Diameter and height [m] and shear modulus [Pa] of the rubber disc, as in the verification of the impact."""
JOINT = (100.0, 20e-6)
"""Strength [N] and opening [m] of the adhesive."""
STEP = 1e-7
"""Time step of the bars [s]."""
MOVES = 1e-9
"""Displacement that defines the start of the flyer [m]."""
EVERY = 5
"""Number of steps between two samples of the motion."""


@lru_cache(maxsize=64)
def flyer_samples(
    *,
    speed: float,
    striker_length: float,
    flyer: tuple[float, float, float],
    specimen: tuple[float, float, float],
    duration: float,
) -> tuple[FloatArray, FloatArray]:
    """Time since the flyer's start [s] and its displacement toward the specimen [m], shape [n] each."""
    mass, diameter, length = flyer
    area = np.pi * diameter**2 / 4.0
    body = Section(length, 0.5 * diameter, YOUNG, mass / (area * length))
    bar = Section(_BAR_LENGTH, RADIUS, YOUNG, STEEL)
    apparatus = Apparatus(
        striker=(Section(striker_length, RADIUS, YOUNG, STEEL),),
        speed=speed,
        shaper=disc(*SHAPER),
        incident=(bar,),
        joint=Joint(*JOINT),
        flyer=(body,),
        transmission=(bar,),
    )
    end = duration + 2.0 * _BAR_LENGTH / bar.wave_speed
    n = round(end / STEP) + 1
    resisting = SpecimenForce(*static_curve(*specimen), np.zeros(n), np.zeros(n))
    history = integrate_test(apparatus, end=end, step=STEP, specimen=resisting)
    started = int(np.argmax(history.flyer_path > MOVES))
    keep = slice(max(started - 1, 0), None, EVERY)
    time, path = history.times[keep], history.flyer_path[keep]
    return time - time[0], path - path[0]


def static_curve(diameter: float, length: float, modulus: float) -> tuple[FloatArray, FloatArray]:
    """Approximate compression [m] and force [N] of a bonded neo-Hookean cylinder. A flat cylinder is
    stiffer."""
    stretch = np.linspace(1.0, 0.04, 300)
    area = np.pi * diameter**2 / 4.0
    flat = 1.0 + 0.5 * (0.25 * diameter / length) ** 2 / stretch**3
    return length * (1.0 - stretch), modulus * area * (stretch**-2 - stretch) * flat


def disc(diameter: float, height: float, shear_modulus: float) -> PulseShaper:
    """A neo-Hookean disc that slides on the steel: F = mu A (lam^-2 - lam), down to a stretch of 0.2.

    ``diameter``, ``height``: before the test [m]. ``shear_modulus``: at the rate of the test [Pa].
    """
    stretch = np.linspace(1.0, 0.2, 161)
    force = shear_modulus * np.pi * (0.5 * diameter) ** 2 * (stretch**-2 - stretch)
    return loading(height * (1.0 - stretch), force)


def loading(compression: FloatArray, force: FloatArray, unloading: float | None = None) -> PulseShaper:
    """A law from its loading curve. It unloads along its steepest slope unless one is given [N/m]."""
    steepest = float((np.diff(force) / np.diff(compression)).max())
    return PulseShaper(compression, force, steepest if unloading is None else unloading)


_BARS_DURATION = 1.6e-3
"""Default integration time of the whole apparatus [s], beginning at the flyer's start."""
LONGEST = 0.1
"""Longest record [s]."""


class Path1D(Protocol):
    """A displacement toward the specimen and its velocity. Both begin at a start time."""

    @property
    def start(self) -> float:
        """Its start on the shot's clock [s]."""
        ...

    def displacement(self, time: FloatArray) -> FloatArray:
        """Displacement toward the specimen [m], of the time's shape; 0 before the start."""
        ...

    def velocity(self, time: FloatArray) -> FloatArray:
        """Its time derivative [m/s], of the time's shape."""
        ...


@dataclass(frozen=True)
class Ramp:
    """A smooth ramp to a speed, followed by a slowdown with the square of time, Eq. (E.1)."""

    start: float
    """Start time [s]."""
    speed: float
    """Final speed [m/s]."""
    rise: float
    """Time of the ramp [s]."""
    slowdown: float = 0.0
    """Share of the speed that is lost after `over` [-]."""
    over: float = 1.0
    """Duration of the slowdown after the ramp [s]."""

    def displacement(self, time: FloatArray) -> FloatArray:
        """See `Path1D`."""
        t = np.maximum(np.asarray(time) - self.start, 0.0)
        s = np.minimum(t / self.rise, 1.0)
        after = np.maximum(t - self.rise, 0.0)
        ramp = self.rise * (2.5 * s**4 - 3.0 * s**5 + s**6) + after
        return np.asarray(self.speed * (ramp - self.slowdown * after**3 / (3.0 * self.over**2)))

    def velocity(self, time: FloatArray) -> FloatArray:
        """See `Path1D`."""
        t = np.maximum(np.asarray(time) - self.start, 0.0)
        s = np.minimum(t / self.rise, 1.0)
        after = np.maximum(t - self.rise, 0.0)
        ramp = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        return np.asarray(self.speed * (ramp - self.slowdown * (after / self.over) ** 2))


@dataclass(frozen=True)
class Sampled:
    """A motion through samples with cubic interpolation. It is at rest before, and has constant speed after
    the end."""

    start: float
    """Start time [s]."""
    spline: CubicSpline
    """Displacement [m] of the time since the start [s]."""

    @property
    def length(self) -> float:
        """Time that the samples cover [s]."""
        return float(self.spline.x[-1])

    @classmethod
    def of(cls, start: float, time: FloatArray, displacement: FloatArray) -> "Sampled":
        """The motion through samples [s], [m], shape [n] each; both are counted from the first sample."""
        rest = ((1, 0.0), "not-a-knot")
        return cls(start, CubicSpline(time - time[0], displacement - displacement[0], bc_type=rest))

    def displacement(self, time: FloatArray) -> FloatArray:
        """See `Path1D`."""
        t = np.asarray(time) - self.start
        past = np.maximum(t - self.length, 0.0) * float(self.spline(self.length, 1))
        return np.asarray(self.spline(np.clip(t, 0.0, self.length)) + past)

    def velocity(self, time: FloatArray) -> FloatArray:
        """See `Path1D`."""
        t = np.asarray(time) - self.start
        return np.asarray(np.where(t < 0.0, 0.0, self.spline(np.clip(t, 0.0, self.length), 1)))


def path_of(quantities: Specification, folder: Path) -> tuple[Path1D, float]:
    """The flyer's motion, and the time from its start to the end of the record [s]."""
    motion, length = quantities.motion, quantities.specimen.length
    if motion.kind == "ramp":
        return ramp_of(motion, length)
    if motion.kind == "bars":
        material = quantities.material
        time, displacement = flyer_samples(
            speed=motion.speed,
            striker_length=motion.striker_length,
            flyer=(motion.flyer_mass, motion.flyer_diameter, motion.flyer_length),
            specimen=(
                quantities.specimen.diameter,
                length,
                material.stiffness_factor * material.shear_modulus,
            ),
            duration=motion.duration or _BARS_DURATION,
        )
    else:
        time, displacement = _read_samples(folder / (motion.file or ""))
    path = Sampled.of(motion.start, time, displacement)
    reached = np.flatnonzero(displacement - displacement[0] >= motion.compression * length)
    end = float(time[reached[0]] - time[0]) if reached.size else path.length
    return path, end if motion.duration is None else min(end, motion.duration)


def _read_samples(path: Path) -> tuple[FloatArray, FloatArray]:
    """Times [s] and displacements [m] of a sampled motion."""
    table = read_table(path)
    time, displacement = table.values(Column("time (s)")), table.values(Column("displacement (m)"))
    if len(time) < 4 or (np.diff(time) <= 0.0).any():
        raise InputError(
            path,
            "needs four samples or more, at ascending times",
            key="motion.file",
            cure="give the path at four times or more, ascending",
        )
    return time, displacement


def ramp_of(motion: MotionTable, length: float) -> tuple[Ramp, float]:
    """The ramp of [motion] for a specimen of given length [m], and the time from start to end [s]. The end is
    the time at which the nominal compression is reached. With T after the ramp, Eq. (E.2), speed (rise / 2 +
    T (1 - slowdown / 3)) = compression x length."""
    after = (motion.compression * length / motion.speed - 0.5 * motion.rise) / (1.0 - motion.slowdown / 3.0)
    if not 0.0 < after < LONGEST:
        raise ValueError(
            f"a flyer of {motion.speed:g} m/s that takes {motion.rise * 1e6:g} us to get there compresses a "
            f"specimen of {length * 1e3:g} mm by {motion.compression:.0%} {after * 1e6:.4g} us later, which "
            f"must be above 0 and below {LONGEST:g} s"
        )
    end = motion.rise + after
    ramp = Ramp(motion.start, motion.speed, motion.rise, motion.slowdown, after)
    return ramp, end if motion.duration is None else min(end, motion.duration)
