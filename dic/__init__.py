"""Pictures to surfaces: what stereo image correlation measured, with a sigma and an outcome per point."""

from dic.outcome import PointOutcome
from dic.surface import CentrePoints, SurfaceHistory, centre_line

__all__ = ["CentrePoints", "PointOutcome", "SurfaceHistory", "centre_line"]
