"""Rate-dependent response beside a hyperelastic law: Prony series and the Bergstrom-Boyce network."""

from explicit.relaxation.bergstrom_boyce import BergstromBoyce, bergstrom_boyce_stress
from explicit.relaxation.prony import PronySeries
from explicit.relaxation.uniaxial import prony_stress, uniaxial_stress

__all__ = ["BergstromBoyce", "PronySeries", "bergstrom_boyce_stress", "prony_stress", "uniaxial_stress"]
