"""Search for a wrong input.

Each input is changed to give the best fit. The changes are ranked and described.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import floor, inf, isfinite, log10, nan

import numpy as np

from doe import Box
from explicit import Response
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.base.process import one_blas_thread
from kolsky.diagnosis.cause_fit import chance, evidence, explained_share, holm
from kolsky.diagnosis.cause_inputs import can_be_tried, declared_sigma, declared_span, held_value, start_of
from kolsky.diagnosis.cause_model import CauseModel, Point, expected_residual
from kolsky.diagnosis.cause_search import FOLLOWED, KEPT, CauseSearch, Trial, scan_inputs
from kolsky.diagnosis.fit_quality import EDGE, UNEXPLAINED
from kolsky.inverse.parameters import MOVED
from kolsky.inverse.problem import InverseProblem
from kolsky.inverse.result import COVERAGE, CauseFinding, Estimate
from kolsky.inverse.runner import Runner
from kolsky.inverse.surrogate_mesh_search import search_meshes
from kolsky.inverse.valleys import VALLEY
from kolsky.shot.input_records import SHOWN, Cause
from kolsky.shot.inputs import CURVE_SCALE, DAMPING, DENSITY, POISSON, SENSITIVITY, causes

LEVEL = 0.01
"""A change is significant if its probability, adjusted for all inputs tried, is below this."""
EVIDENCE = 100.0
"""Smallest evidence of a cause that is reported; see docs/validation/wrong_inputs."""
ALIKE = 10.0
"""Inputs with a smaller difference of their losses are alike: likelihoods within a factor of exp(5)."""
ASSUMED = "model."
"""Prefix of the keys of assumptions: values that were not measured on the specimen."""
LEAST_SHARE = 0.25
"""Smallest share of the misfit that a cause explains if its evidence is below `EVIDENCE`. If every cause
explains less, another error is likely in addition."""
FREED_TOGETHER = (POISSON, DAMPING)
"""Assumptions that an identification frees together by default. If one is refuted, the pair is refuted."""


def ranked(search: CauseSearch, trials: Sequence[Trial], *, refuted: str = "") -> tuple[CauseFinding, ...]:
    """The ranked findings, with probabilities adjusted for all tests, and indistinguishable inputs.

    An input with its best value within k = 2 of its declared uncertainty is never a likely cause. It is
    listed with the part that it explains separately. ``trials``: the best value of every input. ``refuted``:
    key of a likely cause that is free together with the parameters; empty if there is none.
    """
    adjusted = holm([_chance(search, t) for t in trials])
    entries = np.array([(search.expected.channel == c).sum() for c in range(2)])
    rows = []
    for t, probability in zip(trials, adjusted, strict=True):
        gain = search.gain(t.misfits) if not t.lost else 0.0
        share = explained_share(search.before, t.misfits, entries)
        strong = not t.lost and probability < LEVEL and gain >= EVIDENCE and share >= 0.0
        alone = None if strong or t.candidate not in search.declared else search.alone(t.candidate)
        if alone is not None and _within(search, alone):
            t, gain = alone, evidence(search.bare, alone.misfits, search.expected.times)
            share = explained_share(search.bare, alone.misfits, entries)
        rows.append((t, probability, gain, share, strong and not _within(search, t)))
    likely = [row for row in rows if row[-1]]
    order = in_groups(search, [row[0] for row in likely])
    likely.sort(key=lambda row: order.index(row[0].candidate.key))
    rest = [row for row in rows if not row[-1]]
    losses = [search.loss(row[0].misfits) for row in rest]
    keys = [row[0].candidate.key for row in rest]
    rest = [rest[i] for i in by_evidence(keys, [row[2] for row in rest], losses)]
    if not likely and rest and _explains_all(rest[0], refuted) and not _within(search, rest[0][0]):
        likely, rest = [(*rest[0][:-1], True)], rest[1:]
        groups = [row[0] for row in (*likely, *rest) if not row[0].lost]
    else:
        groups = [row[0] for row in likely]
    found = []
    for row in (*likely, *rest):
        loss = search.loss(row[0].misfits)
        near = [t for t in groups if t is not row[0] and abs(search.loss(t.misfits) - loss) <= ALIKE]
        found.append(_finding(search, *row, alike=tuple(t.candidate.key for t in near if row[-1])))
    return tuple(found)


def _explains_all(row: tuple[Trial, float, float, float, bool], refuted: str) -> bool:
    """True if the leading input after a refuted one is of its pair and significant by itself."""
    # Evidence and share of the first input refute that both values are correct, the probability of this
    # value with the first input free that this one is.
    t, probability, gain, _, _ = row
    pair = refuted in FREED_TOGETHER and t.candidate.key in FREED_TOGETHER
    return pair and not t.lost and gain > ALIKE and probability < LEVEL


def by_evidence(keys: Sequence[str], evidences: Sequence[float], losses: Sequence[float]) -> list[int]:
    """Order of inputs by decreasing evidence, and by increasing loss if it is equal.

    Inputs whose evidence differs by less than `ALIKE` cannot be distinguished. Of these, `ASSUMED` ones come
    first: they were not measured on the specimen and are more likely to be wrong than a measured length.
    """
    left, order = sorted(range(len(keys)), key=lambda i: (-evidences[i], losses[i])), []
    while left:
        first = evidences[left[0]]
        group = [i for i in left if first > ALIKE and first - evidences[i] < ALIKE] or left[:1]
        order += sorted(group, key=lambda i: not keys[i].startswith(ASSUMED))
        left = [i for i in left if i not in group]
    return order


def _within(search: CauseSearch, t: Trial) -> bool:
    """True if the value lies within k = 2 of the declared value."""
    span = declared_span(t.candidate, search.runner)
    return span is not None and span[0] <= t.u <= span[1]


def in_groups(search: CauseSearch, trials: Sequence[Trial]) -> list[str]:
    """Keys by increasing loss. Among indistinguishable keys, the most usual error comes first."""
    left, order = sorted(trials, key=lambda t: search.loss(t.misfits)), []
    while left:
        first = search.loss(left[0].misfits)
        group = [t for t in left if search.loss(t.misfits) - first <= ALIKE]
        keys = [t.candidate.key for t in sorted(group, key=lambda t: _unusual(search, t))]
        order += without_twin_between(keys)
        left = left[len(group) :]
    return order


def without_twin_between(keys: Sequence[str]) -> list[str]:
    """Keys of equal rank; the second of gain and density, which both scale the force, is moved last."""
    twins = [key for key in keys if key in (SENSITIVITY, DENSITY)]
    return [*(key for key in keys if key not in twins[1:]), *twins[1:]]


def _unusual(search: CauseSearch, t: Trial) -> float:
    """`strangeness` of the change, relative to the larger of the declared and the usual uncertainty."""
    c, declared = t.candidate, search.problem.shot.uncertainty
    scale = declared_sigma(c, search.runner)
    if not declared.get(c.declared, 0.0) > 0.0:
        scale = max(scale, c.typical)
    return strangeness(c, t.value, t.sigma, start=held_value(c, search.problem), scale=scale)


MISTAKE = 2.0
"""Size of a usual mistake (a factor of two, another definition) in standard uncertainties: 1 input in 20."""
NEAR = 0.05
"""A value within this share of a mistake's size, by errors of other inputs, counts as this mistake."""


