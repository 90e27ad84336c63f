"""Calibration targets, one file each; a new one is its file and one line of `TARGETS`."""

from dic.calibration.targets.base import Detection, Geometry, Target, TargetNotFound
from dic.calibration.targets.fiducial_dots import FiducialDots

__all__ = ["TARGETS", "Detection", "FiducialDots", "Geometry", "Target", "TargetNotFound"]

TARGETS: dict[str, type] = {"fiducial_dots": FiducialDots}
"""Every target by the name that files call it."""
