"""Which lost points a frame tries again: a point that is out of sight for good costs a frame the most."""

import numpy as np

from dic.arrays import BoolArray
from dic.tracking.neighbours import Neighbours

TRIES = 4
"""Frames in a row in which a point is searched for before it is left alone for a while."""
EVERY = 8
"""From then on it is searched for in each such frame only, or as soon as a neighbour has come back."""


class Patience:
    """Counts the frames for which n points have been lost."""

    def __init__(self, n: int) -> None:
        self.lost = np.zeros(n, dtype=np.int64)
        """Frames with a picture since the point was found last, shape [n]."""

    @property
    def asleep(self) -> BoolArray:
        """Points that the next frame leaves alone, shape [n]."""
        return np.asarray((self.lost >= TRIES) & (self.lost % EVERY != 0))

    def add(self, valid: BoolArray, neighbours: Neighbours) -> None:
        """Take in which points a frame found, shape [n]."""
        back = valid & (self.lost > 0)
        self.lost = np.where(valid, 0, self.lost + 1)
        self.lost[~valid & neighbours.any(back)] = 0
