"""Two cameras: epipolar geometry, stereo match, triangulation, diagnosis."""

from dic.stereo.epipolar import epipolar_distance
from dic.stereo.gates import Gate
from dic.stereo.match import StereoMatch, match_stereo
from dic.stereo.reconstruction import Reconstruction, reconstruct
from dic.stereo.settings import StereoGates, StereoSearch
from dic.stereo.systematic import calibration_sigma, calibration_slopes
from dic.stereo.triangulation import Triangulation, projection_error, triangulate

__all__ = [
    "Gate",
    "Reconstruction",
    "StereoGates",
    "StereoMatch",
    "StereoSearch",
    "Triangulation",
    "calibration_sigma",
    "calibration_slopes",
    "epipolar_distance",
    "match_stereo",
    "projection_error",
    "reconstruct",
    "triangulate",
]
