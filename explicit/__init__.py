"""Explicit finite elements for impact on soft axisymmetric specimens, batch-first."""

from explicit.energy import EnergyLedger
from explicit.incompressible import NearlyIncompressible, run_nearly_incompressible
from explicit.mesh import Mesh, cylinder
from explicit.model import Model, Samples, Sampling, Stepping
from explicit.motion import PlatenMotion
from explicit.outcome import Outcome
from explicit.response import Response
from explicit.run import run
from explicit.support import RIGID, CharacteristicBar

__all__ = [
    "RIGID",
    "CharacteristicBar",
    "EnergyLedger",
    "Mesh",
    "Model",
    "NearlyIncompressible",
    "Outcome",
    "PlatenMotion",
    "Response",
    "Samples",
    "Sampling",
    "Stepping",
    "cylinder",
    "run",
    "run_nearly_incompressible",
]
