"""Covariance of the rows of a strip across an edge, and what the scatter of its columns says of the edge."""

import numpy as np
from scipy.special import ndtr

from dic.arrays import FloatArray

CELL = 0.5
"""Distance of the places of paint that a pixel is summed over [px]."""


BEYOND = 5.0
"""Paint beyond the strip that the blur brings into it [px]."""


def paint(lag: FloatArray, length: float, shape: float) -> FloatArray:
    """Covariance of paint, the rational quadratic ``(1 + lag² / (2 shape length²))^-shape``: Gaussian for a
    large shape, with the longer tail of spots of many sizes for a small one [-]."""
    return np.asarray((1.0 + lag**2 / (2.0 * shape * length**2)) ** -shape)


def covariance(p: FloatArray, u: FloatArray, width: FloatArray, free: bool) -> FloatArray:
    """Covariance of the rows of a strip, shape [n_rows, n_rows].

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
    """
    edge, (blur, first, other, contrast, second, noise, shape) = p[0], np.exp(p[1:8])
    band = float(width[0] + (p[8] * width[1] if free else 0.0))
    v = np.arange(u[0] - BEYOND, u[-1] + BEYOND + CELL, CELL)
    low, high = v - 0.5 * CELL, v + 0.5 * CELL
    lag = CELL * np.arange(v.size, dtype=np.float64)
    apart = np.abs(np.subtract.outer(np.arange(v.size), np.arange(v.size)))
    inside = _weights(u, low, np.minimum(high, edge), blur)
    outside = _weights(u, np.maximum(low, edge + band), high, blur)
    C = contrast**2 * inside @ paint(lag, first, shape)[apart] @ inside.T
    C += second**2 * outside @ paint(lag, other, shape)[apart] @ outside.T
    C[np.diag_indices_from(C)] += noise**2
    return np.asarray(C)


def _weights(u: FloatArray, low: FloatArray, high: FloatArray, blur: float) -> FloatArray:
    """What paint between `low` and `high` gives a pixel at u, shape [n_u, n_v]."""
    reach = np.maximum(high, low)
    return np.asarray(ndtr((reach - u[:, None]) / blur) - ndtr((low - u[:, None]) / blur))


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
        C = covariance(p, u, width[k], free)
        inverse = np.linalg.inv(C)
        slopes = []
        for j in used:
            step = np.zeros(p.size)
            step[j] = 1e-4
            slopes.append(
                (covariance(p + step, u, width[k], free) - covariance(p - step, u, width[k], free)) / 2e-4
            )
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
