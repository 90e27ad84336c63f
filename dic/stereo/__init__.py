"""Two cameras: which point is which, and where it is in space."""

from dic.stereo.diagnosis import Fault, Finding, diagnose
from dic.stereo.epipolar import epipolar_curve, epipolar_distance, epipolar_sigma
from dic.stereo.reconstruction import Reconstruction, reconstruct
from dic.stereo.systematic import calibration_sigma, calibration_slopes
from dic.stereo.triangulation import Triangulation, projection_error, triangulate

__all__ = [
    "Fault",
    "Finding",
    "Reconstruction",
    "Triangulation",
    "calibration_sigma",
    "calibration_slopes",
    "diagnose",
    "epipolar_curve",
    "epipolar_distance",
    "epipolar_sigma",
    "projection_error",
    "reconstruct",
    "triangulate",
]
