"""Dots located by their edges: a blurred elliptical disc fitted to the grey values."""

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

FloatArray = NDArray[np.float64]

STEPS = 8
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
    n, w = len(centre), int(np.ceil(reach))
    offsets = np.arange(-w, w + 1)
    column, row = np.round(centre).astype(int).T
    inside = (column >= w) & (row >= w) & (column < image.shape[1] - w) & (row < image.shape[0] - w)
    column, row = np.where(inside, column, w), np.where(inside, row, w)
    xx, yy = np.tile(offsets, len(offsets)).astype(np.float64), np.repeat(offsets, len(offsets)).astype(float)
    values = image[row[:, None] + yy.astype(int), column[:, None] + xx.astype(int)]
    top, bottom = np.percentile(values, [90.0, 10.0], axis=1)
    p = np.zeros((n, 10))  # x, y, Mxx, Mxy, Myy, s, B, gx, gy, D
    p[:, :2] = np.where(inside[:, None], centre - np.stack([column, row], axis=1), 0.0)
    p[:, 2:5], p[:, 5], p[:, 6], p[:, 9] = shape, 0.8, top, 1.0 - bottom / np.maximum(top, 1e-9)
    start = p[:, :2].copy()
    with np.errstate(all="ignore"):  # a dot whose fit runs away becomes NaN and is left to the caller
        for _ in range(STEPS):
            model, J = _model(p, xx, yy)
            normal = np.einsum("nkp,nlp->nkl", J, J)
            right = np.einsum("nkp,np->nk", J, values - model)
            bad = ~(np.isfinite(normal).all(axis=(1, 2)) & np.isfinite(right).all(axis=1))
            normal[bad], right[bad] = np.eye(10), np.nan
            scale = 1.0 / np.sqrt(np.einsum("nkk->nk", normal) + 1e-300)
            scaled = normal * scale[:, :, None] * scale[:, None] + 1e-9 * np.eye(10)
            step = scale * np.linalg.solve(scaled, (scale * right)[..., None])[..., 0]
            p = p + step
            p[:, 5] = np.maximum(p[:, 5], 0.3)  # a sharper edge than a pixel's own width is noise
        inverse = np.linalg.inv(np.where(np.isfinite(scaled), scaled, np.eye(10)))
        sigma = noise * np.sqrt(
            0.5 * np.sum(np.einsum("nkk->nk", inverse)[:, :2] * scale[:, :2] ** 2, axis=1)
        )
        off = np.hypot(*(p[:, :2] - start).T)
        fine = inside & (off < 0.5) & (np.abs(step[:, :2]).max(axis=1) < 0.01) & np.isfinite(sigma)
    found = p[:, :2] + np.stack([column, row], axis=1)
    return np.where(fine[:, None], found, np.nan), np.where(fine, sigma, np.nan)


def _model(p: FloatArray, xx: FloatArray, yy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Grey values, Eq. (C.3), shape [n, pixels], and their derivatives, shape [n, 10, pixels]."""
    x0, y0, a, b, c, s, B, Bx, By, D = (p[:, k : k + 1] for k in range(10))
    dx, dy = xx - x0, yy - y0
    mx, my = a * dx + b * dy, b * dx + c * dy
    q = np.sqrt(np.maximum(dx * mx + dy * my, 1e-12))
    slope = np.maximum(np.hypot(mx, my), 1e-9)
    delta = (q - 1.0) * q / slope
    S = ndtr(-delta / s)
    light, left = B + Bx * dx + By * dy, 1.0 - D * S
    edge = light * D * np.exp(-0.5 * (delta / s) ** 2) / (np.sqrt(2.0 * np.pi) * s)  # by δ
    model = light * left
    J = np.empty((len(p), 10, xx.size))
    J[:, 0], J[:, 1] = -edge * mx / slope, -edge * my / slope
    J[:, 2], J[:, 3], J[:, 4] = (edge * k / slope for k in (0.5 * dx * dx, dx * dy, 0.5 * dy * dy))
    J[:, 5] = -edge * delta / s
    J[:, 6], J[:, 7], J[:, 8], J[:, 9] = left, dx * left, dy * left, -light * S
    return model, J
