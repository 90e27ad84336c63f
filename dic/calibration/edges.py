"""Dots located by their edges: a blurred elliptical disc fitted to the grey values."""

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray

Single = NDArray[np.float32]

STEPS = 8
"""Gauss-Newton steps at most."""
SETTLED = 1e-5
"""A dot whose centre a step moves by less than this is done [px]; noise is some hundred times larger."""
AT_ONCE = 250_000
"""Pixels of the dots that are fitted in one go: many, so that pictures in other threads get on meanwhile."""
ROOT = float(np.sqrt(2.0 * np.pi))
"""√(2π)"""
HASTINGS = (0.3275911, 0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429)
"""Of his approximation of the error function, p and a1 to a5."""
LARGEST = 25.0
"""Dots up to this radius [px] are fitted: a larger one's centroid is known to a few mpx, and its printed
outline is no better an ellipse than that."""


def fit_discs(
    image: FloatArray, centre: FloatArray, shape: FloatArray, reach: float, noise: float
) -> tuple[FloatArray, FloatArray]:
    """Centres of dark discs and their standard deviations, all dots of a picture at once.

    With d the offset from the centre and q = √(dᵀ M d), so that q = 1 is the outline, the model is

        I = (B + g · d) (1 - D Φ(-δ / s)),     δ = (q - 1) q / |M d|                                (C.3)

    with δ the distance from the outline to first order, Φ the normal distribution and s the blur. The
    brightness, its slope, D, M, s and the centre are found by Gauss-Newton steps. The edge alone carries the
    place, so the noise of the surface around it, which a centroid takes in, does not enter.

    Parameters
    ----------
    image
        Grey values, shape [rows, columns].
    centre
        Starting centres [px], shape [n, 2].
    shape
        Starting M as (Mxx, Mxy, Myy) [1/px²], shape [n, 3].
    reach
        Half side of the window [px]; no other dot may reach into it.
    noise
        Standard deviation of the grey values.

    Returns
    -------
    centre
        Shape [n, 2]; NaN where the fit failed.
    sigma
        Standard deviation of a coordinate [px], shape [n].
    """
    found, sigma = np.full((len(centre), 2), np.nan), np.full(len(centre), np.nan)
    w = int(np.ceil(reach))
    step = max(1, AT_ONCE // (2 * w + 1) ** 2)
    for first in range(0, len(centre), step):
        rows = slice(first, first + step)
        found[rows], sigma[rows] = _fitted(image, centre[rows], shape[rows], w, noise)
    return found, sigma


def _fitted(
    image: FloatArray, centre: FloatArray, shape: FloatArray, w: int, noise: float
) -> tuple[FloatArray, FloatArray]:
    """`fit_discs` of some dots, with windows of half side `w`."""
    n, offsets = len(centre), np.arange(-w, w + 1)
    column, row = np.round(centre).astype(int).T
    inside = (column >= w) & (row >= w) & (column < image.shape[1] - w) & (row < image.shape[0] - w)
    column, row = np.where(inside, column, w), np.where(inside, row, w)
    across, down = np.tile(offsets, len(offsets)), np.repeat(offsets, len(offsets))
    values = image[row[:, None] + down, column[:, None] + across]
    xx, yy = across.astype(np.float32), down.astype(np.float32)
    top, bottom = np.percentile(values, [90.0, 10.0], axis=1)
    p = np.zeros((n, 10))  # x, y, Mxx, Mxy, Myy, s, B, gx, gy, D
    p[:, :2] = np.where(inside[:, None], centre - np.stack([column, row], axis=1), 0.0)
    p[:, 2:5], p[:, 5], p[:, 6], p[:, 9] = shape, 0.8, top, 1.0 - bottom / np.maximum(top, 1e-9)
    start = p[:, :2].copy()
    normal, last = np.tile(np.eye(10), (n, 1, 1)), np.full((n, 2), np.nan)
    rows, room = np.arange(n), np.empty((n, p.shape[1], xx.size), dtype=np.float32)
    with np.errstate(all="ignore"):  # a dot whose fit runs away becomes NaN and is left to the caller
        for _ in range(STEPS):
            J = room[: len(rows)]
            model = _model(p[rows], xx, yy, J)
            N = (J @ np.swapaxes(J, 1, 2)).astype(np.float64)
            off = (values[rows] - model).astype(np.float32)
            right = (J @ off[..., None])[..., 0].astype(np.float64)
            bad = ~(np.isfinite(N).all(axis=(1, 2)) & np.isfinite(right).all(axis=1))
            N[bad], right[bad] = np.eye(10), np.nan
            scaled, scale = _scaled(N)
            step = scale * np.linalg.solve(scaled, (scale * right)[..., None])[..., 0]
            p[rows] += step
            p[rows, 5] = np.maximum(p[rows, 5], 0.3)  # a sharper edge than a pixel's own width is noise
            normal[rows], last[rows] = N, step[:, :2]
            rows = rows[np.abs(step[:, :2]).max(axis=1) > SETTLED]
            if not len(rows):
                break
        scaled, scale = _scaled(normal)
        inverse = np.linalg.inv(scaled)
        sigma = noise * np.sqrt(
            0.5 * np.sum(np.einsum("nkk->nk", inverse)[:, :2] * scale[:, :2] ** 2, axis=1)
        )
        off = np.hypot(*(p[:, :2] - start).T)
        fine = inside & (off < 0.5) & (np.abs(last).max(axis=1) < 0.01) & np.isfinite(sigma)
    found = p[:, :2] + np.stack([column, row], axis=1)
    return np.where(fine[:, None], found, np.nan), np.where(fine, sigma, np.nan)


def _scaled(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Normal matrices with a diagonal of 1, hardly damped, shape [n, 10, 10], and their scales, [n, 10]."""
    scale = 1.0 / np.sqrt(np.einsum("nkk->nk", normal) + 1e-300)
    return normal * scale[:, :, None] * scale[:, None] + 1e-9 * np.eye(10), scale


def _model(p: FloatArray, xx: Single, yy: Single, J: Single) -> Single:
    """Grey values, Eq. (C.3), shape [n, pixels]; their derivatives go to J, shape [n, 10, pixels].

    In fp32: a rounding of a grey value is some hundred thousandth of its noise.
    """
    x0, y0, a, b, c, s, B, Bx, By, D = (p[:, k : k + 1].astype(np.float32) for k in range(10))
    dx, dy = xx - x0, yy - y0
    mx, my = a * dx + b * dy, b * dx + c * dy
    q = np.sqrt(np.maximum(dx * mx + dy * my, 1e-12))
    slope = np.maximum(np.sqrt(mx * mx + my * my), 1e-9)
    delta = (q - 1.0) * q / slope
    x = delta / s
    bell = np.exp(-0.5 * x**2)
    S = _upper(x, bell)
    light, left = B + Bx * dx + By * dy, 1.0 - D * S
    edge = light * D * bell / (ROOT * s)  # by δ
    J[:, 0], J[:, 1] = -edge * mx / slope, -edge * my / slope
    J[:, 2], J[:, 3], J[:, 4] = (edge * k / slope for k in (0.5 * dx * dx, dx * dy, 0.5 * dy * dy))
    J[:, 5] = -edge * delta / s
    J[:, 6], J[:, 7], J[:, 8], J[:, 9] = left, dx * left, dy * left, -light * S
    return light * left


def _upper(x: Single, bell: Single) -> Single:
    """Normal distribution Φ(-x) to 1e-7, given exp(-x²/2).

    Hastings' approximation (Abramowitz and Stegun, Handbook of Mathematical Functions, 7.1.26) takes a tenth
    of the time of SciPy's, which was a third of that of the fit.
    """
    t = 1.0 / (1.0 + HASTINGS[0] / np.sqrt(2.0, dtype=x.dtype) * np.abs(x))
    total = np.zeros_like(t)
    for a in HASTINGS[:0:-1]:
        total = (total + a) * t
    tail = 0.5 * total * bell
    return np.where(x > 0.0, tail, 1.0 - tail)