def strangeness(c: Cause, value: float, sigma: float, *, start: float, scale: float) -> float:
    """Size of a change divided by its usual standard uncertainty [-], at most `MISTAKE` for a usual mistake.

    ``value``, ``sigma``: the best value and its uncertainty. ``start``: the declared value; NaN for an input
    without a number. ``scale``: the usual standard uncertainty.
    """
    known = isfinite(start)
    away = abs(value - start) / scale if known and isfinite(scale) else inf
    wide = 2.0 * sigma if isfinite(sigma) else 0.0
    for mistake in c.mistakes:
        reach = max(wide, NEAR * abs(mistake - start) if known else c.typical)
        if abs(value - mistake) <= reach:
            away = min(away, MISTAKE)
    return away


def _chance(search: CauseSearch, t: Trial) -> float:
    """Probability of such a change if the input is correct within its declared uncertainty."""
    if t.lost or t.fit is None:
        return 1.0
    degrees = len(t.residual) / max(t.fit.inflation, 1.0) - len(t.fit.step)
    start = held_value(t.candidate, search.problem)
    if not isfinite(start):
        return chance(np.sqrt(max(search.gain(t.misfits), 0.0)), 1.0, degrees=degrees)
    return chance(
        t.value - start, float(np.hypot(t.sigma, declared_sigma(t.candidate, search.runner))), degrees=degrees
    )


