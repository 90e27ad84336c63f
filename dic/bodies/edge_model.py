"""Covariance of the rows of a strip across an edge, and what the scatter of its columns says of the edge."""

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
    edge, (blur, first, other, contrast, second, noise, shape) = p[0], np.exp(p[1:8])
    band = float(width[0] + (p[8] * width[1] if free else 0.0))
    v = np.arange(u[0] - BEYOND, u[-1] + BEYOND + CELL, CELL)
    lag, apart = CELL * np.arange(v.size, dtype=np.float64), _apart(v.size)
    slopes = np.zeros((9, u.size, u.size))
    C = noise**2 * np.eye(u.size)
    slopes[6] = 2.0 * C
    body, beyond = _side(u, v, edge, blur, below=True), _side(u, v, edge + band, blur, below=False)
    for side, length, size, by_length, by_size in (
        (body, first, contrast, 2, 4),
        (beyond, other, second, 3, 5),
    ):
        K = size**2 * paint(lag, length, shape)[apart]
        near = side.seen @ K
        part = near @ side.seen.T
        C += part
        slopes[by_size] = 2.0 * part
        slopes[1] += _both(near @ side.by_blur.T)
        lengths, shapes = paint_slopes(lag, length, shape)
        slopes[by_length] = size**2 * side.seen @ lengths[apart] @ side.seen.T
        slopes[7] += size**2 * side.seen @ shapes[apart] @ side.seen.T
        if side.end is not None:
            cell, by_end = side.end
            moved = _both(np.outer(near[:, cell], by_end))
            slopes[0] += moved
            if free and side is beyond:
                slopes[8] = width[1] * moved
    return C, slopes


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
    for k in range(len(width)):
        C, every = with_slopes(p, u, width[k], free)
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
