"""The shots below a folder and their table.

For speed with thousands of shots, one file per shot is read.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from io import StringIO
from itertools import islice
from math import isnan
from pathlib import Path
from typing import Any

from nicegui import ui

from kolsky.app import frame
from kolsky.app.jobs import is_running
from kolsky.report.result_folder import RESULT_FILE, SUMMARY
from kolsky.results.numbers import measured, plain_sentence
from kolsky.schema.pictures import MEASUREMENT_FILE
from kolsky.schema.shot_file import SHOT_FILE
from kolsky.survey.tables import SUFFIXES

_BLANK = re.compile(r'^[^#"\n]*=\s*(""|\[\s*""\s*(,\s*""\s*)*\])', re.MULTILINE)
M = "stiffness_factor"
PICTURES_ONLY = "pictures only"
"""State of a measurement by image correlation without a shot."""
NOT_SEARCHED = {"results", "__pycache__", "node_modules"}
"""Folders that are not searched for shots."""


@dataclass(frozen=True)
class ListedShot:
    """A shot of the table."""

    name: str
    """Its folder, relative to the root."""
    state: str
    """"no shot.toml", "not filled in", "ready to run", "running", "finished", "changed since",
    `PICTURES_ONLY`, or the name of a file that cannot be read."""
    row: Mapping[str, str]
    """The row of `summary.csv`; empty without one."""
    time: float
    """Time at which its result or, without a result, its shot file was written [s since 1970]. NaN if neither
    exists."""

    def number(self, key: str) -> float:
        """A number of the row; NaN if it is missing."""
        try:
            return float(self.row.get(key, "nan"))
        except ValueError:
            return float("nan")

    @property
    def rate(self) -> float:
        """Nominal strain rate [1/s]."""
        return self.number("nominal strain rate (1/s)")

    @property
    def verdict(self) -> str:
        """Verdict on the stiffness factor."""
        return self.row.get(f"verdict {M}", "")


def shot_folders(root: Path) -> Iterator[tuple[str, str]]:
    """Folders of shots, of pictures without a shot and of raw files below a root, by name.

    Yields: a folder with the name of its shot file or dic.toml. The name is empty without such a file. Shots
    are not searched inside a shot, nor in folders with a name that begins with a dot.
    """
    for place, folders, files in os.walk(root):
        file = next((name for name in (SHOT_FILE, MEASUREMENT_FILE) if name in files), "")
        raw = any(name.lower().endswith(SUFFIXES) for name in files)
        if file or (raw and (not folders or Path(place) != root)):
            yield place, file
            folders.clear()
        folders[:] = sorted(f for f in folders if f not in NOT_SEARCHED and not f.startswith("."))


def list_shots(root: Path) -> list[ListedShot]:
    """The shots below a root. One file is read for each: its summary or, without a summary, its shot file."""
    start = len(os.path.join(root, ""))
    return [
        _listed(place[start:].replace(os.sep, "/") or ".", place, file) for place, file in shot_folders(root)
    ]


def _listed(name: str, place: str, file: str) -> ListedShot:
    if not file:
        return ListedShot(name, "no shot.toml", {}, float("nan"))
    written = _written(f"{place}/{file}")
    if file == MEASUREMENT_FILE:
        return ListedShot(name, PICTURES_ONLY, {}, written)
    if is_running(Path(place)):
        return ListedShot(name, "running", {}, written)
    if (done := _written(f"{place}/results/{SUMMARY}.csv")) == done:
        state = "changed since" if written > done else "finished"
        try:
            with open(f"{place}/results/{SUMMARY}.csv", encoding="utf-8", newline="") as text:
                head, values = islice(csv.reader(text), 2)
        except (OSError, ValueError, csv.Error):
            return ListedShot(name, f"{SUMMARY}.csv cannot be read", {}, done)
        return ListedShot(name, state, dict(zip(head, values, strict=False)), done)
    if (done := _written(f"{place}/results/{RESULT_FILE}")) == done:
        return ListedShot(name, "finished", {}, done)  # results without a summary: `kolsky report` writes one
    try:
        with open(f"{place}/{file}", encoding="utf-8", errors="replace") as text:
            state = "not filled in" if _BLANK.search(text.read()) else "ready to run"
    except OSError:
        state = f"{SHOT_FILE} cannot be read"
    return ListedShot(name, state, {}, written)


def _written(path: str) -> float:
    """Time at which a file was written [s]. NaN if it does not exist."""
    try:
        return os.stat(path).st_mtime
    except OSError:
        return float("nan")


def table_row(shot: ListedShot) -> dict[str, Any]:
    """A row of the page's table: texts, and the numbers for sorting."""
    numbers = {"m": shot.number(f"{M} (1)"), "U": shot.number(f"U {M} (1)"), "rate": shot.rate}
    texts = () if isnan(numbers["m"] + numbers["U"]) else measured(numbers["m"], numbers["U"])
    view = "pictures" if shot.state == PICTURES_ONLY else "look" if shot.row else "setup"
    return {
        "name": shot.name,
        "state": shot.state,
        **dict(zip(("m", "U"), map(plain_sentence, texts or ("", "")), strict=True)),
        "rate": "" if isnan(shot.rate) else f"{shot.rate:.4g}",
        **{f"{key}_number": None if isnan(value) else value for key, value in numbers.items()},
        "verdict": shot.verdict,
        "date": "" if isnan(shot.time) else f"{datetime.fromtimestamp(shot.time):%Y-%m-%d %H:%M}",
        "link": frame.address(view, shot.name),
    }


