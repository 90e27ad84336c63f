"""A flyer that no frame shows for some time: what the smoothness of its motion, unknown there, adds.

Elsewhere the frames tell how smooth the motion is, and the likeliest smoothness tau serves
(`kolsky.bars.flyer.fit`). Where frames are missing, before the flyer comes into view for one, tau is known to
a factor of two or three: the path of the likeliest one is off by more than its posterior covariance says. The
log tau of the spans that no frame shows are drawn about the likeliest, the draws weighted by their likelihood
(importance sampling), and the covariance is that of the mixture about the path:

    sum of w_k (C_k + (j_k - j)(j_k - j)')

with the jerks j_k and covariances C_k of each draw. The path itself stays the likeliest one's. On two drawn
shots (numbers 25 and 26 of `python -m benchmarks.forty --seed 28411`), the flyer unseen for its first 0.3 mm,
the largest error of the path is 12.3 and 8.7 um; it was known to 4.9 and 3.3 um, and is to 10 and 7 um.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from kolsky.base.arrays import BoolArray, FloatArray

DRAWS = 128
"""Draws: some 60 of them count, which tells a standard deviation to a tenth."""
WIDER = 1.5
"""Width of what is drawn from over that of the likelihood, whose tails are heavier than normal ones."""
STEP = 0.05
"""Half the distance of central differences of the slope, in log tau."""
LEAST_CURVATURE = 0.1
"""Least curvature of -ln L in log tau: a factor of e^3 either way."""
LEAST_WEIGHT = 1e-5
"""A draw with less weight is left out."""


class Deviances(Protocol):
    """-2 ln L for several rows of unknowns."""

    @property
    def values(self) -> FloatArray:
        """The values, shape [n_rows]."""

    @property
    def gradients(self) -> FloatArray:
        """Their gradients, shape [n_rows, n]."""


Solution = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Mean and covariance of the jerks with some smoothness and noise."""


def unseen_controls(hats: FloatArray, t: FloatArray, seen: BoolArray, knots: FloatArray) -> BoolArray:
    """Control points of log tau that act on a span with an end that no frame shows, shape [n_controls].

    Parameters
    ----------
    hats
        `kolsky.bars.flyer.jerks.hat_functions` at the spans, shape [n_spans, n_controls].
    t, seen
        Times [s], and which of them are data, shape [n].
    knots
        Ends of the spans [s], shape [n_spans + 1].
    """
    hidden = np.isin(knots, t[~seen])
    return np.asarray((hats[hidden[:-1] | hidden[1:]] > 0.0).any(axis=0))


def weighted_draws(
    theta: FloatArray, free: BoolArray, deviances: Callable[[FloatArray], Deviances]
) -> tuple[FloatArray, FloatArray]:
    """Draws about the likeliest values of some unknowns, and their weights, which add up to one.

    Pairs of draws lie opposite to each other; the same call gives the same draws.

    Parameters
    ----------
    theta
        The likeliest values, shape [n].
    free
        Those that are drawn; the others stay, shape [n].
    deviances
        -2 ln L of rows of values of all, shape [n_rows, n].

    Returns
    -------
    tuple of NDArray
        Values [n_draws, n], weights [n_draws].
    """
    rows = np.flatnonzero(free)
    steps = STEP * np.eye(theta.size)[rows]
    ahead, behind = np.split(deviances(np.concatenate([theta + steps, theta - steps])).gradients[:, rows], 2)
    curvature = 0.5 * (ahead - behind) / (2.0 * STEP)
    values, vectors = np.linalg.eigh(0.5 * (curvature + curvature.T))
    widths = WIDER / np.sqrt(np.maximum(values, LEAST_CURVATURE))
    half = np.random.default_rng(0).standard_normal((DRAWS // 2, rows.size))
    normal = np.concatenate([half, -half])
    drawn = np.tile(theta, (DRAWS, 1))
    drawn[:, rows] += normal * widths @ vectors.T
    log = -0.5 * deviances(drawn).values + 0.5 * (normal**2).sum(axis=1)
    weight = np.exp(log - log.max())
    return drawn, weight / weight.sum()


def mixed_covariance(
    drawn: FloatArray, weights: FloatArray, jerk: FloatArray, solution: Solution
) -> FloatArray:
    """Covariance of the jerks about those of the path, over draws of their smoothness, shape [n, n].

    Parameters
    ----------
    drawn, weights
        As of `weighted_draws`.
    jerk
        Of the path, shape [n].
    solution
        Jerks and their covariance for one draw.
    """
    total = np.zeros((jerk.size, jerk.size))
    kept = weights > LEAST_WEIGHT * weights.max()
    for one, weight in zip(drawn[kept], weights[kept] / weights[kept].sum(), strict=True):
        mean, covariance = solution(one)
        total += weight * (covariance + np.outer(mean - jerk, mean - jerk))
    return total
