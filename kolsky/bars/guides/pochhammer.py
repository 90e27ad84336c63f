"""First longitudinal mode of a solid round bar with a free surface, after Pochhammer (1876) and Chree (1889).

Everything is dimensionless: lengths in bar radii a, speeds in bar wave speeds c0 = sqrt(E / rho). With the
wavenumber K = k a and the frequency W = omega a / c0, the phase velocity is c / c0 = W / K and the ratio of
radius to wavelength a / Lambda = K / (2 pi).
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kolsky.bars.guides.frequency_equation import dispersion_table, frequency_equation, onoe, slownesses
from kolsky.base.arrays import FloatArray

Array = NDArray[Any]


def wavenumber(frequency: ArrayLike, poisson: float) -> Array:
    """Wavenumber of the first mode.

    Complex frequencies are those of waves under an exponential window, or of a viscoelastic bar by the
    correspondence principle; the table then only starts a Newton iteration on the frequency equation.

    Parameters
    ----------
    frequency : array_like
        omega a / c0 [-], real or complex with a real part that outweighs the imaginary one, any sign.
    poisson : float
        Poisson's ratio, in [0, 0.5).

    Returns
    -------
    NDArray
        k a [-], same shape; odd in the frequency. Relative error below `dispersion_table.TABLE_ERROR`.

    Raises
    ------
    ValueError
        If Poisson's ratio is outside its range or a frequency is not finite.
    """
    w = np.asarray(frequency)
    if not np.isfinite(w).all():
        raise ValueError("frequencies must be finite; cure: remove what is not a number from the signal")
    size = np.abs(w.real)
    slowness = dispersion_table(poisson, float(size.max(initial=0.0)))
    real = size * slowness(size)
    if not np.iscomplexobj(w):
        return np.copysign(real, w)
    turned = np.where(w.real < 0.0, -w, w)  # K(-W) = -K(W): only the right half-plane has to be known
    offset = 1j * turned.imag
    group = slowness(size) + size * slowness(size, 1)
    bend = 2.0 * slowness(size, 1) + size * slowness(size, 2)
    found = np.asarray(real + offset * group + 0.5 * offset**2 * bend)
    return np.where(w.real < 0.0, -1.0, 1.0) * _polished(found, turned, poisson)


def phase_velocity(ratio: ArrayLike, poisson: float) -> FloatArray:
    """Phase velocity of the first mode over c0 [-], against radius over wavelength.

    Parameters
    ----------
    ratio : array_like
        a / Lambda [-], >= 0.
    poisson : float
        Poisson's ratio, in [0, 0.5).

    Raises
    ------
    ValueError
        If an argument is outside its range.
    """
    k = 2.0 * np.pi * np.asarray(ratio, dtype=float)
    if not (np.isfinite(k).all() and (k >= 0.0).all()):
        raise ValueError("a / Lambda must be finite and >= 0")
    w = frequency(k, poisson)
    still = k == 0.0
    return np.asarray(np.where(still, 1.0, w / np.where(still, 1.0, k)))


def frequency(wavenumber: ArrayLike, poisson: float) -> Array:
    """Frequency of the first mode, the inverse of `wavenumber`.

    Parameters
    ----------
    wavenumber : array_like
        k a [-], real or complex with a real part that outweighs the imaginary one, any sign.
    poisson : float
        Poisson's ratio, in [0, 0.5).

    Returns
    -------
    NDArray
        omega a / c0 [-], same shape.

    Raises
    ------
    ValueError
        If Poisson's ratio is outside its range or a wavenumber is not finite.
    """
    k = np.asarray(wavenumber)
    if not np.isfinite(k).all():
        raise ValueError("wavenumbers must be finite")
    sign = np.where(k.real < 0.0, -1.0, 1.0)
    turned = sign * k
    table = dispersion_table(poisson, float(np.abs(turned.real).max(initial=0.0)))
    knots = table.x * table(table.x)
    w = np.asarray(np.interp(turned.real, knots, table.x), dtype=k.dtype if np.iscomplexobj(k) else float)
    w = w + (turned - turned.real) * (w.real / np.where(turned.real == 0.0, 1.0, turned.real))
    moving = np.abs(turned) > 1e-4
    for _ in range(8):
        if poisson == 0.0 or not moving.any():
            break
        f, _, slope = frequency_equation(turned[moving], w[moving], poisson)
        w[moving] -= f / slope
    return np.asarray(sign * np.where(moving | (poisson == 0.0), w, turned))


def group_velocity(frequency: ArrayLike, poisson: float) -> FloatArray:
    """Group velocity d(omega) / dk of the first mode over c0 [-], at real frequencies omega a / c0."""
    size = np.abs(np.asarray(frequency, dtype=float))
    slowness = dispersion_table(poisson, float(size.max(initial=0.0)))
    return np.asarray(1.0 / (slowness(size) + size * slowness(size, 1)))


def mean_over_surface(frequency: ArrayLike, poisson: float) -> Array:
    """Axial strain averaged over the cross-section over that on the surface [-], where gauges sit.

    This is the factor M1 of Tyas and Watson (2001). Their M2, the mean stress over E times the mean strain,
    is (c / c0)^2: a free surface leaves the axial momentum no other way.

    Parameters
    ----------
    frequency : array_like
        omega a / c0 [-], real or complex.
    poisson : float
        Poisson's ratio, in [0, 0.5).
    """
    if not poisson > 0.0:
        raise ValueError("without Poisson's ratio the mean strain is that of the surface")
    w = np.asarray(frequency)
    k = wavenumber(w, poisson)
    shear, longitudinal = slownesses(poisson)
    p, q = w**2 * longitudinal - k**2, w**2 * shear - k**2
    mean = 2.0 * w**2 * (shear - 2.0 * longitudinal)  # = 2 (q - K^2) - 4 p without its cancellation
    surface = onoe(p) * (q - k**2) - 2.0 * p * onoe(q)
    still = np.abs(w) < 1e-6
    return np.asarray(np.where(still, 1.0, mean / np.where(still, 1.0, surface)))


def _polished(k: Array, w: Array, poisson: float) -> Array:
    """A few Newton steps in the complex plane, from a start that is already close."""
    result = np.array(k)
    moving = np.flatnonzero(np.abs(np.ravel(w)) > 1e-4)  # below, the residual is round-off
    if poisson == 0.0:
        return result
    result, at = result.ravel(), np.ravel(w)
    for _ in range(8):
        if moving.size == 0:
            return result.reshape(w.shape)
        f, slope, _ = frequency_equation(result[moving], at[moving], poisson)
        change = f / slope
        result[moving] -= change
        # Newton's method doubles the digits: the next step would change round-off.
        moving = moving[np.abs(change) > 1e-8 * np.abs(result[moving])]
    raise ValueError(
        f"no wavenumber found at omega a / c0 = {at[moving[0]]:.6g}; the damping must be small, the "
        "imaginary part below a third of the real one. Cure: limit the band"
    )
