"""Files and numbers of a test between bars against closed forms: sensitivities, true curve, database."""

import csv
import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from barshots import DIAMETER, LENGTH, STRESS, bar_shot
from typer.testing import CliRunner

from kolsky.cli import app

MORE = 'specimen_length = "0.5 %"\ngauge_calibration = "0.2 %"'


def reduce(folder: Path) -> dict:
    done = CliRunner().invoke(app, ["waves", str(folder), "--json"])
    assert done.exit_code == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module", params=["compression", "tension"])
def reduced(request, tmp_path_factory) -> tuple[Path, dict, str]:
    """Tension is the same record with the gauges' sign turned."""
    folder = bar_shot(
        tmp_path_factory.mktemp("bars") / "=shot",
        more=MORE,
        waves=f'load = "{request.param}"',
    )
    if request.param == "tension":
        path = folder / "shot.toml"
        path.write_text(path.read_text().replace('compression = "positive"', 'compression = "negative"'))
    return folder / "results", reduce(folder), request.param


def lines(path: Path) -> list[str]:
    return path.read_text(encoding="utf-8").splitlines()


def table(path: Path) -> dict[str, np.ndarray]:
    rows = list(csv.reader(x for x in lines(path) if not x.startswith("# ")))
    return {name: np.array(column, float) for name, *column in zip(*rows, strict=True)}


def test_sensitivities_have_the_signs_of_closed_forms(reduced):
    """s = 4 F / (pi d^2), F in proportion to the gauge; e = shortening over length."""
    folder, said, _ = reduced
    slopes = said["sensitivity"]
    peak, strain = (said["results"][name]["value"] for name in ("peak stress", "largest strain"))
    assert peak == pytest.approx(STRESS, rel=0.03)
    assert slopes["specimen, diameter"]["peak stress"] == pytest.approx(-2.0 * peak / DIAMETER, rel=1e-3)
    assert slopes["specimen, length"]["largest strain"] == pytest.approx(-strain / LENGTH, rel=1e-4)
    # Three waves: the mean of both forces, of which the transmission gauge has half.
    found = slopes["transmission gauge, strain per volt"]["peak stress"]
    assert found == pytest.approx(0.5 * peak / 1e-3, rel=0.05)
    assert "specimen, density" not in slopes  # counts as exact: not varied
    with h5py.File(folder / "waves.h5") as file:
        part = file["entry/budget/results/peak_stress"]
        names = [name.decode() for name in part["sensitivity_inputs"][()]]
        stored = dict(zip(names, part["sensitivity"][()], strict=True))
    assert stored["specimen, diameter"] == slopes["specimen, diameter"]["peak stress"]
    rows = {row["input"]: row for row in csv.DictReader(lines(folder / "waves_budget.csv"))}
    heading = "sensitivity, peak stress (Pa per unit of the input)"
    assert float(rows["specimen, diameter"][heading]) < 0.0
    assert rows["specimen, density"][heading] == ""
    page = (folder / "waves.html").read_text(encoding="utf-8")
    # 1 % of the diameter takes 2 % of the stress.
    assert f"−{0.02 * peak * 1e-6:.3g} MPa" in page


def test_the_true_curve_is_that_of_constant_volume(reduced):
    folder, _, load = reduced
    sign = -1.0 if load == "tension" else 1.0
    rows = table(folder / "waves.csv")
    e, s = rows["strain, three waves (1)"], rows["stress, three waves (Pa)"]
    stretch = 1.0 - sign * e
    np.testing.assert_allclose(rows["true strain (1)"], -sign * np.log(stretch), atol=1e-8)
    np.testing.assert_allclose(rows["true stress (Pa)"], s * stretch, rtol=1e-6, atol=1.0)
    # The diameter's 1 % is 2 % of the stress, true or nominal; the rest adds in quadrature.
    at = int(np.argmin(np.abs(rows["time (s)"] - 75e-6)))
    share = rows["sigma of true stress (Pa)"][at] / rows["true stress (Pa)"][at]
    assert share == pytest.approx(0.02, rel=0.05)


def test_the_database_file_says_what_it_holds(reduced):
    folder, said, load = reduced
    path = folder / "waves_database.csv"
    head = dict(line[2:].split(": ", 1) for line in lines(path) if line.startswith("# "))
    assert head["test_name"].startswith("'=")  # no formula for a spreadsheet
    assert head["load_case"] == f"{load}, counted positive"
    assert float(head["specimen_diameter_mm"]) == 10.0
    assert head["analysis"] == "three waves"
    assert "dispersion" in head["corrections_applied"]
    assert {"mass", "droop", "punching"} < set(head["corrections_left_out"].split(", "))
    value = said["results"]["peak stress"]["value"]
    assert float(head["peak_stress_MPa"].split()[0]) == pytest.approx(1e-6 * value, rel=1e-5)
    assert len(head["input_sha256 scope.csv"]) == 64
    columns, own = table(path), table(folder / "waves.csv")
    for name, other, factor in (
        ("engineering_strain", "strain, three waves (1)", 1.0),
        ("engineering_stress_MPa", "stress, three waves (Pa)", 1e-6),
        ("u_engineering_stress_MPa", "sigma of stress, three waves (Pa)", 1e-6),
        ("true_stress_MPa", "true stress (Pa)", 1e-6),
        ("engineering_strain_rate_per_s", "rate, three waves (1/s)", 1.0),
    ):
        np.testing.assert_allclose(columns[name], factor * own[other], rtol=1e-7)
    first, last = said["balanced"]
    inside = columns["time_s"][columns["force_equilibrium"] == 1.0]
    assert (inside[0], inside[-1]) == (pytest.approx(first, abs=1e-9), pytest.approx(last, abs=1e-9))


@pytest.mark.parametrize(("way", "factor"), [("one wave", 1.0), ("two waves", 1.1)])
def test_the_quoted_analysis_is_the_chosen_one(tmp_path, way, factor):
    """An incident gauge 10 % too sensitive in the declaration moves the front force only."""
    folder = bar_shot(tmp_path / "shot", waves=f'analysis = "{way}"', more=MORE)
    path = folder / "shot.toml"
    text = path.read_text()
    assert text.count("0.001 1/V") == 2
    path.write_text(text.replace("0.001 1/V", "0.0011 1/V", 1))
    said = reduce(folder)
    assert said["analysis"] == way
    assert said["results"]["peak stress"]["value"] == pytest.approx(factor * STRESS, rel=0.03)
    own = said["sensitivity"]["transmission gauge, strain per volt"].get("peak stress", 0.0)
    assert own == pytest.approx((STRESS / 1e-3) * (way == "one wave"), rel=0.03, abs=1e7)
    head = dict(
        line[2:].split(": ", 1) for line in lines(folder / "results" / "waves_database.csv") if ": " in line
    )
    assert head["analysis"] == way
    columns, rows = (table(folder / "results" / name) for name in ("waves_database.csv", "waves.csv"))
    stress = rows[f"stress, {way} (Pa)"]
    np.testing.assert_allclose(columns["engineering_stress_MPa"], 1e-6 * stress, rtol=1e-7)
    stretch = 1.0 - rows[f"strain, {way} (1)"]
    np.testing.assert_allclose(rows["true stress (Pa)"], stress * stretch, rtol=1e-6, atol=1.0)


def test_an_analysis_that_is_none_is_refused(tmp_path):
    folder = bar_shot(tmp_path / "shot", waves='analysis = "four waves"')
    done = CliRunner().invoke(app, ["waves", str(folder)])
    assert done.exit_code == 2
    assert "waves.analysis" in done.stderr
