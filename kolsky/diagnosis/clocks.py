"""Clock lags: delays of the force, outline and flyer recordings, from the residual of the model.

A force recorded late by d is the model's force at t - d. The same holds for an outline. The lag is fitted
together with the free parameters. If a lag is large, new runs are made.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import nan
from operator import attrgetter

import numpy as np
from scipy.interpolate import CubicSpline

from explicit import Response
from kolsky.bars.signals.transducers import ForceBins
from kolsky.base.arrays import FloatArray
from kolsky.diagnosis.fit_quality import fit_quality
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import SAME_TIME, radius_at
from kolsky.inverse.parameters import MOVED
from kolsky.inverse.result import FORCE, LATE, OUTLINE, ClockLag
from kolsky.inverse.runner import Runner
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
"""Predicted data vector, shape [k], of a force and an outline with late records, or its slopes by the free
parameters, shape [k, d]. The two lags [s] have shape [2]."""


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
    """Jacobian of the data vector by the free parameters and the lag, shape [k, d + 1]."""
    objective: Objective
    evidence: float
    """Decrease of -2 ln L by the lag, with the free parameters fitted in both cases [-]."""
    settled: bool
    """True if the search converged inside `REACH`."""
    explains: bool
    """True if the model explains force and outline with this lag."""
    move: FloatArray
    """Shift of the free parameters by it, shape [d]."""

    @property
    def significance(self) -> float:
        """Size of the lag divided by its standard uncertainty [-]; 0 if the uncertainty is unknown."""
        return abs(self.lag) / self.sigma if self.settled and self.sigma > 0.0 else 0.0


def fit_lag(
    objective: Objective,
    shifted: Shifted,
    slopes: Shifted,
    direction: tuple[float, float],
    changes: Mapping[str, FloatArray],
    *,
    before: float | None = None,
) -> FittedLag:
    """Fit one lag together with the free parameters."""
    way, h = np.array(direction), STEP
    d = slopes(0.0 * way).shape[1]
    before = without_lag(objective, shifted, slopes) if before is None else before
    plain = _without_slow_error(objective)
    lag = first_lag(objective, shifted, slopes, direction)
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
        if abs(change[d]) < LAG_STAYS:
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
    """-2 ln L without a lag, with the free parameters fitted [-]. Arguments as for `fit_lag`."""
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
    """The first lag [s]: the likeliest one of a scan over `REACH`, with the free parameters refitted.

    In this scan, the front face's noise is part of the discrepancies. Arguments as for `fit_lag`.
    """
    way, plain = np.array(direction), _without_slow_error(objective)
    plain = replace(plain, front=replace(plain.front, patterns=None))

    def cost(lag: float) -> float:
        vector, weighted, jacobian = shifted(lag * way), plain, slopes(lag * way)
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
TURNS = 3
"""Maximum number of iterations with new runs."""
DIFFERENCE_SHARE = 1e-3
"""Step of the difference by a parameter, as a share of its range [-]."""
RIVAL = 0.5
"""Lags with at least this share of the leading lag's evidence are refined too."""
PARAMETERS_STAY = 1e-4
"""No further run is made if all parameters change by less than this, relative to their size."""


@dataclass(frozen=True)
class Reruns:
    """The solver for lags beyond the linear range."""

    x: FloatArray
    """The optimum, shape [d]."""
    declared: FloatArray
    """Declared values of the free parameters, NaN if there is none, shape [d]."""
    lower: FloatArray
    """Lower bounds of the free parameters, shape [d]."""
    upper: FloatArray
    """Upper bounds, shape [d]."""
    run: Callable[[FloatArray], Response]
    """Runs on the refined mesh at points of shape [n, d]."""

    @classmethod
    def of(cls, runner: Runner, x: FloatArray) -> "Reruns":
        """The runs of an identification with the optimum x, shape [d]."""
        problem = runner.problem
        box = problem.box
        return cls(
            x=x,
            declared=np.where([name == MOVED for name in box.names], np.nan, problem.declared),
            lower=np.array(box.lower),
            upper=np.array(box.upper),
            run=lambda points: runner.run("clocks", points, problem.refined).response,
        )

    def starts(self, moved: FloatArray) -> list[FloatArray]:
        """First points for the solver: the shifted parameters, and the declared ones if they differ."""
        point = self.inside(moved)
        other = self.inside(np.where(np.isfinite(self.declared), self.declared, moved))
        return [point] if np.allclose(point, other, rtol=PARAMETERS_STAY, atol=0.0) else [point, other]

    def beside(self, point: FloatArray) -> FloatArray:
        """The point, then one neighbour per parameter inside the box, shape [d + 1, d]."""
        step = DIFFERENCE_SHARE * (self.upper - self.lower)
        step = np.where(point + step > self.upper, -step, step)
        return np.asarray(point + np.concatenate([np.zeros((1, len(point))), np.diag(step)]))

    def inside(self, point: FloatArray) -> FloatArray:
        """The point inside the box."""
        return np.asarray(np.clip(point, self.lower, self.upper))


