"""Users' TOML files.

Validation by a schema, blank values, error messages, and edits that keep everything else. A problem found by
a schema is reported with line, key, value, allowed range and remedy. An edit replaces single values as text.
Comments and order are kept.
"""

from __future__ import annotations

import difflib
import hashlib
import re
import tomllib
from collections.abc import Container, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError

from kolsky.base.errors import InputError, refuse
from kolsky.base.files import decode, read_bytes

BLANK = ""
"""Placeholder of a value that is not filled in. An empty text is never a valid value in a shot file."""
FILL_IN = "is not filled in"


def blanks(content: Any, key: str = "") -> Iterator[str]:
    """Dotted keys of the blanks, in the order of the file. A list of blanks counts as one."""
    if isinstance(content, dict):
        for name, value in content.items():
            yield from blanks(value, f"{key}.{name}" if key else name)
    elif content == BLANK or (isinstance(content, list) and content and all(x == BLANK for x in content)):
        yield key


def _enclosing(key: str, known: Container[str]) -> str:
    """A dotted key, or the innermost of its tables, that is one of the known ones; "" if none is."""
    while key and key not in known:
        key = key.rpartition(".")[0]
    return key


_SHOULD_BE = "Input should be "
"""Beginning of pydantic's messages on allowed values."""
_CHOICE = re.compile(r"(list|dict|tuple|literal|nullable|function-\w+|lax-or-strict)\[")
"""Parts of pydantic's error location that are not keys: the alternatives of a value of several kinds."""


def _translate(
    details: Any, model: type[BaseModel], path: Path, lines: dict[str, int], empty: set[str]
) -> InputError:
    """One error of Pydantic as an `InputError`; `lines` as of `key_lines`, `empty`: keys without a value."""
    location = [str(part) for part in details["loc"] if not _CHOICE.match(str(part))]
    context = details.get("ctx", {})
    kind, value = details["type"], details["input"]
    if "key" in context:
        location.append(context["key"])
        value = value.get(context["key"]) if isinstance(value, dict) else None
    key = ".".join(location)
    message, allowed, cure = _words(kind, location, context, model, details["msg"])
    if blank := _enclosing(key, empty):  # it caused the problem
        key, message, value = blank, FILL_IN, None
    return InputError(
        path,
        message,
        line=line_of(lines, key),
        key=key,
        value=None if kind == "missing" or isinstance(value, dict) else value,
        allowed=allowed,
        cure=cure,
    )


def _without_doubles(model: type[BaseModel], errors: list[Any]) -> list[Any]:
    """Report a misspelt key as one problem. Otherwise it would be an unknown key and a missing one."""
    meant = {(*e["loc"][:-1], _nearest(model, e["loc"])) for e in errors if e["type"] == "extra_forbidden"}
    return [e for e in errors if not (e["type"] == "missing" and e["loc"] in meant)]


def _nearest(model: type[BaseModel], location: Any) -> str | None:
    """The valid key that an unknown one resembles most."""
    valid = _keys_of(model, [str(part) for part in location[:-1]])
    return next(iter(difflib.get_close_matches(str(location[-1]), valid, n=1)), None)


def _words(
    kind: str, location: list[str], context: dict[str, Any], model: type[BaseModel], fallback: str
) -> tuple[str, str | None, str | None]:
    """Message, allowed values and remedy of a pydantic error."""
    if kind == "shot":
        return context["message"], context.get("allowed"), context.get("cure")
    if kind == "missing":
        bars = " --bars" if "gauges" in model.model_fields and "frames" not in model.model_fields else ""
        command = getattr(model, "NEW", "kolsky new") + f" FOLDER{bars}"
        return "is missing", None, f"add it; `{command}` writes a file with every key"
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
    if fallback.startswith(_SHOULD_BE):
        return "is not allowed", fallback.removeprefix(_SHOULD_BE).replace("dictionary", "table"), None
    return f"is not allowed ({fallback})", None, "write it as the page of this file's format shows it"


def _keys_of(model: type[BaseModel], location: list[str]) -> list[str]:
    """The valid keys of a table of the schema. In a table of named tables, any name is valid."""
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


def line_of(lines: dict[str, int], key: str) -> int | None:
    """The line of a key, or of the nearest enclosing table. None for the file as a whole."""
    return lines.get(_enclosing(key, lines))


_HEADER = re.compile(r"\s*\[([^\[\]]+)\]\s*(?:#.*)?")
_ASSIGNMENT = re.compile(r"""\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*[\w-]+)*)\s*=""")


@dataclass(frozen=True)
class Statement:
    """A header of a table, or a key with its value, as written in a file."""

    table: str
    """Dotted name of the table that it begins or belongs to. Empty above the first table."""
    key: str
    """Dotted key in that table. Empty for a header."""
    line: int
    """Its first line, counted from 1."""
    start: int
    """Index of the first character of that line."""
    value: int
    """Index after the equals sign. For a header it equals `end`."""
    end: int
    """Index behind the value, remark not counted."""


