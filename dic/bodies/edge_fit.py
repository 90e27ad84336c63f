"""Edge between two bodies in strips of pictures, by a maximum-likelihood fit of the rows' covariance.

The rows of a strip are parallel to the edge; each column crosses it. Each column is a sample of a Gaussian
process. The paint of each body has a covariance that ends at the edge. The optics blur the result. The mean
and the shading of each row are removed; the brightness of the bodies has no effect.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy import ndimage
from scipy.optimize import minimize
from scipy.special import ndtr

from dic.basics import BoolArray, FloatArray, IntArray
from dic.camera import Camera
from dic.surfaces.cylinder import SpecimenFrame

CELL = 0.5
"""Size of the cells of paint that are summed for a pixel [px]."""


BEYOND = 5.0
"""Width of paint beyond the strip that contributes by blur [px]."""


def paint(lag: FloatArray, length: float, shape: float) -> FloatArray:
    """Covariance of paint, the rational quadratic ``(1 + lag² / (2 shape length²))^-shape`` [-]. It is
    Gaussian for a large shape. A small shape gives the longer tail of spots of many sizes."""
    return np.asarray((1.0 + lag**2 / (2.0 * shape * length**2)) ** -shape)


def _paint_slopes(lag: FloatArray, length: float, shape: float) -> tuple[FloatArray, FloatArray]:
    """Slopes of `paint` over the logarithms of length and of shape [-]."""
    q = lag**2 / (2.0 * shape * length**2)
    value = (1.0 + q) ** -shape
    by_length = 2.0 * shape * q * value / (1.0 + q)
    return by_length, value * shape * (q / (1.0 + q) - np.log1p(q))


@dataclass(frozen=True)
class _Side:
    """The paint of one body as the pixels see it."""

    response: FloatArray
    """Contribution of each cell of paint to each pixel, shape [n_u, n_v]."""
    by_blur: FloatArray
    """Its derivative by the logarithm of the blur, shape [n_u, n_v]."""
    end: tuple[int, FloatArray] | None
    """The cell of paint in which the body ends, and the derivative of its contribution by the position of the
    end [1/px], shape [n_u]. None if the body ends beyond the strip."""


@dataclass(frozen=True)
class _Paint:
    """Covariance of the paint of one body and its derivatives, independent of the body's end."""

    size: float
    """Its standard deviation."""
    covariance: FloatArray
    """Covariance of the cells of paint, shape [n_v, n_v]."""
    by_length: FloatArray
    """Derivative by the logarithm of the length, for a standard deviation of 1, shape [n_v, n_v]."""
    by_shape: FloatArray
    """Derivative by the logarithm of the shape, likewise."""

    @classmethod
    def of(cls, n: int, size: float, length: float, shape: float) -> "_Paint":
        """The paint of `n` cells in a row."""
        lag, apart = CELL * np.arange(n, dtype=np.float64), _step_distance(n)
        lengths, shapes = _paint_slopes(lag, length, shape)
        return cls(size, size**2 * paint(lag, length, shape)[apart], lengths[apart], shapes[apart])


@dataclass(frozen=True)
class _Share:
    """Share of one body in the covariance of the rows, and its slopes, each of shape [n_rows, n_rows]."""

    covariance: FloatArray
    by_blur: FloatArray
    by_length: FloatArray
    by_shape: FloatArray
    by_end: FloatArray | None
    """None if the body ends beyond the strip."""

    @classmethod
    def of(cls, side: _Side, of: _Paint) -> "_Share":
        """Contribution of a body's paint to the pixels."""
        near, sized = side.response @ of.covariance, of.size**2 * side.response
        return cls(
            covariance=near @ side.response.T,
            by_blur=_symmetric_sum(near @ side.by_blur.T),
            by_length=sized @ of.by_length @ side.response.T,
            by_shape=sized @ of.by_shape @ side.response.T,
            by_end=None if side.end is None else _symmetric_sum(np.outer(near[:, side.end[0]], side.end[1])),
        )


def covariance(p: FloatArray, u: FloatArray, width: FloatArray, free: bool) -> FloatArray:
    """Covariance of the rows of a strip, shape [n_rows, n_rows]; parameters as for `with_slopes`."""
    return with_slopes(p, u, width, free)[0]


def with_slopes(p: FloatArray, u: FloatArray, width: FloatArray, free: bool) -> tuple[FloatArray, FloatArray]:
    """Covariance of the rows of a strip, and its slope over each parameter.

    ``p``: first the position of the edge [px]. Then seven logarithms: blur, length of the paint on the body
    and beyond [px], contrast of the body and beyond, noise [-], shape. Last the band's parameter. ``u``:
    positions of the rows [px], shape [n_rows]. ``width``: width of the band for parameter 0, and its increase
    for parameter 1 [px]. Returns: covariance, shape [n_rows, n_rows], and slopes, shape [9, n_rows, n_rows].
    """
    return next(of_bands(p, u, [width], free))


