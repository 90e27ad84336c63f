"""Which input is wrong? Each is changed alone until the model explains the data best, and they are ranked."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import isfinite, nan

import numpy as np
from threadpoolctl import threadpool_limits

from explicit import Response
from kolsky.base.arrays import FloatArray
from kolsky.diagnosis.candidate_input import DENSITY, SENSITIVITY, CandidateInput
from kolsky.diagnosis.cause_fit import ExpectedResidual, chance, evidence, explained_share, holm
from kolsky.diagnosis.cause_inputs import CANDIDATES
from kolsky.diagnosis.cause_model import CauseModel, Point
from kolsky.diagnosis.cause_search import FOLLOWED, UNEXPLAINED, CauseSearch, Trial
from kolsky.inverse.cause_results import CauseFinding
from kolsky.inverse.staged_runs import StagedRuns

LEVEL = 0.01
"""Probability, adjusted for all inputs tried, below which a change is significant."""
EVIDENCE = 100.0
"""Least evidence of a cause that is named; see docs/validation/wrong_inputs."""
ALIKE = 10.0
"""Inputs whose losses differ by less cannot be told apart: likelihoods within a factor of exp(5)."""
LEAST_SHARE = 0.25
"""Least share of the misfit that a cause explains that is named."""


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


def find_causes(stages: StagedRuns, x: FloatArray, refined: Response) -> CauseAnalysis:
    """Try every input as the cause of the misfit.

    Parameters
    ----------
    stages
        The identification's simulations.
    x
        The answer in SI, shape [d].
    refined
        The run on the refined mesh there, a batch of one.
    """
    started = time.perf_counter()
    try:
        with threadpool_limits(limits=1, user_api="blas"):
            return _analysed(stages, x, refined)
    except (ValueError, ArithmeticError) as error:
        return CauseAnalysis((), np.full(2, nan), str(error))
    finally:
        stages.seconds["causes"] = time.perf_counter() - started


def _analysed(stages: StagedRuns, x: FloatArray, refined: Response) -> CauseAnalysis:
    settings = stages.settings
    model = CauseModel(stages, x, refined)
    known = np.isfinite(model.vectors([Point(x)])[0])
    expected = _counted(model.expected(settings.numerics.with_mesh(settings.replicate_mesh)), known)
    candidates = [c for c in CANDIDATES if c.here(stages)]
    search = CauseSearch(stages, model, expected, known, candidates)
    trials = best_trials(search, candidates)
    findings = ranked(search, trials)
    if findings and findings[0].named:
        first = next(t for t in trials if t.candidate.key == findings[0].key)
        findings = beside(search, first, findings, [c for c in candidates if c is not first.candidate])
    return CauseAnalysis(findings, search.before)


def beside(
    search: CauseSearch, first: Trial, findings: tuple[CauseFinding, ...], rest: Sequence[CandidateInput]
) -> tuple[CauseFinding, ...]:
    """The findings with the first renewed on the refined mesh, and with what else is wrong beside it.

    A change that needs other runs has left the correction by the refined mesh behind: one run there renews
    it. Then the first input is free as the parameters are, and the others are tried beside it.
    """
    c, stages = first.candidate, search.stages
    at, refined = np.append(search.model.x, c.start(stages)), search.model.refined
    start = np.append(first.x, first.u)
    if c.simulated:
        run = search.model.refined_run(Point(first.x, c.changed(first.u)))
        if run is None:
            return findings
        at, refined = start, run
        fine = CauseModel(stages, at, refined, c)
        declared = [one for one in rest if one.within(stages) is not None]
        again = CauseSearch(stages, fine, search.expected, search.use, declared, start=start)
        first = min([first, *again.followed([first])], key=lambda t: search.loss(t.misfits))
        start = np.append(first.x, first.u)
    fine = CauseModel(stages, at, refined, c)
    second = CauseSearch(stages, fine, search.expected, search.use, rest, start=start)
    x = np.clip(start + second.null.step, second.model.lower, second.model.upper)
    names = stages.box.names
    renewed = replace(
        findings[0],
        value=c.value(float(x[-1])),
        parameters=dict(zip(names, x[: len(names)].tolist(), strict=True)),
    )
    more = [replace(f, beside=c.key) for f in ranked(second, best_trials(second, rest)) if f.named]
    keys = {f.key for f in more}
    return (renewed, *more, *(f for f in findings[1:] if f.key not in keys))


def best_trials(search: CauseSearch, candidates: Sequence[CandidateInput]) -> list[Trial]:
    """The best value of every candidate; far ones are tried only where the data are not explained."""
    tangents = search.tangents(candidates)
    if not (search.before > UNEXPLAINED).any():
        return tangents
    starts = [t for t in tangents if not t.lost] + search.scanned(candidates)
    starts = sorted(starts, key=lambda t: search.loss(t.misfits))[:FOLLOWED]
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


def _counted(expected: ExpectedResidual, use: FloatArray) -> ExpectedResidual:
    """The entries that the answer itself reaches."""
    return replace(
        expected,
        sigma=expected.sigma[use],
        patterns=expected.patterns[use],
        channel=expected.channel[use],
        block=expected.block[use],
    )


def ranked(search: CauseSearch, trials: Sequence[Trial]) -> tuple[CauseFinding, ...]:
    """The findings in order, with probabilities for all tests together and what cannot be told apart.

    An input whose preferred value lies within k = 2 of its declared uncertainty is never a likely cause: it
    is listed with what it explains alone.
    """
    adjusted = holm([_chance(search, t) for t in trials])
    entries = np.array([(search.expected.channel == c).sum() for c in range(2)])
    rows = []
    for t, probability in zip(trials, adjusted, strict=True):
        gain = search.gain(t.misfits) if not t.lost else 0.0
        share = explained_share(search.before, t.misfits, entries)
        strong = not t.lost and probability < LEVEL and gain >= EVIDENCE and share >= LEAST_SHARE
        alone = None if strong or t.candidate not in search.declared else search.alone(t.candidate)
        if alone is not None and _within(search, alone):
            t, gain = alone, evidence(search.bare, alone.misfits, search.expected.times)
            share = explained_share(search.bare, alone.misfits, entries)
        rows.append((t, probability, gain, share, strong and not _within(search, t)))
    likely = [row for row in rows if row[-1]]
    order = _in_groups(search, [row[0] for row in likely])
    likely.sort(key=lambda row: order.index(row[0].candidate.key))
    rest = sorted((row for row in rows if not row[-1]), key=lambda row: -row[2])
    groups = [row[0] for row in likely]
    return tuple(
        _finding(search, *row, alike=_alike(search, row[0], groups) if row[-1] else ())
        for row in (*likely, *rest)
    )


def _within(search: CauseSearch, t: Trial) -> bool:
    """True if the value lies within k = 2 of what is declared."""
    span = t.candidate.within(search.stages)
    return span is not None and span[0] <= t.u <= span[1]


def _in_groups(search: CauseSearch, trials: Sequence[Trial]) -> list[str]:
    """Keys, the least loss first; of those that cannot be told from it the most usual error first."""
    left, order = sorted(trials, key=lambda t: search.loss(t.misfits)), []
    while left:
        first = search.loss(left[0].misfits)
        group = [t for t in left if search.loss(t.misfits) - first <= ALIKE]
        order += [t.candidate.key for t in sorted(group, key=lambda t: _unusual(search, t))]
        left = left[len(group) :]
    return order


def _unusual(search: CauseSearch, t: Trial) -> float:
    """Size of the change over its declared uncertainty, or over what is usual."""
    scale = t.candidate.sigma(search.stages) or t.candidate.typical
    start = t.candidate.held(search.stages)
    return abs(t.value - start) / scale if isfinite(start) and isfinite(scale) else float("inf")


def _alike(search: CauseSearch, one: Trial, likely: Sequence[Trial]) -> tuple[str, ...]:
    return tuple(
        t.candidate.key
        for t in likely
        if t is not one and abs(search.loss(t.misfits) - search.loss(one.misfits)) <= ALIKE
    )


def _chance(search: CauseSearch, t: Trial) -> float:
    """Probability of such a change if the input is right within its declared uncertainty."""
    if t.lost or t.fit is None:
        return 1.0
    degrees = len(t.residual) / max(t.fit.inflation, 1.0) - len(t.fit.step)
    start = t.candidate.held(search.stages)
    if not isfinite(start):
        return chance(np.sqrt(max(search.gain(t.misfits), 0.0)), 1.0, degrees=degrees)
    return chance(
        t.value - start, float(np.hypot(t.sigma, t.candidate.sigma(search.stages))), degrees=degrees
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
    names, c = search.stages.box.names, t.candidate
    sigmas = (
        {}
        if t.fit is None or t.lost
        else dict(zip(names, np.sqrt(np.diag(t.fit.covariance))[: len(names)].tolist(), strict=True))
    )
    return CauseFinding(
        key=c.key,
        words=c.words,
        unit=c.unit,
        exact=c.held(search.stages),
        value=nan if t.lost else t.value,
        sigma=nan if t.lost else t.sigma,
        explained=share,
        evidence=gain,
        probability=probability,
        parameters={} if t.lost else dict(zip(names, t.x[: len(names)].tolist(), strict=True)),
        sigmas=sigmas,
        named=named,
        alike=alike,
        status=t.lost,
        declared_sigma=c.sigma(search.stages) or None,
    )


def cause_warnings(analysis: CauseAnalysis, *, explained: bool = False) -> Iterator[str]:
    """Say which inputs are likely to be wrong, the most likely first, or that none explains the misfit.

    Parameters
    ----------
    analysis
        All inputs that were tried.
    explained
        Whether the model explains force and outline on the refined mesh: then there is nothing that no input
        explains.
    """
    if analysis.lost:
        yield f"which input may be wrong could not be tried: {analysis.lost}"
    checks = {c.key: c.check for c in CANDIDATES}
    for finding in analysis.named:
        told = ", ".join(f"{name} = {value:.5g}" for name, value in finding.parameters.items())
        other = f" (the data cannot tell it from {' or '.join(finding.alike)})" if finding.alike else ""
        also, whole = ("", "the misfit")
        if finding.beside:
            also, whole = f"beside {finding.beside}, ", "what is left of it"
        yield (
            f"{also}{sentence(finding)} explains {percent(finding.explained)} of {whole}{other}: "
            f"{checks.get(finding.key, finding.key)}; with it {told}"
        )
    if not explained and not analysis.named and (analysis.misfits > UNEXPLAINED).any():
        yield (
            "no single change of an input explains the misfit (the residual is "
            f"{' and '.join(f'{x**0.5:.2g}' for x in analysis.misfits)} times what a right model leaves, of "
            "force and outline): more than one input may be wrong, or the model"
        )


SHOWN = {"s": (1e6, "us"), "m": (1e6, "um")}
"""Factor and unit in which a value is written."""


def sentence(finding: CauseFinding) -> str:
    """The change in words: "a force gain of 0.498 ± 0.003 (k = 2)"."""
    factor, unit = SHOWN.get(finding.unit, (1.0, "" if finding.unit == "1" else finding.unit))
    half = 2.0 * factor * finding.sigma
    value = factor * finding.value
    digits = max(0, 1 - int(np.floor(np.log10(half)))) if isfinite(half) and half > 0.0 else 4
    written = f"{value:.{min(digits, 7)}f}"
    if isfinite(half) and half > 0.0:
        written += f" ± {half:.{min(digits, 7)}f}"
    return f"{finding.words} of {written} {unit}".rstrip() + " (k = 2)"


def percent(share: float) -> str:
    """A share in percent, with as many digits as tell it from 100 %."""
    return f"{100.0 * share:.1f} %" if share > 0.95 else f"{100.0 * share:.0f} %"
