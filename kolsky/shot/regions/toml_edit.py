"""Edit of single values of a TOML file as text: all else, comments and order included, stays as it was."""

import copy
import re
import tomllib
from collections.abc import Mapping

_HEADER = re.compile(r"\s*\[([^\[\]]+)\]\s*(?:#.*)?$")
_ANY_HEADER = re.compile(r"\s*\[")
_KEY = re.compile(r"\s*([A-Za-z0-9_-]+)((?:\s*\.\s*[A-Za-z0-9_-]+)*)\s*=")


class CannotEdit(ValueError):
    """A text whose values cannot be replaced one by one; it was left as it is."""


def with_values(text: str, table: str, values: Mapping[str, str]) -> str:
    """The text with values of one table replaced, or added at its end.

    The result is parsed and compared: it says what the text said, but for these values.

    Parameters
    ----------
    text
        A valid TOML text.
    table
        Name of a table with a header of its own, as "dic" for ``[dic]``.
    values
        Key -> value as TOML text.

    Raises
    ------
    CannotEdit
        If the table has no header, or the result would say something else.
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
        header = _HEADER.match(line)
        if header or _ANY_HEADER.match(line):
            inside = bool(header) and header is not None and header.group(1).strip() == table
            first = k if inside else first
            k += 1
            continue
        found = _KEY.match(line)
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
            header = _HEADER.match(line.rstrip("\r\n"))
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
