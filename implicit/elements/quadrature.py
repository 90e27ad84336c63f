"""Gauss rules of any order on hypercubes and simplices.

A hypercube takes the product of Gauss and Legendre's points. A simplex takes Stroud's conical product of
Gauss and Jacobi's points (Stroud 1971, section 2.4), exact to degree 2 n - 1 with n points in each direction;
for n <= 2 the symmetric rules of 1 and d + 1 points, exact to degree 1 and 2, are smaller.
"""

import numpy as np
from scipy.special import roots_jacobi

from explicit.arrays import FloatArray


def hypercube_rule(gauss: int, dimension: int) -> tuple[FloatArray, FloatArray]:
    """Points in [-1, 1]^d, shape [gauss^d, d], and weights of sum 2^d, shape [gauss^d]."""
    x, w = np.polynomial.legendre.leggauss(_checked(gauss))
    points = np.stack(np.meshgrid(*[x] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    weights = np.stack(np.meshgrid(*[w] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension)
    return points, weights.prod(axis=1)


def simplex_rule(gauss: int, dimension: int) -> tuple[FloatArray, FloatArray]:
    """Points in the unit simplex, shape [g, d], and weights of sum 1 / d!, shape [g]."""
    volume = 1.0 / (1.0, 1.0, 2.0, 6.0)[dimension]
    if _checked(gauss) == 1:
        return np.full((1, dimension), 1.0 / (dimension + 1)), np.array([volume])
    if gauss == 2:
        # a point on each line from the centre to a corner: exact for degree 2 (Stroud's Tn: 2-1)
        near = {2: 1.0 / 6.0, 3: (5.0 - 5.0**0.5) / 20.0}[dimension]
        points = np.full((dimension + 1, dimension), near)
        points[np.arange(dimension), np.arange(dimension)] = 1.0 - dimension * near
        return points, np.full(dimension + 1, volume / (dimension + 1))
    # x_1 = t_1, x_2 = (1 - t_1) t_2, x_3 = (1 - t_1)(1 - t_2) t_3 with the weight (1 - t_i)^(d - i)
    rules = [roots_jacobi(gauss, dimension - 1 - i, 0.0) for i in range(dimension)]
    t = np.stack(np.meshgrid(*[0.5 * (x + 1.0) for x, _ in rules], indexing="ij"), axis=-1)
    scaled = [w * 0.5 ** (dimension - i) for i, (_, w) in enumerate(rules)]
    weights = np.stack(np.meshgrid(*scaled, indexing="ij"), axis=-1).reshape(-1, dimension)
    t = t.reshape(-1, dimension)
    left = np.cumprod(np.column_stack([np.ones(len(t)), 1.0 - t[:, :-1]]), axis=1)
    return left * t, weights.prod(axis=1)


def _checked(gauss: int) -> int:
    if not 1 <= gauss <= 12:
        raise ValueError(f"gauss must be in [1, 12] points a direction, got {gauss}")
    return gauss
