"""Punching: elastic indentation of the bars' faces by a narrower specimen."""

from dataclasses import replace
from math import pi

import numpy as np
from scipy.interpolate import PchipInterpolator

from kolsky.bars.records import Correction, History, Reduction
from kolsky.bars.signals.arrival import moving_mean
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.arrays import FloatArray

HALF_SPACE = 16.0 / (3.0 * pi**2)
"""Mean sinking under an even pressure on a half-space, in units of (1 - nu^2) F / (E a) (Love 1929)."""

_RATIO = np.array([0.0, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0])
# Static finite elements of a half-infinite bar with a free side, nu = 0.29, extrapolated over three meshes;
# tests/validation/test_punching_elements.py computes them again. Over 0 <= nu < 0.5 they vary by 4 %.
_SHARE = np.array(
    [1.0, 0.87847, 0.81791, 0.75775, 0.63881, 0.52260, 0.41026, 0.30319, 0.20332, 0.11371, 0.04015, 0.0]
)
_share = PchipInterpolator(_RATIO, _SHARE)


def punching_compliance(bar: Bar, radius: float) -> float:
    """Mean sinking of a bar's face below that of one-dimensional theory, per force [m/N].

    Eq. (R.15): (16 / (3 pi^2)) (1 - nu^2) / (E a) times the share f(a/b) that the bar's finite radius b
    leaves; f(0) = 1 and f(1) = 0. The pressure is even over the circle of radius a, as under a specimen much
    softer than the bar; under a rigid one the mean is 8 % smaller.

    Parameters
    ----------
    bar
        The bar; its Poisson's ratio is used in 1 - nu^2.
    radius
        Radius of the specimen [m], in (0, bar radius].

    Raises
    ------
    ValueError
        If the radius is outside its range.
    """
    ratio = radius / (0.5 * bar.diameter)
    if not 0.0 < ratio <= 1.0 + 1e-9:
        raise ValueError(
            f"the specimen's radius = {radius} m must be > 0 and not exceed the bar's, {0.5 * bar.diameter} m"
        )
    share = float(_share(ratio)) if ratio < 1.0 else 0.0
    return HALF_SPACE * share * (1.0 - bar.poisson**2) / (bar.youngs_modulus * radius)


def correct_punching(
    reduction: Reduction,
    specimen: Specimen,
    incident_bar: Bar,
    transmission_bar: Bar,
    *,
    apply: bool = True,
) -> tuple[Reduction, Correction]:
    """Take the sinking of both faces from the specimen's shortening.

    Eq. (R.16): e - (C1 F1 + C2 F2) / L, with the forces that the analysis has: F2 twice for one wave, F1
    twice for two, both for three. The rate loses the difference quotient of the same over the time that a
    wave needs to cross the bar's diameter; below that time the sinking is no quasi-static one. Velocities of
    the faces stay what one-dimensional theory says.

    Parameters
    ----------
    reduction
        The reduction.
    specimen
        The specimen before the test.
    incident_bar, transmission_bar
        The bars.
    apply
        False returns the reduction as it is, with the correction it would have had.

    Returns
    -------
    tuple of Reduction and Correction
        The correction's sizes are changes of the nominal strain by three waves.
    """
    C1 = punching_compliance(incident_bar, specimen.radius)
    C2 = punching_compliance(transmission_bar, specimen.radius)
    F1, F2 = reduction.front_force, reduction.back_force
    step = float(reduction.time[1] - reduction.time[0])
    width = max(2, round(max(b.diameter / b.wave_speed for b in (incident_bar, transmission_bar)) / step))
    L = specimen.length
    shares = {"one wave": (0.0, C1 + C2), "two waves": (C1 + C2, 0.0), "three waves": (C1, C2)}
    strain, rate = {}, {}
    for key, (first, second) in shares.items():
        sunk = (first * F1.value + second * F2.value) / L
        noise = np.hypot(first * F1.sigma, second * F2.sigma) / L
        e, r = reduction.strain[key], reduction.rate[key]
        strain[key] = History(e.value - sunk, np.hypot(e.sigma, noise), e.unit)
        slope_noise = noise / (width * step)  # means of two neighbours at either end
        rate[key] = History(r.value - _slope(sunk, step, width), np.hypot(r.sigma, slope_noise), r.unit)
    change = strain["three waves"].value - reduction.strain["three waves"].value
    verb = "shortens" if apply else "would shorten"
    correction = Correction(
        name="punching of the bars' faces",
        key="punching",
        applied=apply,
        size=float(np.abs(change).max()),
        rms=float(np.sqrt(np.mean(change**2))),
        unit="1",
        reason=(
            f"a specimen of {specimen.diameter * 1e3:.4g} mm on bars of {incident_bar.diameter * 1e3:.4g} "
            f"and {transmission_bar.diameter * 1e3:.4g} mm sinks in by {C1 * 1e9:.3g} and {C2 * 1e9:.3g} "
            f"nm/N; this {verb} the strain"
        ),
    )
    return (replace(reduction, strain=strain, rate=rate) if apply else reduction), correction


def _slope(value: FloatArray, step: float, width: int) -> FloatArray:
    """Derivative of the mean over `width` samples."""
    return np.gradient(moving_mean(value, width), step)
