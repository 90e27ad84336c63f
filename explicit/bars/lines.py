"""One-dimensional bars by the method of characteristics, and the whole impact test made of them.

With the compressive force F and the particle velocity v to the right, F = R + L and v = (R - L) / Z. R
travels to the right and L to the left, unchanged. A section has no nodes between its ends. At the interfaces
of sections forces and velocities are continuous. Only the travel times are rounded, to whole time steps.

The test has a striker, a pulse shaper, an incident bar, a joint that may break, a flyer and a transmission
side. Its events are features of the signals (Mates et al. 2012, Fig. 5).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from explicit.arrays import FloatArray


@dataclass(frozen=True)
class Section:
    """A round section with one radius and one material."""

    length: float
    """Length along the axis [m]."""
    radius: float
    """Radius [m]."""
    youngs_modulus: float
    """Young's modulus E [Pa]."""
    density: float
    """Mass density rho [kg/m^3]."""
    poisson: float = 0.29
    """Poisson's ratio [-]; not used by one-dimensional waves."""

    def __post_init__(self) -> None:
        for name in ("length", "radius", "youngs_modulus", "density"):
            value = getattr(self, name)
            if not (value > 0.0 and isfinite(value)):
                raise ValueError(f"{name} of a section must be > 0 and finite, got {value}")
        if not -1.0 < self.poisson < 0.5:
            raise ValueError(f"poisson of a section must be in (-1, 0.5), got {self.poisson}")

    @property
    def area(self) -> float:
        """Cross-section A [m^2]."""
        return pi * self.radius**2

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return self.density * self.area * self.length

    @property
    def wave_speed(self) -> float:
        """Bar wave speed c0 = sqrt(E / rho) [m/s]."""
        return sqrt(self.youngs_modulus / self.density)

    @property
    def impedance(self) -> float:
        """Force per particle velocity Z = rho c0 A [N s/m]."""
        return self.density * self.wave_speed * self.area

    @property
    def travel_time(self) -> float:
        """Time of a wave from one end to the other, L / c0 [s]."""
        return self.length / self.wave_speed


@dataclass(frozen=True)
class LineHistory:
    """The waves in a row of bonded sections. They give force and velocity at any position."""

    sections: tuple[Section, ...]
    """The sections, left to right."""
    step: float
    """Time step [s]."""
    n_times: int
    """Number of times, the first at 0 s."""
    delays: tuple[int, ...]
    """Travel time of each section [steps]."""
    right: tuple[FloatArray, ...]
    """R at the left end of each section [N], shape [delay + n_times]: entry delay + n at time n."""
    left: tuple[FloatArray, ...]
    """L at the right end of each section [N], same shape."""

    @property
    def length(self) -> float:
        """Length of all sections [m]."""
        return sum(section.length for section in self.sections)

    def force(self, depth: float) -> FloatArray:
        """Compressive force at a distance from the left end [m], in newtons, shape [n_times]."""
        rightward, leftward, _ = self._waves(depth)
        return rightward + leftward

    def velocity(self, depth: float) -> FloatArray:
        """Velocity to the right at a distance from the left end [m], in m/s, shape [n_times]."""
        rightward, leftward, impedance = self._waves(depth)
        return (rightward - leftward) / impedance

    def _waves(self, depth: float) -> tuple[FloatArray, FloatArray, float]:
        if not 0.0 <= depth <= self.length * (1.0 + 1e-12):
            raise ValueError(f"depth must be in [0, {self.length:.6g}] m, got {depth}")
        distance = depth
        for section, delay, rightward, leftward in zip(
            self.sections, self.delays, self.right, self.left, strict=True
        ):
            if distance <= section.length or section is self.sections[-1]:
                k = min(round(distance / section.length * delay), delay)
                n = self.n_times
                return rightward[delay - k : delay - k + n], leftward[k : k + n], section.impedance
            distance -= section.length
        raise AssertionError("unreachable")

    def momentum(self) -> FloatArray:
        """Momentum to the right [N s], shape [n_times]."""
        return self._in_flight(lambda right, left, _: (right - left) * self.step)

    def energy(self) -> FloatArray:
        """Kinetic and strain energy together [J], shape [n_times]."""
        return self._in_flight(lambda right, left, z: (right**2 + left**2) * (self.step / z))

    def _in_flight(self, density: Callable[[FloatArray, FloatArray, float], FloatArray]) -> FloatArray:
        total = np.zeros(self.n_times)
        for section, delay, rightward, leftward in zip(
            self.sections, self.delays, self.right, self.left, strict=True
        ):
            summed = np.concatenate([[0.0], np.cumsum(density(rightward, leftward, section.impedance))])
            total += summed[delay + 1 : delay + 1 + self.n_times] - summed[1 : 1 + self.n_times]
        return total


