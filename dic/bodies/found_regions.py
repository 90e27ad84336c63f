"""Regions of specimen and flyer in the pictures of camera 0, found in the pictures alone.

The flyer is what moves rigidly into the picture (`dic.bodies.followed_edge`). Followed back to rest, its
edge is the specimen's upper end; where its last rows leave the picture before, the end is one of the few
rows that are left, or out of view. Where so few rows of it come into view that nothing can be followed,
looks alone must tell (`dic.bodies.row_looks`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from dic.arrays import BoolArray, FloatArray
from dic.bodies.followed_edge import FollowedEdge, follow_edge
from dic.bodies.region import Region
from dic.bodies.rim_arc import end_arc
from dic.bodies.row_looks import CLEAR, EVEN, TURNS, clear_edge, followed_by_looks, row_correlation, turned
from dic.images import PictureError, Pictures

BAND = 0.5
"""A row of a platen without speckles has less than this share of the specimen's contrast."""
FLANK = 0.3
"""A column of the body has at least this share of the contrast of its middle."""
ARC_CLEAR = 1.5
"""Distance of the specimen's region from the arc of its lower end: its error and the blur [px]."""
MOST_COLUMNS = 64
"""Columns that the flyer is followed by [px]."""
MOST_STILL = 20
"""Static pictures that the noise is taken from."""
LOOKS = "rows of pixels that span the flyer's edge look like neither of its sides"
"""How it was told where nothing could be followed."""
SMALLEST = 20
"""Rows of a specimen that is taken for one [px]."""


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
    """How the flyer was told from the specimen, in words."""


def find_regions(pictures: Pictures, static: BoolArray, usable: BoolArray, *, toward: str) -> FoundRegions:
    """Find specimen, flyer and the transmission platen's edge.

    Parameters
    ----------
    pictures
        The series of camera 0.
    static
        Frames in which both bodies rest, shape [n_frames].
    usable
        Frames with a usable picture, shape [n_frames].
    toward
        Where the flyer lies: a key of `TURNS`.

    Raises
    ------
    ValueError
        If an edge is not in view or not clear; the message says which, and to declare the region.
    """
    if toward not in TURNS:
        raise ValueError(f"toward must be one of {', '.join(TURNS)}, got {toward!r}")
    rest = np.flatnonzero(static & usable)
    moving = np.flatnonzero(~static & usable)
    if not rest.size or not moving.size:
        raise ValueError("regions need a usable static picture and one of the motion")
    mean = turned(np.mean([pictures.frame(k).astype(np.float64) for k in rest.tolist()], axis=0), toward)
    third = len(mean) // 3
    inner = _inner(_columns(mean[third:-third], "specimen"))  # what lies beside a body is alike in all rows
    bottom, edge = _lower_end(mean[:, inner])
    stack, frames = _stack(pictures, [int(rest[-1]), *moving.tolist()], toward, inner)
    try:
        followed = follow_edge(stack, _noise(pictures, rest.tolist(), toward, inner))
    except ValueError as error:
        top, (last, picture, border), why = (
            *_by_looks(pictures, frames, toward, inner, mean, bottom, error),
            LOOKS,
        )
    else:
        top = _upper_end(mean[: bottom + 1, inner], followed)
        last, border = frames[-1], int(np.floor(followed.row[0]))
        picture = turned(pictures.frame(last).astype(np.float64), toward)
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
        specimen=Region(corners(columns, (top, bottom)), int(rest[0])),
        flyer=Region(corners(wide, (0, border - 1)), last),
        edge=_back((0.5 * (columns[0] + columns[1]), edge), shape, toward),
        why=why,
    )


def _stack(
    pictures: Pictures, wanted: Sequence[int], toward: str, inner: slice
) -> tuple[FloatArray, list[int]]:
    """The pictures that can be read, without the uneven light, and their frames."""
    kept, frames = [], []
    for k in wanted:
        try:
            kept.append(_even(turned(pictures.frame(k).astype(np.float64), toward)[:, inner]))
        except PictureError:
            continue
        frames.append(k)
    return np.array(kept), frames


