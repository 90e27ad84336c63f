"""Subsets that reach past an end of the specimen, or behind the rim of a platen, in either camera.

The side of the specimen rolls onto the platens as it is compressed, and its material passes the ends. Before
that, a camera that stands beyond the plane of an end looks at it over the platen: the rim, wider than the
specimen, hides the last of its side. What a subset matches there is partly the platen, and it is pulled
along; where the cameras stand one above the other, that moves the match along the epipolar line, and no
epipolar distance tells it.
"""

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.bodies.follow import TrackedBody
from dic.camera import Camera, StereoRig
from dic.correlation.warp import carried
from dic.outcome import PointOutcome
from dic.surfaces import SpecimenFrame
from dic.tracking import Track

MARGIN = 0.5
"""Distance that a subset keeps from the ends: about the width of an edge in a picture [px]."""
SMALL = 1e-5
"""Distance of the places that tell a picture's scale [m]."""
AT_ONCE = 50_000
"""Points of all frames that are looked at in one go: of few points many frames, as a call takes its time."""
SLACK = 0.8
"""Share of a picture's scale that is sure everywhere on the specimen [-]."""


def past_the_ends(
    body: TrackedBody,
    rig: StereoRig,
    frame: SpecimenFrame,
    subset: int,
    direction: tuple[float, float],
    ends: tuple[FloatArray, FloatArray],
    *,
    platen: float | None = None,
) -> BoolArray:
    """Valid points whose subset reaches past an end, so that a camera sees part of it no longer.

    The part of a subset that its mask holds reaches so many pixels from the point toward either end in the
    material picture. Deformed with the point's own warp it must fit, in each camera's picture, between the
    point and that end, or the platen's rim where it hides the end.

    Parameters
    ----------
    body
        The specimen, followed.
    rig
        The cameras.
    frame
        The test frame.
    subset
        Side of the subsets [px].
    direction
        From the transmission platen toward the flyer in camera 0's picture (right, down).
    ends
        y of the lower and the upper end in every frame [m], each of shape [n_frames]; NaN where not known.
    platen
        Radius of both platens [m]; None: not known, and no rim is looked at.

    Returns
    -------
    array of bool
        Shape [n_frames, n_points].
    """
    r = body.reconstruction
    toward = np.asarray(direction) / np.linalg.norm(direction)
    position = frame.positions(r.position)
    valid = r.outcome == PointOutcome.VALID
    past = np.zeros(valid.shape, dtype=bool)
    step = max(1, AT_ONCE // max(len(body.points), 1))
    parts = [slice(first, first + step) for first in range(0, len(valid), step)]
    for side, end in zip((-1.0, 1.0), ends, strict=True):
        reach = _reach(body, side * toward, subset // 2)
        for camera, track, pixels in zip(rig.cameras, body.tracks, r.pixels, strict=True):
            along, scale = axis_in_picture(camera, frame, position[valid])
            hidden = 0.0 if platen is None else platen * _steepest(camera, frame, side, end)
            for part in parts:
                known = valid[part] & np.isfinite(end[part, None])
                with np.errstate(invalid="ignore"):  # no point
                    before = side * (end[part, None] - position[part, :, 1])
                    near = known & (before < 2.0 * subset / (SLACK * scale) + hidden)
                k, rows = np.nonzero(near)
                k += part.start
                room = visible_room(
                    camera, frame, position[k, rows], pixels[k, rows], end[k], side * along, platen
                )
                extent = _extent(track, k, rows, side * reach[rows, None] * toward)
                past[k, rows] |= extent @ (side * along) > room - MARGIN
    return past


def visible_room(
    camera: Camera,
    frame: SpecimenFrame,
    places: FloatArray,
    pixels: FloatArray,
    end: FloatArray | float,
    outward: FloatArray,
    platen: float | None,
) -> FloatArray:
    """Distance in a picture from points to where the specimen is seen to end [px], shape [n].

    Its end is taken at the point's own distance from the axis. The rim lies in the plane of the end where
    the plane through the point, the camera and the direction of the axis meets it on the camera's side; it
    hides nothing of a point that is as far from the axis.

    Parameters
    ----------
    camera, frame
        The camera and the test frame.
    places
        The points in the test frame [m], shape [n, 3].
    pixels
        Where the camera sees them [px], shape [n, 2].
    end
        y of the end [m], one or one a point, shape [n].
    outward
        Unit vector toward that end in the picture, shape [2].
    platen
        Radius of the platen's rim [m]; None: not known.
    """
    y = np.full(len(places), end)
    at_end = np.column_stack([places[:, 0], y, places[:, 2]])
    room = (camera.project(frame.in_rig(at_end)) - pixels) @ outward
    if platen is None:
        return np.asarray(room)
    eye = frame.positions(camera.centre)
    start, way = eye[[0, 2]], places[:, [0, 2]] - eye[[0, 2]]
    a, b, c = (way**2).sum(axis=1), way @ start, start @ start - platen**2
    share = (-b - np.sqrt(np.maximum(b**2 - a * c, 0.0))) / a
    before = (b**2 > a * c) & (share < 1.0)
    rim = start + share[:, None] * way
    on_rim = np.column_stack([rim[:, 0], y, rim[:, 1]])[before]
    room[before] = np.minimum(room[before], (camera.project(frame.in_rig(on_rim)) - pixels[before]) @ outward)
    return np.asarray(room)


def axis_in_picture(camera: Camera, frame: SpecimenFrame, places: FloatArray) -> tuple[FloatArray, float]:
    """Direction of the axis toward the flyer in a picture, a unit vector [2], and pixels of a metre along it.

    Parameters
    ----------
    camera, frame
        The camera and the test frame.
    places
        Points of the specimen in the test frame [m], shape [n, 3]: both are those at their middle.
    """
    if not len(places):
        return np.array([0.0, -1.0]), 1.0
    step = np.array([0.0, SMALL, 0.0])
    middle = places.mean(axis=0)
    pixels = camera.project(frame.in_rig(np.array([middle - step, middle + step])))
    way = pixels[1] - pixels[0]
    size = float(np.linalg.norm(way))
    return np.asarray(way / size), size / (2.0 * SMALL)


def _steepest(camera: Camera, frame: SpecimenFrame, side: float, end: FloatArray) -> float:
    """Largest rise of the rays over the plane of an end, away from the specimen; 0 for a camera before it."""
    x, y, z = frame.positions(camera.centre)
    return float(np.max(np.nan_to_num(side * (y - end)), initial=0.0) / np.hypot(x, z))


def _extent(track: Track, k: IntArray, rows: IntArray, step: FloatArray) -> FloatArray:
    """Steps in the material picture from points `rows` as pictures `k` show them [px], shape [n, 2]."""
    warp = track.warp[k, rows]
    return np.asarray(step + carried(warp, step)[:, :2] - warp[:, :2])


def _reach(body: TrackedBody, step: FloatArray, half: int) -> FloatArray:
    """Distance that each subset's mask reaches from its point along `step` [px], shape [n_points]."""
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
