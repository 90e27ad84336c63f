"""Calibration targets, one module each. To add one, write its module and add one line to `TARGETS`."""

from dic.calibration.targets.asymmetric_dots import AsymmetricDots
from dic.calibration.targets.base import Detection, Geometry, Target, TargetNotFound
from dic.calibration.targets.charuco import Charuco
from dic.calibration.targets.chessboard import Chessboard
from dic.calibration.targets.dotted_cylinder import DottedCylinder
from dic.calibration.targets.fiducial_dots import FiducialDots

__all__ = [
    "TARGETS",
    "AsymmetricDots",
    "Charuco",
    "Chessboard",
    "Detection",
    "DottedCylinder",
    "FiducialDots",
    "Geometry",
    "Target",
    "TargetNotFound",
]

TARGETS: dict[str, type] = {
    "chessboard": Chessboard,
    "charuco": Charuco,
    "fiducial_dots": FiducialDots,
    "asymmetric_dots": AsymmetricDots,
    "dotted_cylinder": DottedCylinder,
}
"""All targets by their names in files."""
