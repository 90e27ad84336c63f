"""shot.toml from text to schema; every problem is reported with its line, key, value and cure."""

import difflib
import hashlib
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError

from kolsky.base.errors import InputError, refuse
from kolsky.readers.text import decode, read_bytes
from kolsky.shot.schema.blanks import FILL_IN, blanks, of_blank
from kolsky.shot.schema.schema import ShotFile, schema

TOML_LIMIT = 1_000_000
"""Largest shot.toml that is read [bytes]."""

LONGEST_LINE = 20_000
"""Most characters of a line: a key of a hundred thousand parts would take a minute to take apart."""
DEEPEST = 30
"""Most tables and lists inside each other."""
LINE_SHOWN = 60
"""Most characters of a line that a message shows."""

Model = TypeVar("Model", bound=BaseModel)

_HEADER = re.compile(r"\s*\[([^\[\]]+)\]\s*(?:#.*)?")
_ASSIGNMENT = re.compile(r"""\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*[\w-]+)*)\s*=""")


@dataclass(frozen=True)
class TomlFile:
    """A parsed file with what is needed to point at its lines."""

    path: Path
    """The file."""
    sha256: str
    """SHA-256 of it, hex."""
    content: dict[str, Any]
    """What it says, as written."""
    lines: dict[str, int]
    """Dotted key -> line, counted from 1."""

    def error(
        self, key: str, message: str, *, allowed: str | None = None, cure: str | None = None
    ) -> InputError:
        """An error about a declared value, with its line and the value as written."""
        value: Any = self.content
        for part in key.split("."):
            value = value.get(part) if isinstance(value, dict) else None
        return InputError(
            self.path,
            message,
            line=line_of(self.lines, key),
            key=key,
            value=None if isinstance(value, dict) else value,
            allowed=allowed,
            cure=cure,
        )

    def validated(self, model: type[Model]) -> Model:
        """Its declarations by a schema, in SI.

        Raises
        ------
        InputError
            If it declares anything unknown, incomplete or impossible; several problems come as one
            `InputErrors`.
        """
        empty = set(blanks(self.content))
        try:
            valid = model.model_validate(self.content)
        except ValidationError as error:
            doubtful = _without_doubles(model, error.errors())
            problems = [_translate(self, model, details, empty) for details in doubtful]
        else:
            if not empty:
                return valid
            problems = []
        known = {p.key for p in problems if p.message == FILL_IN}
        cure = "write its value between the quotes"
        problems += [
            InputError(self.path, FILL_IN, line=line_of(self.lines, key), key=key, cure=cure)
            for key in sorted(empty - known)
        ]
        once = {(p.key, p.message): p for p in reversed(problems)}.values()
        refuse(sorted(once, key=lambda p: (p.line is None, p.line)))
        raise AssertionError("unreachable: there is a problem")


@dataclass(frozen=True)
class ShotToml(TomlFile):
    """A valid shot file."""

    declared: ShotFile
    """What it declares, in SI."""


Source = str | Path | TomlFile
"""A shot: its folder, its shot.toml, or that file as it was parsed before."""


def parse_toml(path: Path) -> TomlFile:
    """Parse a file; what it declares is not looked at yet.

    Raises
    ------
    InputError
        If it cannot be read or is no TOML.
    """
    data = read_bytes(path, limit=TOML_LIMIT)
    text = decode(path, data)
    long = next((i for i, line in enumerate(text.split("\n"), start=1) if len(line) > LONGEST_LINE), None)
    if long is not None:
        raise InputError(
            path,
            f"has a line of more than {LONGEST_LINE} characters",
            line=long,
            cure="is it the right file? if so, break the list into lines",
        )
    try:
        content = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # beside its own, tomllib lets these two through
        raise _syntax_error(path, text, str(error)) from None
    if _depth(content) > DEEPEST:
        raise InputError(
            path, f"has more than {DEEPEST} tables and lists inside each other", cure="is it the right file?"
        )
    return TomlFile(path, hashlib.sha256(data).hexdigest(), content, key_lines(text))


