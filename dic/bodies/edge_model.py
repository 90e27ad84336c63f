"""Covariance of the rows of a strip across an edge, and what the scatter of its columns says of the edge."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import ndtr

from dic.arrays import FloatArray, IntArray

CELL = 0.5
"""Distance of the places of paint that a pixel is summed over [px]."""


BEYOND = 5.0
"""Paint beyond the strip that the blur brings into it [px]."""


def paint(lag: FloatArray, length: float, shape: float) -> FloatArray:
    """Covariance of paint, the rational quadratic ``(1 + lag² / (2 shape length²))^-shape``: Gaussian for a
    large shape, with the longer tail of spots of many sizes for a small one [-]."""
    return np.asarray((1.0 + lag**2 / (2.0 * shape * length**2)) ** -shape)


def paint_slopes(lag: FloatArray, length: float, shape: float) -> tuple[FloatArray, FloatArray]:
    """Slopes of `paint` over the logarithms of length and of shape [-]."""
    q = lag**2 / (2.0 * shape * length**2)
    value = (1.0 + q) ** -shape
    by_length = 2.0 * shape * q * value / (1.0 + q)
    return by_length, value * shape * (q / (1.0 + q) - np.log1p(q))


@dataclass(frozen=True)
class _Side:
    """The paint of one body as the pixels see it."""

    seen: FloatArray
    """What each place of paint gives each pixel, shape [n_u, n_v]."""
    by_blur: FloatArray
    """Its slope over the logarithm of the blur, shape [n_u, n_v]."""
    end: tuple[int, FloatArray] | None
    """The place of paint that the body ends in, and the slope of what it gives over that end [1/px], shape
    [n_u]; None if the body ends beyond the strip."""


@dataclass(frozen=True)
class _Paint:
    """Covariance of the paint of one body and its slopes, wherever the body ends."""

    size: float
    """Its standard deviation."""
    covariance: FloatArray
    """Of the places of paint, shape [n_v, n_v]."""
    by_length: FloatArray
    """Slope over the logarithm of the length, for a standard deviation of 1, shape [n_v, n_v]."""
    by_shape: FloatArray
    """The same over that of the shape."""

    @classmethod
    def of(cls, n: int, size: float, length: float, shape: float) -> "_Paint":
        """The paint at `n` places in a row."""
        lag, apart = CELL * np.arange(n, dtype=np.float64), _apart(n)
        lengths, shapes = paint_slopes(lag, length, shape)
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
        """What a body's paint gives the pixels."""
        near, sized = side.seen @ of.covariance, of.size**2 * side.seen
        return cls(
            covariance=near @ side.seen.T,
            by_blur=_both(near @ side.by_blur.T),
            by_length=sized @ of.by_length @ side.seen.T,
            by_shape=sized @ of.by_shape @ side.seen.T,
            by_end=None if side.end is None else _both(np.outer(near[:, side.end[0]], side.end[1])),
        )


def covariance(p: FloatArray, u: FloatArray, width: FloatArray, free: bool) -> FloatArray:
    """Covariance of the rows of a strip, shape [n_rows, n_rows]; parameters as for `with_slopes`."""
    return with_slopes(p, u, width, free)[0]


def with_slopes(p: FloatArray, u: FloatArray, width: FloatArray, free: bool) -> tuple[FloatArray, FloatArray]:
    """Covariance of the rows of a strip, and its slope over each parameter.

    Parameters
    ----------
    p
        Place of the edge [px]; logarithms of blur, of the lengths of the paint on the body and beyond [px],
        of the contrasts of body and beyond and of the noise [-], of the shape; the band's parameter.
    u
        Places of the rows [px], shape [n_rows].
    width
        Band for parameter 0, and what parameter 1 adds [px].
    free
        Whether the parameter counts.

    Returns
    -------
    tuple of NDArray
        Covariance, shape [n_rows, n_rows], and slopes, shape [9, n_rows, n_rows].
    """
    return next(of_bands(p, u, [width], free))


def of_bands(
    p: FloatArray, u: FloatArray, widths: Iterable[FloatArray], free: bool
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """`with_slopes` of several bands in turn: what is alike for all of them, above all the body before the
    edge, is worked out once."""
    edge, (blur, first, other, contrast, second, noise, shape) = p[0], np.exp(p[1:8])
    v = np.arange(u[0] - BEYOND, u[-1] + BEYOND + CELL, CELL)
    paint_beyond = _Paint.of(v.size, second, other, shape)
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
def _apart(n: int) -> IntArray:
    """Distance of two of n places in a row, in steps, shape [n, n]."""
    places = np.arange(n)
    return np.abs(places[:, None] - places)


def _both(a: FloatArray) -> FloatArray:
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
        seen=np.diff(ndtr(z), axis=1),
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
    """Standard deviation of the place from the scatter of the blocks' scores: ``H^-1 Σ g gᵀ H^-1 n/(n-1)``
    with the information H; parameters at a bound are held."""
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
    """Standard deviation of the first parameter: ``H^-1 Σ g gᵀ H^-1 n / (n - 1)``.

    Parameters
    ----------
    g
        Scores of the blocks, shape [n, n_parameters].
    H
        Their information, shape [n_parameters, n_parameters].
    """
    n, turned = len(g), np.linalg.pinv(H, rcond=1e-10)
    V = turned @ (g.T @ g) @ turned * n / (n - 1.0)
    return float(np.sqrt(V[0, 0]))
