"""TOML files of our users: blanks, problems in words of the file, and edits that keep everything else.

A problem that a schema finds is reported with line, key, value, allowed range and cure. An edit replaces
single values as text: comments and order stay.
"""

from __future__ import annotations

import copy
import difflib
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, get_args, get_origin

from pydantic import BaseModel

from kolsky.base.errors import InputError

BLANK = ""
"""What stands for a value that is not filled in; nothing in a shot file may be an empty text."""
FILL_IN = "is not filled in"


def blanks(content: Any, key: str = "") -> Iterator[str]:
    """Dotted keys of the blanks, in the order of the file; a list of blanks is one."""
    if isinstance(content, dict):
        for name, value in content.items():
            yield from blanks(value, f"{key}.{name}" if key else name)
    elif content == BLANK or (isinstance(content, list) and content and all(x == BLANK for x in content)):
        yield key


def _of_blank(location: list[str], found: set[str]) -> str | None:
    """The blank that a problem at a place is about; None if it is about something else."""
    for end in range(len(location), 0, -1):
        if (key := ".".join(location[:end])) in found:
            return key
    return None


SHOULD_BE = "Input should be "
"""How pydantic says what is allowed."""
CHOICE = re.compile(r"(list|dict|tuple|literal|nullable|function-\w+|lax-or-strict)\[")
"""Parts of pydantic's place of an error that are no keys: the alternatives of a value of several kinds."""


def translate(
    details: Any, model: type[BaseModel], path: Path, lines: dict[str, int], empty: set[str]
) -> InputError:
    """One pydantic error as an `InputError`.

    ``details``: the error, an item of `pydantic.ValidationError.errors`. ``model``: the schema that was not
    met. ``path``, ``lines``: the file, and the lines of its keys, as `kolsky.schema.shot_file.key_lines`
    gives them. ``empty``: keys that are not filled in.
    """
    location = [str(part) for part in details["loc"] if not CHOICE.match(str(part))]
    context = details.get("ctx", {})
    kind, value = details["type"], details["input"]
    if "key" in context:
        location.append(context["key"])
        value = value.get(context["key"]) if isinstance(value, dict) else None
    key = ".".join(location)
    message, allowed, cure = _words(kind, location, context, model, details["msg"])
    if (blank := _of_blank(location, empty)) is not None:
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


def without_doubles(model: type[BaseModel], errors: list[Any]) -> list[Any]:
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


def line_of(lines: dict[str, int], key: str) -> int | None:
    """The line of a key, or of the nearest table around it; None for the file as a whole."""
    parts = key.split(".")
    for end in range(len(parts), 0, -1):
        line = lines.get(".".join(parts[:end]))
        if line is not None:
            return line
    return None


_EDITED_HEADER = re.compile(r"\s*\[([^\[\]]+)\]\s*(?:#.*)?$")
_ANY_HEADER = re.compile(r"\s*\[")
_EDITED_KEY = re.compile(r"\s*([A-Za-z0-9_-]+)((?:\s*\.\s*[A-Za-z0-9_-]+)*)\s*=")


class CannotEdit(ValueError):
    """A text whose values cannot be replaced one by one; it was left as it is."""


def with_values(text: str, table: str, values: Mapping[str, str]) -> str:
    """The text with values of one table replaced, or added at its end.

    The result is parsed and compared: it says what the text said, but for these values.

    ``text``: a valid TOML text. ``table``: name of a table with a header of its own, as "dic" for ``[dic]``.
    ``values``: key -> value as TOML text. Raises CannotEdit if the table has no header, or the result would
    say something else.
    """
    newline = "\r\n" if "\r\n" in text else "\n"
    wanted = copy.deepcopy(tomllib.loads(text))
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
    lines = _without_subtable(text, table, key).splitlines(keepends=True)
    statements = _statements(lines, table)
    if statements is None:
        raise CannotEdit(f"the table [{table}] has no header of its own")
    first, spans = statements
    own = [(name, rest, span) for name, rest, span in spans if name == key]
    if len(own) == 1 and not own[0][1]:
        start, end = own[0][2]
        block = "".join(lines[start:end])
        at = block.index("=") + 1
        stop = value_end(block, at)
        lines[start:end] = [f"{block[:at]} {value}{block[stop:]}"]
        return "".join(lines)
    for _, _, (start, end) in reversed(own):  # specimen.x = ..., specimen.y = ...
        del lines[start:end]
    gone = sum(end - start for _, _, (start, end) in own)
    last = max([first + 1, *(end for _, _, (_, end) in spans)]) - gone
    if last and not lines[last - 1].endswith("\n"):
        lines[last - 1] += newline
    lines.insert(last, f"{key} = {value}{newline}")
    return "".join(lines)


def _statements(lines: list[str], table: str) -> tuple[int, list[tuple[str, str, tuple[int, int]]]] | None:
    """The line of a table's header, and its assignments: first key, further keys, lines from and to."""
    k, inside, first = 0, False, -1
    spans = []
    while k < len(lines):
        line = lines[k].rstrip("\r\n")
        header = _EDITED_HEADER.match(line)
        if header or _ANY_HEADER.match(line):
            inside = bool(header) and header is not None and header.group(1).strip() == table
            first = k if inside else first
            k += 1
            continue
        found = _EDITED_KEY.match(line)
        end = k + 1
        if found:
            block = "".join(lines[k:])
            end = k + max(block[: value_end(block, found.end())].count("\n") + 1, 1)
            if inside:
                spans.append((found.group(1), found.group(2).strip(), (k, end)))
        k = end
    return None if first < 0 else (first, spans)


def _without_subtable(text: str, table: str, key: str) -> str:
    """The text without [table.key] and its lines up to the next header."""
    kept, gone = [], False
    for line in text.splitlines(keepends=True):
        if _ANY_HEADER.match(line):
            header = _EDITED_HEADER.match(line.rstrip("\r\n"))
            name = "" if header is None else header.group(1).replace(" ", "")
            gone = name == f"{table}.{key}"
        if not gone:
            kept.append(line)
    return "".join(kept)


def value_end(text: str, start: int) -> int:
    """Index behind the value that begins at `start`, blanks and comment behind it not counted."""
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
