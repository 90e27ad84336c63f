"""Subset matching by inverse-compositional Gauss-Newton, many points at once."""

from dic.correlation.search import correlate
from dic.correlation.settings import Correlation, Match, Templates
from dic.correlation.stack import Noise, PictureStack
from dic.correlation.warp import Shape

__all__ = ["Correlation", "Match", "Noise", "PictureStack", "Shape", "Templates", "correlate"]
