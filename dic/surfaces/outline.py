"""Outline of an axisymmetric specimen with its uncertainty, and its error due to a highlight.

A body of revolution has one radius at each height. A highlight in the middle of the strip shifts the matches
by tenths of a pixel. Its residual is not larger than at other places. The surface on both sides of the
highlight then has a different radius, which shows the error.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dic.basics import BoolArray, FloatArray, IntArray
from dic.correlation.subsets import Shape, overlap_matrix
from dic.outcome import PointOutcome
from dic.surfaces.surface_history import CentrePoints, SurfaceHistory


def rows_of(surface: SurfaceHistory, points: ArrayLike) -> IntArray:
    """Row number of each point of the grid; rows run across the axis and are counted by increasing y."""
    grid = np.asarray(points, dtype=np.float64)
    y = surface.X[:, 1]
    terms = np.column_stack([np.ones(len(y)), grid])
    slope = np.linalg.lstsq(terms, y, rcond=None)[0][1:]
    along = int(np.argmax(np.abs(slope)))  # the picture's coordinate along the axis
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
    """Outline from the points near the centre line, one mean per row of the grid.

    Every point is rotated about the axis to the centre line as in `dic.centre_line`. The points of a row are
    then averaged, weighted with the inverse squares of their sigmas. The sigma of a mean includes the
    correlation of overlapping subsets (`dic.correlation.subsets.overlap_correlation`). A finer grid therefore
    does not reduce it.

    ``surface``: the measured surface. ``points``: positions of its points in the material picture, on a grid
    along the axis [px], shape [n_points, 2]. ``half_width``: points within this distance of the centre plane
    in their frame are used [m]. ``subset``: side of the subsets in the material picture [px]. ``shape``:
    shape function of the matches. If those of tracking and stereo differ, it is the one of higher order.
    ``axis_x``, ``axis_Z``: position of the specimen's axis in the surface's frame [m]. Returns: the outline
    frame by frame. Within a frame the rows are ordered by increasing y at rest. `left_out` counts the invalid
    points whose reference position lies in the strip. Raises ValueError if `half_width` or `subset` is not
    positive, if `points` has another shape, or if a valid point of the strip is not on the camera side of the
    axis.
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
    outcomes = surface.outcome[:, np.abs(surface.X[:, 0] - axis_x) <= half_width]
    counts = {member: int(np.sum(outcomes == member)) for member in PointOutcome if not member.ok}
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
    """Frames, weighted means of y and radius, and sigma of the radius; one tuple per row."""
    for number in range(int(row.max(initial=-1)) + 1):
        members = np.flatnonzero(row == number)
        members_used = used[:, members]
        frame = np.flatnonzero(members_used.any(axis=1))
        if not frame.size:
            continue
        members_used = members_used[frame]
        s = np.where(members_used, sigma[np.ix_(frame, members)], np.inf)
        w = s**-2
        w = w / w.sum(axis=1, keepdims=True)
        noise = np.where(members_used, w * np.where(members_used, s, 0.0), 0.0)
        correlation = overlap_matrix(grid[members], *subset)
        means = [
            np.sum(w * np.where(members_used, value[np.ix_(frame, members)], 0.0), axis=1)
            for value in (y, radius)
        ]
        variance = np.sum((noise @ correlation) * noise, axis=1)
        yield frame.astype(np.int64), means[0], means[1], np.sqrt(variance)


LATERAL = 1.5, 3.5
"""Range of distances from the centre plane for lateral points, in half widths of the strip [-]. These points
are outside the strip, and their radius points nearly toward the cameras."""
FEWEST_POINTS = 2
"""Smallest number of points of a row on one side for a lateral radius."""
FEWEST_ROWS = 3
"""Smallest number of rows on each side for an interpolated lateral radius."""


def departures(
    surface: SurfaceHistory, points: ArrayLike, line: CentrePoints, *, half_width: float
) -> tuple[FloatArray, FloatArray]:
    """Outline minus the mean of the radii left and right of the strip at the same height.

    A lateral error of the axis increases one of the two radii and decreases the other by the same amount. The
    lateral radii are interpolated linearly between rows.

    ``surface``: the measured surface; its axis is that of its frame. ``points``: positions of its points in
    the material picture, on a grid along the axis [px], shape [n_points, 2]. ``half_width``: half width of
    the outline's strip [m]. Returns: the difference for each row of the outline [m], shape [n]; NaN where the
    lateral surface is not known. Returns: its standard deviation [m], shape [n]. The lateral points of a row
    share their pixels and count as one point.
    """
    row = rows_of(surface, points)
    position = surface.position
    radius = np.hypot(position[..., 0], position[..., 2])
    with np.errstate(invalid="ignore"):
        noise = np.hypot(position[..., 0] * surface.sigma[..., 0], position[..., 2] * surface.sigma[..., 2])
        noise = noise / radius
        away = np.abs(position[..., 0]) / half_width
    lateral = surface.valid & (away >= LATERAL[0]) & (away <= LATERAL[1])
    departure, sigma = np.full((2, line.Z.size), np.nan)
    for k in np.unique(line.frame).tolist():
        at = np.flatnonzero(line.frame == k)
        sides = []
        for right in (False, True):
            in_side = lateral[k] & ((position[k, :, 0] > 0.0) == right)
            sides.append(_at_heights(in_side, row, position[k, :, 1], radius[k], noise[k], line.y[at]))
        (left_mean, left_sigma), (right_mean, other_sigma) = sides
        departure[at] = line.Z[at] - 0.5 * (left_mean + right_mean)
        sigma[at] = np.sqrt(line.sigma[at] ** 2 + 0.25 * (left_sigma**2 + other_sigma**2))
    return departure, sigma


def _at_heights(
    used: BoolArray, row: IntArray, y: FloatArray, radius: FloatArray, noise: FloatArray, heights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Radius and its standard deviation at given heights. They are interpolated between the row means; NaN
    outside."""
    count = np.bincount(row[used])
    full = np.flatnonzero(count >= FEWEST_POINTS)
    if full.size < FEWEST_ROWS:
        return np.full(heights.size, np.nan), np.full(heights.size, np.nan)
    means = [np.bincount(row[used], values[used])[full] / count[full] for values in (y, radius, noise)]
    order = np.argsort(means[0])
    low, value, spread = (mean[order] for mean in means)
    at = [np.interp(heights, low, one, left=np.nan, right=np.nan) for one in (value, spread)]
    return np.asarray(at[0]), np.asarray(at[1])


def beyond_noise(departure: FloatArray, sigma: FloatArray) -> FloatArray:
    """Pattern of the outline's error from its departures [m], shape [n]: one standard deviation.

    The departures are scaled down to remove the contribution of noise: their mean square over their variances
    is reduced by 1. The pattern is 0 where a departure is not known. It is 0 everywhere if the departures do
    not exceed the noise.

    ``departure``, ``sigma``: as returned by `departures` [m], shape [n].
    """
    finite = np.isfinite(departure)
    if not finite.any():
        return np.zeros(departure.size)
    chi2 = float(np.mean((departure[finite] / sigma[finite]) ** 2))
    share = np.sqrt(max(1.0 - 1.0 / chi2, 0.0)) if chi2 > 0.0 else 0.0
    return np.where(finite, share * departure, 0.0)
