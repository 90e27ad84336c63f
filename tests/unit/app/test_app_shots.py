"""The list of shots: states, one file a shot, the campaign's table, and the page."""

from __future__ import annotations

import builtins
import csv
import io
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("nicegui", reason="the extra `app` is not installed")

from nicegui.testing import User
from simulated import walk
from synthetic import synthetic

from kolsky.app.shots import campaign_csv, list_shots, table_row
from kolsky.base.files import write_table
from kolsky.results.tables import summary_row


def tree(root: Path, count: int = 3) -> Path:
    """Identified shots, one that is not, one with a blank, one without a shot file."""
    row = summary_row(synthetic(), 400.0)
    for i in range(count):
        folder = root / f"day {i % 2}" / f"shot-{i}"
        (folder / "results").mkdir(parents=True)
        (folder / "shot.toml").write_text("format = 1\n")
        write_table(folder / "results" / "summary.csv", row)
        os.utime(folder / "shot.toml", (1e9, 1e9))
    for name, text in (("ready", "format = 1\n"), ("blank", '[specimen]\ndiameter = ""  # > 0\n')):
        (root / name).mkdir()
        (root / name / "shot.toml").write_text(text)
    (root / "plane").mkdir()
    (root / "plane" / "dic.toml").write_text("format = 1\n")
    (root / "raw").mkdir()
    (root / "raw" / "scope.csv").write_text("a,b\n1,2\n")
    (root / "empty").mkdir()
    return root


def test_every_state(tmp_path: Path) -> None:
    listed = {one.name: one for one in list_shots(tree(tmp_path))}
    assert {name: one.state for name, one in listed.items()} == {
        "day 0/shot-0": "finished",
        "day 0/shot-2": "finished",
        "day 1/shot-1": "finished",
        "plane": "pictures only",
        "ready": "ready to run",
        "blank": "not filled in",
        "raw": "no shot.toml",
    }
    done = listed["day 0/shot-0"]
    estimate = synthetic().estimates["stiffness_factor"]
    assert done.rate == 400.0
    assert done.verdict == estimate.outcome.value
    assert done.number("stiffness_factor (1)") == pytest.approx(estimate.value, rel=1e-6)
    assert done.number("U stiffness_factor (1)") == pytest.approx(2.0 * estimate.sigma, rel=1e-6)
    (tmp_path / "day 0" / "shot-0" / "shot.toml").write_text("format = 1 # later\n")
    assert next(one.state for one in list_shots(tmp_path) if one.name == "day 0/shot-0") == "changed since"


@pytest.mark.parametrize("content", [b"", b"a,b\n", b"\xff\xfe,\n1,2\n"], ids=["empty", "no row", "no text"])
def test_a_damaged_summary_is_a_row_and_no_end(content: bytes, tmp_path: Path) -> None:
    root = tree(tmp_path, 2)
    (root / "day 0" / "shot-0" / "results" / "summary.csv").write_bytes(content)
    states = {one.name: one.state for one in list_shots(root)}
    assert states["day 0/shot-0"] == "summary.csv cannot be read"
    assert states["day 1/shot-1"] == "finished"


def test_of_each_shot_one_file_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """So that 2 000 shots are listed in a second: the time is in benchmarks/app_shots.py."""
    root, opened = tree(tmp_path, 12), []
    real = io.open

    def counting(file: Any, *more: Any, **named: Any) -> Any:
        opened.append(str(file))
        return real(file, *more, **named)

    monkeypatch.setattr(io, "open", counting)
    monkeypatch.setattr(builtins, "open", counting)
    found = list_shots(root)
    inside = [name for name in opened if name.startswith(str(root))]
    assert len(found) == 16
    assert len(inside) == 14  # none of the folders without a shot file
    assert len(set(inside)) == len(inside)


def test_a_row_is_sorted_by_numbers_and_shows_the_digits_that_count(tmp_path: Path) -> None:
    rows = [table_row(one) for one in list_shots(tree(tmp_path, 1))]
    done = next(row for row in rows if row["state"] == "finished")
    assert isinstance(done["m_number"], float)
    assert re.fullmatch(r"[\d.]+", done["m"])
    assert done["link"].startswith("/look?shot=day+0%2Fshot-0")
    other = next(row for row in rows if row["state"] == "no shot.toml")
    assert other["m_number"] is None
    assert other["link"].startswith("/setup")
    assert next(row["link"] for row in rows if row["name"] == "plane") == "/pictures?shot=plane"


def test_the_campaign_is_one_table(tmp_path: Path) -> None:
    rows = list(csv.DictReader(io.StringIO(campaign_csv(list_shots(tree(tmp_path, 2))))))
    assert [row["folder"] for row in rows] == ["day 0/shot-0", "day 1/shot-1"]
    assert np.isclose(float(rows[0]["nominal strain rate (1/s)"]), 400.0)


def test_the_page_lists_and_names_them(tmp_path: Path) -> None:
    root = tree(tmp_path / "root")

    async def steps(user: User) -> None:
        await user.open("/")
        await user.should_see("7 shots below")
        user.find("Compare the chosen").click()
        await user.should_see("Choose two shots or more.")
        await user.open("/setup?shot=..")
        await user.should_see("there is no folder")

    walk(root, tmp_path / "main.py", steps)
