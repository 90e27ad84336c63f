"""Outline of an axisymmetric specimen with its uncertainty, and the error that a highlight makes of it.

A body of revolution has one radius at one height. A highlight in the middle of the strip moves the matches
there by tenths of a pixel, while its residual is no larger than elsewhere; the surface beside it has another
radius, which shows the error.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dic.basics import BoolArray, FloatArray, IntArray
from dic.correlation.subsets import Shape, overlap_matrix
from dic.outcome import PointOutcome
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

    ``surface``: the measured surface. ``points``: places of its points in the material picture, on a grid
    along the axis [px], shape [n_points, 2]. ``half_width``: points within this distance of the centre plane
    in their frame are used [m]. ``subset``: side of the subsets in the material picture [px]. ``shape``:
    shape function of the matches, of tracking and stereo that of the higher order. ``axis_x``, ``axis_Z``:
    where the specimen's axis lies in the surface's frame [m]. Returns: frame by frame, in each frame by
    increasing y of the rows at rest. `left_out` counts the points that are not valid and whose reference
    position lies in the strip. Raises ValueError: `half_width` or `subset` not positive, `points` of another
    shape, or a valid point of the strip that is not on the camera side of the axis.
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
    """Frames, weighted means of y and radius, and sigma of the latter; one tuple a row."""
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
"""Distances from the centre plane between which points lie beside the strip, in its half widths [-]: clear of
it, and where the radius is still seen nearly along itself."""
FEWEST_POINTS = 2
"""Points of a row on one side that give its radius there."""
FEWEST_ROWS = 3
"""Rows on each side that tell the radius between them."""


def departures(
    surface: SurfaceHistory, points: ArrayLike, line: CentrePoints, *, half_width: float
) -> tuple[FloatArray, FloatArray]:
    """Outline less the mean of the radii beside it, to the left and to the right, at the same height.

    An axis that lies off to one side adds to one radius what it takes from the other. Rows beside the strip
    are joined by straight lines.

    ``surface``: the measured surface; its axis is that of its frame. ``points``: places of its points in the
    material picture, on a grid along the axis [px], shape [n_points, 2]. ``line``: the outline.
    ``half_width``: half width of the strip that it is from [m]. Returns: of each row of the outline [m],
    shape [n]; NaN where the surface beside it is not known. Returns: its standard deviation [m], shape [n]:
    points of a row beside the strip share their pixels and are counted as one.
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
    """Radius and its standard deviation at some heights, by the row means of some points; NaN beyond them."""
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
    """Pattern of the outline's error that the departures show, one standard deviation [m], shape [n].

    It is the departures, smaller by so much that their mean square over their variances is what noise leaves
    of it: its own 1 is taken off. 0 where none is known, and everywhere if they are no larger than noise.

    ``departure``, ``sigma``: as `departures` gives them [m], shape [n].
    """
    finite = np.isfinite(departure)
    if not finite.any():
        return np.zeros(departure.size)
    chi2 = float(np.mean((departure[finite] / sigma[finite]) ** 2))
    share = np.sqrt(max(1.0 - 1.0 / chi2, 0.0)) if chi2 > 0.0 else 0.0
    return np.where(finite, share * departure, 0.0)
