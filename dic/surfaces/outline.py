"""Outline of an axisymmetric specimen with its uncertainty, and the surface's deviation from axial symmetry.

A body of revolution has one radius at one height. A highlight lies on the side that faces the lamp and the
cameras, which is the middle of the strip; it moves the match of a subset that it brightens in part by tenths
of a pixel, and each camera sees it at another place of the surface. Its residual is no larger than that of
compressed speckles elsewhere. But the surface beside it, where it is not, has another radius.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import diags_array

from dic.basics import BoolArray, FloatArray, IntArray
from dic.correlation.subsets import Shape, overlap_matrix
from dic.outcome import FrameOutcome, PointOutcome
from dic.surfaces.surface_history import CentrePoints, SurfaceHistory


def rows_of(surface: SurfaceHistory, points: ArrayLike) -> IntArray:
    """Number of the row across the axis that each point of the grid lies in, by increasing y."""
    grid = np.asarray(points, dtype=np.float64)
    y = surface.X[:, 1]
    terms = np.column_stack([np.ones(len(y)), grid])
    slope = np.linalg.lstsq(terms, y, rcond=None)[0][1:]
    along = int(np.argmax(np.abs(slope)))  # the picture's coordinate that runs along the axis
    _, row = np.unique(np.sign(slope[along]) * grid[:, along], return_inverse=True)
    return row.astype(np.int64)


def outline(
    surface: SurfaceHistory,
    points: ArrayLike,
    *,
    half_width: float,
    subset: float,
    shape: Shape = Shape.AFFINE,
    axis_x: float = 0.0,
    axis_Z: float = 0.0,
) -> CentrePoints:
    """Outline from the points near the centre line, one mean a row of the grid.

    Every point is carried round the circle to the centre line as in `dic.centre_line`; the points of a
    row are then averaged with the inverse squares of their sigmas. The sigma of a mean counts that
    subsets which overlap share pixels (`dic.correlation.subsets.overlap_correlation`), so that more columns
    of the same pixels promise nothing.

    Parameters
    ----------
    surface
        The measured surface.
    points
        Places of its points in the material picture, on a grid along the axis [px], shape [n_points, 2].
    half_width
        Points within this distance of the centre plane in their frame are used [m].
    subset
        Side of the subsets in the material picture [px].
    shape
        Shape function of the matches, of tracking and stereo that of the higher order.
    axis_x, axis_Z
        Where the specimen's axis lies in the surface's frame [m].

    Returns
    -------
    CentrePoints
        Frame by frame, in each frame by increasing y of the rows at rest. `left_out` counts the points
        that are not valid and whose reference position lies in the strip.

    Raises
    ------
    ValueError
        `half_width` or `subset` not positive, `points` of another shape, or a valid point of the strip
        that is not on the camera side of the axis.
    """
    if not (np.isfinite(half_width) and half_width > 0.0 and np.isfinite(subset) and subset > 0.0):
        raise ValueError(
            f"half_width [m] and subset [px] must be positive lengths, got {half_width} and {subset}"
        )
    grid = np.asarray(points, dtype=np.float64)
    if grid.shape != (surface.n_points, 2):
        raise ValueError(f"points has shape {grid.shape}, must be {(surface.n_points, 2)}")
    position = surface.position
    d, depth = position[..., 0] - axis_x, position[..., 2] - axis_Z
    used = surface.valid & (np.abs(d) <= half_width)
    behind = used & (depth <= 0.0)
    if np.any(behind):
        frame, point = np.argwhere(behind)[0]
        raise ValueError(
            f"frame {frame}, point {point} lies {depth[frame, point]} m from the axis toward the cameras, "
            f"must be > 0: check axis_Z (now {axis_Z} m)"
        )
    radius = np.hypot(d, depth)
    with np.errstate(invalid="ignore"):
        sigma = np.hypot(d * surface.sigma[..., 0], depth * surface.sigma[..., 2]) / radius
    parts = list(_means(used, rows_of(surface, grid), grid, (subset, shape), position[..., 1], radius, sigma))
    frame, y, Z, s = (np.concatenate(column) for column in zip(*parts, strict=True)) if parts else _NONE
    order = np.argsort(frame, kind="stable")
    lost = surface.outcome[:, np.abs(surface.X[:, 0] - axis_x) <= half_width]
    counts = {member: int(np.sum(lost == member)) for member in PointOutcome if not member.ok}
    return CentrePoints(
        t=surface.t[frame[order]],
        frame=frame[order],
        y=y[order],
        Z=Z[order],
        sigma=s[order],
        left_out={member: count for member, count in counts.items() if count},
    )


_NONE = (np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0), np.zeros(0))


def _means(
    used: NDArray[np.bool_],
    row: IntArray,
    grid: FloatArray,
    subset: tuple[float, Shape],
    y: FloatArray,
    radius: FloatArray,
    sigma: FloatArray,
) -> Iterator[tuple[IntArray, FloatArray, FloatArray, FloatArray]]:
    """Frames, weighted means of y and radius, and sigma of the latter; one tuple a row."""
    for number in range(int(row.max(initial=-1)) + 1):
        members = np.flatnonzero(row == number)
        here = used[:, members]
        frame = np.flatnonzero(here.any(axis=1))
        if not frame.size:
            continue
        here = here[frame]
        s = np.where(here, sigma[np.ix_(frame, members)], np.inf)
        w = s**-2
        w = w / w.sum(axis=1, keepdims=True)
        noise = np.where(here, w * np.where(here, s, 0.0), 0.0)
        correlation = overlap_matrix(grid[members], *subset)
        means = [
            np.sum(w * np.where(here, value[np.ix_(frame, members)], 0.0), axis=1) for value in (y, radius)
        ]
        variance = np.sum((noise @ correlation) * noise, axis=1)
        yield frame.astype(np.int64), means[0], means[1], np.sqrt(variance)


BESIDE = 1.5, 3.5
"""Distances from the centre plane between which points lie beside the strip, in its half widths [-]: clear of
it, and where the radius is still seen nearly along itself."""
FEWEST_POINTS = 2
"""Points of a row on one side that tell its radius there."""
FEWEST_ROWS = 3
"""Rows on each side that tell the radius between them."""


def departures(
    surface: SurfaceHistory, points: ArrayLike, line: CentrePoints, *, half_width: float
) -> tuple[FloatArray, FloatArray]:
    """Outline less the mean of the radii beside it, to the left and to the right, at the same height.

    An axis that lies off to one side adds to one radius what it takes from the other. Rows beside the strip
    are joined by straight lines.

    Parameters
    ----------
    surface
        The measured surface; its axis is that of its frame.
    points
        Places of its points in the material picture, on a grid along the axis [px], shape [n_points, 2].
    line
        The outline.
    half_width
        Half width of the strip that it is from [m].

    Returns
    -------
    departure : array
        Of each row of the outline [m], shape [n]; NaN where the surface beside it is not known.
    sigma : array
        Its standard deviation [m], shape [n]: points of a row beside the strip share their pixels and are
        counted as one.
    """
    row = rows_of(surface, points)
    position = surface.position
    radius = np.hypot(position[..., 0], position[..., 2])
    with np.errstate(invalid="ignore"):
        noise = np.hypot(position[..., 0] * surface.sigma[..., 0], position[..., 2] * surface.sigma[..., 2])
        noise = noise / radius
        away = np.abs(position[..., 0]) / half_width
    beside = surface.valid & (away >= BESIDE[0]) & (away <= BESIDE[1])
    departure, sigma = np.full((2, line.Z.size), np.nan)
    for k in np.unique(line.frame).tolist():
        at = np.flatnonzero(line.frame == k)
        sides = []
        for right in (False, True):
            here = beside[k] & ((position[k, :, 0] > 0.0) == right)
            sides.append(_at_heights(here, row, position[k, :, 1], radius[k], noise[k], line.y[at]))
        (left, left_sigma), (other, other_sigma) = sides
        departure[at] = line.Z[at] - 0.5 * (left + other)
        sigma[at] = np.sqrt(line.sigma[at] ** 2 + 0.25 * (left_sigma**2 + other_sigma**2))
    return departure, sigma


def _at_heights(
    here: BoolArray, row: IntArray, y: FloatArray, radius: FloatArray, noise: FloatArray, heights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Radius and its standard deviation at some heights, by the row means of some points; NaN beyond them."""
    count = np.bincount(row[here])
    full = np.flatnonzero(count >= FEWEST_POINTS)
    if full.size < FEWEST_ROWS:
        return np.full(heights.size, np.nan), np.full(heights.size, np.nan)
    means = [np.bincount(row[here], values[here])[full] / count[full] for values in (y, radius, noise)]
    order = np.argsort(means[0])
    low, value, spread = (mean[order] for mean in means)
    at = [np.interp(heights, low, one, left=np.nan, right=np.nan) for one in (value, spread)]
    return np.asarray(at[0]), np.asarray(at[1])


def beyond_noise(departure: FloatArray, sigma: FloatArray) -> FloatArray:
    """Pattern of the outline's error that the departures show, one standard deviation [m], shape [n].

    It is the departures, smaller by so much that their mean square over their variances is what noise leaves
    of it: its own 1 is taken off. 0 where none is known, and everywhere if they are no larger than noise.

    Parameters
    ----------
    departure, sigma
        As `departures` gives them [m], shape [n].
    """
    known = np.isfinite(departure)
    if not known.any():
        return np.zeros(departure.size)
    chi2 = float(np.mean((departure[known] / sigma[known]) ** 2))
    share = np.sqrt(max(1.0 - 1.0 / chi2, 0.0)) if chi2 > 0.0 else 0.0
    return np.where(known, share * departure, 0.0)


@dataclass(frozen=True)
class _Axisymmetry:
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
) -> _Axisymmetry:
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
    return _Axisymmetry(
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
