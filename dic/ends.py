"""The ends of a specimen: where they are at rest, and which subsets reach past one as the side rolls."""

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.bodies import Followed
from dic.camera import Camera, StereoRig
from dic.edge import find_edge
from dic.outcome import PointOutcome
from dic.surfaces import Cylinder, SpecimenFrame

MARGIN = 0.5
"""How far a subset stays inside the ends: about the width of an edge in a picture [px]."""


DECLARED = 0.5
"""Standard deviation of a place that was read off a picture [px]."""


def refined_end(
    pictures: tuple[FloatArray, FloatArray],
    rig: StereoRig,
    cylinder: Cylinder,
    declared: FloatArray,
    direction: tuple[float, float],
) -> tuple[FloatArray, float, int]:
    """The end of a specimen at rest, from its edge in both cameras' pictures.

    Parameters
    ----------
    pictures
        Mean static pictures of both cameras.
    rig
        The cameras.
    cylinder
        The specimen at rest.
    declared
        Where its end is thought to be, a point on its surface in the rig's frame [m], shape [3].
    direction
        From there into the specimen in the pictures (right, down).

    Returns
    -------
    point : array
        The declared point moved along the axis [m], shape [3].
    sigma : float
        Its standard deviation along the axis [m].
    found : int
        Cameras in which the edge was found. If in none, the point is the declared one.
    """
    inward = (round(direction[0]), round(direction[1]))
    small = 1e-5 * cylinder.axis
    moves, sigmas, slopes = [], [], []
    for camera, picture in zip(rig.cameras, pictures, strict=True):
        place = camera.project(declared)
        slope = float((camera.project(declared + small) - place) @ np.asarray(direction)) / 1e-5  # px per m
        slopes.append(abs(slope))
        edge = find_edge(picture, (float(place[0]), float(place[1])), inward)
        if edge is not None:
            moves.append(edge.offset / slope)
            sigmas.append(edge.sigma / abs(slope))
    if not moves:
        return declared, DECLARED / slopes[0], 0
    apart = 0.5 * abs(moves[0] - moves[-1])
    sigma = float(np.hypot(np.mean(sigmas) / np.sqrt(len(sigmas)), apart))
    return declared + float(np.mean(moves)) * cylinder.axis, sigma, len(moves)


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
