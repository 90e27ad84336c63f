"""`kolsky dic` on a dic.toml: files, tables and page from synthetic pictures with a known displacement."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from boards import CALIBRATION, LENS, MATRIX, SHIFT, board_series
from kolsky_command import json_of, rows_of, run_kolsky
from speckle_pictures import render, speckle_pattern

from dic.camera_files import read_rig
from dic.outcome import PointOutcome
from kolsky.base.errors import InputError
from kolsky.pictures.dic_file import read_full_field
from kolsky.pictures.measurement import mask_of, measure_file, read_measurement
from kolsky.report.pages.surfaces import summary
from kolsky.schema.pictures import find_measurement_file
from kolsky.schema.shot_file import shot_toml

STRETCH = (1.02, 0.97)
SIDE, NOISE = 128, 2.0
TOML = """
[dic]
kind = "plane"
region = {{ x = [16, 111], y = [16, 111] }}
exclude = [{{ polygon = [[50, 50], [70, 50], [70, 70], [50, 70]] }}]
step = 8
{more}

[pictures]
camera_0.pattern = "cam0_*.png"

[extensometers.axial]
ends = [[30, 24], [30, 104]]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three pictures: two at rest, one stretched about the middle; numbered."""
    place = tmp_path_factory.mktemp("plane")
    pattern = speckle_pattern((SIDE, SIDE), seed=3)
    middle = np.array([63.5, 63.5])
    motions = (None, None, lambda x: middle + (x - middle) / np.array(STRETCH))
    for k, motion in enumerate(motions):
        picture = render(pattern, (SIDE, SIDE), material=motion, noise=NOISE, bits=8, seed=k)
        cv2.imwrite(str(place / f"cam0_{k:03d}.png"), picture.astype(np.uint8))
    (place / "dic.toml").write_text(TOML.format(more='scale = "0.01 mm"\nstatic = 2'))
    return place


@pytest.fixture(scope="module")
def done(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("results")
    return out, json_of("dic", folder, "--out", out, "--csv", "--vtu")


def test_a_plane_stretch_comes_out_with_its_extensometer(done):
    said = done[1]
    xx, yy, xy = said["mean_strain_xx_yy_xy"]
    # 150 gauges, each known to some 1e-3: their mean to some 1e-4
    assert (xx, yy) == pytest.approx([0.5 * (s**2 - 1.0) for s in STRETCH], abs=5e-4)
    assert xy == pytest.approx(0.0, abs=5e-4)
    axial = said["extensometers"]["axial"]
    assert axial["elongation_m"] == pytest.approx(80e-5 * (STRETCH[1] - 1.0), abs=4.0 * axial["sigma_m"])
    assert said["grey_noise"] == pytest.approx([NOISE], rel=0.03)
    # at the corner of what is excluded a quarter of a subset and a bit is left
    assert set(said["points_lost"]) <= {"out of view"}
    assert said["points_found_share"] > 0.97


def test_the_errors_of_points_are_those_that_are_stated(done):
    result = read_full_field(done[0] / "dic.h5")
    truth = (result.points - 63.5) * (np.array(STRETCH) - 1.0) * 1e-5
    off = (result.surface.u[2, :, :2] - truth) / result.surface.sigma[2, :, :2]
    off = off[result.surface.valid[2]]
    # 139 points, their subsets overlap: some 40 independent ones a component
    assert np.sqrt(np.mean(off**2)) == pytest.approx(1.0, abs=0.25)
    assert (result.kind, result.unit, result.timed) == ("plane", "m", False)
    inside = (np.abs(result.points - 60) <= 10).all(axis=1)
    assert not inside.any()


def test_files_tables_and_page_are_there(done):
    out, _ = done
    rows = rows_of(out / "csv" / "frame_0002.csv")
    lost = [row for row in rows if row["outcome"] != "VALID"]
    assert all(row["U (m)"] == "" for row in lost)
    assert float(rows[40]["U (m)"]) == pytest.approx((float(rows[40]["x0 (px)"]) - 63.5) * 2e-7, abs=3e-7)
    assert (out / "vtu" / "field_00002.vtu").stat().st_size > 1000
    history = rows_of(out / "history.csv")
    assert [row["points"] for row in history] == [str(len(rows) - len(lost))] * 3
    page = (out / "dic.html").read_text()
    assert "extensometer axial" in page
    assert "<script" not in page


def test_noise_without_static_frames_comes_from_the_matches(folder, tmp_path):
    for picture in folder.glob("*.png"):
        (tmp_path / picture.name).write_bytes(picture.read_bytes())
    (tmp_path / "dic.toml").write_text(TOML.format(more=""))
    result = measure_file(read_measurement(tmp_path / "dic.toml"))
    assert result.unit == "px"
    assert result.facts["noise_from"] == "residuals of the matches"
    assert result.noise == pytest.approx([NOISE], rel=0.1)  # interpolation and rounding are in it
    assert summary(result)["points"] == len(result.points)
    assert set(result.outcomes()) <= {PointOutcome.VALID, PointOutcome.OUT_OF_VIEW}


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (('kind = "plane"', 'kind = "flyer test"'), "shot.toml"),
        (('kind = "plane"', 'kind = "surface"'), "has no camera_1"),
        (("step = 8", 'radius = "6 mm"'), "no effect"),
        (("step = 8", 'mask = "none.png"'), "none.png"),
        (('"cam0_*.png"', '"cam7_*.png"'), "camera_0"),
        (("[30, 24]", "[3, 3]"), "place it on the region"),
        (("step = 8", "reference = 9"), "there are 3 frames"),
        (("x = [16, 111]", "x = [50, 51]"), "inside it"),
    ],
)
def test_what_cannot_be_measured_is_refused_with_its_cure(folder, tmp_path, wrong, said):
    for picture in folder.glob("*.png"):
        (tmp_path / picture.name).write_bytes(picture.read_bytes())
    text = TOML.format(more="")
    assert wrong[0] in text
    (tmp_path / "dic.toml").write_text(text.replace(*wrong))
    with pytest.raises(InputError, match=said):
        measure_file(read_measurement(tmp_path / "dic.toml"))


def test_a_mask_is_white_where_it_is_measured(folder, tmp_path):
    for picture in folder.glob("*.png"):
        (tmp_path / picture.name).write_bytes(picture.read_bytes())
    white = np.zeros((SIDE, SIDE), np.uint8)
    white[:40] = 255
    cv2.imwrite(str(tmp_path / "mask.png"), white)
    (tmp_path / "dic.toml").write_text(TOML.format(more='mask = "mask.png"'))
    mask = mask_of(read_measurement(tmp_path / "dic.toml"))
    assert mask[16:40, 16:112].all()
    assert not mask[40:].any()
    assert not mask[:16].any()
    cv2.imwrite(str(tmp_path / "mask.png"), white[:50])
    with pytest.raises(InputError, match="128 x 50 px"):
        mask_of(read_measurement(tmp_path / "dic.toml"))


def test_a_shot_is_not_taken_for_a_measurement(folder, tmp_path):
    assert find_measurement_file(folder) == folder / "dic.toml"
    (tmp_path / "shot.toml").write_text('[dic]\nkind = "plane"\n')
    assert find_measurement_file(tmp_path) is None
    with pytest.raises(InputError, match=r"dic\.toml"):
        shot_toml(tmp_path)


@pytest.fixture(scope="module")
def series(tmp_path_factory) -> Path:
    """Seven pairs of a board with calibration.toml; the fourth and the sixth of camera 1 are swapped."""
    return board_series(tmp_path_factory.mktemp("series"))


@pytest.fixture(scope="module")
def calibrated(series, tmp_path_factory):
    """One run with everything it can write."""
    out = tmp_path_factory.mktemp("out")
    return run_kolsky(
        "calibrate", series, "--out", out, "--export", "dice,opencorr", "--figures", "png", "--json"
    ), out


@pytest.mark.slow
def test_the_answer_is_one_json_object_with_the_true_cameras(calibrated):
    result, _ = calibrated
    answer = json.loads(result.stdout)
    assert [pair["outcome"] for pair in answer["pairs"]] == [
        *["VALID"] * 3, "INCONSISTENT", "VALID", "INCONSISTENT", "VALID",
    ]  # fmt: skip
    sigma = answer["sigma"]
    for camera, given in enumerate(answer["cameras"]):
        for name, found, true in (
            ("fx", given["matrix"][0][0], MATRIX[0, 0]),
            ("cy", given["matrix"][1][2], MATRIX[1, 2]),
        ):
            assert abs(found - true) < 4 * sigma[f"{name}{camera}"]
        assert abs(given["distortion"][0] - LENS[0]) < 4 * sigma[f"k1{camera}"]
        assert given["sensor"] == [320, 240]
    assert abs(answer["translation"][2] - SHIFT[2]) < 4 * sigma["tz"]
    assert sum("was left out" in line for line in answer["warnings"]) == 2


@pytest.mark.slow
def test_the_files_say_the_same(calibrated):
    result, out = calibrated
    answer = json.loads(result.stdout)
    rig = read_rig(out / "rig.yml")
    assert rig.covariance is not None
    for camera, given in zip(rig.cameras, answer["cameras"], strict=True):
        np.testing.assert_allclose(camera.matrix, given["matrix"], rtol=1e-9)
        assert camera.sensor == (320, 240)
    np.testing.assert_allclose(rig.relative[1], answer["translation"], rtol=1e-9)
    sigma = np.sqrt(np.diag(rig.covariance))
    np.testing.assert_allclose(sigma, [answer["sigma"][name] for name in rig.parameter_names], rtol=1e-6)
    for name in ("rig-dice.xml", "rig-opencorr.txt"):
        # these programs' files hold six digits or more
        np.testing.assert_allclose(read_rig(out / name).relative[1], answer["translation"], atol=1e-6)
    rows = rows_of(out / "calibration.csv")
    used = [row for row in rows if row["used"] == "1"]
    residual = [[float(row["residual x (px)"]), float(row["residual y (px)"])] for row in used]
    rms = np.sqrt(np.mean(np.sum(np.square(residual), axis=1)))
    assert rms == pytest.approx(answer["checks"]["fit_rms"], abs=1e-5)
    page = (out / "calibration.html").read_text("utf-8")
    assert page.count("<svg") == 2
    assert "left out" in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert {path.name for path in (out / "figures").iterdir()} == {
        "calibration-pairs.png", "calibration-residuals.png",
    }  # fmt: skip


@pytest.mark.slow
def test_the_table_names_pairs_and_intervals(series, tmp_path):
    result = run_kolsky("calibrate", series / "calibration.toml", "--out", tmp_path / "results")
    assert "5 of 7" in result.stdout
    assert "camera 0, fx" in result.stdout
    assert "inconsistent" in result.stdout
    assert "pair 3 was left out" in result.stderr


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('"fiducial_dots"', '"stars"'), "is not a known target"),
        (("hole =", "marker ="), "has no such dimension"),
        (('diameter = "0.6 mm"\n', ""), 'diameter is missing; the target "'),
        (('"0.6 mm"', '"3 mm"'), "below the pitch"),
        (('distortion = "k1 k2 p1 p2"', 'distortion = "k9"'), "is not allowed"),
        (("left_*", "nothing_*"), "cannot be used"),
        (
            ("rows = 8", "rows = 8\nanchors_0 = [[1, 1, 2.0, 3.0], [2, 1, 9.0, 3.0], [1, 2, 2.0, 9.0]]"),
            "no anchors",
        ),
        (("[calibration]", '[calibration]\nfile = "rig.xml"'), "so it would have no effect"),
        (("[calibration]", "[calibration]\nroom = 3"), "is not a known key"),
        (("rows = 8", "rows = 4"), "rows 0 to 3"),
        (("diameter", "dark = false\ndiameter"), "does not determine the cameras"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(tmp_path, change, said):
    for name in ("left_0", "left_1", "right_0", "right_1"):
        cv2.imwrite(str(tmp_path / f"{name}.png"), np.full((120, 160), 99, np.uint8))
    (tmp_path / "calibration.toml").write_text(CALIBRATION.replace(*change))
    result = run_kolsky("calibrate", tmp_path, code=2)
    assert said in result.stderr
    assert not (tmp_path / "results").exists()


def test_a_folder_without_a_description_says_so(tmp_path):
    result = run_kolsky("calibrate", tmp_path, code=2)
    assert "has neither calibration.toml nor shot.toml" in result.stderr
    run_kolsky("calibrate", tmp_path, "--export", "word", code=2)
