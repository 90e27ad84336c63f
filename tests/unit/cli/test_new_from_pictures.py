"""`kolsky new --pictures`: series of the test and of a target are distinguished; facts remain blank."""

import json
import shutil
import tomllib
from pathlib import Path

import numpy as np
import tifffile
from shot_folders import OPEN_01
from typer.testing import CliRunner

from dic.basics import cv2
from kolsky.base.toml import blanks
from kolsky.cli import app
from kolsky.survey.blank_file import template
from kolsky.survey.pictures import picture_findings, survey_pictures
from kolsky.survey.signals import Findings
from kolsky.survey.tables import survey

runner = CliRunner()
FRAMES = 186
"""Of open-01, whose frames' file is used."""


def folder_of(path: Path, *, size: tuple[int, int] = (8, 12), count: int = FRAMES) -> Path:
    """A shot with two TIFF series of 6 x 8 px and two numbered ones of a target."""
    path.mkdir()
    for name in ("scope.csv", "frames.csv", "quasi_static.csv"):
        shutil.copy(OPEN_01 / name, path)
    for camera in ("left", "right"):
        tifffile.imwrite(path / f"{camera}.tif", np.zeros((count, 6, 8), np.uint16), photometric="minisblack")
        (path / "board").mkdir(exist_ok=True)
        for k in range(4):
            cv2.imwrite(str(path / "board" / f"{camera}_{k:02d}.png"), np.zeros(size, np.uint8))
    return path


def test_series_of_test_and_target_are_written_and_the_rest_is_blank(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "shot")
    said = json.loads(runner.invoke(app, ["new", "--pictures", "--json", str(folder)]).stdout)
    text = (folder / "shot.toml").read_text("utf-8")
    declared = tomllib.loads(text)
    assert declared["pictures"] == {
        "camera_0": {"file": "left.tif", "crop_offset": ["", ""]},
        "camera_1": {"file": "right.tif", "crop_offset": ["", ""]},
    }
    assert declared["calibration"]["camera_0"] == "board/left_*.png"
    assert declared["calibration"]["camera_1"] == "board/right_*.png"
    assert "file" not in declared["calibration"]
    assert said["found"]["pictures.camera_1"] == "right.tif"
    empty = {key for key in blanks(declared) if key.startswith(("pictures.", "calibration."))}
    assert empty == {
        "pictures.camera_0.crop_offset", "pictures.camera_1.crop_offset", "calibration.distortion",
        "calibration.target.kind", "calibration.target.columns", "calibration.target.rows",
    }  # fmt: skip
    assert "# left.tif: 186 pictures of 8 x 6 px; camera 0 by the order of the names" in text
    assert "# board/left_*.png: 4 pictures of 12 x 8 px; crop_offset counts from their top left" in text


def test_pictures_as_large_as_the_targets_were_not_cut(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "shot", size=(6, 8))
    shown = Findings()
    picture_findings(survey_pictures(folder, survey(folder)), shown)
    values = shown.values
    assert values["pictures.camera_0"] == '{ file = "left.tif", crop_offset = [0, 0] }'


def test_a_series_of_another_length_is_not_the_tests(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "shot", count=FRAMES - 1)
    found = survey_pictures(folder, survey(folder))
    assert found.test == found.target == ()
    assert [one.name for one in found.others] == [
        "board/left_*.png", "board/right_*.png", "left.tif", "right.tif",
    ]  # fmt: skip
    done = runner.invoke(app, ["new", "--pictures", str(folder)])
    assert "left.tif: 185 pictures of 8 x 6 px: not clearly part of the shot" in done.stdout
    assert (folder / "shot.toml").read_text("utf-8").count("[calibration.target]") == 1


def test_three_series_of_the_tests_length_are_left_open(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "shot")
    shutil.copy(folder / "left.tif", folder / "middle.tif")
    assert survey_pictures(folder, survey(folder)).test == ()


def test_an_empty_folder_gives_the_template(tmp_path: Path) -> None:
    assert runner.invoke(app, ["new", "--pictures", str(tmp_path)]).exit_code == 0
    assert (tmp_path / "shot.toml").read_text("utf-8") == template(pictures=True)


def test_what_is_blank_is_asked_for_with_examples_of_its_own(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "shot")
    assert runner.invoke(app, ["new", "--pictures", str(folder)]).exit_code == 0
    said = runner.invoke(app, ["check", str(folder)]).stderr
    asked = {line.partition(": ")[2].partition(" is not")[0]: line for line in said.splitlines()}
    assert '"fiducial_dots"' in asked["calibration.target.kind"]
    assert 'e.g. "0.0112 V/N"' in asked["force.sensitivity"]
    # Pictures that never change show no motion, and [uncertainty] is optional.
    assert "frames.static" in asked
    assert not any(key.startswith("uncertainty") for key in asked)
    # A side that bulges is read too near to the axis by subsets that do not bend.
    written = tomllib.loads((folder / "shot.toml").read_text("utf-8"))["dic"]
    assert (written["subset"], written["step"], written["shape"]) == (25, 6, "quadratic")


def test_pictures_show_the_frames_at_rest(tmp_path: Path) -> None:
    """A noisy pattern that moves from picture 20 on: nine tenths of the 20 before are frames at rest."""
    folder = folder_of(tmp_path / "shot")
    noise = np.random.default_rng(3)
    scene = noise.uniform(200.0, 800.0, (40, 48 + FRAMES))
    for camera in ("left", "right"):
        still = [scene[:, max(0, k - 19) :][:, :48] for k in range(FRAMES)]
        stack = np.array([part + noise.normal(0.0, 3.0, part.shape) for part in still]).astype(np.uint16)
        tifffile.imwrite(folder / f"{camera}.tif", stack, photometric="minisblack")
    assert runner.invoke(app, ["new", "--pictures", str(folder)]).exit_code == 0
    text = (folder / "shot.toml").read_text("utf-8")
    assert tomllib.loads(text)["frames"]["static"] == 18
    assert "# left.tif: the first clear motion is in frame 20" in text
