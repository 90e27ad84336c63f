"""Numbers and rows as plain text; imports nothing of the identification, which most commands do without."""

import re
from collections.abc import Mapping
from typing import Any

from kolsky.report import numbers

_POWER = re.compile(" × 10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)")
_LOWERED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def columns(rows: Mapping[str, Any]) -> list[str]:
    """Return names and values in two columns; numbers with six digits."""
    width = max(map(len, rows), default=0)
    return [f"  {name:<{width}}  {_shown(value)}" for name, value in rows.items()]


def plain(text: str) -> str:
    """Return a number of `kolsky.report.numbers` in ASCII where possible, e.g. "2.5e-5"."""
    text = _POWER.sub(lambda power: "e" + power[1].translate(_LOWERED), text)
    return text.replace("µ", "u").replace(numbers.MINUS, "-").replace(numbers.NOTHING, "unknown")


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} = {_shown(item)}" for key, item in value.items())
    return "none" if value is None else str(value)
