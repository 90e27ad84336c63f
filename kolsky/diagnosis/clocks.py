"""Lags of the clocks: how late force, outline and flyer were recorded, from the model's own residual.

A force that was recorded late by d is the model's force of the time t - d, and so is an outline; a flyer
recorded late makes the model late, and force and outline early alike. The lags are fitted to the data by
Gauss-Newton steps together with the free parameters, whose effect is taken as linear; the discrepancies are
found anew with every step, since a wrong clock has inflated those of the optimum. A standard uncertainty of a
lag holds the residual, correlated in time or not, and what noise of the inputs and mesh do to the lag.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.interpolate import CubicSpline

from explicit import Response
from kolsky.base.arrays import FloatArray
from kolsky.diagnosis.fit_quality import fit_quality
from kolsky.inverse.fit_results import ClockLag
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import SAME_TIME
from kolsky.inverse.side_surface import radius_at
from kolsky.shot.records import Shot

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

Shifted = Callable[[FloatArray], FloatArray]
"""Predicted data vector, shape [k], of a force and an outline recorded late by two lags [s], shape [2]."""
FORCE, OUTLINE, FLYER = "force", "outline", "flyer"
DIRECTIONS = {FORCE: (1.0, 0.0), OUTLINE: (0.0, 1.0), FLYER: (-1.0, -1.0)}
"""By how much force and outline are late if a recording is late by one."""


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
    """Fall of -2 ln L [-]."""
    settled: bool
    """Whether the search came to rest inside `REACH`."""


def clock_lags(
    shot: Shot,
    response: Response,
    objective: Objective,
    jacobian: FloatArray,
    changes: Mapping[str, FloatArray],
) -> tuple[ClockLag, ...]:
    """Lags of force, outline and flyer, each against the two others.

    Parameters
    ----------
    shot
        The shot, for the names of files and keys.
    response
        The run at the optimum.
    objective
        With the discrepancies of the optimum.
    jacobian
        Of the data vector by the free parameters, shape [k, d].
    changes
        As of `kolsky.diagnosis.fit_quality.fit_quality`.

    Returns
    -------
    tuple of ClockLag
        The force's first; without an outline only that.
    """
    shifted, found = late_prediction(response, objective), []
    recordings = DIRECTIONS if objective.observations.has_shape else (FORCE,)
    for name in recordings:
        fit = fit_lag(objective, shifted, jacobian, DIRECTIONS[name], changes)
        left = fit_quality(fit.objective, fit.vector, fit.jacobian, changes=changes)
        file, key = origin(shot, name)
        found.append(
            ClockLag(
                recording=name,
                lag=fit.lag,
                sigma=fit.sigma if fit.settled else float("nan"),
                evidence=fit.evidence,
                explains=all(channel.explained for channel in left),
                file=file,
                key=key,
            )
        )
    return tuple(found)


def fit_lag(
    objective: Objective,
    shifted: Shifted,
    jacobian: FloatArray,
    direction: tuple[float, float],
    changes: Mapping[str, FloatArray],
) -> FittedLag:
    """Fit one lag, and the free parameters with it.

    Parameters
    ----------
    objective
        Data, noise and first discrepancies.
    shifted
        The prediction of late recordings at the optimum.
    jacobian
        Of the data vector by the free parameters, shape [k, d].
    direction
        Lags of force and outline if this lag is one.
    changes
        By source, changes of the prediction by one standard uncertainty, shape [k] or [n, k].
    """
    way, d, h = np.array(direction), jacobian.shape[1], STEP
    before = objective.deviance(shifted(0.0 * way)[None])[0]
    lag, move, settled = _first(objective, shifted, jacobian, way), np.zeros(d), False
    for _ in range(ROUNDS):
        vector = shifted(lag * way) + jacobian @ move
        slope = (shifted((lag + h) * way) - shifted((lag - h) * way)) / (2.0 * h)
        wide = np.column_stack([jacobian, slope])
        objective = objective.with_discrepancy(vector)
        gain = objective.gain(wide)
        change = gain @ (objective.data - vector)
        move, lag = move + change[:d], float(np.clip(lag + change[d], -REACH, REACH))
        if abs(change[d]) < STILL:
            settled = True
            break
    vector = shifted(lag * way) + jacobian @ move
    variance = float(objective.residual_covariance(wide, vector)[d, d])
    for source in changes.values():
        moves = np.nan_to_num(np.atleast_2d(source)) @ gain[d]
        variance += float((moves**2).mean())
    return FittedLag(
        lag=lag,
        sigma=variance**0.5,
        vector=vector,
        jacobian=wide,
        objective=objective.with_discrepancy(vector),
        evidence=float(before - objective.deviance(vector[None])[0]),
        settled=settled and abs(lag) < REACH,
    )


def _first(objective: Objective, shifted: Shifted, jacobian: FloatArray, way: FloatArray) -> float:
    """A lag to begin with: the likeliest of a scan over `REACH`, the free parameters refitted."""

    def cost(lag: float) -> float:
        vector, weighted = shifted(lag * way), objective
        for _ in range(2):
            weighted = weighted.with_discrepancy(vector)
            vector = vector + jacobian @ (weighted.gain(jacobian) @ (objective.data - vector))
        return float(objective.deviance(vector[None])[0])

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
    edges, line = observations.bins.edges, observations.centre_line
    t, impulse = response.force_times, response.impulse_transmission[0]
    s = response.surface_times
    rows = np.flatnonzero(objective.counted)
    both = np.stack([response.surface_r[0], response.surface_y[0]], axis=-1)
    surfaces = CubicSpline(s, both) if observations.has_shape else None
    times, frame = np.unique(line.time[rows], return_inverse=True)

    @cache
    def force(lag: float) -> FloatArray:
        at = edges - lag
        mean = np.diff(np.interp(at, t, impulse)) / np.diff(edges)
        behind = at[1:] > t[-1] + SAME_TIME
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
        return np.concatenate([force(float(lags[0])), radii(float(lags[1]))])

    return shifted


def origin(shot: Shot, recording: str) -> tuple[str, str]:
    """File with a recording's times, and the key of shot.toml that puts its clock right."""
    content = {} if shot.file is None else shot.file.content

    def file(table: str) -> str:
        section = content.get(table)
        return str(section.get("file", "shot.toml")) if isinstance(section, dict) else "shot.toml"

    if recording == FORCE:
        return (file("force"), "force.clock_offset") if "force" in content else ("shot.toml", "recorders")
    if "frames" in content and recording == FLYER:
        return file("flyer"), "flyer.frame"
    if "frames" in content:
        return file("centre_line"), "centre_line.frame"
    return "shot.toml", "pictures"
