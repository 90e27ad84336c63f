"""The text of a shot file that a page edits.

Fields, single changes that keep comments, undo, conflicts. The file on disk is the state. A change is written
immediately, as a complete new file. It is rejected if another tab, an editor or a script has changed the file
since it was read.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel

from dic.files import alone_in, replacing
from explicit.contact import CONTACT_LAWS
from kolsky.base.errors import InputError
from kolsky.base.files import decode, read_bytes
from kolsky.base.toml import TOML_LIMIT, CannotEdit, blanks, parse_toml, statements, with_values
from kolsky.schema.shot_file import FullShotFile, is_bar_driven, shot_toml
from kolsky.survey.new_file import BLANK, fill_in
from kolsky.survey.tables import quoted

_REMARK = re.compile(r"\s*#\s?(?P<words>.*)")
_OFF = re.compile(r"#\s*(?P<key>\w+) = ")
MOST_UNDONE = 200
"""Maximum number of changes that can be undone."""


class Conflict(InputError):
    """The file on disk differs from the version that was read."""


@dataclass(frozen=True)
class FieldEntry:
    """One key of a shot file, for a form."""

    table: str
    """Dotted name of its table; empty above the first table."""
    key: str
    """Its name in the table."""
    value: str
    """Its value as TOML text."""
    remark: str
    """Comments after it and above it."""

    @property
    def dotted(self) -> str:
        """Its name in the file."""
        return f"{self.table}.{self.key}".removeprefix(".")

    @property
    def parsed(self) -> Any:
        """Its value."""
        return tomllib.loads(f"value = {self.value}")["value"]

    @property
    def display(self) -> str:
        """Its value as the user types it: a text without quotes."""
        value = self.parsed
        return value if isinstance(value, str) else self.value.strip()

    @property
    def blank(self) -> bool:
        """True if the value, or a part of it, is blank."""
        return bool(list(blanks({"value": self.parsed})))


def fields_of(text: str) -> list[FieldEntry]:
    """The keys of a shot file in their order, each with its comments.

    Raises tomllib.TOMLDecodeError if the text is not TOML.
    """
    tomllib.loads(text)
    found, end = [], 0
    for s in statements(text):
        if s.key:
            above = [
                m["words"]
                for line in text[end : s.start].splitlines()
                if (m := _REMARK.fullmatch(line)) and not _OFF.match(line.lstrip())
            ]
            after = text[s.end : text.find("\n", s.end) if "\n" in text[s.end :] else len(text)]
            remark = _REMARK.fullmatch(after)
            words = [*above, *([remark["words"]] if remark else [])]
            found.append(
                FieldEntry(s.table, s.key, text[s.value : s.end].strip(), ". ".join(filter(None, words)))
            )
        end = text.find("\n", s.end) + 1 or len(text)
    return found


def optional_keys(text: str, table: str) -> list[str]:
    """Keys of a table that are commented out in the file and can be enabled."""
    inside, found = False, []
    for line in text.splitlines():
        bare = line.lstrip("# ")
        if bare.startswith("["):
            inside = bare.partition("]")[0].strip("[ ") == table and not line.startswith("#")
        elif inside and (m := _OFF.match(line)):
            found.append(m["key"])
    return found


def choices(dotted: str) -> tuple[str, ...]:
    """The allowed texts of a key. Empty if other texts are also allowed."""
    if dotted in ("interface.faces", "interface.side"):  # a registry: laws may be added
        return tuple(CONTACT_LAWS)
    kind: Any = FullShotFile
    for name in dotted.split("."):
        model = next(
            (m for m in _alternatives(kind) if isinstance(m, type) and issubclass(m, BaseModel)), None
        )
        if model is None or name not in model.model_fields:
            return ()
        kind = model.model_fields[name].annotation
    literals = [one for one in _alternatives(kind) if get_origin(one) is Literal]
    return tuple(v for one in literals for v in get_args(one) if isinstance(v, str))


def _alternatives(kind: Any) -> Iterator[Any]:
    """The types of a union, each without its annotations."""
    if get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    if get_origin(kind) in (Union, UnionType):
        for one in get_args(kind):
            yield from _alternatives(one)
    else:
        yield kind


@dataclass
class Draft:
    """A shot file that a page edits."""

    path: Path
    """The file."""
    text: str = ""
    """Its text when it was last read or written."""
    undone: list[str] = field(default_factory=list)
    """Earlier texts, with the last change at the end."""

    def __post_init__(self) -> None:
        """Read the file."""
        self.text = self._on_disk()

    def _on_disk(self) -> str:
        return decode(self.path, read_bytes(self.path, limit=TOML_LIMIT))

    def reload(self) -> None:
        """Read the file again. Earlier changes can then not be undone.

        Raises InputError if it cannot be read.
        """
        self.text, self.undone = self._on_disk(), []

    def write(self, text: str) -> None:
        """Write a new text that replaces the text that was read.

        Raises Conflict if the file was changed in the meantime; the file is then left unchanged. Raises
        InputError if the text is not TOML or cannot be written.
        """
        before = self.text
        self._replace(text)
        self.undone = [*self.undone[-MOST_UNDONE + 1 :], before]

    def _replace(self, text: str) -> None:
        try:
            tomllib.loads(text)
        except (tomllib.TOMLDecodeError, RecursionError) as error:
            cure = "correct the line; the file keeps its earlier text until then"
            raise InputError(self.path.name, f"is not valid TOML: {error}", cure=cure) from None
        try:
            with alone_in(self.path.parent):
                if self._on_disk() != self.text:
                    raise Conflict(
                        self.path.name,
                        "was changed by another page or program since it was read here",
                        cure="read it again; what you just entered was not written",
                    )
                with replacing(self.path) as partial:
                    partial.write_bytes(text.encode("utf-8"))
        except OSError as error:
            raise InputError(
                self.path, f"cannot be written: {error.strerror}", cure="make it writable"
            ) from None
        self.text = text

    def undo(self) -> bool:
        """Undo the last change. Returns False if there is none.

        Raises Conflict as `write`.
        """
        if not self.undone:
            return False
        self._replace(self.undone[-1])
        self.undone.pop()
        return True

    def set_values(self, values: Mapping[str, str]) -> None:
        """Write values of keys as one change: dotted key -> value as TOML text.

        Raises InputError for the reasons of `write`, or if a key cannot be edited separately.
        """
        text = self.text
        for dotted, value in values.items():
            text = with_one(self.path, text, dotted, value)
        if text != self.text:
            self.write(text)

    def enter(self, dotted: str, typed: str) -> None:
        """Write the user's input for a key. Quantities and words get quotes, numbers do not.

        Raises InputError as `set_values`.
        """
        self.set_values({dotted: self.as_toml(dotted, typed)})

    def as_toml(self, dotted: str, typed: str) -> str:
        """The user's input as TOML text for the schema."""
        typed = typed.strip()
        if not typed:
            return BLANK
        ways = [quoted(typed)]
        try:
            if not isinstance(tomllib.loads(f"value = {typed}")["value"], str):
                ways.insert(0, typed)
        except tomllib.TOMLDecodeError:
            return ways[0]
        for way in ways:
            try:
                content = tomllib.loads(with_one(self.path, self.text, dotted, way))
            except InputError:
                continue
            if not any(p.key == dotted for p in schema_problems(self.path, content)):
                return way
        return ways[-1]

    def content(self) -> dict[str, Any]:
        """The content of the text. Empty while the text is not TOML."""
        try:
            return tomllib.loads(self.text)
        except tomllib.TOMLDecodeError:
            return {}

    def problems(self) -> list[InputError]:
        """Problems of the file by the schema. Data files are not opened."""
        return schema_problems(self.path, tomllib.loads(self.text))


