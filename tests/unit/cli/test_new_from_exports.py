"""`kolsky new` in a laboratory's folder: series of DIC exports, a workbook, and facts from their numbers."""

import json
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from kolsky_command import json_of, run_kolsky
from laboratory_files import TYPED, laboratory
from typer.testing import CliRunner

from kolsky.base.toml import blanks
from kolsky.cli import app
from kolsky.readers.dic_export import LAYOUTS, programs_of
from kolsky.survey import signals
from kolsky.survey.new_file import fill_in
from kolsky.survey.surface import scatter_at_rest, survey_surfaces

runner = CliRunner()
HEADS = {
    "vic3d": '"X", "Y", "Z", "U", "V", "W", "sigma", "x", "y"',
    "aramis": "id;x [mm];y [mm];z [mm];displacement_x [mm];displacement_y [mm];displacement_z [mm]",
    "matchid": "coor.X [m],coor.Y [m],coor.Z [m],disp.Horizontal Displacement U [m],"
    "disp.Vertical Displacement V [m],disp.Out-Of-Plane: W [m],Coordinates.Image X [Pixel],"
    "Coordinates.Image Y [Pixel]",
    "dice": "SUBSET_ID,MODEL_COORDINATES_X,MODEL_COORDINATES_Y,MODEL_COORDINATES_Z,"
    "MODEL_DISPLACEMENT_X,MODEL_DISPLACEMENT_Y,MODEL_DISPLACEMENT_Z",
    "opencorr": "ref_x,ref_y,ref_z,u,v,w,x,y",
    "duodic": "point,Points3D_X,Points3D_Y,Points3D_Z,DispVec_X,DispVec_Y,DispVec_Z",
}
FRAMES, START = 12, 6
"""Frames of a short series, and the first in which it moves."""
NOISE = 2e-3
"""Of its points [mm]."""


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The laboratory's folder with the file that `kolsky new` writes there."""
    folder = laboratory(tmp_path_factory.mktemp("lab") / "shot5")
    done = run_kolsky("new", folder)
    assert "dic/specimen_*.csv: [surface]" in done.stdout
    assert "dic/flyer_*.csv: [surface.flyer]" in done.stdout
    return folder


def test_a_laboratorys_folder_needs_eleven_values(lab: Path) -> None:
    """A German scope file, VIC-3D's series in a sub-folder and a workbook: what is left to type."""
    text = (lab / "shot.toml").read_text("utf-8")
    declared = tomllib.loads(text)
    assert list(blanks(declared)) == list(TYPED)
    typed = [json.loads(value) for value in TYPED.values()]
    assert len(typed) == 11  # and of the origin only one of three lengths is no zero
    assert declared["surface"] == {
        "pattern": "dic/specimen_*.csv",
        "program": "vic3d",
        "unit": "mm",
        "y": "-Y",
        "Z": "+Z",
        "frame": "cylinder",
        "origin": ["", "", ""],
        "half_width": declared["surface"]["half_width"],
        "sigma": declared["surface"]["sigma"],
        "flyer": {"pattern": "dic/flyer_*.csv", "sigma": declared["surface"]["flyer"]["sigma"]},
    }
    assert "flyer" not in declared
    assert "centre_line" not in declared
    assert declared["curve"]["strain"] == {"column": "Strain", "unit": "%"}
    assert declared["curve"]["stress"] == {"column": "Stress", "unit": "MPa"}
    assert "time" not in declared["force"]  # the header has rate and start
    assert "-200 us to 1470 us, every 0.5 us" in text
    # The flyer's noise at rest is 0.6 um (facts of open-05), of 12 differences known to a fifth.
    assert 0.4 <= float(declared["surface"]["flyer"]["sigma"].removesuffix(" um")) <= 1.1
    # The outline's noise of 3 to 4 um with 1 um of the points added: at rest each point jumps by both.
    assert 3.0 <= float(declared["surface"]["sigma"].removesuffix(" um")) <= 5.0


