"""Measurement from two series of pictures and their cameras to surfaces.

`stages.measure` has its stages in the order of the work; each is a module beside it.
"""

from dic.chain.inspect_images import Inspection, inspect_pictures
from dic.chain.settings import DIRECTIONS, ChainError, ChainSettings
from dic.chain.stages import VERSION, measure

__all__ = [
    "DIRECTIONS",
    "VERSION",
    "ChainError",
    "ChainSettings",
    "Inspection",
    "inspect_pictures",
    "measure",
]
