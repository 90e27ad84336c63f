"""The flyer's true motion: a smooth ramp, or one that was sampled."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.virtual.schema import MotionTable

LONGEST = 0.1
"""Longest record [s]."""


class Path1D(Protocol):
    """A displacement toward the specimen and its velocity, from a start on."""

    start: float
    """When it starts, on the shot's clock [s]."""

    def displacement(self, time: FloatArray) -> FloatArray:
        """Displacement toward the specimen [m], of the time's shape; 0 before the start."""
        ...

    def velocity(self, time: FloatArray) -> FloatArray:
        """Its time derivative [m/s], of the time's shape."""
        ...


@dataclass(frozen=True)
class Ramp:
    """A smooth ramp to a speed, of which a share is then lost as the square of time, Eq. (E.1)."""

    start: float
    """When it starts [s]."""
    speed: float
    """[m/s]"""
    rise: float
    """Time of the ramp [s]."""
    slowdown: float = 0.0
    """Share of the speed lost after `over` [-]."""
    over: float = 1.0
    """Time after the ramp in which it is lost [s]."""

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


def ramp_of(motion: MotionTable, length: float) -> tuple[Ramp, float]:
    """The ramp of [motion] on a specimen of some length [m], and the time from start to end [s].

    The end is where the nominal compression is reached: with T after the ramp, Eq. (E.2),
    speed (rise / 2 + T (1 - slowdown / 3)) = compression x length.

    Raises
    ------
    ValueError
        If the compression is reached before the ramp ends, or the record would be longer than `LONGEST`.
    """
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
