"""Regions and points as a person draws them, and what is wrong with them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dic.bodies.region import polygon_mask

MOST_CORNERS = 1000
LEAST_AREA = 25.0
"""Smallest region [px²]: that of a subset of 5 px."""


@dataclass(frozen=True)
class Drawable:
    """A key of the TOML file that can be drawn."""

    key: str
    """Key in the table [dic]."""
    title: str
    """What it is, for a person."""
    point: bool = False
    """True for a single place."""
    many: bool = False
    """True for a list of regions."""
    framed: bool = False
    """True if a region is that of the frame it was drawn in; else it is that of frame `home`."""
    home: int = 0
    """Frame that a region without a frame of its own is drawn in."""


SHOT = (
    Drawable("specimen", "Specimen: its side surface, clear of the platens", framed=True),
    Drawable("flyer", "Flyer: where it is seen, clear of its edge", framed=True),
    Drawable(
        "transmission_edge", "Transmission platen: a place on the edge where the specimen ends", point=True
    ),
)
"""What is drawn for a shot.toml."""


def alone(reference: int) -> tuple[Drawable, ...]:
    """What is drawn for a dic.toml with this reference frame."""
    return (
        Drawable("region", "Region that is measured", home=reference),
        Drawable("exclude", "Parts of it that are left out", many=True, home=reference),
    )


@dataclass(frozen=True)
class Drawn:
    """One region or point."""

    corners: tuple[tuple[float, float], ...]
    """Corners (x, y), or the one place [px]."""
    frame: int
    """Frame it was drawn in."""


def read_drawn(content: Any, wanted: Sequence[Drawable]) -> dict[str, list[Drawn]]:
    """What a page sends, as regions; a key without any is left out.

    Parameters
    ----------
    content
        JSON: key -> list of ``{"corners": [[x, y], ...], "frame": k}``.
    wanted
        What can be drawn.

    Raises
    ------
    ValueError
        If it is not of this form; the message names the place.
    """
    if not isinstance(content, Mapping):
        raise ValueError("the regions are no mapping of names to lists")
    known = {one.key: one for one in wanted}
    found: dict[str, list[Drawn]] = {}
    for key, shapes in content.items():
        if key not in known or not isinstance(shapes, list):
            raise ValueError(f"{key!r} is not one of {', '.join(known)}, or no list")
        drawn = []
        for shape in shapes:
            given: dict[str, Any] = shape if isinstance(shape, dict) else {}
            corners: Any = given.get("corners")
            frame: Any = given.get("frame")
            fine = isinstance(corners, list) and len(corners) <= MOST_CORNERS
            fine = fine and all(isinstance(c, list) and len(c) == 2 for c in corners)
            fine = fine and all(type(v) in (int, float) for c in corners for v in c)
            if not fine or type(frame) is not int:
                raise ValueError(f"{key} is not a list of at most {MOST_CORNERS} corners [x, y] with a frame")
            drawn.append(Drawn(tuple((float(x), float(y)) for x, y in corners), frame))
        if drawn:
            found[key] = drawn
    return found


def problems_of(
    drawn: Mapping[str, Sequence[Drawn]],
    wanted: Sequence[Drawable],
    *,
    shape: tuple[int, int],
    n_frames: int,
) -> list[str]:
    """What is wrong with drawn regions, one sentence each; empty if they can be saved.

    Parameters
    ----------
    drawn
        By key.
    wanted
        What can be drawn.
    shape
        Rows and columns of the pictures.
    n_frames
        Number of pictures.
    """
    said = [] if drawn else ["nothing is drawn"]
    for one in wanted:
        shapes = drawn.get(one.key, ())
        if len(shapes) > 1 and not one.many:
            said.append(f"{one.key}: there are {len(shapes)}, it may have one")
        for number, shape_drawn in enumerate(shapes, start=1):
            name = f"{one.key} {number}" if one.many else one.key
            if not 0 <= shape_drawn.frame < n_frames:
                said.append(f"{name}: frame {shape_drawn.frame} does not exist, there are {n_frames}")
            elif not one.framed and shape_drawn.frame != one.home:
                said.append(f"{name}: belongs into frame {one.home}, was drawn in {shape_drawn.frame}")
            problem = _point(shape_drawn, shape) if one.point else _polygon(shape_drawn, shape)
            if problem:
                said.append(f"{name}: {problem}")
    return said


def _point(drawn: Drawn, shape: tuple[int, int]) -> str:
    if len(drawn.corners) != 1:
        return f"is one place, has {len(drawn.corners)}"
    return _outside(drawn, shape)


def _outside(drawn: Drawn, shape: tuple[int, int]) -> str:
    rows, columns = shape
    for x, y in drawn.corners:
        if not (np.isfinite(x) and np.isfinite(y)):
            return "has a corner that is no number"
        if not (0.0 <= x <= columns - 1.0 and 0.0 <= y <= rows - 1.0):
            return f"({x:g}, {y:g}) lies outside the picture of {columns} x {rows} px"
    return ""


def _polygon(drawn: Drawn, shape: tuple[int, int]) -> str:
    """What is wrong with a polygon; empty if nothing is."""
    if len(drawn.corners) < 3:
        return f"has {len(drawn.corners)} corners, needs three or more"
    if outside := _outside(drawn, shape):
        return outside
    corners = np.array(drawn.corners)
    if len(np.unique(corners, axis=0)) < len(corners):
        return "has one corner twice"
    if (crossing := crossing_sides(corners)) is not None:
        return f"crosses itself: sides {crossing[0] + 1} and {crossing[1] + 1}"
    if (area := polygon_area(corners)) < LEAST_AREA:
        return f"holds {area:.3g} px², needs {LEAST_AREA:g} or more"
    try:
        polygon_mask(drawn.corners, shape)
    except ValueError as error:
        return str(error)
    return ""


def polygon_area(corners: np.ndarray) -> float:
    """Area of a polygon [px²]: half of the sum of x_i y_(i+1) - x_(i+1) y_i."""
    x, y = corners.T
    return float(0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))


def crossing_sides(corners: np.ndarray) -> tuple[int, int] | None:
    """The first two sides that meet elsewhere than at a shared corner; side i begins at corner i."""
    n = len(corners)
    ends = np.roll(corners, -1, axis=0)
    for i in range(n):
        for j in range(i + 1, n):
            if (j == i + 1 or (i == 0 and j == n - 1)) and n > 3:
                # neighbours share a corner; they overlap only if they double back
                a, b, c = (corners[i], ends[i], ends[j]) if j == i + 1 else (ends[i], corners[i], corners[j])
                back, ahead = a - b, c - b
                if abs(_cross(back, ahead)) < 1e-9 and back @ ahead > 0.0:
                    return i, j
            elif n > 3 and _meet(corners[i], ends[i], corners[j], ends[j]):
                return i, j
    return None


def _cross(a: np.ndarray, b: np.ndarray) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _meet(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> bool:
    """True if the segments ab and cd have a point in common."""
    s = [_cross(b - a, c - a), _cross(b - a, d - a), _cross(d - c, a - c), _cross(d - c, b - c)]
    if s[0] * s[1] < 0.0 and s[2] * s[3] < 0.0:
        return True
    pairs = ((a, b, c, s[0]), (a, b, d, s[1]), (c, d, a, s[2]), (c, d, b, s[3]))
    return any(
        side == 0.0 and (np.minimum(p, q) <= r).all() and (r <= np.maximum(p, q)).all()
        for p, q, r, side in pairs
    )


def as_toml(one: Drawable, drawn: Sequence[Drawn]) -> str:
    """The value of a key as TOML."""
    if one.point:
        return _corner(drawn[0].corners[0])
    tables = []
    for shape in drawn:
        frame = f", frame = {shape.frame}" if one.framed else ""
        tables.append(f"{{ polygon = [{', '.join(map(_corner, shape.corners))}]{frame} }}")
    return f"[{', '.join(tables)}]" if one.many else tables[0]


def _corner(place: tuple[float, float]) -> str:
    return f"[{place[0]:g}, {place[1]:g}]"
