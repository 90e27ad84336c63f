"""Numbering of dots: a lattice grown from dots whose place in it is known."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dic.arrays import FloatArray

SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1))
"""Columns and rows to the neighbours of a place."""
NEAR = 0.3
"""A dot belongs to a lattice place if it lies this close to where it is expected [steps]."""


def grow(
    points: FloatArray, seeds: dict[int, tuple[int, int]], steps: FloatArray
) -> dict[tuple[int, int], int]:
    """Lattice places of points, found outward from some whose place is known.

    A neighbour is expected one step further; the step of a place is that of the place it was reached from,
    corrected by what was found, so that perspective, lens distortion and a curved board are followed.
    The places nearest to their expectation are taken first, each point once.

    Parameters
    ----------
    points
        Dots in the picture [px], shape [n, 2].
    seeds
        Point number -> its place (column, row).
    steps
        From a seed to its neighbour in the next column and in the next row [px], shape [2, 2].

    Returns
    -------
    dict
        Place -> point number.
    """
    tree = cKDTree(points)
    places = {place: number for number, place in seeds.items()}
    used = set(seeds)
    rim, local = list(places), np.tile(np.asarray(steps, dtype=np.float64), (len(places), 1, 1))
    while rim:
        here = points[[places[place] for place in rim]]
        near = NEAR * np.sqrt(np.min(np.sum(local * local, axis=2), axis=1))
        distances, numbers = tree.query(here[:, None] + np.stack([local, -local], axis=2).reshape(-1, 4, 2))
        fits, found = (distances <= near[:, None]).tolist(), numbers.tolist()
        reached: list[tuple[int, int]] = []
        origins: list[tuple[int, int]] = []
        for k, (column, row) in enumerate(rim):
            for side, (right, down) in enumerate(SIDES):
                beside = (column + right, row + down)
                if beside in places or not fits[k][side] or found[k][side] in used:
                    continue
                places[beside] = found[k][side]
                used.add(found[k][side])
                reached.append(beside)
                origins.append((k, side))
        if not reached:
            break
        k, side = np.array(origins).T
        local, axis, sign = local[k], side // 2, 1.0 - 2.0 * (side % 2)
        step = sign[:, None] * (points[[places[place] for place in reached]] - here[k])
        own = np.arange(len(k))
        local[own, axis] = 0.5 * (local[own, axis] + step)
        rim = reached
    return places


def homography_outliers(index: FloatArray, points: FloatArray, limit: float) -> NDArray[np.bool_]:
    """Points off a plane lattice seen in perspective by more than `limit` steps, shape [n].

    Parameters
    ----------
    index
        Lattice places, shape [n, 2].
    points
        Dots in the picture [px], shape [n, 2].
    limit
        Allowed distance from the fitted homography, in steps of the lattice.
    """
    from dic.opencv import cv2

    if len(points) < 8:
        return np.zeros(len(points), dtype=bool)
    cv2.setRNGSeed(1)  # the same picture gives the same answer
    H, _ = cv2.findHomography(points, index, cv2.LMEDS)
    if H is None:
        return np.ones(len(points), dtype=bool)
    there = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ H.T
    off = np.hypot(*(there[:, :2] / there[:, 2:] - index).T)
    return np.asarray(~(off <= limit))
