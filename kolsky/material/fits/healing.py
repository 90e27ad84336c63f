"""Recovery of a material's properties by healing: tensile tests to fracture, undamaged against healed.

The properties are those of Terryn et al. (2021, Table 3): Young's modulus by regression from 0 to 5 %, the
constants of a law fitted up to the fracture, with a Poisson's ratio also D1 = 2 / K, stress and strain of
fracture. A healing efficiency is a mean of healed specimens over a mean of undamaged ones.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from explicit.materials import LAWS
from kolsky.material.curves.properties import Recovery, fracture, recovery, youngs_modulus
from kolsky.material.fits.fit import fit_law
from kolsky.material.fits.homogeneous_test import HomogeneousTest
from kolsky.material.fits.modes import Mode


@dataclass(frozen=True)
class SpecimenProperties:
    """Properties of one specimen."""

    name: str
    """Its test."""
    values: dict[str, float]
    """Property -> value in SI; what a test does not show is missing."""


@dataclass(frozen=True)
class Healing:
    """Properties of both groups and what healing recovered."""

    undamaged: tuple[SpecimenProperties, ...]
    """Specimens that were not cut."""
    healed: tuple[SpecimenProperties, ...]
    """Specimens that were cut and healed."""
    units: dict[str, str]
    """Property -> SI unit, in the order of tables."""
    rows: dict[str, Recovery]
    """Property -> means and efficiency; those that both groups show."""
    remarks: tuple[str, ...]
    """What a reader must know."""


def healing(
    undamaged: Sequence[HomogeneousTest],
    healed: Sequence[HomogeneousTest],
    *,
    law: str = "neo_hookean",
    poisson: float | None = None,
) -> Healing:
    """Compare specimens that were cut and healed with undamaged ones.

    Parameters
    ----------
    undamaged, healed
        Uniaxial tensile tests, one a specimen.
    law
        Law of `explicit.materials.LAWS` whose constants are compared.
    poisson
        Its Poisson's ratio at rest; incompressible if not given.

    Raises
    ------
    ValueError
        If a group is empty, or a test is none of uniaxial tension.
    """
    if not undamaged or not healed:
        raise ValueError("a healing efficiency needs undamaged and healed specimens")
    made = [[_properties(test, law, poisson) for test in group] for group in (undamaged, healed)]
    units = {"Young's modulus to 5 %": "Pa"}
    units |= {spec.name: spec.unit for spec in LAWS[law].PARAMETERS}
    if poisson is not None:
        units["D1"] = "1/Pa"
    units |= {"fracture stress": "Pa", "fracture strain": "1"}
    rows: dict[str, Recovery] = {}
    remarks: list[str] = []
    for name in units:
        before, after = ([one.values[name] for one in group if name in one.values] for group in made)
        for group, seen, word in zip(made, (before, after), ("undamaged", "healed"), strict=True):
            lacking = [one.name for one in group if name not in one.values]
            if lacking and seen:
                remarks.append(f"{word}: {', '.join(lacking)} shows no {name} and is not in its mean")
        if before and after and np.mean(before) > 0.0:
            rows[name] = recovery(before, after)
    for group, word in ((made[0], "undamaged"), (made[1], "healed")):
        if len(group) == 1:
            remarks.append(
                f"one {word} specimen: how {word} specimens differ is unknown, and so is the uncertainty of"
                " every efficiency"
            )
    return Healing(tuple(made[0]), tuple(made[1]), units, rows, tuple(remarks))


def _properties(test: HomogeneousTest, law: str, poisson: float | None) -> SpecimenProperties:
    """Young's modulus, constants up to the fracture, and the fracture, as far as a test shows them."""
    if test.mode is not Mode.UNIAXIAL or not test.strain.max() > 0.0:
        raise ValueError(f"{test.name} is no uniaxial tensile test")
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
    return SpecimenProperties(test.name, values)