def clock_lags(
    shot: Shot,
    response: Response,
    objective: Objective,
    jacobian: FloatArray,
    changes: Mapping[str, FloatArray],
    *,
    again: Reruns | None = None,
) -> tuple[ClockLag, ...]:
    """Lags of force, outline and flyer, each relative to the two others; only the force's without an outline.

    ``shot``: for the names of files and keys. ``response``: the run at the optimum. ``objective``: with its
    discrepancies. ``jacobian``: of the data vector by the free parameters, shape [k, d]. ``changes``: as for
    `kolsky.diagnosis.fit_quality.fit_quality`. ``again``: the solver for lags beyond the linear range.
    """
    shifted = late_prediction(response, objective)
    recordings = tuple(DIRECTIONS) if objective.observations.has_shape else (FORCE,)
    before = without_lag(objective, shifted, lambda _: jacobian)

    def fitted(name: str, seen: Shifted, slope: Shifted) -> FittedLag:
        return fit_lag(objective, seen, slope, DIRECTIONS[name], changes, before=before)

    def refitted(name: str, points: FloatArray, runs: Sequence[Response]) -> FittedLag:
        seen = [late_prediction(run, objective) for run in runs]
        return fitted(name, seen[0], slopes(points, seen))

    fits = {name: fitted(name, shifted, lambda _: jacobian) for name in recordings}
    if again is not None:
        fits = follow(fits, again, refitted)
    return tuple(
        ClockLag(
            name, fit.lag, fit.sigma if fit.settled else nan, fit.evidence, fit.explains, *origin(shot, name)
        )
        for name, fit in fits.items()
    )


def slopes(points: FloatArray, seen: Sequence[Shifted]) -> Shifted:
    """Effect of each parameter on late recordings, [k, d]; zero at a point that a run does not reach.

    ``points``: as for `Reruns.beside`, [d + 1, d]. ``seen``: the predictions at these points.
    """
    steps = np.diag(points[1:] - points[0])

    def slope(lags: FloatArray) -> FloatArray:
        first, *others = (one(lags) for one in seen)
        return np.nan_to_num((np.array(others) - first) / steps[:, None]).T

    return slope


def follow(
    fits: Mapping[str, FittedLag],
    again: Reruns,
    refit: Callable[[str, FloatArray, Sequence[Response]], FittedLag],
) -> dict[str, FittedLag]:
    """The lags refined with new runs, if the leading lag is significant but does not explain the data.

    ``fits``: by recording, the lags from the run at the optimum. ``again``: the solver. ``refit``: fits the
    lag of a recording to the runs at the points of `Reruns.beside`, a batch of one each.
    """
    leading = max(fits.values(), key=attrgetter("evidence"))
    if leading.explains or not (leading.significance > LATE and leading.evidence > 0.0):
        return dict(fits)
    going = [
        (name, start, point)
        for name, fit in fits.items()
        if fit.evidence >= RIVAL * leading.evidence
        for start, point in enumerate(again.starts(again.x + fit.move))
    ]
    found: dict[tuple[str, int], FittedLag] = {}
    for _ in range(TURNS):
        groups, moved = [again.beside(point) for *_, point in going], []
        response, size = again.run(np.concatenate(groups)), len(again.x) + 1
        for row, (name, start, point) in enumerate(going):
            rows = range(row * size, (row + 1) * size)
            if all(response.outcomes[i].ok for i in rows):
                fit = found[name, start] = refit(name, groups[row], [response.select([i]) for i in rows])
                to = again.inside(point + fit.move)
                if not np.allclose(to, point, rtol=PARAMETERS_STAY, atol=0.0):
                    moved.append((name, start, to))
        first = max(found, key=lambda key: found[key].evidence, default=None)
        if first is not None and found[first].explains:
            moved = [one for one in moved if one[:2] == first]  # only its value is still needed
        going = moved
        if not going:
            break
    followed = [(name, fit) for (name, _), fit in found.items()]
    return {
        name: max([fit, *(f for other, f in followed if other == name)], key=attrgetter("evidence"))
        for name, fit in fits.items()
    }


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
