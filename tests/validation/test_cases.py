"""Small files of real kinds that were once read wrongly: each gives the right value by its command."""

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from kolsky.cli import app

CLOCKS = {
    "clock/rate_in_khz.csv": (0.0, 1.25e-6),
    "clock/interval_in_ms.csv": (0.0, 1e-6),
    "clock/rate_and_column.csv": (0.0, 2e-6),
    "clock/decimal_comma.lvm": (0.0, 2.5e-6),
    "clock/sequence_from_40.csv": (-120e-6, 2e-6),
    "tables/lines_in_quotes.csv": (0.0, 1e-6),
}
"""File -> time of the first of 120 samples and from sample to sample [s]."""


def channels(path: Path) -> list[dict[str, Any]]:
    run = CliRunner().invoke(app, ["channels", str(path), "--json"])
    assert run.exit_code == 0, run.output
    found: list[dict[str, Any]] = json.loads(run.stdout)["channels"]
    return found


@pytest.mark.parametrize("name", CLOCKS)
def test_clock(name, shared):
    start, interval = CLOCKS[name]
    (channel,) = channels(shared / "data/cases" / name)
    assert channel["samples"] == 120
    assert channel["start"] == pytest.approx(start, abs=1e-9 * interval)
    assert channel["interval"] == pytest.approx(interval, rel=1e-9)


def test_channels_that_start_apart(shared):
    a, b = channels(shared / "data/cases/clock/starts_apart.tdms")
    assert b["start"] - a["start"] == pytest.approx(150e-6, abs=1e-12)


def test_rate_and_duration_are_printed_in_words(shared):
    run = CliRunner().invoke(app, ["channels", str(shared / "data/cases/clock/rate_in_khz.csv")])
    assert "800 kHz, 120 samples, 150 us" in run.stdout


def test_one_column_of_decimal_commas(shared):
    (channel,) = channels(shared / "data/cases/tables/one_column_decimal_comma.csv")
    assert (channel["name"], channel["unit"], channel["samples"]) == ("Kraft [N]", "N", 120)


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("quasi_static.xlsx", {"Strain": "%", "Stress": "MPa"}),
        ("units_line_in_brackets.csv", {"Displacement": "mm", "Force": "kN"}),
        ("short_under_remarks.txt", {"stretch": None, "stress (kPa)": "kPa"}),
    ],
)
def test_names_and_units_of_columns(name, columns, shared):
    found = channels(shared / "data/cases/tables" / name)
    assert {channel["name"]: channel["unit"] for channel in found} == columns