def test_the_filled_file_passes_the_check(lab: Path) -> None:
    text = (lab / "shot.toml").read_text("utf-8")
    folder = lab.parent / "filled"
    shutil.copytree(lab, folder)
    (folder / "shot.toml").write_text(fill_in(text, TYPED), encoding="utf-8")
    run_kolsky("check", folder, "--json")


@pytest.mark.slow
def test_the_walk_ends_with_the_answer(lab: Path) -> None:
    """On a coarse mesh, whose interval is 1.136 ± 0.017; the truth is 1.12."""
    text = (lab / "shot.toml").read_text("utf-8")
    folder = lab.parent / "identified"
    shutil.copytree(lab, folder)
    (folder / "shot.toml").write_text(fill_in(text, TYPED), encoding="utf-8")
    options = ["--mesh", "16x22", "--refined-mesh", "24x32", "--replicates", "2"]
    found = json_of("identify", folder, *options)
    assert found["stiffness_factor"]["value"] == pytest.approx(1.12, rel=0.03)
    assert not any("does not explain" in warning for warning in found["warnings"])


def columns(program: str, X: np.ndarray, u: np.ndarray, scale: float) -> np.ndarray:
    """Rows of one frame in the order of `HEADS`; mm times `scale`."""
    point = np.arange(len(X), dtype=float)[:, None]
    lengths = scale * np.hstack([X, u])
    return {
        "vic3d": np.hstack([lengths, np.full_like(point, 0.01), point, point]),
        "aramis": np.hstack([point, lengths]),
        "matchid": np.hstack([lengths, point, point]),
        "dice": np.hstack([point, lengths]),
        "opencorr": np.hstack([lengths, point, point]),
        "duodic": np.hstack([point, lengths]),
    }[program]


def series(folder: Path, program: str, *, name: str = "Image", seed: int = 1) -> Path:
    """Five points along the side of a specimen that is pressed from +Y, a file a frame."""
    folder.mkdir(parents=True, exist_ok=True)
    noise = np.random.default_rng(seed)
    X = np.column_stack([np.zeros(5), np.linspace(1.0, 5.0, 5), np.full(5, 4.0)])
    scale = 1e-3 if program == "matchid" else 1.0
    cut = ";" if program == "aramis" else ","
    for frame in range(FRAMES):
        e = 0.04 * max(0, frame - START + 1)
        u = np.column_stack([np.zeros(5), -e * X[:, 1], 0.5 * e * X[:, 2]])
        u = u + (noise.normal(0.0, NOISE, u.shape) if frame else 0.0)
        rows = columns(program, X, u, scale)
        lines = [HEADS[program], *(cut.join(f"{v:.8f}" for v in row) for row in rows)]
        (folder / f"{name}_{frame:04d}_0.tiff.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("program", "place"),
    [("vic3d", ""), ("duodic", "dic/left right [1]"), *((program, "dic") for program in HEADS)],
)
def test_series_of_five_rows_are_recognised_by_their_headings(
    program: str, place: str, tmp_path: Path
) -> None:
    series(tmp_path / place, program)
    found = survey_surfaces(tmp_path).specimen
    assert found is not None
    assert (found.program, found.unit) == (program, "m" if program == "matchid" else "mm")
    assert len(found.export.frame) == FRAMES
    np.testing.assert_allclose(np.ptp(found.export.X[:, 1]), 4e-3, rtol=1e-6)
    assert set(tmp_path.glob(found.pattern)) == set((tmp_path / place).glob("*.csv"))
    done = run_kolsky("new", tmp_path)
    declared = tomllib.loads((tmp_path / "shot.toml").read_text("utf-8"))["surface"]
    assert declared["pattern"] == found.pattern
    assert (declared["y"], declared["Z"], declared["frame"]) == ("+Y", "+Z", "declared")
    # Noise of 2 um in each component, of 25 differences known to a seventh; the noisiest one counts.
    assert float(declared["sigma"].removesuffix(" um")) == pytest.approx(2.0, rel=0.4)
    assert "Image_0000" not in done.stdout  # no file of the series is named as a table of unknown use