class WaveLine:
    """A row of bonded sections during the integration; `history` returns a copy."""

    def __init__(
        self, sections: Sequence[Section], *, step: float, n_times: int, velocity: float = 0.0
    ) -> None:
        """Sections with a common velocity [m/s] and without force.

        Raises ValueError if there is no section, or if one is shorter than half the travel of a wave in a
        step.
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
        """Transmit the waves of time n between the sections: 2 R / Z1 + 2 L / Z2 = F (1 / Z1 + 1 / Z2)."""
        for k in range(len(self.sections) - 1):
            first, second = self.impedances[k], self.impedances[k + 1]
            rightward, leftward = self.right[k][n], self.left[k + 1][n]
            force = 2.0 * (rightward * second + leftward * first) / (first + second)
            self.left[k][self.delays[k] + n] = force - rightward
            self.right[k + 1][self.delays[k + 1] + n] = force - leftward

    def free_velocity(self, n: int, end: int) -> float:
        """Velocity of the left (0) or right (-1) end at time n without a force on it [m/s]."""
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
        """History up to the present time."""
        rightward, leftward = (tuple(np.array(wave) for wave in waves) for waves in (self.right, self.left))
        return LineHistory(self.sections, self.step, self.n_times, tuple(self.delays), rightward, leftward)


def loaded_line(sections: Sequence[Section], force: FloatArray, *, step: float) -> LineHistory:
    """Sections at rest under a compressive force on the left end. The right end is free.

    ``force``: force at 0, `step`, 2 `step` ... [N]. ``step``: time step [s].
    """
    line = WaveLine(sections, step=step, n_times=len(force))
    for n, value in enumerate(force.tolist()):
        line.meet_inside(n)
        line.load(n, 0, value)
        line.load(n, -1, 0.0)
    return line.history()


def section_force(times: FloatArray, force: FloatArray, *, delay: float, round_trip: float) -> FloatArray:
    """Force inside a uniform bar with a free far end, from the force at its front.

    F(x, t) = F(t - d) + sum over k >= 1 of F(t - d - k T) - F(t + d - k T), with the travel time d = x / c0
    and the round trip T. The signal of a transducer at depth x contains the inertia of the material in front
    of it. For the first echo this is -2 d F'(t - T).

    Parameters
    ----------
    times, force : shape [n]
        Compressive force at the front [N] over time [s]. It is zero before the first time.
    delay : float
        Travel time from the front to the position [s], at least 0 and below half the round trip.
    round_trip : float
        Round trip of a wave through the whole bar [s].

    Raises
    ------
    ValueError
        If the delay is outside its range.
    """
    if not 0.0 <= delay < 0.5 * round_trip:
        raise ValueError(f"delay must be in [0, {0.5 * round_trip:.6g}) s, got {delay}")
    total = np.interp(times - delay, times, force, left=0.0)
    late = round_trip
    while late - delay < times[-1] - times[0]:
        total += np.interp(times - delay - late, times, force, left=0.0)
        total -= np.interp(times + delay - late, times, force, left=0.0)
        late += round_trip
    return total


@dataclass(frozen=True)
class PulseShaper:
    """A soft disc between striker and incident bar. It loads along a table and unloads along a straight
    line."""

    compression: FloatArray
    """Approach of its faces [m], ascending from 0, shape [n]. Beyond the last datum the last slope is
    used."""
    force: FloatArray
    """Compressive force while loading [N], ascending from 0, shape [n]."""
    unloading: float
    """Slope of unloading and reloading [N/m], not below the table's largest slope."""

    def __post_init__(self) -> None:
        x, f = np.asarray(self.compression), np.asarray(self.force)
        if x.ndim != 1 or x.shape != f.shape or len(x) < 2 or x[0] != 0.0 or f[0] != 0.0:
            raise ValueError("a pulse shaper needs compression and force of equal length >= 2, both from 0")
        if not ((np.diff(x) > 0.0).all() and (np.diff(f) > 0.0).all()):
            raise ValueError("compression and force of a pulse shaper must ascend strictly")
        steepest = float((np.diff(f) / np.diff(x)).max())
        if not steepest * (1.0 - 1e-12) <= self.unloading < np.inf:
            raise ValueError(f"unloading must be >= {steepest:.6g} N/m and finite, got {self.unloading}")


