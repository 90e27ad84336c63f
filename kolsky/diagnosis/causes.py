"""Which input is wrong? Each is changed alone until the model explains the data best, and they are ranked."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import nan

import numpy as np

from explicit import Response
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.base.process import one_blas_thread
from kolsky.diagnosis.candidate_input import DENSITY, SENSITIVITY, CandidateInput
from kolsky.diagnosis.cause_expected import expected_residual
from kolsky.diagnosis.cause_inputs import CANDIDATES
from kolsky.diagnosis.cause_model import CauseModel, Point
from kolsky.diagnosis.cause_ranking import ranked
from kolsky.diagnosis.cause_scan import scanned
from kolsky.diagnosis.cause_search import FOLLOWED, CauseSearch
from kolsky.diagnosis.cause_trial import Trial
from kolsky.diagnosis.cause_valleys import in_valleys, valley_is_free, without_change
from kolsky.diagnosis.thresholds import UNEXPLAINED
from kolsky.inverse.cause_results import CauseFinding
from kolsky.inverse.staged_runs import StagedRuns


@dataclass(frozen=True)
class CauseAnalysis:
    """All inputs that were tried."""

    findings: tuple[CauseFinding, ...]
    """The likely causes first, the most likely before all; then the others by their evidence."""
    misfits: FloatArray
    """Mean squared residual of force and outline over what a right model leaves, shape [2]."""
    lost: str = ""
    """Why nothing could be tried; empty if it was."""

    @property
    def named(self) -> tuple[CauseFinding, ...]:
        """The likely causes."""
        return tuple(finding for finding in self.findings if finding.named)


@dataclass(frozen=True)
class OtherStart:
    """Another point from which causes are searched, with a run of its own on the refined mesh."""

    x: FloatArray
    """Free parameters in SI, shape [d]."""
    refined: Response
    """The run there, a batch of one."""


Elsewhere = Callable[[], OtherStart | None]
"""Gives another point, None if there is none; asked when the search from the answer has ended."""


@dataclass(frozen=True)
class Best:
    """The best value of an input, of those that the searches found."""

    seen: Trial
    """As the search that ranks it sees it."""
    own: Trial
    """As its own search found it."""
    search: CauseSearch
    """That search."""


def find_causes(
    stages: StagedRuns,
    x: FloatArray,
    refined: Response,
    *,
    other: Elsewhere = lambda: None,
    explained: Callable[[], bool] = lambda: False,
) -> CauseAnalysis:
    """Try every input as the cause of the misfit.

    Parameters
    ----------
    stages
        The identification's simulations.
    x
        The answer in SI, shape [d].
    refined
        The run on the refined mesh there, a batch of one.
    other
        Where to search too, for an answer that the model does not explain: a wrong input may have led the
        free parameters into a valley from which no step leads back once the input is put right.
    explained
        Whether the goodness of fit leaves no misfit that is out of a tangent's reach, see
        `kolsky.diagnosis.verdicts.near_right`; asked where the search itself would look far away.
    """
    started = time.perf_counter()
    try:
        with one_blas_thread():
            return _analysed(stages, x, refined, other, explained)
    except (ValueError, ArithmeticError) as error:
        return CauseAnalysis((), np.full(2, nan), str(error))
    finally:
        stages.seconds["causes"] = time.perf_counter() - started


def _analysed(
    stages: StagedRuns,
    x: FloatArray,
    refined: Response,
    elsewhere: Elsewhere,
    explained: Callable[[], bool],
) -> CauseAnalysis:
    candidates = [c for c in CANDIDATES if c.here(stages)]
    search = search_from(stages, CauseModel(stages, x, refined), candidates)
    trials = best_trials(search, candidates, explained=explained)
    found = _findings(search, [Best(t, t, search) for t in trials], candidates)
    other = elsewhere()
    if other is not None:
        # At the answer the meshes are in step; at the other point the difference of its own two runs serves.
        apart = StagedRuns(stages.prepared, stages.settings, stages.box, stages.progress, prior=stages.prior)
        model = CauseModel(apart, other.x, other.refined)
        second = search_from(apart, model, candidates, counted=search.use)
        seen = second.judge(search, trials)
        both = [Best(s, t, search) for s, t in zip(seen, trials, strict=True)]
        both += [Best(t, t, second) for t in best_trials(second, candidates)]
        more = _findings(second, best_of_each(both, second), candidates)
        found = more if more and more[0].named else found
    return CauseAnalysis(found, search.before)


def search_from(
    stages: StagedRuns,
    model: CauseModel,
    candidates: Sequence[CandidateInput],
    *,
    counted: BoolArray | None = None,
) -> CauseSearch:
    """The search from a model's own point.

    Parameters
    ----------
    stages, model, candidates
        As of `CauseSearch`.
    counted
        Entries of the data that may count, shape [k]; all that the model reaches if left out.
    """
    settings = stages.settings
    known = np.isfinite(model.vectors([Point(model.x)])[0])
    known &= True if counted is None else counted
    expected = expected_residual(model, settings.numerics.with_mesh(settings.replicate_mesh))
    return CauseSearch(stages, model, expected.among(known), known, candidates)


def best_of_each(trials: Sequence[Best], judge: CauseSearch) -> list[Best]:
    """Of each input the trial with the least loss; one that could be tried before one that could not."""
    best: dict[str, Best] = {}
    for one in trials:
        key = one.seen.candidate.key
        if key not in best or _badness(one.seen, judge) < _badness(best[key].seen, judge):
            best[key] = one
    return list(best.values())


def _badness(t: Trial, judge: CauseSearch) -> tuple[bool, float]:
    return bool(t.lost), judge.loss(t.misfits)


def _findings(
    judge: CauseSearch, trials: Sequence[Best], candidates: Sequence[CandidateInput]
) -> tuple[CauseFinding, ...]:
    """The ranked findings, the first of them renewed if it is a likely cause."""
    findings = ranked(judge, [one.seen for one in trials])
    if not (findings and findings[0].named):
        return findings
    first = next(one for one in trials if one.own.candidate.key == findings[0].key)
    rest = [c for c in candidates if c is not first.own.candidate]
    return beside(first.search, first.own, findings, rest)


def beside(
    search: CauseSearch, first: Trial, findings: tuple[CauseFinding, ...], rest: Sequence[CandidateInput]
) -> tuple[CauseFinding, ...]:
    """The findings with the first renewed on the refined mesh, and with what else is wrong beside it.

    A change that needs other runs has left the correction by the refined mesh behind, and so has one with
    which a free Poisson's ratio is in step in another valley: one run there renews it. Then the first input
    is free as the parameters are, and the others are tried beside it: with the first put right, what they
    explained alone says nothing more of them.
    """
    c, stages = first.candidate, search.stages
    at, refined = np.append(search.model.x, c.start(stages)), search.model.refined
    start = np.append(first.x, first.u)
    if c.simulated or valley_is_free(search):
        run = search.model.refined_run(Point(first.x, c.changed(first.u)))
        if run is None:
            return findings
        at, refined = start, run
        fine = CauseModel(stages, at, refined, c)
        declared = [one for one in rest if one.within(stages) is not None]
        again = CauseSearch(stages, fine, search.expected, search.use, declared, start=start)
        # Losses with the earlier correction are no measure of those with this one.
        (first,) = again.followed([first]) or [first]
        start = np.append(first.x, first.u)
    fine = CauseModel(stages, at, refined, c)
    second = CauseSearch(stages, fine, search.expected, search.use, rest, start=start)
    trials = best_trials(second, rest)
    x = second.at
    names = stages.box.names
    renewed = replace(
        findings[0],
        value=c.value(float(x[-1])),
        parameters=dict(zip(names, x[: len(names)].tolist(), strict=True)),
    )
    more = tuple(replace(f, beside=c.key) for f in ranked(second, trials, refuted=c.key))
    return (renewed, *listed_beside(more, findings[1:]))


def listed_beside(more: Sequence[CauseFinding], alone: Sequence[CauseFinding]) -> tuple[CauseFinding, ...]:
    """What follows the first cause: likely ones beside it, likely ones in its place, the rest.

    Parameters
    ----------
    more
        Findings beside the first cause, in their order.
    alone
        The same inputs, each as the only cause, in their order; inputs that were not tried beside it too.
    """
    likely = [f for f in more if f.named]
    likely += [f for f in alone if f.named and f.key not in {one.key for one in likely}]
    known = {f.key for f in likely}
    rest = [f for f in more if f.key not in known and not f.status]
    known |= {f.key for f in rest}
    return (*likely, *rest, *(f for f in alone if f.key not in known))


def best_trials(
    search: CauseSearch,
    candidates: Sequence[CandidateInput],
    *,
    explained: Callable[[], bool] = lambda: False,
) -> list[Trial]:
    """The best value of every candidate; far ones are tried only where the data are not explained.

    What a right model leaves is known to the search from two meshes alone; `explained` may know better, and
    is asked where the search's own misfit is too large.
    """
    tangents = search.tangents(candidates)
    if not (search.before > UNEXPLAINED).any() or explained():
        return tangents
    starts = [t for t in tangents if not t.lost] + scanned(search, candidates)
    starts = sorted(starts, key=lambda t: search.loss(t.misfits))[:FOLLOWED]
    if valley_is_free(search):
        without_change(search)
        starts = in_valleys(search, starts)
    followed = search.followed([*starts, *_same_force(search, starts)])
    best = {t.candidate.key: t for t in tangents}
    for t in sorted(followed, key=lambda t: -search.loss(t.misfits)):
        if search.gain(t.misfits) > 0.0:  # else the tangent tells more
            best[t.candidate.key] = t
    return list(best.values())


def _same_force(search: CauseSearch, starts: Sequence[Trial]) -> list[Trial]:
    """A density for each gain of the force: these and stress scaled alike leave the motion."""
    names = search.stages.box.names
    gains = [t for t in starts if t.candidate.key == SENSITIVITY]
    density = next(c for c in CANDIDATES if c.key == DENSITY)
    if not gains or "stiffness_factor" not in names:
        return []
    x = gains[0].x.copy()
    x[names.index("stiffness_factor")] *= gains[0].u
    x = np.clip(x, search.model.lower, search.model.upper)
    return [replace(gains[0], candidate=density, x=x, u=gains[0].u - 1.0)]
