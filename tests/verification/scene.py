"""What the verification cases share: the reference specimen, smooth platen motions, a short way to run."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.optimize import brentq

from explicit import PlatenMotion

FloatArray = NDArray[np.float64]

RADIUS, LENGTH, DENSITY = 4.75e-3, 6.5e-3, 870.0
"""Radius [m], length [m] and mass density [kg/m^3] of the specimen of the reference solutions."""
YOUNG = 80e3
"""Its initial modulus of elasticity [Pa]."""


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


def rms(values: FloatArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


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
