"""Where a speckled side ends in a picture, to a fraction of a pixel."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtr

from dic.arrays import FloatArray

FARTHEST = 2.0
"""How far from where it was declared an edge is looked for [px]."""
MODEL = 0.1
"""Standard deviation of an edge for speckle that is no quadratic and a band that hides it [px]."""
ROWS, COLUMNS = 5, 22
"""Half height and half width of the window [px]."""
WIDEST_BAND = 1.5
"""Widest strip between the side and what lies behind it, as a platen's face seen at a glance [px]."""


@dataclass(frozen=True)
class Edge:
    """An edge that was found."""

    offset: float
    """From the declared place toward the inside of the body [px]."""
    sigma: float
    """Its standard deviation: residual of the fit, and `MODEL` for what the model leaves out [px]."""


def find_edge(picture: FloatArray, place: tuple[float, float], inward: tuple[int, int]) -> Edge | None:
    """Refine the place of an edge between a speckled side and something even.

    Columns of pixels across the edge are fitted together: each has its own grey values inside, a quadratic of
    the distance from the edge; outside all share one, and so does a narrow band between. Edge and band are
    blurred alike, and the edge may be tilted. What a column shows inside differs from column to column, which
    tells the edge from the band.

    Parameters
    ----------
    picture
        Grey values, best the mean of static pictures, shape [rows, columns].
    place
        Where the edge is to a pixel or two (x, y) [px].
    inward
        Direction from it into the body, along a row or a column of the picture: (0, -1) is up.

    Returns
    -------
    Edge or None
        None if there is no such edge within two pixels, or the picture ends there.
    """
    window, ahead, across = _window(picture, place, inward)
    if window is None:
        return None

    def residual(p: FloatArray) -> FloatArray:
        edge, tilt, band, blur = p
        u = ahead[:, None] - (edge + tilt * across)[None]
        inside, rest = ndtr(-u / blur), ndtr((u - band) / blur)
        return _left_over(window, u, inside, 1.0 - inside - rest, rest)

    low, high = [-FARTHEST, -0.1, 0.0, 0.3], [FARTHEST, 0.1, WIDEST_BAND, 1.5]
    starts = [(edge, 0.0, band, 0.6) for edge in (-0.5, 0.5) for band in (0.3, 0.8)]
    fits = [
        least_squares(residual, start, bounds=(low, high), x_scale=(0.1, 0.01, 0.1, 0.1)) for start in starts
    ]
    best = min(fits, key=lambda fit: fit.cost)
    freedom = window.size - 3 * window.shape[1] - 6
    variance = 2.0 * best.cost / freedom * np.linalg.pinv(best.jac.T @ best.jac)[0, 0]
    contrast = float(np.std(window[: ROWS - 1] - np.median(window[-2:])))
    if abs(best.x[0]) > FARTHEST - 0.05 or np.sqrt(2.0 * best.cost / window.size) > 0.3 * contrast:
        return None
    # Rows count outward; inward is the other way.
    return Edge(offset=-float(best.x[0]), sigma=float(np.hypot(np.sqrt(variance), MODEL)))


def _left_over(
    window: FloatArray, u: FloatArray, inside: FloatArray, band: FloatArray, rest: FloatArray
) -> FloatArray:
    """What the best grey values leave over: columns' own first, then the two that all share."""
    depth = np.clip(u, -8.0, 0.0)
    own = np.stack([inside, inside * depth, inside * depth**2], axis=-1).swapaxes(0, 1)  # column, row, term
    shared = np.stack([band, rest], axis=-1).swapaxes(0, 1)
    grey = window.T[..., None]
    q, _ = np.linalg.qr(own)
    out = np.concatenate([shared, grey], axis=-1)
    out = out - q @ (q.swapaxes(1, 2) @ out)
    terms, left = out[..., :2].reshape(-1, 2), out[..., 2].reshape(-1)
    return np.asarray(left - terms @ np.linalg.lstsq(terms, left, rcond=None)[0])


def _window(
    picture: FloatArray, place: tuple[float, float], inward: tuple[int, int]
) -> tuple[FloatArray | None, FloatArray, FloatArray]:
    """Grey values with the body above, and their distances outward and across from the place [px]."""
    x, y = place
    turned = np.asarray(picture, dtype=np.float64)
    if inward[0]:
        turned, (x, y) = turned.T, (y, x)
    if inward[0] + inward[1] > 0:
        turned, y = turned[::-1], turned.shape[0] - 1 - y
    row, column = round(y), round(x)
    rows = np.arange(row - ROWS, min(row + ROWS + 1, turned.shape[0]))
    columns = np.arange(max(column - COLUMNS, 0), min(column + COLUMNS + 1, turned.shape[1]))
    if rows.size < 2 * ROWS or rows[0] < 0 or columns.size < COLUMNS:
        return None, np.empty(0), np.empty(0)
    return turned[np.ix_(rows, columns)], rows - y, columns - x
