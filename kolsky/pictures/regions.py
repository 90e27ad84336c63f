"""Regions drawn by hand over pictures: their checks, and the session that saves them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from dic.basics import cv2
from dic.bodies.region import Region, polygon_mask
from dic.files import replacing
from dic.images import PictureError, Pictures
from kolsky.base.errors import InputError
from kolsky.base.files import decode, read_bytes
from kolsky.base.toml import TOML_LIMIT, CannotEdit, with_values

LEAST_AREA = 25.0
"""Smallest region [px²]. It is that of a subset of 5 px."""


@dataclass(frozen=True)
class Drawable:
    """A key of the TOML file that can be drawn."""

    key: str
    """Key in the table [dic]."""
    title: str
    """Title shown to the user."""
    point: bool = False
    """True for a single place."""
    many: bool = False
    """True for a list of regions."""
    framed: bool = False
    """True if a region belongs to the frame in which it was drawn. Otherwise it belongs to frame `home`."""
    home: int = 0
    """Frame in which a region without a frame number is drawn."""


DRAWABLES_OF_SHOT = (
    Drawable("specimen", "Specimen: its side surface, clear of the platens", framed=True),
    Drawable("flyer", "Flyer: where it is seen, clear of its edge", framed=True),
    Drawable(
        "transmission_edge", "Transmission platen: a place on the edge where the specimen ends", point=True
    ),
)
"""Regions and points that can be drawn for a shot.toml."""


def drawables_of_measurement(reference: int) -> tuple[Drawable, ...]:
    """Regions and points that can be drawn for a dic.toml with this reference frame."""
    return (
        Drawable("region", "Region that is measured", home=reference),
        Drawable("exclude", "Parts of it that are left out", many=True, home=reference),
    )


def problems_of(
    drawn: Mapping[str, Sequence[Region]],
    wanted: Sequence[Drawable],
    *,
    shape: tuple[int, int],
    n_frames: int,
) -> list[str]:
    """Problems of drawn regions, one sentence each. Empty if the regions can be saved."""
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
            count = len(shape_drawn.corners)
            if one.point:
                problem = f"is one place, has {count}" if count != 1 else _outside_picture(shape_drawn, shape)
            else:
                problem = _polygon(shape_drawn, shape)
            if problem:
                said.append(f"{name}: {problem}")
    return said


def _outside_picture(drawn: Region, shape: tuple[int, int]) -> str:
    rows, columns = shape
    for x, y in drawn.corners:
        if not (np.isfinite(x) and np.isfinite(y)):
            return "has a corner that is not a number"
        if not (0.0 <= x <= columns - 1.0 and 0.0 <= y <= rows - 1.0):
            return f"({x:g}, {y:g}) lies outside the picture of {columns} x {rows} px"
    return ""


def _polygon(drawn: Region, shape: tuple[int, int]) -> str:
    """Problem of a polygon, in words; empty if it has none."""
    if len(drawn.corners) < 3:
        return f"has {len(drawn.corners)} corners, needs three or more"
    if outside := _outside_picture(drawn, shape):
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
    """The first two sides that meet outside a shared corner, or None. Side i begins at corner i."""
    n = len(corners)
    ends = np.roll(corners, -1, axis=0)
    for i in range(n):
        for j in range(i + 1, n):
            if (j == i + 1 or (i == 0 and j == n - 1)) and n > 3:
                # adjacent sides share a corner; they overlap only if they fold back
                a, b, c = (corners[i], ends[i], ends[j]) if j == i + 1 else (ends[i], corners[i], corners[j])
                back, ahead = a - b, c - b
                if abs(_cross(back, ahead)) < 1e-9 and back @ ahead > 0.0:
                    return i, j
            elif n > 3 and _segments_meet(corners[i], ends[i], corners[j], ends[j]):
                return i, j
    return None


def _cross(a: np.ndarray, b: np.ndarray) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _segments_meet(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> bool:
    """True if the segments ab and cd have a point in common."""
    s = [_cross(b - a, c - a), _cross(b - a, d - a), _cross(d - c, a - c), _cross(d - c, b - c)]
    if s[0] * s[1] < 0.0 and s[2] * s[3] < 0.0:
        return True
    pairs = ((a, b, c, s[0]), (a, b, d, s[1]), (c, d, a, s[2]), (c, d, b, s[3]))
    return any(
        side == 0.0 and (np.minimum(p, q) <= r).all() and (r <= np.maximum(p, q)).all()
        for p, q, r, side in pairs
    )


def _as_toml(one: Drawable, drawn: Sequence[Region]) -> str:
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


@dataclass
class Session:
    """Drawing session for the regions of one TOML file."""

    path: Path
    """The shot.toml or dic.toml."""
    pictures: Pictures
    """Camera 0's series."""
    wanted: tuple[Drawable, ...]
    """What can be drawn."""
    validate: Callable[[Path], object]
    """Reads a file of this kind. Raises InputError if it is not valid."""
    drawn: dict[str, list[Region]] = field(default_factory=dict)
    """Regions that the file declares already."""
    saved: tuple[str, ...] = ()
    """Keys saved in this session."""

    def __post_init__(self) -> None:
        self._text = self._read()

    def problems(self, drawn: Mapping[str, Sequence[Region]]) -> list[str]:
        """Problems of drawn regions. Empty if they can be saved."""
        return problems_of(drawn, self.wanted, shape=self.pictures.shape, n_frames=self.pictures.n_frames)

    def snippet(self, drawn: Mapping[str, Sequence[Region]]) -> dict[str, str]:
        """Drawn regions as values of the table [dic]."""
        return {one.key: _as_toml(one, drawn[one.key]) for one in self.wanted if drawn.get(one.key)}

    def save(self, drawn: dict[str, list[Region]]) -> list[str]:
        """Save drawn regions in the file, completely or not at all. Returns their problems.

        Regions that are not drawn remain as in the file. Nothing is saved if the file has changed since it
        was read. Nothing is saved either if the file would not be valid with the regions.
        """
        if said := self.problems(drawn):
            return said
        values = self.snippet(drawn)
        lines = [f"{key} = {value}" for key, value in values.items()]
        try:
            if self._read() != self._text:
                return [f"{self.path.name} was changed meanwhile: open the page again"]
            text = with_values(self._text, "dic", values)
            with replacing(self.path) as partial:
                partial.write_bytes(text.encode("utf-8"))
                self.validate(partial)
        except CannotEdit as error:
            return [f"{self.path.name} was not changed, {error}; write into [dic]: {'; '.join(lines)}"]
        except InputError as error:
            return [f"{self.path.name} was not changed: {error.message}"]
        except OSError as error:
            return [f"{self.path.name} cannot be written: {error.strerror}"]
        self._text, self.saved = text, tuple(values)
        self.drawn = {**self.drawn, **drawn}
        return []

    def _read(self) -> str:
        return decode(self.path, read_bytes(self.path, limit=TOML_LIMIT))


def png_of(pictures: Pictures, frame: int) -> bytes | str:
    """A frame as an 8-bit PNG with the middle 99 % of its grey values, or the reason why there is none."""
    try:
        picture = np.asarray(pictures.frame(frame), dtype=np.float64)
    except (PictureError, IndexError) as error:
        return str(error)
    low, high = np.percentile(picture, [0.5, 99.5])
    grey = np.clip(255.0 * (picture - low) / max(high - low, 1.0), 0.0, 255.0).astype(np.uint8)
    return bytes(cv2.imencode(".png", grey)[1].tobytes())
