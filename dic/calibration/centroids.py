"""Dots located by their centroid: darkness against a plane through the brightness around them."""

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.robust import MAD

WINDOW, RING = 1.35, 1.85
"""The centroid is taken over this many radii of the dot, the brightness around it out to the second."""
MARGIN = 1.5
"""Further out by this much, for the blur of the lens [px]."""
AT_ONCE = 60_000
"""Pixels looked at in one go: many, so that pictures in other threads get on meanwhile, but so few that
memory is not asked of the system for each array anew."""
RING_PIXELS = 1000
"""Pixels around a dot that are enough for a plane; of more, every so many are taken."""


def centroids(image: FloatArray, ellipses: FloatArray, noise: float) -> FloatArray:
    """Centroids of outlined dots, `dic.calibration.dots.find_dots` says of what.

    Parameters
    ----------
    image
        Grey values, dots dark, shape [rows, columns].
    ellipses
        Outlines: centre x, y, diameters along both axes [px] and angle of the first [degrees], shape [n, 5].
    noise
        Standard deviation of the grey values.

    Returns
    -------
    array
        x, y and their standard deviation [px], mass [px²] and darkness [-] of each dot, shape [n, 5]; NaN
        where the surroundings of a dot cannot be told from it.
    """
    result = np.full((len(ellipses), 5), np.nan)
    reach = np.ceil(0.5 * ellipses[:, 2:4].max(axis=1, initial=0.0) * RING + 2.0 * MARGIN).astype(int) + 2
    order = np.argsort(reach, kind="stable")
    first = 0
    while first < len(order):
        # dots of like size together: their windows are those of the largest
        size = np.cumsum(np.ones(len(order) - first, dtype=int)) * (2 * reach[order[first:]] + 1) ** 2
        rows = order[first : first + max(1, int(np.searchsorted(size, AT_ONCE, side="right")))]
        result[rows] = _together(image, ellipses[rows], int(reach[rows].max()), noise)
        first += len(rows)
    return result


def _together(image: FloatArray, ellipses: FloatArray, reach: int, noise: float) -> FloatArray:
    """`centroids` of dots with windows of one size, shape [n, 5]."""
    result = np.full((len(ellipses), 5), np.nan)
    rows, x0, y0 = np.arange(len(ellipses)), ellipses[:, 0].copy(), ellipses[:, 1].copy()
    for last in (
        False,
        True,
    ):  # a second time about the centre found, so that the window is centred on the dot
        part = _Window(image, x0[rows], y0[rows], ellipses[rows, 2:], reach)
        plane, fine = _plane(part)
        around = plane[:, :1] + plane[:, 1:2] * part.inner_x + plane[:, 2:] * part.inner_y
        least = np.where(part.inner, around, np.inf).min(axis=1, initial=np.inf)
        fine &= least > 4.0 * noise
        around = np.where(part.inner & fine[:, None], around, 1.0)
        w = np.where(part.inner & fine[:, None], 1.0 - part.inner_grey / around, 0.0)
        mass = w.sum(axis=1)
        major, minor = ellipses[rows, 2], ellipses[rows, 3]
        fine &= mass > 0.15 * 0.25 * np.pi * major * minor
        mass = np.where(fine, mass, 1.0)
        shift = np.stack([np.sum(w * part.inner_x, axis=1), np.sum(w * part.inner_y, axis=1)]) / mass
        fine &= np.hypot(*shift) <= 0.25 * minor
        x0[rows] += shift[0]
        y0[rows] += shift[1]
        if not last:
            rows = rows[fine]
    spread = (part.inner_x - shift[0][:, None]) ** 2 + (part.inner_y - shift[1][:, None]) ** 2
    variance = np.sum(np.where(part.inner, spread * (noise / around) ** 2, 0.0), axis=1)
    sigma = np.maximum(np.sqrt(0.5 * variance) / mass, 1e-4)
    found = np.stack([x0[rows], y0[rows], sigma, mass, _quantile(w, part.inner, 0.9)], axis=1)
    result[rows[fine]] = found[fine]
    return result


