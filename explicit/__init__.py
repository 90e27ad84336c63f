"""Explicit finite elements for impact on soft axisymmetric specimens, batch-first."""

from explicit.energy import EnergyLedger
from explicit.outcome import Outcome
from explicit.response import Response

__all__ = ["EnergyLedger", "Outcome", "Response"]