def _depth(content: object) -> int:
    """How many tables and lists are inside each other; counted without a call inside a call."""
    level, depth = [content], 0
    while level := [
        item
        for holder in level
        if isinstance(holder, dict | list)
        for item in (holder.values() if isinstance(holder, dict) else holder)
    ]:
        depth += 1
        if depth > DEEPEST:
            break
    return depth


def parsed(source: Source) -> TomlFile:
    """The shot file of a folder, parsed; one that is parsed already is returned as it is.

    Raises
    ------
    InputError
        If there is none, or as `parse_toml`.
    """
    return source if isinstance(source, TomlFile) else parse_toml(find_shot_file(Path(source)))


def shot_toml(source: Source) -> ShotToml:
    """A whole shot file, validated.

    Raises
    ------
    InputError
        If it cannot be read, is no TOML, or declares anything unknown, incomplete or impossible;
        several problems come as one `InputErrors`.
    """
    file = parsed(source)
    if isinstance(file, ShotToml):
        return file
    declared = file.validated(schema(file.content))
    return ShotToml(file.path, file.sha256, file.content, file.lines, declared)


def is_bar_driven(file: TomlFile) -> bool:
    """True if motion and force of a shot come from the gauges of its bars, and from no cameras."""
    return bool({"gauges", "bars", "recorders"} & set(file.content)) and not {
        "flyer",
        "pictures",
        "frames",
    } & set(file.content)


def key_lines(text: str) -> dict[str, int]:
    """Lines of the keys: dotted key -> line, counted from 1.

    A key inside an inline table is not listed; `line_of` then gives the line of that table.
    """
    lines: dict[str, int] = {}
    table = ""
    for number, line in enumerate(text.split("\n"), start=1):
        header = _HEADER.fullmatch(line.rstrip("\r"))
        assignment = _ASSIGNMENT.match(line)
        if header:
            table = _plain(header.group(1))
            lines.setdefault(table, number)
        elif assignment:
            key = _plain(assignment.group(1))
            lines.setdefault(f"{table}.{key}" if table else key, number)
    return lines


def line_of(lines: dict[str, int], key: str) -> int | None:
    """The line of a key, or of the nearest table around it; None for the file as a whole."""
    parts = key.split(".")
    for end in range(len(parts), 0, -1):
        line = lines.get(".".join(parts[:end]))
        if line is not None:
            return line
    return None


def _plain(dotted: str) -> str:
    return ".".join(part.strip().strip("\"'") for part in dotted.split("."))


def _syntax_error(path: Path, text: str, message: str) -> InputError:
    place = re.search(r"\s*\(at line (\d+), column (\d+)\)", message)
    message = message[: place.start()] if place else message.removesuffix(" (at end of document)")
    column, line, shown = "", None, ""
    if place:
        column, line = f" (column {place.group(2)})", int(place.group(1))
        shown = f": {text.splitlines()[line - 1].strip()[:LINE_SHOWN]!r}"
    return InputError(
        path,
        f"is not valid TOML: {message}{column}{shown}",
        line=line,
        cure='values with units stand in quotes: key = "9.5 mm"'
        if path.suffix == ".toml"
        else "give the folder of a shot, or its shot.toml",
    )


SHOULD_BE = "Input should be "
"""How pydantic says what is allowed."""
CHOICE = re.compile(r"(list|dict|tuple|literal|nullable|function-\w+|lax-or-strict)\[")
"""Parts of pydantic's place of an error that are no keys: the alternatives of a value of several kinds."""


