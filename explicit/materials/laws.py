"""The closed-form laws by name. A new one is a line here."""

from explicit.materials.arrudaboyce import ArrudaBoyce
from explicit.materials.exponential import Humphrey, VerondaWestmann
from explicit.materials.gent import Gent
from explicit.materials.invariants import InvariantLaw
from explicit.materials.mooneyrivlin import MooneyRivlin
from explicit.materials.neohookean import NeoHookean
from explicit.materials.ogden import Ogden1, Ogden2, Ogden3
from explicit.materials.polynomial import Polynomial
from explicit.materials.stretches import StretchLaw
from explicit.materials.yeoh import ReducedPolynomial, Yeoh

AnyLaw = InvariantLaw | StretchLaw
"""A closed-form law: it has its constants, its energy by stretches, and all that the solver asks for."""

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
    """Look a law up by name.

    Raises
    ------
    ValueError
        If there is no such law; the message lists those there are.
    """
    if name not in LAWS:
        raise ValueError(f"law must be one of {sorted(LAWS)}, got {name!r}")
    return LAWS[name]