def _finding(
    search: CauseSearch,
    t: Trial,
    probability: float,
    gain: float,
    share: float,
    named: bool,
    *,
    alike: tuple[str, ...],
) -> CauseFinding:
    names, c = search.problem.box.names, t.candidate
    sigmas = np.zeros(0) if t.fit is None or t.lost else np.sqrt(np.diag(t.fit.covariance))
    return CauseFinding(
        key=c.key,
        words=c.words,
        unit=c.unit,
        exact=held_value(c, search.problem),
        value=nan if t.lost else t.value,
        sigma=nan if t.lost else t.sigma,
        explained=share,
        evidence=gain,
        probability=probability,
        parameters={} if t.lost else dict(zip(names, t.x.tolist(), strict=False)),
        sigmas=dict(zip(names, sigmas.tolist(), strict=False)),
        named=named,
        alike=alike,
        status=t.lost,
        declared_sigma=declared_sigma(c, search.runner) or None,
    )


@dataclass(frozen=True)
class CauseAnalysis:
    """All inputs that were tried."""

    findings: tuple[CauseFinding, ...]
    """The likely causes, the most likely first. The other inputs follow by their evidence."""
    misfits: FloatArray
    """Mean squared residual of force and outline, divided by that of a correct model, shape [2]."""
    unchanged: Mapping[str, float] = field(default_factory=dict)
    """The free parameters by the same search without a changed input."""
    lost: str = ""
    """Reason why an input could not be searched, or none could be; empty if all were."""

    @property
    def named(self) -> tuple[CauseFinding, ...]:
        """The likely causes."""
        return tuple(finding for finding in self.findings if finding.named)


OtherStart = tuple[FloatArray, Response]
"""Another start for the search of causes: free parameters in SI, [d], and their run on the refined mesh."""


@dataclass(frozen=True)
class Best:
    """The best value of an input from all searches."""

    seen: Trial
    """The trial, evaluated by the ranking search."""
    own: Trial
    """The trial, as found by its search."""
    search: CauseSearch
    model: CauseModel | None = None
    """The model corrected by a run on the refined mesh at its point; None without such a run."""

    def renewed(self, judge: CauseSearch) -> Best:
        """The model after a refinement from a run on the refined mesh at its point, if that run completes."""
        t, search = self.own, self.search
        run = search.model.refined_run(Point(t.x, t.candidate.changed(t.u)))
        if run is None:
            return self
        start = np.append(t.x, t.u)
        model = CauseModel(search.runner, start, run, t.candidate)
        beside = [c for c in search.declared if c.key != t.candidate.key]
        again = CauseSearch(search.runner, model, search.expected, search.use, beside, start=start)
        own = min(again.followed([t]), key=lambda one: search.loss(one.misfits), default=t)
        return Best(judge.seen(search, own), own, search, model)


def find_causes(
    runner: Runner,
    x: FloatArray,
    refined: Response,
    *,
    other: OtherStart | None = None,
    explained: bool = False,
) -> CauseAnalysis:
    """Try every input as the cause of the misfit.

    ``x``, ``refined``: the answer in SI, [d], and its run on the refined mesh, a batch of one. ``other``: a
    second such pair, used if the model does not explain the data: a wrong input may have led the free
    parameters into another valley, from which no step leads back once it is corrected. ``explained``: True if
    the misfit is small enough for linear steps, see `kolsky.diagnosis.fit_quality.near_right`.
    """
    try:
        with one_blas_thread(), runner.work.stage("causes", 1):
            return _analysed(runner, x, refined, other, explained)
    except (ValueError, ArithmeticError) as error:
        return CauseAnalysis((), np.full(2, nan), lost=str(error))


def _analysed(
    runner: Runner, x: FloatArray, refined: Response, other: OtherStart | None, explained: bool
) -> CauseAnalysis:
    ends = stiffness_at_bound(runner.problem.box, x)
    tried = [c for c in causes() if ends or c.needs != "stiffness at its bound"]
    candidates = [c for c in tried if can_be_tried(c, runner.problem)]
    search = _search_from(CauseModel(runner, x, refined), candidates)
    trials = best_trials(search, candidates, explained=explained)
    unchanged = dict(zip(runner.problem.box.names, search.at.tolist(), strict=False))
    bests = [Best(t, t, search) for t in trials]
    lost = ""
    if not explained and (search.before > UNEXPLAINED).any():
        try:
            bests = best_of_each([*bests, *_freed_poisson(search, candidates)], search)
        except ValueError as error:  # the other causes remain
            lost = f"the valleys of Poisson's ratio: {error}"
    found = _findings(search, bests, candidates)
    if other is not None and not any(solved(one.seen) for one in bests):
        # At the answer, the meshes are in phase. At the other point, the difference of its two runs is used.
        model = CauseModel(runner.under(runner.front, {}), *other)
        second = _search_from(model, candidates, counted=search.use)
        second.judge(search)
        both = [replace(one, seen=second.seen(search, one.own)) for one in bests]
        both += [Best(t, t, second) for t in best_trials(second, candidates)]
        more = _findings(second, best_of_each(both, second), candidates)
        found = more if more and more[0].named else found
    return CauseAnalysis(found, search.before, unchanged, lost)


