"""The closed-form laws by name. A new law needs one line here."""

from explicit.materials.families import InvariantLaw, StretchLaw
from explicit.materials.laws.ogden import Ogden1, Ogden2, Ogden3
from explicit.materials.laws.polynomial import MooneyRivlin, NeoHookean, Polynomial, ReducedPolynomial, Yeoh
from explicit.materials.laws.stiffening import ArrudaBoyce, Gent, Humphrey, VerondaWestmann

AnyLaw = InvariantLaw | StretchLaw
"""A closed-form law with its constants, its energy by stretches, and the interface to the solver."""

LAWS: dict[str, type[AnyLaw]] = {
    law.NAME: law
    for law in (
        NeoHookean,
        MooneyRivlin,
        Polynomial,
        ReducedPolynomial,
        Yeoh,
        Ogden1,
        Ogden2,
        Ogden3,
        ArrudaBoyce,
        Gent,
        VerondaWestmann,
        Humphrey,
    )
}


def law_class(name: str) -> type[AnyLaw]:
    """Find a law by name; raises ValueError with the valid names if there is none."""
    if name not in LAWS:
        raise ValueError(f"law must be one of {sorted(LAWS)}, got {name!r}")
    return LAWS[name]
