"""Goodness of fit in closed form: residual, information, whiteness, blocks, the verdict."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from kolsky.base.records import CentreLine, ForceHistory
from kolsky.diagnosis.fit_quality import (
    LIMITS,
    SLOW_LIMITS,
    block_means,
    block_noise,
    blocks,
    correlated,
    fit_quality,
    in_quadrature,
    information_shares,
    left_over,
    mesh_changes,
    neighbours,
)
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import observe
from kolsky.inverse.result import FitQuality
from kolsky.uncertainty.mesh_error import ELEMENT_ORDER, GradedChange, MeshChange

FloatArray = NDArray[np.float64]
FRAMES, POINTS = 16, 6
TIME = np.linspace(0.0, 1.6e-3, 1601)


def objective(*, force_sigma: float = 0.5, outline_sigma: float = 1e-6) -> Objective:
    """Sixteen bins of a force of 1e4 N/s, and six points in each of sixteen frames."""
    when = np.repeat((np.arange(FRAMES) + 0.5) * 1e-4, POINTS)
    line = CentreLine(
        when,
        np.repeat(np.arange(FRAMES), POINTS),
        np.tile(1e-3 * np.arange(POINTS), FRAMES),
        np.tile(5e-3 + 1e-4 * np.arange(POINTS), FRAMES),
        np.full(when.size, outline_sigma),
    )
    history = ForceHistory(TIME, 1e4 * TIME, np.full(TIME.size, force_sigma))
    seen = observe(history, line, window=(0.0, 1.6e-3), bin_width=1e-4)
    return Objective(seen, np.ones(when.size, dtype=bool))


def judged(
    residual: FloatArray, changes: Mapping[str, FloatArray] | None = None, **more: float
) -> tuple[FitQuality, FitQuality]:
    one = objective(**more)
    jacobian = np.ones((len(one.data), 1))
    nothing = np.zeros((1, len(one.data)))
    force, outline = fit_quality(
        one.with_discrepancy(one.data - residual),
        one.data - residual,
        jacobian,
        changes={"flyer motion": nothing, **(changes or {})},
        names=("m",),
    )
    return force, outline


def test_a_change_that_a_parameter_makes_leaves_nothing() -> None:
    rng = np.random.default_rng(1)
    jacobian, weight = rng.standard_normal((7, 2)), rng.uniform(0.5, 2.0, 7)
    weighted = (weight[:, None] * jacobian).T
    gain: FloatArray = np.linalg.solve(weighted @ jacobian, weighted).astype(np.float64)
    np.testing.assert_allclose(left_over(jacobian @ [2.0, -3.0], jacobian, gain), 0.0, atol=1e-12)
    # What no parameter can make is left whole: it is orthogonal to the Jacobian in the weights.
    other = np.linalg.svd(jacobian.T * weight)[2][-1]
    np.testing.assert_allclose(left_over(np.stack([other, 2.0 * other]), jacobian, gain)[1], 2.0 * other)
    lost = np.array([np.nan, *np.zeros(6)])
    np.testing.assert_array_equal(left_over(lost, jacobian, gain), 0.0)


def test_shares_of_information_are_those_of_the_fisher_matrix() -> None:
    rng = np.random.default_rng(2)
    jacobian, sigma = rng.standard_normal((9, 2)), rng.uniform(0.5, 2.0, 9)
    force = np.arange(9) < 4
    weighted = jacobian / sigma[:, None]
    gain = np.linalg.inv(weighted.T @ weighted) @ (jacobian / sigma[:, None] ** 2).T
    # The information on the first parameter, the other fitted: its column less its projection on the other's.
    a, b = weighted.T
    alone = a - b * (a @ b) / (b @ b)
    shares = information_shares(gain, gain * sigma**2, {"force": force, "outline": ~force})
    assert shares["force"][0] == pytest.approx((alone[force] ** 2).sum() / (alone**2).sum(), rel=1e-12)
    np.testing.assert_allclose(shares["force"] + shares["outline"], 1.0, rtol=1e-12)


def test_an_error_in_common_takes_its_share_of_the_information() -> None:
    """Two data of one quantity, the first with a common error of 3 beside its own of 1: weights 0.1, 1."""
    gain = np.array([[1.0, 10.0]]) / 11.0
    covariance = np.diag([10.0, 1.0])
    found = information_shares(gain, gain @ covariance, {"a": np.array([True, False])})
    assert found["a"][0] == pytest.approx(1.0 / 11.0, rel=1e-12)


def test_a_parameter_that_no_datum_moves_has_no_shares() -> None:
    gain = np.array([[0.0, 0.0], [3.0, 4.0]])
    found = information_shares(gain, gain, {"a": np.array([True, False])})
    np.testing.assert_array_equal(found["a"], [np.nan, 9.0 / 25.0])


def test_correlation_of_neighbours_is_ljung_and_boxs() -> None:
    residual = np.array([1.0, 2.0, -1.0, -2.0, 1.0, 3.0])
    r, probability = correlated(residual, np.arange(5), np.arange(1, 6))
    # Sum of products over sum of squares: (2 - 2 + 2 - 2 + 3) / 20.
    assert r == pytest.approx(3.0 / 20.0, rel=1e-12)
    # Q = n (n + 2) r^2 / (n - 1) of Ljung and Box (1978) with n = 6.
    assert probability == pytest.approx(chi2.sf(6.0 * 8.0 / 5.0 * r**2, 1), rel=1e-12)
    assert np.isnan(correlated(residual, np.arange(1), np.arange(1, 2))[0])


def test_neighbours_stay_in_their_frame() -> None:
    one = objective()
    first, second = neighbours(one, "outline")
    assert first.size == FRAMES * (POINTS - 1)
    np.testing.assert_array_equal(second - first, 1)
    first, second = neighbours(one, "force")
    assert (first.size, first[0], second[-1]) == (15, 0, 15)


def test_blocks_are_eighths_of_the_window_and_thirds_of_a_frame() -> None:
    one = objective()
    np.testing.assert_array_equal(blocks(one, "force"), np.repeat(np.arange(8), 2))
    lowest = blocks(one, "outline")[: 2 * POINTS]
    np.testing.assert_array_equal(lowest, [0, 0, 1, 1, 2, 2] * 2)
    block = np.array([0, 0, 1, 1, 1])
    np.testing.assert_allclose(block_means(np.array([1.0, 3.0, 3.0, 6.0, 9.0]), block), [2.0, 6.0])
    # Of means of two and of three values of sigma 2: variances 4 / 2 and 4 / 3.
    assert block_noise(np.full(5, 2.0), block) == pytest.approx(np.sqrt(0.5 * (2.0 + 4.0 / 3.0)), rel=1e-12)


def test_figures_of_a_residual_by_hand() -> None:
    one = objective()
    n = one.n_force
    sigma = one.noise[0]
    residual = np.zeros(len(one.data))
    residual[:n] = 3.0 * sigma * np.tile([1.0, -1.0], n // 2)
    force, outline = judged(residual)
    assert force.residual == pytest.approx(3.0 * sigma, rel=1e-12)
    assert force.over_noise == pytest.approx(3.0, rel=1e-12)
    assert force.chi2 == pytest.approx(9.0, rel=1e-12)
    assert force.discrepancy_share == pytest.approx(8.0 / 9.0, rel=1e-12)  # tau^2 = (9 - 1) sigma^2
    assert force.peak == pytest.approx(1e4 * 1.55e-3, rel=1e-9)  # the mean of the last bin
    assert force.over_peak == pytest.approx(3.0 * sigma / 15.5, rel=1e-9)
    assert force.excess == pytest.approx(3.0, rel=1e-12)
    assert force.slow_residual == pytest.approx(0.0, abs=1e-12)  # it alternates within each block
    assert force.slow_expected == pytest.approx(sigma / np.sqrt(2.0), rel=1e-12)
    assert force.correlation < -0.9
    assert (outline.residual, outline.values, outline.unit) == (0.0, FRAMES * POINTS, "m")
    assert outline.peak == pytest.approx(1e-4 * (POINTS - 1), rel=1e-9)
    assert outline.discrepancy_share == 0.0


def test_what_is_predicted_adds_up_in_quadrature() -> None:
    one = objective()
    n, sigma = one.n_force, one.noise[0]
    wave = np.zeros(len(one.data))
    wave[:n] = np.tile([1.0, -1.0], n // 2)  # orthogonal to the parameter's column
    draws = np.stack([4.0 * sigma * wave, -4.0 * sigma * wave])
    force, _ = judged(np.zeros(len(one.data)), {"flyer motion": draws, "mesh": 2.0 * sigma * wave})
    assert force.predicted["flyer motion"] == pytest.approx(4.0 * sigma, rel=1e-9)
    assert force.predicted["mesh"] == pytest.approx(2.0 * sigma, rel=1e-9)
    assert force.expected == pytest.approx(np.sqrt(1.0 + 16.0 + 4.0) * sigma, rel=1e-9)


def test_the_verdict_has_two_limits_and_none_without_the_flyers_noise() -> None:
    one = objective()
    n, sigma = one.n_force, one.noise[0]
    fast = np.zeros(len(one.data))
    fast[:n] = sigma * np.tile([1.0, -1.0], n // 2)
    assert judged(0.99 * LIMITS["force"] * fast)[0].explained
    assert not judged(1.01 * LIMITS["force"] * fast)[0].explained
    slow = np.zeros(len(one.data))
    slow[:n] = sigma / np.sqrt(2.0) * np.repeat(np.tile([1.0, -1.0], 4), 2)
    assert judged(0.99 * SLOW_LIMITS["force"] * slow)[0].explained
    assert not judged(1.01 * SLOW_LIMITS["force"] * slow)[0].explained
    nothing = fit_quality(one, one.data - 100.0 * fast, np.ones((len(one.data), 1)), changes={})
    assert nothing[0].explained  # what the flyer's noise leaves is not known, so nothing is judged
    assert nothing[0].limit == np.inf


def test_an_unknown_residual_is_not_explained() -> None:
    assert not replace(judged(np.zeros(112))[0], residual=np.nan).explained


def test_remaining_mesh_error_is_richardsons() -> None:
    coarser, element = np.array([3.0, 0.0]), np.array([0.0, 1.0])
    rows = mesh_changes(MeshChange(coarser, element, ratio=2.0))
    # Of second order a third of the shift is left; the elements come together as they do for the parameters.
    squares = (rows**2).mean(axis=0)
    np.testing.assert_allclose(np.sqrt(squares), [1.0, 2.0**-ELEMENT_ORDER / 3.0**0.5], rtol=1e-12)
    # Where graded meshes tell it, it is what they say: 0.5 of them, and 0.2 less than the refined mesh has.
    graded = GradedChange(np.array([1.5, 0.0]), 2.0, np.array([-0.2, 0.0]))
    rows = mesh_changes(MeshChange(coarser, None, ratio=2.0, graded=graded))
    np.testing.assert_allclose(np.sqrt((rows**2).mean(axis=0)), [0.7, 0.0], rtol=1e-12)
    np.testing.assert_allclose((in_quadrature([coarser]) ** 2).mean(axis=0), coarser**2)
