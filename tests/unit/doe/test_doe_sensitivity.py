"""Variance-based indices, elementary effects and information against closed forms and SciPy."""

from itertools import combinations

import numpy as np
import pytest
from scipy import stats
from scipy.stats import sobol_indices as scipy_indices

from doe import Box, information
from doe.information import LinearData, SingularInformationError, best_groups, best_window
from doe.sensitivity import at_saltelli_points, morris, sobol_indices

CIRCLE = Box.of({name: (-np.pi, np.pi) for name in ("x1", "x2", "x3")})
WEIGHTS = np.array([0.0, 1.0, 4.5, 9.0])
UNIT = Box.of({f"u{i}": (0.0, 1.0) for i in range(4)})


def ishigami(x: np.ndarray) -> np.ndarray:
    return (np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0]))[:, None]


def ishigami_exact() -> tuple[np.ndarray, np.ndarray, float]:
    """First and total indices and the variance (Ishigami and Homma 1990), a = 7, b = 0.1."""
    a, b, pi4 = 7.0, 0.1, np.pi**4
    v1, v2, v13 = 0.5 * (1.0 + b * pi4 / 5.0) ** 2, a**2 / 8.0, 8.0 * b**2 * pi4**2 / 225.0
    v = v1 + v2 + v13
    return np.array([v1, v2, 0.0]) / v, np.array([v1 + v13, v2, v13]) / v, v


def g_function(u: np.ndarray) -> np.ndarray:
    return np.prod((np.abs(4.0 * u - 2.0) + WEIGHTS) / (1.0 + WEIGHTS), axis=1)[:, None]


def g_exact() -> tuple[np.ndarray, np.ndarray]:
    """First and total indices of Sobol's g-function."""
    partial = 1.0 / (3.0 * (1.0 + WEIGHTS) ** 2)
    whole = np.prod(1.0 + partial) - 1.0
    others = np.array([np.prod(np.delete(1.0 + partial, i)) for i in range(4)])
    return partial / whole, partial * others / whole


def test_ishigami():
    first, total, variance = ishigami_exact()
    found = sobol_indices(CIRCLE, ishigami, outputs=("y",), n=4096, rng=1)
    # 0.02: the standard error of plain sampling with 4096 points is 0.02 to 0.03, Sobol' points do better.
    np.testing.assert_allclose(found.first[0], first, atol=0.02)
    np.testing.assert_allclose(found.total[0], total, atol=0.02)
    assert found.variance[0] == pytest.approx(variance, rel=0.02)  # likewise
    for exact, interval in ((first, found.first_interval[0]), (total, found.total_interval[0])):
        assert (interval[:, 0] <= exact + 1e-12).all()
        assert (exact - 1e-12 <= interval[:, 1]).all()
        assert (np.diff(interval) < 0.15).all()  # an interval of any width would contain the truth


def test_g_function_with_its_interactions():
    first, total = g_exact()
    found = sobol_indices(UNIT, g_function, outputs=("g",), n=4096, rng=2)
    np.testing.assert_allclose(found.first[0], first, atol=0.01)  # as above
    np.testing.assert_allclose(found.total[0], total, atol=0.01)
    assert found.total[0].sum() > 1.05 * found.first[0].sum()


def test_the_estimators_are_those_of_scipy():
    at_A, at_B, at_AB = at_saltelli_points(ishigami, CIRCLE, 256, 3)
    theirs = scipy_indices(
        func={"f_A": at_A.T, "f_B": at_B.T, "f_AB": at_AB.swapaxes(1, 2)}, n=256, rng=np.random.default_rng(0)
    )
    ours = sobol_indices(CIRCLE, ishigami, outputs=("y",), n=256, rng=3)
    # One formula on the same sample: round-off.
    np.testing.assert_allclose(ours.first[0], theirs.first_order, atol=1e-12)
    np.testing.assert_allclose(ours.total[0], theirs.total_order, atol=1e-12)


