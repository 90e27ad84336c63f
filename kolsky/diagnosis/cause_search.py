"""The search for the value of one changed input that explains the data best, the free parameters found anew.

First every input by one linear step from the answer. Where the data are not explained as they are, values
far from what is declared are tried too, and the most promising inputs are followed by Gauss-Newton steps
with runs of their own: a gain of 2 or a Poisson's ratio with another rhythm is out of reach of a tangent.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.diagnosis.candidate_input import DECLARED, CandidateInput
from kolsky.diagnosis.cause_fit import Allowances, LinearFit, evidence, fit_linear, solve_linear
from kolsky.diagnosis.cause_model import CauseModel, Point
from kolsky.diagnosis.cause_trial import Trial
from kolsky.diagnosis.expected_residual import ExpectedResidual
from kolsky.inverse.cause_results import COVERAGE
from kolsky.inverse.staged_runs import StagedRuns

FOLLOWED = 6
"""Most starts that are followed by Gauss-Newton steps."""
TURNS = 6
"""Most Gauss-Newton steps of each."""
KEPT = 60.0
"""A start is given up when its loss is so much above the best one's."""
SETTLED = 0.1
"""And is at rest when a step makes the loss smaller by less."""
DAMPED = (1.0, 0.3, 0.1)
"""Shares of a step of which the best is taken."""


