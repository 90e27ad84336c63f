"""One-dimensional bars by the method of characteristics: a uniform section is a delay.

With the compressive force F and the particle velocity v to the right, F = R + L and v = (R - L) / Z: R runs
to the right and L to the left, unchanged. Between the ends of a section nothing is discretised; where
sections meet, forces and velocities agree. Only the travel times are rounded, to whole time steps.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray
from explicit.bars.sections import Section


@dataclass(frozen=True)
class LineHistory:
    """The waves in a row of bonded sections, from which force and velocity follow anywhere."""

    sections: tuple[Section, ...]
    """The sections, left to right."""
    step: float
    """Time step [s]."""
    n_times: int
    """Number of times, the first at 0 s."""
    delays: tuple[int, ...]
    """Travel time of each section [steps]."""
    right: tuple[FloatArray, ...]
    """R as it leaves the left end of each section [N], shape [delay + n_times]: entry delay + n at time n."""
    left: tuple[FloatArray, ...]
    """L as it leaves the right end of each section [N], same shape."""

    @property
    def length(self) -> float:
        """Length of all sections [m]."""
        return sum(section.length for section in self.sections)

    def force(self, depth: float) -> FloatArray:
        """Compressive force at a distance from the left end [m], in newtons, shape [n_times]."""
        right, left, _ = self._waves(depth)
        return right + left

    def velocity(self, depth: float) -> FloatArray:
        """Velocity to the right at a distance from the left end [m], in m/s, shape [n_times]."""
        right, left, impedance = self._waves(depth)
        return (right - left) / impedance

    def _waves(self, depth: float) -> tuple[FloatArray, FloatArray, float]:
        if not 0.0 <= depth <= self.length * (1.0 + 1e-12):
            raise ValueError(f"depth must be in [0, {self.length:.6g}] m, got {depth}")
        rest = depth
        for section, delay, right, left in zip(
            self.sections, self.delays, self.right, self.left, strict=True
        ):
            if rest <= section.length or section is self.sections[-1]:
                k = min(round(rest / section.length * delay), delay)
                n = self.n_times
                return right[delay - k : delay - k + n], left[k : k + n], section.impedance
            rest -= section.length
        raise AssertionError("unreachable")

    def momentum(self) -> FloatArray:
        """Momentum to the right [N s], shape [n_times]."""
        return self._in_flight(lambda right, left, _: (right - left) * self.step)

    def energy(self) -> FloatArray:
        """Kinetic and strain energy together [J], shape [n_times]."""
        return self._in_flight(lambda right, left, z: (right**2 + left**2) * (self.step / z))

    def _in_flight(self, density: Callable[[FloatArray, FloatArray, float], FloatArray]) -> FloatArray:
        total = np.zeros(self.n_times)
        for section, delay, right, left in zip(
            self.sections, self.delays, self.right, self.left, strict=True
        ):
            summed = np.concatenate([[0.0], np.cumsum(density(right, left, section.impedance))])
            total += summed[delay + 1 : delay + 1 + self.n_times] - summed[1 : 1 + self.n_times]
        return total


class WaveLine:
    """A row of bonded sections while it is integrated; `history` freezes it."""

    def __init__(
        self, sections: Sequence[Section], *, step: float, n_times: int, velocity: float = 0.0
    ) -> None:
        """Sections that move with one velocity [m/s] and carry no force.

        Raises
        ------
        ValueError
            If there is no section, or one is shorter than half the way of a wave in a step.
        """
        if not sections:
            raise ValueError("a row of bars needs at least one section, got none")
        shortest = min(section.travel_time for section in sections)
        if not 0.0 < step <= 2.0 * shortest:
            raise ValueError(f"step must be in (0, {2.0 * shortest:.3g}] s for these sections, got {step}")
        self.sections, self.step, self.n_times = tuple(sections), step, n_times
        self.impedances = [section.impedance for section in sections]
        self.delays = [max(1, round(section.travel_time / step)) for section in sections]
        self.right, self.left = [], []
        for impedance, delay in zip(self.impedances, self.delays, strict=True):
            half = 0.5 * impedance * velocity
            self.right.append([half] * delay + [0.0] * n_times)
            self.left.append([-half] * delay + [0.0] * n_times)

    def meet_inside(self, n: int) -> None:
        """Let the waves of time n pass from section to section: 2 R / Z1 + 2 L / Z2 = F (1 / Z1 + 1 / Z2)."""
        for k in range(len(self.sections) - 1):
            first, second = self.impedances[k], self.impedances[k + 1]
            right, left = self.right[k][n], self.left[k + 1][n]
            force = 2.0 * (right * second + left * first) / (first + second)
            self.left[k][self.delays[k] + n] = force - right
            self.right[k + 1][self.delays[k + 1] + n] = force - left

    def free_velocity(self, n: int, end: int) -> float:
        """Velocity of the left (0) or right (-1) end at time n if nothing acted on it [m/s]."""
        arriving = self.left[0][n] if end == 0 else self.right[-1][n]
        return (-2.0 if end == 0 else 2.0) * arriving / self.impedances[end]

    def load(self, n: int, end: int, force: float) -> float:
        """Apply a compressive force [N] to an end at time n and return the end's velocity [m/s]."""
        if end == 0:
            self.right[0][self.delays[0] + n] = force - self.left[0][n]
            return self.free_velocity(n, 0) + force / self.impedances[0]
        self.left[-1][self.delays[-1] + n] = force - self.right[-1][n]
        return self.free_velocity(n, -1) - force / self.impedances[-1]

    def history(self) -> LineHistory:
        """History up to now."""
        right, left = (tuple(np.array(wave) for wave in waves) for waves in (self.right, self.left))
        return LineHistory(self.sections, self.step, self.n_times, tuple(self.delays), right, left)


def loaded_line(sections: Sequence[Section], force: FloatArray, *, step: float) -> LineHistory:
    """Sections at rest under a compressive force on the left end, the right one free.

    Parameters
    ----------
    force : shape [n_times]
        Force at 0, `step`, 2 `step` ... [N].
    step : float
        Time step [s].
    """
    line = WaveLine(sections, step=step, n_times=len(force))
    for n, value in enumerate(force.tolist()):
        line.meet_inside(n)
        line.load(n, 0, value)
        line.load(n, -1, 0.0)
    return line.history()


def section_force(times: FloatArray, force: FloatArray, *, delay: float, round_trip: float) -> FloatArray:
    """Force inside a uniform bar with a free far end, from the one at its front.

    F(x, t) = F(t - d) + sum over k >= 1 of F(t - d - k T) - F(t + d - k T), with the travel time d = x / c0
    and the round trip T. A transducer at depth x sees the inertia of what lies before it: -2 d F'(t - T) of
    the first echo.

    Parameters
    ----------
    times, force : shape [n]
        Compressive force at the front [N] over time [s], zero before the first.
    delay : float
        Travel time from the front to the place [s], at least 0 and below half the round trip.
    round_trip : float
        Round trip of a wave through the whole bar [s].

    Raises
    ------
    ValueError
        If the delay is outside its range.
    """
    if not 0.0 <= delay < 0.5 * round_trip:
        raise ValueError(f"delay must be in [0, {0.5 * round_trip:.6g}) s, got {delay}")
    found = np.interp(times - delay, times, force, left=0.0)
    late = round_trip
    while late - delay < times[-1] - times[0]:
        found += np.interp(times - delay - late, times, force, left=0.0)
        found -= np.interp(times + delay - late, times, force, left=0.0)
        late += round_trip
    return found
