"""Numbers as text, rounded by their uncertainty or to significant digits, and rows of plain text."""

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

MINUS = "\u2212"
NOTHING = "–"
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def measured(value: float, uncertainty: float) -> tuple[str, str]:
    """Return a value and its expanded uncertainty, both to the second significant digit of the uncertainty.

    For example ("1.1200", "0.0050"); ("2.50 × 10⁻⁵", "0.13 × 10⁻⁵"). If the uncertainty is zero or not
    finite, the number of significant digits is unknown. The result then has four digits and "–".
    """
    if not (math.isfinite(value) and math.isfinite(uncertainty) and uncertainty > 0.0):
        return plain(value), plain(uncertainty) if math.isfinite(uncertainty) else NOTHING
    last = _exponent(uncertainty, digits=2) - 1  # power of ten of the last digit kept
    largest = _exponent(max(abs(value), uncertainty), digits=1)
    if last >= -7 and -3 <= largest <= 5:
        return rounded(value, last), rounded(uncertainty, last)
    power = f" × 10{str(largest).translate(_RAISED)}" if largest else ""
    scale = 10.0**largest
    return (
        rounded(value / scale, last - largest) + power,
        rounded(uncertainty / scale, last - largest) + power,
    )


def like(value: float, uncertainty: float) -> str:
    """Return a value rounded as by `measured`."""
    return measured(value, uncertainty)[0]


def part(value: float, uncertainty: float) -> str:
    """Return a contribution to an expanded uncertainty with one digit more than `measured`."""
    if not (math.isfinite(value) and math.isfinite(uncertainty) and uncertainty > 0.0):
        return plain(value, 2)
    last = _exponent(uncertainty, digits=2) - 2
    return rounded(value, last) if -8 <= last <= 4 else plain(value, 3)


def rounded(value: float, last: int) -> str:
    """Return a number rounded at the power of ten `last`, e.g. rounded(1234.5, 1) is "1230"."""
    if not math.isfinite(value):
        return NOTHING
    text = f"{round(value, -last):.{max(0, -last)}f}"
    return _signed("0" + text[2:] if text.startswith("-0") and float(text) == 0.0 else text)


def plain(value: float, digits: int = 4) -> str:
    """Return a number with `digits` significant digits, with a power of ten below 1e-3 and from 1e6 on."""
    if not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return "0"
    exponent = _exponent(value, digits=digits)
    if not -4 < exponent < 6:
        mantissa = f"{value:.{digits - 1}e}".split("e")[0]
        return _signed(f"{_trim(mantissa)} × 10{str(exponent).translate(_RAISED)}")
    return _signed(_trim(f"{round(value, digits - 1 - exponent):.{max(0, digits - 1 - exponent)}f}"))


def percent(share: float, digits: int = 2) -> str:
    """Return a fraction in percent."""
    text = plain(100.0 * share, digits)
    return text if text == NOTHING else f"{text} %"


def _exponent(value: float, *, digits: int) -> int:
    """Return the power of ten of the leading digit after rounding (0.0999 with 2 digits gives -1)."""
    return int(f"{abs(value):.{digits - 1}e}".split("e")[1])


def _trim(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text else text


def _signed(text: str) -> str:
    return text.replace("-", MINUS)


_WRITTEN_POWER = re.compile(" × 10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)")
_LOWERED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def columns(rows: Mapping[str, Any]) -> list[str]:
    """Return names and values in two columns; numbers with six digits."""
    width = max(map(len, rows), default=0)
    return [f"  {name:<{width}}  {_cell_text(value)}" for name, value in rows.items()]


def table_lines(rows: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return the rows of a page's table, by the headings of their columns, as lines of aligned columns."""
    shown = list(map(_unmarked, rows))
    cells = [list(shown[0]), *(list(row.values()) for row in shown)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return ["  ".join(map(str.ljust, line, widths)).rstrip() for line in cells]


def row_lines(rows: Iterable[Mapping[str, Any]], names: int = 1) -> dict[str, str]:
    """Return the rows of a page's table as names, of the first cells, and texts of the others in words."""
    lines = {}
    for row in map(_unmarked, rows):
        cells = [(head, cell) for head, cell in row.items() if cell]
        text = ", ".join(f"{_lower_first(head)} {cell}" for head, cell in cells[names:])
        lines[", ".join(cell for _, cell in cells[:names])] = plain_sentence(text)
    return lines


def _lower_first(heading: str) -> str:
    """A heading inside a sentence; symbols of one or two letters stay."""
    return heading if len(heading.split()[0]) < 3 else heading[0].lower() + heading[1:]


def _unmarked(row: Mapping[str, Any]) -> dict[str, str]:
    """Cells by headings without the marks of HTML."""
    texts = {head: cell for head, cell in row.items() if head != "lost"}
    return {_UNMARKED.sub("", str(head)): _UNMARKED.sub("", str(cell)) for head, cell in texts.items()}


_UNMARKED = re.compile("<[^>]*>")


def plain_sentence(text: str) -> str:
    """Return a number of `kolsky.results.numbers` in ASCII where possible, e.g. "2.5e-5"."""
    text = _WRITTEN_POWER.sub(lambda power: "e" + power[1].translate(_LOWERED), text)
    return text.replace("µ", "u").replace(MINUS, "-").replace(NOTHING, "unknown")


def _cell_text(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} = {_cell_text(item)}" for key, item in value.items())
    return "none" if value is None else str(value)
