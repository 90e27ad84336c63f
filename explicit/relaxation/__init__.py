"""Rate-dependent response added to a hyperelastic law: Prony series and the Bergstrom-Boyce network."""

from collections.abc import Sequence

from explicit.relaxation.base import RateDependence
from explicit.relaxation.bergstrom_boyce import BergstromBoyce, bergstrom_boyce_stress
from explicit.relaxation.prony import PronySeries, prony_stress, uniaxial_stress

RELAXATIONS: dict[str, type[RateDependence]] = {"prony": PronySeries, "bergstrom_boyce": BergstromBoyce}
"""Kinds of relaxation, by their names in a shot file."""

__all__ = [
    "RELAXATIONS",
    "BergstromBoyce",
    "PronySeries",
    "bergstrom_boyce_stress",
    "prony_stress",
    "relaxation_of",
    "uniaxial_stress",
]


def relaxation_of(kind: str, constants: Sequence[float]) -> RateDependence:
    """The relaxation of a kind in `RELAXATIONS`, from its constants; for a series, strengths, then times.

    Raises ValueError if the constants are not allowed.
    """
    if kind == "bergstrom_boyce":
        return BergstromBoyce(*constants)
    n = len(constants) // 2
    return PronySeries(tuple(constants[:n]), tuple(constants[n:]))
