"""What a residual holds beyond the measured noise: a discrepancy of force and outline, a slow one beside it.

Of a residual r = e + M' a + S' b, with a of known patterns M standard normal and b of the slow
patterns S normal with one unknown variance, e is estimated with its uncertainty, on which the discrepancies
depend in turn (expectation maximisation). Its mean square beyond what is known is the discrepancy of a
channel: a mean with weights D^-2, D the variance of e, which is the most likely one where variances differ
(Fisher scoring). Without patterns e is r, and the mean is plain. The variance of b is the most likely one
beside the other parts, renewed with them.
"""

from __future__ import annotations

import numpy as np

from doe.whitening import Whitening
from kolsky.base.arrays import FloatArray
from kolsky.inverse.common_errors import most_likely_amplitude, without_common

ROUNDS = 6
"""Rounds in which the discrepancies and the front face's share of the residual are told apart; each leaves
about a tenth of the error."""


def most_likely_discrepancies(
    residual: FloatArray, n_force: int, *, known: FloatArray, common: FloatArray, slow: FloatArray
) -> tuple[float, float, float]:
    """Discrepancy of the force [N] and the outline [m], and root mean square of the slow error [m].

    Parameters
    ----------
    residual
        Force [N], then outline [m], shape [k].
    n_force
        How many entries are the force's.
    known
        Standard deviation of each entry by what is independent and known, shape [k].
    common
        Patterns of known errors in common, a standard deviation each, shape [n, k].
    slow
        Patterns of the slow error, of unit amplitude, shape [q, k].
    """
    square, weight = residual**2, np.ones(len(residual))
    force = shape = amplitude = 0.0
    own = known
    for turn in range(ROUNDS if len(common) + len(slow) else 1):
        if turn:
            every = np.concatenate([common, amplitude * slow])
            left, variance = without_common(residual, every, own)
            square, weight = left**2 + variance, own**-4
        excess = square - known**2
        force = _root_of_mean(excess[:n_force], weight[:n_force])
        shape = _root_of_mean(excess[n_force:], weight[n_force:])
        tau = np.where(np.arange(len(residual)) < n_force, force, shape)
        own = np.sqrt(known**2 + tau**2)
        amplitude = most_likely_amplitude(residual, slow, Whitening(own, common))
    return force, shape, amplitude


def _root_of_mean(excess: FloatArray, weight: FloatArray) -> float:
    """Root of a weighted mean; zero where that is negative, or of nothing."""
    return float(np.sqrt(max(np.average(excess, weights=weight), 0.0))) if excess.size else 0.0
