"""Cameras and oscilloscope: the lag of the flyer's motion relative to the signals.

A trigger synchronises the clocks; this is a cross-check. The force of a transducer behind a mass, integrated
twice, gives the motion of that mass. The face velocity from the bar's waves, integrated once, gives the
motion of the face. Either motion is fitted to the displacement measured by the cameras. The lag between the
clocks is the only nonlinear unknown. Displacements are compared because the noise of the cameras in
displacement is white and known.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import minimize_scalar

from dic.basics import check_interval
from kolsky.bars.records import Signal
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion

REACH = 200e-6
"""Largest lag in the search, in either direction [s]."""
FEWEST_FRAMES = 8
"""Smallest number of moving frames: three more than the number of unknowns."""
UNLIKE = 25.0
"""Chi-square per degree of freedom above which signal and cameras show different motions. It equals five
times the noise."""
COVERAGE = 2.0
"""Standard uncertainties within which clocks agree [-]."""


class Agreement(StrEnum):
    """Verdict of the cross-check on the declared clocks."""

    AGREES = "agrees"
    DIFFERS = "differs"
    UNDECIDED = "not decided"
    UNLIKE = "no match"


@dataclass(frozen=True)
class Synchronisation:
    """The lag of the cameras' clock. Both instruments have measured one motion."""

    lag: float
    """Time to be added to the cameras' times, in addition to the declared offset [s]."""
    sigma: float
    """Its standard uncertainty by the fit and the declared trigger [s]."""
    gain: float
    """Motion measured by the cameras, divided by the motion computed from the signal [-]. It is 1 if mass and
    sensitivity are correct."""
    sigma_gain: float
    """Its standard uncertainty [-]."""
    chi2_per_dof: float
    """Residual sum of squares in the cameras' sigmas, divided by the degrees of freedom [-]."""
    frames: int
    """Frames used, those at rest included."""
    frame_interval: float
    """Median time from frame to frame [s]."""
    at_edge: bool
    """True if the best lag is at an end of the search range."""

    @property
    def agreement(self) -> Agreement:
        """The verdict at k = 2. It is undecided if the uncertainty of the lag exceeds a frame interval."""
        if self.chi2_per_dof > UNLIKE:
            return Agreement.UNLIKE
        if self.at_edge or COVERAGE * self.sigma > self.frame_interval:
            return Agreement.UNDECIDED
        return Agreement.AGREES if abs(self.lag) <= COVERAGE * self.sigma else Agreement.DIFFERS

    @property
    def sentence(self) -> str:
        """The verdict in words."""
        found = f"{1e6 * self.lag:+.2f} us +- {COVERAGE * 1e6 * self.sigma:.2f} us (k = 2)"
        gain = f"gain {self.gain:.4f} +- {COVERAGE * self.sigma_gain:.4f}"
        match self.agreement:
            case Agreement.AGREES:
                return f"the cameras' clock agrees with the signals': lag {found}, {gain}"
            case Agreement.DIFFERS:
                return (
                    f"the cameras' clock differs from the signals' by {found}, {gain}; add the lag to "
                    "frames.clock_offset, or find out which trigger was late"
                )
            case Agreement.UNDECIDED if self.at_edge:
                return "the clocks differ by more than the lags searched; correct frames.clock_offset first"
            case Agreement.UNDECIDED:
                return f"the cross-check is undecided: lag {found}, more than a frame interval"
        return (
            f"the flyer's motion is not that of the signal: residuals of {self.chi2_per_dof**0.5:.3g} times"
            " the cameras' sigma; is it the right channel, and the mass between transducer and specimen?"
        )


def synchronise(
    motion: FlyerMotion,
    force: Signal,
    *,
    mass: float,
    rest: float,
    travel: float,
    sigma_zero: float = 0.0,
    reach: float = REACH,
) -> Synchronisation:
    """Lag between the cameras and a transducer behind a mass on the flyer.

    ``F = m a + F_s`` gives ``x = (integral of (F - F_s)) / m`` by two integrations. The force of the
    specimen, F_s, is unknown. For a short travel it is modelled as ``Z v + k x`` plus a part proportional to
    a. The factors are free; that of a is `gain`.

    ``motion``: the flyer's displacement at the frames, on the declared clock; its zero is arbitrary.
    ``force``: force at the transducer [N], compression positive, baseline removed. ``mass``: mass between its
    sensing plane and the specimen [kg]. ``rest``: a time on the signal's clock before the wave arrives [s];
    integration begins there. ``travel``: displacement up to which frames are used [m], about 5 % of the
    specimen's length. ``sigma_zero``: standard uncertainty of the force's zero [N]. ``reach``: largest lag in
    the search, in either direction [s]. Raises ValueError if a value is outside its range, or if the frames
    or the signal do not suffice.
    """
    check_interval("(0, inf)", mass=mass, travel=travel, reach=reach)
    check_interval("[0, inf) N", sigma_zero=sigma_zero)
    t, F = _from(force, rest)
    v = cumulative_trapezoid(F, t, initial=0.0) / mass
    x = cumulative_trapezoid(v, t, initial=0.0)
    once = cumulative_trapezoid(x, t, initial=0.0)
    twice = cumulative_trapezoid(once, t, initial=0.0)
    curves = np.stack([x, once, twice, 0.5 * (t - t[0]) ** 2 / mass])
    free = np.inf
    return _Fit(motion, t, curves, np.array([free, free, free, sigma_zero]), travel, reach).solve()


