"""The choice of the points to run next: the optimum, and points whose misfit may be as low."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy  # statistics load when they are named, see `doe.designs`

from doe.arrays import FloatArray
from doe.box import Box
from doe.surrogates.process import ProcessSurrogate

Misfit = Callable[[FloatArray], FloatArray]
"""What is to be small, of responses [n, k], shape [n]: a deviance, i.e. minus twice a log-likelihood."""

CANDIDATES = 96
"""Points among which the new runs are chosen."""
DRAWS = 8
"""Responses drawn at each candidate, for the spread of its misfit."""
BOUND = 2.0
"""Standard deviations of the misfit below its mean that count as possible."""
APART = 0.08
"""Least distance of two new runs over the region's edge."""


def choose(
    surrogate: ProcessSurrogate,
    region: Box,
    best: FloatArray,
    misfit: Misfit,
    size: int,
    rng: np.random.Generator,
) -> FloatArray:
    """The optimum, and the candidates with the lowest bound of the misfit, one after the other.

    After each choice the surrogate is believed to have been right there, so that its error about the
    point no longer counts (the kriging believer).

    Parameters
    ----------
    surrogate
        Predicts the response and its error.
    region
        Where to choose.
    best
        The surrogate's optimum in it, in parameter units, shape [d].
    misfit
        What is to be small.
    size
        Points wanted; fewer are chosen if no more have room in the region.
    rng
        Of the candidates and the drawn responses.

    Returns
    -------
    points
        The optimum first, in parameter units, shape [n, d].
    """
    unit = np.concatenate([region.unit(best)[None], _candidates(region, best, rng)])
    x = region.scale(unit)
    draws = scipy.stats.norm.ppf(scipy.stats.qmc.Sobol(surrogate.n_components, rng=rng).random(DRAWS))
    means = surrogate.scores(x)
    chosen = [0]
    while len(chosen) < size:
        apart = np.abs(unit[:, None] - unit[chosen]).max(axis=2).min(axis=1) > APART
        if not apart.any():
            break
        spread = surrogate.believing(x[chosen]).score_sigma(x[apart])
        bound = _lower_bound(surrogate, means[apart], spread, draws, misfit)
        chosen.append(int(np.flatnonzero(apart)[np.argmin(bound)]))
    return x[chosen]


def _candidates(region: Box, best: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Points of the unit region: half evenly spread, half about the optimum."""
    d, half = region.dimension, CANDIDATES // 2
    even = scipy.stats.qmc.Sobol(d, rng=rng).random(2 ** int(np.ceil(np.log2(half))))
    about = region.unit(best) + 0.2 * rng.standard_normal((half, d))
    return np.concatenate([even, about[np.all((about >= 0.0) & (about <= 1.0), axis=1)]])


def _lower_bound(
    surrogate: ProcessSurrogate, means: FloatArray, spread: FloatArray, draws: FloatArray, misfit: Misfit
) -> FloatArray:
    """Mean less `BOUND` standard deviations of the misfit over drawn responses, shape [n]."""
    scores = means + spread * draws[:, None, :]
    values = np.stack([misfit(surrogate.components.expand(one)) for one in scores])
    return np.asarray(values.mean(axis=0) - BOUND * values.std(axis=0))
