"""The outline of an axisymmetric specimen from several columns of points, with the sigma of their mean."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dic.arrays import FloatArray, IntArray
from dic.correlation.warp import Shape
from dic.outcome import PointOutcome
from dic.surfaces.overlap import overlap_matrix
from dic.surfaces.surface_history import CentrePoints, SurfaceHistory


def rows_of(surface: SurfaceHistory, points: ArrayLike) -> IntArray:
    """Number of the row across the axis that each point of the grid lies in, by increasing y.

    Parameters
    ----------
    surface
        The points' reference positions.
    points
        Their places in the material picture, on a grid [px], shape [n_points, 2].

    Returns
    -------
    NDArray
        Shape [n_points].
    """
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
    subsets which overlap share pixels (`dic.surfaces.overlap.overlap_correlation`), so that more columns
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