class _Fit:
    """Displacements at the frames as a sum of curves over the signal's time, shifted by a lag."""

    def __init__(
        self,
        motion: FlyerMotion,
        time: FloatArray,
        curves: FloatArray,
        prior: FloatArray,
        travel: float,
        reach: float,
    ) -> None:
        moved = motion.displacement - motion.displacement[:3].mean()
        beyond = np.flatnonzero(moved > travel)
        last = int(beyond[0]) if beyond.size else moved.size
        moving = int((moved[:last] > 5.0 * motion.sigma[:last]).sum())
        if moving < FEWEST_FRAMES:
            raise ValueError(
                f"{moving} frames show the flyer between rest and {1e3 * travel:.3g} mm, at least "
                f"{FEWEST_FRAMES} are needed; allow a longer travel"
            )
        self.t, self.y, self.sigma = (
            array[:last] for array in (motion.time, motion.displacement, motion.sigma)
        )
        if not self.t[-1] + reach <= time[-1]:
            raise ValueError(
                f"the signal ends at {time[-1]:.9g} s, the frames used at {self.t[-1]:.9g} s and may lag by"
                f" {reach:.3g} s; shorten reach or travel"
            )
        self.time, self.reach = time, reach
        scale = np.abs(curves).max(axis=1)
        self.curves, self.scale = curves / scale[:, None], scale
        self.known = np.isfinite(prior)
        self.prior = prior * scale
        self.interval = float(np.median(np.diff(motion.time)))

    def columns(self, lag: float) -> FloatArray:
        """The curves at the frames, and the constant. Before the signal's start the curves are zero."""
        at = np.maximum(self.t + lag, self.time[0])
        return np.column_stack([np.ones(at.size), *(np.interp(at, self.time, row) for row in self.curves)])

    def weighted(self, lag: float) -> tuple[FloatArray, FloatArray]:
        """Equations in units of sigma, followed by the priors of the known zeros."""
        G, y = self.columns(lag) / self.sigma[:, None], self.y / self.sigma
        keep = np.append(True, ~self.known | (self.prior > 0.0))
        rows = np.flatnonzero(self.known & (self.prior > 0.0))
        below = np.zeros((rows.size, G.shape[1]))
        below[np.arange(rows.size), rows + 1] = 1.0 / self.prior[rows]
        return np.vstack([G, below])[:, keep], np.append(y, np.zeros(rows.size))

    def chi2(self, lag: float) -> float:
        """Smallest sum of squares at a lag."""
        G, y = self.weighted(lag)
        rest = y - G @ np.linalg.lstsq(G, y, rcond=None)[0]
        return float(rest @ rest)

    def solve(self) -> Synchronisation:
        """The best lag with its uncertainty."""
        step = 0.25 * self.interval
        grid = step * np.arange(-int(self.reach / step), int(self.reach / step) + 1)
        best = int(np.argmin([self.chi2(lag) for lag in grid]))
        at_edge = best in (0, grid.size - 1)
        lag = float(grid[best])
        if not at_edge:
            chi2: Callable[[float], float] = self.chi2
            found = minimize_scalar(
                chi2, bounds=(lag - step, lag + step), method="bounded", options={"xatol": 1e-10}
            )
            lag = float(found.x)
        G, y = self.weighted(lag)
        solution = np.linalg.lstsq(G, y, rcond=None)[0]
        slope = (self.weighted(lag + 0.1 * step)[0] - self.weighted(lag - 0.1 * step)[0]) @ solution
        J = np.column_stack([G, slope / (0.2 * step)])
        size = np.linalg.norm(J, axis=0)
        size[size == 0.0] = 1.0
        covariance = np.linalg.pinv((J / size).T @ (J / size)) / np.outer(size, size)
        dof = self.t.size + int((self.prior[self.known] > 0.0).sum()) - J.shape[1]
        rest = y - G @ solution
        ratio = float(rest @ rest) / dof
        growth = max(1.0, ratio)
        return Synchronisation(
            lag=lag,
            sigma=float(np.sqrt(growth * covariance[-1, -1])),
            gain=float(solution[1] / self.scale[0]),
            sigma_gain=float(np.sqrt(growth * covariance[1, 1]) / self.scale[0]),
            chi2_per_dof=ratio,
            frames=int(self.t.size),
            frame_interval=self.interval,
            at_edge=at_edge,
        )


def _from(signal: Signal, rest: float) -> tuple[FloatArray, FloatArray]:
    """The signal from `rest` on."""
    if not signal.start <= rest < signal.end:
        raise ValueError(
            f"the time of rest {rest:.9g} s is outside the signal, {signal.start:.9g} to {signal.end:.9g} s"
        )
    use = signal.time >= rest
    return signal.time[use], signal.value[use]