def _freed_poisson(search: CauseSearch, candidates: Sequence[Cause]) -> list[Best]:
    """A held Poisson's ratio by the search of its valleys, as if it were free, then on the refined mesh.

    The valleys are narrow and many: no step from the answer leads to another one. Raises ValueError if no run
    of the scan completes.
    """
    held = next((c for c in candidates if c.key == POISSON), None)
    if held is None:
        return []
    problem, settings = search.problem, search.problem.settings
    others = {name: value for name, value in settings.held.items() if name != VALLEY}
    hold = tuple(name for name in settings.hold if name != VALLEY)
    freed = replace(settings, free={**problem.freed.free, VALLEY: None}, held=others, hold=hold)
    wide = InverseProblem.freeing(problem.prepared, replace(problem.freed, settings=freed))
    start = np.clip(wide.declared, wide.box.lower, wide.box.upper)
    start[: len(search.x)] = search.x
    found = search_meshes(Runner.of(wide, search.runner.work), start).optima[wide.numerics.mesh].x
    x = search.clipped(found[:-1] - search.runner.offset(wide.numerics.mesh))
    trial = Trial(held, x, held.coordinate(float(found[-1])), search.before, search.left)
    return [Best(t, t, search).renewed(search) for t in search.measured([trial])]


SOLVED = 1.5
"""No other start is searched if a cause reduces the misfit of both channels to this. 1 is the residual of a
correct model. 1.5 is an assumption, not chosen on a population."""


def solved(t: Trial) -> bool:
    """True if a cause leaves the residual of a correct model. No other valley can then fit better."""
    return not t.lost and bool((t.misfits <= SOLVED).all())


def stiffness_at_bound(box: Box, x: FloatArray) -> bool:
    """True if the stiffness factor ends at a bound. The scale of the curve then affects the residual."""
    ends = dict(zip(box.names, zip(x.tolist(), box.lower, box.upper, strict=False), strict=False))
    value, low, high = ends.get(MOVED, (0.0, -inf, inf))
    return min(value - low, high - value) <= EDGE * (high - low) < inf


def _search_from(
    model: CauseModel, candidates: Sequence[Cause], *, counted: BoolArray | None = None
) -> CauseSearch:
    """The search from the point of a model."""
    problem = model.runner.problem
    known = np.isfinite(model.vectors([Point(model.x)])[0])
    known &= True if counted is None else counted
    expected = expected_residual(model, problem.numerics.with_mesh(problem.settings.replicate_mesh))
    return CauseSearch(model.runner, model, expected.among(known), known, candidates)


def best_of_each(trials: Sequence[Best], judge: CauseSearch) -> list[Best]:
    """The trial of each input with the least loss. Successful trials come before failed ones."""
    best: dict[str, list[Best]] = {}
    for one in trials:
        best.setdefault(one.seen.candidate.key, []).append(one)
    return [
        min(ones, key=lambda b: (bool(b.seen.lost), judge.loss(b.seen.misfits))) for ones in best.values()
    ]


CONTENDERS = 4
"""Maximum number of inputs that are compared by separate runs on the refined mesh."""


def _contenders(judge: CauseSearch, trials: Sequence[Best]) -> list[Best]:
    """Strong inputs near the largest evidence, or far in phase, whose order the mesh error could change."""
    strong = [one for one in trials if not one.seen.lost and judge.gain(one.seen.misfits) >= EVIDENCE]
    strong.sort(key=lambda one: judge.loss(one.seen.misfits))
    most = max((judge.gain(one.seen.misfits) for one in strong), default=0.0)
    near = [one for one in strong if most - judge.gain(one.seen.misfits) < KEPT]
    found = near[:CONTENDERS] if len(near) > 1 else []
    far = [one for one in strong if one.seen.candidate.key == CURVE_SCALE]
    return found + [one for one in far if one not in found]


