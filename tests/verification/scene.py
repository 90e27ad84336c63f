"""Common parts of the cases: the reference specimen, smooth platen motions, fitted limits."""

from collections.abc import Callable
from math import pi, sin
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq, minimize_scalar

from explicit import PlatenMotion

FloatArray = NDArray[np.float64]


def distances(points: FloatArray, line: FloatArray) -> FloatArray:
    """Distance of each point to the closest place of a polyline [m], shape [n_points].

    Measured along the normal, so it is as meaningful where the outline runs along a platen as where it
    stands upright, which a difference of radii at equal height is not.

    ``points``: array, shape [n_points, 2]. ``line``: vertices in order.
    """
    start, along = line[:-1], np.diff(line, axis=0)
    offset = points[:, None] - start
    share = np.clip((offset * along).sum(axis=-1) / (along**2).sum(axis=-1), 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - share[..., None] * along, axis=-1).min(axis=1))


def rms(values: FloatArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


class Limit(NamedTuple):
    """The limit of a series q(h) = q_0 + C h^p with a given order p."""

    value: FloatArray  # q_0, in the unit of the series, shape [...]
    deviation: FloatArray  # largest distance of a member of the series from the law, shape [...]


def limit(h: ArrayLike, series: ArrayLike, order: float) -> Limit:
    """Fit q_0 and C by least squares.

    ``h``: element sizes, any unit, shape [n], n >= 3: two would leave nothing to judge the law by.
    ``series``: the quantity on each mesh, shape [n, ...]. ``order``: the order p, from theory.
    """
    sizes, values = np.asarray(h, dtype=float), np.asarray(series, dtype=float)
    law = np.column_stack([np.ones_like(sizes), sizes**order])
    flat = values.reshape(len(sizes), -1)
    found = np.linalg.lstsq(law, flat, rcond=None)[0]
    shape = values.shape[1:]
    return Limit(found[0].reshape(shape), np.abs(flat - law @ found).max(axis=0).reshape(shape))


class CommonLimit(NamedTuple):
    """What several series share: q_i(h) = q_0 + C_i h^p with one limit and one order."""

    value: float  # q_0, in the unit of the series
    order: float  # p [-]
    deviation: float  # largest distance of a member of a series from the law, in the unit of the series


def common_limit(h: ArrayLike, series: ArrayLike) -> CommonLimit:
    """Fit q_0, p and a C for each series by least squares; two series of four leave four degrees of freedom.

    ``h``: element sizes, any unit, shape [n]. ``series``: a number on each mesh, by element, shape [n_series,
    n], n >= 3, n_series >= 2.
    """
    sizes, values = np.asarray(h, dtype=float), np.asarray(series, dtype=float)

    def fit(order: float) -> tuple[float, FloatArray]:
        law = np.zeros((values.size, 1 + len(values)))
        law[:, 0] = 1.0
        for i in range(len(values)):
            law[i * len(sizes) : (i + 1) * len(sizes), i + 1] = sizes**order
        found = np.linalg.lstsq(law, values.ravel(), rcond=None)[0]
        return float(found[0]), values.ravel() - law @ found

    best = minimize_scalar(lambda p: float((fit(p)[1] ** 2).sum()), bounds=(0.3, 4.0), method="bounded").x
    value, residual = fit(best)
    return CommonLimit(value, float(best), float(np.abs(residual).max()))


def corner_exponent() -> float:
    """Exponent of the displacement at a right-angled edge of an incompressible solid bonded on one side.

    The root of sin^2(lambda pi / 2) = 1 - lambda^2: Williams (1952), clamped-free wedge, plane strain,
    nu = 1/2. Energies and forces then converge with the order 2 lambda on a uniform mesh.
    """
    return float(brentq(lambda x: sin(0.5 * pi * x) ** 2 - 1.0 + x * x, 0.3, 0.9))


RADIUS, LENGTH, DENSITY = 4.75e-3, 6.5e-3, 870.0
"""Radius [m], length [m] and mass density [kg/m^3] of the specimen of the reference solutions."""
YOUNG = 80e3  # its initial modulus of elasticity [Pa]


def shear_modulus(poisson: float) -> float:
    """Initial shear modulus of the reference specimen, E / (2 (1 + nu)) [Pa]."""
    return YOUNG / (2.0 * (1.0 + poisson))


def quintic(s: FloatArray) -> FloatArray:
    """Smooth step 10 s^3 - 15 s^4 + 6 s^5 from 0 to 1 on [0, 1], held outside [-]."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def speed_after_rise(speed: float, rise: float, *, end: float, n_knots: int = 3001) -> PlatenMotion:
    """A platen that accelerates smoothly over `rise` [s] to `speed` [m/s] and keeps it until `end` [s]."""

    def position(time: FloatArray) -> FloatArray:
        s = np.clip(time / rise, 0.0, 1.0)
        return speed * rise * s**4 * (2.5 - 3.0 * s + s**2) + speed * np.maximum(time - rise, 0.0)

    return PlatenMotion.sampled(
        position, lambda time: speed * quintic(time / rise), start=0.0, end=end, n_knots=n_knots
    )


def smooth_stroke(stroke: float, duration: float, *, end: float, n_knots: int = 3001) -> PlatenMotion:
    """A platen that moves by `stroke` [m] within `duration` [s], at rest before and after."""

    def velocity(time: FloatArray) -> FloatArray:
        s = np.clip(time / duration, 0.0, 1.0)
        return stroke / duration * 30.0 * s**2 * (1.0 - s) ** 2

    return PlatenMotion.sampled(
        lambda time: stroke * quintic(time / duration), velocity, start=0.0, end=end, n_knots=n_knots
    )


_NINTH = Polynomial([0.0, 0.0, 0.0, 0.0, 0.0, 126.0, -420.0, 540.0, -315.0, 70.0])
"""Smooth step of ninth order: four continuous derivatives, for studies of convergence."""


def ninth(s: FloatArray) -> FloatArray:
    """Smooth step of ninth order from 0 to 1 on [0, 1], held outside [-]."""
    return np.asarray(_NINTH(np.clip(s, 0.0, 1.0)))


def ninth_slope(s: FloatArray, derivative: int = 1) -> FloatArray:
    """Derivative of `ninth` (or a higher one) [-]."""
    return np.asarray(_NINTH.deriv(derivative)(np.clip(s, 0.0, 1.0)))


def gentle_stroke(stroke: float, duration: float, *, end: float) -> PlatenMotion:
    """Like `smooth_stroke`, along the smooth step of ninth order."""
    return PlatenMotion.sampled(
        lambda time: stroke * ninth(time / duration),
        lambda time: stroke / duration * ninth_slope(time / duration),
        start=0.0,
        end=end,
        n_knots=8001,
    )


def gentle_start(speed: float, rise: float, *, end: float) -> PlatenMotion:
    """Like `speed_after_rise`, along the smooth step of ninth order."""
    area = _NINTH.integ()

    def position(time: FloatArray) -> FloatArray:
        s = np.clip(time / rise, 0.0, 1.0)
        return speed * (rise * np.asarray(area(s)) + np.maximum(time - rise, 0.0))

    return PlatenMotion.sampled(
        position, lambda time: speed * ninth(time / rise), start=0.0, end=end, n_knots=8001
    )


def label_sizes(axes: Axes, sizes: FloatArray) -> None:
    """Label a short logarithmic x axis with the sizes themselves."""
    axes.set_xticks(sizes, [f"{size:.3g}" for size in sizes])
    axes.xaxis.set_minor_locator(NullLocator())


def table(header: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def invert(function: Callable[[float], float], value: float) -> float:
    """The s in [0, 1] at which a function rising from 0 to 1 has a value."""
    return float(brentq(lambda s: float(function(s)) - value, 0.0, 1.0, xtol=1e-15))