def statements(text: str) -> Iterator[Statement]:
    """The statements of a text in their order. There are none inside a value."""
    start, line, table = 0, 1, ""
    while start < len(text):
        row = text[start : _next_line(text, start)].rstrip("\r\n")
        end = start + len(row)
        if row.lstrip().startswith("["):
            header = _HEADER.fullmatch(row)
            table = _plain_key(header.group(1)) if header else row.strip()
            yield Statement(table, "", line, start, end, end)
        elif assignment := _ASSIGNMENT.match(row):
            value = start + assignment.end()
            end = value_end(text, value)
            yield Statement(table, _plain_key(assignment.group(1)), line, start, value, end)
        following = _next_line(text, end)
        line += text.count("\n", start, following)
        start = following


def _next_line(text: str, place: int) -> int:
    """Index of the first character of the next line."""
    return text.find("\n", place) + 1 or len(text)


def _plain_key(dotted: str) -> str:
    return ".".join(part.strip().strip("\"'") for part in dotted.split("."))


def key_lines(text: str) -> dict[str, int]:
    """Lines of the keys: dotted key -> line, counted from 1.

    A key inside an inline table is not listed. `line_of` then gives the line of that table.
    """
    lines: dict[str, int] = {}
    for s in statements(text):
        lines.setdefault(".".join(filter(None, (s.table, s.key))), s.line)
    return lines


TOML_LIMIT = 1_000_000
"""Largest shot.toml that is read [bytes]."""

LONGEST_LINE = 20_000
"""Largest number of characters of a line. A key of a hundred thousand parts would take a minute to parse."""
DEEPEST = 30
"""Largest nesting depth of tables and lists."""
END = " (at end of document)"
"""Message of `tomllib` for a file that ends inside a value."""
LINE_SHOWN = 60
"""Largest number of characters of a line in a message."""


Schema = TypeVar("Schema", bound=BaseModel)


@dataclass(frozen=True)
class TomlFile:
    """A parsed file with the line numbers of its entries."""

    path: Path
    """The file."""
    sha256: str
    """SHA-256 of the file, hex."""
    content: dict[str, Any]
    """Parsed content of the file, before validation."""
    lines: dict[str, int]
    """Dotted key -> line, counted from 1."""

    def written(self, key: str) -> Any:
        """The value at a dotted key, as written; None if absent."""
        value: Any = self.content
        for part in key.split("."):
            value = value.get(part) if isinstance(value, dict) else None
        return value

    def varied(self, values: Mapping[str, Any]) -> TomlFile:
        """The file with other values at dotted keys. The keys of a table are set together.

        Raises InputError if a part of a key is not a table.
        """
        content = deepcopy(self.content)
        for key, value in values.items():
            table = content
            *path, last = key.split(".")
            for part in path:
                table = table.setdefault(part, {})
                if not isinstance(table, dict):
                    cure = "write it as a table of the file"
                    raise InputError(self.path, f"{part} is not a table", key=key, cure=cure)
            if isinstance(value, dict):
                table.setdefault(last, {}).update(deepcopy(value))
            else:
                table[last] = deepcopy(value)
        return replace(self, content=content)

    def error(
        self, key: str, message: str, *, allowed: str | None = None, cure: str | None = None
    ) -> InputError:
        """An error about a declared value, with its line and the value as written."""
        value = self.written(key)
        return InputError(
            self.path,
            message,
            line=line_of(self.lines, key),
            key=key,
            value=None if isinstance(value, dict) else value,
            allowed=allowed,
            cure=cure,
        )

    @contextmanager
    def refusing(self, key: str, problem: str, *, cure: str | None = None) -> Iterator[None]:
        """Convert a ValueError in the block to an error about a declared value.

        It has problem and reason.
        """
        try:
            yield
        except ValueError as error:
            raise self.error(key, f"{problem}: {error}", cure=cure) from None

    def validated(self, schema: type[Schema]) -> Schema:
        """Its declarations by a schema, in SI.

        Raises InputError if it declares anything unknown, incomplete or impossible. Several problems are
        raised as one `InputErrors`.
        """
        empty = set(blanks(self.content))
        try:
            valid = schema.model_validate(self.content)
        except ValidationError as error:
            doubtful = _without_doubles(schema, error.errors())
            problems = [_translate(details, schema, self.path, self.lines, empty) for details in doubtful]
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


