"""The flyer's true motion: a smooth ramp, or a sampled motion such as that of `kolsky predict`."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.readers.table import Column, read_table
from kolsky.virtual.schema import MotionTable, Specification

MOVES = 1e-9
"""Displacement that defines the start of the flyer [m]."""
LONGEST = 0.1
"""Longest record [s]."""


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
        """Displacement toward the specimen [m], of the time's shape; 0 before the start."""
        t = np.maximum(np.asarray(time) - self.start, 0.0)
        s = np.minimum(t / self.rise, 1.0)
        after = np.maximum(t - self.rise, 0.0)
        ramp = self.rise * (2.5 * s**4 - 3.0 * s**5 + s**6) + after
        return np.asarray(self.speed * (ramp - self.slowdown * after**3 / (3.0 * self.over**2)))

    def velocity(self, time: FloatArray) -> FloatArray:
        """Its time derivative [m/s], of the time's shape."""
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
        """See `Ramp`."""
        t = np.asarray(time) - self.start
        past = np.maximum(t - self.length, 0.0) * float(self.spline(self.length, 1))
        return np.asarray(self.spline(np.clip(t, 0.0, self.length)) + past)

    def velocity(self, time: FloatArray) -> FloatArray:
        """See `Ramp`."""
        t = np.asarray(time) - self.start
        return np.asarray(np.where(t < 0.0, 0.0, self.spline(np.clip(t, 0.0, self.length), 1)))


Path1D = Ramp | Sampled


def path_of(quantities: Specification, folder: Path) -> tuple[Path1D, float]:
    """The flyer's motion, and the time from its start to the end of the record [s]."""
    motion, length = quantities.motion, quantities.specimen.length
    if motion.kind == "ramp":
        return ramp_of(motion, length)
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
