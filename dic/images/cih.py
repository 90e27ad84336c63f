"""Photron's camera information header: `.cih` text and `.cihx` XML."""

import re
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from dic.images.series import PictureError

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
}
"""The fields that are read: their names in text, and their places in XML."""


@dataclass(frozen=True)
class Header:
    """The fields of a camera information header, by their names in the text form."""

    path: Path
    """The header file."""
    fields: dict[str, str]
    """Name and value as written."""

    def word(self, name: str, default: str = "") -> str:
        """A field's text, in lower case."""
        return self.fields.get(name, default).lower()

    def whole(self, name: str, default: int | None = None) -> int:
        """A field's whole number.

        Raises
        ------
        PictureError
            If it is missing and has no default, or is not a whole number.
        """
        text = self.fields.get(name)
        if text is None and default is not None:
            return default
        if text is None or not re.fullmatch(r"[+-]?\d{1,15}", text):
            raise PictureError(self.path, f'"{name}" must be a whole number, is {text!r}')
        return int(text)

    def number(self, name: str) -> float | None:
        """A field's number; None if it is missing.

        Raises
        ------
        PictureError
            If it is no number.
        """
        text = self.fields.get(name)
        if text is None:
            return None
        if not re.fullmatch(r"\d{1,15}(\.\d{1,15})?", text):
            raise PictureError(self.path, f'"{name}" must be a number, is {text!r}')
        return float(text)


def read_header(path: Path) -> Header:
    """Read a `.cih` or `.cihx` file.

    Raises
    ------
    PictureError
        If it cannot be read, is too large, or is neither of the two.
    """
    try:
        with open(path, "rb") as file:
            data = file.read(_LARGEST + 1)
    except OSError as error:
        raise PictureError(path, f"cannot be read ({error.strerror})") from None
    if len(data) > _LARGEST:
        raise PictureError(path, f"is larger than {_LARGEST} bytes, which no header is")
    if b"<cih>" in data:
        return Header(path, _from_xml(path, data))
    fields = _from_text(data.decode("utf-8", "replace"))
    if not fields:
        raise PictureError(path, 'has no line of the form "name : value"')
    return Header(path, fields)


def _from_text(text: str) -> dict[str, str]:
    """Fields of the text form; the first of a name counts."""
    fields: dict[str, str] = {}
    for line in text.splitlines():
        name, colon, value = line.partition(":")
        if colon:
            fields.setdefault(name.strip(), value.strip())
    return fields


def _from_xml(path: Path, data: bytes) -> dict[str, str]:
    """Fields of the XML form, which stands between other bytes."""
    start, end = data.find(b"<cih>"), data.rfind(b"</cih>")
    inside = data[start : end + len(b"</cih>")] if end > start else b""
    if b"<!" in re.sub(rb"<!--.*?-->", b"", inside, flags=re.DOTALL):
        raise PictureError(path, "declares entities or a document type, which no camera writes")
    try:
        tree = ElementTree.fromstring(inside.decode("utf-8", "replace"))
    except (ElementTree.ParseError, ValueError) as error:
        raise PictureError(path, f"its XML cannot be read ({error})") from None
    found = {name: tree.findtext(place) for name, place in _XML.items()}
    return {name: text.strip() for name, text in found.items() if text is not None}
