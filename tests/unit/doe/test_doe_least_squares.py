"""Least squares in batches: known optima, bounds, failed runs, rough functions, several starts."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import optimize
from scipy.optimize import lsq_linear

from doe import Box, SearchOutcome, nelder_mead
from doe.least_squares import STEP, Whitening, _Search, least_squares
from doe.uncertainty import Channel, Likelihood, VerdictKind, profile_likelihoods, verdicts

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
        lambda u: (decay(BOX.scale(u)[None])[0] - NOISY) / 0.01, BOX.unit(TRUTH), xtol=1e-14, ftol=1e-14,
        gtol=1e-14,
    )  # fmt: skip
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
    assert both[1].ended == "the run at the start, or a neighbouring one, failed"
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


RNG = np.random.default_rng(11)
SIGMA = RNG.uniform(0.5, 3.0, 9)
PATTERNS = RNG.normal(size=(3, 9))
DENSE = np.diag(SIGMA**2) + PATTERNS.T @ PATTERNS
ROWS = RNG.normal(size=(4, 9))


def test_whitened_rows_precision_and_determinant_are_the_dense_ones() -> None:
    white = Whitening(SIGMA, PATTERNS).apply(ROWS)
    expected = np.einsum("ik,kl,il->i", ROWS, np.linalg.inv(DENSE), ROWS)
    np.testing.assert_allclose((white**2).sum(axis=1), expected, rtol=1e-12)  # round-off
    # Not only their lengths: products of two rows too.
    np.testing.assert_allclose(white @ white.T, ROWS @ np.linalg.inv(DENSE) @ ROWS.T, rtol=1e-11)
    one = Whitening(SIGMA, PATTERNS)
    np.testing.assert_allclose(one.precision(ROWS), ROWS @ np.linalg.inv(DENSE), rtol=1e-11)
    assert one.log_determinant == pytest.approx(np.linalg.slogdet(DENSE)[1], rel=1e-13)


def test_patterns_that_depend_on_each_other_and_large_ones() -> None:
    # One pattern as two of 3/5 and 4/5 of it is the same covariance; 1e4 standard deviations project it out.
    twice = np.vstack([0.6 * PATTERNS[:1], 0.8 * PATTERNS[:1], PATTERNS[1:]])
    np.testing.assert_allclose(
        Whitening(SIGMA, twice).apply(ROWS), Whitening(SIGMA, PATTERNS).apply(ROWS), rtol=1e-11
    )
    white = Whitening(SIGMA, 1e4 * PATTERNS)
    np.testing.assert_allclose(
        white.precision(ROWS) @ PATTERNS.T, 0.0, atol=1e-6
    )  # 1e-8 by the covariance, and the round-off of 1e8
    inner = np.eye(3) + 1e8 * (PATTERNS / SIGMA**2) @ PATTERNS.T
    expected = 2.0 * np.log(SIGMA).sum() + np.linalg.slogdet(inner)[1]
    assert white.log_determinant == pytest.approx(expected, rel=1e-12)  # round-off


def test_without_patterns_it_is_division_by_sigma() -> None:
    for one in (Whitening(SIGMA), Whitening(SIGMA, np.zeros((0, 9)))):
        np.testing.assert_array_equal(one.apply(ROWS), ROWS / SIGMA)
        np.testing.assert_allclose(one.precision(ROWS), ROWS / SIGMA**2, rtol=1e-15)
        assert one.log_determinant == pytest.approx(2.0 * np.log(SIGMA).sum(), rel=1e-15)


def test_what_whitening_refuses() -> None:
    with pytest.raises(ValueError, match="every sigma must be > 0, got 0"):
        Whitening(np.array([1.0, 0.0]))
    with pytest.raises(ValueError, match=r"patterns of shape \(1, 3\) do not fit \(2,\) sigmas"):
        Whitening(np.ones(2), np.ones((1, 3)))


SEARCH_BOX = Box(("x", "y"), (-2.0, -1.0), (2.0, 3.0))


def rosenbrock(p: FloatArray) -> float:
    """Minimum 0 at (1, 1) at the end of a bent valley."""
    return float((1.0 - p[0]) ** 2 + 100.0 * (p[1] - p[0] ** 2) ** 2)


@pytest.mark.parametrize("start", [None, (-1.2, 1.0), (2.0, 3.0), (-2.0, -1.0)])
def test_rosenbrock_inside_the_box(start: tuple[float, float] | None) -> None:
    result = nelder_mead(rosenbrock, SEARCH_BOX, start=start, tolerance=1e-7)
    # Tolerance 1e-7 of an edge of 4; the valley's curvatures differ by 2500, so allow 10 of it.
    np.testing.assert_allclose(result.x, [1.0, 1.0], atol=4e-6)
    assert result.outcome is SearchOutcome.CONVERGED
    assert result.outcome.ok
    assert result.at_bound == {}
    assert result.value == rosenbrock(result.x)


def test_rosenbrock_on_a_face() -> None:
    # With x <= 0.5 the constrained minimum is at (0.5, 0.25), value 0.25, on the upper face of x.
    result = nelder_mead(rosenbrock, Box(("x", "y"), (-2.0, -1.0), (0.5, 3.0)), start=(-1.2, 1.0))
    assert result.outcome is SearchOutcome.AT_BOUND
    assert result.at_bound == {"x": "upper"}
    np.testing.assert_allclose(result.x, [0.5, 0.25], atol=4e-5)  # 10 tolerances of 1e-6 times the edge 4
    assert result.value == pytest.approx(0.25, abs=1e-4)  # slope -1 in x along the valley, times 4e-5
    assert "beyond" in result.outcome.cause
    assert "widen" in result.outcome.cure


def test_corner_kink_and_logarithm_are_found() -> None:
    result = nelder_mead(lambda p: float(p[0] - 2.0 * p[1]), SEARCH_BOX)
    assert result.at_bound == {"x": "lower", "y": "upper"}
    np.testing.assert_allclose(result.x, [-2.0, 3.0], atol=4e-5)
    result = nelder_mead(lambda p: float(abs(p[0] - 1.12) + abs(p[1] - 0.3)), SEARCH_BOX)
    np.testing.assert_allclose(result.x, [1.12, 0.3], atol=4e-5)
    box = Box(("damping",), (1e-6,), (1e-2,), (True,))
    result = nelder_mead(lambda p: float(np.log10(p[0] / 2.5e-5) ** 2), box)
    assert result.outcome is SearchOutcome.CONVERGED
    # 10 tolerances of 1e-6 over a range of log(1e4) = 9.2.
    assert result.x[0] == pytest.approx(2.5e-5, rel=1e-4)


@pytest.mark.parametrize("d", [1, 2, 3, 4])
def test_quadratics_with_optima_inside_near_and_on_faces(d: int) -> None:
    # A clipped simplex alone reports optima near a face as on it (one in ten in 1-D); none may be wrong.
    rng = np.random.default_rng(1)
    box = Box(tuple(f"p{j}" for j in range(d)), (0.0,) * d, (1.0,) * d)
    for _ in range(15):
        root = rng.normal(size=(d, d)) + 0.5 * np.eye(d)
        root = np.vstack([root, 0.3 * np.eye(d)])  # curvature of at least 0.09 in every direction
        centre = rng.choice([rng.uniform(-0.3, 1.3), 1e-3, 0.02], size=d)
        exact = lsq_linear(root, root @ centre, bounds=(0.0, 1.0), method="bvls", tol=1e-14).x
        result = nelder_mead(lambda p, a=root, c=centre: float(np.sum((a @ (p - c)) ** 2)), box)
        # Within the 10 tolerances of 1e-6 that an agreeing restart allows.
        np.testing.assert_allclose(result.x, exact, atol=1e-5)
        on_face = {
            n: "lower" if u == 0 else "upper" for n, u in zip(box.names, exact, strict=True) if u in (0, 1)
        }
        assert result.at_bound == on_face
        assert result.outcome is (SearchOutcome.AT_BOUND if on_face else SearchOutcome.CONVERGED)


def test_the_best_call_is_returned() -> None:
    calls: list[FloatArray] = []

    def counted(p: FloatArray) -> float:
        calls.append(p.copy())
        value = rosenbrock(p)
        p[:] = 99.0  # a careless function must not disturb the search
        return value

    result = nelder_mead(counted, SEARCH_BOX, start=(-1.2, 1.0))
    assert result.evaluations == len(calls)
    np.testing.assert_allclose(calls[0], [-1.2, 1.0], rtol=1e-14)  # round trip through the unit box
    assert SEARCH_BOX.contains(np.array(calls)).all()
    assert result.value == min(rosenbrock(p) for p in calls)


@pytest.mark.parametrize("limit", [3, 10, 57])
def test_running_out_of_evaluations_is_said(limit: int) -> None:
    result = nelder_mead(rosenbrock, SEARCH_BOX, start=(-1.2, 1.0), max_evaluations=limit)
    assert result.outcome is SearchOutcome.NOT_CONVERGED
    assert not result.outcome.ok
    assert result.evaluations <= limit
    assert "max_evaluations" in result.outcome.cause
    assert result.value == rosenbrock(result.x)


def test_not_a_number_is_refused_with_the_point() -> None:
    def broken(p: FloatArray) -> float:
        return float("nan") if p[0] > 0.5 else rosenbrock(p)

    with pytest.raises(ValueError, match=r"the function is nan at x = .*, y = .*; it must be finite"):
        nelder_mead(broken, SEARCH_BOX)


def test_refusals() -> None:
    with pytest.raises(ValueError, match=r"start 0: x = 3 is outside \[-2, 2\]"):
        nelder_mead(rosenbrock, SEARCH_BOX, start=(3.0, 0.0))
    with pytest.raises(ValueError, match="start must be one point"):
        nelder_mead(rosenbrock, SEARCH_BOX, start=[[0.0, 0.0], [1.0, 1.0]])
    with pytest.raises(ValueError, match=r"tolerance must be in \[1e-9, 0.1\)"):
        nelder_mead(rosenbrock, SEARCH_BOX, tolerance=0.0)
    with pytest.raises(ValueError, match="max_evaluations must be at least 3"):
        nelder_mead(rosenbrock, SEARCH_BOX, max_evaluations=2)


def of_inflation(inflation: float) -> Likelihood:
    """Two parameters whose interval is so many times longer than alone: 1 over the sine of their angle."""
    angle = np.arcsin(1.0 / inflation)
    A = np.array([[1.0, np.cos(angle)], [0.0, np.sin(angle)]])

    def model(p: FloatArray) -> FloatArray:
        return p @ A.T

    box = Box(("x", "y"), (-2.0, -2.0), (2.0, 2.0))
    return Likelihood(box, model, np.zeros(2), [Channel("all", np.full(2, 0.1))])


@pytest.mark.parametrize(("inflation", "leans"), [(2.9, False), (3.1, True)])
def test_an_interval_three_times_longer_than_alone_rests_on_the_others(inflation: float, leans: bool) -> None:
    likelihood = of_inflation(inflation)
    x, _ = verdicts(likelihood, profile_likelihoods(likelihood, (0.1, 0.1)))
    assert x.kind is VerdictKind.IDENTIFIED
    assert x.inflation == pytest.approx(inflation, rel=1e-4)  # the ends' tolerance
    assert ("times longer" in x.text) is leans
    assert [p.name for p in x.partners] == (["y"] if leans else [])


@pytest.mark.parametrize(("other", "given_up"), [(9.9, False), (10.1, True)])
def test_a_search_is_given_up_at_ten_times_its_predicted_decrease(other: float, given_up: bool) -> None:
    """One search is at 1 + 16 with a predicted decrease of 1. The other one is at 17 - other."""
    level = np.sqrt(17.0 - other)

    def two(points: FloatArray) -> FloatArray:
        x = points[:, 0]
        near = np.stack([0.5 * (x - 10.0), np.full_like(x, 4.0)], axis=1)
        return np.where((x < 50.0)[:, None], near, np.stack([0.0 * x, np.full_like(x, level)], axis=1))

    found = least_squares(
        two, Box(("x",), (0.0,), (100.0,)), [[12.0], [60.0]], data=[0.0, 0.0],
        weighting=lambda residual: Whitening(np.ones_like(residual)), give_up=10.0,
    )  # fmt: skip
    left = next(each for each in found if each.x[0] < 50.0)
    assert (left.steps == 1) is given_up
    assert left.converged is not given_up
    assert (left.ended == "another search is better than this one can become") is given_up


def test_a_short_step_uses_broydens_slopes_until_it_is_rejected() -> None:
    """A response A u, then two values off this plane: the first one is accepted, the second one is not."""
    box = Box(("x", "y"), (0.0, 0.0), (1.0, 1.0))
    A, B = np.array([[3.0, 1.0], [0.5, 2.0]]), np.array([[1.0, -2.0], [0.0, 4.0]])
    search = _Search(
        box, np.array([0.6, 0.7]), np.zeros(2), lambda residual: Whitening(np.ones_like(residual)), STEP,
        1e-9, np.inf,
    )  # fmt: skip
    assert len(search.batch()) == 5
    search.take(search.batch() @ A.T)
    np.testing.assert_allclose(search.slope, A, rtol=1e-9)
    before, trial, found = search.u, search.trial, 0.5 * search.response
    assert len(search.batch()) == 1
    search.take(found[None])
    # Broyden's update: right along the step, unchanged across it.
    step, across = trial - before, np.array([[0.0, -1.0], [1.0, 0.0]]) @ (trial - before)
    np.testing.assert_allclose(search.slope @ step, found - A @ before, rtol=1e-9)
    np.testing.assert_allclose(search.slope @ across, A @ across, rtol=1e-9)
    updated = search.slope
    assert len(search.batch()) == 1
    search.take(10.0 * found[None])
    np.testing.assert_array_equal(search.slope, updated)
    assert len(search.batch()) == 5
    search.take(10.0 * found + (search.batch() - search.trial) @ B.T)
    np.testing.assert_allclose(search.slope, B, rtol=1e-9)
    np.testing.assert_array_equal(search.u, trial)
    # The slopes from runs stay when a further trial point is rejected.
    search.take(10.0 * found + (search.batch() - search.trial) @ A.T)
    np.testing.assert_allclose(search.slope, B, rtol=1e-9)


def test_short_steps_without_neighbours_find_the_same_optimum_with_fewer_runs() -> None:
    every, few = (
        least_squares(decay, BOX, [[1.2, 3e-5]], data=NOISY, weighting=constant, short=short, at_rest=1e-3)[0]
        for short in (0.0, np.inf)
    )
    assert every.converged
    assert few.converged
    np.testing.assert_allclose(few.x, reference(), rtol=1e-4)  # a step of 1e-3 standard deviations
    assert few.runs < 0.5 * every.runs


@pytest.mark.parametrize(("name", "value"), [("give_up", 0.0), ("give_up", np.nan), ("short", -1.0)])
def test_limits_of_a_search_are_refused_with_their_range(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be >=? 0 .*, got {value}"):
        least_squares(decay, BOX, [TRUTH], data=NOISY, weighting=constant, **{name: value})
