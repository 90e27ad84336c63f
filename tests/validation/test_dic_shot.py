"""`kolsky check`, `dic` and a loaded shot, only from pictures and calibration pictures of open-01."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import tifffile
from damaged_shots import toml
from kolsky_command import json_of, run_kolsky
from scipy.interpolate import CubicSpline
from shared_data import data
from typer.testing import CliRunner

from benchmarks.dic_whole import PICTURES
from kolsky.cli import app
from kolsky.pictures.dic_file import read_stereo_result
from kolsky.shot.load import load_shot

ROOT = Path(__file__).parents[2]
FRAMES = 64
KEYS = (
    PICTURES.replace("x = [0, 127], y = [6, 121]", "x = [20, 105], y = [6, 121]")
    .replace("y = [0, 69], frame = 185", "y = [0, LAST_ROW], frame = LAST_FRAME")
    .replace("step = 6", "step = 9")
    + '[reporting]\nlens = "a <virtual> lens & no other"\n\n'
)
runner = CliRunner()


def shot_file(last_frame: int, last_row: int) -> str:
    """open-01's shot file with pictures in place of exports."""
    text = (ROOT / "runs" / "open-01" / "shot.toml").read_text()
    before, after = text[: text.index("[flyer]")], text[text.index("[curve]") :]
    keys = KEYS.replace("LAST_ROW", str(last_row)).replace("LAST_FRAME", str(last_frame))
    return before + keys + after


@pytest.fixture(scope="module")
def source() -> Path:
    return data("shots", "open-01")


@pytest.fixture(scope="module")
def short(source, tmp_path_factory) -> Path:
    """The first 64 frames of open-01, with every fifth pair of calibration pictures left out."""
    folder = tmp_path_factory.mktemp("short") / "open-01"
    (folder / "calibration").mkdir(parents=True)
    for name in ("scope.csv", "quasi_static.csv"):
        shutil.copyfile(source / name, folder / name)
    for path in (source / "calibration").iterdir():
        shutil.copyfile(path, folder / "calibration" / path.name)
    lines = (source / "frames.csv").read_text().splitlines()
    (folder / "frames.csv").write_text("\n".join(lines[: FRAMES + 1]) + "\n")
    for camera in (0, 1):
        pictures = tifffile.imread(source / f"cam{camera}.tif")[:FRAMES]
        tifffile.imwrite(folder / f"cam{camera}.tif", pictures, photometric="minisblack")
    # The flyer has come down to row 24 in the last of these pictures; the record of the force covers more.
    text = shot_file(FRAMES - 1, 23)
    (folder / "shot.toml").write_text(text.replace("[window] ", '[window]\nend = "460 us"\n#'))
    return folder


@pytest.fixture
def copy(short, tmp_path) -> Path:
    return Path(shutil.copytree(short, tmp_path / "open-01", symlinks=True))


def test_check_opens_and_counts(short):
    told = json_of("check", short)
    assert told["pictures"]["camera_1,_size"]["value"] == "128 x 128 px at (192, 192) of the sensor"
    assert told["pictures"]["camera_0,_bits"]["value"] == 12
    assert told["frames"]["frames"]["value"] == FRAMES
    assert "flyer" not in told
    assert set(told["inputs"]) >= {"cam0.tif", "cam1.tif", "calibration/cam0_*.png"}
    assert not (short / "results").exists()  # a check runs nothing


def without_a_picture(folder: Path) -> None:
    pictures = tifffile.imread(folder / "cam1.tif")
    tifffile.imwrite(folder / "cam1.tif", pictures[:-1], photometric="minisblack")


