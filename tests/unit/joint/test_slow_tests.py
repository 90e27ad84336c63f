"""Slow tests of a list: SI units and signs, rejected inputs, predictions."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from kolsky_command import json_of, rows_of

from explicit.materials import neo_hookean
from explicit.relaxation import PronySeries, prony_stress
from kolsky.base.apparatus import NETWORK_CONSTANTS, Relaxation, prony_names
from kolsky.base.errors import InputError
from kolsky.inverse.slow_tests import read_slow_list, read_slow_tests, slow_measured, slow_predicted
from kolsky.material.relaxation.rate_fit import DynamicTest, HistoryTest, apparent_moduli
from kolsky.material.relaxation.temperature import wlf
from kolsky.report.canvas import build
from kolsky.report.figures import RELAXATIONS
from kolsky.studies.rate_dependence import analyse_rate_dependence, shot_modulus

LIST = """format = 1
[test.held]
kind = "relaxation"
file = "held.csv"
time = { column = "t (s)", unit = "s" }
stress = { column = "P (kPa)", unit = "kPa" }
strain = "20 %"
rise = "5 ms"
convention = "compression positive"
relative_sigma = "1 %"
[test.ramp]
kind = "history"
file = "ramp.csv"
time = { column = "t (s)", unit = "s" }
stress = { column = "P (kPa)", unit = "kPa" }
strain_column = { column = "e (%)", unit = "%" }
convention = "compression positive"
relative_sigma = "3 %"
[test.dma]
kind = "oscillation"
file = "dma.csv"
frequency = { column = "f (Hz)", unit = "Hz" }
storage = { column = "E1 (Pa)", unit = "Pa" }
loss = { column = "E2 (Pa)", unit = "Pa" }
relative_sigma = "2 %"
"""


def written(folder: Path, text: str = LIST) -> Path:
    (folder / "held.csv").write_text("t (s),P (kPa)\n0.01,8.0\n1.0,6.0\n")
    (folder / "ramp.csv").write_text("t (s),P (kPa),e (%)\n0.0,0.0,0.0\n1.0,3.0,5.0\n2.0,7.0,10.0\n")
    (folder / "dma.csv").write_text("f (Hz),E1 (Pa),E2 (Pa)\n1.0,60000,1000\n10.0,64000,2000\n")
    (folder / "slow.toml").write_text(text)
    return folder / "slow.toml"


def test_a_list_is_read_in_si_tension_positive(tmp_path: Path) -> None:
    held, ramp, dma = read_slow_tests(written(tmp_path))
    assert isinstance(held, HistoryTest)
    assert held.label == "held"
    assert held.stretch[-1] == pytest.approx(0.8)
    np.testing.assert_allclose(held.stress[np.isfinite(held.sigma)], [-8e3, -6e3])
    np.testing.assert_allclose(held.sigma[np.isfinite(held.sigma)], [80.0, 60.0])
    assert held.time[held.stretch < 0.8 + 1e-12][0] == pytest.approx(5e-3)  # the end of the rise
    assert isinstance(ramp, HistoryTest)
    np.testing.assert_allclose(ramp.stretch, [1.0, 0.95, 0.9])
    np.testing.assert_allclose(ramp.stress, [0.0, -3e3, -7e3])
    np.testing.assert_allclose(ramp.sigma, [np.inf, 90.0, 210.0])  # at rest nothing is measured
    assert isinstance(dma, DynamicTest)
    np.testing.assert_allclose(dma.angular_frequency, 2.0 * np.pi * np.array([1.0, 10.0]))
    np.testing.assert_allclose(dma.sigma, [1200.0, 1280.0, 20.0, 40.0])
    values, sigma = slow_measured((held, ramp, dma))
    assert len(values) == len(sigma) == 2 + 2 + 4


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('strain = "20 %"\n', "", r'line 2.*test.held.strain.*is missing; kind = "relaxation" needs it'),
        ('rise = "5 ms"', 'loss = { column = "x", unit = "Pa" }', "kind = .relaxation. does not read it"),
        ('relative_sigma = "3 %"', "", "as if the test had no uncertainty"),
        ('strain = "20 %"', 'strain = "120 %"', "in compression below 100 %"),
        ('file = "dma.csv"', 'file = "other.csv"', "other.csv"),
        ('unit = "Hz"', 'unit = "rpm"', "is not a unit of a frequency"),
        ("0.01,8.0", "", "held.csv"),
    ],
)
def test_what_cannot_be_read_is_refused(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = written(tmp_path, LIST.replace(old, new, 1))
    if old == "0.01,8.0":
        (tmp_path / "held.csv").write_text("t (s),P (kPa)\n0.001,8.0\n1.0,6.0\n")  # within the rise
        words = "times must be >= the rise"
    with pytest.raises((InputError, ExceptionGroup)) as refused:
        read_slow_tests(path)
    import re

    assert re.search(words, str(refused.value) + repr(refused.value), re.DOTALL)


def test_predictions_of_a_branch_are_those_of_the_closed_form() -> None:
    law = neo_hookean(20e3)
    series = Relaxation("prony", dict(zip(prony_names(1), (0.4, 0.01), strict=True)))
    omega = np.array([10.0, 1000.0])
    ones = np.ones(2)
    dma = DynamicTest(omega, ones, ones, ones, ones)
    held = HistoryTest.relaxation([0.02], [-1.0], [1.0], stretch=0.8)
    found = slow_predicted((dma, held), law, series, {"stiffness_factor": 1.1, "prony_strength_1": 0.5})
    x = omega * 0.01
    young = 1.1 * 60e3
    np.testing.assert_allclose(found[:2], young * (1.0 + 0.5 * x**2 / (1.0 + x**2)))
    np.testing.assert_allclose(found[2:4], young * 0.5 * x / (1.0 + x**2))
    # P = m mu (lam - lam^-2) of the long-term law
    slow = 1.1 * 20e3 * (0.8 - 0.8**-2)
    assert slow_predicted((held,), law, None, {"stiffness_factor": 1.1})[0] == pytest.approx(slow)
    # after two relaxation times the branch holds exp(-2) of its stress
    assert found[4] / slow == pytest.approx(1.0 + 0.5 * np.exp(-2.0), rel=1e-9)


def test_a_network_has_no_moduli_and_is_at_rest_the_law() -> None:
    law = neo_hookean(20e3)
    network = Relaxation(
        "bergstrom_boyce", dict(zip(NETWORK_CONSTANTS, (0.5, 8e3, 4.0, -1.0, 0.01), strict=True))
    )
    held = HistoryTest.relaxation([0.0], [-1.0], [1.0], stretch=0.9)
    found = slow_predicted((held,), law, network, {"stiffness_factor": 1.2, "creep_ratio": 0.25})
    # before it creeps both networks stand together: 1 + s
    assert found[0] == pytest.approx(1.25 * 1.2 * 20e3 * (0.9 - 0.9**-2), rel=1e-6)
    ones = np.ones(1)
    with pytest.raises(ValueError, match="leave the test out, or fit a Prony series"):
        slow_predicted((DynamicTest(ones, ones, ones, ones, ones),), law, network, {})
    assert slow_predicted((), law, network, {}).size == 0


LAW, SERIES = neo_hookean(20e3), PronySeries((0.4,), (0.5,))
DYNAMICS_LIST = """format = 1
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