def _findings(
    judge: CauseSearch, trials: Sequence[Best], candidates: Sequence[Cause]
) -> tuple[CauseFinding, ...]:
    """The ranked findings. The first one is updated if it is a likely cause."""
    again = {
        one.own.candidate.key: one.renewed(judge) for one in _contenders(judge, trials) if one.model is None
    }
    trials = [again.get(one.own.candidate.key, one) for one in trials]
    findings = ranked(judge, [one.seen for one in trials])
    if not (findings and findings[0].named):
        return findings
    first = next(one for one in trials if one.own.candidate.key == findings[0].key)
    rest = [c for c in candidates if c is not first.own.candidate]
    return _search_beside_leading(first, judge, findings, rest)


def _search_beside_leading(
    first: Best, judge: CauseSearch, findings: tuple[CauseFinding, ...], rest: Sequence[Cause]
) -> tuple[CauseFinding, ...]:
    """The findings with the first one updated on the refined mesh, and further errors in addition to it.

    The correction by the refined mesh is not valid for a change that needs other runs, nor in another valley
    of a free Poisson's ratio: one run at the changed point updates it. The first input is then free like the
    parameters, and the others are tried together with it. Their separate results have no meaning.
    """
    search, c = first.search, first.own.candidate
    runner, problem = search.runner, search.problem
    at, refined = np.append(search.model.x, start_of(c, problem)), search.model.refined
    if first.model is None and (c.simulated or VALLEY in problem.box.names):
        first = first.renewed(judge)
        if first.model is None:
            return findings
    if first.model is not None:
        at, refined = first.model.x, first.model.refined
    start = np.append(first.own.x, first.own.u)
    fine = CauseModel(runner, at, refined, c)
    second = CauseSearch(runner, fine, search.expected, search.use, rest, start=start)
    trials = best_trials(second, rest)
    x = second.at
    parameters = dict(zip(problem.box.names, x[:-1].tolist(), strict=True))
    renewed = replace(findings[0], value=c.value(float(x[-1])), parameters=parameters)
    more = tuple(replace(f, beside=c.key) for f in ranked(second, trials, refuted=c.key))
    return (renewed, *list_pairs(more, findings[1:]))


def list_pairs(more: Sequence[CauseFinding], alone: Sequence[CauseFinding]) -> tuple[CauseFinding, ...]:
    """The list after the first cause: likely causes together with it, likely alternatives, the rest."""
    likely = [f for f in more if f.named]
    likely += [f for f in alone if f.named and f.key not in {one.key for one in likely}]
    known = {f.key for f in likely}
    rest = [f for f in more if f.key not in known and not f.status]
    known |= {f.key for f in rest}
    return (*likely, *rest, *(f for f in alone if f.key not in known))


def best_trials(search: CauseSearch, candidates: Sequence[Cause], *, explained: bool = False) -> list[Trial]:
    """The best value of every candidate, with large changes if the data are not explained.

    The search estimates the residual of a correct model from two meshes; `explained` is more accurate.
    """
    tangents = search.tangents(candidates)
    if not (search.before > UNEXPLAINED).any() or explained:
        return tangents
    starts = [t for t in tangents if not t.lost] + scan_inputs(search, candidates)
    starts = sorted(starts, key=lambda t: search.loss(t.misfits))[:FOLLOWED]
    followed = search.followed(starts)
    better = [t for t in followed if search.gain(t.misfits) > 0.0]  # otherwise the linear step is better
    better.sort(key=lambda t: -search.loss(t.misfits))
    return list({t.candidate.key: t for t in (*tangents, *better)}.values())


def with_likely(analysis: CauseAnalysis, m: Estimate, *, at_bound: bool) -> tuple[CauseFinding, ...]:
    """The causes of an analysis in which none has enough evidence, with those marked that are likely anyway.

    If only averages over time show a misfit, it has no share that an input could explain. ``m``: the
    stiffness factor with its verdict. ``at_bound``: `stiffness_at_bound`.
    """
    if m.outcome.identified or not (at_bound or (analysis.misfits > 1.0).any()):
        return with_suspects(analysis.findings, analysis.unchanged, m.sigma)
    return with_leading(analysis.findings, at_bound=at_bound)


SURE = 1e-6
"""If the data show no misfit, a change counts only below this probability, adjusted for all inputs tried."""


