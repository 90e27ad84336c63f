"""Where points will be in the next frame."""

import numpy as np

from dic.arrays import FloatArray, IntArray

ORDERS = (0, 1, 2)
"""At rest, constant velocity, constant acceleration."""
JURY = 300
"""Points that decide about the order, about."""
PARTS = (slice(0, 2), slice(2, 6), slice(6, 12))
"""Displacement, its first and its second derivatives: the noisier, the lower the order that serves."""


class Predictor:
    """Extrapolates the warps of the last three frames in which each point was found.

    The order of the extrapolation is that which would have foretold the last frame best, by the median over
    the points, for displacements and their derivatives each: a series that starts from rest, moves steadily
    or is shaken chooses its own. A point with too short a past takes the highest order it has.
    """

    def __init__(self, n: int) -> None:
        self.frame = np.zeros((3, n), dtype=np.int64)
        """Latest first, shape [3, n]."""
        self.warp = np.zeros((3, n, 12))
        """Warps in those frames, shape [3, n, 12]."""
        self.known = np.zeros(n, dtype=np.int64)
        """How many of them are filled, shape [n]."""
        self.order = [0] * len(PARTS)
        """Order in use for each of `PARTS`."""
        self._foretold: dict[int, FloatArray] = {}

    def predict(self, frame: int) -> FloatArray:
        """Warps expected in `frame`, shape [n, 12]; those of a point never found are zero."""
        self._foretold = {order: self._extrapolated(frame, order) for order in ORDERS}
        guess = np.empty_like(self.warp[0])
        for part, order in zip(PARTS, self.order, strict=True):
            guess[:, part] = self._foretold[order][:, part]
        return guess

    def add(self, frame: int, rows: IntArray, warp: FloatArray) -> None:
        """Take in that points `rows` were found in `frame` with these warps, shape [len(rows), 12]."""
        highest = min(int(np.max(self.known[rows], initial=0)) - 1, max(ORDERS))
        if self._foretold and highest > 0:
            past = np.flatnonzero(self.known[rows] > highest)
            past = past[:: max(len(past) // JURY, 1)]
            found = warp[past]
            foretold = np.stack([self._foretold[k][rows[past]] for k in ORDERS[: highest + 1]])
            off = np.abs(foretold - found)
            for k, part in enumerate(PARTS):
                self.order[k] = int(np.argmin(np.median(off[..., part].max(axis=-1), axis=-1)))
        self._foretold = {}
        again = (self.known[rows] > 0) & (self.frame[0, rows] == frame)  # a first guess, now found
        later = rows[~again]
        for kept in (self.frame, self.warp):
            kept[1:, later] = kept[:-1, later]
        self.frame[0, rows], self.warp[0, rows] = frame, warp
        self.known[later] = np.minimum(self.known[later] + 1, 3)

    def _extrapolated(self, frame: int, order: int) -> FloatArray:
        """Lagrange's polynomial through the latest `order` + 1 frames of each point, at `frame`."""
        result = self.warp[0].copy()
        for reach in range(1, order + 1):
            rows = np.flatnonzero(np.minimum(self.known - 1, order) == reach)
            times = self.frame[: reach + 1, rows].astype(np.float64)
            total = np.zeros((len(rows), 12))
            for j in range(reach + 1):
                weight = np.ones(len(rows))
                for i in range(reach + 1):
                    if i != j:
                        weight *= (frame - times[i]) / (times[j] - times[i])
                total += weight[:, None] * self.warp[j, rows]
            result[rows] = total
        return result