REFUSED = {
    "a picture too few": (without_a_picture, ["pictures.camera_1.file", "holds 63 pictures",
     "lists 64 frames"]),
    "a missing file": (lambda f: (f / "cam0.tif").unlink(),
     ["pictures.camera_0.file", "names a missing file"]),
    "no pictures": (lambda f: (f / "cam0.tif").write_text("nothing"),
     ["pictures.camera_0.file", "cannot be used", "is not a TIFF"]),
    "no calibration": (toml("[calibration]\n", "[window2]\n"),
     ["is not a known key", "calibration"]),
    "half a region": (toml(", y = [6, 121] }", " }"), ["dic.specimen", "is not a region"]),
    "both sources": (toml('camera_0 = "calibration/cam0_*.png"',
     'file = "rig.xml"\ncamera_0 = "c/a_*.png"'), ["calibration.camera_0", "in addition to file"]),
    "an even subset": (toml("subset = 25", "subset = 24"),
     ["dic.subset", "odd, from 5 to 101"]),
    "no pattern": (toml("calibration/cam0_*.png", "calibration/cam0_00.png"),
     ["calibration.camera_0", "matches one file at most"]),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_right_is_refused(copy, name):
    change, fragments = REFUSED[name]
    change(copy)
    result = run_kolsky("check", copy, code=2)
    for fragment in fragments:
        assert fragment in result.stderr
    assert "Traceback" not in result.stderr


def test_a_crop_outside_the_sensor_is_refused(copy):
    for camera in (0, 1):
        old = f'"cam{camera}.tif", crop_offset = [192, 192]'
        toml(old, old.replace("[192", "[400"))(copy)
    result = run_kolsky("dic", copy, code=2)
    assert "puts 128 x 128 px at (400, 192) of the 512 x 512 px" in result.stderr


def test_pictures_without_exports_need_their_tables(copy):
    text = (copy / "shot.toml").read_text()
    (copy / "shot.toml").write_text(text[: text.index("[pictures]")] + text[text.index("[calibration]") :])
    result = run_kolsky("check", copy, code=2)
    assert "flyer is missing" in result.stderr
    assert "centre_line is missing" in result.stderr


@pytest.fixture(scope="module")
def correlated(short, tmp_path_factory):
    out = tmp_path_factory.mktemp("out")
    result = run_kolsky("dic", short, "--out", out, "--csv", "--vtu", "--figures", "svg", "--json")
    return out, result


@pytest.mark.slow
def test_dic_writes_what_it_says(short, correlated):
    out, result = correlated
    told = json.loads(result.stdout)
    assert told["frames"] == FRAMES
    assert told["frames_not_usable"] == {}
    assert told["epipolar_rms_px"] < 0.05  # the calibration's residual is 0.025 px
    names = {path.name for path in out.iterdir()}
    assert {
        "dic.h5", "dic.html", "centreline.csv", "flyer.csv", "dic_reporting.md", "surface", "vtu",
    } <= names  # fmt: skip
    assert len(list((out / "surface").glob("frame_*.csv"))) == FRAMES
    assert len(list((out / "vtu").glob("specimen_*.vtu"))) == FRAMES
    header, first = (out / "surface" / "frame_0000.csv").read_text().splitlines()[:2]
    assert header.startswith("X,Y,Z,U,V,W,x,y,Sigma,sigma_X,sigma_Y,sigma_Z,e,exx,eyy,exy,outcome")
    assert first.endswith(",VALID")
    page = (out / "dic.html").read_text()
    assert page.count("<figure") == 8  # the flight, the speckles and the maps too
    assert "a &lt;virtual&gt; lens &amp; no other" in page  # texts of a shot are not markup
    assert "not stated" in page
    assert not re.search(r"(?:src|href)=.https?:", page)  # nothing from outside
    again = runner.invoke(app, ["dic", str(short), "--out", str(out)])
    assert "(as it was)" in again.stdout  # the same inputs and settings are not correlated twice


@pytest.mark.slow
def test_a_shot_without_exports_is_its_pictures(short, correlated, source):
    out, _ = correlated
    from kolsky.shot.optical_data import measured

    shot = load_shot(short, measure=lambda seen: measured(seen, out))
    with np.load(source / "truth_surface.npz") as truth:
        t, d = truth["t"], truth["d"]
    off = shot.flyer.displacement - np.interp(shot.flyer.time, t, d)
    assert shot.flyer.time.size == FRAMES
    assert np.sqrt(np.mean(off**2)) < 3e-6  # the target for the flyer
    assert set(shot.centre_line.frame) == set(range(FRAMES))
    rest = shot.centre_line.time <= shot.window[0]
    assert np.abs(np.median(shot.centre_line.Z[rest]) - 4.75e-3) < 3e-6  # axis from the declared diameter


@pytest.mark.slow
def test_a_truncated_file_costs_the_frames_after_the_cut(copy, correlated):
    path = copy / "cam1.tif"
    data = path.read_bytes()
    pages = tifffile.imread(path)
    kept = 40
    with tifffile.TiffWriter(path) as writer:  # page by page: the header of a page stands before its data
        for page in pages:
            writer.write(page, contiguous=False, photometric="minisblack", metadata=None)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * kept // FRAMES])
    missing = json_of("check", copy)["pictures"]["camera_1,_pictures_cut_off"]["value"]
    assert FRAMES - kept - 1 <= missing <= FRAMES - kept + 2
    told = json_of("dic", copy)
    assert told["frames_not_usable"] == {str(k): "unreadable" for k in range(FRAMES - missing, FRAMES)}
    assert any("unreadable pictures: camera 1" in text for text in told["remarks"])
    whole = read_stereo_result(correlated[0] / "dic.h5").specimen
    cut = read_stereo_result(copy / "results" / "dic.h5").specimen
    upto = slice(0, FRAMES - missing)
    # the flyer of the cut series is not the same to the end rule, so that the points kept may differ
    _, a, b = np.intersect1d(*(body.cell @ [1, 1000] for body in (whole, cut)), return_indices=True)
    both = whole.surface.valid[upto, a] & cut.surface.valid[upto, b]
    assert both.sum() > 0.98 * whole.surface.valid[upto].sum()


@pytest.mark.slow
def test_the_script_for_a_shot_from_pictures(short, correlated):
    """From the surfaces that are there to the stiffness; 64 frames know it to a few per cent."""
    out, _ = correlated
    script = ROOT / "runs" / "from_pictures.py"
    assert len(script.read_text().splitlines()) < 60
    done = subprocess.run(
        [sys.executable, str(script), str(short), str(out)], capture_output=True, text=True, check=True,
        cwd=ROOT,
    )  # fmt: skip
    assert "flyer's velocity" in done.stdout
    m = float(re.search(r"m = ([\d.]+) ±", done.stdout).group(1))
    assert m == pytest.approx(1.12, rel=0.05)  # of truth.json; the window ends at a strain of 0.16
    assert (out / "report.html").exists()


NOISE = 4e-6  # declared standard deviation of a point [m]


def errors(folder) -> np.ndarray:
    """Exported radius less the true one at its height, of all points that the true surface reaches [m]."""
    truth = np.load(folder / "truth_surface.npz")
    table = np.loadtxt(folder / "centreline.csv", delimiter=",", skiprows=1)
    rows = np.searchsorted(truth["t"], table[:, 1] - 1e-9)
    found = []
    for row in np.unique(rows[rows < len(truth["t"])]):
        if abs(truth["t"][row] - table[rows == row, 1][0]) > 1e-9:
            continue  # before the motion
        y, r = truth["y"][row].astype(float), truth["r"][row].astype(float)
        first = last = len(y) // 2  # the part that has not folded onto a platen
        while first > 0 and y[first] - y[first - 1] > 1e-7:
            first -= 1
        while last < len(y) - 1 and y[last + 1] - y[last] > 1e-7:
            last += 1
        surface = CubicSpline(y[first : last + 1], r[first : last + 1], extrapolate=False)
        points = table[rows == row]
        found.append(1e-3 * points[:, 3] - surface(1e-3 * points[:, 2]))
    every = np.concatenate(found)
    return every[np.isfinite(every)]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["open-01", "open-02", "open-03", "open-04"])
def test_points_have_an_error_in_common_that_their_scatter_does_not_tell(name) -> None:
    error = errors(data("shots", name))
    print(
        f"{name}: {error.size} points, mean {1e6 * error.mean():+.2f} um, scatter {1e6 * error.std():.2f} um"
    )
    # The scatter is what is declared; the mean of independent errors would be 0.08 um.
    assert error.std() == pytest.approx(NOISE, rel=0.1)
    assert error.mean() > 8.0 * NOISE / np.sqrt(error.size)
