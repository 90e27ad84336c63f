"""Neighbouring points: what they say about each other, and which lost points a frame tries again."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.correlation.warp import carried

NEAREST = 8
"""Neighbours looked for: those around a point of a square grid."""
REACH = 3.0
"""A neighbour farther than this many times the median distance of the nearest one is none."""


@dataclass(frozen=True)
class Neighbours:
    """The nearest points of every point in the material picture."""

    index: IntArray
    """Rows of the neighbours, nearest first, shape [n, k]; where `there` is False the point itself."""
    step: FloatArray
    """From the neighbours to the point [px], shape [n, k, 2]."""
    there: BoolArray
    """True where there is such a neighbour, shape [n, k]."""

    @cached_property
    def _across(self) -> FloatArray:
        """The steps' x and y, each in one piece, shape [2, n, k]."""
        return np.ascontiguousarray(np.moveaxis(self.step, -1, 0))

    @classmethod
    def of(cls, points: FloatArray) -> "Neighbours":
        """Neighbours of `points` (x, y) [px], shape [n, 2]."""
        n = len(points)
        k = min(NEAREST, n - 1)
        if k < 1:
            empty = np.zeros((n, 1), dtype=np.int64)
            return cls(empty, np.zeros((n, 1, 2)), np.zeros((n, 1), dtype=bool))
        distance, index = cKDTree(points).query(points, k=k + 1)
        # a point that coincides with another need not be its own nearest one
        own = index == np.arange(n)[:, None]
        own[~own.any(axis=1), -1] = True
        distance, index = distance[~own].reshape(n, k), index[~own].reshape(n, k)
        there = distance <= REACH * np.median(distance[:, 0])
        index = np.where(there, index, np.arange(n)[:, None])
        return cls(index, points[:, None, :] - points[index], there)

    def guesses(self, warp: FloatArray, rows: IntArray) -> FloatArray:
        """The warps that the neighbours of points `rows` suggest for them, shape [len(rows), k, 12]."""
        return carried(warp[self.index[rows]], self.step[rows])

    def best(self, warp: FloatArray, zncc: FloatArray, usable: BoolArray, rows: IntArray) -> FloatArray:
        """The warps that the neighbours with the best correlation suggest, shape [len(rows), 12].

        Parameters
        ----------
        warp
            Warps of all points, shape [n, 12].
        zncc
            Their correlations, shape [n].
        usable
            Which of them have been found, shape [n].
        rows
            Points with at least one neighbour among those.
        """
        index = self.index[rows]
        score = np.where(self.there[rows] & usable[index], zncc[index], -np.inf)
        pick = np.argmax(score, axis=1)
        here = np.arange(len(rows))
        return carried(warp[index[here, pick]], self.step[rows][here, pick])

    def any(self, usable: BoolArray) -> BoolArray:
        """Points that have a neighbour among the `usable` ones, shape [n]."""
        return np.asarray((self.there & usable[self.index]).any(axis=1))

    def votes(
        self, warp: FloatArray, usable: BoolArray, rows: IntArray, gate: float
    ) -> tuple[IntArray, IntArray]:
        """Number of neighbours that agree with the places of points `rows`.

        Parameters
        ----------
        warp, usable, rows
            As in `best`.
        gate
            Largest distance [px].

        Returns
        -------
        tuple
            Neighbours that agree, and neighbours that have been found, shape [len(rows)] each.
        """
        index = self.index[rows]
        x, y = self._across[:, rows]
        # column by column: half the time of rows of six numbers
        own, near = warp[rows, :2], [column[index] for column in np.ascontiguousarray(warp[:, :6].T)]
        u = near[0] + near[2] * x + near[3] * y - own[:, :1]
        v = near[1] + near[4] * x + near[5] * y - own[:, 1:]
        found = self.there[rows] & usable[index]
        agree = found & (u * u + v * v <= gate * gate)
        return np.count_nonzero(agree, axis=1), np.count_nonzero(found, axis=1)

    def agreeing(self, warp: FloatArray, usable: BoolArray, rows: IntArray, gate: float) -> BoolArray:
        """Points that lie where two of their neighbours put them, shape [len(rows)].

        Two, not most: at the border of two bodies most neighbours may belong to the other one. A point with
        fewer than three neighbours found has nobody to contradict it and agrees. Parameters as in `votes`.
        """
        votes, found = self.votes(warp, usable, rows, gate)
        return np.asarray((votes >= 2) | (found < 3))


TRIES = 4
"""Frames in a row in which a point is searched for before it is left alone for a while."""
EVERY = 8
"""From then on it is searched for in each such frame only, or as soon as a neighbour has come back."""


class RetrySchedule:
    """Schedule of retries of lost points: counts the frames for which each has been lost."""

    def __init__(self, n: int) -> None:
        self.lost = np.zeros(n, dtype=np.int64)
        """Frames with a picture since the point was found last, shape [n]."""

    @property
    def skipped(self) -> BoolArray:
        """Points that the next frame does not try, shape [n]."""
        return np.asarray((self.lost >= TRIES) & (self.lost % EVERY != 0))

    def add(self, valid: BoolArray, neighbours: Neighbours) -> None:
        """Take in which points a frame found, shape [n]."""
        back = valid & (self.lost > 0)
        self.lost = np.where(valid, 0, self.lost + 1)
        self.lost[~valid & neighbours.any(back)] = 0
