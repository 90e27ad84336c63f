"""Anisotropic correlation functions of Gaussian processes, with their derivatives by the lengths."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from doe.arrays import FloatArray

Correlation = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Correlation c and its slope -2 dc/d(r^2) of squared distances r^2, measured in lengths."""


def squared_exponential(r2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """exp(-r^2 / 2): for responses with all derivatives."""
    c = np.exp(-0.5 * r2)
    return c, c


def matern52(r2: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(1 + a + a^2 / 3) exp(-a), a = sqrt(5) r: for responses with two derivatives."""
    a = np.sqrt(5.0 * r2)
    decay = np.exp(-a)
    return (1.0 + a + a**2 / 3.0) * decay, 5.0 / 3.0 * (1.0 + a) * decay


CORRELATIONS: dict[str, Correlation] = {
    "squared exponential": squared_exponential,
    "matern 5/2": matern52,
}
"""By name; the likelihood of the runs chooses among them."""


def squared_differences(a: FloatArray, b: FloatArray) -> FloatArray:
    """(a_i - b_j)^2 by coordinate, shape [d, n, m]."""
    return np.asarray((a.T[:, :, None] - b.T[:, None, :]) ** 2)


def with_lengths(kind: str, squares: FloatArray, lengths: FloatArray) -> FloatArray:
    """Correlation matrix of squared differences [d, n, m] and lengths [d], shape [n, m]."""
    return CORRELATIONS[kind](np.tensordot(1.0 / lengths**2, squares, axes=1))[0]


def with_slopes(kind: str, squares: FloatArray, lengths: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same and its derivatives by ln(length), shapes [n, m] and [d, n, m]."""
    scaled = squares / (lengths**2)[:, None, None]
    c, slope = CORRELATIONS[kind](scaled.sum(axis=0))
    return c, scaled * slope
