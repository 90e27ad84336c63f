"""Subset matching by inverse-compositional Gauss-Newton, many points at once."""

from dic.correlation.match import Match
from dic.correlation.search import correlate
from dic.correlation.settings import Correlation
from dic.correlation.stack import Noise, PictureStack
from dic.correlation.templates import Templates
from dic.correlation.warp import Shape

__all__ = ["Correlation", "Match", "Noise", "PictureStack", "Shape", "Templates", "correlate"]
