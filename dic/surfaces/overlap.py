"""Subsets that overlap share pixels: how much the mean of their points is noisier than that of free ones."""

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dic.arrays import FloatArray
from dic.correlation.warp import Shape


def overlap_correlation(
    first: ArrayLike, second: ArrayLike, subset: float, shape: Shape = Shape.AFFINE
) -> FloatArray:
    """Correlation of the errors of points whose square subsets have pixels in common.

    The error of a match is a sum over the subset of noise times gradient times a weight: that which a fit of
    the shape function gives its value in the middle. For even speckle the covariance of two such sums is that
    of the weights over the common area. A rigid or affine shape function weighs all pixels alike, which gives
    (1 - |Δx|/s)(1 - |Δy|/s), s the side. A quadratic one weighs them with ``7/2 - 15/4 (ξ² + η²)``, ξ and η
    from -1 to 1 over the subset: less than nothing in the corners, so that the errors of neighbours are less
    alike, and opposite farther apart.

    Parameters
    ----------
    first, second
        Places in the material picture [px], shapes [n, 2] and [m, 2].
    subset
        Side of the subsets [px].
    shape
        Shape function of the match.

    Returns
    -------
    NDArray
        Shape [n, m].
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    return _alike(a[:, None, :] - b[None, :, :], subset, shape)


def _alike(apart: FloatArray, subset: float, shape: Shape) -> FloatArray:
    """Correlation of points that are `apart` [px], shape [..., 2]."""
    share = np.maximum(1.0 - np.abs(apart) / subset, 0.0)
    across, down = share[..., 0], share[..., 1]
    if shape <= Shape.AFFINE:
        return np.asarray(across * down)
    # half the overlap h along an axis, and half the distance e, in halves of the side: means over the overlap
    # of ξ² (alike for the other subset's, by symmetry) and of the product of both squares
    e2 = (1.0 - share) ** 2
    square = share**2 / 3.0 + e2
    product = share**4 / 5.0 - 2.0 * e2 * share**2 / 3.0 + e2**2
    x, y, xx, yy = square[..., 0], square[..., 1], product[..., 0], product[..., 1]
    mean = 3.5**2 - 2.0 * 3.5 * 3.75 * (x + y) + 3.75**2 * (xx + yy + 2.0 * x * y)
    return np.asarray(across * down * mean / 3.5)


def overlap_matrix(points: ArrayLike, subset: float, shape: Shape = Shape.AFFINE) -> csr_array:
    """`overlap_correlation` of points with themselves, of the pairs alone whose subsets overlap.

    Parameters
    ----------
    points
        Places in the material picture [px], shape [n, 2].
    subset
        Side of the subsets [px].
    shape
        Shape function of the match.

    Returns
    -------
    csr_array
        Shape [n, n], symmetric, ones on its diagonal; a row holds as many numbers as subsets reach into the
        point's own.
    """
    grid = np.asarray(points, dtype=np.float64)
    tree = cKDTree(grid)
    pairs = tree.query_pairs(subset, p=np.inf, output_type="ndarray")
    value = _alike(grid[pairs[:, 0]] - grid[pairs[:, 1]], subset, shape)
    some = value != 0.0
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
