"""The fitted law as a curve, planned tests, mid-regions and tables: closed forms."""

import tomllib

import numpy as np
import pytest

from kolsky.bodies.specimen_constants import Constants, law_curve, shot_lines
from kolsky.bodies.specimen_studies import cross_table, expected, plan

NEO = Constants("neo_hookean", {"mu": 2.0e4, "poisson": 0.45}, ("mu",))
MOONEY = Constants("mooney_rivlin", {"C10": 9e3, "C01": 4e3, "C11": 0.0, "poisson": 0.45}, ("C10", "C01"))


def test_curve_of_a_neo_hookean_law() -> None:
    curve = law_curve(NEO, np.array([[1e6]]), branch="tension", largest_strain=1.0)
    lam = 1.0 + curve.strain
    assert curve.strain[[0, -1]] == pytest.approx([0.0, 1.0])
    assert curve.stress == pytest.approx(2e4 * (lam - lam**-2))
    # sigma(mu) = 1 kPa moves every point by 1/20 of its stress.
    assert curve.sigma == pytest.approx(curve.stress / 20.0, rel=1e-4)


def test_curve_in_compression_and_of_the_coupled_law() -> None:
    coupled = Constants("neo_hookean_coupled", {"E": 5.8e4, "poisson": 0.45}, ("E",))
    curve = law_curve(coupled, np.full((1, 1), np.nan), branch="compression", largest_strain=0.5)
    lam = 1.0 + curve.strain
    assert lam[-1] == pytest.approx(0.5)
    assert curve.stress == pytest.approx(5.8e4 / 2.9 * (lam - lam**-2))
    assert curve.modes.shape == (0, 41)


def test_correlated_constants_move_a_curve_less() -> None:
    # T = 2 (lam - lam^-2)(C10 + C01 / lam): the variance is s^T C s with the slopes s.
    covariance = 1e4 * np.array([[4.0, -2.9], [-2.9, 2.25]])
    curve = law_curve(MOONEY, covariance, branch="tension", largest_strain=1.5)
    lam = 1.0 + curve.strain
    slopes = 2.0 * (lam - lam**-2) * np.stack([np.ones_like(lam), 1.0 / lam])
    variance = np.einsum("in,ij,jn->n", slopes, covariance, slopes)
    assert curve.sigma**2 == pytest.approx(variance, rel=1e-4, abs=1e-9)


def test_lines_for_a_shot() -> None:
    curve = law_curve(NEO, np.array([[1e6]]), branch="compression", largest_strain=0.5)
    lines = tomllib.loads(shot_lines(curve, "law.csv"))["curve"]
    assert lines["branch"] == "compression"
    assert lines["modes"] == {"prefix": "mode", "unit": "Pa"}


def test_expected_deviations_add_information() -> None:
    # J^T J of two tests with one row of slope each constant: sigma of C10 is 1 / sqrt(sum J^2).
    whitened = {
        "a": np.array([[3.0, 0.0], [0.0, 1.0]]) * 1e-3,
        "b": np.array([[4.0, 0.0], [0.0, 1.0]]) * 1e-3,
    }
    forces = {"a": 2.0, "b": 5.0}
    one = expected(["a"], whitened, forces, MOONEY, ())
    assert one.relative == pytest.approx([1e3 / 3.0 / 9e3, 1e3 / 4e3])
    both = expected(["a", "b"], whitened, forces, MOONEY, ["C10"])
    assert both.relative == pytest.approx([1e3 / 5.0 / 9e3, 1e3 / np.sqrt(2.0) / 4e3])
    assert both.criterion == pytest.approx(both.relative[0])
    assert both.peak_force == 5.0
    # With nothing wanted: the geometric mean of the principal deviations.
    assert one.criterion == pytest.approx(np.sqrt(one.relative[0] * one.relative[1]))
    assert [c.tests for c in plan([["a"], ["a", "b"]], whitened, forces, MOONEY)] == [("a", "b"), ("a",)]


def test_a_test_that_does_not_tell_is_last() -> None:
    whitened = {"blind": np.array([[1.0, 0.0], [1.0, 0.0]]) * 1e-3, "seen": np.eye(2) * 1e-3}
    found = plan([["blind"], ["seen"]], whitened, {"blind": 1.0, "seen": 1.0}, MOONEY)
    assert [one.tests for one in found] == [("seen",), ("blind",)]
    # what it does see is known: 1 / (C10 sqrt(2) 1e-3)
    assert found[1].relative[0] == pytest.approx(1.0 / (MOONEY.start[0] * np.sqrt(2.0) * 1e-3))
    assert found[1].relative[1] == np.inf
    assert found[1].criterion == np.inf


def test_cross_table_has_a_row_a_fit() -> None:
    assert cross_table([], ["a", "b"]).shape == (0, 2)
