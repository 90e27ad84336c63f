"""Regions of bodies in pictures: polygons, regions carried to another frame or detected automatically.

The flyer is the body that moves rigidly into the picture; its edge, tracked back to rest, is the specimen's
upper end (`dic.bodies.edges`). A declared region is carried to another frame by shifts of whole pixels, if
its pixels correlate with the declared picture in every frame between.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.ndimage import gaussian_filter1d

from dic.basics import BoolArray, FloatArray, IntArray, zncc
from dic.bodies.edges import (
    CLEAR_CORRELATION,
    EVEN,
    TURNS,
    FollowedEdge,
    clear_edge,
    end_arc,
    follow_by_correlation,
    follow_edge,
    rotate_rows,
    row_correlation,
)
from dic.images import PictureError, Pictures
from dic.outcome import FrameOutcome


@dataclass(frozen=True)
class Region:
    """Region of a body in one picture of camera 0."""

    corners: tuple[tuple[float, float], ...]
    """Corners (x, y) [px]."""
    frame: int = 0
    """The frame in which it is declared."""


def polygon_mask(corners: Sequence[tuple[float, float]], shape: tuple[int, int]) -> BoolArray:
    """The pixels whose centres lie inside a polygon or on its boundary.

    OpenCV's `fillPoly` also fills pixels that a side crosses. Their centres may lie up to half a pixel
    outside. A region that was declared clear of an edge would then touch the edge.

    ``corners``: at least three corners (x, y) in order [px]. The last is joined to the first. The even-odd
    rule decides what is inside. ``shape``: rows and columns of the picture. Returns: shape [rows, columns].
    Raises ValueError if there are fewer than three corners, if a corner is not finite, or if the polygon
    contains no pixel of the picture.
    """
    vertices = np.asarray(corners, dtype=np.float64)
    if vertices.ndim != 2 or vertices.shape[0] < 3 or vertices.shape[1] != 2:
        raise ValueError(
            f"a region needs three corners (x, y) or more, got an array of shape {vertices.shape}"
        )
    if not np.all(np.isfinite(vertices)):
        raise ValueError(f"the corners of a region must be finite, got {vertices.tolist()}")
    from skimage.measure import grid_points_in_poly  # 0.2 s

    place = grid_points_in_poly(shape, vertices[:, ::-1], binarize=False)
    mask = np.asarray(place > 0)  # inside, on a corner, on a side
    if not mask.any():
        rows, columns = shape
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        raise ValueError(
            f"the region from ({low[0]:g}, {low[1]:g}) to ({high[0]:g}, {high[1]:g}) px holds no pixel of "
            f"a picture of {columns} x {rows} px"
        )
    return mask


def grid_points(mask: BoolArray, step: int, *, margin: float = 0.0) -> tuple[FloatArray, IntArray]:
    """Points of a square grid inside a mask.

    ``mask``: pixels of the body, shape [rows, columns]. ``step``: distance of adjacent points [px] (1 or
    more). ``margin``: smallest distance of a point from the nearest pixel outside the mask [px]; the area
    beyond the picture's border is outside. Returns: positions (x, y) [px], shape [n, 2]: whole numbers, i.e.
    pixel centres. Returns: column and row of each point in the grid, shape [n, 2]. Raises ValueError if the
    step is below 1, if the margin is negative, or if no point remains.
    """
    if not (step >= 1 and margin >= 0.0):
        raise ValueError(f"step must be at least 1 px and margin not negative, got {step} and {margin}")
    rows, columns = np.nonzero(mask)
    if rows.size == 0:
        raise ValueError("the mask holds no pixel")
    fit = mask
    if margin > 0.0:
        from scipy.ndimage import distance_transform_edt

        fit = np.asarray(distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1] > margin)
        rows, columns = np.nonzero(fit)
        if rows.size == 0:
            raise ValueError(
                f"no pixel of the region is {margin:g} px inside it: enlarge it or lower the subset"
            )
    # The grid is centred on the measurable area: the distance to both boundaries is equal.
    x = _centred(columns.min(), columns.max(), step)
    y = _centred(rows.min(), rows.max(), step)
    i, j = np.meshgrid(np.arange(x.size), np.arange(y.size))
    selected = fit[y[j], x[i]].ravel()
    cell = np.column_stack([i.ravel(), j.ravel()])[selected]
    return np.column_stack([x[cell[:, 0]], y[cell[:, 1]]]).astype(np.float64), cell.astype(np.int64)


def _centred(first: int, last: int, step: int) -> IntArray:
    count = (last - first) // step + 1
    begin = first + (last - first - (count - 1) * step) // 2
    return np.asarray(begin + step * np.arange(count))


BAND = 0.5
"""A row of a platen without speckles has less than this share of the specimen's contrast."""
FLANK = 0.3
"""A column of the body has at least this share of the contrast of its middle."""
ARC_CLEAR = 1.5
"""Distance of the specimen's region from the arc of its lower end: its error and the blur [px]."""
MOST_COLUMNS = 64
"""Number of columns that are used to track the flyer [px]."""
MOST_STATIC_FRAMES = 20
"""Largest number of static pictures from which the noise is estimated."""
LOOKS = "rows of pixels that span the flyer's edge do not resemble either of its sides"
"""Explanation if the flyer could not be tracked."""
SMALLEST = 20
"""Smallest number of rows of a detected specimen [px]."""


