"""Frames in which a body is about to come into view: its edge strip registered, and frames that agree."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from dic.arrays import BoolArray, FloatArray
from dic.bodies.follow import TrackedBody
from dic.camera import StereoRig
from dic.images import PictureError, Pictures
from dic.rigid_body.edge_registration import SEARCH_STEP, EdgeRegistration, RegisteredEdge
from dic.surfaces import SpecimenFrame

SEARCH_RANGE = 0.9
"""Half width of the interval about the prediction in which the edge strip is searched [px]."""


MOST_OFFSET_FRAMES = 40
"""Frames at most from which the offsets of the rows at the border of the picture are found."""


MOST_RECENT = 12
"""Frames from which the error of the row at the region's end is found."""


def registered_edges(
    pictures: tuple[Pictures, Pictures],
    body: TrackedBody,
    rig: StereoRig,
    frame: SpecimenFrame,
    places: FloatArray,
    moves: FloatArray,
    rows: list[int],
    found: list[float],
    static: BoolArray,
) -> list[tuple[int, RegisteredEdge]]:
    """The frames before the first of `rows`, latest first, with the registration of the edge strip."""
    first, m = rows[0], body.material
    twice = np.flatnonzero(np.isfinite(moves).all(axis=1))
    near = moves[twice[0]]
    if not np.isfinite(moves[m]).all() or first < 1:
        return []
    chosen = (pictures[0].frame(m).astype(np.float64), pictures[1].frame(m).astype(np.float64))
    registration = EdgeRegistration(chosen, body.mask, rig, frame, places, moves[m])
    registration.fit_row_offsets(_in_view(pictures, moves, rows, found))
    result: list[tuple[int, RegisteredEdge]] = []
    recent: list[tuple[tuple[FloatArray, FloatArray], FloatArray]] = []
    end_error: float | None = None
    # The first points to come into view are few: the motion is that of the first ten frames together.
    at, y = np.array(rows[:10], dtype=np.float64), np.array(found[:10])
    speed = float(np.median(np.diff(y) / np.diff(at))) if at.size > 1 else 0.0
    start = float(np.median(y - speed * (at - first)))
    past = [(first, start), (first + 1, start + speed)]
    for k in range(first - 1, -1, -1):
        try:
            pair = (pictures[0].frame(k).astype(np.float64), pictures[1].frame(k).astype(np.float64))
        except PictureError:
            continue  # its frame has an outcome that says so (`dic.images.frame_health`)
        (last, there), (before, earlier) = past
        speed = 0.0 if static[k] else (there - earlier) / (last - before)
        expected = there + speed * (k - last)
        settled = static[k] and static[min(k + 1, len(static) - 1)] and last == k + 1
        around = SEARCH_STEP if settled else SEARCH_RANGE * (last - k)
        tried = np.arange(-around, around + 0.5 * SEARCH_STEP, SEARCH_STEP) * registration.pixel
        edge = registration.register(pair, near, expected + tried)
        if edge is None:
            continue
        if edge.clear:
            recent = [(pair, np.array([near[0], edge.y, near[2]])), *recent[: MOST_RECENT - 1]]
        else:
            end_error = registration.end_error(recent) if end_error is None else end_error
            if end_error is None:
                break  # what is left of the body is too near its own edge
            edge = replace(edge, common=float(np.hypot(edge.common, end_error)))
        result.append((k, edge))
        past = [(k, edge.y), past[0]]
    return result


def consistent_frames(
    rows: list[int], found: list[float], counts: list[int], static: BoolArray, distance: float
) -> list[bool]:
    """Frames that agree with the path of those after them.

    As a body comes into view a few of its points may agree on a wrong place. From the frame with most points
    back to rest, a frame farther than `distance` [m], or half a step, from the line through the next is left
    out. The body came to speed after it rested: a static frame is left out where it is farther than
    `distance` beyond the line, or on the other side of the frame next to it.
    """
    fine = [True] * len(rows)
    if not rows:
        return fine
    best = int(np.argmax(counts))
    kept = [best]
    for i in range(best - 1, -1, -1):
        after = kept[-6:]
        if len(after) >= 3:
            at, y = np.array([rows[k] for k in after]), np.array([found[k] for k in after])
            speed = float(np.median(np.diff(y) / np.diff(at)))
            if static[rows[i]]:
                fine[i] = at_rest_before(found[i] - y[-1], speed * (rows[i] - at[-1]), distance)
            else:
                off = found[i] - float(np.median(y + speed * (rows[i] - at)))
                fine[i] = abs(off) <= max(distance, 0.5 * abs(speed))
        if fine[i]:
            kept.append(i)
    return fine


def at_rest_before(change: float, most: float, distance: float) -> bool:
    """Whether a body can have rested where a static frame shows it.

    Parameters
    ----------
    change
        From its place in the next frame that shows it to that in the static frame [m].
    most
        The same if it had its later speed all the way [m].
    distance
        What either may be off by [m].
    """
    low, high = min(most, 0.0), max(most, 0.0)
    return low - distance <= change <= high + distance


def _in_view(
    pictures: tuple[Pictures, Pictures], moves: FloatArray, rows: list[int], found: list[float]
) -> Iterator[tuple[tuple[FloatArray, FloatArray], FloatArray]]:
    """Pictures of frames whose points give the translation, with it; about `MOST_OFFSET_FRAMES` of them."""
    seen = [(k, y) for k, y in zip(rows, found, strict=True) if np.isfinite(moves[k]).all()]
    for k, y in seen[:: max(len(seen) // MOST_OFFSET_FRAMES, 1)]:
        try:
            pair = (pictures[0].frame(k).astype(np.float64), pictures[1].frame(k).astype(np.float64))
        except PictureError:
            continue
        yield pair, np.array([moves[k, 0], y, moves[k, 2]])
