"""One lag fitted to the data: how late a recording is, the free parameters found with it.

A force that was recorded late by d is the model's force of the time t - d, and so is an outline. The lag is
fitted by Gauss-Newton steps together with the free parameters, whose effect is taken as linear, and as late
as the recording where runs beside the point tell it; the discrepancies are found anew with every step, since
a wrong clock has inflated those of the optimum. A late outline is a slowly varying error that its points have
in common: weights that know such errors (`kolsky.inverse.common_errors`) would take the lag for one. It is
fitted without, and they enter its standard uncertainty with the amplitude that is left, beside the residual,
correlated in time or not, and what noise of the inputs and mesh do to the lag.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline

from explicit import Response
from kolsky.bars.signals.transducers import ForceBins
from kolsky.base.arrays import FloatArray
from kolsky.diagnosis.fit_quality import fit_quality
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import SAME_TIME
from kolsky.inverse.side_surface import radius_at

REACH = 60e-6
"""Largest lag that is looked for, either way [s]: some seven frames."""
SCAN = 4e-6
"""Step of the search for a first lag [s]: a small part of the period of what rings."""
STEP = 0.5e-6
"""Half the distance of central differences by a lag [s]."""
ROUNDS = 15
"""Most Gauss-Newton steps."""
STILL = 1e-8
"""A lag that moves by less has come to rest [s]: a fiftieth of what can be told."""
AT_REST = 1e-2
"""Free parameters that move by less, in standard deviations, have come to rest: -2 ln L changes by 1e-4."""

Shifted = Callable[[FloatArray], FloatArray]
"""Predicted data vector, shape [k], of a force and an outline recorded late by two lags [s], shape [2]; or
its slopes by the free parameters, shape [k, d]."""


@dataclass(frozen=True)
class FittedLag:
    """The lag that fits the data best, with the free parameters refitted."""

    lag: float
    """The lag [s]."""
    sigma: float
    """Its standard uncertainty [s]."""
    vector: FloatArray
    """Data vector with it, shape [k]."""
    jacobian: FloatArray
    """Of the data vector by the free parameters and the lag, shape [k, d + 1]."""
    objective: Objective
    """With the discrepancies that are left."""
    evidence: float
    """Fall of -2 ln L by the lag, the free parameters fitted with it and without [-]."""
    settled: bool
    """Whether the search came to rest inside `REACH`."""
    explains: bool
    """Whether the model explains force and outline with it."""
    move: FloatArray
    """By how much the free parameters move with it, shape [d]."""

    @property
    def significance(self) -> float:
        """Size of the lag over its standard uncertainty [-]; 0 if that is not known."""
        return abs(self.lag) / self.sigma if self.settled and self.sigma > 0.0 else 0.0


def fit_lag(
    objective: Objective,
    shifted: Shifted,
    slopes: Shifted,
    direction: tuple[float, float],
    changes: Mapping[str, FloatArray],
    *,
    before: float | None = None,
    first: float | None = None,
) -> FittedLag:
    """Fit one lag, and the free parameters with it.

    Parameters
    ----------
    objective
        Data, noise and first discrepancies.
    shifted
        The prediction of late recordings at the optimum.
    slopes
        Of the data vector by the free parameters, shape [k, d], with late recordings.
    direction
        Lags of force and outline if this lag is one.
    changes
        By source, changes of the prediction by one standard uncertainty, shape [k] or [n, k].
    before
        -2 ln L with which the evidence is compared; that of `without_lag` for the same run if left out.
    first
        What `first_lag` gives for the same arguments, where it is known.
    """
    way, h = np.array(direction), STEP
    d = slopes(0.0 * way).shape[1]
    if before is None:
        before = without_lag(objective, shifted, slopes)
    plain = _without_slow_error(objective)
    lag = first_lag(objective, shifted, slopes, direction) if first is None else first
    move, settled = np.zeros(d), False
    for _ in range(ROUNDS):
        jacobian = slopes(lag * way)
        vector = shifted(lag * way) + jacobian @ move
        slope = (shifted((lag + h) * way) - shifted((lag - h) * way)) / (2.0 * h)
        wide = np.column_stack([jacobian, slope])
        plain = plain.with_discrepancy(vector)
        gain = plain.gain(wide)
        change = gain @ (plain.data - vector)
        move, lag = move + change[:d], float(np.clip(lag + change[d], -REACH, REACH))
        if abs(change[d]) < STILL:
            settled = True
            break
    vector = shifted(lag * way) + slopes(lag * way) @ move
    left = objective.with_discrepancy(vector)
    slow = left.slow_discrepancy * (left.slow_patterns @ gain[d])
    variance = float(plain.residual_covariance(wide, vector)[d, d]) + float(slow @ slow)
    for source in changes.values():
        moves = np.nan_to_num(np.atleast_2d(source)) @ gain[d]
        variance += float((moves**2).mean())
    return FittedLag(
        lag=lag,
        sigma=variance**0.5,
        vector=vector,
        jacobian=wide,
        objective=left,
        evidence=float(before - plain.deviance(vector[None])[0]),
        settled=settled and abs(lag) < REACH,
        explains=all(channel.explained for channel in fit_quality(left, vector, wide, changes=changes)),
        move=move,
    )


def without_lag(objective: Objective, shifted: Shifted, slopes: Shifted) -> float:
    """-2 ln L without a lag, the free parameters fitted [-]; arguments as of `fit_lag`."""
    plain, now = _without_slow_error(objective), np.zeros(2)
    vector, jacobian = shifted(now), slopes(now)
    for _ in range(ROUNDS):
        plain = plain.with_discrepancy(vector)
        change = plain.gain(jacobian) @ (plain.data - vector)
        vector = vector + jacobian @ change
        if float(change @ plain.information(jacobian) @ change) < AT_REST**2:
            break
    return float(plain.deviance(vector[None])[0])


def _without_slow_error(objective: Objective) -> Objective:
    return replace(objective, slowly=False, slow_discrepancy=0.0)


def first_lag(
    objective: Objective, shifted: Shifted, slopes: Shifted, direction: tuple[float, float]
) -> float:
    """A lag to begin with [s]: the likeliest of a scan over `REACH`, the free parameters refitted.

    For a beginning the modes of the front face's noise are left to the discrepancies. Arguments as of
    `fit_lag`.
    """
    way, plain = np.array(direction), _without_slow_error(objective)
    plain = replace(plain, observations=replace(plain.observations, front_noise=None))

    def cost(lag: float) -> float:
        vector, weighted, jacobian = shifted(lag * way), plain, slopes(lag * way)
        for _ in range(2):
            weighted = weighted.with_discrepancy(vector)
            vector = vector + jacobian @ (weighted.gain(jacobian) @ (plain.data - vector))
        return float(plain.deviance(vector[None])[0])

    steps = round(REACH / SCAN)
    return min((SCAN * step for step in range(-steps, steps + 1)), key=cost)


def late_prediction(response: Response, objective: Objective) -> Shifted:
    """The prediction of a run as recorders with late clocks would have seen it.

    A bin's mean is the difference of the impulse at its edges; surfaces between the frames are splines in
    time. Before the simulation begins everything is at rest; where a time lies behind its end the value is
    that without a lag.

    Parameters
    ----------
    response
        The run at the optimum, a batch of one.
    objective
        Bins and points.
    """
    observations = objective.observations
    line, t = observations.centre_line, response.force_times
    s = response.surface_times
    rows = np.flatnonzero(objective.counted)
    both = np.stack([response.surface_r[0], response.surface_y[0]], axis=-1)
    surfaces = CubicSpline(s, both) if observations.has_shape else None
    times, frame = np.unique(line.time[rows], return_inverse=True)

    @cache
    def force(lag: float) -> FloatArray:
        def mean_of(bins: ForceBins, which: str) -> FloatArray:
            impulse = response.impulse_transmission if which == "transmission" else response.impulse_flyer
            return np.asarray(np.diff(np.interp(bins.edges - lag, t, impulse[0])) / np.diff(bins.edges))

        mean = observations.of_forces(mean_of)
        behind = observations.of_forces(lambda bins, _: bins.edges[1:] - lag) > t[-1] + SAME_TIME
        return np.where(behind, force(0.0), mean) if behind.any() else mean

    @cache
    def radii(lag: float) -> FloatArray:
        if surfaces is None:
            return np.empty(0)
        late = times - lag
        r, y = np.moveaxis(surfaces(np.clip(late, s[0], s[-1])), -1, 0)
        Z, _ = radius_at(r, y, frame, line.y[rows])
        unknown = (late > s[-1] + SAME_TIME)[frame] | ~np.isfinite(Z)
        return np.where(unknown, radii(0.0), Z) if lag != 0.0 and unknown.any() else Z

    def shifted(lags: FloatArray) -> FloatArray:
        seen = np.concatenate([force(float(lags[0])), radii(float(lags[1]))])
        return objective.under_fitted_path(seen)

    return shifted
