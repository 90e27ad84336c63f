"""Several shots in a page: their curves, their rate study, and shots that cannot be compared."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("nicegui", reason="the extra `app` is not installed")

from laboratory_files import OPEN_05
from nicegui import ui
from nicegui.testing import User
from ratedshots import found
from simulated import walk

from kolsky.base.files import write_table
from kolsky.results.hdf5 import write_identification
from kolsky.results.tables import summary_row
from kolsky.shot.load import load_shot

M = {"one": 1.10, "two": 1.14, "three": 1.12}


def shots(root: Path) -> None:
    """Copies of open-05 with made-up results."""
    shot = load_shot(OPEN_05)
    made_of = {
        "inputs": shot.inputs,
        "specimen": {name: getattr(shot.specimen, name) for name in ("diameter", "length", "density")},
        "window_s": list(shot.window),
    }
    for name, m in M.items():
        shutil.copytree(OPEN_05, root / name, ignore=shutil.ignore_patterns("results"))
        path = root / name / "shot.toml"
        text = path.read_text("utf-8").replace("format = 1", f'format = 1\nname = "{name}"', 1)
        path.write_text(text, encoding="utf-8")
        (root / name / "results").mkdir()
        result = found(name, m, parts={"force and shape": 0.01})
        result = replace(result, provenance={**result.provenance, **made_of})
        write_identification(root / name / "results" / "identification.h5", result)
        write_table(root / name / "results" / "summary.csv", summary_row(result, 400.0))


def test_curves_and_rate_study(tmp_path: Path) -> None:
    root = tmp_path / "root"
    shots(root)

    async def steps(user: User) -> None:
        await user.open("/compare?shots=one|two|three")
        await user.should_see("three: m = 1.120 ± 0.020 (k = 2)", retries=200)
        await user.should_see("mean m: 1.120")
        plots = list(user.find(ui.echart).elements)
        force = next(one for one in plots if "Forces of the shots" in str(one.props))
        assert [one["name"] for one in force.options["series"]] == [n for n in M for _ in range(2)]
        over_rate = next(one for one in plots if "over strain rate" in str(one.props))
        counted = next(one for one in over_rate.options["series"] if one["name"] == "counted")
        assert [row[1] for row in counted["data"]] == [M[name] for name in sorted(M)]
        bars = [one["data"] for one in over_rate.options["series"] if not one["name"]]
        assert [bar[1][1] - bar[0][1] for bar in bars] == pytest.approx([0.04] * 3)  # ± U, k = 2
        await user.open("/compare?shots=one|none")
        await user.should_see("there is no folder 'none'", retries=100)

    walk(root, tmp_path / "main.py", steps)
