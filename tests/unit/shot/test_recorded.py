"""The recordings of an identification in its report."""

import re
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from barrecord import classical_shot
from shot_folders import OPEN_01
from synthetic import synthetic
from synthetic_dic import SIDE, synthetic_result

from kolsky.base.errors import InputError
from kolsky.pictures.dic_file import write_stereo_result
from kolsky.pictures.picture_set import PicturePair
from kolsky.pictures.summary import numbers, printed
from kolsky.report.canvas import build
from kolsky.report.figures import RECORDINGS
from kolsky.report.pages.identification import render
from kolsky.results.display import recorded_label
from kolsky.results.hdf5 import read_identification, write_identification
from kolsky.shot.load import load_shot
from kolsky.shot.recordings import ShotRecordings, recording_facts, shot_recordings, surface_of

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
def seen() -> ShotRecordings:
    return shot_recordings(load_shot(OPEN_01), OPEN_01 / "results")


@pytest.fixture
def no_old_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """The figures of the result have tests of their own, and take most of a page's time."""
    monkeypatch.setattr("kolsky.report.pages.identification.REGISTRY", {})


def test_recordings_are_those_of_the_files(seen: ShotRecordings) -> None:
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
    motion = shot_recordings(shot, Path("none")).motion
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
def test_figures_of_recordings_have_units(name: str, bars: bool, seen: ShotRecordings) -> None:
    shown = shot_recordings(classical_shot(0), Path("none")) if bars else replace(seen, pair=pair())
    if not RECORDINGS[name].applies(shown):
        pytest.skip("nothing to draw")
    for ax in build(RECORDINGS[name], shown).axes:
        assert re.fullmatch(r".+ \([^()]+\)", ax.get_ylabel())
    assert RECORDINGS[name].caption(shown).endswith(".")


@pytest.mark.usefixtures("no_old_figures")
def test_every_recording_fact_has_words(seen: ShotRecordings) -> None:
    facts = recording_facts(load_shot(OPEN_01)) | recording_facts(classical_shot(0))
    assert not [key for key in facts if recorded_label(f"recordings.{key}") == f"recordings.{key}"]


def test_the_surface_is_that_of_the_results_folder(tmp_path: Path) -> None:
    text = (OPEN_01 / "shot.toml").read_text(encoding="utf-8")
    for name in ("flyer", "centre_line"):
        text = re.sub(rf"(?ms)^\[{name}\].*?(?=^\[)", "", text)
    (tmp_path / "shot.toml").write_text(text + PICTURED, encoding="utf-8")
    made = synthetic_result()
    write_stereo_result(tmp_path / "dic.h5", made, key="any")
    shown = surface_of(tmp_path, tmp_path)
    assert shown["surface"] == printed(made)
    assert (shown["surface_file"], shown["surface_page"]) == ("dic.h5", "")
    assert shown["numbers"] == numbers(made)
    assert "frames.csv" in shown["pair"]  # there is none, and so no picture either
    (tmp_path / "dic.html").touch()
    assert surface_of(tmp_path, tmp_path)["surface_page"] == "dic.html"
    (tmp_path / "dic.h5").write_bytes(b"no such thing")
    with pytest.raises(InputError, match="kolsky dic"):
        surface_of(tmp_path, tmp_path)
    assert surface_of(OPEN_01, tmp_path) == {}  # measured by others: no pictures were correlated


@pytest.mark.usefixtures("no_old_figures")
def test_surfaces_are_shown_and_linked(seen: ShotRecordings) -> None:
    shown = replace(
        seen, surface={"points": "2000, 1990 alive"}, surface_file="dic.h5", surface_page="dic.html"
    )
    html = render(synthetic(), shown)
    assert "2000, 1990 alive" in html
    assert '<a href="dic.html">' in html
    assert "dic.html" not in render(synthetic(), replace(shown, surface_page=""))
    said = "There are no pictures: the motion of the flyer and the outline come from declared files"
    assert said in render(synthetic(), seen)
    said = render(synthetic(), replace(shown, pair="cam0.tif <is> missing"))
    assert "is shown: cam0.tif &lt;is&gt; missing." in said


def pair(frame: int = 15) -> PicturePair:
    """Made-up pictures under made-up points."""
    made = synthetic_result()
    left, right = np.random.default_rng(1).integers(0, 4096, size=(2, SIDE, SIDE), dtype=np.uint16)
    return PicturePair(made, frame, (left, right))


def test_the_pair_shows_the_valid_points_of_both_cameras(seen: ShotRecordings) -> None:
    shown = pair(35)
    figure = build(RECORDINGS["picture-pair"], replace(seen, pair=shown))
    body = shown.result.specimen
    valid = body.surface.valid[35]
    assert 0 < valid.sum() < valid.size  # some are lost there
    for ax, pixels in zip(figure.axes[:2], body.pixels, strict=True):
        lines, points = ax.collections
        np.testing.assert_array_equal(points.get_offsets(), pixels[35, valid])
        ends = np.concatenate([path.vertices for path in lines.get_paths()])
        assert np.isfinite(ends).all()  # none leads to a lost point
        # a full grid of m x n has m (n - 1) + n (m - 1) joints; points that are lost take theirs with them
        assert len(lines.get_paths()) < 19 * 16 + 17 * 18
    assert f"{valid.sum()} of {valid.size} points" in RECORDINGS["picture-pair"].caption(
        replace(seen, pair=shown)
    )


@pytest.mark.usefixtures("no_old_figures")
def test_every_number_of_the_surfaces_is_in_the_file(tmp_path: Path) -> None:
    made = synthetic_result()
    path = tmp_path / "identification.h5"
    write_identification(path, replace(synthetic(), image_correlation=numbers(made)))
    kept = read_identification(path).image_correlation
    rows = printed(made)
    assert rows["sigma of a match"] == f"{kept['sigma_match_px']:.4f} px"
    assert rows["epipolar rms"] == f"{kept['epipolar_rms_px']:.4f} px"
    assert f"{1e3 * kept['cylinder_radius_m']:.4f} mm" in rows["cylinder at rest"]
    assert f"{1e6 * kept['noise_floor_time_Z_m']:.2f} µm" in rows["noise floor in time"]
    assert f"{1e6 * kept['sigma_x_m']:.2f}, {1e6 * kept['sigma_y_m']:.2f}" in rows["sigma of x, y, Z"]
    for name, count in kept.items():
        if name.startswith("points_lost, "):
            assert f"{count:.0f} {name.removeprefix('points_lost, ')}" in rows["points lost, by outcome"]
    assert not np.isnan(kept["flyer_travel_m"])
    with h5py.File(path) as file:
        assert "entry/image_correlation/values" in file
