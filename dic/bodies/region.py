"""Regions of bodies in a picture: polygons to masks, masks to grids of points."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class Region:
    """Region of a body in one picture of camera 0."""

    corners: tuple[tuple[float, float], ...]
    """Corners (x, y) [px]."""
    frame: int = 0
    """The frame whose picture it is."""


def polygon_mask(corners: Sequence[tuple[float, float]], shape: tuple[int, int]) -> BoolArray:
    """The pixels whose centres lie inside a polygon or on its rim.

    OpenCV's `fillPoly` fills the pixels that a side passes through as well, whose centres may lie up to half
    a pixel outside: a region that is declared clear of an edge would come to it.

    Parameters
    ----------
    corners
        Corners (x, y) in order [px], at least three; the last is joined to the first. Even-odd rule.
    shape
        Rows and columns of the picture.

    Returns
    -------
    array of bool
        Shape [rows, columns].

    Raises
    ------
    ValueError
        Fewer than three corners, one that is not finite, or a polygon that holds no pixel of the picture.
    """
    vertices = np.asarray(corners, dtype=np.float64)
    if vertices.ndim != 2 or vertices.shape[0] < 3 or vertices.shape[1] != 2:
        raise ValueError(
            f"a region needs three corners (x, y) or more, got an array of shape {vertices.shape}"
        )
    if not np.all(np.isfinite(vertices)):
        raise ValueError(f"the corners of a region must be finite, got {vertices.tolist()}")
    rows, columns = shape
    y, x = np.mgrid[0.0:rows, 0.0:columns]
    inside = np.zeros(shape, dtype=bool)
    rim = np.zeros(shape, dtype=bool)
    for (xa, ya), (xb, yb) in zip(vertices, np.roll(vertices, -1, axis=0), strict=True):
        cross = (xb - xa) * (y - ya) - (yb - ya) * (x - xa)
        along = (x - xa) * (xb - xa) + (y - ya) * (yb - ya)
        length = np.hypot(xb - xa, yb - ya)
        rim |= (np.abs(cross) <= 1e-9 * max(length, 1.0)) & (along >= 0.0) & (along <= length**2)
        spans = (ya > y) != (yb > y)
        inside ^= spans & ((cross > 0.0) == (yb > ya))
    mask = inside | rim
    if not mask.any():
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        raise ValueError(
            f"the region from ({low[0]:g}, {low[1]:g}) to ({high[0]:g}, {high[1]:g}) px holds no pixel of "
            f"a picture of {columns} x {rows} px"
        )
    return mask


def grid_points(mask: BoolArray, step: int, *, margin: float = 0.0) -> tuple[FloatArray, IntArray]:
    """Points of a square grid inside a mask.

    Parameters
    ----------
    mask
        Pixels of the body, shape [rows, columns].
    step
        Distance of neighbouring points [px], at least 1.
    margin
        Least distance from a point to the nearest pixel outside the mask [px]; the picture's border is
        outside.

    Returns
    -------
    points : array
        Places (x, y) [px], shape [n, 2]: whole numbers, so a point is a pixel's centre.
    cell : array of int
        Column and row of each point in the grid, shape [n, 2].

    Raises
    ------
    ValueError
        A step below 1, a negative margin, or no point that is left.
    """
    if step < 1 or margin < 0.0:
        raise ValueError(f"step must be at least 1 px and margin not negative, got {step} and {margin}")
    rows, columns = np.nonzero(mask)
    if rows.size == 0:
        raise ValueError("the mask holds no pixel")
    fit = mask
    if margin > 0.0:
        from scipy.ndimage import distance_transform_edt

        fit = np.asarray(distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1] > margin)
        rows, columns = np.nonzero(fit)
        if rows.size == 0:
            raise ValueError(
                f"no pixel of the region is {margin:g} px inside it: enlarge it or lower the subset"
            )
    # The grid is centred on what can be measured, so that both rims are approached alike.
    x = _centred(columns.min(), columns.max(), step)
    y = _centred(rows.min(), rows.max(), step)
    i, j = np.meshgrid(np.arange(x.size), np.arange(y.size))
    kept = fit[y[j], x[i]].ravel()
    cell = np.column_stack([i.ravel(), j.ravel()])[kept]
    return np.column_stack([x[cell[:, 0]], y[cell[:, 1]]]).astype(np.float64), cell.astype(np.int64)


def _centred(first: int, last: int, step: int) -> IntArray:
    count = (last - first) // step + 1
    begin = first + (last - first - (count - 1) * step) // 2
    return np.asarray(begin + step * np.arange(count))
