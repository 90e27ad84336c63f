"""Comparison of the table of docs/howto/json.md with the output of commands with `--json`."""

import json
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "json.md"


class Row(NamedTuple):
    """Keys of one row of the table."""

    always: frozenset[str]
    at_times: frozenset[str]
    more: bool  # true if the row also allows one key for each member of a set

    def fits(self, keys: set[str]) -> bool:
        """True if an object with these keys agrees with the row."""
        return self.always <= keys and (self.more or keys <= self.always | self.at_times)


def row_of(text: str) -> Row:
    """The keys in the second column of a row. Text in brackets explains them."""
    bare = re.sub(r"\([^()]*\)", "", text)
    bare = bare.replace("`dic.toml`", "")
    always, _, seldom = bare.partition("at times")
    keys = [frozenset(re.findall(r"`([^`]+)`", part)) for part in (always, seldom)]
    return Row(*keys, more="a key for each" in bare)


@cache
def rows() -> dict[str, list[Row]]:
    """Rows by command; some commands have several."""
    found: dict[str, list[Row]] = {}
    for name, text in re.findall(r"^\| `([a-z -]+)` \| (.*) \|$", PAGE.read_text("utf-8"), re.MULTILINE):
        found.setdefault(name, []).append(row_of(text))
    return found


def compare(words: Sequence[str], stdout: str) -> None:
    """Compare the output of a command with `--json` with its rows.

    Raises AssertionError if no row of the command has these keys.
    """
    name = " ".join(words[:2]) if " ".join(words[:2]) in rows() else words[0]
    said: dict[str, Any] = json.loads(stdout)
    assert name in rows(), f"docs/howto/json.md has no row for {name}"
    assert any(row.fits(set(said)) for row in rows()[name]), f"{name} prints the keys {', '.join(said)}"
