"""Subsets that reach past the end of a specimen, where its side rolls onto a platen and is seen no more."""

import numpy as np
from numpy.typing import NDArray

from dic.bodies import Followed
from dic.camera import Camera
from dic.outcome import PointOutcome
from dic.surfaces import SpecimenFrame

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MARGIN = 0.5
"""How far a subset stays inside the ends: about the width of an edge in a picture [px]."""


def past_the_ends(
    body: Followed,
    camera: Camera,
    frame: SpecimenFrame,
    subset: int,
    direction: tuple[float, float],
    ends: tuple[FloatArray, FloatArray],
) -> NDArray[np.bool_]:
    """Which valid points have a subset part of which is no longer seen.

    The part of a subset that its mask holds reaches so many pixels from the point toward either end in the
    material picture. Deformed with the point's own warp it must fit between the point and that end; where
    side surface has rolled onto the platen, it does not. What such a subset matches is partly the platen,
    and it is pulled along.

    Parameters
    ----------
    body
        The specimen, followed.
    camera
        Camera 0.
    frame
        The test frame.
    subset
        Side of the subsets [px].
    direction
        From the transmission platen toward the flyer in camera 0's picture (right, down).
    ends
        y of the lower and the upper end in every frame [m], each of shape [n_frames]; NaN where not known.

    Returns
    -------
    array of bool
        Shape [n_frames, n_points].
    """
    r = body.reconstruction
    toward = np.asarray(direction) / np.linalg.norm(direction)
    warp = body.tracks[0].warp
    gradient = np.eye(2) + warp[..., 2:6].reshape(*warp.shape[:2], 2, 2)
    stretch = np.einsum("i,fpij,j->fp", toward, gradient, toward)
    position = frame.positions(r.position)
    valid = r.outcome == PointOutcome.VALID
    scale = _pixels_per_metre(camera, frame, position, toward)
    past = np.zeros(valid.shape, dtype=bool)
    for side, end in zip((-1.0, 1.0), ends, strict=True):
        reach = _reach(body, side * toward, subset // 2)
        room = side * (end[:, None] - position[..., 1]) * scale
        with np.errstate(invalid="ignore"):  # no end, or no point: nothing is past it
            past |= valid & (stretch * reach > room - MARGIN)
    return past


def _reach(body: Followed, step: FloatArray, half: int) -> FloatArray:
    """How far each subset's mask reaches from its point along `step` [px], shape [n_points]."""
    rows, columns = body.mask.shape
    reach = np.full(len(body.points), 0.5)
    inside = np.ones(len(body.points), dtype=bool)
    for k in range(1, half + 1):
        x, y = np.round(body.points + k * step).astype(int).T
        here = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        inside &= here
        inside[inside] = body.mask[y[inside], x[inside]]
        reach[inside] = k + 0.5
    return reach


def _pixels_per_metre(
    camera: Camera, frame: SpecimenFrame, position: FloatArray, toward: FloatArray
) -> FloatArray:
    """Pixels along `toward` of a metre along y, at every point, shape [n_frames, n_points]."""
    small = 1e-5
    ahead = camera.project(frame.in_rig(position + np.array([0.0, small, 0.0])))
    return np.asarray((ahead - camera.project(frame.in_rig(position))) @ toward / small)