def list_file(folder, text=DYNAMICS_LIST, *, elastic=False):
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
    hold = read_slow_list(list_file(tmp_path)).tests[0]
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
    said = json_of("material", "relaxation", list_file(tmp_path), "--branches", "2", "--out", out)
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
    shifts = rows_of(out / "relaxation_shifts.csv")
    assert [float(row["temperature (degC)"]) for row in shifts] == pytest.approx([0.0, 10.0, 25.0, 40.0])
    assert float(shifts[2]["lg a_T, free (1)"]) == 0.0
    page = (out / "relaxation.html").read_text(encoding="utf-8")
    assert page.count("<svg") == 4
    assert set(said["inputs"]) == {str(tmp_path / name) for name in ("slow.toml", "hold.csv", "dma.csv")}


def test_an_elastic_sweep_is_left_out_and_refused_beside_shots(tmp_path):
    path = list_file(tmp_path, elastic=True)
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
    path = list_file(tmp_path, DYNAMICS_LIST.replace("[test.hold]", law + "[test.hold]"))
    assert read_slow_list(path).law.initial_shear_modulus == pytest.approx(30e3)
    with pytest.raises(InputError, match="that of the shots"):
        read_slow_tests(path)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('unit = "degC"', 'unit = "F"', "is not a unit of temperatures"),
        ('reference = "25 degC"', 'reference = "25"', "is not a temperature"),
        ('reference = "25 degC"', 'reference = "-300 degC"', "above absolute zero"),
        ('reference = "25 degC"', 'reference = "5 degC"', "not one of the measured temperatures"),
        ('reference = "25 degC"\n', "", "is missing"),
    ],
)
def test_temperatures_that_cannot_be_are_refused(tmp_path, old, new, message):
    with pytest.raises(InputError, match=message):
        read_slow_list(list_file(tmp_path, DYNAMICS_LIST.replace(old, new)))