def _even(picture: FloatArray) -> FloatArray:
    """A picture without the uneven light, in so many of its columns as tell enough."""
    flat = picture - gaussian_filter1d(picture, EVEN, axis=1)
    return np.asarray(flat[:, :: max(flat.shape[1] // MOST_COLUMNS, 1)])


def _noise(pictures: Pictures, rest: Sequence[int], toward: str, inner: slice) -> float:
    """Standard deviation of the pictures at rest."""
    if len(rest) < 2:
        raise ValueError("a single static picture tells no noise")
    still = _stack(pictures, rest[-MOST_STILL:], toward, inner)[0]
    return float(np.sqrt(still.var(axis=0, ddof=1).mean()))


def _upper_end(mean: FloatArray, followed: FollowedEdge) -> int:
    """First row of the specimen at rest, a pixel clear of the flyer; `mean` is the picture at rest."""
    row = float(followed.row[-1])
    if followed.frames[-1] == 0:  # followed to rest
        return max(int(np.ceil(row + 0.75)), 2)
    likeness = row_correlation(mean)
    pairs = 0.5 * (likeness[:-1] + likeness[1:])
    limit = CLEAR * float(np.median(likeness))
    k = int(np.argmin(pairs[: int(np.ceil(row)) + 1]))
    if pairs[k] < limit or (k == 0 and likeness[1] < limit):
        return k + 2
    return 2  # none of its rows are in view at rest


def _by_looks(
    pictures: Pictures,
    frames: Sequence[int],
    toward: str,
    inner: slice,
    mean: FloatArray,
    bottom: int,
    problem: ValueError,
) -> tuple[int, tuple[int, FloatArray, int]]:
    """First row of the specimen at rest, and the flyer's edge in the last frame, by the looks of rows."""
    likeness = row_correlation(mean[: bottom + 1, inner])  # a platen without speckles is like nothing
    pairs = 0.5 * (likeness[:-1] + likeness[1:])
    try:
        top = clear_edge(pairs[: (bottom + 1) // 2], likeness, "where the flyer meets the specimen") + 2
        found = followed_by_looks(pictures, frames, toward, inner, top - 2, bottom - 2)
    except ValueError as error:
        raise ValueError(f"{problem}; and {error}") from error
    if found[2] < 3:
        raise ValueError(
            "the flyer fills fewer than 3 rows of the last usable picture; declare flyer and its frame"
        )
    return top, found


def _lower_end(mean: FloatArray) -> tuple[int, float]:
    """Last row of the specimen at rest, and where it ends at the transmission platen [px]."""
    likeness = row_correlation(mean)
    contrast = np.std(mean - gaussian_filter1d(mean, EVEN, axis=1), axis=1)
    typical = _painted(contrast)
    middle = len(mean) // 2
    pairs = 0.5 * (likeness[:-1] + likeness[1:])  # an edge lies between two rows: both span it
    first = int(np.flatnonzero(contrast >= BAND * typical)[-1]) + 1
    if first < len(mean):  # an even platen: where the contrast has fallen to half
        before, after = contrast[first - 1], contrast[first]
        edge = first - 1 + float((before - BAND * typical) / (before - after))
        arc = end_arc(mean, edge)  # a camera beside the plane of the end sees it, or the rim before it, bent
        if arc is not None:
            return int(np.floor(arc.min() - ARC_CLEAR)), float(arc[arc.size // 2])
    else:
        edge = middle + clear_edge(pairs[middle:], likeness, "where the specimen meets the platen") + 0.5
    return int(np.floor(edge - 1.0)), edge


def _painted(contrast: FloatArray) -> float:
    """Contrast of the rows that show speckles: the median over those with half that of the best tenth.

    An even platen may fill more rows than the specimen.
    """
    return float(np.median(contrast[contrast >= BAND * np.percentile(contrast, 90.0)]))


def _columns(body: FloatArray, name: str) -> tuple[int, int]:
    """First and last column of a body that reaches from its middle to where its contrast ends."""
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
    """Columns of a body clear of its flanks."""
    room = (columns[1] - columns[0]) // 16
    return slice(columns[0] + room, columns[1] + 1 - room)


def _back(place: tuple[float, float], shape: tuple[int, ...], toward: str) -> tuple[float, float]:
    """A place (x, y) of a turned picture of this shape in the picture itself."""
    (x, y), (rows, columns) = place, shape
    return {
        "up": (x, y),
        "right": (rows - 1 - y, x),
        "down": (columns - 1 - x, rows - 1 - y),
        "left": (y, columns - 1 - x),
    }[toward]