def _translate(file: TomlFile, model: type[BaseModel], details: Any, empty: set[str]) -> InputError:
    """One pydantic error as an `InputError`; `empty` are the keys that are not filled in."""
    location = [str(part) for part in details["loc"] if not CHOICE.match(str(part))]
    context = details.get("ctx", {})
    kind, value = details["type"], details["input"]
    if "key" in context:
        location.append(context["key"])
        value = value.get(context["key"]) if isinstance(value, dict) else None
    key = ".".join(location)
    message, allowed, cure = _words(kind, location, context, model, details["msg"])
    if (blank := of_blank(location, empty)) is not None:
        key, message, value = blank, FILL_IN, None
    return InputError(
        file.path,
        message,
        line=line_of(file.lines, key),
        key=key,
        value=None if kind == "missing" or isinstance(value, dict) else value,
        allowed=allowed,
        cure=cure,
    )


def _without_doubles(model: type[BaseModel], errors: list[Any]) -> list[Any]:
    """A misspelt key is one problem, not an unknown key and a missing one."""
    meant = {(*e["loc"][:-1], _nearest(model, e["loc"])) for e in errors if e["type"] == "extra_forbidden"}
    return [e for e in errors if not (e["type"] == "missing" and e["loc"] in meant)]


def _nearest(model: type[BaseModel], location: Any) -> str | None:
    """The valid key that an unknown one resembles most."""
    valid = _keys_of(model, [str(part) for part in location[:-1]])
    return next(iter(difflib.get_close_matches(str(location[-1]), valid, n=1)), None)


def _words(
    kind: str, location: list[str], context: dict[str, Any], model: type[BaseModel], fallback: str
) -> tuple[str, str | None, str | None]:
    """Message, allowed values and cure of a pydantic error."""
    if kind == "shot":
        return context["message"], context.get("allowed"), context.get("cure")
    if kind == "missing":
        bars = " --bars" if "gauges" in model.model_fields and "frames" not in model.model_fields else ""
        return "is missing", None, f"add it; `kolsky new FOLDER{bars}` writes a file with every key"
    if kind == "extra_forbidden":
        valid = _keys_of(model, location[:-1])
        near = _nearest(model, location)
        cure = f"did you mean {near}?" if near else "remove it"
        return f"is not a known key; the keys here are {', '.join(valid)}", None, cure
    if kind == "literal_error":
        return "is not allowed", str(context["expected"]).replace("'", '"'), None
    if kind == "greater_than_equal":
        return "is not allowed", f">= {context['ge']}", None
    if kind == "less_than_equal":
        return "is not allowed", f"<= {context['le']}", None
    if kind == "int_type":
        return "is not a whole number", None, "write a whole number without quotes"
    if kind in ("model_type", "model_attributes_type"):
        return "is not a table", None, "its keys are " + ", ".join(_keys_of(model, location))
    if fallback.startswith(SHOULD_BE):
        return "is not allowed", fallback.removeprefix(SHOULD_BE).replace("dictionary", "table"), None
    return f"is not allowed ({fallback})", None, "write it as the page of this file's format shows it"


def _keys_of(model: type[BaseModel], location: list[str]) -> list[str]:
    """The valid keys of a table of the schema; in a table of named tables, any name is followed."""
    names = iter(location)
    for name in names:
        annotation = model.model_fields[name].annotation
        choices = [annotation, *get_args(annotation)]
        tables = [c for c in choices if isinstance(c, type) and issubclass(c, BaseModel)]
        if not tables:  # a list or a mapping of plain values
            return []
        model = tables[0]
        if get_origin(annotation) is dict:
            next(names, None)
    return list(model.model_fields)


SHOT_FILE = "shot.toml"


def find_shot_file(path: Path) -> Path:
    """The shot file of a folder, or the file itself."""
    if path.is_dir():
        if not (path / SHOT_FILE).exists():
            raise InputError(
                path,
                f"has no {SHOT_FILE}",
                cure=f"`kolsky new {path}` writes one to fill in, `kolsky new {path} --bars` one for a test "
                "between bars",
            )
        return path / SHOT_FILE
    if not path.exists():
        raise InputError(path, "there is no such folder or file", cure="give the folder of a shot")
    return path


def folder_of(folder_or_toml: str | Path) -> Path:
    """The folder of a shot that is named by its folder or its shot file."""
    path = Path(folder_or_toml)
    return path.parent if path.is_file() else path
