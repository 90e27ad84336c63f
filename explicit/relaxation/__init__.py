"""Rate-dependent response added to a hyperelastic law: Prony series and the Bergstrom-Boyce network."""

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
    "uniaxial_stress",
]
