"""Photron's raw pictures: `.mraw` of 8, 10, 12 or 16 bits, with a `.cih` text or `.cihx` XML header file."""

import re
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from dic.files import regular
from dic.images.series import (
    Grey,
    PictureError,
    checked_bits,
    checked_count,
    checked_frame,
    checked_index,
    checked_shape,
    packed_size,
    unpack,
)

_LARGEST = 4_000_000
_XML = {
    "Total Frame": "frameInfo/totalFrame",
    "Start Frame": "frameInfo/startFrame",
    "Record Rate(fps)": "recordInfo/recordRate",
    "Image Width": "imageDataInfo/resolution/width",
    "Image Height": "imageDataInfo/resolution/height",
    "File Format": "imageFileInfo/fileFormat",
    "Color Type": "imageDataInfo/colorInfo/type",
    "Color Bit": "imageDataInfo/colorInfo/bit",
    "EffectiveBit Depth": "imageDataInfo/effectiveBit/depth",
    "EffectiveBit Side": "imageDataInfo/effectiveBit/side",
    "Save Step": "frameInfo/skipFrame",
    "Camera Type": "deviceInfo/deviceName",
}
"""The fields that are read: path in the XML form by name in the text form."""
_SEGMENT = "Segment Position"
"""Name of the field with the pictures' position on the sensor, "x, y" [px]."""
_COLOUR_CAMERA = re.compile(r"\bC\b|colou?r|bayer", re.IGNORECASE)
"""Pattern in the type of a camera with a colour mosaic, e.g. "FASTCAM SA-Z type 2100K-C-32GB"."""


@dataclass(frozen=True)
class Header:
    """The fields of a camera information header, by their names in the text form."""

    path: Path
    fields: dict[str, str]
    """Name and value as written."""

    def word(self, name: str, default: str = "") -> str:
        """A field's text, in lower case."""
        return self.fields.get(name, default).lower()

    def whole(self, name: str, default: int | None = None) -> int:
        """A field's whole number.

        Raises PictureError if it is missing and has no default, or is not a whole number.
        """
        text = self.fields.get(name)
        if text is None and default is not None:
            return default
        if text is None or not re.fullmatch(r"[+-]?\d{1,15}", text):
            raise PictureError(
                self.path,
                f'"{name}" must be a whole number, is {text!r}',
                cure="export the recording again, or correct the header",
            )
        return int(text)

    def number(self, name: str) -> float | None:
        """A field's number; None if it is missing.

        Raises PictureError if it is no number.
        """
        text = self.fields.get(name)
        if text is None:
            return None
        if not re.fullmatch(r"\d{1,15}(\.\d{1,15})?", text):
            raise PictureError(
                self.path,
                f'"{name}" must be a number, is {text!r}',
                cure="export the recording again, or correct the header",
            )
        return float(text)


def read_header(path: Path) -> Header:
    """Read a `.cih` or `.cihx` file."""
    try:
        with open(regular(path), "rb") as file:
            data = file.read(_LARGEST + 1)
    except OSError as error:
        raise PictureError(path, f"cannot be read ({error.strerror})", cure="copy it again") from None
    if len(data) > _LARGEST:
        raise PictureError(
            path,
            f"is larger than {_LARGEST} bytes, too large for a header",
            cure="is it the header? the pictures are in the .mraw file",
        )
    if b"<cih>" in data:
        return Header(path, _from_xml(path, data))
    fields = _from_text(data.decode("utf-8", "replace"))
    if not fields:
        raise PictureError(path, 'has no line of the form "name : value"', cure="export the recording again")
    return Header(path, fields)


def _from_text(text: str) -> dict[str, str]:
    """Fields of the text form; of repeated names the first is used."""
    fields: dict[str, str] = {}
    for line in text.splitlines():
        name, colon, value = line.partition(":")
        if colon:
            fields.setdefault(name.strip(), value.strip())
    return fields


def _without_comments(data: bytes) -> bytes:
    """XML without its comments; an unterminated comment is kept."""
    *ended, remainder = data.split(b"-->")
    return b"".join(part.partition(b"<!--")[0] for part in ended) + remainder


def _from_xml(path: Path, data: bytes) -> dict[str, str]:
    """Fields of the XML form; other bytes before and after the XML are ignored."""
    start, end = data.find(b"<cih>"), data.rfind(b"</cih>")
    inside = data[start : end + len(b"</cih>")] if end > start else b""
    if b"<!" in _without_comments(inside):
        raise PictureError(
            path,
            "declares entities or a document type, which a camera does not write",
            cure="export the recording again",
        )
    try:
        tree = ElementTree.fromstring(inside.decode("utf-8", "replace"))
    except (ElementTree.ParseError, ValueError) as error:
        raise PictureError(path, f"its XML cannot be read ({error})", cure="copy it again") from None
    entries = {name: tree.findtext(place) for name, place in _XML.items()}
    segment = tree.find(".//segmentPos")
    if segment is not None:
        corner = [segment.findtext(axis, segment.get(axis, "")) for axis in "xy"]
        entries[_SEGMENT] = ", ".join(corner) if any(corner) else segment.text
    return {name: text.strip() for name, text in entries.items() if text is not None}