def schema_problems(path: Path, content: dict[str, Any]) -> list[InputError]:
    """Problems of declarations by the schema."""
    file = replace(parse_toml(path), content=content)
    if is_bar_driven(file):
        return []
    try:
        shot_toml(file)
    except InputError as error:
        return list(error.problems)
    return []


def with_one(path: Path, text: str, dotted: str, value: str) -> str:
    """A text with one value replaced or added.

    A commented-out line of the key is replaced. Raises InputError if the key cannot be edited separately.
    """
    table, _, key = dotted.rpartition(".")
    present = {(s.table, s.key) for s in statements(text)}
    if (table, key) not in present:
        try:
            return fill_in(text, {dotted: value})
        except KeyError:
            pass
    try:
        if not table:
            return fill_in(text, {dotted: value})
        return with_values(text, table, {key: value})
    except (CannotEdit, KeyError, tomllib.TOMLDecodeError) as error:
        cure = "edit the text next to the form"
        raise InputError(path.name, f"{dotted} cannot be edited here: {error}", cure=cure) from None


def column_toml(column: str, unit: str) -> str:
    """The declaration of a column in a shot file."""
    return f"{{ column = {quoted(column)}, unit = {quoted(unit)} }}"


def series_toml(key: str, name: str, offset: Iterable[str]) -> str:
    """The declaration of a camera's pictures in a shot file. Numbers have no quotes; blanks stay blank."""
    places = []
    for text in offset:
        try:
            places.append(f"{float(text):g}")
        except ValueError:
            places.append(quoted(text.strip()))
    return f"{{ {key} = {quoted(name)}, crop_offset = [{', '.join(places)}] }}"


def by_key(problems: Iterable[InputError]) -> dict[str, str]:
    """Problems as texts, by key. Those without a key are under ""."""
    words_by_key: dict[str, list[str]] = {}
    for one in problems:
        words = one.message if one.allowed is None else f"{one.message}; it must be {one.allowed}"
        words_by_key.setdefault(one.key or "", []).append(
            words if one.cure is None else f"{words}. {one.cure}"
        )
    return {key: "; ".join(words) for key, words in words_by_key.items()}
