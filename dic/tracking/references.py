"""Which picture each point is compared with, and what the changes of it cost.

A point's references form a chain. Its root is the material picture (or the frame that tracking starts from);
every later reference is a frame in which the point was found, with the total warp found there. Since the
template of reference B is sampled at the very places where the match A → B ended, T_B(ξ) = g_B(W_B(ξ)), the
noise of picture B enters the match A → B and the match B → C with opposite signs::

    Σ ∇T_A (T_A − T_B) = 0  and  Σ ∇T_B (T_B − T_C) = 0   give   Σ ∇T (T_A − T_C) ≈ 0

so that to first order the chain has the error of the one match A → C. What is carried along a chain is
therefore the part of the covariance that comes from the root's template, mapped by the deformation since, and
of each match only the part that comes from the picture searched in, plus a share `RESIDUE` of it for every
change of reference, where the gradients of the two templates differ.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.correlation import PictureStack
from dic.tracking.frames import Picture

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

DEPTH = 8
"""References kept of a point: the root and the latest ones."""


def gradient(warp: FloatArray) -> FloatArray:
    """Deformation gradient F = I + ∇(u, v) of warps at the point itself, shape [..., 2, 2]."""
    return np.asarray(warp[..., 2:6].reshape(*warp.shape[:-1], 2, 2) + np.eye(2))


def relative(warp: FloatArray, reference_warp: FloatArray) -> FloatArray:
    """Deformation gradient since the reference, F F_ref⁻¹, shape [..., 2, 2]."""
    return np.asarray(gradient(warp) @ np.linalg.inv(gradient(reference_warp)))


def stretch(F: FloatArray) -> FloatArray:
    """The larger of the largest principal stretch and the inverse of the smallest [-], shape [...]."""
    total = np.sum(F * F, axis=(-2, -1))
    area = np.abs(np.linalg.det(F))
    root = np.sqrt(np.maximum(total + 2.0 * area, 0.0))
    gap = np.sqrt(np.maximum(total - 2.0 * area, 0.0))
    largest, smallest = (root + gap) / 2.0, (root - gap) / 2.0
    return np.asarray(np.maximum(largest, 1.0 / np.maximum(smallest, 1e-12)))


@dataclass(frozen=True)
class Template:
    """What points are compared with: pictures by frame, and where the points lie in them."""

    frame: IntArray
    """Frames of the references, shape [m]."""
    warp: FloatArray
    """Total warps there, shape [m, 12]."""
    before: FloatArray
    """Covariance that the chain of references carries [px²], shape [m, 2, 2]."""
    root: BoolArray
    """Whether the reference is the root of its chain, shape [m]."""

    def take(self, rows: IntArray) -> "Template":
        """Those of some points."""
        return Template(self.frame[rows], self.warp[rows], self.before[rows], self.root[rows])

    def put(self, rows: IntArray, other: "Template") -> None:
        """Overwrite those of points `rows` in place."""
        self.frame[rows], self.warp[rows] = other.frame, other.warp
        self.before[rows], self.root[rows] = other.before, other.root


class References:
    """The chains of n points and the pictures that they use."""

    def __init__(self, n: int) -> None:
        self.level = np.zeros(n, dtype=np.int64)
        """Place of the current reference in the chain, 0 the root, shape [n]."""
        self._frame = np.zeros((DEPTH, n), dtype=np.int64)
        self._warp = np.zeros((DEPTH, n, 12))
        self._before = np.zeros((DEPTH, n, 2, 2))
        self._own_root = True
        self.stacks: dict[int, PictureStack] = {}
        """Prepared pictures by frame."""
        self.pictures: dict[int, Picture] = {}
        """The same as recorded, for the search."""

    def add(self, frame: int, picture: Picture, stack: PictureStack) -> None:
        """Keep a picture that points may take as their reference."""
        self.stacks[frame], self.pictures[frame] = stack, picture

    def root(self, frame: int, warp: FloatArray, before: FloatArray) -> None:
        """Start all chains at `frame`, with total warps [n, 12] and covariances [px², n, 2, 2] there."""
        self.level[:] = 0
        self._frame[0], self._warp[0], self._before[0] = frame, warp, before

    def start_from(self, before: FloatArray) -> None:
        """Say that the root itself was found by a match, which the chain carries `before` of [px²], [n, 2, 2]."""
        self._before[0], self._own_root = before, False

    def template(self, rows: IntArray, back: int = 0) -> Template:
        """References of points `rows`, or those `back` steps earlier in their chains."""
        level = self.level[rows] - back
        return Template(
            self._frame[level, rows],
            self._warp[level, rows],
            self._before[level, rows],
            (level == 0) & self._own_root,
        )

    def renew(self, rows: IntArray, frame: IntArray | int, warp: FloatArray, before: FloatArray) -> None:
        """Give points `rows` a new reference; the oldest but the root is forgotten in a full chain."""
        full = rows[self.level[rows] == DEPTH - 1]
        for kept in (self._frame, self._warp, self._before):
            kept[1:-1, full] = kept[2:, full]
        self.level[full] -= 1
        self.level[rows] += 1
        level = self.level[rows]
        self._frame[level, rows], self._warp[level, rows], self._before[level, rows] = frame, warp, before

    def go_back(self, rows: IntArray) -> None:
        """Return points `rows` to the reference before."""
        self.level[rows] -= 1

    def tidy(self, keep: int) -> None:
        """Let go of the pictures that no chain uses any more, other than frame `keep`."""
        used = {keep}
        for level in range(DEPTH):
            used.update(np.unique(self._frame[level, self.level >= level]).tolist())
        for frame in [frame for frame in self.stacks if frame not in used]:
            del self.stacks[frame], self.pictures[frame]
