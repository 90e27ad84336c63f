r"""Numbers that a testing standard asks of a curve: Young's modulus, Poisson's ratio, fracture, recovery.

Young's modulus is the slope of the regression line of nominal stress over nominal strain in a range, 0 to 5 %
unless said otherwise; Poisson's ratio the slope of :math:`-\ln\lambda_t` over :math:`\ln\lambda` through rest
(logarithmic strains, for which 0.5 keeps the volume at any stretch). Fracture is the largest stress of a test
that broke after it. A healing efficiency is a mean of healed specimens over a mean of undamaged ones (Terryn
et al. 2021, Table 3).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray

INITIAL = 0.05
"""End of the range of Young's modulus, as nominal strain [-]."""
DROP = 0.2
"""Share of the largest stress that a broken specimen has lost [-]."""
BACK = 0.02
"""Share of its strain by which a specimen may spring back as it breaks [-]."""
FEWEST = 3
"""Points that a regression needs."""


@dataclass(frozen=True)
class Measured:
    """A number with its standard uncertainty."""

    value: float
    """The number."""
    sigma: float
    """Its standard uncertainty; NaN where nothing tells."""


@dataclass(frozen=True)
class Fracture:
    """Where a specimen broke."""

    stress: float
    """Largest nominal stress [Pa]."""
    strain: float
    """Nominal strain there [-]."""


@dataclass(frozen=True)
class Recovery:
    """One property of healed specimens against undamaged ones."""

    undamaged: Measured
    """Mean and its standard uncertainty."""
    healed: Measured
    """Likewise."""
    efficiency: Measured
    """Healed over undamaged [-]."""


def youngs_modulus(strain: FloatArray, stress: FloatArray, *, upto: float = INITIAL) -> Measured | None:
    """Slope of the regression line of stress over strain, |strain| <= `upto`.

    Parameters
    ----------
    strain, stress
        Nominal, of one sign convention [-] and [Pa], shape [n].
    upto
        End of the range [-].

    Returns
    -------
    Measured or None
        Modulus [Pa] with the regression's standard error; None with fewer than `FEWEST` strains in the range.
    """
    inside = np.abs(strain) <= upto * (1.0 + 1e-9)
    x, y = strain[inside], stress[inside]
    if np.unique(x).size < FEWEST:
        return None
    dx = x - x.mean()
    slope = float(dx @ y / (dx @ dx))
    rest = y - y.mean() - slope * dx
    return Measured(slope, float(np.sqrt(rest @ rest / (x.size - 2) / (dx @ dx))))


def poissons_ratio(stretch: FloatArray, lateral: FloatArray) -> Measured | None:
    """Slope of -ln(lateral stretch) over ln(stretch) through rest.

    Returns
    -------
    Measured or None
        Ratio [-] with the regression's standard error; None with fewer than `FEWEST` points away from rest.
    """
    x, y = np.log(stretch), -np.log(lateral)
    away = x != 0.0
    if away.sum() < FEWEST:
        return None
    x, y = x[away], y[away]
    slope = float(x @ y / (x @ x))
    rest = y - slope * x
    return Measured(slope, float(np.sqrt(rest @ rest / (x.size - 1) / (x @ x))))


def fracture(strain: FloatArray, stress: FloatArray, *, drop: float = DROP) -> Fracture | None:
    """Largest stress and its strain, if the stress then falls by the share `drop`; None if it never does.

    The fall counts only where the strain has not gone back by more than `BACK`: unloading is no fracture.
    Stress and strain are positive along the load, in the order of the test, shape [n].
    """
    top = int(np.argmax(stress))
    fallen = (stress[top:] <= (1.0 - drop) * stress[top]) & (strain[top:] >= (1.0 - BACK) * strain[top])
    if not fallen.any():
        return None
    return Fracture(float(stress[top]), float(strain[top]))


def mean_of(values: Sequence[float]) -> Measured:
    """Mean of specimens and its standard uncertainty by their scatter; NaN from one specimen."""
    x = np.asarray(values, dtype=float)
    sigma = float(x.std(ddof=1) / np.sqrt(x.size)) if x.size > 1 else float("nan")
    return Measured(float(x.mean()), sigma)


def recovery(undamaged: Sequence[float], healed: Sequence[float]) -> Recovery:
    """Healing efficiency of a property, with the standard uncertainty of the quotient to first order.

    The uncertainty is NaN where a group is one specimen, which does not tell its scatter.

    Raises
    ------
    ValueError
        If a group is empty, or the undamaged mean is not > 0.
    """
    if not undamaged or not healed:
        raise ValueError("a healing efficiency needs undamaged and healed specimens")
    before, after = mean_of(undamaged), mean_of(healed)
    if not before.value > 0.0:
        raise ValueError(f"the undamaged specimens' mean must be > 0, got {before.value:g}")
    ratio = after.value / before.value
    sigma = math.hypot(after.sigma, ratio * before.sigma) / before.value
    return Recovery(before, after, Measured(ratio, sigma))
