"""Slow tests of a list: read in SI with their signs, refused where they cannot be, predicted."""

from pathlib import Path

import numpy as np
import pytest

from explicit.materials import neo_hookean
from kolsky.base.apparatus import NETWORK_CONSTANTS, Relaxation, prony_names
from kolsky.base.errors import InputError
from kolsky.inverse.slow_tests import read_slow_tests, slow_measured, slow_predicted
from kolsky.material.relaxation.evidence import DynamicTest, HistoryTest

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
