"""The recordings behind an identification as its report shows them."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from barrecord import classical_shot
from synthetic import synthetic
from synthetic_dic import synthetic_result
from test_cli_new_check import OPEN_01

from dic.output import write_result
from kolsky.dicsummary import printed
from kolsky.errors import InputError
from kolsky.recorded import Recorded, recorded, recording_facts, surface_of
from kolsky.report.canvas import build
from kolsky.report.figures import RECORDINGS
from kolsky.report.labels import label
from kolsky.report.page import render
from kolsky.shots import load_shot

PICTURED = """
[pictures]
camera_0 = { file = "cam0.tif", crop_offset = [192, 192] }
camera_1 = { file = "cam1.tif", crop_offset = [192, 192] }
bits = 12

[calibration]
camera_0 = "calibration/cam0_*.png"
camera_1 = "calibration/cam1_*.png"
distortion = "k1"

[calibration.target]
kind = "fiducial_dots"
columns = 14
rows = 10
pitch = "1.2 mm"
diameter = "0.6 mm"
hollow = [[2, 2], [11, 2], [2, 7]]

[dic]
flyer_side = "up"
strip_half_width = "0.6 mm"
"""
"""What stands in place of the exports in the file of a shot with pictures."""


@pytest.fixture(scope="module")
def seen() -> Recorded:
    return recorded(load_shot(OPEN_01), OPEN_01, OPEN_01 / "results")


@pytest.fixture
def no_old_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """The figures of the result have tests of their own, and take most of a page's time."""
    monkeypatch.setattr("kolsky.report.page.REGISTRY", {})


def test_recordings_are_those_of_the_files(seen: Recorded) -> None:
    rows = np.loadtxt(OPEN_01 / "scope.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(seen.time, rows[:, 0])  # its clock is the shot's
    rest = (rows[:, 0] >= -200e-6) & (rows[:, 0] <= 0.0)
    assert min(abs(rows[rest, 1:].mean(axis=0) - seen.zero)) < 1e-12  # round-off of the mean
    motion = seen.motion
    later = np.isfinite(motion.residual)
    # The noise is that of the declared 1 um, or as the shot says 0.6 to 0.9: the fit neither lags nor rings.
    assert 0.4e-6 < np.sqrt(np.mean(motion.residual[later] ** 2)) < 1.2e-6
    assert motion.time[0] == seen.window[0]
    assert seen.surface == {}


def test_bars_alone_show_the_velocity_of_the_face() -> None:
    shot = classical_shot(0)
    motion = recorded(shot, Path("none"), Path("none")).motion
    assert motion.is_velocity
    later = np.isfinite(motion.residual)
    assert later.any()
    # White noise of the declared size, of which the path takes up some.
    assert 0.5 < np.sqrt(np.mean(motion.residual[later] ** 2)) / motion.sigma[0] < 1.2
    facts = recording_facts(shot)
    assert facts["force_from"] == "waves in the transmission bar"
    assert facts["window_end_s"] == shot.window[1]


@pytest.mark.parametrize("bars", [False, True])
@pytest.mark.parametrize("name", RECORDINGS)
def test_figures_of_recordings_have_units(name: str, bars: bool, seen: Recorded) -> None:
    shown = recorded(classical_shot(0), Path("none"), Path("none")) if bars else seen
    for ax in build(RECORDINGS[name], shown).axes:
        assert re.fullmatch(r".+ \([^()]+\)", ax.get_ylabel())
    assert RECORDINGS[name].caption(shown).endswith(".")


@pytest.mark.usefixtures("no_old_figures")
def test_every_recording_fact_has_words(seen: Recorded) -> None:
    facts = recording_facts(load_shot(OPEN_01)) | recording_facts(classical_shot(0))
    assert not [key for key in facts if label(f"recordings.{key}") == f"recordings.{key}"]


def test_the_surface_is_that_of_the_results_folder(tmp_path: Path) -> None:
    text = (OPEN_01 / "shot.toml").read_text(encoding="utf-8")
    for name in ("flyer", "centre_line"):
        text = re.sub(rf"(?ms)^\[{name}\].*?(?=^\[)", "", text)
    (tmp_path / "shot.toml").write_text(text + PICTURED, encoding="utf-8")
    made = synthetic_result()
    write_result(tmp_path / "dic.h5", made, key="any")
    shown = surface_of(tmp_path, tmp_path)
    assert shown["surface"] == printed(made)
    assert (shown["surface_file"], shown["surface_page"]) == ("dic.h5", "")
    (tmp_path / "dic.html").touch()
    assert surface_of(tmp_path, tmp_path)["surface_page"] == "dic.html"
    (tmp_path / "dic.h5").write_bytes(b"no such thing")
    with pytest.raises(InputError, match="kolsky dic"):
        surface_of(tmp_path, tmp_path)
    assert surface_of(OPEN_01, tmp_path) == {}  # measured by others: no pictures were correlated


@pytest.mark.usefixtures("no_old_figures")
def test_surfaces_are_shown_and_linked(seen: Recorded) -> None:
    shown = replace(
        seen, surface={"points": "2000, 1990 alive"}, surface_file="dic.h5", surface_page="dic.html"
    )
    html = render(synthetic(), shown)
    assert "2000, 1990 alive" in html
    assert '<a href="dic.html">' in html
    assert "<a href" not in render(synthetic(), replace(shown, surface_page=""))
    assert 'id="surface"' not in render(synthetic(), seen)