@dataclass(frozen=True)
class Joint:
    """A low-tack adhesive between two faces. It fails permanently when its strength is reached."""

    strength: float
    """Tensile force at which it begins to fail [N]; 0: no adhesive."""
    opening: float = 0.0
    """Opening over which its force falls linearly to zero [m]; 0: immediately."""

    def __post_init__(self) -> None:
        if not self.strength >= 0.0 or not self.opening >= 0.0:
            raise ValueError(
                f"strength and opening of a joint must be >= 0, got {self.strength} N and {self.opening} m"
            )


class _ShaperContact:
    """State of a pulse shaper during a run. The faces touch at first and may separate and touch again."""

    def __init__(self, shaper: PulseShaper, step: float) -> None:
        """A shaper that has not been loaded."""
        x, f = shaper.compression, shaper.force
        last = float((f[-1] - f[-2]) / (x[-1] - x[-2]))
        self._x = np.append(x, x[-1] + 1.0)
        self._f = np.append(f, f[-1] + last)
        self._unloading, self._step = shaper.unloading, step
        self._most_x = self._most_f = 0.0
        self._knots_x, self._knots_f = self._curve()
        self.approach, self._closing = 0.0, 0.0

    def _curve(self) -> tuple[FloatArray, FloatArray]:
        """Force over approach from the present state: zero, reloading, then the table."""
        beyond = self._x > self._most_x
        set_left = self._most_x - self._most_f / self._unloading
        x, f = [set_left - 1.0, set_left], [0.0, 0.0]
        if self._most_f > 0.0:
            x, f = [*x, self._most_x], [*f, self._most_f]
        return np.array([*x, *self._x[beyond]]), np.array([*f, *self._f[beyond]])

    def force(self, closing: float, compliance: float) -> float:
        """Force at the end of a step [N]."""
        # Trapezoidal rule: x = x0 + h/2 (c0 + closing - F(x) compliance), piecewise linear and increasing in
        # x.
        half = 0.5 * self._step
        excess = self._knots_x - self.approach - half * (self._closing + closing - compliance * self._knots_f)
        self.approach = float(np.interp(0.0, excess, self._knots_x))
        force = float(np.interp(self.approach, self._knots_x, self._knots_f))
        self._closing = closing - compliance * force
        if self.approach > self._most_x:
            self._most_x, self._most_f = self.approach, force
            self._knots_x, self._knots_f = self._curve()
        return force


class _JointContact:
    """State of two faces that touch at first. A joint bonds them, or they are only pressed together."""

    def __init__(self, joint: Joint, step: float) -> None:
        """A joint that holds, if it has any strength."""
        self._joint, self._step, self._sticky = joint, step, joint.opening > 0.0
        self.broken = joint.strength == 0.0
        self.gap = 0.0

    def force(self, closing: float, compliance: float) -> float:
        """Compressive force at the end of a step [N]; arguments as for `ShaperContact.force`."""
        holding = closing / compliance  # force for equal velocities of the faces
        if not self.broken:
            if holding >= -self._joint.strength:
                return holding
            self.broken = True
        # Backward Euler: a face that would pass through the other one is moved onto it within the step.
        force = (closing - self.gap / self._step) / compliance
        if force < 0.0:
            force = self._adhesion(closing, compliance)
        else:
            self._sticky = False  # a broken joint does not heal
        self.gap = max(self.gap - self._step * (closing - compliance * force), 0.0)
        return force

    def _adhesion(self, closing: float, compliance: float) -> float:
        """Stress left in the joint at its gap: -S (1 - gap / opening), solved together with the gap."""
        strength, opening = self._joint.strength, self._joint.opening
        if not self._sticky or self.gap >= opening:
            return 0.0
        slope = strength / opening
        free = self.gap - self._step * closing
        force = (slope * free - strength) / (1.0 - slope * self._step * compliance)
        return min(force, 0.0)


