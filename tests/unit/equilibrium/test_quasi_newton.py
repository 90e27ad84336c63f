"""Kept tangents and the continuation of a history, in closed form."""

import numpy as np
import pytest

from explicit.materials import LAWS
from kolsky.equilibrium.meshes import box
from kolsky.equilibrium.model import Fixed, Model, Prescribed
from kolsky.equilibrium.solid import Isotropic, bulk
from kolsky.equilibrium.solve import PAIRS, Newton, QuasiNewtonTangent, continued, solve


class Doubled:
    """Factors of 2 I."""

    def solve(self, right):
        return 0.5 * right

    def solve_transposed(self, right):
        return 0.5 * right


def test_the_formula_is_that_of_bfgs() -> None:
    # H+ = (I - s y^T / y.s) H (I - y s^T / y.s) + s s^T / y.s  (Nocedal and Wright 2006, Eq. 6.17)
    rng = np.random.default_rng(3)
    A = rng.normal(size=(5, 5))
    A = A @ A.T + np.eye(5)
    H, kept = 0.5 * np.eye(5), QuasiNewtonTangent(Doubled(), learns=True)
    for step in rng.normal(size=(3, 5)):
        change = A @ step
        kept.learn(step, change)
        left = np.eye(5) - np.outer(step, change) / (change @ step)
        H = left @ H @ left.T + np.outer(step, step) / (change @ step)
    found = np.array([kept.direction(column) for column in np.eye(5)])
    np.testing.assert_allclose(found, -H, rtol=1e-12, atol=1e-12 * np.abs(H).max())
    assert kept.uses == 3


def test_what_would_spoil_the_formula_is_not_learnt() -> None:
    step, residual = np.array([1.0, 0.0]), np.array([1.0, 2.0])
    falling, still = QuasiNewtonTangent(Doubled(), learns=True), QuasiNewtonTangent(Doubled(), learns=False)
    falling.learn(step, -step)
    still.learn(step, 3.0 * step)
    for kept in (falling, still):
        np.testing.assert_allclose(kept.direction(residual), [-0.5, -1.0])
        assert kept.uses == 1


def test_only_the_last_pairs_are_remembered() -> None:
    kept = QuasiNewtonTangent(Doubled(), learns=True)
    axes = np.eye(PAIRS + 1)
    for axis in axes:
        kept.learn(axis, 4.0 * axis)
    np.testing.assert_allclose([-kept.direction(axis) @ axis for axis in axes], [0.5] + [0.25] * PAIRS)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
def test_a_polynomial_is_continued(degree: int) -> None:
    places = [0.0, -1.0, -1.5, -3.0, -4.0, -5.0]
    rng = np.random.default_rng(degree)
    of = rng.normal(size=(3, degree + 1))
    states = [np.array([np.polyval(row, x) for row in of]) for x in places]
    wanted = [np.polyval(row, 1.0) for row in of]
    np.testing.assert_allclose(continued(places, states), wanted, rtol=1e-9)


def test_beyond_a_kink_few_states_are_taken() -> None:
    # at rest until the last step but one, then straight on: 0, 0, 0, 0, 1, 2 goes on to 3
    states = [np.array([value]) for value in (2.0, 1.0, 0.0, 0.0, 0.0, 0.0)]
    np.testing.assert_allclose(continued([0.0, -1.0, -2.0, -3.0, -4.0, -5.0], states), [3.0])


def test_a_smooth_history_takes_fewer_factorisations_than_steps() -> None:
    rubber = Isotropic(LAWS["neo_hookean"].of([25e3]), bulk(2e5))
    grips = (Fixed("left"), Fixed("right", axes=(1, 2)), Prescribed("right", 0, "pull"))
    strip = Model(box((0.1, 0.025, 0.005), (8, 2, 1), kind="hex8"), rubber, grips)
    pulls = np.linspace(0.01, 0.1, 10)
    found = solve(strip, {"pull": pulls})
    assert found.outcome.ok
    assert found.factorisations < 10
    # what they converge to is an equilibrium of its own tangent
    tight = solve(strip, {"pull": pulls}, newton=Newton(tolerance=1e-11, single=False))
    np.testing.assert_allclose(found.reaction("right"), tight.reaction("right"), rtol=1e-8, atol=1e-9)
