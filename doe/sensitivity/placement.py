"""Placement of measurements: of many possible groups of data the few with the most information.

Independent data add their information H. D-optimal data have the largest det H, the smallest volume of the
joint interval; A-optimal data the smallest trace of H^-1, the mean variance of the parameters in units of
their scale (Pukelsheim, *Optimal Design of Experiments*, 1993).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import comb
from operator import index
from typing import Literal

import numpy as np

from doe.arrays import FloatArray

Criterion = Literal["D", "A"]

ALL = 20_000
"""Up to so many subsets all are compared; beyond, points are exchanged until none gains."""


class UndecidedError(ValueError):
    """No choice of so many groups decides all parameters."""


@dataclass(frozen=True)
class Placement:
    """The groups chosen, and what they leave undecided."""

    chosen: tuple[int, ...]
    """Indices of the groups, ascending."""
    cost: float
    """-ln det H, or the trace of H^-1, with the base included."""
    information: FloatArray
    """H of base and chosen groups together [-], shape [d, d]."""
    exhaustive: bool
    """Whether all subsets were compared; else no single exchange gains."""


def costs(information: FloatArray, criterion: Criterion) -> FloatArray:
    """Cost of an information matrix, shape [..., d, d] -> [...]; infinite where it is singular.

    Raises
    ------
    ValueError
        If the criterion is neither "D" nor "A".
    """
    if criterion not in ("D", "A"):
        raise ValueError(f'criterion must be "D" or "A", got {criterion!r}')
    values = np.linalg.eigvalsh(information)
    regular = values[..., 0] > 1e-12 * np.maximum(values[..., -1], np.finfo(float).tiny)
    safe = np.where(regular[..., None], values, 1.0)
    cost = -np.log(safe).sum(axis=-1) if criterion == "D" else (1.0 / safe).sum(axis=-1)
    return np.asarray(np.where(regular, cost, np.inf))


def best_groups(
    groups: FloatArray, count: int, *, base: FloatArray | None = None, criterion: Criterion = "D"
) -> Placement:
    """The `count` groups of data that with the base leave least undecided.

    Parameters
    ----------
    groups
        Information of each group, e.g. of all that is seen at one height [-], shape [n, d, d].
    count
        How many to choose, 1 to n.
    base
        Information that is there anyway [-], shape [d, d]; none if left out.
    criterion
        "D" or "A".

    Raises
    ------
    ValueError
        If `count` is outside its range.
    UndecidedError
        If every choice is singular.
    """
    n, d, _ = groups.shape
    count = index(count)
    if not 1 <= count <= n:
        raise ValueError(f"count must be in [1, {n}], got {count}")
    start = np.zeros((d, d)) if base is None else base
    exhaustive = comb(n, count) <= ALL
    if exhaustive:
        subsets = np.array(list(combinations(range(n), count)))
        cost = costs(start + groups[subsets].sum(axis=1), criterion)
        chosen = [int(i) for i in subsets[int(np.argmin(cost))]]
    else:
        chosen = _exchanged(groups, count, start, criterion)
    return _placed(groups, chosen, start, criterion, exhaustive)


def best_window(
    groups: FloatArray, length: int, *, base: FloatArray | None = None, criterion: Criterion = "D"
) -> Placement:
    """The `length` neighbouring groups, e.g. frames, that with the base leave least undecided.

    Parameters and errors as in `best_groups`.
    """
    n, d, _ = groups.shape
    length = index(length)
    if not 1 <= length <= n:
        raise ValueError(f"length must be in [1, {n}], got {length}")
    start = np.zeros((d, d)) if base is None else base
    total = np.concatenate([np.zeros((1, d, d)), np.cumsum(groups, axis=0)])
    cost = costs(start + total[length:] - total[:-length], criterion)
    first = int(np.argmin(cost))
    return _placed(groups, list(range(first, first + length)), start, criterion, True)


def _exchanged(groups: FloatArray, count: int, start: FloatArray, criterion: Criterion) -> list[int]:
    # A little of everything makes the first choices comparable where few groups are singular.
    ridge = 1e-6 * np.trace(groups.sum(axis=0)) / len(start) * np.eye(len(start))
    chosen: list[int] = []
    information = start + ridge
    for _ in range(count):
        cost = costs(information + groups, criterion)
        cost[chosen] = np.inf
        chosen.append(int(np.argmin(cost)))
        information = information + groups[chosen[-1]]
    best = float(costs(start + groups[chosen].sum(axis=0), criterion))
    gained = True
    while gained:
        gained = False
        for place in range(count):
            rest = [g for k, g in enumerate(chosen) if k != place]
            cost = costs(start + groups[rest].sum(axis=0) + groups, criterion)
            cost[rest] = np.inf
            other = int(np.argmin(cost))
            if cost[other] < best - 1e-12 * abs(best):
                chosen[place], best, gained = other, float(cost[other]), True
    return chosen


def _placed(
    groups: FloatArray, chosen: list[int], start: FloatArray, criterion: Criterion, exhaustive: bool
) -> Placement:
    information = start + groups[chosen].sum(axis=0)
    cost = float(costs(information, criterion))
    if not np.isfinite(cost):
        raise UndecidedError("no choice decides all parameters: choose more groups, or hold a parameter")
    return Placement(tuple(sorted(chosen)), cost, information, exhaustive)
