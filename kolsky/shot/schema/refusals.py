"""What a schema refuses, told in words of the file: line, key, value, what is allowed, cure."""

import difflib
import re
from pathlib import Path
from typing import Any, get_args, get_origin

from pydantic import BaseModel

from kolsky.base.errors import InputError
from kolsky.shot.schema.blanks import FILL_IN, of_blank

SHOULD_BE = "Input should be "
"""How pydantic says what is allowed."""
CHOICE = re.compile(r"(list|dict|tuple|literal|nullable|function-\w+|lax-or-strict)\[")
"""Parts of pydantic's place of an error that are no keys: the alternatives of a value of several kinds."""


def translate(
    details: Any, model: type[BaseModel], path: Path, lines: dict[str, int], empty: set[str]
) -> InputError:
    """One pydantic error as an `InputError`.

    Parameters
    ----------
    details
        The error, an item of `pydantic.ValidationError.errors`.
    model
        The schema that was not met.
    path, lines
        The file, and the lines of its keys, as `kolsky.shot.schema.reading.key_lines` gives them.
    empty
        Keys that are not filled in.
    """
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