@dataclass(frozen=True)
class Apparatus:
    """Striker, bars, flyer and specimen, left to right."""

    striker: tuple[Section, ...]
    speed: float
    """Its velocity at impact [m/s]."""
    shaper: PulseShaper | None
    """Pulse shaper between striker and incident bar; None if there is none."""
    incident: tuple[Section, ...]
    joint: Joint
    """Joint between flyer and incident bar."""
    flyer: tuple[Section, ...]
    """Transducer and platen, the specimen's side last."""
    transmission: tuple[Section, ...]
    """Platen, transducer and bar behind the specimen, the specimen's side first."""

    def __post_init__(self) -> None:
        if not 0.0 < self.speed < np.inf:
            raise ValueError(f"speed of the striker must be > 0 m/s and finite, got {self.speed}")


@dataclass(frozen=True)
class SpecimenForce:
    """Force of the specimen on both platens: a static curve plus a time-dependent difference."""

    compression: FloatArray
    """Approach of the platens [m], ascending, shape [n]."""
    force: FloatArray
    """Compressive force there [N], shape [n]; linear between, constant outside."""
    excess_flyer: FloatArray
    """Added to the force on the flyer at every step [N], shape [n_times]."""
    excess_transmission: FloatArray
    """Added to the force on the transmission platen at every step [N], shape [n_times]."""


@dataclass(frozen=True)
class FlightHistory:
    """Motion and force of every part, at every step from the impact of the striker on."""

    times: FloatArray
    """Times since the striker's impact [s], shape [n_times]."""
    striker: LineHistory
    """Waves in the striker."""
    incident: LineHistory
    """Waves in the incident bar."""
    flyer: LineHistory
    """Waves in the flyer."""
    transmission: LineHistory
    """Waves on the transmission side."""
    shaper_force: FloatArray
    """Compressive force between striker and incident bar [N], shape [n_times]."""
    shaper_approach: FloatArray
    """Approach of the faces there [m], shape [n_times]; a gap is negative."""
    joint_force: FloatArray
    """Compressive force between incident bar and flyer [N], shape [n_times]; tension is negative."""
    joint_gap: FloatArray
    """Gap there [m], shape [n_times]."""
    force_flyer: FloatArray
    """Force of the flyer on the specimen [N], shape [n_times]."""
    force_transmission: FloatArray
    """Force of the specimen on the transmission platen [N], shape [n_times]."""
    flyer_path: FloatArray
    """Displacement of the flyer's face toward the specimen [m], shape [n_times]."""
    flyer_velocity: FloatArray
    """Its velocity [m/s], shape [n_times]."""
    support_path: FloatArray
    """Displacement of the transmission platen's face, away from the specimen [m], shape [n_times]."""
    support_velocity: FloatArray
    """Its velocity [m/s], shape [n_times]."""

    @property
    def compression(self) -> FloatArray:
        """Approach of the platens [m], shape [n_times]."""
        return self.flyer_path - self.support_path