@dataclass(frozen=True)
class FoundRegions:
    """Regions in the pictures of camera 0."""

    specimen: Region
    """The specimen at rest, a pixel clear of both platens."""
    flyer: Region
    """The flyer in the last usable frame, a pixel clear of its edge."""
    edge: tuple[float, float]
    """End of the specimen at the transmission platen at rest (x, y) [px]."""
    why: str = ""
    """Text: how the flyer was distinguished from the specimen."""


def find_regions(pictures: Pictures, static: BoolArray, usable: BoolArray, *, toward: str) -> FoundRegions:
    """Detect specimen, flyer and the transmission platen's edge.

    ``pictures``: the series of camera 0. ``static``: frames in which both bodies are at rest, shape
    [n_frames]. ``usable``: frames with a usable picture, shape [n_frames]. Raises ValueError if an edge is
    not in view or not clear. The message names the edge and asks the user to declare the region.
    """
    if toward not in TURNS:
        raise ValueError(f"toward must be one of {', '.join(TURNS)}, got {toward!r}")
    rest_frames = np.flatnonzero(static & usable)
    moving = np.flatnonzero(~static & usable)
    if not rest_frames.size or not moving.size:
        raise ValueError("regions need a usable static picture and one of the motion")
    mean = rotate_rows(
        np.mean([pictures.frame(k).astype(np.float64) for k in rest_frames.tolist()], axis=0), toward
    )
    third = len(mean) // 3
    inner = _inner(_columns(mean[third:-third], "specimen"))  # the background of a body is equal in all rows
    bottom, edge = _lower_end(mean[:, inner])
    stack, frames = _stack(pictures, [int(rest_frames[-1]), *moving.tolist()], toward, inner)
    try:
        followed = follow_edge(stack, _noise(pictures, rest_frames.tolist(), toward, inner))
    except ValueError as error:
        top, (last, picture, border), why = (
            *_by_row_correlation(pictures, frames, toward, inner, mean, bottom, error),
            LOOKS,
        )
    else:
        top = _upper_end(mean[: bottom + 1, inner], followed)
        last, border = frames[-1], int(np.floor(followed.row[0]))
        picture = rotate_rows(pictures.frame(last).astype(np.float64), toward)
        why = (
            f"the flyer's rows were followed back to frame {frames[followed.frames[-1]]}; beyond its edge "
            "the "
            f"pictures vary {followed.contrast:.0f} times as much as within"
        )
    if bottom - top < SMALLEST:
        raise ValueError(
            f"rows {top} to {bottom} are too few for a specimen; declare specimen and transmission_edge"
        )
    columns = _columns(mean[top : bottom + 1], "specimen")
    wide = _columns(picture[:border], "flyer")
    shape = mean.shape

    def corners(columns: tuple[int, int], rows: tuple[int, int]) -> tuple[tuple[float, float], ...]:
        (x0, x1), (y0, y1) = columns, rows
        return tuple(_back(p, shape, toward) for p in ((x0, y0), (x1, y0), (x1, y1), (x0, y1)))

    return FoundRegions(
        specimen=Region(corners(columns, (top, bottom)), int(rest_frames[0])),
        flyer=Region(corners(wide, (0, border - 1)), last),
        edge=_back((0.5 * (columns[0] + columns[1]), edge), shape, toward),
        why=why,
    )


