"""Errors that many outline points have in common: a field that varies slowly with height and time.

A stereo measurement's calibration, its zero and the fit of the axis, and what is left of the mesh's error
move neighbouring points and frames together: micrometres that no averaging over thousands of points takes
away. The field is a polynomial of height and time, its coefficients independent and alike,

    e(y, t) = s sum_ij a_ij P_i(y) P_j(t),   a_ij ~ N(0, 1),   i, j < DEGREES,

with Legendre polynomials scaled such that s is its root mean square over the points. s is the most likely one
for a residual, zero where independent errors explain it.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from scipy.optimize import minimize_scalar

from doe.whitening import Whitening
from kolsky.base.arrays import FloatArray

DEGREES = 4
"""Polynomials in height and in time, constant to cubic: zero, scale, tilt and bend of a measured surface, and
how they change as the specimen shortens."""
FEW = 16
"""Patterns up to which sums are taken without BLAS."""
WIDEST = 1e6
"""Largest amplitude that is looked for, over what the independent errors leave of it [-]."""
STEPS = np.linspace(-5.0, float(np.log(WIDEST)), 40)
"""Logarithms of the amplitudes that are tried first, in the same measure."""


def slow_patterns(height: FloatArray, time: FloatArray) -> FloatArray:
    """Patterns of an error with a root mean square of one over the points, shape [DEGREES^2, n].

    Their squares, summed over the patterns and averaged over the points, are one. Fewer patterns where
    heights or times are too few to tell them apart; none without points.

    Parameters
    ----------
    height, time
        Of the points, in any unit, shape [n].
    """
    found = [a * b for a in _polynomials(height) for b in _polynomials(time)]
    if not found or not len(height):
        return np.zeros((0, len(height)))
    patterns = np.array(found)
    return np.asarray(patterns / np.sqrt((patterns**2).sum(axis=0).mean()))


def _polynomials(x: FloatArray) -> list[FloatArray]:
    """Legendre polynomials over the range of some values, as many as those tell apart."""
    many = min(DEGREES, len(np.unique(x)))
    if many < 2:
        return [np.ones(len(x))][:many]
    low, high = float(np.min(x)), float(np.max(x))
    scaled = (2.0 * x - low - high) / (high - low)
    return list(legendre.legvander(scaled, many - 1).T)


def most_likely_amplitude(residual: FloatArray, patterns: FloatArray, other: Whitening) -> float:
    """Most likely standard deviation of the patterns' amplitudes, in the residual's unit.

    With C the covariance of all else, whitened patterns B = V S U' and the residual's coordinates h = U' r in
    the same units, -2 ln L is ``sum ln(1 + s^2 S^2) + h^2 / (1 + s^2 S^2)`` up to a constant.

    Parameters
    ----------
    residual
        Shape [k].
    patterns
        Of unit amplitude, shape [q, k].
    other
        The covariance of all other errors.
    """
    if not len(patterns):
        return 0.0
    white = other.apply(np.vstack([patterns, residual[None]]))
    values, vectors = np.linalg.eigh(white[:-1] @ white[:-1].T)
    kept = values > 1e-9 * values[-1]
    size = values[kept]
    seen = (vectors[:, kept].T @ (white[:-1] @ white[-1])) ** 2 / size

    def deviance(log_share: FloatArray | float) -> FloatArray:
        total = 1.0 + np.exp(2.0 * log_share) * size / size[-1]
        return np.asarray((np.log(total) + seen / total).sum(axis=-1))

    first = int(np.argmin(deviance(STEPS[:, None])))
    if deviance(STEPS[first]) >= seen.sum():
        return 0.0
    near = float(STEPS[max(first - 1, 0)]), float(STEPS[min(first + 1, len(STEPS) - 1)])
    best = float(minimize_scalar(lambda x: float(deviance(x)), bounds=near, method="bounded").x)
    return float(np.exp(best) / np.sqrt(size[-1]))


def without_common(
    residual: FloatArray, common: FloatArray, own_sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """A residual without its most likely part by common errors, and that part's variance, shape [k] both.

    D (D + M' M)^-1 r with the variances D of what is independent and the common rows M, by Woodbury's
    identity: the matrix that is inverted has the size of those.

    Parameters
    ----------
    residual
        Shape [k].
    common
        A standard deviation a row, shape [n, k].
    own_sigma
        Standard deviations of what is independent, shape [k].
    """
    weight: FloatArray = own_sigma**-2
    inner = np.eye(len(common)) + _product(common * weight, common.T)
    spread = _product(np.asarray(np.linalg.inv(inner), dtype=np.float64), common)
    share = np.einsum("ik,k->i", common, weight * residual)
    return residual - np.einsum("ik,i->k", spread, share), np.einsum("ik,ik->k", spread, common)


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Matrix product; of few rows without BLAS, whose threads cost more than the sums."""
    return np.asarray(a @ b if len(a) > FEW else np.einsum("ik,kj->ij", a, b))
