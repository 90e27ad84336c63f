"""Tables of the first longitudinal mode: roots of the frequency equation, by Poisson's ratio."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from kolsky.bars.guides.frequency_equation import (
    check_poisson,
    frequency_equation,
    onoe,
    onoe_slope,
    rayleigh_speed,
)
from kolsky.base.arrays import FloatArray

TABLE_ERROR = 1e-9
"""Largest relative error of a table's wavenumber [-], measured between its knots."""
FIRST_TABLE = 8.0
"""omega a / c0 up to which a table reaches at first; it is doubled until it holds what is asked for."""
_SCAN = 400
"""Phase velocities at which a bracket of the slowest root is sought."""


def dispersion_table(poisson: float, largest: float = FIRST_TABLE) -> CubicHermiteSpline:
    """Slowness c0 / c of the first mode against omega a / c0, cached by Poisson's ratio.

    Knots lie on the frequency equation, with exact slopes. Intervals are halved until the cubic between the
    knots is within `TABLE_ERROR` of the root in their middle.

    Parameters
    ----------
    poisson : float
        Poisson's ratio, in [0, 0.5).
    largest : float
        omega a / c0 up to which the table must reach [-].

    Raises
    ------
    ValueError
        If Poisson's ratio is outside its range.
    """
    check_poisson(poisson)
    doublings = max(0, int(np.ceil(np.log2(max(largest, FIRST_TABLE) / FIRST_TABLE))))
    return _table(float(poisson), FIRST_TABLE * 2.0**doublings)


@lru_cache(maxsize=32)
def _table(poisson: float, end: float) -> CubicHermiteSpline:
    if poisson == 0.0:
        return _table_without_poisson(end)

    def solve(w: FloatArray) -> tuple[FloatArray, FloatArray]:
        k = _slowest_root(w, poisson)
        _, by_k, by_w = frequency_equation(k, w, poisson)
        return k / w, (-by_w / by_k - k / w) / w

    return _refined(solve, np.array([0.0]), np.ones(1), np.zeros(1), end)


def _table_without_poisson(end: float) -> CubicHermiteSpline:
    """Without Poisson's ratio the bar does not disperse up to J1'(W) = 0, where two branches cross."""
    crossing = 1.8411837813406593

    def solve(w: FloatArray) -> tuple[FloatArray, FloatArray]:
        low, high = w.copy(), w / (0.8 * rayleigh_speed(0.0))
        for _ in range(80):  # W^2 - p O(p) - K^2 O(q) = 0: f over 2 p
            k = 0.5 * (low + high)
            p, q = w**2 - k**2, 2.0 * w**2 - k**2
            beyond = w**2 - p * onoe(p) - k**2 * onoe(q) < 0.0
            low, high = np.where(beyond, low, k), np.where(beyond, k, high)
        p, q = w**2 - k**2, 2.0 * w**2 - k**2
        op, oq = onoe(p), onoe(q)
        kept, turned = op + p * onoe_slope(p, op), k**2 * onoe_slope(q, oq)
        by_k = 2.0 * k * (kept - oq + turned)
        by_w = 2.0 * w * (1.0 - kept - 2.0 * turned)
        return k / w, (-by_w / by_k - k / w) / w

    above = _refined(solve, np.array([]), np.array([]), np.array([]), end, start=crossing * (1.0 + 1e-9))
    knots = np.concatenate([[0.0, crossing], above.x])
    values = np.concatenate([[1.0, 1.0], above(above.x)])
    return CubicHermiteSpline(knots, values, np.concatenate([[0.0, 0.0], above(above.x, 1)]))


def _refined(
    solve: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
    knots: FloatArray,
    values: FloatArray,
    slopes: FloatArray,
    end: float,
    *,
    start: float = 0.0,
) -> CubicHermiteSpline:
    """Slowness table whose intervals were halved until the cubics hold in their middles."""
    first = np.linspace(start, end, 33)[1 if start == 0.0 else 0 :]
    new_values, new_slopes = solve(first)
    knots, values, slopes = (
        np.concatenate(pair) for pair in ((knots, first), (values, new_values), (slopes, new_slopes))
    )
    open_ = np.ones(knots.size - 1, dtype=bool)
    while open_.any():
        middles = 0.5 * (knots[1:] + knots[:-1])[open_]
        found, slope = solve(middles)
        error = np.abs(CubicHermiteSpline(knots, values, slopes)(middles) / found - 1.0)
        places = np.flatnonzero(open_) + 1
        # The error falls with the fourth power: halves of what is already good need no look.
        again = (error > TABLE_ERROR) & (middles - knots[places - 1] > 1e-7)
        knots, values = np.insert(knots, places, middles), np.insert(values, places, found)
        slopes = np.insert(slopes, places, slope)
        open_ = np.zeros(knots.size - 1, dtype=bool)
        left = places + np.arange(places.size) - 1
        open_[left[again]] = open_[left[again] + 1] = True
    return CubicHermiteSpline(knots, values, slopes)


def _slowest_root(w: FloatArray, poisson: float) -> FloatArray:
    """Largest wavenumber at each frequency: the first mode, bracketed by a scan and closed in on."""
    slowest = 0.9 * rayleigh_speed(poisson)
    k = np.empty_like(w)
    pending = np.arange(w.size)
    n = _SCAN
    while pending.size:
        speeds = np.linspace(slowest, 1.0 + 1e-12, n)
        ascending = w[pending, None] / speeds
        sign = np.sign(frequency_equation(ascending, w[pending, None], poisson)[0])
        changes = sign[:, 1:] * sign[:, :-1] <= 0.0
        found = changes.any(axis=1)
        cell = changes.argmax(axis=1)[found]
        rows = pending[found]
        k[rows] = _closed_in(ascending[found, cell + 1], ascending[found, cell], w[rows], poisson)
        pending = pending[~found]
        n *= (
            10  # next to the crossing of two branches, at a very small Poisson's ratio, both hide in one cell
        )
        if n > 1_000_000:
            raise RuntimeError(f"no root of the frequency equation at omega a / c0 = {w[pending[0]]:g}")
    return k


def _closed_in(low: FloatArray, high: FloatArray, w: FloatArray, poisson: float) -> FloatArray:
    """Newton's method kept inside a bracket, by bisection where it leaves."""
    sign = np.sign(frequency_equation(low, w, poisson)[0])
    k = 0.5 * (low + high)
    for _ in range(80):
        f, slope, _ = frequency_equation(k, w, poisson)
        same = np.sign(f) == sign
        low, high = np.where(same, k, low), np.where(same, high, k)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = k - f / slope
        inside = np.isfinite(step) & (step > low) & (step < high)
        following = np.where(inside, step, 0.5 * (low + high))
        done = np.abs(following - k) <= 4e-16 * k
        k = following
        if done.all():
            break
    return k
