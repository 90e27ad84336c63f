"""Shared unknowns: parameters and nodes of the curve, coordinates, factors and smoothness."""

import numpy as np
import pytest

from kolsky.base.records import MaterialCurve
from kolsky.inverse.forward import Numerics
from kolsky.inverse.joint_result import JointSettings
from kolsky.inverse.joint_runs import Unknowns, node_strains, smoothness, with_factors

STRETCH = np.linspace(1.0, 0.4, 13)
CURVE = MaterialCurve(STRETCH, 1e4 * (STRETCH - STRETCH**-2.0), np.ones(13))


def test_parameters_come_first_in_their_own_coordinates() -> None:
    both = Unknowns({"poisson": (0.49, 0.499), "prony_time_1": (1e-5, 1e-3)}, nodes=4)
    assert both.names == ("poisson", "prony_time_1", "curve_1", "curve_2", "curve_3", "curve_4")
    x = np.array([0.495, 2e-4, 0.1, -0.2, 0.3, 0.0])
    inner = both.to_search(x)
    np.testing.assert_allclose(inner, [0.01, *x[1:]])
    np.testing.assert_allclose(both.from_search(inner), x)
    assert both.inner.logarithmic == (True, True, False, False, False, False)
    with pytest.raises(ValueError, match="cannot be free beside them"):
        Unknowns({"stiffness_factor": None}, nodes=4)
    alone = Unknowns({}, nodes=4)
    assert alone.parameters is None
    np.testing.assert_array_equal(alone.to_search(np.ones(4)), np.ones(4))


def test_the_stiffness_of_all_is_m_or_all_nodes_together() -> None:
    slopes = np.arange(12.0).reshape(2, 6)
    nodes = Unknowns({"poisson": None, "damping": None}, nodes=4)
    np.testing.assert_allclose(nodes.relative_stiffness(slopes, np.ones(6)), [14.0, 38.0])
    m = Unknowns({"poisson": None, "stiffness_factor": None})
    # d F / d ln m = m d F / d m
    np.testing.assert_allclose(m.relative_stiffness(slopes[:, :2], np.array([0.49, 1.5])), [1.5, 10.5])


def test_factors_stand_at_the_nodes_and_their_logarithm_is_linear_between() -> None:
    np.testing.assert_allclose(node_strains(CURVE, 4), [0.0, -0.2, -0.4, -0.6])
    logs = np.log([1.0, 1.2, 1.5, 1.5])
    factor = np.divide(with_factors(CURVE, logs), CURVE.stress, where=CURVE.stress != 0.0, out=np.ones(13))
    at = np.abs(STRETCH - 1.0)
    assert factor[np.isclose(at, 0.2)] == pytest.approx(1.2)
    assert factor[np.isclose(at, 0.3)] == pytest.approx(np.sqrt(1.2 * 1.5))
    assert factor[np.isclose(at, 0.6)] == pytest.approx(1.5)


def test_smoothness_is_the_second_difference_over_its_sigma() -> None:
    rows = smoothness(5, 0.1)
    assert rows.shape == (3, 5)
    np.testing.assert_allclose(rows @ (2.0 + 0.7 * np.arange(5.0)), 0.0, atol=1e-12)  # a line is smooth
    np.testing.assert_allclose(rows @ np.arange(5.0) ** 2, 20.0)  # second difference 2 over 0.1


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"curve_nodes": 3}, "curve_nodes must be 0 or 4 to 24, got 3"),
        ({"curve_roughness": 0.0}, "curve_roughness must be in"),
        ({"gain_each": 1.0}, "gain_each must be in"),
        ({"refined_mesh": (16, 22)}, "must be finer"),
        ({"numerics": Numerics(mesh=(16, 22), compressible=0.495)}, "leave the correction out"),
    ],
)
def test_settings_that_cannot_be_are_refused(given: dict, words: str) -> None:  # type: ignore[type-arg]
    with pytest.raises(ValueError, match=words):
        JointSettings(**given)
