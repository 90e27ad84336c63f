"""The how-to of the first bar test, executed from the raw file to the page."""

import csv
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from kolsky_command import json_of, run_kolsky
from module_files import module_at

ROOT = Path(__file__).parents[3]
MADE = ROOT / "runs" / "bar-01"
PAGE = (ROOT / "docs" / "howto" / "first_bar_test.md").read_text(encoding="utf-8")
FLOW, GROWTH = 120e6, 0.02  # the specimen's stress is FLOW (1 - exp(-strain / GROWTH)), as the page says


def test_the_raw_file_is_the_scripts(tmp_path):
    module_at(MADE / "make_raw.py").main(tmp_path / "raw.csv")
    made, shipped = (
        np.genfromtxt(path, delimiter=",", skip_header=5)
        for path in (tmp_path / "raw.csv", MADE / "tek0017.csv")
    )
    # Another machine's Fourier transform may round the last printed digit the other way.
    np.testing.assert_allclose(made, shipped, atol=1.5e-3)


def declared(path: Path) -> list[str]:
    """The lines of a shot file but for remarks, blank lines and the name."""
    text = path.read_text(encoding="utf-8")
    return [line for line in text.splitlines() if line and not line.startswith(("#", "name"))]


@pytest.fixture(scope="module")
def first(tmp_path_factory) -> Path:
    """The reader's folder after the third step."""
    folder = tmp_path_factory.mktemp("walk") / "first"
    folder.mkdir()
    shutil.copy(MADE / "tek0017.csv", folder)
    assert "2  CH1 (mV)  mV  4000 samples" in run_kolsky("channels", folder / "tek0017.csv").stdout
    run_kolsky("new", folder, "--bars")
    blank, filled = (declared(place / "shot.toml") for place in (folder, MADE))
    for empty, full in zip(blank, filled, strict=True):
        # What is not blank in the new file stands in the filled one: the reader changes nothing else.
        assert empty == full or '""' in empty, (empty, full)
    shutil.copy(MADE / "shot.toml", folder)
    return folder


def test_check_shows_what_step_4_says(first):
    said = json_of("check", first)
    assert 500e-6 < said["gauges.incident"]["largest_strain"]["value"] < 2e-3
    assert "than predicted" in said["waves"]["reflected_pulse"]["value"]


def test_the_page_holds_the_answer_that_was_made(first):
    said = json_of("waves", first)
    named = re.findall(r"`(waves[\w.]*)`", PAGE)
    assert {"waves.html", "waves_database.csv"} < set(named)
    for name in named:
        if "." in name:
            assert (first / "results" / name).exists(), name
    assert said["remarks"] == [] or all("nonlinearly" in remark for remark in said["remarks"])
    with (first / "results" / "waves.csv").open(encoding="utf-8") as file:
        head, *rows = list(csv.reader(file))
    table = dict(zip(head, np.array(rows, float).T, strict=True))
    first_time, last = (said["facts"][f"plateau {end}"]["value"] for end in ("from", "to"))
    inside = (table["time (s)"] >= first_time) & (table["time (s)"] <= last)
    true = float(np.mean(FLOW * (1.0 - np.exp(-table["strain, three waves (1)"][inside] / GROWTH))))
    quoted = said["results"]["mean stress"]
    low, high = quoted["interval"]
    assert low < true < high
    assert quoted["value"] == pytest.approx(true, rel=0.02)
