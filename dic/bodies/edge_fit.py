"""Edge between two bodies in strips of pictures, by maximum likelihood of how rows of pixels correlate.

Speckles are wider than a pixel, so that rows of one body correlate, and rows of two bodies do not. Rows of a
strip lie across the edge, its columns along it. A column's grey values are taken for a draw of a Gaussian
process: each body's paint has a covariance of its own, it ends at the edge, and the optics blur what is
left. Only how columns differ from each other counts: each row's mean and its shading are taken out, so that
neither body's brightness matters, nor that of the platen's face which may lie between them as a band.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.optimize import minimize

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.bodies.edge_model import of_bands, sandwich
from dic.camera import Camera
from dic.surfaces import SpecimenFrame

HALF = 6
"""Rows of a strip on either side of the edge [px]."""
BLUR = (0.3, 1.6)
"""Least and largest standard deviation of the blur [px]."""
LENGTH = (0.4, 10.0)
"""Least and largest length of the paint's covariance [px]."""
SHAPE = (0.3, 20.0)
"""Least and largest shape of the paint's covariance [-]."""
NOISE = (0.03, 0.5)
"""Least and largest standard deviation of what is no paint, over the contrast [-]."""
CONTRAST = (0.01, 3.0)
"""Least and largest standard deviation of a body's paint, over that of the strip [-]."""
GRID = 0.5
"""Distance of the places that are tried [px]."""
AT_END = 0.05
"""An edge so near to the end of the search was not found [px]."""
ROOM = 1.0
"""Rows between an edge that is looked for and the end of a strip [px]."""
CLEAR_OF_EDGE = 3.0
"""Rows so far before an edge have the contrast of the body [px]."""
BLOCK = 8.0
"""Width of the blocks of columns that count as independent [px]: more than a speckle."""
BANDS = 6
"""Groups of frames with like bands that are told apart."""
ALIKE = 0.05
"""Bands that differ by less are alike [px]."""


@dataclass(frozen=True)
class EdgeFit:
    """An edge that was found."""

    place: float
    """Place, outward from where it was looked for [px]."""
    sigma: float
    """Its standard deviation, from how the blocks of columns scatter [px]."""
    band: float
    """Parameter of the band's width, from 0 to 1 [-]."""
    contrast: float
    """Standard deviation of the body's paint over that of what is no paint [-]."""
    gap: float
    """Distance from where the rows' contrast falls to half that of the body to the place [px]: about none
    where the paint reaches to the edge, as wide as the gap where it does not."""


def strip_places(x: FloatArray, y: FloatArray, radius: float) -> FloatArray:
    """Places on the cameras' side of a cylinder about the axis [m], shape [n_y, n_x, 3]."""
    Y, X = np.meshgrid(y, x, indexing="ij")
    return np.stack([X, Y, np.sqrt(np.maximum(radius**2 - X**2, 0.0))], axis=-1)


def in_view(camera: Camera, shape: tuple[int, ...], frame: SpecimenFrame, places: FloatArray) -> BoolArray:
    """Places of the test frame that lie in the picture, a pixel clear of its border, shape [n_y, n_x]."""
    at = camera.project(frame.in_rig(places.reshape(-1, 3))).reshape(*places.shape[:2], 2)
    return np.asarray(np.all((at >= 1.0) & (at <= np.array(shape[::-1]) - 2.0), axis=2))


def sampled(camera: Camera, picture: FloatArray, frame: SpecimenFrame, places: FloatArray) -> FloatArray:
    """Grey values of a picture at places of the test frame that lie in it, shape [n_y, n_x]."""
    at = camera.project(frame.in_rig(places.reshape(-1, 3))).T[::-1]
    return np.asarray(ndimage.map_coordinates(picture, at, order=3).reshape(places.shape[:2]))