def test_every_program_has_headings_here() -> None:
    assert set(HEADS) == set(LAYOUTS)


def test_headings_of_no_program_and_of_two_are_no_guess(tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    plain.mkdir()
    for frame in range(4):
        rows = "\n".join(f"{i},1,2,3,4,5" for i in range(5))
        (plain / f"a_{frame}.csv").write_text(f"x,y,z,u,v,w\n{rows}\n")
    assert programs_of(plain / "a_0.csv") == {}  # names that MatchID has too, without its pixels
    assert survey_surfaces(tmp_path).files == frozenset()
    both = tmp_path / "both"
    both.mkdir()
    names = "ID,x_undef,y_undef,z_undef,u,v,w,x,y,z,x_pic,y_pic"
    for frame in range(4):
        rows = "\n".join(f"{i},1,2,3,4,5,6,{i},2,3,{i},8" for i in range(5))
        (both / f"b_{frame}.csv").write_text(f"{names}\n{rows}\n")
    found = survey_surfaces(tmp_path)
    assert found.specimen is None
    assert found.doubtful == {"both/b_*.csv": "its headings are those of aramis and matchid"}


def test_a_series_that_does_not_shorten_is_written_with_a_question(tmp_path: Path) -> None:
    """MatchID's headings in metres without its pixels, three files, all points by 0.1 mm a frame."""
    (tmp_path / "dic").mkdir()
    head = HEADS["matchid"].split(",Coordinates")[0]
    for frame in range(3):
        rows = "\n".join(f"{1e-3 * i:.7e},0,0,{1e-4 * frame:.7e},0,0" for i in range(5))
        (tmp_path / "dic" / f"Image_{frame:04d}_0.tiff.csv").write_text(f"{head}\n{rows}\n")
    run_kolsky("new", tmp_path)
    text = (tmp_path / "shot.toml").read_text("utf-8")
    declared = tomllib.loads(text)["surface"]
    assert (declared["program"], declared["unit"]) == ("matchid", "m")
    assert declared["pattern"] == "dic/Image_*_0.tiff.csv"
    assert "# 3 files of MatchID 2024: frames 0 to 2, 5 points; do they show the specimen?" in text
    assert declared["sigma"] == ""


def test_names_with_two_numbers_are_a_question(tmp_path: Path) -> None:
    for k, path in enumerate(sorted(series(tmp_path, "vic3d").iterdir())):
        path.rename(tmp_path / f"Image_{k:04d}_{7 * k}.csv")
    found = survey_surfaces(tmp_path)
    assert found.specimen is None
    assert "differ in several numbers" in found.doubtful["Image_0000_0.csv"]
    assert len(found.files) == FRAMES


def test_two_series_of_a_specimen_are_a_question(tmp_path: Path) -> None:
    series(tmp_path / "a", "dice")
    series(tmp_path / "b", "dice", seed=2)
    done = runner.invoke(app, ["new", str(tmp_path)])
    assert "could be the specimen, and so could each of a/Image_*_0.tiff.csv, b/Image_*_0" in done.stdout
    assert "surface" not in tomllib.loads((tmp_path / "shot.toml").read_text("utf-8"))


def test_rest_noise_and_sign_of_a_record_by_hand() -> None:
    """Noise that alternates by 1 has differences of 2: scatter 2 / sqrt(2); it departs at value 40."""
    still = np.where(np.arange(40) % 2, 1.0, -1.0)
    rise = np.arange(1, 61) * 40.0
    quiet = signals.quiet_stretch(np.concatenate([still, -rise]), fewest=20)
    assert quiet == signals.QuietStretch(40, pytest.approx(0.0), pytest.approx(np.sqrt(2.0)))
    assert signals.first_push(np.concatenate([still, -rise]), quiet) == -1
    assert signals.first_push(np.concatenate([still, rise]), quiet) == 1
    # First up by more than a fifth of the largest departure, then further down: no clear sign.
    assert signals.first_push(np.concatenate([still, rise, -2.0 * rise]), quiet) is None
    assert signals.first_push(np.concatenate([still, 0.1 * rise, -2.0 * rise]), quiet) == -1
    # A ramp from the first value on, noise alone, and a small step have no clear rest.
    assert (
        signals.quiet_stretch(np.arange(100.0) + 0.1 * np.where(np.arange(100) % 2, 1.0, -1.0), fewest=20)
        is None
    )
    assert signals.quiet_stretch(np.tile(still, 3), fewest=20) is None
    assert signals.quiet_stretch(np.concatenate([still, still + 20.0]), fewest=20) is None
    assert signals.quiet_stretch(np.concatenate([still[:10], rise]), fewest=20) is None


def test_ranges_and_figures_by_hand() -> None:
    assert signals.range_above(np.array([0.1, -0.2778])) == 0.5
    assert signals.range_above(np.array([0.5, 0.2])) == 1.0
    assert signals.range_above(np.array([1.0, 0.2])) == 2.0
    assert signals.range_above(np.concatenate([np.zeros(3), np.full(10, 0.7)])) is None
    assert signals.range_above(np.concatenate([np.zeros(3), np.full(9, 0.7)])) == 1.0
    assert [signals.two_figures(v) for v in (0.001234, 1.2, 9.91, 37.0)] == [0.0013, 1.2, 10.0, 37.0]
    assert signals.common_sign(np.array([0.0, 0.01, -1.0, -2.0])) == -1
    assert signals.common_sign(np.array([0.5, -1.0, -2.0])) is None


def test_scatter_of_a_curve_by_hand() -> None:
    """A cubic has none. Errors of ± 1 % at equal steps: the cubic's weights are -1/6, 4/6, 4/6, -1/6."""
    x = np.arange(1.0, 41.0)
    assert signals.relative_scatter(x, x**3) == pytest.approx(0.0, abs=1e-12)
    off = 0.01 * np.where(np.arange(40) % 2, 1.0, -1.0)
    # A point at +1 % between neighbours at -1 %, next ones at +1 %: off by 1 + 8/6 + 2/6 = 8/3 per cent.
    weights = np.array([-1.0, 4.0, 4.0, -1.0]) / 6.0
    expected = 1.4826 * 0.01 * (8.0 / 3.0) / np.sqrt(1.0 + np.sum(weights**2))
    assert signals.relative_scatter(x, 100.0 * (1.0 + off)) == pytest.approx(expected, rel=0.02)
    assert signals.relative_scatter(x[:11], x[:11]) is None


def test_noise_of_points_from_the_frames_at_rest(tmp_path: Path) -> None:
    found = survey_surfaces(series(tmp_path / "a", "vic3d")).specimen
    u = found.export.u.copy()
    u[:START] = 0.0
    u[1:START:2, :, 1] = 3e-6  # up, down, up: differences of 3 um
    still = found.export.__class__(**{**vars(found.export), "u": u})
    moved = found.__class__(**{**vars(found), "export": still})
    assert scatter_at_rest(moved, START) == pytest.approx(3e-6 / np.sqrt(2.0))


@pytest.mark.parametrize(
    ("name", "sign", "expected"),
    [
        ("Druckversuch.csv", 1, ("compression positive", "compression")),
        ("Zugversuch.csv", 1, ("tension positive", "tension")),
        ("test.csv", -1, ("tension positive", "compression")),
        ("test.csv", 1, ("", "")),
    ],
)
def test_signs_of_a_curve(name: str, sign: int, expected: tuple[str, str], tmp_path: Path) -> None:
    rows = "\n".join(f"{sign * 0.01 * i:.3f},{sign * 1000.0 * i:.1f}" for i in range(30))
    (tmp_path / name).write_text(f"strain (1),stress (Pa)\n{rows}\n")
    assert runner.invoke(app, ["new", str(tmp_path)]).exit_code == 0
    text = (tmp_path / "shot.toml").read_text("utf-8")
    declared = tomllib.loads(text)["curve"]
    assert (declared["convention"], declared["branch"]) == expected
    if not expected[0]:
        assert "# strain and stress are positive: a tension test, or a compression test" in text