class CauseSearch:
    """All candidates of one identification.

    What is declared as uncertain may be off within k = 2 of that, whatever is tried: only what that leaves
    is a misfit.

    Parameters
    ----------
    stages, model, expected
        The identification's simulations, data vectors from them, what a right model leaves.
    use
        Entries of the data vector that are counted, shape [k].
    candidates
        Inputs that are tried, or may be off.
    start
        Where the search begins; the model's own point if left out.
    """

    def __init__(
        self,
        stages: StagedRuns,
        model: CauseModel,
        expected: ExpectedResidual,
        use: BoolArray,
        candidates: Sequence[CandidateInput],
        *,
        start: FloatArray | None = None,
    ) -> None:
        self.stages, self.model, self.expected, self.use = stages, model, expected, use
        self.x = x = model.x if start is None else start
        slopes = model.slopes(x, DECLARED)
        steps = {c.key: (c, c.start(stages)) for c in candidates if np.isfinite(c.start(stages))}
        beside = [Point(x, c.changed(_inside(c, u + c.step))) for c, u in steps.values()]
        vectors = model.vectors([Point(x), *slopes, *beside])
        self.vector = vectors[0]
        self.slope = self._columns(vectors, model.steps(x))
        self.columns: dict[str, FloatArray] = {}
        """Change of the prediction per unit of each candidate's coordinate, shape [k]; of lost runs none."""
        for (c, u), vector in zip(steps.values(), vectors[1 + len(slopes) :], strict=True):
            if np.isfinite(vector[: self.n_force]).all():
                change = np.nan_to_num(vector - self.vector)[use]
                self.columns[c.key] = change / (_inside(c, u + c.step) - u)
        self.declared = [c for c in candidates if c.key in self.columns and c.within(stages) is not None]
        here = self.residual(self.vector)
        self.null = solve_linear(here, self.slope, expected, self.allowed())
        self.at, self.left = self.clipped(x + self.null.step), self.null.residual
        self.bare_left = solve_linear(here, self.slope, expected).residual
        self.before, self.bare = expected.misfits(self.left), expected.misfits(self.bare_left)

    def against(self, unchanged: Trial) -> None:
        """Let evidence count against other free parameters with no input changed, if they are better."""
        if self.loss(unchanged.misfits) < self.loss(self.before):
            self.at, self.left, self.before = unchanged.x, unchanged.residual, unchanged.misfits
            self.bare_left = self.residual(self.model.vectors([Point(self.at)])[0])
            self.bare = self.expected.misfits(self.bare_left)

    def judge(self, answer: CauseSearch, trials: Sequence[Trial]) -> list[Trial]:
        """Let evidence count against another search's answer, if that is the better one; its trials as here.

        Parameters
        ----------
        answer
            The search from the answer, of the same data; it counts all entries that count here.
        trials
            What it found.

        Returns
        -------
        list of Trial
            The same with the entries that count here, and their misfits by what is expected here.
        """
        kept = self.use[answer.use]
        known = self.expected.misfits(answer.left[kept])
        if self.loss(known) < self.loss(self.before):
            self.before, self.bare = known, self.expected.misfits(answer.bare_left[kept])
        found = []
        for t in trials:
            residual = t.residual[kept]
            found.append(replace(t, residual=residual, misfits=self.expected.misfits(residual)))
        return found

    def allowed(self, tried: CandidateInput | None = None) -> Allowances:
        """What may be off within its declared uncertainty, without the input that is tried."""
        columns, lower, upper = [], [], []
        for c in self.declared:
            span = c.within(self.stages)
            if span is None or (tried is not None and c.key == tried.key):
                continue
            unit, start = (span[1] - span[0]) / (2.0 * COVERAGE), c.start(self.stages)
            columns.append(unit * self.columns[c.key])
            lower.append((span[0] - start) / unit)
            upper.append((span[1] - start) / unit)
        B = np.array(columns).T if columns else np.zeros((int(self.use.sum()), 0))
        return Allowances(B, np.array(lower), np.array(upper))

    def relieved(self, residual: FloatArray, tried: CandidateInput) -> FloatArray:
        """A residual less what the declared uncertainties explain of it, shape [k]."""
        none = np.zeros((len(residual), 0))
        return solve_linear(residual, none, self.expected, self.allowed(tried)).residual

    def alone(self, c: CandidateInput) -> Trial:
        """A declared input by one linear step with all others as they are declared."""
        u, own = c.start(self.stages), self.columns[c.key]
        fit = fit_linear(self.residual(self.vector), np.column_stack([self.slope, own]), self.expected)
        misfits = self.expected.misfits(fit.residual)
        x = self.clipped(self.x + fit.step[:-1])
        return Trial(c, x, u + float(fit.step[-1]), misfits, fit.residual, fit)

    def residual(self, vector: FloatArray) -> FloatArray:
        """Prediction minus data at the counted entries; a point that is not reached is as at the answer."""
        whole = np.where(np.isfinite(vector), vector, self.vector)
        return np.asarray((whole - self.model.data)[self.use])

    def gain(self, misfits: FloatArray) -> float:
        """Evidence for a change against the answer as it is."""
        return evidence(self.before, misfits, self.expected.times)

    def loss(self, misfits: FloatArray) -> float:
        """What a search makes small; below what a right model leaves it still falls."""
        return float(self.expected.times @ np.log(np.maximum(misfits, 1e-3)))

    def _columns(self, vectors: FloatArray, steps: FloatArray) -> FloatArray:
        """Change of the vectors' counted entries per unit of each step, shape [k, d]."""
        change = np.nan_to_num(vectors[1 : 1 + len(steps)] - vectors[0])[:, self.use]
        return np.asarray((change / steps[:, None]).T)

    def tangents(self, candidates: Sequence[CandidateInput]) -> list[Trial]:
        """Every candidate by one linear step from the answer; none where it has no value there."""
        found, here = [], self.residual(self.vector)
        for c in candidates:
            u = c.start(self.stages)
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
                # It ends at the edge of what can be: the others follow it there.
                at = solve_linear(here + own * (to - u), self.slope, self.expected, allowed)
                misfits = self.expected.misfits(at.residual)
            x = self.clipped(self.x + fit.step[:-1])
            found.append(Trial(c, x, to, misfits, fit.residual, fit))
        return found

    @property
    def n_force(self) -> int:
        """Force bins at the head of the data vector."""
        return self.model.observations.n_force

    def _none(self, c: CandidateInput, why: str) -> Trial:
        return Trial(c, self.x, float("nan"), self.before, self.left, lost=why)

    def clipped(self, x: FloatArray) -> FloatArray:
        """Free parameters inside their ranges, shape [d]."""
        return np.clip(x, self.model.lower[: len(x)], self.model.upper[: len(x)])

    def followed(self, starts: Sequence[Trial]) -> list[Trial]:
        """Gauss-Newton steps from each start with runs of their own; the answer itself if none is better."""
        trials, done = self.measured(list(starts)), []
        for _ in range(TURNS):
            least = min((self.loss(t.misfits) for t in trials), default=0.0)
            points, counts = [], []
            for t in trials:
                step = self._own_step(t)
                points += [
                    Point(t.x, t.candidate.changed(t.u)),
                    *self.model.slopes(t.x, t.candidate.changed(t.u)),
                    Point(t.x, t.candidate.changed(t.u + step)),
                ]
                counts.append(step)
            vectors = self.model.vectors(points)
            size = len(self.model.x) + 2
            fits = []
            for i, (t, step) in enumerate(zip(trials, counts, strict=True)):
                rows = vectors[i * size : (i + 1) * size]
                columns = self._columns(rows, np.append(self.model.steps(t.x), step))
                allowed = self.allowed(t.candidate)
                fits.append(fit_linear(self.residual(rows[0]), columns, self.expected, allowed))
            moved = self._better(trials, fits)
            going = [
                self.loss(old.misfits) - self.loss(new.misfits) > SETTLED
                and self.loss(new.misfits) < least + KEPT
                for old, new in zip(trials, moved, strict=True)
            ]
            done += [t for t, goes in zip(moved, going, strict=True) if not goes]
            trials = [t for t, goes in zip(moved, going, strict=True) if goes]
            if not trials:
                break
        return [*done, *trials]

    def _own_step(self, t: Trial) -> float:
        """Step of the input's coordinate for differences, inward at its end."""
        c = t.candidate
        return c.step if t.u + c.step <= c.highest else -c.step

    def measured(self, trials: list[Trial]) -> list[Trial]:
        """Trials as runs at their points find them; those whose runs are lost are left out."""
        vectors = self.model.vectors([Point(t.x, t.candidate.changed(t.u)) for t in trials])
        found = []
        for t, vector in zip(trials, vectors, strict=True):
            if np.isfinite(vector[: self.n_force]).all():
                residual = self.relieved(self.residual(vector), t.candidate)
                found.append(replace(t, residual=residual, misfits=self.expected.misfits(residual)))
        return found

    def _better(self, trials: list[Trial], fits: list[LinearFit]) -> list[Trial]:
        """Each trial after the best share of its step."""
        tried = []
        for t, fit in zip(trials, fits, strict=True):
            for share in DAMPED:
                x = self.clipped(t.x + share * fit.step[:-1])
                u = _inside(t.candidate, t.u + share * float(fit.step[-1]))
                tried.append(replace(t, x=x, u=u, fit=fit))
        vectors = self.model.vectors([Point(t.x, t.candidate.changed(t.u)) for t in tried])
        found = []
        for i, (t, fit) in enumerate(zip(trials, fits, strict=True)):
            best = replace(t, fit=fit, step=float(fit.step[-1]))
            for j in range(i * len(DAMPED), (i + 1) * len(DAMPED)):
                if not np.isfinite(vectors[j][: self.n_force]).all():
                    continue
                residual = self.relieved(self.residual(vectors[j]), t.candidate)
                misfits = self.expected.misfits(residual)
                if self.loss(misfits) < self.loss(best.misfits):
                    best = replace(tried[j], residual=residual, misfits=misfits)
            found.append(best)
        return found


def _inside(c: CandidateInput, u: float) -> float:
    """A coordinate inside the input's range."""
    return float(min(max(u, c.lowest), c.highest))