def of_bands(
    p: FloatArray, u: FloatArray, widths: Iterable[FloatArray], free: bool
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """`with_slopes` for several bands in turn. Common parts, mainly the body before the edge, are computed
    once."""
    edge, (blur, first, second_grey, contrast, second, noise, shape) = p[0], np.exp(p[1:8])
    v = np.arange(u[0] - BEYOND, u[-1] + BEYOND + CELL, CELL)
    paint_beyond = _Paint.of(v.size, second, second_grey, shape)
    body = _Share.of(_side(u, v, edge, blur, below=True), _Paint.of(v.size, contrast, first, shape))
    for width in widths:
        band = float(width[0] + (p[8] * width[1] if free else 0.0))
        beyond = _Share.of(_side(u, v, edge + band, blur, below=False), paint_beyond)
        slopes = np.zeros((9, u.size, u.size))
        C = noise**2 * np.eye(u.size)
        slopes[6] = 2.0 * C
        for share, by_length, by_size in ((body, 2, 4), (beyond, 3, 5)):
            C += share.covariance
            slopes[by_size] = 2.0 * share.covariance
            slopes[1] += share.by_blur
            slopes[by_length] = share.by_length
            slopes[7] += share.by_shape
            if share.by_end is not None:
                slopes[0] += share.by_end
                if free and share is beyond:
                    slopes[8] = width[1] * share.by_end
        yield C, slopes


@cache
def _step_distance(n: int) -> IntArray:
    """Distance of two of n places in a row, in steps, shape [n, n]."""
    places = np.arange(n)
    return np.abs(places[:, None] - places)


def _symmetric_sum(a: FloatArray) -> FloatArray:
    return np.asarray(a + a.T)


def _side(u: FloatArray, v: FloatArray, end: float, blur: float, *, below: bool) -> _Side:
    """Paint in cells about v that ends at `end`, on the side below or above it."""
    walls = np.append(v, v[-1] + CELL) - 0.5 * CELL
    cell = int(np.searchsorted(walls, end)) - 1
    inside = np.clip(walls, None, end) if below else np.clip(walls, end, None)
    z = (inside - u[:, None]) / blur
    density = np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi)
    within = 0 <= cell < v.size
    at_end = density[:, cell + 1 if below else cell] / blur if within else None
    return _Side(
        response=np.diff(ndtr(z), axis=1),
        by_blur=-np.diff(z * density, axis=1),
        end=None if at_end is None else (cell, at_end if below else -at_end),
    )


def sandwich(
    p: FloatArray,
    u: FloatArray,
    width: FloatArray,
    free: bool,
    moments: FloatArray,
    counts: FloatArray,
    bound: list[tuple[float, float]],
) -> float:
    """Standard deviation of the edge's position from the scatter of the blocks' scores: ``H^-1 Σ g gᵀ H^-1
    n/(n-1)``. H is the information; parameters at a bound are fixed."""
    used = [
        k
        for k, (low, high) in enumerate(bound)
        if (k == 0 or min(p[k] - low, high - p[k]) > 1e-3) and (k < 8 or free)
    ]
    n_blocks = counts.shape[1]
    g, H = np.zeros((n_blocks, len(used))), np.zeros((len(used), len(used)))
    for k, (C, every) in enumerate(of_bands(p, u, width, free)):
        inverse, slopes = np.linalg.inv(C), every[used]
        middle = [inverse @ D @ inverse for D in slopes]
        for b in range(n_blocks):
            off = moments[k, b] - counts[k, b] * C
            g[b] += [0.5 * float(np.sum(M * off)) for M in middle]
        total = counts[k].sum()
        H += total * np.array([[0.5 * float(np.sum(M * D)) for D in slopes] for M in middle])
    return block_sigma(g, H)


def block_sigma(g: FloatArray, H: FloatArray) -> float:
    """Standard deviation of the first parameter: ``H^-1 Σ g gᵀ H^-1 n / (n - 1)``."""
    n, turned = len(g), np.linalg.pinv(H, rcond=1e-10)
    V = turned @ (g.T @ g) @ turned * n / (n - 1.0)
    return float(np.sqrt(V[0, 0]))


HALF = 6
"""Rows of a strip on either side of the edge [px]."""
BLUR = (0.3, 1.6)
"""Smallest and largest standard deviation of the blur [px]."""
LENGTH = (0.4, 10.0)
"""Smallest and largest length of the paint's covariance [px]."""
SHAPE = (0.3, 20.0)
"""Smallest and largest shape of the paint's covariance [-]."""
NOISE = (0.03, 0.5)
"""Smallest and largest standard deviation of the noise, over the contrast [-]."""
CONTRAST = (0.01, 3.0)
"""Smallest and largest standard deviation of a body's paint, over that of the strip [-]."""
GRID = 0.5
"""Distance of the start positions that are tried [px]."""
AT_END = 0.05
"""An edge closer than this to the end of the search range counts as not found [px]."""
ROOM = 1.0
"""Smallest distance between an edge and the end of a strip [px]."""
CLEAR_OF_EDGE = 3.0
"""Distance before an edge from which rows have the body's full contrast [px]."""
BLOCK = 8.0
"""Width of the blocks of columns [px]. Blocks are wider than a speckle and are taken as independent."""
BANDS = 6
"""Largest number of groups of frames with similar bands."""
ALIKE = 0.05
"""Bands that differ by less are treated as equal [px]."""


