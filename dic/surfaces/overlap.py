"""Subsets that overlap share pixels: how much the mean of their points is noisier than that of free ones."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dic.arrays import FloatArray


def overlap_correlation(first: ArrayLike, second: ArrayLike, subset: float) -> FloatArray:
    """Correlation of the errors of points from the share of pixels their square subsets have in common.

    The error of a match is a sum over the subset of noise times gradient; with even speckle the
    covariance of two sums is the common area over the area of one: (1 - |Δx|/s)(1 - |Δy|/s), s the side.

    Parameters
    ----------
    first, second
        Places in the material picture [px], shapes [n, 2] and [m, 2].
    subset
        Side of the subsets [px].

    Returns
    -------
    NDArray
        Shape [n, m].
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    across, down = (np.maximum(1.0 - np.abs(a[:, None, c] - b[None, :, c]) / subset, 0.0) for c in (0, 1))
    return np.asarray(across * down)


def overlap_matrix(points: ArrayLike, subset: float) -> csr_array:
    """`overlap_correlation` of points with themselves, of the pairs alone whose subsets overlap.

    Parameters
    ----------
    points
        Places in the material picture [px], shape [n, 2].
    subset
        Side of the subsets [px].

    Returns
    -------
    csr_array
        Shape [n, n], symmetric, ones on its diagonal; a row holds as many numbers as subsets reach into the
        point's own.
    """
    grid = np.asarray(points, dtype=np.float64)
    tree = cKDTree(grid)
    pairs = tree.query_pairs(subset, p=np.inf, output_type="ndarray")
    shares = np.maximum(1.0 - np.abs(grid[pairs[:, 0]] - grid[pairs[:, 1]]) / subset, 0.0)
    value = shares[:, 0] * shares[:, 1]
    some = value > 0.0
    one, other, value = pairs[some, 0], pairs[some, 1], value[some]
    own = np.arange(len(grid))
    rows, columns = np.concatenate([own, one, other]), np.concatenate([own, other, one])
    values = np.concatenate([np.ones(len(grid)), value, value])
    return csr_array((values, (rows, columns)), shape=(len(grid), len(grid)))


def overlap_factor(points: ArrayLike, subset: float, valid: ArrayLike | None = None) -> FloatArray:
    """Variance factor of each point that lets points be combined as if they were independent.

    It is the sum of a point's correlations with all others that are valid in the frame. For a mean with
    equal weights the variance then comes out exactly; for slopes a little too large.

    Parameters
    ----------
    points
        Places in the material picture [px], shape [n_points, 2].
    subset
        Side of the subsets [px].
    valid
        Which points are used together, shape [..., n_points]; None: all.

    Returns
    -------
    NDArray
        Factors >= 1, shape [n_points] or that of `valid`; 1 where not valid.

    Raises
    ------
    ValueError
        If `subset` is not positive.
    """
    if not subset > 0.0:
        raise ValueError(f"subset must be a positive number of pixels, got {subset}")
    correlation = overlap_matrix(points, subset)
    if valid is None:
        return np.asarray(correlation.sum(axis=1))
    used = np.asarray(valid, dtype=bool)
    return np.where(used, used.astype(np.float64) @ correlation, 1.0)
