"""XML without entities: elements with the line they begin in.

Expat parses; a document that declares an entity is refused, so nothing expands or is fetched.
"""

from dataclasses import dataclass, field
from xml.parsers import expat

from dic.camera_files.source import CameraFileError, Source

DEEPEST = 20
"""Levels that elements may be nested."""


@dataclass
class Element:
    """One element."""

    name: str
    """Its tag."""
    attributes: dict[str, str]
    """By name."""
    line: int
    """Line in which it begins in the file, from 1."""
    text: str = ""
    """Characters before its first child."""
    children: list["Element"] = field(default_factory=list)
    """In the file's order."""

    def named(self, name: str) -> list["Element"]:
        """Children with this tag."""
        return [child for child in self.children if child.name == name]


def parse(source: Source, *, start: int = 0, end: int | None = None) -> Element:
    """The root element of a file, or of a part of it.

    Parameters
    ----------
    source
        The file.
    start, end
        The part [characters].

    Raises
    ------
    CameraFileError
        If it is not well-formed, cut short, nested too deep, or declares an entity.
    """
    before = source.line_of(start) - 1
    document = Element("", {}, 0)
    open_ = [document]

    def begin(name: str, attributes: dict[str, str]) -> None:
        element = Element(name, attributes, parser.CurrentLineNumber + before)
        if len(open_) > DEEPEST:
            raise CameraFileError(
                source.path,
                f"nests more than {DEEPEST} elements",
                line=element.line,
                cure="name the calibration of one pair",
            )
        open_[-1].children.append(element)
        open_.append(element)

    def characters(text: str) -> None:
        if not open_[-1].children:
            open_[-1].text += text

    def entity(*_: object) -> None:
        raise CameraFileError(
            source.path,
            "declares an XML entity, which no calibration does",
            line=parser.CurrentLineNumber + before,
            cure="export the calibration again from its program",
        )

    parser = expat.ParserCreate("utf-8")
    parser.buffer_text = True
    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda _: open_.pop()
    parser.CharacterDataHandler = characters
    parser.EntityDeclHandler = entity
    try:
        parser.Parse(source.text[start:end].encode(), True)
    except expat.ExpatError as error:
        raise CameraFileError(
            source.path,
            f"is not well-formed XML ({expat.ErrorString(error.code)})",
            line=error.lineno + before,
            cure="it may be cut short: export it again",
        ) from None
    return document.children[0]
