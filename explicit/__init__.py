"""Explicit finite elements for impact on soft axisymmetric specimens, batch-first."""

from explicit.energy import EnergyLedger
from explicit.incompressible import NearlyIncompressible, run_nearly_incompressible
from explicit.mesh import Mesh, cylinder
from explicit.model import Model, Samples, Sampling, Stepping
from explicit.modules import ahead_of_time
from explicit.motion import PlatenMotion
from explicit.outcome import Ending, Outcome
from explicit.response import Response
from explicit.run import run
from explicit.support import RIGID, CharacteristicBar, MovingSupport

__all__ = [
    "RIGID",
    "CharacteristicBar",
    "Ending",
    "EnergyLedger",
    "Mesh",
    "Model",
    "MovingSupport",
    "NearlyIncompressible",
    "Outcome",
    "PlatenMotion",
    "Response",
    "Samples",
    "Sampling",
    "Stepping",
    "ahead_of_time",
    "cylinder",
    "run",
    "run_nearly_incompressible",
]
