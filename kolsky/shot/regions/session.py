"""Drawing of regions over a series of pictures: what is drawn, checked, and saved into the TOML file."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from dic.files import replacing
from dic.images import PictureError, Pictures
from kolsky.base.errors import InputError
from kolsky.readers.text import decode, read_bytes
from kolsky.shot.regions.shapes import Drawable, Drawn, as_toml, problems_of, read_drawn
from kolsky.shot.regions.toml_edit import CannotEdit, with_values
from kolsky.shot.schema.reading import TOML_LIMIT


@dataclass
class Session:
    """Regions of one TOML file under way."""

    path: Path
    """The shot.toml or dic.toml."""
    pictures: Pictures
    """Camera 0's series."""
    wanted: tuple[Drawable, ...]
    """What can be drawn."""
    validate: Callable[[Path], object]
    """Reads a file of this kind and raises an InputError if it is not valid."""
    drawn: dict[str, list[Drawn]] = field(default_factory=dict)
    """What the file declares already."""
    saved: tuple[str, ...] = ()
    """Keys that were saved."""

    def __post_init__(self) -> None:
        self._text = self._read()

    def state(self) -> dict[str, Any]:
        """What a page needs to begin, as JSON can hold it."""
        rows, columns = self.pictures.shape
        return {
            "name": self.path.parent.resolve().name,
            "file": self.path.name,
            "columns": columns,
            "rows": rows,
            "frames": self.pictures.n_frames,
            "wanted": [vars(one) for one in self.wanted],
            "drawn": {
                key: [{"corners": [list(c) for c in one.corners], "frame": one.frame} for one in shapes]
                for key, shapes in self.drawn.items()
            },
        }

    def problems(self, content: Any) -> list[str]:
        """What is wrong with what a page sends; empty if it can be saved."""
        try:
            drawn = read_drawn(content, self.wanted)
        except ValueError as error:
            return [str(error)]
        return problems_of(drawn, self.wanted, shape=self.pictures.shape, n_frames=self.pictures.n_frames)

    def snippet(self, drawn: Mapping[str, Sequence[Drawn]]) -> dict[str, str]:
        """Drawn regions as values of the table [dic]."""
        return {one.key: as_toml(one, drawn[one.key]) for one in self.wanted if drawn.get(one.key)}

    def save(self, content: Any) -> list[str]:
        """Save what a page sends into the file, whole or not at all; what is wrong with it, if anything is.

        Regions that are not drawn stay as the file has them. The file is refused if it was changed since it
        was read, or would not be valid with the regions.
        """
        if said := self.problems(content):
            return said
        drawn = read_drawn(content, self.wanted)
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
            return [f"{self.path.name} was left as it is, {error}; write into [dic]: {'; '.join(lines)}"]
        except InputError as error:
            return [f"{self.path.name} was left as it is: {error.message}"]
        except OSError as error:
            return [f"{self.path.name} cannot be written: {error.strerror}"]
        self._text, self.saved = text, tuple(values)
        self.drawn = {**self.drawn, **drawn}
        return []

    def png(self, frame: int) -> bytes | str:
        """A frame as an 8-bit PNG, grey values stretched over its middle 99 %; or why there is none."""
        from dic.opencv import cv2

        try:
            picture = np.asarray(self.pictures.frame(frame), dtype=np.float64)
        except (PictureError, IndexError) as error:
            return str(error)
        low, high = np.percentile(picture, [0.5, 99.5])
        grey = np.clip(255.0 * (picture - low) / max(high - low, 1.0), 0.0, 255.0).astype(np.uint8)
        return bytes(cv2.imencode(".png", grey)[1].tobytes())

    def _read(self) -> str:
        return decode(self.path, read_bytes(self.path, limit=TOML_LIMIT))
