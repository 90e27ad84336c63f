"""Covariance of an optimum whose residuals may be correlated in time: the block "sandwich"."""

from __future__ import annotations

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray

BLOCKS = (2, 4, 8, 16)
"""Block lengths, in force bins, over which residuals may be correlated in time."""


def correlated_in_blocks(
    score: FloatArray, block: IntArray, independent: FloatArray, known: FloatArray
) -> FloatArray:
    """Covariance with residuals of a block of time correlated in any way, or not, shape [d, d].

    Of the block lengths in `BLOCKS`, and of independent residuals, the one with the largest variances counts.
    Lengths that leave four blocks a parameter or fewer say nothing.

    Parameters
    ----------
    score
        Move of the optimum by each entry's residual, shape [d, k].
    block
        Force bin in which each entry lies, from 0, shape [k].
    independent
        The covariance from independent residuals, `known` included, shape [d, d].
    known
        What is added to every sandwich, shape [d, d].
    """
    best, d = independent, len(score)
    for length in BLOCKS:
        label = block // length
        n_blocks = label.max() + 1
        if n_blocks <= 4 * d:
            continue
        sums = np.array([np.bincount(label, row, minlength=n_blocks) for row in score])
        sandwich = sums @ sums.T * n_blocks / (n_blocks - d) + known
        if np.trace(sandwich / np.diag(best)) > np.trace(best / np.diag(best)):
            best = sandwich
    return best
