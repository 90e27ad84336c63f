"""How far the outline on the centre line departs from the surface beside its strip.

A body of revolution has one radius at one height. A highlight lies on the side that faces the lamp and the
cameras, which is the middle of the strip; it moves the match of a subset that it brightens in part by tenths
of a pixel, and each camera sees it at another place of the surface. Its residual is no larger than that of
compressed speckles elsewhere. But the surface beside it, where it is not, has another radius.
"""

import numpy as np
from numpy.typing import ArrayLike

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.surfaces.outline import rows_of
from dic.surfaces.surface_history import CentrePoints, SurfaceHistory

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
