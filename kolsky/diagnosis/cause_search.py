"""The search for the value of one changed input that explains the data best.

The free parameters are fitted again for each value.

First, every input is tried by one linear step from the answer. If this does not explain the data, large
changes are scanned and the best are refined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.diagnosis.cause_fit import (
    Allowances,
    ExpectedResidual,
    LinearFit,
    evidence,
    fit_linear,
    solve_linear,
)
from kolsky.diagnosis.cause_inputs import declared_span, leaves_length, start_of
from kolsky.diagnosis.cause_model import CauseModel, Point
from kolsky.inverse.result import COVERAGE
from kolsky.inverse.runner import Runner
from kolsky.shot.input_records import UNCHANGED, Cause


@dataclass(frozen=True)
class Trial:
    """An input at a value, with the best free parameters for it."""

    candidate: Cause
    x: FloatArray
    """Free parameters in SI, shape [d]."""
    u: float
    """Coordinate of the input."""
    misfits: FloatArray
    """`ExpectedResidual.misfits` at this point, shape [2]."""
    residual: FloatArray
    """Prediction minus data at this point, shape [k]."""
    fit: LinearFit | None = None
    """The last linear fit about it."""
    lost: str = ""
    """Reason why the input could not be tried; empty if it was tried."""

    @property
    def value(self) -> float:
        """Value that fits the data best, in the input's unit."""
        return self.candidate.value(self.u)

    @property
    def sigma(self) -> float:
        """Standard uncertainty of the value; NaN if it is unknown."""
        if self.fit is None or self.lost:
            return float("nan")
        low, high = self.candidate.lowest, self.candidate.highest
        one = float(np.sqrt(self.fit.covariance[-1, -1]))
        if not np.isfinite(one):
            return float("inf")
        reach = max(min(one, self.u - low, high - self.u), 1e-3 * one, 1e-15)
        up, down = min(self.u + reach, high), max(self.u - reach, low)
        slope = abs(self.candidate.value(up) - self.candidate.value(down)) / (up - down)
        return slope * one


FOLLOWED = 6
"""Maximum number of starts for Gauss-Newton steps."""
TURNS = 6
"""Maximum number of Gauss-Newton steps of each."""
KEPT = 60.0
"""A start is dropped if its loss exceeds the best one's by more than this."""
SETTLED = 0.1
"""A start has converged if a step reduces the loss by less than this."""
DAMPED = (1.0, 0.3, 0.1)
"""Shares of a step that are tried. The best share is used."""


