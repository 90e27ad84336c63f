"""Young's modulus, Poisson's ratio and fracture of a tensile curve, and their recovery by healing."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import linregress

from explicit.materials import LAWS
from kolsky.base.arrays import FloatArray
from kolsky.material.fits.fit import fit_law
from kolsky.material.fits.homogeneous import Mode
from kolsky.material.fits.homogeneous_test import HomogeneousTest, with_unique_names

INITIAL = 0.05
"""End of the range of Young's modulus, as nominal strain [-]."""
DROP = 0.2
"""Share of the largest stress that a broken specimen has lost [-]."""
BACK = 0.02
"""Share of its strain by which a specimen may spring back as it breaks [-]."""
FEWEST = 3
"""Smallest number of points for a regression."""


@dataclass(frozen=True)
class Measured:
    """A number with its standard uncertainty."""

    value: float
    sigma: float
    """Its standard uncertainty; NaN if unknown."""


@dataclass(frozen=True)
class Fracture:
    """Fracture of a specimen."""

    stress: float
    """Largest nominal stress [Pa]."""
    strain: float
    """Nominal strain at this stress [-]."""


@dataclass(frozen=True)
class Recovery:
    """One property of healed specimens against undamaged ones."""

    undamaged: Measured
    """Mean and its standard uncertainty."""
    healed: Measured
    """Mean and its standard uncertainty, healed."""
    efficiency: Measured
    """Healed value divided by undamaged value [-]."""


def youngs_modulus(strain: FloatArray, stress: FloatArray) -> Measured | None:
    """Slope of the regression line of stress over strain, |strain| <= `INITIAL`.

    ``strain``, ``stress``: nominal, with one sign convention [-] and [Pa], shape [n]. Returns: modulus [Pa]
    with the regression's standard error. None with fewer than `FEWEST` strains in the range.
    """
    inside = np.abs(strain) <= INITIAL * (1.0 + 1e-9)
    x, y = strain[inside], stress[inside]
    if np.unique(x).size < FEWEST:
        return None
    line = linregress(x, y)
    return Measured(float(line.slope), float(line.stderr))


def poissons_ratio(stretch: FloatArray, lateral: FloatArray) -> Measured | None:
    """Slope of -ln(lateral stretch) over ln(stretch) through rest [-], with its standard error.

    None with fewer than `FEWEST` points away from rest.
    """
    x, y = np.log(stretch), -np.log(lateral)
    away = x != 0.0
    if away.sum() < FEWEST:
        return None
    x, y = x[away], y[away]
    slope = float(x @ y / (x @ x))
    rest = y - slope * x
    return Measured(slope, float(np.sqrt(rest @ rest / (x.size - 1) / (x @ x))))


def fracture(strain: FloatArray, stress: FloatArray) -> Fracture | None:
    """Largest stress and its strain, if the stress then falls by the share `DROP`; otherwise None.

    The fall counts only if the strain has not decreased by more than `BACK`, because unloading is no
    fracture. Stress and strain are positive along the load, in the order of the test, shape [n].
    """
    top = int(np.argmax(stress))
    fallen = (stress[top:] <= (1.0 - DROP) * stress[top]) & (strain[top:] >= (1.0 - BACK) * strain[top])
    if not fallen.any():
        return None
    return Fracture(float(stress[top]), float(strain[top]))


def mean_of(values: Sequence[float]) -> Measured:
    """Mean of specimens and its standard uncertainty by their scatter; NaN for one specimen.

    Raises ValueError if there is none.
    """
    if not values:
        raise ValueError("a mean needs at least one specimen")
    x = np.asarray(values, dtype=float)
    sigma = float(x.std(ddof=1) / np.sqrt(x.size)) if x.size > 1 else float("nan")
    return Measured(float(x.mean()), sigma)


def recovery(undamaged: Sequence[float], healed: Sequence[float]) -> Recovery:
    """Healing efficiency of a property, with the standard uncertainty of the quotient to first order.

    The uncertainty is NaN if a group has a single specimen and therefore no scatter. Raises ValueError if a
    group is empty, or if the mean of the undamaged specimens is not positive.
    """
    before, after = mean_of(undamaged), mean_of(healed)
    if not before.value > 0.0:
        raise ValueError(f"the undamaged specimens' mean must be > 0, got {before.value:g}")
    ratio = after.value / before.value
    sigma = math.hypot(after.sigma, ratio * before.sigma) / before.value
    return Recovery(before, after, Measured(ratio, sigma))


