"""Small files of real kinds that are easily misread: each command gives the correct value."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kolsky_command import json_of, run_kolsky
from typer.testing import CliRunner

from kolsky.base.errors import InputError
from kolsky.cli import app
from kolsky.readers.dic_export import matching, read
from kolsky.shot.load import load_shot

ROOT = Path(__file__).resolve().parents[2]

CLOCKS = {
    "clock/rate_in_khz.csv": (0.0, 1.25e-6), "clock/interval_in_ms.csv": (0.0, 1e-6),
    "clock/rate_and_column.csv": (0.0, 2e-6), "clock/decimal_comma.lvm": (0.0, 2.5e-6),
    "clock/sequence_from_40.csv": (-120e-6, 2e-6), "tables/lines_in_quotes.csv": (0.0, 1e-6),
}  # fmt: skip
"""File -> time of the first of 120 samples and from sample to sample [s]."""


def channels(path: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json_of("channels", path)["channels"]
    return found


@pytest.mark.parametrize("name", CLOCKS)
def test_clock(name, shared):
    start, interval = CLOCKS[name]
    (channel,) = channels(shared / "data/cases" / name)
    assert channel["samples"] == 120
    assert channel["start"] == pytest.approx(start, abs=1e-9 * interval)
    assert channel["interval"] == pytest.approx(interval, rel=1e-9)


def test_channels_that_start_apart(shared):
    a, b = channels(shared / "data/cases/clock/starts_apart.tdms")
    assert b["start"] - a["start"] == pytest.approx(150e-6, abs=1e-12)


def test_rate_and_duration_are_printed_in_words(shared):
    run = CliRunner().invoke(app, ["channels", str(shared / "data/cases/clock/rate_in_khz.csv")])
    assert "800 kHz, 120 samples, 150 us" in run.stdout


def test_one_column_of_decimal_commas(shared):
    (channel,) = channels(shared / "data/cases/tables/one_column_decimal_comma.csv")
    assert (channel["name"], channel["unit"], channel["samples"]) == ("Kraft [N]", "N", 120)


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("quasi_static.xlsx", {"Strain": "%", "Stress": "MPa"}),
        ("units_line_in_brackets.csv", {"Displacement": "mm", "Force": "kN"}),
        ("short_under_remarks.txt", {"stretch": None, "stress (kPa)": "kPa"}),
    ],
)
def test_names_and_units_of_columns(name, columns, shared):
    found = channels(shared / "data/cases/tables" / name)
    assert {channel["name"]: channel["unit"] for channel in found} == columns


def fitted(path: Path, folder: Path, *options: str) -> float:
    """Shear modulus of a neo-Hookean fit [kPa]."""
    words = ["--convention", "tension-positive", "--laws", "neo_hookean", "--out", str(folder)]
    (law,) = json_of("material", "fit", path, *words, *options)["laws"]
    return 1e-3 * float(law["fit"]["constants"]["mu"])


def test_a_short_table_under_remarks_is_fitted(shared, tmp_path):
    path = shared / "data/cases/tables/short_under_remarks.txt"
    assert fitted(path, tmp_path, "--stretch", "stretch", "--stress", "stress") == pytest.approx(
        120.0, rel=1e-3
    )


def test_of_a_cycle_the_loading_is_taken_or_its_turn_named(shared, tmp_path):
    path = shared / "data/cases/tables/cycle.csv"
    columns = ("--strain", "nominal strain", "--stress", "nominal stress")
    assert fitted(path, tmp_path, *columns, "--loading") == pytest.approx(300.0, rel=1e-3)
    words = ["--convention", "tension-positive", "--laws", "neo_hookean", "--out", str(tmp_path)]
    run = run_kolsky("material", "fit", path, *words, *columns, code=2)
    assert "turns back behind point 60" in run.stderr


def test_the_unit_of_an_exports_headings(shared):
    files = matching(shared / "data/cases/dic_units", "*.csv")
    export = read(files, "matchid")
    u = export.u[..., 0]
    assert u == pytest.approx(u[:, :1] + 0.0 * u)
    assert 1e3 * u[:, 0] == pytest.approx([0.0, 0.1, 0.2], abs=1e-9)
    with pytest.raises(
        InputError, match=r"unit 'm' in its column 'coor.X \[m\]', and unit = \"mm\" is declared"
    ):
        read(files, "matchid", unit="mm")


def test_a_workbook_may_stand_as_the_curve_of_a_shot(shared, tmp_path):
    shot = tmp_path / "shot"
    shutil.copytree(ROOT / "runs/open-01", shot, ignore=shutil.ignore_patterns("results"))
    shutil.copy(shared / "data/cases/tables/quasi_static.xlsx", shot)
    text = (shot / "shot.toml").read_text(encoding="utf-8")
    for old, new in {
        'file = "quasi_static.csv"': 'file = "quasi_static.xlsx"',
        '{ column = "nominal strain (-)", unit = "1" }': '{ column = "Strain", unit = "%" }',
        '{ column = "nominal stress (Pa)", unit = "Pa" }': '{ column = "Stress", unit = "MPa" }',
    }.items():
        assert old in text
        text = text.replace(old, new)
    (shot / "shot.toml").write_text(text, encoding="utf-8")
    curve = load_shot(shot).curve
    at = int(np.argmin(np.abs(curve.stretch - 0.99)))  # row 7 of the workbook: -1 %, -0.000749 MPa
    assert (curve.stretch[at], curve.stress[at]) == pytest.approx((0.99, -749.0))
    assert len(curve.stretch) == 63


def printed(path: Path, folder: Path, *command: str) -> dict[str, Any]:
    """What a command on a file of the cases prints with --json."""
    found: dict[str, Any] = json_of(*command, path, "--out", folder)
    return found


@pytest.mark.slow
def test_points_at_a_hole_and_a_border_are_kept(shared, tmp_path):
    path = shared / "data/cases/sheet_hole/good.toml"
    found = printed(path, tmp_path, "specimen", "fit")
    for name, right in (("E", 80e3), ("poisson", 0.35)):
        assert abs(found["constants"][name] - right) < 1.96 * found["sigma"][name]
    assert found["adequate"]
    assert found["force_explained"]
    assert not any("left out" in one for one in found["warnings"])


@pytest.mark.slow
def test_a_force_with_the_wrong_sign_is_named(shared, tmp_path):
    found = printed(shared / "data/cases/sheet_hole/fsign.toml", tmp_path, "specimen", "fit")
    assert not found["force_explained"]
    assert "field.pad.force times -1" in found["one_change"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('unit = "mN"', 'unit = "N"', "field.pad.force times 0.001"),
        pytest.param('unit = "mN"', 'unit = "gf"', "field.pad.force times 0.101972", marks=pytest.mark.long),
        pytest.param(  # 90 s of one core
            'mesh_unit = "mm"', 'mesh_unit = "cm"', "0.1 times its size", marks=pytest.mark.long
        ),
    ],
)
def test_a_wrong_unit_of_a_sheet_is_named(shared, tmp_path, old, new, words):
    source = shared / "data/cases/sheet_hole"
    for name in ("mesh.msh", "points.csv", "pad.csv"):
        shutil.copy(source / name, tmp_path)
    text = (source / "good.toml").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "wrong.toml").write_text(text.replace(old, new), encoding="utf-8")
    found = printed(tmp_path / "wrong.toml", tmp_path / "out", "specimen", "fit")
    assert words in found["one_change"]


@pytest.mark.slow
def test_cells_that_run_clockwise_are_turned(shared, tmp_path):
    source = shared / "data/cases/sheet_hole"
    for name in ("mesh_flip.msh", "points.csv", "pad.csv"):
        shutil.copy(source / name, tmp_path)
    text = (source / "good.toml").read_text(encoding="utf-8").replace("mesh.msh", "mesh_flip.msh")
    (tmp_path / "flip.toml").write_text(text, encoding="utf-8")
    found = printed(tmp_path / "flip.toml", tmp_path / "out", "specimen", "fit")
    assert abs(found["constants"]["E"] - 80e3) < 1.96 * found["sigma"]["E"]
    assert any("10 of 2240 cells of the mesh run clockwise" in one for one in found["warnings"])


def test_too_few_points_are_counted(shared, tmp_path):
    path = shared / "data/cases/sheet_hole/few.toml"
    run = run_kolsky("specimen", "fit", path, "--out", tmp_path, code=2)
    assert "has 6 points a frame in p_few.csv" in run.stderr
    assert "at least 21 without field.sigma_displacement" in run.stderr


def test_an_open_cavity_is_refused_with_its_place(shared, tmp_path):
    path = shared / "data/cases/actuator/open.toml"
    run = run_kolsky("actuator", "simulate", path, "--out", tmp_path, code=2)
    assert "14 of its edges belong to one loaded face only, at x = 39, y = 1.5 to 10.5" in run.stderr


@pytest.mark.slow
def test_a_closed_cavity_bends_as_felupe_says(shared, tmp_path):
    found = printed(shared / "data/cases/actuator/good.toml", tmp_path, "actuator", "simulate")
    angles = np.degrees(found["bends"]["downward"]["angle_rad"])
    assert angles == pytest.approx([2.15200, 2.50166], abs=1e-4)


@pytest.mark.slow
def test_the_intervals_of_a_bonded_cylinder_contain_its_constants(shared, tmp_path):
    words = ["--displacement", "Travel", "--force", "Load", "--convention", "compression-positive"]
    words += ["--specimen", "80 mm x 70 mm", "--ends", "bonded", "--laws", "reduced_polynomial"]
    path = shared / "data/cases/bonded/push.csv"
    found = json_of("material", "fit", path, *words, "--out", tmp_path)
    (law,) = found["laws"]
    for name, right in (("C10", 1404.9), ("C20", 699.4)):
        assert abs(law["constants"][name] - right) < 2.0 * law["sigma"][name]
    assert abs(found["poisson"]["value"] - 0.4995) < 2.0 * found["poisson"]["sigma"]
    assert "the constants change with the range" in law["remark"]


@pytest.mark.long  # every law is tried; tests/unit/material/test_baseline_friction.py has two
def test_the_curve_behind_a_bonded_cylinder_is_that_of_its_law(shared, tmp_path):
    # Yeoh's law meets this test best, and has no equilibrium on the refined mesh: the others take its place.
    words = ["--displacement", "Travel", "--force", "Load", "--convention", "compression-positive"]
    words += ["--branch", "compression", "--diameter", "80 mm", "--length", "70 mm"]
    words += ["--friction", "bonded", "--poisson", "0.4995", "--out", str(tmp_path / "curve.csv")]
    path = shared / "data/cases/bonded/push.csv"
    run = CliRunner().invoke(app, ["material", "reference-curve", str(path), *words])
    assert run.exit_code == 0, run.output
    curve = np.loadtxt(tmp_path / "curve.csv", delimiter=",", skiprows=1)
    stretch = 1.0 - curve[:, 0]
    slope = 1404.9 + 2.0 * 699.4 * (stretch**2 + 2.0 / stretch - 3.0)
    stress = 2.0 * slope * (stretch**-2 - stretch)  # of an incompressible reduced polynomial in tension
    band = 2.0 * np.linalg.norm(curve[:, 2:], axis=1)
    assert (np.abs(curve[:, 1] - stress) < band).all()
    # the force of this case ends 1.2 % low, see below; without the correction the stress is 23 % high
    np.testing.assert_allclose(curve[:, 1], stress, rtol=0.01)


def test_the_force_of_the_bonded_case_ends_below_that_of_a_softer_cylinder(shared):
    """DOLFINx's cylinder of this size and these constants, on two meshes that agree within 0.01 %, has
    nu = 0.495. It must be softer than the case's 0.4995; at 13 and 14 % the case has less force."""
    path = Path(__file__).resolve().parents[1] / "reference" / "I_force.csv"
    rows = [line.split(",") for line in path.read_text("utf-8").splitlines()]
    softer = {round(70.0 * float(row[2]), 2): float(row[3]) for row in rows if row[0] == "reduced_polynomial"}
    case = np.loadtxt(shared / "data/cases/bonded/push.csv", delimiter=",", skiprows=2)
    excess = np.array([force / softer[round(travel, 2)] - 1.0 for travel, force in case])
    np.testing.assert_allclose(excess[case[:, 0] < 4.0], 7e-3, atol=4e-4)
    assert (np.diff(excess[case[:, 0] > 3.0]) < 0.0).all()
    assert excess[-1] < -2e-3
