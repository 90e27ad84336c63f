"""The three commands on a small strip and a small sheet: their files and fitted constants."""

import json
from pathlib import Path

import pytest
from kolsky_command import run_kolsky

from tests.unit.bodies.test_reading import _field_folder

SPEC = """
[material]
law = "neo_hookean"
free = ["mu"]
poisson = 0.45
constants = {{ mu = "{mu}" }}

[numerics]
element = "hex8"

[tests.pull]
size = ["80 mm", "20 mm", "4 mm"]
bond = "20 mm"
elements = [8, 2, 2]
{data}
sigma_force = "5 mN"

[tests.short]
size = ["60 mm", "20 mm", "4 mm"]
bond = "15 mm"
elements = [8, 2, 2]
stroke = "10 mm"
samples = 6
sigma_force = "5 mN"
"""
FILE = """file = "pull.csv"
displacement = { column = "displacement x (mm)", unit = "mm" }
force = { column = "force x (N)", unit = "N" }"""


@pytest.mark.slow
def test_simulate_fit_and_plan(tmp_path: Path) -> None:
    truth = tmp_path / "truth.toml"
    truth.write_text(SPEC.format(mu="24 kPa", data='stroke = "20 mm"\nsamples = 8'))
    run_kolsky("specimen", "simulate", truth, "--seed", 3, "--out", tmp_path, "--vtu", "--json")
    assert (tmp_path / "pull.vtu").stat().st_size > 0
    assert (tmp_path / "pull_strains.csv").read_text().startswith("strain from (1),")
    spec = tmp_path / "spec.toml"
    spec.write_text(SPEC.format(mu="10 kPa", data=FILE))
    run_kolsky("specimen", "fit", spec, "--out", tmp_path / "fit", "--json")
    said = json.loads((tmp_path / "fit" / "specimen.json").read_text())
    own = said["fits"]["pull"]["estimates"]["mu"]
    assert own["interval_95"][0] < 24e3 < own["interval_95"][1]
    assert own["verdict"] == "identified"
    assert said["fits"]["pull"]["bonds"]["pull"][0]["suspected"] is False
    page = (tmp_path / "fit" / "specimen.html").read_text()
    assert "mu" in page
    assert "Correlations" not in page  # one constant has none
    names = {path.name for path in (tmp_path / "fit").rglob("*") if path.is_file()}
    assert {"forces.csv", "constants.csv", "specimen.h5", "pull_tension.csv", "pull_shot.toml"} <= names
    run_kolsky("specimen", "plan", truth, "--out", tmp_path / "plan", "--json")
    told = json.loads((tmp_path / "plan" / "plan.json").read_text())
    sigmas = {tuple(one["tests"]): one["relative_sigma"]["mu"] for one in told["choices"]}
    # The deviation of the fit is the planned one, widened by what its own residuals show (8 samples).
    assert 0.99 < own["sigma"] / own["value"] / sigmas[("pull",)] < 2.5
    assert sigmas[("pull",)] < sigmas[("short",)]


@pytest.mark.slow
def test_sheet(tmp_path: Path) -> None:
    _field_folder(tmp_path)
    run_kolsky(
        "specimen", "fit", tmp_path / "sheet.toml", "--out", tmp_path / "fit", "--steps-alone", "--vtu",
        "--json",
    )  # fmt: skip
    said = json.loads((tmp_path / "fit" / "specimen.json").read_text())
    assert said["kinematics"] == "plane_stress"
    assert len(said["steps"]) == 2
    assert "Sutula" in (tmp_path / "fit" / "specimen.html").read_text()


def test_options_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    _field_folder(tmp_path)
    result = run_kolsky("specimen", "simulate", tmp_path / "sheet.toml", "--vtu", code=2)
    assert "for force curves" in result.output
