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
class FittedLags:
    """Lags that fit the data best, with the free parameters refitted."""

    lags: FloatArray
    """Along each direction that was fitted [s], shape [n]."""
    sigma: FloatArray
    """Standard uncertainties [s], shape [n]."""
    vector: FloatArray
    """Data vector with them, shape [k]."""
    settled: bool
    """Whether the search came to rest inside `REACH`."""


def clock_lags(
    shot: Shot,
    response: Response,
    objective: Objective,
    jacobian: FloatArray,
    changes: Mapping[str, FloatArray],
) -> tuple[ClockLag, ...]:
    """Lags of force, outline and flyer, each against the others.

    The lags of force and outline are fitted together, that of the flyer alone: it is both of them at once.

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
        Force first; without an outline only it.
    """
    shifted = late_prediction(response, objective)
    found = []
    outline = objective.observations.has_shape
    for names in ((FORCE, OUTLINE), (FLYER,)) if outline else ((FORCE,),):
        fitted = fit_lags(objective, shifted, jacobian, [DIRECTIONS[name] for name in names], changes)
        for name, lag, sigma in zip(names, fitted.lags.tolist(), fitted.sigma.tolist(), strict=True):
            file, key = origin(shot, name)
            found.append(ClockLag(name, lag, sigma if fitted.settled else float("nan"), file, key))
    return tuple(found)


def fit_lags(
    objective: Objective,
    shifted: Shifted,
    jacobian: FloatArray,
    directions: list[tuple[float, float]],
    changes: Mapping[str, FloatArray],
) -> FittedLags:
    """Fit lags along directions of (force, outline), and the free parameters with them.

    Parameters
    ----------
    objective
        Data, noise and first discrepancies.
    shifted
        The prediction of late recordings at the optimum.
    jacobian
        Of the data vector by the free parameters, shape [k, d].
    directions
        Lags of force and outline for each lag that is fitted, length n.
    changes
        By source, changes of the prediction by one standard uncertainty, shape [k] or [n, k].
    """
    along, d = np.array(directions), jacobian.shape[1]
    lags = _first(objective, shifted, jacobian, along)
    move, settled = np.zeros(d), False
    for _ in range(ROUNDS):
        vector = shifted(lags @ along) + jacobian @ move
        slopes = [shifted((lags + h) @ along) - shifted((lags - h) @ along) for h in STEP * np.eye(len(lags))]
        wide = np.column_stack([jacobian, np.array(slopes).T / (2.0 * STEP)])
        objective = objective.with_discrepancy(vector)
        gain = objective.gain(wide)
        change = gain @ (objective.data - vector)
        move, lags = move + change[:d], np.clip(lags + change[d:], -REACH, REACH)
        if (np.abs(change[d:]) < STILL).all():
            settled = True
            break
    vector = shifted(lags @ along) + jacobian @ move
    variance = np.diag(objective.covariance(wide, vector))[d:].copy()
    for source in changes.values():
        moves = np.nan_to_num(np.atleast_2d(source)) @ gain[d:].T
        variance += (moves**2).mean(axis=0)
    inside = bool((np.abs(lags) < REACH).all())
    return FittedLags(lags, np.sqrt(variance), vector, settled and inside)


def _first(objective: Objective, shifted: Shifted, jacobian: FloatArray, along: FloatArray) -> FloatArray:
    """Lags to begin with, shape [n]: the best of a scan over `REACH`, the free parameters refitted.

    Each lag is scanned alone, all of them as one, and each again with the others at their best.
    """
    tried, n = SCAN * np.arange(-round(REACH / SCAN), round(REACH / SCAN) + 1), len(along)

    def cost(point: FloatArray) -> float:
        vector, weighted = shifted(point @ along), objective
        for _ in range(2):
            weighted = weighted.with_discrepancy(vector)
            vector = vector + jacobian @ (weighted.gain(jacobian) @ (objective.data - vector))
        return float(objective.deviance(vector[None])[0])

    def scanned(start: FloatArray, way: FloatArray) -> FloatArray:
        points = start + tried[:, None] * way
        return np.asarray(points[int(np.argmin([cost(point) for point in points]))])

    starts = [scanned(np.zeros(n), way) for way in np.eye(n)]
    if n > 1:
        starts.append(scanned(np.zeros(n), np.ones(n)))
        best = min(starts, key=cost)
        starts += [scanned(best * (way == 0.0), way) for way in np.eye(n)]
    return np.asarray(min(starts, key=cost))


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