def fit_edge(
    strips: FloatArray,
    u: FloatArray,
    bands: FloatArray,
    *,
    reach: float = 2.0,
    sure: bool = False,
) -> EdgeFit | None:
    """Find an edge in strips.

    Parameters
    ----------
    strips
        Grey values, shape [n_frames, n_rows, n_columns].
    u
        Places of the rows, outward from the body, from where the edge is looked for [px], shape [n_rows].
    bands
        Width of the band in every frame for a parameter p from 0 to 1, as ``first + p second`` [px], shape
        [2, n_frames].
    reach
        Largest distance of the edge from there [px].
    sure
        True if other evidence says that there is an edge within `reach`: no other place is tried then. Where
        frames repeat the body's paint, its own chance may look like an edge.

    Returns
    -------
    EdgeFit or None
        None if the most likely edge of the strip is not within `reach`, or at an end of it.
    """
    flat = without_shading(strips)
    size = float(np.sqrt(np.mean(flat**2)))
    if not size > 0.0:
        return None
    flat = flat / size
    widths = np.asarray(bands, dtype=np.float64)
    group = _groups(widths)
    free = bool(np.any(np.abs(widths[1]) > ALIKE))
    columns = _blocks(strips.shape[2])
    n = int(group.max()) + 1
    width = np.stack([widths[:, group == k].mean(axis=1) for k in range(n)])
    n_blocks = int(columns.max()) + 1
    moments = np.zeros((n, n_blocks, u.size, u.size))  # sums of squares, not yet over their number
    for k in range(n):
        for b in range(n_blocks):
            part = flat[group == k][:, :, columns == b]
            moments[k, b] = np.einsum("frc,fsc->rs", part, part)
    counts = np.array(
        [[np.sum(group == k) * np.sum(columns == b) for b in range(columns.max() + 1)] for k in range(n)],
        dtype=np.float64,
    )
    whole = moments.sum(axis=1) / counts.sum(axis=1)[:, None, None]
    share = counts.sum(axis=1) / counts.sum()

    def cost(p: FloatArray) -> tuple[float, FloatArray]:
        total, slope = 0.0, np.zeros(p.size)
        for k, (C, slopes) in enumerate(of_bands(p, u, width, free)):
            L = np.linalg.cholesky(C)
            inverse = np.linalg.inv(C)
            left = inverse @ whole[k]
            total += share[k] * (np.sum(np.log(np.diag(L))) + 0.5 * np.trace(left))
            slope += 0.5 * share[k] * np.einsum("rs,jrs->j", inverse - left @ inverse, slopes)
        return float(total), slope

    logs = [np.log(limits) for limits in (BLUR, LENGTH, LENGTH, CONTRAST, CONTRAST, NOISE, SHAPE)]
    wide = (-reach, reach) if sure else (float(u[0]) + ROOM, float(u[-1]) - ROOM)
    bound = [wide, *((low, high) for low, high in logs), (0.0, 1.0)]
    begin = np.log([0.7, 1.8, 1.8, 1.0, 0.5, 0.05, 2.0])
    tried = np.arange(wide[0] + AT_END, wide[1], GRID)
    likely = tried[int(np.argmin([cost(np.array([at, *begin, 0.5]))[0] for at in tried]))]
    fits = [
        minimize(
            cost,
            np.array([at, *begin, 0.5]),
            jac=True,
            method="L-BFGS-B",
            bounds=bound,
            options={"maxiter": 60},
        )
        for at in {0.0, float(likely)}
    ]
    best = min(fits, key=lambda fit: fit.fun)
    if abs(best.x[0]) > reach - AT_END:
        return None
    sigma = sandwich(best.x, u, width, free, moments, counts, bound)
    return EdgeFit(
        place=float(best.x[0]),
        sigma=sigma,
        band=float(best.x[8]) if free else 0.0,
        contrast=float(np.exp(best.x[4] - best.x[6])),
        gap=gap_before(np.sqrt(np.mean(flat**2, axis=(0, 2))), u, float(best.x[0])),
    )


def gap_before(spread: FloatArray, u: FloatArray, place: float) -> float:
    """Distance from the last row of the body with half its contrast to an edge [px].

    Parameters
    ----------
    spread
        Standard deviation of every row, those of the body first, shape [n_rows].
    u
        Places of the rows [px], shape [n_rows].
    place
        The edge [px].
    """
    body = spread[u <= max(place - CLEAR_OF_EDGE, float(u[0]))]
    half = 0.5 * float(np.median(body))
    below = np.flatnonzero((spread < half) & (u > u[body.size - 1]))
    if not below.size:
        return 0.0
    k = int(below[0])
    last = float(u[k]) - float((half - spread[k]) / (spread[k - 1] - spread[k])) * float(u[k] - u[k - 1])
    return max(place - last, 0.0)


def without_shading(strips: FloatArray) -> FloatArray:
    """Strips without each row's mean, slope and curvature along the edge."""
    x = np.linspace(-1.0, 1.0, strips.shape[2])
    q, _ = np.linalg.qr(np.stack([np.ones_like(x), x, x**2], axis=1))
    return np.asarray(strips - (strips @ q) @ q.T)


def _groups(widths: FloatArray) -> IntArray:
    """Group of every frame, by the width of its band; shape [n_frames]."""
    typical = widths[0] + 0.5 * widths[1]
    low, high = float(typical.min()), float(typical.max())
    if high - low < ALIKE:
        return np.zeros(typical.size, dtype=np.int64)
    found = np.minimum(((typical - low) / (high - low) * BANDS).astype(np.int64), BANDS - 1)
    return np.asarray(np.unique(found, return_inverse=True)[1])


def _blocks(n_columns: int) -> IntArray:
    """Block of every column, shape [n_columns]."""
    n = max(int(n_columns / BLOCK), 2)
    return np.minimum((np.arange(n_columns) * n) // n_columns, n - 1)