def test_the_interval_has_about_the_spread_of_repeated_estimates():
    found = [sobol_indices(CIRCLE, ishigami, outputs=("y",), n=256, rng=seed) for seed in range(24)]
    width = np.mean([np.diff(f.total_interval[0])[:, 0] for f in found], axis=0)
    spread = 2 * 1.96 * np.std([f.total[0] for f in found], axis=0, ddof=1)
    # A bootstrap takes the points for random; a Sobol' sequence is more even, so the interval is wider.
    assert (width > 0.8 * spread).all()  # 24 repetitions know a spread to 15 %
    assert (width < 10.0 * spread).all()


def test_the_same_seed_gives_the_same_bits():
    first, second = (sobol_indices(CIRCLE, ishigami, outputs=("y",), n=64, rng=7) for _ in range(2))
    np.testing.assert_array_equal(first.total_interval, second.total_interval)


def test_what_does_not_vary_is_refused():
    with pytest.raises(ValueError, match="'still' is 3 all over the box"):
        sobol_indices(
            CIRCLE, lambda x: np.column_stack([x[:, 0], 3.0 + 0.0 * x[:, 0]]), outputs=("x", "still"), rng=1
        )
    with pytest.raises(ValueError, match="power of two"):
        sobol_indices(CIRCLE, ishigami, outputs=("y",), n=1000, rng=1)
    with pytest.raises(ValueError, match=r"not finite at \{'x1'"):
        sobol_indices(CIRCLE, lambda x: np.where(x[:, :1] > 0.0, x[:, :1], np.nan), outputs=("y",), rng=1)


def test_elementary_effects_of_a_linear_function_are_its_slopes():
    box = Box.of({"a": (1.0, 3.0), "b": (10.0, 20.0)})
    walks = morris(box, 6, rng=1)
    assert len(walks.design) == 6 * 3
    found = walks.effects(walks.design.points @ np.array([[2.0], [-0.5]]))
    # Per edge of the box: 2 x 2 and -0.5 x 10, exactly, wherever the walk is.
    np.testing.assert_allclose(found.mean, [[4.0, -5.0]], rtol=1e-12)
    np.testing.assert_allclose(found.size, [[4.0, 5.0]], rtol=1e-12)
    np.testing.assert_allclose(found.scatter, 0.0, atol=1e-12)


def test_screening_sees_curvature_interaction_and_what_is_idle():
    def f(u: np.ndarray) -> np.ndarray:
        return (u[:, 0] + 4.0 * (u[:, 1] - 0.5) ** 2 + u[:, 2] * u[:, 0])[:, None]

    walks = morris(UNIT, 400, levels=4, rng=2)
    found = walks.effects(f(walks.design.points))
    # Levels 0, 1/3, 2/3, 1 and steps of 2/3: u0 acts by 1 + u2, mean of u2 1/2; the parabola by +-4/3 with
    # equal chance; u2 by u0, mean 1/2.
    sigma = np.abs(found.effects[..., 0]).std(axis=0, ddof=1) / np.sqrt(400)
    np.testing.assert_array_less(np.abs(found.size[0] - [1.5, 4.0 / 3.0, 0.5, 0.0]), 4.0 * sigma + 1e-12)
    assert abs(found.mean[0, 1]) < 4.0 * found.scatter[0, 1] / 20.0
    assert found.scatter[0, 3] == 0.0
    # The scatter of u0's effect is that of u2 on four levels, sqrt(5) / 6; 400 draws know it to 4 %.
    assert found.scatter[0, 0] == pytest.approx(np.sqrt(5.0) / 6.0, rel=0.12)


