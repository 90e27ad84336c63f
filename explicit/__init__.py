"""Explicit finite elements for impact on soft axisymmetric specimens, batch-first."""

from explicit.energy import EnergyLedger
from explicit.mesh import Mesh, cylinder
from explicit.model import Model, Samples, Sampling, Stepping
from explicit.motion import PlatenMotion
from explicit.outcome import Ending, Outcome
from explicit.response import Response
from explicit.run import run
from explicit.support import RIGID, CharacteristicBar

__all__ = [
    "RIGID",
    "CharacteristicBar",
    "Ending",
    "EnergyLedger",
    "Mesh",
    "Model",
    "Outcome",
    "PlatenMotion",
    "Response",
    "Samples",
    "Sampling",
    "Stepping",
    "cylinder",
    "run",
]
