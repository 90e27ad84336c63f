"""Which dot is which: a lattice grown from dots whose place in it is known."""

from collections import deque

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

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
    local = {place: np.array(steps, dtype=np.float64) for place in places}
    queue = deque(places)
    while queue:
        column, row = place = queue.popleft()
        here, own = points[places[place]], local[place]
        sides = [
            (axis, sign, beside)
            for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1))
            if (beside := (column + sign * (axis == 0), row + sign * (axis == 1))) not in places
        ]
        if not sides:
            continue
        near = NEAR * np.sqrt(np.min(np.sum(own * own, axis=1)))
        distances, numbers = tree.query(here + np.array([sign * own[axis] for axis, sign, _ in sides]))
        for (axis, sign, beside), distance, found in zip(
            sides, distances.tolist(), numbers.tolist(), strict=True
        ):
            if distance > near or found in used:
                continue
            places[beside] = found
            used.add(found)
            next_steps = own.copy()
            next_steps[axis] = 0.5 * (own[axis] + sign * (points[found] - here))
            local[beside] = next_steps
            queue.append(beside)
    return places


def homography_outliers(index: FloatArray, points: FloatArray, limit: float) -> NDArray[np.bool_]:
    """Which points are off a plane lattice seen in perspective by more than `limit` steps, shape [n].

    Parameters
    ----------
    index
        Lattice places, shape [n, 2].
    points
        Dots in the picture [px], shape [n, 2].
    limit
        Allowed distance from the fitted homography, in steps of the lattice.
    """
    import cv2

    if len(points) < 8:
        return np.zeros(len(points), dtype=bool)
    cv2.setRNGSeed(1)  # the same picture gives the same answer
    H, _ = cv2.findHomography(points, index, cv2.LMEDS)
    if H is None:
        return np.ones(len(points), dtype=bool)
    there = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ H.T
    off = np.hypot(*(there[:, :2] / there[:, 2:] - index).T)
    return np.asarray(~(off <= limit))
