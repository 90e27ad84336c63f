"""Protocol of calibration targets, their checks, and the numbering of dots by a growing lattice."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dic.basics import FloatArray, IntArray


class TargetNotFound(ValueError):
    """A target could not be recognised in a picture; the text describes what was found."""


@dataclass(frozen=True)
class Detection:
    """Points of a target in one picture."""

    ids: IntArray
    """Numbers of the target's points, shape [n]."""
    pixels: FloatArray
    """Observed pixels [px], shape [n, 2]."""
    sigma: FloatArray
    """Standard deviation of a coordinate from the picture's noise [px], shape [n]."""

    def __post_init__(self) -> None:
        n = len(self.ids)
        if self.pixels.shape != (n, 2) or self.sigma.shape != (n,):
            raise ValueError(
                f"{n} ids need pixels [{n}, 2] and sigma [{n}], got {self.pixels.shape}, {self.sigma.shape}"
            )
        if len(np.unique(self.ids)) != n:
            raise ValueError("a point of a target can be seen once in a picture; ids hold one twice")
        if not (np.all(np.isfinite(self.pixels)) and np.all(self.sigma > 0.0)):
            raise ValueError("pixels must be finite and sigma positive")


@dataclass(frozen=True)
class Geometry:
    """A target's points in its frame, with the data needed for the calibration."""

    points: FloatArray
    """Positions [m], shape [n, 3]."""
    normals: FloatArray
    """Outward unit normals of the surface, shape [n, 3]; used where `spread` is not zero."""
    spread: FloatArray
    """Second moment per axis of the patch whose centroid is the point [m²], shape [n]. It is taken in the
    surface: r²/4 for a disc, zero for a corner."""
    bend: FloatArray
    """Direction of the surface's curvature times the root of the curvature [m^-½], shape [n, 3]; zero if
    flat."""
    equivalents: IntArray
    """Equivalent numberings, the identity first, shape [m, n]."""


@runtime_checkable
class Target(Protocol):
    """A calibration target: a frozen dataclass with its dimensions in metres."""

    def geometry(self) -> Geometry:
        """Its points."""

    def detect(self, picture: NDArray[np.generic]) -> Detection:
        """Its points in a picture.

        Raises TargetNotFound if it is not found, or its points cannot be numbered.
        """


def positive(**lengths: float) -> None:
    """Reject lengths that are not positive and finite. Raises ValueError; its message names the length."""
    for name, value in lengths.items():
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} must be a positive length in metres, got {value}")


def counts(least: int, **numbers: int) -> None:
    """Reject numbers of columns or rows outside `least` to 1000.

    Raises ValueError; its message names the number.
    """
    for name, value in numbers.items():
        if not (isinstance(value, int) and least <= value <= 1000):
            raise ValueError(f"{name} must be a whole number from {least} to 1000, got {value}")


SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1))
"""Columns and rows to the neighbours of a place."""
NEAR = 0.3
"""Largest distance of a dot from the predicted position of its lattice place [steps]."""


def grow(
    points: FloatArray, seeds: dict[int, tuple[int, int]], steps: FloatArray
) -> dict[tuple[int, int], int]:
    """Lattice places of points, found outward from seeds with known places.

    A neighbour is predicted one step further. The step of a place is that of the previous place, corrected by
    the measured position. It adapts to perspective, lens distortion and a curved board. The points nearest to
    their predictions are assigned first, each point once.

    ``points``: dots in the picture [px], shape [n, 2]. ``seeds``: point number -> its place (column, row).
    ``steps``: from a seed to its neighbour in the next column and in the next row [px], shape [2, 2].
    Returns: place -> point number.
    """
    tree = cKDTree(points)
    places = {place: number for number, place in seeds.items()}
    used = set(seeds)
    rim, local = list(places), np.tile(np.asarray(steps, dtype=np.float64), (len(places), 1, 1))
    while rim:
        rim_points = points[[places[place] for place in rim]]
        near = NEAR * np.sqrt(np.min(np.sum(local * local, axis=2), axis=1))
        distances, numbers = tree.query(
            rim_points[:, None] + np.stack([local, -local], axis=2).reshape(-1, 4, 2)
        )
        fits, candidates = (distances <= near[:, None]).tolist(), numbers.tolist()
        reached: list[tuple[int, int]] = []
        origins: list[tuple[int, int]] = []
        for k, (column, row) in enumerate(rim):
            for side, (right, down) in enumerate(SIDES):
                neighbour = (column + right, row + down)
                if neighbour in places or not fits[k][side] or candidates[k][side] in used:
                    continue
                places[neighbour] = candidates[k][side]
                used.add(candidates[k][side])
                reached.append(neighbour)
                origins.append((k, side))
        if not reached:
            break
        k, side = np.array(origins).T
        local, axis, sign = local[k], side // 2, 1.0 - 2.0 * (side % 2)
        step = sign[:, None] * (points[[places[place] for place in reached]] - rim_points[k])
        indices = np.arange(len(k))
        local[indices, axis] = 0.5 * (local[indices, axis] + step)
        rim = reached
    return places


def homography_outliers(index: FloatArray, points: FloatArray, limit: float) -> NDArray[np.bool_]:
    """True for points that deviate from a plane lattice in perspective by more than `limit` steps, shape [n].

    ``index``: lattice places, shape [n, 2]. ``points``: dots in the picture [px], shape [n, 2]. ``limit``:
    allowed distance from the fitted homography, in steps of the lattice.
    """
    from dic.basics import cv2

    if len(points) < 8:
        return np.zeros(len(points), dtype=bool)
    cv2.setRNGSeed(1)  # the same picture gives the same answer
    H, _ = cv2.findHomography(points, index, cv2.LMEDS)
    if H is None:
        return np.ones(len(points), dtype=bool)
    projected = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ H.T
    off = np.hypot(*(projected[:, :2] / projected[:, 2:] - index).T)
    return np.asarray(~(off <= limit))
