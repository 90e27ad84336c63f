"""Data of several shots in one vector: its weights, blocks and each shot's own unknowns, in closed form."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from doe.least_squares import Whitening
from kolsky.bars.signals.transducers import ForceBins
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.inverse.joint_problem import CLOCK, ShotData, Stack, bounded_step, covariance, information
from kolsky.inverse.observations import Observations
from kolsky.joint_identification import _shot_unknown

WIDE = np.array([1e3])
"""Ranges of the unknowns, far beyond what the data leave."""


def shot(force: np.ndarray, outline: np.ndarray, *, sigma: float = 0.5, own: Any = None) -> ShotData:
    n, q = len(force), len(outline)
    edges = np.linspace(0.0, 1.0, n + 1)
    bins = ForceBins(edges=edges, mean=force, sigma=np.full(n, sigma), n=np.full(n, 3))
    history = ForceHistory(edges, np.zeros(n + 1), np.ones(n + 1))
    times = np.linspace(0.0, 1.0, q)
    line = CentreLine(times, np.arange(q), np.zeros(q), outline, np.full(q, 0.1))
    seen = Observations(force=history, bins=bins, centre_line=line)
    return ShotData(seen, np.ones(q, bool), np.zeros((0, n + q)), own or {})


def test_the_vector_is_shots_then_slow_tests_then_what_is_known() -> None:
    a, b = shot(np.array([1.0, 2.0]), np.array([3.0])), shot(np.array([4.0]), np.array([5.0, 6.0]))
    b = replace(b, counted=np.array([False, True]))
    stack = Stack((a, b), np.array([7.0]), np.array([0.2]), known=2)
    np.testing.assert_array_equal(stack.data, [1.0, 2.0, 3.0, 4.0, 6.0, 7.0, 0.0, 0.0])
    assert stack.ends == (3, 5)
    # A point that a run does not reach takes its measured value; a run that is lost stays lost.
    vectors = [np.array([[1.5, 2.5, np.nan]]), np.array([[4.5, 0.0, 6.5]])]
    whole = stack.joined(vectors, np.array([[7.5]]), np.zeros((1, 2)))
    np.testing.assert_array_equal(whole, [[1.5, 2.5, 3.0, 4.5, 6.5, 7.5, 0.0, 0.0]])
    lost = stack.joined([vectors[0], np.full((1, 3), np.nan)], np.zeros((1, 1)), np.zeros((1, 2)))
    assert np.isnan(lost[0, 3:5]).all()
    np.testing.assert_array_equal(stack.of_shot(1, np.arange(8.0)), [0, 0, 0, 3, 4, 0, 0, 0])


def test_discrepancies_are_each_shots_and_channels_own() -> None:
    a, b = shot(np.zeros(4), np.zeros(3)), shot(np.zeros(4), np.zeros(3))
    stack = Stack((a, b), np.zeros(1), np.array([0.2]), known=1)
    residual = np.concatenate(
        [np.full(4, 1.5), np.full(3, 0.05), np.full(4, 0.1), np.full(3, 0.3), [9.0, 9.0]]
    )
    weights = stack.weighting(residual)
    # mean square of the residual where it is above the noise, 0.5 and 0.1; slow tests keep their own
    np.testing.assert_allclose(weights.sigma, [*[1.5] * 4, *[0.1] * 3, *[0.5] * 4, *[0.3] * 3, 0.2, 1.0])


def test_patterns_are_a_shots_own_or_go_through_several() -> None:
    late = np.array([0.3, -0.2, 0.0])
    a = shot(np.array([1.0, 2.0]), np.array([3.0]), own={CLOCK: late})
    b = shot(np.array([4.0]), np.array([5.0]))
    common = np.array([[0.1, 0.2, 0.0, 0.4, 0.0]])
    # A slow test of sigma 0.3 hangs together with the first shot by the curve's noise; a prior row with none.
    curve = np.array([[0.2, 0.3, 0.0, 0.0, 0.0, 0.4]])
    stack = Stack((a, b), np.array([7.0]), np.array([0.3]), known=1, common=common, curve=curve)
    whitening = stack.whitening([one.objective for one in stack.shots])
    error = 0.2 * late  # what a pattern itself is off by is independent: PATTERN_ERROR
    c = np.diag(np.array([0.5, 0.5, 0.1, 0.5, 0.1, 0.3, 1.0]) ** 2)
    c[:3, :3] += np.diag(error**2) + np.outer(late, late)
    c[:5, :5] += common.T @ common
    c[:6, :6] += curve.T @ curve
    np.testing.assert_allclose(whitening.precision(np.eye(7)), np.linalg.inv(c), rtol=1e-9, atol=1e-12)


def test_the_most_likely_amount_of_a_pattern() -> None:
    # One datum of variance 1 + 4 with the pattern 2: amount 2 r / 5, and 1 - 4/5 of its variance is left.
    weights = Whitening(np.array([1.0]), np.array([[2.0]]))
    objective: Any = SimpleNamespace(whitening=lambda: weights)
    amount, left = _shot_unknown(np.array([2.0]), weights.precision(np.array([[-3.0]]))[0], objective)
    assert amount == pytest.approx(2.0 * 3.0 / 5.0)
    assert left == pytest.approx(np.sqrt(0.2))


def test_residuals_that_hang_together_widen_the_interval() -> None:
    n = 64
    stack = Stack((shot(np.zeros(n), np.zeros(0), sigma=1.0),), np.zeros(0), np.zeros(0), known=0)
    slopes, weights = np.ones((n, 1)), Whitening(np.ones(n))
    alternating = np.tile([1.0, -1.0], n // 2)
    # independent at most: the Gauss-Newton variance of a mean, 1 / n
    assert covariance(slopes, alternating, weights, stack, WIDE)[0, 0] == pytest.approx(1.0 / n)
    # blocks of 16 equal residuals: four sums of 16, (4 x 16^2 / n^2) n_blocks / (n_blocks - 1)
    blocks = np.repeat([1.0, -1.0, 1.0, -1.0], 16)
    expected = max(
        (n // length) * length**2 / n**2 * (n // length) / (n // length - 1) for length in (2, 4, 8, 16)
    )
    assert covariance(slopes, blocks, weights, stack, WIDE)[0, 0] == pytest.approx(expected)


def test_an_unknown_that_nothing_sees_keeps_the_width_of_its_range() -> None:
    rows = np.array([[3.0, 4.0], [0.0, 0.0]])
    found = np.linalg.inv(information(rows, np.array([10.0, 6.0])))
    # 1 / 25 of what is seen; the variance of an even distribution over 6 is 36 / 12
    np.testing.assert_allclose(found, np.diag([0.04, 3.0]))


def test_a_step_stops_at_a_bound_and_the_others_follow() -> None:
    # r = 2 - x - y, z = x: least at x = 0, y = 2; with y <= 1 the least of (1 - x)^2 + x^2 is at x = 1/2
    rows = np.array([[1.0, 1.0], [1.0, 0.0]])
    low, high = np.array([-5.0, -5.0]), np.array([5.0, 1.0])
    np.testing.assert_allclose(bounded_step(rows, np.array([-2.0, 0.0]), low, high), [0.5, 1.0])
    # where nothing is seen nothing moves
    still = bounded_step(np.array([[1.0], [0.0]]), np.array([-0.5]), low, high)
    np.testing.assert_allclose(still, [0.5, 0.0], atol=1e-12)


def test_discrepancies_of_what_free_patterns_leave() -> None:
    stack = Stack((shot(np.zeros(64), np.zeros(0), sigma=0.1),), np.zeros(0), np.zeros(0), known=0)
    ramp, alternating = np.linspace(-1.0, 1.0, 64), np.tile([1.0, -1.0], 32)
    ramp -= alternating * (ramp @ alternating) / 64.0
    found = stack.weighed_beside(5.0 * ramp + alternating, ramp[None])[0]
    assert found.force_discrepancy == pytest.approx(np.sqrt(1.0 - 0.01))


def test_two_shots_are_not_one_block() -> None:
    pair = (shot(np.zeros(8), np.zeros(0)), shot(np.zeros(8), np.zeros(0)))
    stack = Stack(pair, np.zeros(2), np.ones(2), known=1)
    for label in stack.blocks:
        assert len(label) == 19
        assert not set(label[:8].tolist()) & set(label[8:16].tolist())
        assert len(set(label[16:].tolist())) == 3  # slow tests and prior rows stand alone
