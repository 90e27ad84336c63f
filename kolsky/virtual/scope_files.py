"""The recorder's file in the formats that laboratories have, and what shot.toml says of each."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kolsky.base.errors import InputError
from kolsky.virtual.instruments import Scope

TIME, INCIDENT, TRANSMITTED = "Time (s)", "CH1 incident (V)", "CH2 transmitted (V)"
VOLT_DIGITS = 9
"""Significant digits of a printed voltage: more than any recorder's bits."""
GROUP = "scope"
"""Group of the channels in a TDMS file."""


@dataclass(frozen=True)
class ScopeFormat:
    """One format of the recorder's file."""

    name: str
    """Name of the file."""
    write: Callable[[Path, Scope], None]
    """Writes it."""
    columns: tuple[str, str]
    """Names of the incident and the transmitted channel."""
    force: dict[str, Any]
    """Further keys of [force] in shot.toml: its time column, its layout."""


def _text(path: Path, scope: Scope, delimiter: str, decimal: str) -> None:
    rows = [delimiter.join((TIME, INCIDENT, TRANSMITTED))]
    for t, a, b in zip(scope.time, scope.incident, scope.transmitted, strict=True):
        rows.append(delimiter.join((f"{t:.9e}", f"{a:.{VOLT_DIGITS}g}", f"{b:.{VOLT_DIGITS}g}")))
    text = "\n".join(rows) + "\n"
    if decimal != ".":
        head, _, rest = text.partition("\n")
        text = head + "\n" + rest.replace(".", decimal)
    path.write_text(text, encoding="utf-8")


def _comma(path: Path, scope: Scope) -> None:
    _text(path, scope, ",", ".")


def _semicolon(path: Path, scope: Scope) -> None:
    _text(path, scope, ";", ",")


def _workbook(path: Path, scope: Scope) -> None:
    from openpyxl import Workbook

    book = Workbook(write_only=True)
    sheet = book.create_sheet("Data")
    sheet.append([TIME, INCIDENT, TRANSMITTED])
    for row in zip(scope.time.tolist(), scope.incident.tolist(), scope.transmitted.tolist(), strict=True):
        sheet.append(row)
    book.save(path)


def _tdms(path: Path, scope: Scope) -> None:
    try:
        from nptdms import ChannelObject, TdmsWriter
    except ImportError:
        raise InputError(
            path, 'scope.format = "tdms" needs npTDMS', cure="pip install 'kolsky[tdms]'"
        ) from None
    clock = {
        "wf_start_offset": float(scope.time[0]),
        "wf_increment": float(scope.time[1] - scope.time[0]),
        "unit_string": "V",
    }
    names = (INCIDENT, TRANSMITTED)
    channels = [
        ChannelObject(GROUP, name, volts, properties=clock)
        for name, volts in zip(names, (scope.incident, scope.transmitted), strict=True)
    ]
    with TdmsWriter(str(path)) as writer:
        writer.write_segment(channels)


_TIME = {"column": TIME, "unit": "s"}
FORMATS = {
    "csv": ScopeFormat("scope.csv", _comma, (INCIDENT, TRANSMITTED), {"time": _TIME}),
    "csv semicolon": ScopeFormat(
        "scope.csv",
        _semicolon,
        (INCIDENT, TRANSMITTED),
        {"time": _TIME, "layout": {"delimiter": ";", "decimal": ",", "header_line": 1}},
    ),
    "xlsx": ScopeFormat(
        "scope.xlsx",
        _workbook,
        (INCIDENT, TRANSMITTED),
        {"time": _TIME, "layout": {"format": "excel", "sheet": "Data"}},
    ),
    "tdms": ScopeFormat(
        "scope.tdms",
        _tdms,
        (f"{GROUP}/{INCIDENT}", f"{GROUP}/{TRANSMITTED}"),
        {"layout": {"format": "tdms"}},
    ),
}
"""The formats by their names in [scope]."""