@dataclass(frozen=True)
class Healing:
    """Properties of both groups and their recovery by healing."""

    undamaged: dict[str, dict[str, float]]
    """Specimens that were not cut: name -> property -> value in SI. Properties that a test does
    not determine are missing."""
    healed: dict[str, dict[str, float]]
    """Specimens that were cut and healed, in the same form."""
    units: dict[str, str]
    """Property -> SI unit, in the order of tables."""
    rows: dict[str, Recovery]
    """Property -> means and efficiency, for properties of both groups."""
    remarks: tuple[str, ...]


def _reason(name: str) -> str:
    """Reasons why a test may not determine a property, with the requirements."""
    if name == "Young's modulus to 5 %":
        return f"; at least {FEWEST} points are needed up to {100.0 * INITIAL:g} % strain"
    if name.startswith("fracture"):
        return f"; the stress must fall by {100.0 * DROP:g} % after its largest value"
    return ""


def healing(
    undamaged: Sequence[HomogeneousTest],
    healed: Sequence[HomogeneousTest],
    *,
    law: str = "neo_hookean",
    poisson: float | None = None,
) -> Healing:
    """Compare specimens that were cut and healed with undamaged ones.

    ``undamaged``, ``healed``: uniaxial tensile tests, one per specimen. ``law``: law of
    `explicit.materials.LAWS`; its constants are compared. ``poisson``: its Poisson's ratio at rest;
    incompressible if not given. Raises ValueError if a group is empty, or a test is not uniaxial tension.
    """
    if not undamaged or not healed:
        raise ValueError("a healing efficiency needs undamaged and healed specimens")
    made = [
        {test.name: _properties(test, law, poisson) for test in with_unique_names(group)}
        for group in (undamaged, healed)
    ]
    units = {"Young's modulus to 5 %": "Pa"}
    units |= {spec.name: spec.unit for spec in LAWS[law].PARAMETERS}
    if poisson is not None:
        units["D1"] = "1/Pa"
    units |= {"fracture stress": "Pa", "fracture strain": "1"}
    rows: dict[str, Recovery] = {}
    remarks: list[str] = []
    for name in units:
        before, after = ([one[name] for one in group.values() if name in one] for group in made)
        for group, seen, word in zip(made, (before, after), ("undamaged", "healed"), strict=True):
            lacking = [specimen for specimen, one in group.items() if name not in one]
            if lacking and seen:
                remarks.append(f"{word}: {', '.join(lacking)} shows no {name} and is not in its mean")
        if before and after and np.mean(before) > 0.0:
            rows[name] = recovery(before, after)
        elif not before or not after:
            words = [word for seen, word in ((before, "undamaged"), (after, "healed")) if not seen]
            remarks.append(
                f"{name} has no figure: no {' and no '.join(words)} specimen shows it{_reason(name)}"
            )
        else:
            remarks.append(f"{name} has no figure: the mean of the undamaged specimens is not above 0")
    for group, word in ((made[0], "undamaged"), (made[1], "healed")):
        if len(group) == 1:
            remarks.append(
                f"one {word} specimen: the scatter of {word} specimens is unknown, and so is the "
                "uncertainty of every efficiency"
            )
    return Healing(made[0], made[1], units, rows, tuple(remarks))


def _properties(test: HomogeneousTest, law: str, poisson: float | None) -> dict[str, float]:
    """Young's modulus, constants up to the fracture, and the fracture, as far as the test has them."""
    if test.mode is not Mode.UNIAXIAL or not test.strain.max() > 0.0:
        raise ValueError(f"{test.name} is not a uniaxial tensile test")
    values: dict[str, float] = {}
    modulus = youngs_modulus(test.strain, test.stress)
    if modulus is not None:
        values["Young's modulus to 5 %"] = modulus.value
    broke = fracture(test.strain, test.stress)
    top = int(np.argmax(test.stress)) + 1 if broke is not None else test.stress.size
    whole = HomogeneousTest(test.name, Mode.UNIAXIAL, test.deformation[:top], test.stress[:top])
    fit = fit_law(LAWS[law], [whole], poisson=poisson)
    values |= {name: fit.values[name] for name in fit.free if name in fit.values}
    if poisson is not None:
        values["D1"] = fit.D1
    if broke is not None:
        values |= {"fracture stress": broke.stress, "fracture strain": broke.strain}
    return values