def integrate_test(
    apparatus: Apparatus, *, end: float, step: float, specimen: SpecimenForce | None = None
) -> FlightHistory:
    """Integrate the bars in time from the striker's impact.

    Parameters
    ----------
    apparatus
        The bars, the pulse shaper and the joint.
    end : float
        Last time [s].
    step : float
        Time step [s]; travel times of the sections are rounded to it.
    specimen : SpecimenForce, optional
        Force of the specimen; none if left out.

    Raises
    ------
    ValueError
        If the step is too long for a section, or the specimen's excess does not fit the steps.
    """
    n_times = round(end / step) + 1
    striker = WaveLine(apparatus.striker, step=step, n_times=n_times, velocity=apparatus.speed)
    incident, flyer, transmission = (
        WaveLine(sections, step=step, n_times=n_times)
        for sections in (apparatus.incident, apparatus.flyer, apparatus.transmission)
    )
    lines = (striker, incident, flyer, transmission)
    direct = _JointContact(Joint(0.0), step)
    shaper = direct if apparatus.shaper is None else _ShaperContact(apparatus.shaper, step)
    joint = _JointContact(apparatus.joint, step)
    first = 1.0 / striker.impedances[-1] + 1.0 / incident.impedances[0]
    second = 1.0 / incident.impedances[-1] + 1.0 / flyer.impedances[0]
    if specimen is not None and not (
        len(specimen.excess_flyer) == len(specimen.excess_transmission) == n_times
    ):
        raise ValueError(f"the specimen's excess needs one value at each of {n_times} steps")
    record = np.zeros((10, n_times))
    x_f = v_f = x_t = v_t = 0.0
    for n in range(n_times):
        for line in lines:
            line.meet_inside(n)
        push = shaper.force(striker.free_velocity(n, -1) - incident.free_velocity(n, 0), first)
        hold = joint.force(incident.free_velocity(n, -1) - flyer.free_velocity(n, 0), second)
        on_flyer = on_support = 0.0
        if specimen is not None:
            # The static curve is evaluated at the positions of this step to first order, because the specimen
            # is much softer than steel.
            static = float(np.interp(x_f - x_t + step * (v_f - v_t), specimen.compression, specimen.force))
            on_flyer = static + specimen.excess_flyer[n]
            on_support = static + specimen.excess_transmission[n]
        striker.load(n, 0, 0.0)
        striker.load(n, -1, push)
        incident.load(n, 0, push)
        incident.load(n, -1, hold)
        flyer.load(n, 0, hold)
        transmission.load(n, -1, 0.0)
        before_f, before_t = v_f, v_t
        v_f, v_t = flyer.load(n, -1, on_flyer), transmission.load(n, 0, on_support)
        if n:
            x_f += 0.5 * step * (before_f + v_f)
            x_t += 0.5 * step * (before_t + v_t)
        approach = -shaper.gap if isinstance(shaper, _JointContact) else shaper.approach
        record[:, n] = push, approach, hold, joint.gap, on_flyer, on_support, x_f, v_f, x_t, v_t
    times = step * np.arange(n_times, dtype=np.float64)
    waves = [line.history() for line in lines]
    return FlightHistory(times, waves[0], waves[1], waves[2], waves[3], *record)


@dataclass(frozen=True)
class Events:
    """Times since the striker's impact [s]; NaN for events that did not occur before the end."""

    striker_parts: float
    """The striker separates permanently from the incident bar."""
    incident_rise: float
    """The compressive wave arrives: 1 % of the largest force on the joint before it opens."""
    tensile_dip: float
    """The joint's force becomes tensile."""
    separation: float
    """The joint has broken and its force is zero."""
    arrest: float
    """The flyer is at rest relative to the transmission platen: largest compression."""
    push_back: float
    """The specimen pushes the flyer back: after the arrest the transmitted force falls to half its peak."""
    second_impact: float
    """The flyer runs into the incident bar."""


def find_events(history: FlightHistory) -> Events:
    """Find the features of a flyer test in its signals."""
    t, hold, gap = history.times, history.joint_force, history.joint_gap
    opens = _first(gap > 0.0)
    peak = float(hold[:opens].max(initial=0.0))
    rise = _first(hold >= 0.01 * peak) if peak > 0.0 else None
    dip = _first(hold < 0.0, rise)
    apart = _first((hold == 0.0) & (gap > 0.0), dip)
    recontact = _first((gap == 0.0) & (hold > 0.0), apart)
    arrest = _summit(history.compression, apart, recontact)
    force = history.force_transmission[: len(t) if recontact is None else recontact]
    back = _first(force <= 0.5 * force.max(initial=0.0), arrest)
    pressed = np.flatnonzero(history.shaper_force > 0.0)
    parts = int(pressed[-1]) + 1 if pressed.size and pressed[-1] + 1 < len(t) else None

    def at(index: int | None) -> float:
        return float("nan") if index is None else float(t[index])

    return Events(at(parts), at(rise), at(dip), at(apart), at(arrest), at(back), at(recontact))


def _summit(signal: FloatArray, after: int | None, before: int | None) -> int | None:
    """Index of the largest value in a range; None if the signal still rises at its end."""
    if after is None:
        return None
    part = signal[after:before]
    top = int(np.argmax(part))
    return None if top == len(part) - 1 else after + top


def _first(happens: NDArray[np.bool_], after: int | None = 0) -> int | None:
    """First index from `after` on that meets the condition; None without one, or if `after` is missing."""
    if after is None:
        return None
    places = np.flatnonzero(happens[after:])
    return after + int(places[0]) if places.size else None