def test_every_level_is_visited_equally_and_one_parameter_moves_at_a_time():
    walks = morris(UNIT, 500, levels=4, rng=3)
    levels, counts = np.unique(walks.design.unit_points.round(9), return_counts=True)
    np.testing.assert_allclose(levels, np.arange(4) / 3.0, atol=1e-9)
    assert (
        counts.min() > 0.9 * counts.mean()
    )  # 2500 draws of each parameter's level: 2 % a standard deviation
    steps = np.diff(walks.design.unit_points.reshape(500, 5, 4), axis=1)
    assert ((np.abs(steps) > 1e-9).sum(axis=2) == 1).all()
    assert (np.sort(walks.moved, axis=1) == np.arange(4)).all()


def test_g_function_is_ranked_by_its_weights():
    walks = morris(UNIT, 50, levels=8, rng=4)
    size = walks.effects(g_function(walks.design.points)).size[0]
    assert (np.diff(size) < 0.0).all()


def test_a_run_without_output_stops_the_screening():
    walks = morris(UNIT, 2, rng=1)
    with pytest.raises(ValueError, match="1 of 10 runs have no finite output"):
        walks.effects(np.where(np.arange(10) == 3, np.nan, 1.0)[:, None])
    with pytest.raises(ValueError, match="even"):
        morris(UNIT, 4, levels=5, rng=1)


# Information


def line(x: np.ndarray, sigma: float = 0.5) -> LinearData:
    """Data a + b x."""
    return LinearData(
        ("a", "b"), np.column_stack([np.ones_like(x), x]), np.full(x.size, sigma), np.array([1.0, 10.0])
    )


