"""A flyer in closed form: pushed, pulled by its joint, stopped by a specimen, pushed back and hit."""

from dataclasses import dataclass

import numpy as np

from kolsky.bars.records import Signal
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion

FRAME, INTERVAL = 1.0 / 120e3, 0.5e-6
SIGMA, NOISE = 1e-6, 0.4
MASS = 7.1e-3
ONSET, RISE, SPEED = 40e-6, 60e-6, 2.6


def ramp(u: FloatArray) -> FloatArray:
    """Smooth step from 0 to 1."""
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(u**3 * (10.0 - 15.0 * u + 6.0 * u**2))


@dataclass(frozen=True)
class Flight:
    """Times of a synthetic flight. A joint that pulls for `pull` reduces the speed by `loss`, linearly in
    time."""

    pull: float = 0.0
    loss: float = 0.0
    arrest: float | None = None
    impact: float | None = None
    rebound: float = 1.5  # velocity after the second impact toward the specimen [m/s]

    @property
    def full(self) -> float:
        """End of the drive [s]."""
        return ONSET + RISE

    def velocity(self, t: FloatArray) -> FloatArray:
        """Velocity toward the specimen [m/s]."""
        v = SPEED * ramp((t - ONSET) / RISE)
        if self.pull:
            v = v - self.loss * np.clip((t - self.full) / self.pull, 0.0, 1.0)
        if self.arrest is not None:
            # A specimen that stops it over 600 us and returns 80 %, antisymmetric about the arrest.
            u = (t - self.arrest) / 300e-6
            v = v - (SPEED - self.loss) * (1.0 + np.tanh(u))
        if self.impact is not None:
            back = self.velocity_before(self.impact)
            v = v + (self.rebound - back) * (t >= self.impact)
        return np.asarray(v)

    def velocity_before(self, t: float) -> float:
        """Velocity without the second impact [m/s]."""
        return float(Flight(self.pull, self.loss, self.arrest).velocity(np.array([t]))[0])

    def motion(self, seed: int, end: float, *, lag: float = 0.0) -> FlyerMotion:
        """Measurement of the cameras, with their clock late by `lag`."""
        fine = np.arange(-100e-6, end + FRAME, 1e-8)
        x = np.concatenate(
            [[0.0], np.cumsum(0.5 * (self.velocity(fine)[1:] + self.velocity(fine)[:-1])) * 1e-8]
        )
        t = -62.5e-6 + FRAME * np.arange(int((end + 62.5e-6) / FRAME))
        noise = SIGMA * np.random.default_rng(seed).standard_normal(t.size)
        return FlyerMotion(t - lag, np.interp(t, fine, x) + noise, np.full(t.size, SIGMA))

    def force(self, seed: int, end: float, *, specimen: tuple[float, float] = (0.0, 0.0)) -> Signal:
        """Force on a transducer behind `MASS`: m a + Z v + k x."""
        t = -200e-6 + INTERVAL * np.arange(round((end + 200e-6) / INTERVAL))
        h = 1e-8
        v = self.velocity(t)
        a = (self.velocity(t + h) - self.velocity(t - h)) / (2.0 * h)
        x = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1])) * INTERVAL])
        clean = MASS * a + specimen[0] * v + specimen[1] * x
        noise = NOISE * np.random.default_rng(seed + 1000).standard_normal(t.size)
        return Signal(float(t[0]), INTERVAL, clean + noise, NOISE, "N", "flyer transducer")