class CauseSearch:
    """All candidates of one identification.

    In every trial, inputs may be wrong within k = 2 of their declared uncertainty. Only the remaining
    residual is a misfit. ``model``: data vectors. ``expected``: residual of a correct model. ``use``: entries
    of the data vector that are counted, shape [k]. ``candidates``: inputs that are tried or may be wrong.
    ``start``: default: the point of the model. Its residual is zero at an outline point that its run does not
    reach. Raises ValueError if that run does not complete.
    """

    def __init__(
        self,
        runner: Runner,
        model: CauseModel,
        expected: ExpectedResidual,
        use: BoolArray,
        candidates: Sequence[Cause],
        *,
        start: FloatArray | None = None,
    ) -> None:
        self.runner, self.model, self.expected, self.use = runner, model, expected, use
        self.problem = problem = runner.problem
        self.x = x = model.x if start is None else start
        slopes = model.slopes(x, UNCHANGED)
        steps = {c.key: (c, start_of(c, problem)) for c in candidates if np.isfinite(start_of(c, problem))}
        beside = [Point(x, c.changed(_inside(c, u + c.step))) for c, u in steps.values()]
        vectors = model.vectors([Point(x), *slopes, *beside])
        if not np.isfinite(vectors[0][: self.n_force]).all():
            raise ValueError("the run at the start of the search for a wrong input did not complete")
        self.vector = np.where(np.isfinite(vectors[0]), vectors[0], model.data)
        self.slope = self._columns(vectors, model.steps(x))
        self.columns: dict[str, FloatArray] = {}
        """Change of the prediction per unit of each candidate's coordinate, shape [k].

        A candidate with failed runs has none."""
        for (c, u), vector in zip(steps.values(), vectors[1 + len(slopes) :], strict=True):
            if np.isfinite(vector[: self.n_force]).all():
                change = np.nan_to_num(vector - self.vector)[use]
                self.columns[c.key] = change / (_inside(c, u + c.step) - u)
        self.declared = [
            c for c in candidates if c.key in self.columns and declared_span(c, runner) is not None
        ]
        here = self.residual(self.vector)
        null = solve_linear(here, self.slope, expected, self.allowed())
        self.at, self.left = self.clipped(x + null.step), null.residual
        self.bare_left = solve_linear(here, self.slope, expected).residual
        self.before, self.bare = expected.misfits(self.left), expected.misfits(self.bare_left)

    def judge(self, answer: CauseSearch) -> None:
        """Measure evidence relative to another search's answer, over these entries, if it fits better."""
        kept = self.use[answer.use]
        known = self.expected.misfits(answer.left[kept])
        if self.loss(known) < self.loss(self.before):
            self.before, self.bare = known, self.expected.misfits(answer.bare_left[kept])

    def seen(self, answer: CauseSearch, t: Trial) -> Trial:
        """Another search's trial, with the entries and the expected residual of this search."""
        residual = t.residual[self.use[answer.use]]
        return replace(t, residual=residual, misfits=self.expected.misfits(residual))

    def allowed(self, tried: Cause | None = None) -> Allowances:
        """Inputs that may be wrong within their declared uncertainty, without the tried input."""
        columns, lower, upper = [], [], []
        for c in self.declared:
            span = declared_span(c, self.runner)
            if span is None or (tried is not None and c.key == tried.key):
                continue
            unit, start = (span[1] - span[0]) / (2.0 * COVERAGE), start_of(c, self.problem)
            columns.append(unit * self.columns[c.key])
            lower.append((span[0] - start) / unit)
            upper.append((span[1] - start) / unit)
        B = np.array(columns).T if columns else np.zeros((int(self.use.sum()), 0))
        return Allowances(B, np.array(lower), np.array(upper))

    def relieved(self, residual: FloatArray, tried: Cause) -> FloatArray:
        """A residual minus the part that the declared uncertainties explain, shape [k]."""
        none = np.zeros((len(residual), 0))
        return solve_linear(residual, none, self.expected, self.allowed(tried)).residual

    def alone(self, c: Cause) -> Trial:
        """A declared input by one linear step. All other inputs have their declared values."""
        u, own = start_of(c, self.problem), self.columns[c.key]
        fit = fit_linear(self.residual(self.vector), np.column_stack([self.slope, own]), self.expected)
        misfits = self.expected.misfits(fit.residual)
        x = self.clipped(self.x + fit.step[:-1])
        return Trial(c, x, u + float(fit.step[-1]), misfits, fit.residual, fit)

    def residual(self, vector: FloatArray) -> FloatArray:
        """Prediction minus data at the counted entries, with the answer's value where not reached."""
        whole = np.where(np.isfinite(vector), vector, self.vector)
        return np.asarray((whole - self.model.data)[self.use])

    def gain(self, misfits: FloatArray) -> float:
        """Evidence for a change, relative to the unchanged answer."""
        return evidence(self.before, misfits, self.expected.times)

    def loss(self, misfits: FloatArray) -> float:
        """Loss that a search minimises. It still decreases below the residual of a correct model."""
        return float(self.expected.times @ np.log(np.maximum(misfits, 1e-3)))

    def _columns(self, vectors: FloatArray, steps: FloatArray) -> FloatArray:
        """Change of the vectors' counted entries per unit of each step, shape [k, d]."""
        change = np.nan_to_num(vectors[1 : 1 + len(steps)] - vectors[0])[:, self.use]
        return np.asarray((change / steps[:, None]).T)

    def tangents(self, candidates: Sequence[Cause]) -> list[Trial]:
        """Every candidate by one linear step from the answer, if it has a value at the answer."""
        found, here = [], self.residual(self.vector)
        for c in candidates:
            u = start_of(c, self.problem)
            if not np.isfinite(u):
                found.append(self._none(c, "no number describes it: other values are tried where needed"))
                continue
            if c.key not in self.columns:
                found.append(self._none(c, "the run with it changed did not complete"))
                continue
            own, allowed = self.columns[c.key], self.allowed(c)
            fit = fit_linear(here, np.column_stack([self.slope, own]), self.expected, allowed)
            to = float(np.clip(u + fit.step[-1], c.lowest, c.highest))
            misfits = self.expected.misfits(fit.residual)
            if to != u + fit.step[-1]:
                # The candidate ends at the limit of its range. The other unknowns are refitted there.
                at = solve_linear(here + own * (to - u), self.slope, self.expected, allowed)
                misfits = self.expected.misfits(at.residual)
            x = self.clipped(self.x + fit.step[:-1])
            found.append(Trial(c, x, to, misfits, fit.residual, fit))
        return found

    @property
    def n_force(self) -> int:
        """Number of force bins at the start of the data vector."""
        return self.model.observations.n_force

    def _none(self, c: Cause, why: str) -> Trial:
        return Trial(c, self.x, float("nan"), self.before, self.left, lost=why)

    def clipped(self, x: FloatArray) -> FloatArray:
        """Free parameters inside their ranges, shape [d]."""
        return np.clip(x, self.model.lower[: len(x)], self.model.upper[: len(x)])

    def followed(self, starts: Sequence[Trial]) -> list[Trial]:
        """Gauss-Newton steps from each start with new runs. Returns the answer if none is better."""
        trials: list[Trial] = self.measured(list(starts))
        done: list[Trial] = []
        for _ in range(TURNS):
            if not trials:
                break
            least = min(self.loss(t.misfits) for t in trials)
            points, steps = [], []
            for t in trials:
                c, changed = t.candidate, t.candidate.changed(t.u)
                steps.append(c.step if t.u + c.step <= c.highest else -c.step)
                points += [Point(t.x, changed), *self.model.slopes(t.x, changed)]
                points.append(Point(t.x, c.changed(t.u + steps[-1])))
            fits, vectors = [], np.split(self.model.vectors(points), len(trials))
            for t, step, rows in zip(trials, steps, vectors, strict=True):
                columns = self._columns(rows, np.append(self.model.steps(t.x), step))
                allowed = self.allowed(t.candidate)
                fits.append(fit_linear(self.residual(rows[0]), columns, self.expected, allowed))
            going: list[Trial] = []
            for old, new in zip(trials, self._better(trials, fits), strict=True):
                gained = self.loss(old.misfits) - self.loss(new.misfits) > SETTLED
                (going if gained and self.loss(new.misfits) < least + KEPT else done).append(new)
            trials = going
        return [*done, *trials]

    def measured(self, trials: list[Trial]) -> list[Trial]:
        """Trials evaluated by runs at their points, without those of failed runs."""
        vectors = self.model.vectors([Point(t.x, t.candidate.changed(t.u)) for t in trials])
        found = []
        for t, vector in zip(trials, vectors, strict=True):
            if np.isfinite(vector[: self.n_force]).all():
                residual = self.relieved(self.residual(vector), t.candidate)
                found.append(replace(t, residual=residual, misfits=self.expected.misfits(residual)))
        return found

    def _better(self, trials: list[Trial], fits: list[LinearFit]) -> list[Trial]:
        """Each trial after the best share of its step is applied."""
        moved = [
            replace(
                t,
                x=self.clipped(t.x + share * fit.step[:-1]),
                u=_inside(t.candidate, t.u + share * float(fit.step[-1])),
                fit=fit,
            )
            for t, fit in zip(trials, fits, strict=True)
            for share in DAMPED
        ]
        found, measured = [], self.measured(moved)
        for t, fit in zip(trials, fits, strict=True):
            tried = [replace(t, fit=fit), *(m for m in measured if m.fit is fit)]
            found.append(min(tried, key=lambda one: self.loss(one.misfits)))
        return found


