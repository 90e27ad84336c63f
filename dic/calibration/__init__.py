"""Cameras and their poses from pictures of targets."""

from dic.calibration.bundle import Undetermined
from dic.calibration.solve import MODELS, calibrate
from dic.calibration.targets import TARGETS, Detection, Target, TargetNotFound
from dic.calibration.views import (
    Calibration,
    Checks,
    Pair,
    PairOutcome,
    PairView,
    detect,
    detection_begun,
)

__all__ = [
    "MODELS",
    "TARGETS",
    "Calibration",
    "Checks",
    "Detection",
    "Pair",
    "PairOutcome",
    "PairView",
    "Target",
    "TargetNotFound",
    "Undetermined",
    "calibrate",
    "detect",
    "detection_begun",
]
