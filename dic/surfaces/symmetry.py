"""Deviation of a surface from a body of revolution about the test frame's axis, frame by frame."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike
from scipy.sparse import diags_array

from dic.arrays import FloatArray, IntArray
from dic.outcome import FrameOutcome
from dic.surfaces.overlap import overlap_matrix
from dic.surfaces.surface_history import SurfaceHistory


@dataclass(frozen=True)
class Axisymmetry:
    """Remainder of a surface beside a body of revolution about y; NaN in a frame that is not VALID.

    With the polar angle θ about the axis, 0 toward the cameras and positive toward x, the distance of
    the surface from y is fitted by ``r(y) + (a + b (y - y_mid)) sin θ``: a body of revolution whose
    axis lies off by a and leans by b toward x. What moves toward the cameras cannot be told from a
    change of radius on the part that they see.
    """

    shift: FloatArray
    """Place a of the axis along x at mid-height of the points [m], shape [n_frames]."""
    shift_sigma: FloatArray
    """Its standard uncertainty [m], shape [n_frames]."""
    tilt: FloatArray
    """Lean b of the axis toward x [-], shape [n_frames]."""
    tilt_sigma: FloatArray
    """Its standard uncertainty [-], shape [n_frames]."""
    angle: FloatArray
    """Middles of the bins of θ [rad], shape [n_angles]."""
    residual: FloatArray
    """Mean distance from the body of revolution about y that fits best, outward positive, by angle [m];
    NaN where the bin has no point, shape [n_frames, n_angles]."""
    residual_sigma: FloatArray
    """Standard uncertainty of that mean from the noise of its points [m], likewise."""
    rms: FloatArray
    """Root mean square of `residual` over the bins [m], shape [n_frames]."""
    expected: FloatArray
    """Value of `rms` from noise alone [m], shape [n_frames]."""
    outcome: IntArray
    """`dic.FrameOutcome`, LOST where there are too few points, shape [n_frames]."""


def axisymmetry(
    surface: SurfaceHistory,
    points: ArrayLike,
    *,
    subset: float,
    degree: int = 6,
    bins: int = 8,
) -> Axisymmetry:
    """Compare a surface in every frame with a body of revolution about the axis of its frame.

    Parameters
    ----------
    surface
        The surface in the test frame.
    points
        Places of its points in the material picture [px], shape [n_points, 2].
    subset
        Side of the subsets there [px]; the errors of points whose subsets overlap are correlated.
    degree
        Degree of the polynomial r(y).
    bins
        Bins of the polar angle, between the smallest and the largest of all valid points.

    Raises
    ------
    ValueError
        `degree`, `bins` or `subset` out of range, `points` of another shape, or no valid point at all.
    """
    if not 0 <= degree <= 20 or not 2 <= bins <= 1000:
        raise ValueError(f"degree must be in 0..20 and bins in 2..1000, got {degree} and {bins}")
    if not surface.valid.any():
        raise ValueError("the surface has no valid point in any frame; look at its outcomes")
    grid = np.asarray(points, dtype=np.float64)
    if grid.shape != (surface.n_points, 2) or not subset > 0.0:
        raise ValueError(
            f"points must be [{surface.n_points}, 2] and subset > 0 px, got {grid.shape} and {subset}"
        )
    correlation = overlap_matrix(grid, subset)
    position = surface.position
    theta = np.arctan2(position[..., 0], position[..., 2])
    distance = np.hypot(position[..., 0], position[..., 2])
    with np.errstate(invalid="ignore"):
        noise = np.hypot(np.sin(theta) * surface.sigma[..., 0], np.cos(theta) * surface.sigma[..., 2])
    seen = theta[surface.valid]
    edges = np.linspace(seen.min(), seen.max() + 1e-9, bins + 1)
    n = surface.n_frames
    numbers = np.full((n, 6), np.nan)
    residual, residual_sigma = np.full((n, bins), np.nan), np.full((n, bins), np.nan)
    outcome = np.full(n, int(FrameOutcome.LOST), dtype=np.int64)
    for k in range(n):
        valid = surface.valid[k]
        if valid.sum() < 2 * (degree + 3):
            continue
        y = position[k, valid, 1]
        middle, half = 0.5 * (y.max() + y.min()), 0.5 * np.ptp(y)
        if not half > 0.0:
            continue
        outcome[k] = FrameOutcome.VALID
        round_part = legendre.legvander((y - middle) / half, degree)
        sin = np.sin(theta[k, valid])
        lateral = np.column_stack([sin, sin * (y - middle) / half])
        sigma = noise[k, valid]
        C = diags_array(sigma) @ correlation[valid][:, valid] @ diags_array(sigma)
        G = _estimator(np.column_stack([round_part, lateral]), sigma)[-2:] / np.array([[1.0], [half]])
        numbers[k, [0, 2]] = G @ distance[k, valid]
        numbers[k, [1, 3]] = np.sqrt(np.sum((G @ C) * G, axis=1))
        terms = _estimator(round_part, sigma)
        bin_of = np.clip(np.digitize(theta[k, valid], edges) - 1, 0, bins - 1)
        average = (bin_of == np.arange(bins)[:, None]) / sigma**2
        weight = average.sum(axis=1)
        full = weight > 0.0
        average = average[full] / weight[full, None]
        average = average - (average @ round_part) @ terms
        residual[k, full] = average @ distance[k, valid]
        residual_sigma[k, full] = np.sqrt(np.sum((average @ C) * average, axis=1))
        numbers[k, 4] = np.sqrt(np.mean(residual[k, full] ** 2))
        numbers[k, 5] = np.sqrt(np.mean(residual_sigma[k, full] ** 2))
    return Axisymmetry(
        shift=numbers[:, 0],
        shift_sigma=numbers[:, 1],
        tilt=numbers[:, 2],
        tilt_sigma=numbers[:, 3],
        angle=0.5 * (edges[1:] + edges[:-1]),
        residual=residual,
        residual_sigma=residual_sigma,
        rms=numbers[:, 4],
        expected=numbers[:, 5],
        outcome=outcome,
    )


def _estimator(terms: FloatArray, sigma: FloatArray) -> FloatArray:
    """Matrix from the data to the weighted least-squares unknowns, shape [n_terms, n]."""
    return np.asarray(np.linalg.pinv(terms / sigma[:, None]) / sigma)
