"""Region of a body carried from the frame it is declared in to another, with proof that it shows the same.

The body is taken to move without turning: the pixels of the region are compared with every picture on the
way, shifted by whole pixels. The region is carried only if those in view correlate with the declared picture
in every frame, the last one among them.
"""

from dataclasses import replace

import numpy as np

from dic.arrays import FloatArray, IntArray
from dic.bodies.region import Region, polygon_mask
from dic.images import PictureError, Pictures
from dic.outcome import FrameOutcome

LEAST_ZNCC = 0.9
"""Least correlation of the region's pixels with the declared picture."""
FARTHEST = 6
"""Pixels that the body may move from frame to frame beyond its motion before, along either axis."""
ASIDE = 1
"""And across the axis."""
FEWEST = 400
"""Pixels of the region that must stay in view."""


def carry_region(
    pictures: Pictures, health: IntArray, region: Region, frame: int, *, direction: tuple[float, float]
) -> Region | None:
    """Carry a region to another frame by following what it shows.

    Parameters
    ----------
    pictures
        The series of camera 0.
    health
        `FrameOutcome` of its pictures, shape [n_frames].
    region
        Where the body is; its frame must be usable.
    frame
        Where it is wanted.
    direction
        Axis of the motion in the pictures (right, down).

    Returns
    -------
    Region or None
        None if the declared frame is not usable, or the body could not be followed.
    """
    if health[region.frame] != FrameOutcome.VALID:
        return None
    declared = pictures.frame(region.frame).astype(np.float64)
    y, x = np.nonzero(polygon_mask(region.corners, pictures.shape))
    along = np.array([abs(round(direction[0])), abs(round(direction[1]))])
    move, speed = np.zeros(2, dtype=np.int64), np.zeros(2, dtype=np.int64)
    step = 1 if frame > region.frame else -1
    for k in range(region.frame + step, frame + step, step):
        if health[k] != FrameOutcome.VALID:
            continue
        try:
            picture = pictures.frame(k).astype(np.float64)
        except PictureError:
            continue
        reach = np.where(along > 0, FARTHEST, ASIDE)
        tried = [
            move + speed + np.array([i, j])
            for i in range(-reach[0], reach[0] + 1)
            for j in range(-reach[1], reach[1] + 1)
        ]
        scores = [_zncc(declared, picture, x, y, shift) for shift in tried]
        best = int(np.argmax(scores))
        if scores[best] < LEAST_ZNCC:
            return None
        speed, move = tried[best] - move, tried[best]
    corners = np.asarray(region.corners) + move
    rows, columns = pictures.shape
    corners = np.clip(corners, 0.0, [columns - 1.0, rows - 1.0])
    return replace(region, corners=tuple((float(a), float(b)) for a, b in corners), frame=frame)


def _zncc(declared: FloatArray, picture: FloatArray, x: IntArray, y: IntArray, move: IntArray) -> float:
    """Correlation of the region's pixels with a picture in which they moved; -1 if too few are in view."""
    rows, columns = picture.shape
    u, v = x + move[0], y + move[1]
    seen = (u >= 0) & (u < columns) & (v >= 0) & (v < rows)
    if seen.sum() < FEWEST:
        return -1.0
    f, g = declared[y[seen], x[seen]], picture[v[seen], u[seen]]
    f, g = f - f.mean(), g - g.mean()
    scale = float(np.sqrt((f @ f) * (g @ g)))
    return float(f @ g) / scale if scale > 0.0 else -1.0
