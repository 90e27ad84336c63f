"""Least squares in batches: known optima, bounds, failed runs, rough functions, several starts."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize

from doe import Box
from doe.least_squares import STEP, Whitening, least_squares

FloatArray = NDArray[np.float64]
BOX = Box(("a", "b"), (0.1, 1e-6), (3.0, 1e-3), (False, True))
TIME = np.linspace(0.0, 2.0, 60)
TRUTH = np.array([1.3, 4e-5])


def decay(points: FloatArray) -> FloatArray:
    """a exp(-t / a) + a wave whose frequency is in b."""
    a, b = points[:, :1], np.log10(points[:, 1:] / 1e-5)
    return a * np.exp(-TIME / a) + 0.3 * np.sin((2.0 + b) * TIME)


def constant(residual: FloatArray) -> Whitening:
    return Whitening(np.full_like(residual, 0.01))


NOISY = decay(TRUTH[None])[0] + 0.01 * np.random.default_rng(4).standard_normal(60)


def reference() -> FloatArray:
    """The optimum by SciPy, in the unit box, from a point near it."""
    found = optimize.least_squares(
        lambda u: (decay(BOX.scale(u)[None])[0] - NOISY) / 0.01,
        BOX.unit(TRUTH),
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
    )
    return BOX.scale(found.x)


def test_every_start_ends_at_the_optimum() -> None:
    batches: list[int] = []

    def run(points: FloatArray) -> FloatArray:
        batches.append(len(points))
        return decay(points)

    starts = [[0.4, 2e-6], [2.8, 9e-4], [1.0, 1e-5]]
    found = least_squares(run, BOX, starts, data=NOISY, weighting=constant)
    best = reference()
    for result in found:
        assert result.converged
        # It stops a tenth of a standard deviation away at most.
        np.testing.assert_array_less(np.abs(result.x - best), 0.1 * result.sigma)
    assert found[0].deviance <= found[-1].deviance
    # One batch a step for all of them, of a point and four neighbours each.
    assert len(batches) == max(result.steps for result in found)
    assert batches[0] == 15
    assert sum(batches) == sum(result.runs for result in found) == 5 * sum(result.steps for result in found)


def test_sigma_is_that_of_the_normal_equations() -> None:
    result = least_squares(decay, BOX, [TRUTH], data=NOISY, weighting=constant)[0]
    h = np.array([1e-6, 1e-10])
    jacobian = np.stack(
        [(decay((result.x + e)[None]) - decay((result.x - e)[None]))[0] / (2.0 * e.sum()) for e in np.diag(h)]
    )
    covariance = np.linalg.inv(jacobian @ jacobian.T / 0.01**2)
    # Differences over a percent of the box are a few percent off.
    np.testing.assert_allclose(result.sigma, np.sqrt(np.diag(covariance)), rtol=0.02)


def test_weights_of_the_residual_give_the_most_likely_point() -> None:
    """With an unknown noise the most likely point minimises n ln(sum of squares)."""

    def unknown(residual: FloatArray) -> Whitening:
        return Whitening(np.full_like(residual, np.sqrt(np.mean(residual**2))))

    result = least_squares(decay, BOX, [[0.5, 3e-6]], data=NOISY, weighting=unknown)[0]
    square = np.sum((decay(result.x[None])[0] - NOISY) ** 2)
    assert result.deviance == pytest.approx(60.0 * (1.0 + np.log(square / 60.0)), abs=1e-9)
    np.testing.assert_array_less(np.abs(result.x - reference()), 0.1 * result.sigma)


def test_an_optimum_beyond_a_face_is_on_the_face() -> None:
    narrow = Box(("a", "b"), (0.1, 1e-6), (1.1, 1e-3), (False, True))
    result = least_squares(decay, narrow, [[0.5, 1e-4]], data=NOISY, weighting=constant)[0]
    assert result.x[0] == 1.1
    assert result.at_bound == ("a",)
    assert result.converged
    along = optimize.minimize_scalar(
        lambda b: float(((decay(np.array([[1.1, 10.0**b]]))[0] - NOISY) ** 2).sum()), bounds=(-5.0, -4.0)
    )
    assert np.log10(result.x[1]) == pytest.approx(
        along.x, abs=0.1 * result.sigma[1] / result.x[1] / np.log(10)
    )


def test_a_direction_that_nothing_sees() -> None:
    box = Box(("a", "blind"), (0.1, 0.0), (3.0, 1.0))
    result = least_squares(
        lambda x: decay(np.column_stack([x[:, 0], np.full(len(x), TRUTH[1])])),
        box,
        [[0.5, 0.3]],
        data=NOISY,
        weighting=constant,
    )[0]
    assert result.converged
    assert result.x[1] == 0.3
    assert result.sigma[1] == np.inf
    assert np.isfinite(result.sigma[0])


def test_failed_runs_shorten_the_step_and_are_told_at_the_start() -> None:
    def fragile(points: FloatArray) -> FloatArray:
        values = decay(points)
        values[points[:, 0] > 1.6] = np.nan
        return values

    result = least_squares(fragile, BOX, [[0.3, 1e-4]], data=NOISY, weighting=constant)[0]
    np.testing.assert_array_less(np.abs(result.x - reference()), 0.1 * result.sigma)
    with pytest.raises(ValueError, match="no search could start"):
        least_squares(fragile, BOX, [[2.0, 1e-4]], data=NOISY, weighting=constant)
    both = least_squares(fragile, BOX, [[0.3, 1e-4], [2.0, 1e-4]], data=NOISY, weighting=constant)
    assert both[1].ended == "the run at the start, or one beside it, failed"
    assert not both[1].converged


def test_two_valleys_are_told_apart() -> None:
    box = Box(("x",), (-2.0,), (2.0,))

    def fold(points: FloatArray) -> FloatArray:
        return np.column_stack([points[:, 0] ** 2, 0.05 * points[:, 0]])

    found = least_squares(
        fold, box, [[-1.5], [1.5]], data=[1.0, 0.05], weighting=lambda r: Whitening(np.full_like(r, 0.01))
    )
    # One valley fits exactly, at 1; the other minimises (x^2 - 1)^2 + (0.05 x - 0.05)^2 near -1.
    other = min(np.roots([4.0, 0.0, -4.0 + 2.0 * 0.0025, -2.0 * 0.0025]).real)
    assert [result.x[0] for result in found] == pytest.approx([1.0, other], abs=1e-3)  # 0.1 of 0.005
    assert found[1].deviance - found[0].deviance == pytest.approx(100.0, rel=0.01)  # (0.1 / 0.01)^2


def test_a_rough_function_is_said_to_be_rough() -> None:
    def rough(points: FloatArray) -> FloatArray:
        return decay(points) + 0.05 * np.sin(1e5 * points[:, :1])

    result = least_squares(rough, BOX, [[0.5, 3e-6]], data=NOISY, weighting=constant)[0]
    assert not result.converged
    assert "rough" in result.ended
    assert abs(result.x[0] - TRUTH[0]) < 0.2  # where its ripple of 0.05 hides the valley


def test_what_is_refused() -> None:
    with pytest.raises(ValueError, match="step must be in"):
        least_squares(decay, BOX, [TRUTH], data=NOISY, weighting=constant, step=0.2)
    with pytest.raises(ValueError, match="start 0: a = 5"):
        least_squares(decay, BOX, [[5.0, 1e-5]], data=NOISY, weighting=constant)
    with pytest.raises(ValueError, match=r"shape \(5, 59\)"):
        least_squares(decay, BOX, [TRUTH], data=NOISY[1:], weighting=constant)
    cut = least_squares(decay, BOX, [[2.9, 9e-4]], data=NOISY, weighting=constant, max_steps=2)[0]
    assert not cut.converged
    assert cut.ended == "the steps were used up"
    assert cut.steps == 2
    assert 0.0 < STEP < 0.1
