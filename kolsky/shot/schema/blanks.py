"""Blanks of a shot file: values that are still to be filled in."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

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


def of_blank(location: list[str], found: set[str]) -> str | None:
    """The blank that a problem at a place is about; None if it is about something else."""
    for end in range(len(location), 0, -1):
        if (key := ".".join(location[:end])) in found:
            return key
    return None
