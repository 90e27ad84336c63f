"""Two cameras: epipolar geometry, stereo match, triangulation, diagnosis."""

from dic.stereo.epipolar_search import StereoGates, StereoSearch
from dic.stereo.geometry import Triangulation, epipolar_distance, triangulate
from dic.stereo.match import Gate, StereoMatch, match_stereo
from dic.stereo.reconstruction import Reconstruction, calibration_sigma, calibration_slopes, reconstruct

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
    "reconstruct",
    "triangulate",
]
