"""Clock lags: delays of the force, outline and flyer recordings, from the residual of the model.

A force recorded late by d is the model's force at t - d. The same holds for an outline. The lag is fitted
together with the free parameters, which act linearly.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache
from math import nan

import numpy as np
from scipy.interpolate import CubicSpline

from explicit import Response
from kolsky.bars.signals.transducers import ForceBins
from kolsky.base.arrays import FloatArray
from kolsky.diagnosis.fit_quality import fit_quality
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import SAME_TIME, radius_at
from kolsky.inverse.result import FORCE, OUTLINE, ClockLag
from kolsky.shot.records import Shot

REACH = 60e-6
"""Largest lag in the search, in both directions [s]: about seven frames."""
SCAN = 4e-6
"""Step of the scan for a first lag [s]: a small part of the ringing period."""
STEP = 0.5e-6
"""Half step of central differences by a lag [s]."""
ROUNDS = 15
"""Maximum number of Gauss-Newton steps."""
LAG_STAYS = 1e-8
"""A lag has converged if it changes by less than this [s]. It is a fiftieth of what the data resolve."""
AT_REST = 1e-2
"""Change of the free parameters at convergence, in standard deviations: 1e-4 in -2 ln L."""

Shifted = Callable[[FloatArray], FloatArray]
"""Predicted data vector, shape [k], of a force and an outline with late records, by two lags [s], [2]."""


@dataclass(frozen=True)
class FittedLag:
    """The lag that fits the data best, with the free parameters refitted."""

    lag: float
    """The lag [s]."""
    sigma: float
    """Its standard uncertainty [s]."""
    objective: Objective
    evidence: float
    """Decrease of -2 ln L by the lag, with the free parameters fitted in both cases [-]."""
    settled: bool
    """True if the search converged inside `REACH`."""
    explains: bool
    """True if the model explains force and outline with this lag."""


def fit_lag(
    objective: Objective,
    shifted: Shifted,
    jacobian: FloatArray,
    direction: tuple[float, float],
    changes: Mapping[str, FloatArray],
    *,
    before: float | None = None,
) -> FittedLag:
    """Fit one lag together with the free parameters.

    ``jacobian``: of the data vector by the free parameters, [k, d]. ``before``: `without_lag`, if known.
    """
    way, h, d = np.array(direction), STEP, jacobian.shape[1]
    before = without_lag(objective, shifted, jacobian) if before is None else before
    plain = _without_slow_error(objective)
    lag = first_lag(objective, shifted, jacobian, direction)
    move, settled = np.zeros(d), False
    for _ in range(ROUNDS):
        vector = shifted(lag * way) + jacobian @ move
        slope = (shifted((lag + h) * way) - shifted((lag - h) * way)) / (2.0 * h)
        wide = np.column_stack([jacobian, slope])
        plain = plain.with_discrepancy(vector)
        gain = plain.gain(wide)
        change = gain @ (plain.data - vector)
        move, lag = move + change[:d], float(np.clip(lag + change[d], -REACH, REACH))
        if abs(change[d]) < LAG_STAYS:
            settled = True
            break
    vector = shifted(lag * way) + jacobian @ move
    left = objective.with_discrepancy(vector)
    slow = left.slow_discrepancy * (left.slow_patterns @ gain[d])
    variance = float(plain.residual_covariance(wide, vector)[d, d]) + float(slow @ slow)
    for source in changes.values():
        moves = np.nan_to_num(np.atleast_2d(source)) @ gain[d]
        variance += float((moves**2).mean())
    return FittedLag(
        lag=lag,
        sigma=variance**0.5,
        objective=left,
        evidence=float(before - plain.deviance(vector[None])[0]),
        settled=settled and abs(lag) < REACH,
        explains=all(channel.explained for channel in fit_quality(left, vector, wide, changes=changes)),
    )


def without_lag(objective: Objective, shifted: Shifted, jacobian: FloatArray) -> float:
    """-2 ln L without a lag, with the free parameters fitted [-]. Arguments as for `fit_lag`."""
    plain, vector = _without_slow_error(objective), shifted(np.zeros(2))
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
    objective: Objective, shifted: Shifted, jacobian: FloatArray, direction: tuple[float, float]
) -> float:
    """The first lag [s]: the likeliest one of a scan over `REACH`, with the free parameters refitted.

    In this scan, the front face's noise is part of the discrepancies. Arguments as for `fit_lag`.
    """
    way, plain = np.array(direction), _without_slow_error(objective)
    plain = replace(plain, front=replace(plain.front, patterns=None))

    def cost(lag: float) -> float:
        vector, weighted = shifted(lag * way), plain
        for _ in range(2):
            weighted = weighted.with_discrepancy(vector)
            vector = vector + jacobian @ (weighted.gain(jacobian) @ (plain.data - vector))
        return float(plain.deviance(vector[None])[0])

    steps = round(REACH / SCAN)
    return min((SCAN * step for step in range(-steps, steps + 1)), key=cost)


def late_prediction(response: Response, objective: Objective) -> Shifted:
    """The prediction of a run, as late clocks would record it.

    A bin's mean is the difference of the impulse at its edges. Between the frames, surfaces are splines in
    time. Before the simulation everything is at rest; after its end, the value without a lag is used.
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


FLYER = "flyer"
DIRECTIONS = {FORCE: (1.0, 0.0), OUTLINE: (0.0, 1.0), FLYER: (-1.0, -1.0)}
"""Delay of force and outline per unit delay of a recording."""


def clock_lags(
    shot: Shot,
    response: Response,
    objective: Objective,
    jacobian: FloatArray,
    changes: Mapping[str, FloatArray],
) -> tuple[ClockLag, ...]:
    """Lags of force, outline and flyer, each relative to the two others; only the force's without an outline.

    ``shot``: for the names of files and keys. ``response``: the run at the optimum. ``objective``: with its
    discrepancies. ``jacobian``: of the data vector by the free parameters, shape [k, d]. ``changes``: as for
    `kolsky.diagnosis.fit_quality.fit_quality`.
    """
    shifted, lags = late_prediction(response, objective), []
    before = without_lag(objective, shifted, jacobian)
    for name in DIRECTIONS if objective.observations.has_shape else (FORCE,):
        fit = fit_lag(objective, shifted, jacobian, DIRECTIONS[name], changes, before=before)
        sigma = fit.sigma if fit.settled else nan
        lags.append(ClockLag(name, fit.lag, sigma, fit.evidence, fit.explains, *origin(shot, name)))
    return tuple(lags)


def origin(shot: Shot, recording: str) -> tuple[str, str]:
    """File with a recording's times, and the key of shot.toml that corrects its clock."""
    content = {} if shot.file is None else shot.file.content
    key, other = {
        FORCE: ("force.clock_offset", "recorders"),
        FLYER: ("flyer.frame", "pictures"),
        OUTLINE: ("centre_line.frame", "pictures"),
    }[recording]
    table = key.partition(".")[0]
    if ("force" if recording == FORCE else "frames") not in content:
        return "shot.toml", other
    section = content.get(table)
    return str(section.get("file", "shot.toml")) if isinstance(section, dict) else "shot.toml", key