def parse_toml(path: Path) -> TomlFile:
    """Parse a file, without validation of its content.

    Raises InputError if it cannot be read or is not valid TOML.
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
    except (ValueError, RecursionError) as error:  # in addition to its errors, tomllib raises these two
        raise _syntax_error(path, text, str(error)) from None
    if _depth(content) > DEEPEST:
        raise InputError(
            path, f"has more than {DEEPEST} tables and lists inside each other", cure="is it the right file?"
        )
    return TomlFile(path, hashlib.sha256(data).hexdigest(), content, key_lines(text))


def _depth(content: object) -> int:
    """Nesting depth of tables and lists. It is counted without recursion."""
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


def read_toml(path: Path, schema: type[Schema]) -> tuple[TomlFile, Schema]:
    """A file, and its declarations according to a schema, in SI units.

    Raises InputError as `parse_toml` and `TomlFile.validated`.
    """
    file = parse_toml(path)
    return file, file.validated(schema)


def _syntax_error(path: Path, text: str, message: str) -> InputError:
    place = re.search(r"\s*\(at line (\d+), column (\d+)\)", message)
    ended = message.endswith(END)
    message = message[: place.start()] if place else message.removesuffix(END)
    column, line, shown = "", None, ""
    if place:
        column, line = f" (column {place.group(2)})", int(place.group(1))
        shown = f": {text.splitlines()[line - 1].strip()[:LINE_SHOWN]!r}"
    elif ended:
        line = len(text.splitlines()) or None
    return InputError(
        path,
        f"is not valid TOML: {message}{column}{shown}",
        line=line,
        cure='values with units need quotes: key = "9.5 mm"'
        if path.suffix == ".toml"
        else "give the folder of a shot, or its shot.toml",
    )


class CannotEdit(ValueError):
    """The values of a text cannot be replaced individually. The text was not changed."""


def with_values(text: str, table: str, values: Mapping[str, str]) -> str:
    """The text with values of one table replaced, or added at its end.

    The result is parsed and compared. It must equal the original except for these values. ``text``: a valid
    TOML text. ``table``: name of a table with a header, such as "dic" for ``[dic]``. ``values``: key -> value
    as TOML text. Raises CannotEdit if the table has no header, or if the result would differ at another
    place.
    """
    newline = "\r\n" if "\r\n" in text else "\n"
    wanted = deepcopy(tomllib.loads(text))
    if not isinstance(wanted.get(table), dict):
        raise CannotEdit(f"there is no table [{table}]")
    for key, value in values.items():
        wanted[table][key] = tomllib.loads(f"value = {value}")["value"]
        text = _with_value(text, table, key, value, newline)
    try:
        same = tomllib.loads(text) == wanted
    except tomllib.TOMLDecodeError:
        same = False
    if not same:
        raise CannotEdit(f"the table [{table}] is written in a way that cannot be edited value by value")
    return text


def _with_value(text: str, table: str, key: str, value: str, newline: str) -> str:
    text = _without_table(text, f"{table}.{key}")
    inside = [s for s in statements(text) if s.table == table]
    if not any(s.key == "" for s in inside):
        raise CannotEdit(f"the table [{table}] has no header")
    own = [s for s in inside if s.key.split(".")[0] == key]
    if len(own) == 1 and own[0].key == key:
        return f"{text[: own[0].value]} {value}{text[own[0].end :]}"
    place = _next_line(text, max(s.end for s in inside))
    for statement in reversed(own):  # specimen.x = ..., specimen.y = ...
        end = _next_line(text, statement.end)
        text = text[: statement.start] + text[end:]
        place -= end - statement.start
    gap = "" if text[:place].endswith("\n") else newline
    return f"{text[:place]}{gap}{key} = {value}{newline}{text[place:]}"


def _without_table(text: str, table: str) -> str:
    """The text without a table, from its header to the next header."""
    headers = [s for s in statements(text) if not s.key]
    for number, header in enumerate(headers):
        if header.table == table:
            end = headers[number + 1].start if number + 1 < len(headers) else len(text)
            return text[: header.start] + text[end:]
    return text


def value_end(text: str, start: int) -> int:
    """Index behind the value that begins at `start`. Blanks and a comment behind it are not counted."""
    depth, k, last = 0, start, start
    while k < len(text):
        c = text[k]
        if c in "\"'":
            k = last = _string_end(text, k)
            continue
        if c == "#":
            if depth == 0:
                break
            k = text.find("\n", k)
            if k < 0:
                break
            continue
        if c in "[{":
            depth += 1
        elif c in "]}":
            depth -= 1
        elif c == "\n" and depth == 0:
            break
        k += 1
        if not c.isspace():
            last = k
    return last


def _string_end(text: str, start: int) -> int:
    """Index behind the string that begins at `start`."""
    quote = text[start]
    mark = 3 * quote if text.startswith(3 * quote, start) else quote
    k = start + len(mark)
    while k < len(text):
        if text[k] == "\\" and quote == '"':
            k += 2
        elif text.startswith(mark, k):
            return k + len(mark)
        else:
            k += 1
    return k
