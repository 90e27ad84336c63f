"""Slow tests and shots on one axis: the shot's point by hand, remarks, the command from files to files."""

import csv
import json
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from explicit.materials import neo_hookean
from explicit.relaxation import PronySeries, prony_stress
from kolsky.base.errors import InputError
from kolsky.cli import app
from kolsky.inverse.slow_tests import read_slow_list, read_slow_tests
from kolsky.material.relaxation.rate_fit import apparent_moduli
from kolsky.material.relaxation.temperature import wlf
from kolsky.report.canvas import build
from kolsky.report.figures import RELAXATIONS
from kolsky.studies.rate_dependence import analyse_rate_dependence, shot_modulus

LAW, SERIES = neo_hookean(20e3), PronySeries((0.4,), (0.5,))
LIST = """format = 1
[test.hold]
kind = "history"
file = "hold.csv"
time = { column = "t (s)", unit = "s" }
stress = { column = "P (kPa)", unit = "kPa" }
strain_column = { column = "e (%)", unit = "%" }
convention = "compression positive"
relative_sigma = "1 %"
sigma_floor = "20 Pa"
[test.sweep]
kind = "sweep"
file = "dma.csv"
frequency = { column = "f (Hz)", unit = "Hz" }
storage = { column = "E1 (Pa)", unit = "Pa" }
loss = { column = "E2 (Pa)", unit = "Pa" }
temperature = { column = "T (degC)", unit = "degC" }
reference = "25 degC"
relative_sigma = "1 %"
sigma_floor = "60 Pa"
"""


def written(folder, text=LIST, *, elastic=False):
    """A hold of 0.1 to 100 s and a sweep of a solid of E = 60 kPa with one branch, of 1 % noise."""
    rng = np.random.default_rng(8)
    time = np.concatenate([np.linspace(0.0, 0.1, 21), 0.1 + np.geomspace(0.01, 100.0, 40)])
    stretch = 1.0 - 0.3 * np.minimum(time / 0.1, 1.0)
    stress = -1e-3 * prony_stress(LAW, SERIES, time, stretch) * (1.0 + 0.01 * rng.standard_normal(61))
    strain = 100.0 * (1.0 - stretch) + 0.02 * (time > 0.1) * rng.standard_normal(61)
    rows = np.column_stack([time, strain, stress])
    np.savetxt(folder / "hold.csv", rows, delimiter=",", header="t (s),e (%),P (kPa)", comments="")
    T, omega = (
        g.ravel() for g in np.meshgrid([0.0, 10.0, 25.0, 40.0], np.geomspace(0.1, 30.0, 9), indexing="ij")
    )
    reduced = omega * 10.0 ** wlf(T - 25.0, 5.0, 150.0)
    storage, loss = 60e3 * SERIES.storage(reduced), 60e3 * SERIES.loss(reduced)
    if elastic:
        storage, loss = 60e3 + 0.0 * storage, 0.0 * loss
    storage = storage * (1.0 + 0.01 * rng.standard_normal(T.size))
    loss = loss + 60.0 * rng.standard_normal(T.size)
    rows = np.column_stack([T, omega / (2.0 * np.pi), storage, loss])
    np.savetxt(folder / "dma.csv", rows, delimiter=",", header="T (degC),f (Hz),E1 (Pa),E2 (Pa)", comments="")
    (folder / "slow.toml").write_text(text)
    return folder / "slow.toml"


def shot(strains, stress, **changed):
    """As much of an identified shot as its point needs."""
    history = SimpleNamespace(largest=0.5, span=(1e-4, 9e-4))
    curve = SimpleNamespace(stretch=1.0 - np.asarray(strains), stress=-np.asarray(stress))
    return SimpleNamespace(
        name="shot", m=1.1, sigma=0.02, history=history, quasi_static=SimpleNamespace(curve=curve), **changed
    )


def test_a_shot_stands_at_half_its_duration_with_m_times_its_curves_modulus():
    strain = np.array([0.0, 0.1, 0.3, 0.5, 0.6])
    lam = 1.0 - strain
    made = shot_modulus(shot(strain, 20e3 * (lam**-2 - lam) * np.array([1, 1, 1, 1, 9])))
    assert made.age[0] == pytest.approx(4e-4)
    assert made.strain[0] == -0.5
    assert made.modulus[0] == pytest.approx(1.1 * 60e3)  # the last point lies past what the shot reached
    assert made.sigma[0] == pytest.approx(0.02 * 60e3)
    with pytest.raises(ValueError, match="has no point below its largest strain"):
        shot_modulus(shot([0.0, 0.7], [0.0, 1e4]))


