"""Two cameras: which point is which, and where it is in space."""

from dic.stereo.diagnose import Fault, Finding, diagnose
from dic.stereo.epipolar import epipolar_curve, epipolar_distance, epipolar_sigma
from dic.stereo.gates import Gate
from dic.stereo.match import StereoMatch, match_stereo
from dic.stereo.reconstruct import reconstruct
from dic.stereo.reconstruction import Reconstruction
from dic.stereo.settings import StereoGates, StereoSearch
from dic.stereo.systematic import calibration_sigma, calibration_slopes
from dic.stereo.triangulate import Triangulation, projection_error, triangulate

__all__ = [
    "Fault",
    "Finding",
    "Gate",
    "Reconstruction",
    "StereoGates",
    "StereoMatch",
    "StereoSearch",
    "Triangulation",
    "calibration_sigma",
    "calibration_slopes",
    "diagnose",
    "epipolar_curve",
    "epipolar_distance",
    "epipolar_sigma",
    "match_stereo",
    "projection_error",
    "reconstruct",
    "triangulate",
]