@dataclass(frozen=True)
class EdgeFit:
    """Result of an edge fit."""

    place: float
    """Position, outward from the centre of the search [px]."""
    sigma: float
    """Its standard deviation, from the scatter of the blocks of columns [px]."""
    band: float
    """Parameter of the band's width, from 0 to 1 [-]."""
    contrast: float
    """Standard deviation of the body's paint over that of the noise [-]."""
    gap: float
    """Distance of the edge from the row where the contrast falls to half that of the body [px]. It is near
    zero if the paint reaches the edge. Otherwise it is the width of the gap in the paint."""


def strip_places(x: FloatArray, y: FloatArray, radius: float) -> FloatArray:
    """Positions on the cameras' side of a cylinder about the axis [m], shape [n_y, n_x, 3]."""
    Y, X = np.meshgrid(y, x, indexing="ij")
    return np.stack([X, Y, np.sqrt(np.maximum(radius**2 - X**2, 0.0))], axis=-1)


def in_view(camera: Camera, shape: tuple[int, ...], frame: SpecimenFrame, places: FloatArray) -> BoolArray:
    """True for positions in the test frame that lie in the picture, a pixel or more from its border. Shape
    [n_y, n_x]."""
    at = camera.project(frame.in_rig(places.reshape(-1, 3))).reshape(*places.shape[:2], 2)
    return np.asarray(np.all((at >= 1.0) & (at <= np.array(shape[::-1]) - 2.0), axis=2))


def sampled(camera: Camera, picture: FloatArray, frame: SpecimenFrame, places: FloatArray) -> FloatArray:
    """Grey values of a picture at positions in the test frame, all within the picture, shape [n_y, n_x]."""
    at = camera.project(frame.in_rig(places.reshape(-1, 3))).T[::-1]
    return np.asarray(ndimage.map_coordinates(picture, at, order=3).reshape(places.shape[:2]))


def fit_edge(
    strips: FloatArray, u: FloatArray, bands: FloatArray, *, reach: float = 2.0, sure: bool = False
) -> EdgeFit | None:
    """Find an edge in strips.

    ``strips``: grey values, shape [n_frames, n_rows, n_columns]. ``u``: positions of the rows, outward from
    the body, relative to the centre of the search [px], shape [n_rows]. ``bands``: width of the band in every
    frame for a parameter p from 0 to 1, as ``first + p second`` [px], shape [2, n_frames]. ``reach``: largest
    distance of the edge from the centre [px]. ``sure``: True if other evidence shows an edge within `reach`.
    Then no position outside `reach` is tried. If all frames show the same paint, its random pattern may
    resemble an edge. Returns: None if the most likely edge of the strip is outside `reach` or at an end of
    it.
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
    moments = np.zeros((n, n_blocks, u.size, u.size))  # sums of squares, divided by their number below
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
            quotient = inverse @ whole[k]
            total += share[k] * (np.sum(np.log(np.diag(L))) + 0.5 * np.trace(quotient))
            slope += 0.5 * share[k] * slopes.reshape(p.size, -1) @ (inverse - quotient @ inverse).ravel()
        return float(total), slope

    logs = [np.log(limits) for limits in (BLUR, LENGTH, LENGTH, CONTRAST, CONTRAST, NOISE, SHAPE)]
    wide = (-reach, reach) if sure else (float(u[0]) + ROOM, float(u[-1]) - ROOM)
    bound = [wide, *((low, high) for low, high in logs), (0.0, 1.0)]
    begin = np.log([0.7, 1.8, 1.8, 1.0, 0.5, 0.05, 2.0])
    tried = np.arange(wide[0] + AT_END, wide[1], GRID)
    likely = float(tried[int(np.argmin([cost(np.array([at, *begin, 0.5]))[0] for at in tried]))])
    # A start at the centre would end in the same place if the best trial is next to it.
    fits = [
        minimize(
            cost,
            np.array([at, *begin, 0.5]),
            jac=True,
            method="L-BFGS-B",
            bounds=bound,
            options={"maxiter": 60},
        )
        for at in ({likely} if abs(likely) <= GRID else {likely, 0.0})
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
    """Distance from an edge to the last row that has half the body's contrast [px]."""
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
    """Group number of every frame, by the width of its band; shape [n_frames]."""
    typical = widths[0] + 0.5 * widths[1]
    low, high = float(typical.min()), float(typical.max())
    if high - low < ALIKE:
        return np.zeros(typical.size, dtype=np.int64)
    groups = np.minimum(((typical - low) / (high - low) * BANDS).astype(np.int64), BANDS - 1)
    return np.asarray(np.unique(groups, return_inverse=True)[1])


def _blocks(n_columns: int) -> IntArray:
    """Block number of every column, shape [n_columns]."""
    n = max(int(n_columns / BLOCK), 2)
    return np.minimum((np.arange(n_columns) * n) // n_columns, n - 1)
