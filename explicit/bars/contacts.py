"""Contacts of two bars: through a pulse shaper, face to face, or in a joint that breaks."""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray


@dataclass(frozen=True)
class PulseShaper:
    """A soft disc between striker and incident bar: loads along a table, unloads along a straight line."""

    compression: FloatArray
    """Approach of its faces [m], ascending from 0, shape [n]; past the last datum the last slope holds."""
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
    """A low-tack adhesive between two faces: holds until its strength is reached, then lets go for good."""

    strength: float
    """Tensile force at which it begins to fail [N]; 0 is no adhesive."""
    opening: float = 0.0
    """Opening over which its force falls to nothing, along a straight line [m]; 0 is at once."""

    def __post_init__(self) -> None:
        if not self.strength >= 0.0 or not self.opening >= 0.0:
            raise ValueError(
                f"strength and opening of a joint must be >= 0, got {self.strength} N and {self.opening} m"
            )


class ShaperContact:
    """State of a pulse shaper during a run; the faces touch at first and may part and meet again."""

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
        """Force over approach from here on: nothing, reloading, then the table."""
        beyond = self._x > self._most_x
        set_left = self._most_x - self._most_f / self._unloading
        x, f = [set_left - 1.0, set_left], [0.0, 0.0]
        if self._most_f > 0.0:
            x, f = [*x, self._most_x], [*f, self._most_f]
        return np.array([*x, *self._x[beyond]]), np.array([*f, *self._f[beyond]])

    def force(self, closing: float, compliance: float) -> float:
        """Force at the end of a step [N].

        Parameters
        ----------
        closing : float
            Closing speed of the faces if no force acted [m/s].
        compliance : float
            1 / Z1 + 1 / Z2 of the bars that meet [m/(N s)]: what a force takes from the closing speed.
        """
        # Trapezoidal rule: x = x0 + h/2 (c0 + closing - F(x) compliance), piecewise linear and rising in x.
        half = 0.5 * self._step
        excess = self._knots_x - self.approach - half * (self._closing + closing - compliance * self._knots_f)
        self.approach = float(np.interp(0.0, excess, self._knots_x))
        force = float(np.interp(self.approach, self._knots_x, self._knots_f))
        self._closing = closing - compliance * force
        if self.approach > self._most_x:
            self._most_x, self._most_f = self.approach, force
            self._knots_x, self._knots_f = self._curve()
        return force


class JointContact:
    """State of two faces that touch at first, bonded by a joint or only pressed together."""

    def __init__(self, joint: Joint, step: float) -> None:
        """A joint that holds, if it has any strength."""
        self._joint, self._step, self._sticky = joint, step, joint.opening > 0.0
        self.broken = joint.strength == 0.0
        self.gap = 0.0

    def force(self, closing: float, compliance: float) -> float:
        """Compressive force at the end of a step [N]; arguments as for `ShaperContact.force`."""
        needed = closing / compliance  # keeps the faces at one velocity
        if not self.broken:
            if needed >= -self._joint.strength:
                return needed
            self.broken = True
        # Backward Euler: a face that would pass through the other is brought onto it within the step.
        force = (closing - self.gap / self._step) / compliance
        if force < 0.0:
            force = self._adhesion(closing, compliance)
        else:
            self._sticky = False  # what was torn does not heal
        self.gap = max(self.gap - self._step * (closing - compliance * force), 0.0)
        return force

    def _adhesion(self, closing: float, compliance: float) -> float:
        """Stress left in the joint at the gap it opens to: -S (1 - gap / opening), solved with the gap."""
        strength, opening = self._joint.strength, self._joint.opening
        if not self._sticky or self.gap >= opening:
            return 0.0
        slope = strength / opening
        free = self.gap - self._step * closing
        force = (slope * free - strength) / (1.0 - slope * self._step * compliance)
        return min(force, 0.0)