@dataclass(frozen=True)
class MrawPictures:
    """Frames of a Photron recording; see `dic.images.Pictures`."""

    path: Path
    n_frames: int
    shape: tuple[int, int]
    bits: int
    times: NDArray[np.float64] | None
    stored: int
    """Bits of a grey value in the file: 8, 16, or 10 and 12 packed."""
    shift: int
    """Zero bits below the grey value, in the file ("EffectiveBit Side: Higher")."""
    crop_offset: tuple[float, float] = (0.0, 0.0)

    def frame(self, index: int) -> Grey:
        """Grey values of one picture, shape [rows, columns].

        Raises PictureError if it lies beyond the end of the file, or needs more bits than the header states.
        """
        index = checked_index(self.n_frames, index)
        rows, columns = self.shape
        need = packed_size(rows * columns, self.stored)
        size = self.path.stat().st_size
        if (index + 1) * need > size:
            raise PictureError(
                self.path,
                f"the file has {size} bytes, {size // need} of {self.n_frames} frames",
                frame=index,
                cure="it is cut off: copy it again",
            )
        raw = np.memmap(self.path, dtype=np.uint8, mode="r", offset=index * need, shape=(need,))
        if self.stored in (10, 12):
            grey: NDArray[np.generic] = unpack(raw, self.stored, rows * columns)
        else:
            grey = np.array(raw.view("<u2")) if self.stored == 16 else np.array(raw)
        if self.shift:
            grey = self._lowered(index, grey)
        return checked_frame(self.path, index, grey.reshape(rows, columns), self.shape, self.bits)

    def _lowered(self, index: int, grey: NDArray[np.generic]) -> NDArray[np.generic]:
        values = np.asarray(grey, dtype=np.uint16)
        if np.any(values & (2**self.shift - 1)):
            raise PictureError(
                self.path,
                f"its lowest {self.shift} bits are not zero, as the header states",
                frame=index,
                cure='correct "EffectiveBit Depth" and "EffectiveBit Side" in the header',
            )
        return values >> self.shift


def sniff(path: Path, start: bytes) -> bool:
    """True if a file is the header or the raw file of a Photron recording; the raw file is recognised by its
    name."""
    return path.suffix.lower() in (".mraw", ".cih", ".cihx")


def read(path: Path) -> MrawPictures:
    """Open a recording by its `.mraw` or its header.

    The times are (Start Frame + i)/Record Rate, on the trigger's clock; None if the header gives no rate.
    Also None if only every n-th frame was saved, because the two forms of the header define this differently.
    `segmentPos` of the XML is the crop offset. "Raw" are the grey values of a camera without a colour mosaic.

    Raises PictureError if one of the two files is missing, if the header is inconsistent, or if the pictures
    have colours.
    """
    pixels, header = _pair(path)
    colours, kind = header.word("Color Type", "mono"), header.word("File Format", "mraw")
    mosaic = colours == "raw" and _COLOUR_CAMERA.search(header.word("Camera Type")) is not None
    if mosaic:
        raise PictureError(
            header.path,
            f"describes raw pictures of the colour camera {header.fields['Camera Type']!r}, a colour a pixel",
            cure="export grey values",
        )
    if colours not in ("mono", "raw") or kind != "mraw":
        raise PictureError(
            header.path,
            f"describes {colours} pictures in {kind} files; raw grey ones can be read",
            cure="open the TIFF or PNG files themselves, or export grey values",
        )
    rows, columns = checked_shape(header.path, header.whole("Image Height"), header.whole("Image Width"))
    stored = header.whole("Color Bit")
    if stored not in (8, 10, 12, 16) or rows * columns * stored % 8:
        raise PictureError(
            header.path,
            f'"Color Bit" is {stored} for {rows} x {columns} pixels: 8, 10, 12 or 16 in whole bytes',
            cure="export it in whole bytes, or packed by the camera",
        )
    real = checked_bits(header.path, min(header.whole("EffectiveBit Depth", stored), stored), stored)
    high = header.word("EffectiveBit Side", "lower") == "higher"
    n_frames = checked_count(header.path, header.whole("Total Frame"))
    size = pixels.stat().st_size
    fits = [bits for bits in (8, 10, 12, 16) if size == n_frames * packed_size(rows * columns, bits)]
    if fits and stored not in fits:
        raise PictureError(
            header.path,
            f'"Color Bit" is {stored}, but {pixels.name} is as long as {n_frames} pictures of {fits[0]} bits',
            cure="is it the header of this recording? correct it, or export the recording again",
        )
    return MrawPictures(
        path=pixels,
        n_frames=n_frames,
        shape=(rows, columns),
        bits=real,
        times=_times(header, n_frames),
        stored=stored,
        shift=stored - real if high else 0,
        crop_offset=_crop_offset(header),
    )


def _crop_offset(header: Header) -> tuple[float, float]:
    """Position of the top left pixel on the sensor (x, y) [px]."""
    text = header.fields.get(_SEGMENT)
    if not text:
        return 0.0, 0.0
    corner = re.fullmatch(r"\s*(\d{1,6})\D+(\d{1,6})\s*", text)
    if corner is None:
        raise PictureError(
            header.path,
            f'"segmentPos" must be two whole numbers, is {text!r}',
            cure="export the recording again, or correct the header",
        )
    return float(corner[1]), float(corner[2])


def _pair(path: Path) -> tuple[Path, Header]:
    """The raw file and its header."""
    siblings = {file.suffix.lower(): file for file in path.parent.iterdir() if file.stem == path.stem}
    pixels = path if path.suffix.lower() == ".mraw" else siblings.get(".mraw")
    header = siblings.get(".cihx", siblings.get(".cih")) if pixels == path else path
    if pixels is None or not pixels.is_file():
        raise PictureError(path, f"there is no {path.stem}.mraw next to it", cure="copy it too")
    if header is None or not header.is_file():
        raise PictureError(path, f"there is no {path.stem}.cih or .cihx next to it", cure="copy it too")
    return pixels, read_header(header)


def _times(header: Header, n_frames: int) -> NDArray[np.float64] | None:
    rate, step = header.number("Record Rate(fps)"), header.whole("Save Step", 1)
    if not rate or step not in (0, 1):
        return None
    return (header.whole("Start Frame", 0) + np.arange(n_frames)) / rate