class _Window:
    """Pixels in and around n dots, listed: offsets from the centre [px], grey values, which of them count.

    Parameters
    ----------
    image
        Grey values, shape [rows, columns].
    x0, y0
        Centres of the windows [px], shape [n].
    ellipses
        Diameters [px] and angle [degrees], shape [n, 3].
    reach
        Half side of the windows [px].
    """

    def __init__(
        self, image: FloatArray, x0: FloatArray, y0: FloatArray, ellipses: FloatArray, reach: int
    ) -> None:
        rows, columns = image.shape
        offsets = np.arange(-reach, reach + 1)
        along, down = np.tile(offsets, len(offsets)), np.repeat(offsets, len(offsets))
        x, y = np.round(x0).astype(int), np.round(y0).astype(int)
        dx, dy = along + (x - x0)[:, None], down + (y - y0)[:, None]
        major, minor, angle = (ellipses[:, k, None] for k in range(3))
        c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
        u, v = c * dx + s * dy, c * dy - s * dx  # along the ellipse's axes
        u *= u
        v *= v
        wide, ring = (
            u * (1.0 / (0.5 * major * by + margin) ** 2) + v * (1.0 / (0.5 * minor * by + margin) ** 2) <= 1.0
            for by, margin in ((WINDOW, MARGIN), (RING, 2.0 * MARGIN))
        )
        ring &= ~wide
        far = (x < reach) | (y < reach) | (x >= columns - reach) | (y >= rows - reach)
        for k in np.flatnonzero(far):  # a window over the picture's edge
            i, j = x[k] + along, y[k] + down
            inside = (i >= 0) & (j >= 0) & (i < columns) & (j < rows)
            wide[k] &= inside
            ring[k] &= inside

        flat, shift = image.reshape(-1), down * columns + along

        def taken(index: IntArray, there: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            place = np.where(there, (y * columns + x)[:, None] + shift[index], 0)
            return along[index] + (x - x0)[:, None], down[index] + (y - y0)[:, None], flat[place]

        index, self.inner = _listed(wide)
        self.inner_x, self.inner_y, self.inner_grey = taken(index, self.inner)
        every = np.maximum(1, ring.sum(axis=1) // RING_PIXELS)
        index, self.ring = _listed(ring, every)
        self.ring_x, self.ring_y, self.ring_grey = taken(index, self.ring)


def _listed(mask: BoolArray, every: IntArray | None = None) -> tuple[IntArray, BoolArray]:
    """Columns where each row of a mask holds, shape [n, m], and which of them are not mere filling.

    Of row i only every ``every[i]``-th is listed.
    """
    n, flat = len(mask), np.flatnonzero(mask)
    count = mask.sum(axis=1)
    row = np.repeat(np.arange(n), count)
    column = flat - mask.shape[1] * row
    place = np.arange(len(flat)) - np.repeat(np.cumsum(count) - count, count)
    if every is not None and np.any(every > 1):
        kept = place % every[row] == 0
        row, column, place = row[kept], column[kept], place[kept] // every[row[kept]]
        count = np.bincount(row, minlength=n)
    index = np.zeros((n, max(int(count.max(initial=0)), 1)), dtype=np.int64)
    index[row, place] = column
    return index, np.arange(index.shape[1]) < count[:, None]


def _quantile(values: FloatArray, there: BoolArray, share: float) -> FloatArray:
    """Quantile of each row's values that are there, between neighbours linear, shape [n]; NaN of none."""
    ordered = np.sort(np.where(there, values, np.inf), axis=1)
    count = there.sum(axis=1)
    place = share * np.maximum(count - 1, 0)
    low = np.floor(place).astype(int)
    high = np.minimum(low + 1, np.maximum(count - 1, 0))
    rows = np.arange(len(values))
    a, b = ordered[rows, low], ordered[rows, high]
    found = a + (place - low) * np.where(count > 0, b - a, 0.0)
    return np.where(count > 0, found, np.nan)


def _plane(part: _Window) -> tuple[FloatArray, BoolArray]:
    """Brightness a + b x + c y around the dots without the pixels that belong to something else, shape
    [n, 3], and where there are enough of them."""
    basis = np.stack([np.ones_like(part.ring_x), part.ring_x, part.ring_y], axis=1)
    kept, fine = part.ring, np.ones(len(basis), dtype=bool)
    for _ in range(3):
        fine = fine & (kept.sum(axis=1) >= 12)
        weighted = basis * (kept & fine[:, None])[:, None]
        normal = weighted @ np.swapaxes(basis, 1, 2)
        normal[~fine] = np.eye(3)
        normal += 1e-12 * normal[:, :1, :1] * np.eye(3)  # pixels on one line fix no plane
        solution = np.linalg.solve(normal, weighted @ part.ring_grey[..., None])
        off = np.abs(part.ring_grey - (np.swapaxes(solution, 1, 2) @ basis)[:, 0])
        middle = np.where(fine, _quantile(off, kept, 0.5), 0.0)
        limit = 4.0 * MAD * middle + 1e-9 * np.abs(solution[:, 0, 0])
        kept = part.ring & (off <= limit[:, None])
    return solution[..., 0], fine
