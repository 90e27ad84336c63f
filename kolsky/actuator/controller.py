r"""The closed loop: the bend that a camera measures goes into the pressure by the inverse of the model.

    s <- s + K (Theta_d - Theta_m),   p = Theta_model^-1(Theta_d + s)                           (A.3)

at every tick, with the wanted angle, the measured one and the gain K. The sum s is what the model is wrong
by and does not grow while the pressure stands at a bound. With a plant whose slope is gamma times the model's
and a measurement that is d ticks late the loop is stable for

    K gamma < 2 sin(pi / (2 (2 d + 1)))                                                        (A.4)

(the roots of z^(d+1) - z^d + K gamma lie inside the unit circle; Levin and May 1976).
"""

from dataclasses import dataclass

import numpy as np

from kolsky.actuator.reduced import ReducedActuator, ReducedBend
from kolsky.base.arrays import FloatArray

CLOSE = 1e-5
"""Difference of the model's angle from the one asked for at which the inverse ends [rad]."""
INVERSIONS = 8
"""Most steps of Newton's method in a tick."""
EQUILIBRIUM = 1e-6
"""Tolerance of the equilibria in a tick, as a share of the forces [-]."""


def largest_gain(delay: int) -> float:
    """Bound of K gamma for a delay of whole ticks, Eq. (A.4) [-]."""
    return float(2.0 * np.sin(np.pi / (2.0 * (2.0 * delay + 1.0))))


@dataclass(frozen=True)
class Tick:
    """What the controller decided."""

    pressure: float
    """Pressure [Pa], in [0, most]."""
    bounded: bool
    """Whether it stands at a bound."""
    held: bool
    """Whether the model gave none, and the last pressure was kept."""


class Controller:
    """The controller of Eq. (A.3); it holds the sum s and the last equilibrium."""

    def __init__(self, model: ReducedActuator, *, gain: float, most: float) -> None:
        if not 0.0 < gain <= 2.0:
            raise ValueError(f"gain must be in (0, 2], got {gain}")
        self.model, self.gain, self.most = model, gain, most
        self.sum = 0.0
        self.pressure = 0.0
        self._low = model.bend(0.0)
        self._high = self._highest()
        self._last: ReducedBend = self._low

    def _highest(self) -> ReducedBend:
        found = self._low
        for pressure in np.linspace(0.0, self.most, 9)[1:]:
            found = self.model.bend(float(pressure), start=found.state.q)
        return found

    def tick(self, wanted: float, measured: float) -> Tick:
        """Take a measured angle and give the pressure for the wanted one; both in rad."""
        error = wanted - measured
        asked = wanted + self.sum + self.gain * error
        bounded = not self._low.angle <= asked <= self._high.angle
        outward = (asked > self._high.angle and error > 0.0) or (asked < self._low.angle and error < 0.0)
        if not outward:
            self.sum += self.gain * error
        if bounded:
            above = asked > self._high.angle
            self._last = self._high if above else self._low
            self.pressure = self.most if above else 0.0
            return Tick(self.pressure, True, False)
        found = self._inverse(asked)
        return Tick(self.pressure, False, not found)

    def _inverse(self, asked: float) -> bool:
        """Newton's method for the pressure from the last one; False where it ends nowhere."""
        pressure, near = self.pressure, self._last
        for _ in range(INVERSIONS):
            left = asked - near.angle
            if abs(left) <= CLOSE:
                self.pressure, self._last = pressure, near
                return True
            if not near.slope > 0.0:
                return False
            following = float(np.clip(pressure + left / near.slope, 0.0, self.most))
            # the path goes on along dq/dp
            start = near.state.q + near.state.slopes[:, 0] * (following - pressure)
            near = self.model.bend(following, start=start, tolerance=EQUILIBRIUM)
            pressure = following
            if not near.ok:
                return False
        return False


@dataclass(frozen=True)
class Plant:
    """A simulated actuator with its pressure supply and camera."""

    pressure: FloatArray
    """Pressures [Pa], rising, shape [n]."""
    angle: FloatArray
    """Angle of the whole model with the plant's own stiffness there [rad], shape [n]."""
    lag: float
    """Time constant of the pressure [s]."""
    delay: int
    """Ticks by which the camera is late."""
    noise: float
    """Standard deviation of a measured angle [rad]."""
