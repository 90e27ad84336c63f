"""`kolsky new` and `kolsky check`: good shots, and every bad one answered with one line and exit code 2."""

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from damaged_shots import BAD
from kolsky_command import json_of, run_kolsky
from matplotlib import pyplot as plt
from shot_folders import FILES, OPEN_01, OPEN_02, ROOT, state
from typer.testing import CliRunner

from kolsky.cli import app
from kolsky.report.figures import CHECKS
from kolsky.report.figures.recordings import three_frames
from kolsky.shot.load import load_shot

runner = CliRunner()


@pytest.mark.parametrize("name", BAD)
def test_bad_input_is_one_clear_line_and_exit_code_2(shot: Path, name: str) -> None:
    mutate, fragments = BAD[name]
    mutate(shot)
    before = state(shot.parent)
    began = time.process_time()
    result = runner.invoke(app, ["check", str(shot)])
    assert time.process_time() - began < 5.0  # none of them reads 2 GB
    assert result.exit_code == 2, result.stdout
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    assert result.stderr.count("\n") == 1, result.stderr
    assert result.stderr.startswith(str(shot))
    for fragment in fragments:
        assert fragment in result.stderr
    assert state(shot.parent) == before


def test_several_missing_files_are_one_line_each(shot: Path) -> None:
    (shot / "flyer.csv").unlink()
    (shot / "scope.csv").unlink()
    result = run_kolsky("check", shot, code=2)
    first, second = result.stderr.splitlines()
    assert "force.file" in first
    assert "flyer.file" in second


def test_no_such_shot(tmp_path: Path) -> None:
    result = run_kolsky("check", tmp_path / "nowhere", code=2)
    assert "there is no such folder or file" in result.stderr


@pytest.mark.parametrize("data", [OPEN_01, OPEN_02])
def test_one_shot_file_serves_both_shots(data: Path, tmp_path: Path) -> None:
    folder = tmp_path / data.name
    shutil.copytree(data, folder)
    shutil.copy(OPEN_01 / "shot.toml", folder)
    told = json_of("check", folder)
    assert told["shot"] == data.name
    assert told["specimen"]["diameter"] == {"value": 0.0095, "unit": "m"}
    assert told["force"]["samples"]["value"] == 3341  # lines of scope.csv but the header
    assert told["flyer"]["frames"]["value"] == 186
    assert told["window"]["end"] == {"value": 0.0014625, "unit": "s"}
    assert told["window"]["frames_after_it"]["value"] == 2
    assert set(told["inputs"]) == set(FILES)
    # Standard deviation of the 400 pre-trigger volts over 0.0112 V/N, by a line of awk.
    assert told["force"]["noise_of_the_force"]["value"] == pytest.approx(
        {"open-01": 0.14608, "open-02": 0.15031}[data.name], abs=1e-5
    )


def test_the_table_shows_what_was_understood(tmp_path: Path) -> None:
    result = run_kolsky("check", OPEN_01 / "shot.toml", "--out", tmp_path)
    for text in (
        "shot open-01",
        "9.5 mm",
        "870 kg/m^3",
        "bonded",
        "CH2 transmitted (V)",
        "1462.5 us",
        "sha256",
    ):
        assert text in result.stdout


def test_what_is_not_declared_uncertain_is_said(shot: Path) -> None:
    with (shot / "shot.toml").open("a") as file:
        file.write('\n[uncertainty]\nsensitivity = "1 %"\nclock_offset = "0.5 us"\ny_offset = "0 um"\n')
    told = json.loads(runner.invoke(app, ["check", str(shot), "--json"]).stdout)["uncertainty"]
    assert told["sensitivity"] == {"value": 0.01, "unit": None}
    assert told["clock_offset"] == {"value": 5e-7, "unit": "s"}
    assert told["y_offset"] == {"value": 0.0, "unit": "m"}
    assert told["specimen_density"]["value"] == "not declared: taken as exact"
    assert "friction" not in told  # nothing slides
    assert not (shot / "results").exists()


def test_a_page_shows_signals_on_one_clock_and_the_outline(shot: Path) -> None:
    result = run_kolsky("check", shot)
    page = (shot / "results" / "check.html").read_text(encoding="utf-8")
    assert str(shot / "results" / "check.html") in result.stdout.replace("\n", "")
    assert "<svg" in page
    assert "the force must begin when it does" in page
    assert "specimen_length" in page.split('id="exact"')[1].split("</section>")[0]
    assert "<script" not in page


def test_the_figure_of_a_check_has_one_axis_of_time() -> None:
    loaded = load_shot(OPEN_01)
    kind = CHECKS["checked-shot"]
    figure, axes = plt.subplots(3)
    kind.draw(loaded, dict(zip(("force", "motion", "outline"), axes, strict=True)))
    first, last = axes[0].get_xlim()
    assert (first, last) == axes[1].get_xlim()
    # From the first sample of the scope to the last frame.
    assert (first, last) == pytest.approx((-0.2, 1.47916667), rel=1e-9)
    assert loaded.centre_line is not None
    frames = three_frames(loaded)
    # The static frames but the last lie before the window; the last two of all after it.
    assert frames == [11, 97, 183]
    plt.close(figure)


def test_new_overwrites_nothing(tmp_path: Path) -> None:
    (tmp_path / "shot.toml").write_text("mine")
    result = run_kolsky("new", tmp_path, code=2)
    assert "exists already and was not changed" in result.stderr
    assert (tmp_path / "shot.toml").read_text() == "mine"
    result = run_kolsky("new", tmp_path / "shot.toml", code=2)
    assert (tmp_path / "shot.toml").read_text() == "mine"


def test_version() -> None:
    result = run_kolsky("--version")
    assert result.stdout.startswith("kolsky")


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys\n"
        "from kolsky.cli import main\n"
        "sys.argv = ['kolsky', '--help']\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'warp', 'numpy', 'scipy', 'matplotlib', 'pyvista', 'vtk', 'vtkmodules', 'pint',\n"
        "         'pydantic', 'h5py', 'cv2', 'skimage', 'pandas'}\n"
        "sys.exit(', '.join(sorted(heavy & set(sys.modules))) or 0)\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    assert "check" in result.stdout
