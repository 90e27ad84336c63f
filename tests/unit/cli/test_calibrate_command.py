"""`kolsky calibrate` on rendered pictures of two cameras: files, table, JSON, bad pairs, refusals."""

import csv
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from boards import LENS, MATRIX, averaged, dots, flat, pose
from typer.testing import CliRunner

from dic.camera_files import read_rig
from kolsky.cli import app

HOLLOW = ((2, 2), (7, 2), (2, 5))
MIDDLE = (5.4e-3, 4.2e-3)
TURN = cv2.Rodrigues(np.array([0.0, 0.2, 0.0]))[0]
SHIFT = np.array([0.0, 0.0, 0.1]) - TURN @ [0.0, 0.0, 0.1] + [1e-4, 2e-4, 0.0]

TOML = """
[calibration]
camera_0 = "left_*.png"
camera_1 = "right_*.png"
distortion = "k1 k2 p1 p2"

[calibration.target]
kind = "fiducial_dots"
columns = 10
rows = 8
pitch = "1.2 mm"
diameter = "0.6 mm"
hole = "0.28 mm"
hollow = [[2, 2], [7, 2], [2, 5]]
"""


@pytest.fixture(scope="module")
def series(tmp_path_factory) -> Path:
    """Seven pairs of a board with calibration.toml; the fourth and the sixth of camera 1 are swapped."""
    folder = tmp_path_factory.mktemp("series")
    paint = dots(10, 8, 1.2e-3, 0.6e-3, HOLLOW, 0.28e-3)
    rng = np.random.default_rng(5)
    second = []
    for k in range(7):
        R, t = pose(tuple(rng.uniform(-0.45, 0.45, 3)), MIDDLE, 0.1 + rng.uniform(-4e-3, 4e-3))
        cv2.imwrite(str(folder / f"left_{k}.png"), averaged(flat(paint, R, t), noise=1.5, seed=k))
        second.append(averaged(flat(paint, TURN @ R, TURN @ t + SHIFT), noise=1.5, seed=50 + k))
    second[3], second[5] = second[5], second[3]
    for k, picture in enumerate(second):
        cv2.imwrite(str(folder / f"right_{k}.png"), picture)
    (folder / "calibration.toml").write_text(TOML)
    return folder


def run(*arguments: object):
    """The command with these arguments."""
    return CliRunner().invoke(app, ["calibrate", *map(str, arguments)])


@pytest.fixture(scope="module")
def done(series, tmp_path_factory):
    """One run with everything it can write."""
    out = tmp_path_factory.mktemp("out")
    return run(series, "--out", out, "--export", "dice,opencorr", "--figures", "png", "--json"), out


@pytest.mark.slow
def test_the_answer_is_one_json_object_with_the_true_cameras(done):
    result, _ = done
    assert result.exit_code == 0, result.output
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
def test_the_files_say_the_same(done):
    result, out = done
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
    with (out / "calibration.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
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
    result = run(series / "calibration.toml", "--out", tmp_path / "results")
    assert result.exit_code == 0, result.output
    assert "5 of 7" in result.stdout
    assert "camera 0, fx" in result.stdout
    assert "inconsistent" in result.stdout
    assert "pair 3 was left out" in result.stderr


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (('"fiducial_dots"', '"stars"'), "is not a known target"),
        (("hole =", "marker ="), "has no such dimension"),
        (('diameter = "0.6 mm"\n', ""), "needs more"),
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
    (tmp_path / "calibration.toml").write_text(TOML.replace(*change))
    result = run(tmp_path)
    assert result.exit_code == 2
    assert said in result.stderr
    assert not (tmp_path / "results").exists()


def test_a_folder_without_a_description_says_so(tmp_path):
    result = run(tmp_path)
    assert result.exit_code == 2
    assert "has neither calibration.toml nor shot.toml" in result.stderr
    assert run(tmp_path, "--export", "word").exit_code == 2
