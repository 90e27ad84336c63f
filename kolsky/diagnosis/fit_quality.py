"""Goodness of fit by channel: the residual at the optimum beside what a right model would leave.

A right model leaves the measured noise, what the noise of the inputs (flyer motion, material curve) does to
its answer, and the error of mesh and step. Each of the last is the change ``c`` of the predicted data vector,
less what the free parameters absorb of it: with the Jacobian J and the gain G of the least-squares problem
``c - J G c`` is left. The discrepancy tau has no part in this: it is made from the residual itself.

Residual and prediction are compared point by point, and in means over blocks of time: a wrong input bends
the whole record by little, where noise and ringing average out.
"""

from collections.abc import Mapping
from math import inf

import numpy as np
from scipy.special import chdtrc

from kolsky.base.arrays import BoolArray, FloatArray, IntArray
from kolsky.diagnosis.thresholds import LIMITS, SLOW_LIMITS
from kolsky.inverse.fit_results import FLYER, FORCE, NOISE, OUTLINE, FitQuality
from kolsky.inverse.objective import Objective

BLOCKS = 8
"""Blocks of time over which residuals are averaged: some 170 us each, a few periods of what rings."""
BANDS = 3
"""Bands of height over which the points of a frame are averaged with them."""


def fit_quality(
    objective: Objective,
    vector: FloatArray,
    jacobian: FloatArray,
    *,
    changes: Mapping[str, FloatArray],
    names: tuple[str, ...] = (),
) -> tuple[FitQuality, ...]:
    """Judge the residual of each measured channel.

    Parameters
    ----------
    objective
        With the discrepancies of the optimum.
    vector
        The data vector that the model predicts at the optimum, shape [k].
    jacobian
        Of the data vector by the free parameters there, shape [k, d].
    changes
        By source, changes of the predicted data vector by one standard uncertainty of that source: the draws
        of a noise, shape [n, k], or one change, shape [k]. Not finite at a point that a run does not reach.
        Without the flyer's noise among them no limit is set: too much is missing.
    names
        The free parameters, length d, for their shares of information; fewer leave out the last ones.

    Returns
    -------
    tuple of FitQuality
        Force, then outline if it was measured.
    """
    gain = objective.gain(jacobian)
    left = {source: left_over(change, jacobian, gain) for source, change in changes.items()}
    spread = objective.spread(gain)
    weights = information_shares(gain, spread, {c: _mask(objective, c) for c in (FORCE, OUTLINE)})
    residual = objective.data - vector
    found = []
    for channel, unit in ((FORCE, "N"), (OUTLINE, "m")):
        use = _mask(objective, channel)
        if not use.any():
            continue
        noise, tau = objective.noise[use], _discrepancy(objective, channel)
        first, second = neighbours(objective, channel)
        block = blocks(objective, channel)
        slow = [rms(block_means(change[..., use], block)) for change in left.values()]
        correlation, whiteness = correlated(residual / objective.noise, first, second)
        found.append(
            FitQuality(
                channel=channel,
                unit=unit,
                values=int(use.sum()),
                residual=rms(residual[use]),
                predicted={NOISE: rms(noise), **{s: rms(c[..., use]) for s, c in left.items()}},
                peak=peak(objective.data[use], channel),
                slow_residual=rms(block_means(residual[use], block)),
                slow_expected=float(np.hypot.reduce([block_noise(noise, block), *slow])),
                chi2=float(((residual[use] / noise) ** 2).mean()),
                discrepancy_share=float(tau**2 / (tau**2 + (noise**2).mean())),
                correlation=correlation,
                whiteness=whiteness,
                weight=dict(zip(names, weights[channel].tolist(), strict=False)),
                limit=LIMITS[channel] if FLYER in changes else inf,
                slow_limit=SLOW_LIMITS[channel] if FLYER in changes else inf,
            )
        )
    return tuple(found)


def left_over(change: FloatArray, jacobian: FloatArray, gain: FloatArray) -> FloatArray:
    """A change of the prediction less what the free parameters absorb, ``c - J G c``, shape of `change`.

    A point that is not finite in it adds nothing.
    """
    change = np.nan_to_num(np.asarray(change, dtype=np.float64), nan=0.0, posinf=0.0, neginf=0.0)
    return np.asarray(change - (change @ gain.T) @ jacobian.T)


