"""Richardson's estimate of what a refinement series converges to."""

from math import pi, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq, minimize_scalar

FloatArray = NDArray[np.float64]


class Limit(NamedTuple):
    """The limit of a series q(h) = q_0 + C h^p with a given order p."""

    value: FloatArray
    """q_0, in the unit of the series, shape [...]."""
    deviation: FloatArray
    """Largest distance of a member of the series from the law, shape [...]."""


def limit(h: ArrayLike, series: ArrayLike, order: float) -> Limit:
    """Fit q_0 and C by least squares.

    Parameters
    ----------
    h
        Element sizes, any unit, shape [n], n >= 3: two would leave nothing to judge the law by.
    series
        The quantity on each mesh, shape [n, ...].
    order
        The order p, from theory.
    """
    sizes, values = np.asarray(h, dtype=float), np.asarray(series, dtype=float)
    if len(sizes) < 3 or len(sizes) != len(values):
        raise ValueError(f"need three or more sizes with a value each, got {len(sizes)} and {len(values)}")
    law = np.column_stack([np.ones_like(sizes), sizes**order])
    flat = values.reshape(len(sizes), -1)
    found = np.linalg.lstsq(law, flat, rcond=None)[0]
    shape = values.shape[1:]
    return Limit(found[0].reshape(shape), np.abs(flat - law @ found).max(axis=0).reshape(shape))


class CommonLimit(NamedTuple):
    """What several series share: q_i(h) = q_0 + C_i h^p with one limit and one order."""

    value: float
    """q_0, in the unit of the series."""
    order: float
    """p [-]."""
    deviation: float
    """Largest distance of a member of a series from the law, in the unit of the series."""


def common_limit(h: ArrayLike, series: ArrayLike) -> CommonLimit:
    """Fit q_0, p and a C for each series by least squares; two series of four leave four degrees of freedom.

    Parameters
    ----------
    h
        Element sizes, any unit, shape [n].
    series
        A number on each mesh, by element, shape [n_series, n], n >= 3, n_series >= 2.
    """
    sizes, values = np.asarray(h, dtype=float), np.asarray(series, dtype=float)
    if len(sizes) < 3 or len(values) < 2:
        raise ValueError(f"need two series of three sizes or more, got {len(values)} of {len(sizes)}")

    def fit(order: float) -> tuple[float, FloatArray]:
        law = np.zeros((values.size, 1 + len(values)))
        law[:, 0] = 1.0
        for i in range(len(values)):
            law[i * len(sizes) : (i + 1) * len(sizes), i + 1] = sizes**order
        found = np.linalg.lstsq(law, values.ravel(), rcond=None)[0]
        return float(found[0]), values.ravel() - law @ found

    best = minimize_scalar(lambda p: float((fit(p)[1] ** 2).sum()), bounds=(0.3, 4.0), method="bounded").x
    value, residual = fit(best)
    return CommonLimit(value, float(best), float(np.abs(residual).max()))


def corner_exponent() -> float:
    """Exponent of the displacement at a right-angled edge of an incompressible solid bonded on one side.

    The root of sin^2(lambda pi / 2) = 1 - lambda^2: Williams (1952), clamped-free wedge, plane strain,
    nu = 1/2. Energies and forces then converge with the order 2 lambda on a uniform mesh.
    """
    return float(brentq(lambda x: sin(0.5 * pi * x) ** 2 - 1.0 + x * x, 0.3, 0.9))
