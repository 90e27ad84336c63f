"""Pictures to surfaces: what stereo image correlation measured, with a sigma and an outcome per point."""

from dic.camera import Camera, StereoRig
from dic.outcome import FrameOutcome, PointOutcome
from dic.surfaces.surface_history import CentrePoints, SurfaceHistory, centre_line

__all__ = [
    "Camera",
    "CentrePoints",
    "FrameOutcome",
    "PointOutcome",
    "StereoRig",
    "SurfaceHistory",
    "centre_line",
]
