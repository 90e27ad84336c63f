"""What the choice between elastic and relaxing says, and when it says that it was not made."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe.least_squares import Whitening
from kolsky.diagnosis.relaxation import (
    choice_in_words,
    choice_with_mesh_error,
    deviance_with_mesh_patterns,
    points_in_step,
)
from kolsky.inverse.joint_result import ModelChoice, rate_of
from kolsky.inverse.result import Verdict
from kolsky.uncertainty.mesh_error import MeshChange, mesh_patterns

ASKED = ModelChoice(-8.0, -2.0, {}, 20.0, 1e-3, 1e-4, asked_for=True, sentence="the data ask for it")


class TwoShots:
    """Data of two shots with unit noise, two entries each."""

    data = np.zeros(4)
    shots = (0, 1)

    def of_shot(self, k: int, row: np.ndarray) -> np.ndarray:
        return np.where(np.arange(4) // 2 == k, row, 0.0)

    def weighed_beside(self, residual: np.ndarray, patterns: np.ndarray) -> None:
        assert not np.isnan(residual).any()

    def whitening(self, objectives: None, patterns: np.ndarray) -> Whitening:
        return Whitening(np.ones(4), patterns)


def strength(value: float, noise: float, mesh: float) -> Any:
    size = SimpleNamespace(name="prony_strength_1", value=value, sigma=float(np.hypot(noise, mesh)))
    return {"prony_strength_1": size}


def test_a_strength_that_the_mesh_may_feign_is_not_asked_for() -> None:
    assert choice_with_mesh_error(ASKED, strength(0.3, 0.06, 0.08)) is ASKED  # 3 of 0.1
    doubtful = choice_with_mesh_error(ASKED, strength(0.19, 0.06, 0.08))
    assert not doubtful.asked_for
    assert "its strength, 0.19 with a standard uncertainty of 0.1, mesh included" in doubtful.sentence
    assert choice_with_mesh_error(ASKED, {}) is ASKED  # held, not found


def test_a_time_at_a_bound_is_no_relaxation() -> None:
    strong = strength(0.3, 0.06, 0.08)
    inside, at_bound = (SimpleNamespace(outcome=v) for v in (Verdict.IDENTIFIED, Verdict.AT_BOUND))
    assert choice_with_mesh_error(ASKED, {**strong, "prony_time_1": inside}) is ASKED
    said = choice_with_mesh_error(ASKED, {**strong, "prony_time_1": at_bound})
    assert not said.asked_for
    assert "prony_time_1 ends at a bound" in said.sentence
    assert rate_of("prony_strength_2") == "prony_time_2"
    assert rate_of("creep_ratio") == "creep_resistance"


def test_a_weak_branch_leaves_the_ringing_in_step() -> None:
    """The bulk modulus, with m (1 + c) / (1 - 2 nu), is what it was; where nu is held nothing moves."""
    points = np.array([[1.2, 0.4985, 0.1], [1.2, 0.499, 0.1]])
    moved = points_in_step(["stiffness_factor", "poisson", "prony_strength_1"], points, 0.1)
    np.testing.assert_allclose(1.1 / (1.0 - 2.0 * moved[:, 1]), 1.0 / (1.0 - 2.0 * points[:, 1]))
    np.testing.assert_array_equal(moved[:, [0, 2]], points[:, [0, 2]])
    held = points_in_step(["stiffness_factor", "damping", "prony_strength_1"], points, 0.1)
    np.testing.assert_array_equal(held, points)


def test_an_error_of_the_mesh_is_each_shots_own_and_of_known_size() -> None:
    stack: Any = TwoShots()
    change = MeshChange(coarser=np.array([1.0, 2.0, 3.0, 4.0]), element=np.full(4, 8.0), ratio=4.0)
    rows = mesh_patterns(stack, change)
    # Richardson's extrapolation with order 3.2: 4^3.2 - 1 = 83.449; elements come together as 4^-1.5 = 1/8
    np.testing.assert_allclose(rows[:2], np.array([[1, 2, 0, 0], [0, 0, 3, 4]]) / 83.449, rtol=1e-4)
    np.testing.assert_allclose(rows[2:], [[1, 1, 0, 0], [0, 0, 1, 1]])
    assert len(mesh_patterns(stack, MeshChange(change.coarser, None, 4.0))) == 2


def test_what_a_mesh_error_explains_speaks_against_no_model() -> None:
    stack: Any = TwoShots()
    pattern = np.array([[3.0, 0.0, 0.0, 0.0]])
    # variance 1 + 9 of the first entry; a point that is not reached adds nothing
    found = deviance_with_mesh_patterns(stack, np.array([2.0, 1.0, np.nan, 0.0]), pattern)
    assert found == pytest.approx(4.0 / 10.0 + 1.0 + np.log(10.0))


def test_a_search_that_ended_above_a_model_that_it_contains_decides_nothing() -> None:
    said = choice_in_words(666.0, 0.3, asked=False, missed=664.0)
    assert said.startswith("not decided")
    assert "ended 664 in -2 ln L above" in said


def test_the_choice_otherwise() -> None:
    assert choice_in_words(-8.0, 1e-4, asked=True).startswith(
        "the data ask for what relaxes (AIC -8.0; 0.01 %"
    )
    assert choice_in_words(2.0, 0.3, asked=False).startswith(
        "the data do not ask for what relaxes (AIC +2.0; 30 %"
    )