def _stack(
    pictures: Pictures, indices: Sequence[int], toward: str, inner: slice
) -> tuple[FloatArray, list[int]]:
    """The readable pictures, corrected for uneven light, and their frames."""
    rotated, frames = [], []
    for k in indices:
        try:
            picture = rotate_rows(pictures.frame(k).astype(np.float64), toward)[:, inner]
        except PictureError:
            continue
        rotated.append(picture @ _even(picture.shape[1]))
        frames.append(k)
    return np.array(rotated), frames


@cache
def _even(columns: int) -> FloatArray:
    """Factor of a picture that corrects uneven light and leaves a sufficient number of columns."""
    one = np.eye(columns)
    return np.asarray((one - gaussian_filter1d(one, EVEN, axis=1))[:, :: max(columns // MOST_COLUMNS, 1)])


def _noise(pictures: Pictures, rest_frames: Sequence[int], toward: str, inner: slice) -> float:
    """Standard deviation of the noise in the static pictures."""
    if len(rest_frames) < 2:
        raise ValueError("the noise cannot be estimated from a single static picture")
    still = _stack(pictures, rest_frames[-MOST_STATIC_FRAMES:], toward, inner)[0]
    return float(np.sqrt(still.var(axis=0, ddof=1).mean()))


def _upper_end(mean: FloatArray, followed: FollowedEdge) -> int:
    """First row of the specimen at rest, a pixel clear of the flyer; `mean` is the picture at rest."""
    row = float(followed.row[-1])
    if followed.frames[-1] == 0:  # the edge was tracked back to rest
        return max(int(np.ceil(row + 0.75)), 2)
    likeness = row_correlation(mean)
    pairs = 0.5 * (likeness[:-1] + likeness[1:])
    limit = CLEAR_CORRELATION * float(np.median(likeness))
    k = int(np.argmin(pairs[: int(np.ceil(row)) + 1]))
    if pairs[k] < limit or (k == 0 and likeness[1] < limit):
        return k + 2
    return 2  # no row of the flyer is in view at rest


def _by_row_correlation(
    pictures: Pictures,
    frames: Sequence[int],
    toward: str,
    inner: slice,
    mean: FloatArray,
    bottom: int,
    problem: ValueError,
) -> tuple[int, tuple[int, FloatArray, int]]:
    """First row of the specimen at rest, and the flyer's edge in the last frame, by correlation of rows."""
    likeness = row_correlation(mean[: bottom + 1, inner])  # a platen without speckles does not correlate
    pairs = 0.5 * (likeness[:-1] + likeness[1:])
    try:
        top = clear_edge(pairs[: (bottom + 1) // 2], likeness, "where the flyer meets the specimen") + 2
        path = follow_by_correlation(pictures, frames, toward, inner, top - 2, bottom - 2)
    except ValueError as error:
        raise ValueError(f"{problem}; and {error}") from error
    if path[2] < 3:
        raise ValueError(
            "the flyer fills fewer than 3 rows of the last usable picture; declare flyer and its frame"
        )
    return top, path


def _lower_end(mean: FloatArray) -> tuple[int, float]:
    """Last row of the specimen at rest, and where it ends at the transmission platen [px]."""
    likeness = row_correlation(mean)
    contrast = np.std(mean - gaussian_filter1d(mean, EVEN, axis=1), axis=1)
    typical = _painted(contrast)
    middle = len(mean) // 2
    pairs = 0.5 * (likeness[:-1] + likeness[1:])  # an edge lies between two rows, and both pairs span it
    first = int(np.flatnonzero(contrast >= BAND * typical)[-1]) + 1
    if first < len(mean):  # an even platen: the end is where the contrast falls to half
        before, after = contrast[first - 1], contrast[first]
        edge = first - 1 + float((before - BAND * typical) / (before - after))
        arc = end_arc(mean, edge)  # a camera outside the plane of the end shows it, or the rim, as a curve
        if arc is not None:
            return int(np.floor(arc.min() - ARC_CLEAR)), float(arc[arc.size // 2])
    else:
        edge = middle + clear_edge(pairs[middle:], likeness, "where the specimen meets the platen") + 0.5
    return int(np.floor(edge - 1.0)), edge


def _painted(contrast: FloatArray) -> float:
    """Contrast of the rows with speckles: the median over rows with at least half the contrast of the best
    tenth."""
    return float(np.median(contrast[contrast >= BAND * np.percentile(contrast, 90.0)]))


def _columns(body: FloatArray, name: str) -> tuple[int, int]:
    """First and last column of a body. The search goes from its middle outward until the contrast ends."""
    contrast = gaussian_filter1d(np.std(body, axis=0), 3.0)
    middle = contrast.size // 2
    inside = contrast >= FLANK * np.median(contrast[middle - middle // 2 : middle + middle // 2])
    if not inside[middle]:
        raise ValueError(f"no speckles are seen in the middle of the {name}; declare its region")
    outside = np.flatnonzero(~inside)
    first = int(outside[outside < middle].max(initial=-1)) + 1
    last = int(outside[outside > middle].min(initial=contrast.size)) - 1
    return first, last


def _inner(columns: tuple[int, int]) -> slice:
    """Columns of a body that are clear of its flanks."""
    room = (columns[1] - columns[0]) // 16
    return slice(columns[0] + room, columns[1] + 1 - room)


def _back(place: tuple[float, float], shape: tuple[int, ...], toward: str) -> tuple[float, float]:
    """Position (x, y) in the original picture of a position in the rotated picture of this shape."""
    (x, y), (rows, columns) = place, shape
    return {
        "up": (x, y),
        "right": (rows - 1 - y, x),
        "down": (columns - 1 - x, rows - 1 - y),
        "left": (y, columns - 1 - x),
    }[toward]


LEAST_ZNCC = 0.9
"""Smallest correlation of the region's pixels with the declared picture."""
FARTHEST = 6
"""Largest change of the body's motion from frame to frame, along either axis [px]."""
ASIDE = 1
"""Largest such change across the axis [px]."""
FEWEST = 400
"""Smallest number of pixels of the region that must stay in view."""


def carry_region(
    pictures: Pictures, health: IntArray, region: Region, frame: int, *, direction: tuple[float, float]
) -> Region | None:
    """Carry a region to another frame by tracking its content.

    ``pictures``: the series of camera 0. ``health``: `FrameOutcome` of its pictures, shape [n_frames].
    ``region``: region of the body; its frame must be usable. ``direction``: axis of the motion in the
    pictures (right, down). Returns: None if the declared frame is not usable, or the body could not be
    tracked.
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
        scores = [_at_shift(declared, picture, x, y, shift) for shift in tried]
        best = int(np.argmax(scores))
        if scores[best] < LEAST_ZNCC:
            return None
        speed, move = tried[best] - move, tried[best]
    corners = np.asarray(region.corners) + move
    rows, columns = pictures.shape
    corners = np.clip(corners, 0.0, [columns - 1.0, rows - 1.0])
    return replace(region, corners=tuple((float(a), float(b)) for a, b in corners), frame=frame)


def _at_shift(declared: FloatArray, picture: FloatArray, x: IntArray, y: IntArray, move: IntArray) -> float:
    """Correlation of the region's pixels with a picture after the shift `move`; -1 if too few are in view."""
    rows, columns = picture.shape
    u, v = x + move[0], y + move[1]
    inside = (u >= 0) & (u < columns) & (v >= 0) & (v < rows)
    if inside.sum() < FEWEST:
        return -1.0
    return zncc(declared[y[inside], x[inside]], picture[v[inside], u[inside]])
