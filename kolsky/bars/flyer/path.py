"""The flyer's path: a motion from rest as a cubic spline with its posterior uncertainty; strain under it."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from kolsky.bars.records import History
from kolsky.base.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

ONSET = (0.5, 0.99)
"""Shares of the largest velocity between which a motion sets in."""


@dataclass(frozen=True)
class FlyerPath:
    """A motion that starts from rest, with position, velocity and acceleration of one cubic spline (C2)."""

    knots: FloatArray
    """Start, then the frames after it [s], shape [n + 1]."""
    jerk: FloatArray
    """Third derivative between the knots [m/s^3], shape [n]."""
    covariance: FloatArray
    """Posterior covariance of `jerk` [m^2/s^6], shape [n, n]."""
    zero: float
    """The recorded displacement at rest, subtracted from it [m]."""
    noise_scale: float
    """Noise used over noise declared, at least 1; the median where it differs from frame to frame [-]."""
    chi2_per_dof: float
    """Residual sum of squares in declared sigmas over (frames - effective parameters); about 1 if the
    declared sigma is right [-]."""
    dof: float
    """Frames minus effective parameters [-]."""
    static_scatter: float
    """Scatter of the static frames over the declared sigma: the check that needs no fit [-]."""

    @property
    def start(self) -> float:
        """Last time at rest [s]."""
        return float(self.knots[0])

    @property
    def end(self) -> float:
        """Last frame [s]."""
        return float(self.knots[-1])

    @cached_property
    def _spline(self) -> "PPoly":
        from scipy.interpolate import PPoly  # loaded where it is of use

        h = np.diff(self.knots)
        state = np.zeros((3, h.size))  # x, v, a at the left knot of each span
        for i in range(h.size - 1):
            x, v, a = state[:, i]
            j = self.jerk[i]
            state[0, i + 1] = x + h[i] * (v + h[i] * (a / 2.0 + h[i] * j / 6.0))
            state[1, i + 1] = v + h[i] * (a + h[i] * j / 2.0)
            state[2, i + 1] = a + h[i] * j
        return PPoly(np.stack([self.jerk / 6.0, state[2] / 2.0, state[1], state[0]]), self.knots)

    def position(self, time: ArrayLike) -> FloatArray:
        """Displacement toward the specimen [m], shape of `time`.

        Raises
        ------
        ValueError
            If a time is outside [start, end]; likewise in the methods below.
        """
        return np.asarray(self._spline(self._inside(time)))

    def velocity(self, time: ArrayLike) -> FloatArray:
        """Velocity toward the specimen [m/s], shape of `time`."""
        return np.asarray(self._spline(self._inside(time), 1))

    def acceleration(self, time: ArrayLike) -> FloatArray:
        """Acceleration toward the specimen [m/s^2], shape of `time`."""
        return np.asarray(self._spline(self._inside(time), 2))

    def sigma_position(self, time: ArrayLike) -> FloatArray:
        """Standard uncertainty of `position`, the zero's included [m], shape of `time`."""
        return self._sigma(time, 0)

    def sigma_velocity(self, time: ArrayLike) -> FloatArray:
        """Standard uncertainty of `velocity` [m/s], shape of `time`."""
        return self._sigma(time, 1)

    def sigma_acceleration(self, time: ArrayLike) -> FloatArray:
        """Standard uncertainty of `acceleration` [m/s^2], shape of `time`."""
        return self._sigma(time, 2)

    def sigma_change(self, first: float, last: float) -> float:
        """Standard uncertainty of the change of `position` between two times [m]."""
        G = responses(self._inside([last]), self.knots, 0) - responses(self._inside([first]), self.knots, 0)
        return float(np.sqrt(max((G @ self.covariance @ G.T).item(), 0.0)))

    @cached_property
    def sigma_onset(self) -> float:
        """Standard uncertainty of when the motion sets in [s].

        A displacement that is off by ``sigma_position`` is one of a record that is late by that over the
        velocity. The largest of these counts, from where the path first has half of its largest velocity to
        where it first has nearly all of it: what no frame of it shows there, the smoothness fills.
        """
        velocity = self.velocity(self.knots)
        first, last = (int(np.argmax(velocity >= share * velocity.max())) for share in ONSET)
        while_rising = slice(first, last + 1)
        if not velocity.max() > 0.0:
            return 0.0
        late = self.sigma_position(self.knots[while_rising]) / velocity[while_rising]
        return float(late.max())

    def replicates(self, n: int, rng: np.random.Generator) -> list["FlyerPath"]:
        """Paths drawn from the posterior, to carry the flyer's noise through a calculation.

        Parameters
        ----------
        n : int
            How many.
        rng : numpy.random.Generator
            Source of the draws; the same state gives the same paths.
        """
        # Eigenvectors rather than Cholesky: the covariance spans many decades and may be semidefinite.
        scale = np.sqrt(np.diag(self.covariance))
        values, vectors = np.linalg.eigh(self.covariance / np.outer(scale, scale))
        root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
        return [replace(self, jerk=self.jerk + root @ rng.standard_normal(values.size)) for _ in range(n)]

    def scaled(self, factor: float) -> "FlyerPath":
        """The path with every displacement multiplied; its covariance is left as it is."""
        return replace(self, jerk=factor * self.jerk)

    def faster(self, factor: float) -> "FlyerPath":
        """The same path run through `factor` times as fast, from the same start; its covariance follows.

        Raises
        ------
        ValueError
            If the factor is not finite and > 0.
        """
        if not 0.0 < factor < np.inf:
            raise ValueError(f"factor must be finite and > 0, got {factor}")
        return replace(
            self,
            knots=self.start + (self.knots - self.start) / factor,
            jerk=factor**3 * self.jerk,
            covariance=factor**6 * self.covariance,
        )

    def table(self, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Times [s], positions [m] and velocities [m/s] at `n` evenly spaced times, start to end."""
        if n < 2:
            raise ValueError(f"a table needs at least 2 times, got {n}")
        time = np.linspace(self.start, self.end, n)
        return time, self.position(time), self.velocity(time)

    def _inside(self, time: ArrayLike) -> FloatArray:
        t = np.asarray(time, dtype=np.float64)
        outside = t[~((t >= self.start) & (t <= self.end))]
        if outside.size:
            raise ValueError(
                f"the flyer's motion is known from {self.start:.9g} s to {self.end:.9g} s, asked for"
                f" {outside[0]:.9g} s; keep the window inside the frames"
            )
        return t

    def _sigma(self, time: ArrayLike, order: int) -> FloatArray:
        t = self._inside(time)
        G = responses(t.ravel(), self.knots, order)
        return np.sqrt(np.sum((G @ self.covariance) * G, axis=1).clip(min=0.0)).reshape(t.shape)


def responses(time: FloatArray, knots: FloatArray, order: int) -> FloatArray:
    """Position (order 0), velocity (1) or acceleration (2) at each time from a unit jerk in each span.

    Parameters
    ----------
    time
        Times [s], shape [n_times].
    knots
        Ends of the spans [s], shape [n_spans + 1].
    order
        0, 1 or 2.

    Returns
    -------
    NDArray
        In [s^3], [s^2] or [s], shape [n_times, n_spans].
    """
    since = np.maximum(time[:, None] - knots, 0.0)
    power, factor = ((3, 6.0), (2, 2.0), (1, 1.0))[order]
    return -np.diff(since**power, axis=1) / factor


def path_strain(path: FlyerPath, time: ArrayLike, *, length: float) -> tuple[History, History, History]:
    """Nominal compression, its rate and its second derivative under a moving face; the other one rests.

    Parameters
    ----------
    path
        The moving face, toward the specimen; before its start it rests.
    time
        Times, not after the path's end [s], shape [n].
    length
        Length of the specimen before the test [m].

    Returns
    -------
    tuple of History
        In [-], [1/s] and [1/s^2].

    Raises
    ------
    ValueError
        If the length is not positive or a time is after the path's end.
    """
    if not length > 0.0:
        raise ValueError(f"length is {length:g} m, must be > 0 m")
    t = np.asarray(time, dtype=np.float64)
    moving = t >= path.start
    at = t[moving]

    def history(value: FloatArray, sigma: FloatArray, unit: str) -> History:
        whole = [np.zeros(t.shape) for _ in range(2)]
        for into, part in zip(whole, (value, sigma), strict=True):
            into[moving] = part / length
        return History(whole[0], whole[1], unit)

    return (
        history(path.position(at), path.sigma_position(at), "1"),
        history(path.velocity(at), path.sigma_velocity(at), "1/s"),
        history(path.acceleration(at), path.sigma_acceleration(at), "1/s^2"),
    )
