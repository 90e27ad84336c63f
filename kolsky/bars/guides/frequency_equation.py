"""The frequency equation of a solid round bar with a free surface (Pochhammer 1876, Chree 1889).

Everything is dimensionless: lengths in bar radii a, speeds in bar wave speeds c0 = sqrt(E / rho). With the
wavenumber K = k a and the frequency W = omega a / c0, the phase velocity is c / c0 = W / K.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import i0e, i1e, j0, j1, jve

Array = NDArray[Any]

_SERIES = 1e-3
"""Below this |s| the Onoe function is its series: the next term is s^4 / 23040, below round-off."""


def frequency_equation(k: Array, w: Array, poisson: float) -> tuple[Array, Array, Array]:
    """Residual of the frequency equation and its derivatives by K and W.

    With p = alpha^2 a^2 = W^2 (c0/c_L)^2 - K^2, q = beta^2 a^2 = W^2 (c0/c_T)^2 - K^2 and the Onoe function
    O(s) = z J0(z) / J1(z), z^2 = s, which is real for real s of either sign (Graff 1975, Eq. 8.2.34, times
    p / (J1 J1)):

    f = 2 p (q + K^2) - (q - K^2)^2 O(p) - 4 K^2 p O(q).
    """
    shear, longitudinal = slownesses(poisson)
    square = k**2
    p, q = w**2 * longitudinal - square, w**2 * shear - square
    op, oq = onoe(p), onoe(q)
    dop, doq = onoe_slope(p, op), onoe_slope(q, oq)
    d = q - square
    f = 2.0 * p * (q + square) - d**2 * op - 4.0 * square * p * oq
    by_p = 2.0 * (q + square) - d**2 * dop - 4.0 * square * oq
    by_q = 2.0 * p - 2.0 * d * op - 4.0 * square * p * doq
    by_square = 2.0 * p + 2.0 * d * op - 4.0 * p * oq
    return f, 2.0 * k * (by_square - by_p - by_q), 2.0 * w * (longitudinal * by_p + shear * by_q)


def rayleigh_speed(poisson: float) -> float:
    """Speed of surface waves over c0, the limit of the first mode at high frequency [-].

    With x = (c / c_T)^2: x^3 - 8 x^2 + (24 - 16 g) x - 16 (1 - g) = 0, g = (c_T / c_L)^2 (Graff 1975,
    Eq. 6.1.86).
    """
    shear, longitudinal = slownesses(poisson)
    g = longitudinal / shear
    roots = np.roots([1.0, -8.0, 24.0 - 16.0 * g, -16.0 * (1.0 - g)])
    real = roots[np.abs(roots.imag) < 1e-9].real
    return float(np.sqrt(real[(real > 0.0) & (real < 1.0)][0] / shear))


def slownesses(poisson: float) -> tuple[float, float]:
    """(c0 / c_T)^2 and (c0 / c_L)^2 [-]."""
    return 2.0 * (1.0 + poisson), (1.0 + poisson) * (1.0 - 2.0 * poisson) / (1.0 - poisson)


def onoe(s: Array) -> Array:
    """z J0(z) / J1(z) with z^2 = s (Onoe, McNiven and Mindlin 1962); scaled functions where s < 0."""
    s = np.asarray(s)
    small = np.abs(s) < _SERIES
    if np.iscomplexobj(s):
        z = np.sqrt(np.where(small, 1.0, s))
        value = z * jve(0, z) / jve(1, z)
    else:
        z = np.sqrt(np.where(small, 1.0, np.abs(s)))
        with np.errstate(divide="ignore", invalid="ignore"):
            value = np.where(s < 0.0, z * i0e(z) / i1e(z), z * j0(z) / j1(z))
    return np.asarray(np.where(small, 2.0 - s / 4.0 - s**2 / 96.0 - s**3 / 1536.0, value))


def onoe_slope(s: Array, value: Array) -> Array:
    """dO/ds from the Riccati equation that O obeys, 2 s O' = 2 O - O^2 - s."""
    small = np.abs(s) < _SERIES
    slope = (2.0 * value - value**2 - s) / (2.0 * np.where(small, 1.0, s))
    return np.asarray(np.where(small, -0.25 - s / 48.0 - s**2 / 512.0, slope))


def check_poisson(poisson: float) -> None:
    if not 0.0 <= poisson < 0.5:
        raise ValueError(f"Poisson's ratio of a bar must be in [0, 0.5), got {poisson}")
