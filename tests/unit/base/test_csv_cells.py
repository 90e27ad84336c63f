"""A spreadsheet must not evaluate a text cell of a table as a formula; numbers remain numbers."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from ratedshots import rated

from dic.files import text_cell
from dic.output import Row, as_csv, write_history
from kolsky.base.files import write_table, write_tables
from kolsky.studies.rates.comparison import compare
from kolsky.studies.rates.output import tables

HOSTILE = (
    "=1+1", '=HYPERLINK("http://x";"y")', "+1+1", "-2+3+cmd|' /C calc'!A0", "@SUM(1;1)", "\t=1", "＝1+1",
)  # fmt: skip
NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?|-inf|")


def cells(path: Path) -> list[str]:
    """Every cell of a table, as a spreadsheet gets them."""
    with path.open(newline="", encoding="utf-8") as file:
        return [cell for row in csv.reader(file) for cell in row]


def formulas(found: list[str]) -> list[str]:
    """Cells that begin as a formula and are no number."""
    return [cell for cell in found if cell[:1] in set("=+-@\t\r\n＝＋－＠") and not NUMBER.fullmatch(cell)]


@pytest.mark.parametrize("text", HOSTILE)
def test_a_formula_gets_an_apostrophe(text: str) -> None:
    assert text_cell(text) == f"'{text}"


@pytest.mark.parametrize("text", ["-1.5", "+2e-3", "-inf", "shot 3", "a=b", "'=1", "", "5 - 3"])
def test_numbers_and_harmless_text_stay(text: str) -> None:
    assert text_cell(text) == text


def test_tables_guard_names_and_leave_numbers(tmp_path: Path) -> None:
    columns = {"=shot": [*HOSTILE], "force (N)": np.linspace(-1.0, 1.0, len(HOSTILE)).tolist()}
    found = cells(write_table(tmp_path / "table.csv", columns))
    assert formulas(found) == []
    assert found[0] == "'=shot"
    assert [float(cell) for cell in found[3::2]] == pytest.approx(columns["force (N)"], abs=1e-9)
    write_history(tmp_path / "history.csv", {name: np.array(values) for name, values in columns.items()})
    assert cells(tmp_path / "history.csv") == found


def test_a_hostile_shot_name_is_text_in_every_table(tmp_path: Path) -> None:
    names = ("=1+1", "@SUM(1;1)", "-2+3", "plain")
    shots = [rated(name, 1.1 + 0.01 * i, 300.0 + 50.0 * i, group="=0") for i, name in enumerate(names)]
    write_tables(tmp_path, tables(compare(shots, grouped_by="material")))
    found = {path.name: cells(path) for path in tmp_path.glob("*.csv")}
    assert len(found) >= 5
    assert [cell for texts in found.values() for cell in formulas(texts)] == []
    # Guarded, not lost.
    assert {"'=1+1", "'@SUM(1;1)", "'-2+3", "plain"} <= set(found["rate_shots.csv"])


def test_the_reporting_table_guards_what_a_shot_file_says() -> None:
    (row,) = list(csv.reader(as_csv((Row("hardware", "camera", "=cmd()"),)).splitlines()))[1:]
    assert row == ["hardware", "camera", "'=cmd()"]
