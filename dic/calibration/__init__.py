"""Cameras and their poses from pictures of targets."""

from dic.calibration.detect import detect, detect_series, detection_begun
from dic.calibration.result import Calibration, Checks, Pair, PairOutcome, PairView
from dic.calibration.rig_state import Undetermined
from dic.calibration.solve import MODELS, calibrate
from dic.calibration.targets import TARGETS, Detection, Target, TargetNotFound

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
    "detect_series",
    "detection_begun",
]
