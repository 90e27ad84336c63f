"""Trials of inputs become findings: likely causes, their order, and what cannot be told apart."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, nan

import numpy as np

from kolsky.diagnosis.candidate_input import DAMPING, POISSON
from kolsky.diagnosis.cause_fit import chance, evidence, explained_share, holm
from kolsky.diagnosis.cause_search import CauseSearch
from kolsky.diagnosis.cause_trial import Trial
from kolsky.inverse.cause_results import CauseFinding

LEVEL = 0.01
"""Probability, adjusted for all inputs tried, below which a change is significant."""
EVIDENCE = 100.0
"""Least evidence of a cause that is named; see docs/validation/wrong_inputs."""
ALIKE = 10.0
"""Inputs whose losses differ by less cannot be told apart: likelihoods within a factor of exp(5)."""
ASSUMED = "model."
"""Where keys of assumptions begin: values that are taken from elsewhere, not from the specimen."""
LEAST_SHARE = 0.25
"""Least share of the misfit that a cause explains that is named."""
FREED_TOGETHER = (POISSON, DAMPING)
"""Assumptions that an identification frees together by default: where one is refuted, so is the pair."""


def ranked(search: CauseSearch, trials: Sequence[Trial], *, refuted: str = "") -> tuple[CauseFinding, ...]:
    """The findings in order, with probabilities for all tests together and what cannot be told apart.

    An input whose preferred value lies within k = 2 of its declared uncertainty is never a likely cause: it
    is listed with what it explains alone.

    Parameters
    ----------
    search, trials
        The data, and the best value of every input.
    refuted
        Key of a likely cause that is free beside the parameters; empty if there is none.
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
    order = in_groups(search, [row[0] for row in likely])
    likely.sort(key=lambda row: order.index(row[0].candidate.key))
    rest = [row for row in rows if not row[-1]]
    rest = [rest[i] for i in by_evidence([row[0].candidate.key for row in rest], [row[2] for row in rest])]
    if not likely and rest and _closes(rest[0], refuted) and not _within(search, rest[0][0]):
        likely, rest = [(*rest[0][:-1], True)], rest[1:]
        groups = [row[0] for row in (*likely, *rest) if not row[0].lost]
    else:
        groups = [row[0] for row in likely]
    return tuple(
        _finding(search, *row, alike=_alike(search, row[0], groups) if row[-1] else ())
        for row in (*likely, *rest)
    )


def _closes(row: tuple[Trial, float, float, float, bool], refuted: str) -> bool:
    """True if the leading input beside a refuted one belongs to its pair and is significant by itself.

    A closed test: that both values are right has been refuted with the evidence and the share of the first,
    which are those of the pair at least; that this one is right is refuted by its own probability, the first
    one free, where the likelihoods can be told apart at all.
    """
    t, probability, gain, _, _ = row
    pair = refuted in FREED_TOGETHER and t.candidate.key in FREED_TOGETHER
    return pair and not t.lost and gain > ALIKE and probability < LEVEL


def by_evidence(keys: Sequence[str], evidences: Sequence[float]) -> list[int]:
    """Places of inputs, the most evidence first; of those that cannot be told apart assumptions first.

    What `ASSUMED` has in its key nobody has measured on the specimen; a length that is off by as much as the
    data would have it is a measurement gone wrong. Evidences that differ by less than `ALIKE` do not tell one
    from the other.

    Parameters
    ----------
    keys, evidences
        Of the inputs, in any order.
    """
    left, order = sorted(range(len(keys)), key=lambda i: -evidences[i]), []
    while left:
        first = evidences[left[0]]
        group = [i for i in left if first > ALIKE and first - evidences[i] < ALIKE] or left[:1]
        order += sorted(group, key=lambda i: not keys[i].startswith(ASSUMED))
        left = [i for i in left if i not in group]
    return order


def _within(search: CauseSearch, t: Trial) -> bool:
    """True if the value lies within k = 2 of what is declared."""
    span = t.candidate.within(search.stages)
    return span is not None and span[0] <= t.u <= span[1]


def in_groups(search: CauseSearch, trials: Sequence[Trial]) -> list[str]:
    """Keys, the least loss first; of those that cannot be told from it the most usual error first."""
    left, order = sorted(trials, key=lambda t: search.loss(t.misfits)), []
    while left:
        first = search.loss(left[0].misfits)
        group = [t for t in left if search.loss(t.misfits) - first <= ALIKE]
        order += [t.candidate.key for t in sorted(group, key=lambda t: _unusual(search, t))]
        left = left[len(group) :]
    return order


def _unusual(search: CauseSearch, t: Trial) -> float:
    """Size of the change over its declared uncertainty, or over what is usual or granted if that is more."""
    c, declared = t.candidate, search.stages.prepared.forward.shot.uncertainty
    scale = c.sigma(search.stages)
    if not declared.get(c.declared, 0.0) > 0.0:
        scale = max(scale, c.typical)
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