def campaign_csv(found: list[ListedShot]) -> str:
    """The rows of all summaries as one table, with the folder of each."""
    rows = [{"folder": one.name, **one.row} for one in found if one.row]
    heads = list(dict.fromkeys(key for row in rows for key in row))
    text = StringIO()
    writer = csv.DictWriter(text, heads, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


COLUMNS = [
    {"name": "name", "label": "Shot", "field": "name", "align": "left", "sortable": True},
    {"name": "state", "label": "State", "field": "state", "align": "left", "sortable": True},
    {"name": "m", "label": "m", "field": "m_number", "sortable": True},
    {"name": "U", "label": "U (k = 2)", "field": "U_number", "sortable": True},
    {"name": "verdict", "label": "Verdict", "field": "verdict", "align": "left", "sortable": True},
    {"name": "rate", "label": "Strain rate (1/s)", "field": "rate_number", "sortable": True},
    {"name": "date", "label": "Date", "field": "date", "align": "left", "sortable": True},
]
CELLS = {
    "name": '<q-td :props="props"><a :href="props.row.link">{{ props.row.name }}</a></q-td>',
    "m": '<q-td :props="props">{{ props.row.m }}</q-td>',
    "U": '<q-td :props="props">{{ props.row.U }}</q-td>',
    "rate": '<q-td :props="props">{{ props.row.rate }}</q-td>',
}


def page(root: Path) -> None:
    """Register the page."""

    @ui.page("/")
    def shots_page() -> None:
        with frame.framed(root.name or str(root), view="shots"):
            found = list_shots(root)
            if not found:
                frame.note(
                    f"No shot and no raw files lie below {root}. Put the files of a test into a folder there."
                )
                return
            done = sum(bool(one.row) for one in found)
            frame.note(f"{len(found)} shots below {root}, {done} of them with a result.")
            _table(found)


def _table(found: list[ListedShot]) -> None:
    with ui.row().classes("w-full items-end"):
        words = ui.input("Filter: name, state or verdict").classes("w-64").props("clearable")
        ui.button("Compare the chosen", on_click=lambda: _compare(table)).props("outline")
        ui.button(
            "Campaign as CSV", on_click=lambda: ui.download(campaign_csv(found).encode(), "campaign.csv")
        ).props("flat")
    table: ui.table = ui.table(
        rows=[table_row(one) for one in found],
        columns=COLUMNS,
        row_key="name",
        selection="multiple",
        pagination={"rowsPerPage": 50, "sortBy": "name"},
    ).classes("w-full")
    table.props('flat dense :rows-per-page-options="[50, 200, 0]"')
    table.bind_filter_from(words, "value", lambda value: value or "")
    for name, cell in CELLS.items():
        table.add_slot(f"body-cell-{name}", cell)
    for slot, name in (("header", "'All shots'"), ("body", "props.row.name")):
        box = f'<q-checkbox dense v-model="props.selected" :aria-label="{name}"></q-checkbox>'
        table.add_slot(f"{slot}-selection", box)


def _compare(table: ui.table) -> None:
    chosen = [row["name"] for row in table.selected]
    if len(chosen) < 2:
        ui.notify("Choose two shots or more.")
        return
    ui.navigate.to(frame.comparison(*chosen))