def test_a_straight_line():
    x = np.linspace(-1.0, 2.0, 13)
    data, mean, square = line(x), x.mean(), ((x - x.mean()) ** 2).sum()
    # Textbook regression with known noise.
    slope = 0.5 / np.sqrt(square)
    offset = 0.5 * np.sqrt(1.0 / 13.0 + mean**2 / square)
    np.testing.assert_allclose(data.deviations, [offset, slope], rtol=1e-12)
    np.testing.assert_allclose(data.conditional_deviations, [0.5 / np.sqrt(13.0), 0.5 / np.linalg.norm(x)])
    assert data.correlation[0, 1] == pytest.approx(-mean / np.sqrt((x**2).mean()), rel=1e-12)
    # The slope is the sum of (x - mean) y over the sum of squares: gain and shares in closed form.
    np.testing.assert_allclose(data.gain[1], (x - mean) / square, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(data.shares[:, 1], (x - mean) ** 2 / square, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(data.shares.sum(axis=0), 1.0)
    np.testing.assert_allclose(data.conditional_shares[:, 0], 1.0 / 13.0)


def test_the_gain_moves_the_least_squares_estimate():
    rng = np.random.default_rng(1)
    data = LinearData(("p", "q"), rng.normal(size=(30, 2)), rng.uniform(0.1, 2.0, 30), np.array([1e-3, 50.0]))
    noise = rng.normal(size=30)
    weighted = data.jacobian / data.sigma[:, None]
    expected = np.linalg.lstsq(weighted, noise / data.sigma, rcond=None)[0]
    np.testing.assert_allclose(data.gain @ noise, expected, rtol=1e-10)


def test_what_is_not_seen_is_said_and_has_no_inverse():
    x = np.ones(5)
    data = line(x)
    with pytest.raises(SingularInformationError):
        _ = data.deviations
    idle = LinearData(("p", "q"), np.column_stack([x, 0.0 * x]), x, np.ones(2))
    assert idle.conditional_deviations[1] == np.inf
    assert (idle.conditional_shares[:, 1] == 0.0).all()


def test_the_best_places_for_a_line_are_its_ends():
    x = np.linspace(-1.0, 1.0, 41)
    rows = np.column_stack([np.ones_like(x), x])
    groups = np.einsum("np,nq->npq", rows, rows)
    found = best_groups(groups, 2)
    assert found.chosen == (0, 40)
    assert found.cost == pytest.approx(-np.log(4.0))  # det = 2 x 2 - 0


def test_the_best_places_for_a_parabola():
    x = np.linspace(-1.0, 1.0, 41)
    rows = np.column_stack([np.ones_like(x), x, x**2])
    groups = np.einsum("np,nq->npq", rows, rows)
    # Three points for three terms: the Fekete points of degree two (Hoel 1958) are -1, 0, 1.
    assert best_groups(groups, 3).chosen == (0, 20, 40)


def test_exchange_finds_what_the_comparison_of_all_finds(monkeypatch: pytest.MonkeyPatch):
    rows = np.random.default_rng(8).normal(size=(16, 3, 3))
    groups = rows.swapaxes(1, 2) @ rows
    exact = best_groups(groups, 4)
    with monkeypatch.context() as patch:
        patch.setattr(information, "ALL", 0)
        assert best_groups(groups, 4).chosen == exact.chosen
    by_hand = min(
        combinations(range(16), 4), key=lambda s: -np.linalg.slogdet(groups[list(s)].sum(axis=0))[1]
    )
    assert best_groups(groups, 4).chosen == by_hand


def test_the_best_window_moves_to_where_the_base_is_blind():
    t = np.linspace(0.0, 1.0, 20)
    rows = np.column_stack([1.0 - t, t**2])
    groups = np.einsum("np,nq->npq", rows, rows)
    knows_first = np.diag([1e4, 0.0])
    # With the first parameter known, the second is seen best at the end.
    assert best_window(groups, 5, base=knows_first).chosen == tuple(range(15, 20))
    costs = [-np.linalg.slogdet(groups[i : i + 5].sum(axis=0))[1] for i in range(16)]
    assert best_window(groups, 5).chosen[0] == int(np.argmin(costs))
    with pytest.raises(ValueError, match="no choice determines all"):
        best_window(groups, 1)
    with pytest.raises(ValueError, match=r"length must be in \[1, 20\]"):
        best_window(groups, 21)


BOX = Box(("a", "b", "c"), (-np.pi,) * 3, (np.pi,) * 3)
N, SEED = 256, 7


def oracles_ishigami(x: np.ndarray) -> np.ndarray:
    """Ishigami and Homma's function, two outputs: one of them in other units."""
    y = np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
    return np.column_stack([y, 1e3 * y + 5.0])


def test_scipys_estimator_on_the_same_points() -> None:
    found = sobol_indices(BOX, oracles_ishigami, outputs=("y", "z"), n=N, rng=SEED)
    at_A, at_B, at_AB = at_saltelli_points(oracles_ishigami, BOX, N, SEED)
    oracle = stats.sobol_indices(func={"f_A": at_A.T, "f_B": at_B.T, "f_AB": np.swapaxes(at_AB, 1, 2)}, n=N)
    # The same sums in another order. SciPy has shape [output, parameter].
    np.testing.assert_allclose(found.first, oracle.first_order, rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(found.total, oracle.total_order, rtol=0.0, atol=1e-10)


def test_salibs_estimator_on_the_same_points() -> None:
    sobol = pytest.importorskip("SALib.analyze.sobol", reason="needs SALib")
    found = sobol_indices(BOX, oracles_ishigami, outputs=("y", "z"), n=N, rng=SEED)
    at_A, at_B, at_AB = at_saltelli_points(oracles_ishigami, BOX, N, SEED)
    # SALib's layout, point by point: A, AB_1 .. AB_d, B.
    Y = np.stack([at_A[:, 0], *at_AB[..., 0], at_B[:, 0]], axis=1).ravel()
    problem = {"num_vars": 3, "names": list("abc"), "bounds": [[-np.pi, np.pi]] * 3}
    oracle = sobol.analyze(problem, Y, calc_second_order=False, num_resamples=10, seed=1)
    # SALib centres by the mean of all evaluations, here by that of A and B: O(1/n) of the first order.
    np.testing.assert_allclose(found.first[0], oracle["S1"], atol=4.0 / N)
    np.testing.assert_allclose(found.total[0], oracle["ST"], atol=4.0 / N)
