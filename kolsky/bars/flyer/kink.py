"""Kink of a curve: a polynomial plus a part that ends, or begins, at an unknown time."""

from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray

STEPS = 80
"""Places tried over the span before the best one is refined."""


@dataclass(frozen=True)
class Kink:
    """The best place of a kink, and what speaks for it."""

    time: float
    """Its time [s]."""
    sigma: float
    """Its standard uncertainty, enlarged where the curve does not fit within its noise [s]."""
    change: float
    """Factor of the part that ends or begins there, in the unit of the data over s^power."""
    gain: float
    """Fall of chi-square by the kink over chi-square per degree of freedom with it [-]; about 2 for none."""


def find_kink(
    time: FloatArray,
    value: FloatArray,
    sigma: FloatArray,
    span: tuple[float, float],
    *,
    degree: int,
    power: int,
    begins: bool,
    bends: bool = False,
) -> Kink:
    """Fit a polynomial plus ``|t - t_k|^power`` on one side of the kink by weighted least squares.

    Parameters
    ----------
    time
        Times of the data [s], shape [n].
    value, sigma
        Data and their standard deviations, shape [n].
    span
        Where the kink may be [s].
    degree
        Of the polynomial.
    power
        1 for a jump of the slope, 2 for one of the curvature.
    begins
        Whether the part acts after the kink; before it otherwise.
    bends
        Whether a part of the next higher power acts there too.

    Raises
    ------
    ValueError
        If there are not three data more than unknowns at least, or the span is empty.
    """
    if time.size < degree + 6:
        raise ValueError(f"a kink needs at least {degree + 6} data, got {time.size}")
    if not span[0] < span[1]:
        raise ValueError(f"a kink needs a span to be looked for in, got {span[0]:.9g} to {span[1]:.9g} s")
    middle, half = 0.5 * (time[0] + time[-1]), 0.5 * (time[-1] - time[0])
    smooth = np.polynomial.polynomial.polyvander((time - middle) / half, degree) / sigma[:, None]
    y = value / sigma

    def equations(at: float) -> FloatArray:
        since = (time - at if begins else at - time) / half
        since = np.maximum(since, 0.0)
        parts = [since ** (power + more) / sigma for more in range(1 + bends)]
        return np.column_stack([smooth, *parts])

    from scipy.optimize import minimize_scalar  # loaded where it is of use

    def chi2(at: float) -> float:
        G = equations(at)
        rest = y - G @ np.linalg.lstsq(G, y, rcond=None)[0]
        return float(rest @ rest)

    grid = np.linspace(*span, STEPS + 1)
    step = float(grid[1] - grid[0])
    best = float(grid[np.argmin([chi2(at) for at in grid])])
    inside = (max(best - step, span[0]), min(best + step, span[1]))
    best = float(minimize_scalar(chi2, bounds=inside, method="bounded", options={"xatol": 1e-4 * step}).x)
    G = equations(best)
    solution = np.linalg.lstsq(G, y, rcond=None)[0]
    h = 1e-2 * step
    slope = (equations(best + h) - equations(best - h)) @ solution / (2.0 * h)
    J = np.column_stack([G, slope])
    size = np.linalg.norm(J, axis=0)
    size[size == 0.0] = 1.0
    variance = (np.linalg.pinv((J / size).T @ (J / size)) / np.outer(size, size))[-1, -1]
    straight = y - smooth @ np.linalg.lstsq(smooth, y, rcond=None)[0]
    left = chi2(best)
    growth = max(1.0, left / (y.size - J.shape[1]))
    return Kink(
        time=best,
        sigma=float(np.sqrt(growth * variance)),
        change=float(solution[degree + 1] / half**power),
        gain=(float(straight @ straight) - left) / growth,
    )