def with_suspects(
    causes: Sequence[CauseFinding], unchanged: Mapping[str, float], sigma: float
) -> tuple[CauseFinding, ...]:
    """The causes of an explained answer; those that would shift it out of its interval are reported.

    The goodness of fit allows for errors of mesh and inputs, which may hide a wrong input. An input is
    suspected if the data prefer another value at the level `SURE`, and if this value shifts the stiffness
    factor out of its k = 2 interval. ``causes``: all tried; none is marked as likely yet. ``unchanged``:
    `CauseAnalysis.unchanged`. ``sigma``: standard uncertainty of the stiffness factor.
    """
    if MOVED not in unchanged:
        return tuple(causes)
    chosen = [
        f
        for f in causes
        if f.probability < SURE
        and not f.within
        and not f.status
        and abs(f.parameters[MOVED] - unchanged[MOVED]) > COVERAGE * sigma
    ]
    return _named_first(sorted(chosen, key=lambda f: f.probability), causes)


def with_leading(causes: Sequence[CauseFinding], *, at_bound: bool) -> tuple[CauseFinding, ...]:
    """The causes of a withheld answer; the leading ones are reported even if their evidence is small.

    An error is then certain, so an input needs less evidence. It must be significant and explain
    `LEAST_SHARE`. At a bound of the stiffness factor, the data prefer a value beyond it. ``causes``: all
    tried, by evidence; none is marked as likely yet.
    """
    beyond = [f for f in causes if at_bound and f.key == CURVE_SCALE and not f.status]
    strong = [f for f in causes if f.probability < LEVEL and f.explained >= LEAST_SHARE]
    chosen = beyond + [f for f in strong if not f.within and not f.status and f not in beyond]
    return _named_first(chosen, causes)


def _named_first(chosen: Sequence[CauseFinding], causes: Sequence[CauseFinding]) -> tuple[CauseFinding, ...]:
    return (*(replace(f, named=True) for f in chosen), *(f for f in causes if f not in chosen))


def cause_warnings(analysis: CauseAnalysis, *, explained: bool = False) -> Iterator[str]:
    """Warnings on inputs that are likely to be wrong, or on a misfit that no input explains.

    ``explained``: True if the model explains force and outline on the refined mesh.
    """
    if analysis.lost:
        yield f"the search for a wrong input failed: {analysis.lost}"
    checks = {c.key: c.check for c in causes()}
    for finding in analysis.named:
        told = ", ".join(f"{name} = {value:.5g}" for name, value in finding.parameters.items())
        other = f" (equally explained by {' or '.join(finding.alike)})" if finding.alike else ""
        check = f"{other}: {checks.get(finding.key, finding.key)}; with it {told}"
        if explained:
            yield (
                f"the model explains the data, and {sentence(finding)} would fit them significantly "
                f"better (by chance 1 in {1.0 / max(finding.probability, 1e-99):.0e}){check}"
            )
            continue
        beside = f"beside {finding.beside}, " if finding.beside else ""
        whole = "its remaining misfit" if finding.beside else "the misfit"
        yield f"{beside}{sentence(finding)} explains {percent(finding.explained)} of {whole}{check}"
    little = all(f.explained < LEAST_SHARE and f.key != CURVE_SCALE for f in analysis.named)
    if not explained and little and (analysis.misfits > UNEXPLAINED).any():
        yield (
            "no single change of an input explains the misfit (the residual is "
            f"{' and '.join(f'{x**0.5:.2g}' for x in analysis.misfits)} times the residual expected of a "
            "correct model, of force and outline): more than one input may be wrong, or the model"
        )


def sentence(finding: CauseFinding) -> str:
    """The change in words: "a force gain of 0.498 ± 0.003 (k = 2)"."""
    factor, unit = SHOWN.get(finding.unit, (1.0, "" if finding.unit == "1" else finding.unit))
    half = 2.0 * factor * finding.sigma
    known = isfinite(half) and half > 0.0
    digits = min(max(0, 1 - floor(log10(half))), 7) if known else 4
    spread = f" ± {half:.{digits}f}" if known else ""
    return f"{finding.words} of {factor * finding.value:.{digits}f}{spread} {unit}".rstrip() + " (k = 2)"


def percent(share: float) -> str:
    """A share in percent, with enough digits to distinguish it from 100 %."""
    return f"{100.0 * share:.1f} %" if share > 0.95 else f"{100.0 * share:.0f} %"