def test_a_noisy_hold_has_an_age(tmp_path):
    hold = read_slow_list(written(tmp_path)).tests[0]
    shown = apparent_moduli(hold)
    # A ramp of 0.1 s, then held: the age is the time less the mean time of a ramp that is steady in strain.
    lam = 0.7
    middle = 0.1 * (1.0 / 0.3 + 1.0 / np.log(lam))  # of the ramp's d ln(lam), by parts
    assert shown.age[-1] == pytest.approx(100.1 - middle, rel=1e-3)
    back = hold.stretch.copy()
    back[-1] = 0.9
    with pytest.raises(ValueError, match="turns back at sample 60"):
        apparent_moduli(type(hold)(hold.time, back, hold.stress, hold.sigma))


def test_from_files_to_the_constants(tmp_path):
    out = tmp_path / "out"
    done = CliRunner().invoke(
        app,
        ["material", "relaxation", str(written(tmp_path)), "--branches", "2", "--out", str(out), "--json"],
    )
    assert done.exit_code == 0, done.output
    said = json.loads(done.stdout)
    assert said == json.loads((out / "relaxation.json").read_text(encoding="utf-8"))
    assert said["branches"] == 1
    for name, planted in (("strength 1", 0.4), ("time 1", 0.5)):
        low, high = said["constants"][name]["interval"]
        assert low < planted < high < 1.2 * low
    low, high = said["long_term_E"]["interval"]
    assert low < 60e3 < high < 1.05 * low
    sweep = said["sweeps"]["sweep"]
    assert sweep["law_holds"]
    assert abs(sweep["C1"] - 5.0) < 3.0 * sweep["sigma_C1_C2"][0]
    with (out / "relaxation_shifts.csv").open(encoding="utf-8") as file:
        shifts = list(csv.DictReader(file))
    assert [float(row["temperature (degC)"]) for row in shifts] == pytest.approx([0.0, 10.0, 25.0, 40.0])
    assert float(shifts[2]["lg a_T, free (1)"]) == 0.0
    page = (out / "relaxation.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 4
    assert set(said["inputs"]) == {str(tmp_path / name) for name in ("slow.toml", "hold.csv", "dma.csv")}


def test_an_elastic_sweep_is_left_out_and_refused_beside_shots(tmp_path):
    path = written(tmp_path, elastic=True)
    found = analyse_rate_dependence(read_slow_list(path), [shot([0.0, 0.2], [0.0, 1e4])], at_most=1)
    assert [test.label for test in found.tests] == ["hold"]
    assert any("is not determined" in said and "not in the fit" in said for said in found.remarks)
    assert [one.label for one in found.moduli] == ["hold", "shot"]
    assert [kind.name for kind in RELAXATIONS.values() if kind.applies(found)] == [
        "relaxation-moduli", "relaxation-holds",
    ]  # fmt: skip
    build(RELAXATIONS["relaxation-moduli"], found)
    with pytest.raises(InputError, match="is not determined"):
        read_slow_tests(path)


def test_a_law_is_the_lists_or_the_shots(tmp_path):
    law = '[law]\nname = "neo_hookean"\nparameters = { mu = "30 kPa" }\nbranch = "compression"\n'
    law += 'largest_strain = "50 %"\nrelative_sigma = "1 %"\n'
    path = written(tmp_path, LIST.replace("[test.hold]", law + "[test.hold]"))
    assert read_slow_list(path).law.initial_shear_modulus == pytest.approx(30e3)
    with pytest.raises(InputError, match="shots' own"):
        read_slow_tests(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('unit = "degC"', 'unit = "F"', "is not a unit of temperatures"),
        ('reference = "25 degC"', 'reference = "25"', "is not a temperature"),
        ('reference = "25 degC"', 'reference = "-300 degC"', "above absolute zero"),
        ('reference = "25 degC"', 'reference = "5 degC"', "none of the measured temperatures"),
        ('reference = "25 degC"\n', "", "is missing"),
    ],
)
def test_temperatures_that_cannot_be_are_refused(tmp_path, old, new, message):
    with pytest.raises(InputError, match=message):
        read_slow_list(written(tmp_path, LIST.replace(old, new)))