def _inside(c: Cause, u: float) -> float:
    """A coordinate inside the input's range."""
    return float(min(max(u, c.lowest), c.highest))


def scan_inputs(search: CauseSearch, candidates: Sequence[Cause]) -> list[Trial]:
    """Starts: the two best large changes of every candidate, with the free parameters by a linear step.

    All changes are run in one launch on a coarse mesh. Ringing causes several minima. Values with failed runs
    are left out.
    """
    values = [(c, u) for c in candidates for u in c.scan if c.lowest <= u <= c.highest]
    tried = [(c, u) for c, u in values if leaves_length(search.runner, c.changed(u))]
    points, trials = [Point(search.x, c.changed(u)) for c, u in tried], dict[str, list[Trial]]()
    for (c, u), vector in zip(tried, search.model.screen.vectors(points), strict=True):
        if not np.isfinite(vector[: search.n_force]).all():
            continue
        fit = solve_linear(search.residual(vector), search.slope, search.expected, search.allowed(c))
        x = search.clipped(search.x + fit.step)
        trial = Trial(c, x, u, search.expected.misfits(fit.residual), fit.residual)
        trials.setdefault(c.key, []).append(trial)
    found = []
    for row in trials.values():
        row.sort(key=lambda t: t.u)
        losses = [search.loss(t.misfits) for t in row]
        lowest = [i for i in range(len(row)) if losses[i] <= min(losses[max(i - 1, 0) : i + 2])]
        found += [row[i] for i in sorted(lowest, key=lambda i: losses[i])[:2]]
    return found