def information_shares(
    gain: FloatArray, spread: FloatArray, masks: Mapping[str, BoolArray]
) -> dict[str, FloatArray]:
    """Share of the information on each parameter that comes from each channel, the others being fitted too.

    The variance of parameter i is the sum over the data of ``g_ik (C g_i)_k`` with the gain g and the data's
    covariance C: each datum has its share, and the shares sum up to one. With independent data it is
    ``(g_ik sigma_k)^2``. A datum that serves to take a common error off the others can have a negative share.

    Parameters
    ----------
    gain
        Linear map from a change of the data vector to the move of the optimum, shape [d, k].
    spread
        The gain times the covariance that weighs the data, shape [d, k].
    masks
        Entries of each channel, shape [k].

    Returns
    -------
    dict
        Channel -> shares, shape [d].
    """
    parts = gain * spread
    return {channel: parts[:, use].sum(axis=1) / parts.sum(axis=1) for channel, use in masks.items()}


def correlated(residual: FloatArray, first: IntArray, second: IntArray) -> tuple[float, float]:
    """Correlation of neighbours, and the probability of one at least so large in white noise.

    Ljung and Box (1978) with one lag: ``Q = n (n + 2) / (n - 1) r^2`` with n - 1 the number of pairs, against
    chi-square of one degree of freedom.

    Parameters
    ----------
    residual
        In units of its noise, shape [k]; its mean is not taken out: a right model leaves none.
    first, second
        Rows of the neighbours, shape [n_pairs].
    """
    if first.size < 2:
        return float("nan"), float("nan")
    pairs = np.union1d(first, second)
    square = float((residual[pairs] ** 2).mean())
    if not square > 0.0:
        return float("nan"), float("nan")
    n = first.size + 1
    r = float((residual[first] * residual[second]).sum()) / (n * square)
    return r, float(chdtrc(1.0, n * (n + 2.0) / (n - 1.0) * r**2))


def blocks(objective: Objective, channel: str) -> IntArray:
    """Number of the block of each entry of a channel, from 0 without gaps, shape [n].

    Blocks have equal spans of time; in each the lowest third of every frame's points, the middle one and the
    highest one are apart.
    """
    times = objective.times[_mask(objective, channel)]
    span = max(float(np.ptp(times)), np.finfo(float).tiny)
    block = np.minimum((BLOCKS * (times - times.min()) / span).astype(np.int64), BLOCKS - 1)
    if channel == OUTLINE:
        line, rows = objective.observations.centre_line, np.flatnonzero(objective.counted)
        order = np.lexsort((line.y[rows], line.frame[rows]))
        _, first, size = np.unique(line.frame[rows][order], return_index=True, return_counts=True)
        rank = np.empty(len(rows), dtype=np.int64)
        rank[order] = (BANDS * (np.arange(len(rows)) - np.repeat(first, size))) // np.repeat(size, size)
        block = BANDS * block + rank
    return np.asarray(np.unique(block, return_inverse=True)[1])


def block_means(values: FloatArray, block: IntArray) -> FloatArray:
    """Means over the blocks, shape [..., n_blocks], of values of shape [..., n]."""
    rows = np.atleast_2d(values)
    means = np.array([np.bincount(block, weights=row) for row in rows]) / np.bincount(block)
    return means if np.ndim(values) > 1 else means[0]


def block_noise(sigma: FloatArray, block: IntArray) -> float:
    """Root mean square over the blocks of the standard deviation of a block's mean of independent noise."""
    return float(np.sqrt(np.mean(np.bincount(block, weights=sigma**2) / np.bincount(block) ** 2)))


def neighbours(objective: Objective, channel: str) -> tuple[IntArray, IntArray]:
    """Rows of neighbours in the data vector: force bins in time, or points along one frame's outline."""
    if channel == FORCE:
        rows = np.arange(objective.n_force)
        return rows[:-1], rows[1:]
    line, rows = objective.observations.centre_line, np.flatnonzero(objective.counted)
    order = np.lexsort((line.y[rows], line.frame[rows]))
    same = np.diff(line.frame[rows][order]) == 0
    placed = objective.n_force + order
    return placed[:-1][same], placed[1:][same]


def peak(data: FloatArray, channel: str) -> float:
    """Largest size of a signal: the largest force, or the spread of the outline's radii."""
    return float(np.abs(data).max()) if channel == FORCE else float(np.ptp(data))


def rms(values: FloatArray) -> float:
    """Root mean square over all entries."""
    return float(np.sqrt(np.mean(np.square(values))))


def _mask(objective: Objective, channel: str) -> BoolArray:
    return objective.mask("force" if channel == FORCE else "shape")


def _discrepancy(objective: Objective, channel: str) -> float:
    return objective.force_discrepancy if channel == FORCE else objective.shape_discrepancy
