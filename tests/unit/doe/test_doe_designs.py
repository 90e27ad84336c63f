"""Designs: levels, strata and discrepancy, and the battery that every entry of DESIGNS passes."""

from itertools import combinations, product

import numpy as np
import pytest
from scipy.stats import qmc

from doe import DESIGNS, Box, Design, from_points, full_factorial, latin_hypercube, sobol
from doe.designs import DesignKind
from doe.designs.optimal import d_optimal, keep, monomials
from doe.designs.response_surface import box_behnken, central_composite, fractional_factorial
from doe.designs.space_filling import halton, maximin
from doe.uncertainty import Channel, Likelihood, profile_likelihoods, sample_posterior, verdicts

BOX = Box(("friction", "damping", "poisson"), (0.0, 1e-6, 0.45), (2.0, 1e-4, 0.4999), (False, True, False))


def example(kind: str) -> Design:
    """A design of every kind from the same options."""
    return DESIGNS[kind].make(
        BOX, levels=3, runs=16, rng=1, generators="a b ab", points=[BOX.lower, BOX.upper]
    )


def one_in_the_middle(box: Box, n: int, *, rng: int) -> Design:
    """A made-up kind: a Latin hypercube whose first point is the middle of the box."""
    points = np.array(latin_hypercube(box, n, rng=rng).unit_points)
    points[0] = 0.5
    return Design(box.scale(points), box, "one_in_the_middle", {"n": n, "rng": rng})


def test_a_made_up_design_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    made_up = DesignKind(one_in_the_middle, ("runs", "rng"))
    monkeypatch.setitem(DESIGNS, "one_in_the_middle", made_up)
    test_battery("one_in_the_middle")
    np.testing.assert_allclose(example("one_in_the_middle").unit_points[0], 0.5, rtol=1e-14)


def test_a_kind_is_asked_for_what_it_needs_alone() -> None:
    asked = []
    kind = DesignKind(lambda box, **given: asked.append(given), ("levels", "rng"))  # type: ignore[arg-type,return-value]
    kind.make(BOX, levels=(2, 3, 4), runs=7, rng=5, generators="a b")
    assert asked == [{"levels": (2, 3, 4), "rng": 5}]


@pytest.mark.parametrize("kind", DESIGNS)
def test_battery(kind: str) -> None:
    design, again = example(kind), example(kind)
    assert design.kind == DESIGNS[kind].function.__name__
    assert design.points.shape == (len(design), 3)
    assert BOX.contains(design.points).all()
    assert np.array_equal(design.points, again.points)  # same seed, same bits
    assert len(np.unique(design.points, axis=0)) == len(design)
    with pytest.raises(ValueError, match="read-only"):
        design.points[0, 0] = 1.0


def test_full_factorial_by_hand() -> None:
    box = Box(("f", "beta"), (0.0, 1e-6), (2.0, 1e-4), (False, True))
    design = full_factorial(box, (2, 3))
    # Levels 0, 2 and 1e-6, 1e-5, 1e-4; the last parameter varies fastest.
    expected = [(0, 1e-6), (0, 1e-5), (0, 1e-4), (2, 1e-6), (2, 1e-5), (2, 1e-4)]
    np.testing.assert_allclose(design.points, expected, rtol=1e-14)  # a few ulp of pow
    assert design.settings["levels"] == (2, 3)
    assert len(full_factorial(box, 10)) == 100


@pytest.mark.parametrize("optimise", [False, True])
def test_latin_hypercube_has_one_point_in_every_slice(optimise: bool) -> None:
    n = 17
    slices = np.floor(latin_hypercube(BOX, n, rng=5, optimise=optimise).unit_points * n).astype(int)
    for column in slices.T:
        assert sorted(column) == list(range(n))


def test_optimised_latin_hypercube_is_more_uniform() -> None:
    plain = latin_hypercube(BOX, 16, rng=5).unit_points
    better = latin_hypercube(BOX, 16, rng=5, optimise=True).unit_points
    assert qmc.discrepancy(better) < qmc.discrepancy(plain)


def test_sobol_is_more_uniform_than_random() -> None:
    n, d = 64, BOX.dimension
    rng = np.random.default_rng(0)
    best_random = min(qmc.discrepancy(rng.random((n, d))) for _ in range(20))
    worst_sobol = max(qmc.discrepancy(sobol(BOX, n, rng=seed).unit_points) for seed in range(20))
    # Centred discrepancy falls like n^-1 (log n)^d against n^-1/2: at n = 64 the two do not overlap.
    assert worst_sobol < best_random


def test_sobol_is_balanced_and_its_first_points_are_known() -> None:
    # (t, m, s)-net: each half, quarter, ... of each parameter holds the same number of points.
    cells = np.floor(sobol(BOX, 32, rng=3).unit_points * 32).astype(int)
    for column in cells.T:
        assert sorted(column) == list(range(32))
    box = Box(("x", "y"), (0, 0), (1, 1))
    points = sobol(box, 4, rng=0, scramble=False).points
    # The first four points of the two-dimensional sequence in Gray-code order.
    assert points.tolist() == [[0.0, 0.0], [0.5, 0.5], [0.75, 0.25], [0.25, 0.75]]


def test_settings_reproduce_a_draw_from_a_generator() -> None:
    rng = np.random.default_rng(7)
    first, second = latin_hypercube(BOX, 5, rng=rng), latin_hypercube(BOX, 5, rng=rng)
    assert not np.array_equal(first.points, second.points)
    assert np.array_equal(second.points, latin_hypercube(BOX, **second.settings).points)
    net = sobol(BOX, 8, rng=rng)
    assert np.array_equal(net.points, sobol(BOX, **net.settings).points)
    assert latin_hypercube(BOX, 5, rng=7).settings["rng"] == 7


def test_refusals() -> None:
    with pytest.raises(ValueError, match="levels of 'friction' must be at least 2"):
        full_factorial(BOX, 1)
    with pytest.raises(ValueError, match="levels of 'damping' must be at least 2"):
        full_factorial(BOX, (2, 1, 2))
    with pytest.raises(ValueError, match="one for each of"):
        full_factorial(BOX, (2, 2))
    with pytest.raises(ValueError, match=r"got n = 20: take 32 \(or 16\)"):
        sobol(BOX, 20, rng=0)
    with pytest.raises(ValueError, match="n >= 2 points, got 1"):
        latin_hypercube(BOX, 1, rng=0)
    with pytest.raises(TypeError, match="rng must be an integer seed"):
        sobol(BOX, 8, rng="seven")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"from_points point 0: friction = 3 is outside \[0, 2\]"):
        from_points(BOX, [[3.0, 1e-5, 0.49]])
    with pytest.raises(ValueError, match="at least one point"):
        from_points(BOX, np.empty((0, 3)))
    with pytest.raises(ValueError, match=r"shape \[n, 3\]"):
        from_points(BOX, [1.0, 1e-5, 0.49])


CUBE = Box(("x", "y", "z"), (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))
SQUARE = Box(("x", "y"), (-1.0, -1.0), (1.0, 1.0))
LINE = Box(("x",), (-1.0,), (1.0,))


def test_unscrambled_halton_is_the_radical_inverse() -> None:
    points = halton(Box(("x", "y"), (0.0, 0.0), (1.0, 1.0)), 5, rng=0, scramble=False).points
    expected = [[0, 0], [1 / 2, 1 / 3], [1 / 4, 2 / 3], [3 / 4, 1 / 9], [1 / 8, 4 / 9]]
    np.testing.assert_allclose(points, expected, atol=1e-15)  # round-off


def test_maximin_is_a_latin_hypercube_with_a_larger_gap() -> None:
    def gap(unit: np.ndarray) -> float:
        return min(float(np.linalg.norm(a - b)) for a, b in combinations(unit, 2))

    design = maximin(CUBE, 10, rng=4)
    cells = np.floor(design.unit_points * 10).astype(int)
    assert all(sorted(column) == list(range(10)) for column in cells.T)
    # The largest of 200 is above the largest of 20 others unless all 20 beat it: odds below 1e-3.
    assert gap(design.unit_points) > max(gap(latin_hypercube(CUBE, 10, rng=k).unit_points) for k in range(20))


def test_a_half_fraction_by_hand() -> None:
    points = fractional_factorial(CUBE, "a b ab").points
    assert sorted(map(tuple, points)) == [(-1, -1, 1), (-1, 1, -1), (1, -1, -1), (1, 1, 1)]
    turned = fractional_factorial(CUBE, "a b -ab").points
    assert sorted(map(tuple, turned)) == [(-1, -1, -1), (-1, 1, 1), (1, -1, 1), (1, 1, -1)]
    # The two halves are the whole.
    assert {*map(tuple, points), *map(tuple, turned)} == set(map(tuple, full_factorial(CUBE, 2).points))


def test_central_composite_by_hand() -> None:
    corners, axes = list(product((-1, 1), repeat=2)), [(-1, 0), (1, 0), (0, -1), (0, 1), (0, 0)]
    assert sorted(map(tuple, central_composite(SQUARE).points)) == sorted([*corners, *axes])


def test_box_behnken_by_hand() -> None:
    edges = [p for p in product((-1, 0, 1), repeat=3) if sum(map(abs, p)) == 2]
    assert sorted(map(tuple, box_behnken(CUBE).points)) == sorted([*edges, (0, 0, 0)])


def test_logarithmic_levels_have_equal_ratios() -> None:
    box = Box(("a", "b"), (1e-6, 1.0), (1e-4, 3.0), (True, False))
    levels = np.unique(central_composite(box).points[:, 0].round(12))
    np.testing.assert_allclose(levels, [1e-6, 1e-5, 1e-4], rtol=1e-6)  # rounded to 1e-12


@pytest.mark.parametrize(
    ("degree", "expected"),
    [
        # Roots of (1 - x^2) P'_k(x): P. G. Hoel, Ann. Math. Statist. 29 (1958) 1134.
        (2, [-1.0, 0.0, 1.0]),
        (3, [-1.0, -np.sqrt(1 / 5), np.sqrt(1 / 5), 1.0]),
        (4, [-1.0, -np.sqrt(3 / 7), 0.0, np.sqrt(3 / 7), 1.0]),
    ],
)
def test_optimal_for_a_polynomial_on_a_line(degree: int, expected: list[float]) -> None:
    grid = np.linspace(-1.0, 1.0, 201)[:, None]
    points = d_optimal(LINE, degree + 1, rng=0, degree=degree, candidates=grid).points[:, 0]
    np.testing.assert_allclose(points, expected, atol=0.005 + 1e-12)  # half a step of the grid


def test_optimal_is_the_best_of_all_subsets() -> None:
    candidates = full_factorial(SQUARE, 3).points
    model = monomials(candidates, 2)
    for n in (6, 7, 8):
        best = max(np.linalg.det(model[list(s)].T @ model[list(s)]) for s in combinations(range(9), n))
        found = monomials(d_optimal(SQUARE, n, rng=1, candidates=candidates).points, 2)
        assert np.linalg.det(found.T @ found) == pytest.approx(best, rel=1e-9)  # round-off of a determinant


def test_constraints_leave_out_and_count() -> None:
    design = full_factorial(SQUARE, 3)
    kept = keep(design, lambda points: points.sum(axis=1) <= 0.0)
    assert sorted(map(tuple, kept.points)) == [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 0), (1, -1)]
    assert kept.settings["refused"] == 3
    round_ = keep(design, lambda points: np.hypot(*points.T) <= 1.1, lambda points: points[:, 0] >= 0.0)
    assert sorted(map(tuple, round_.points)) == [(0, -1), (0, 0), (0, 1), (1, 0)]
    inside = d_optimal(SQUARE, 6, rng=1, candidates=kept.points)
    assert sorted(map(tuple, inside.points)) == sorted(map(tuple, kept.points))


def test_refusals_of_other_designs() -> None:
    with pytest.raises(ValueError, match=r"one word a parameter \(3\)"):
        fractional_factorial(CUBE, "a b")
    with pytest.raises(ValueError, match="letters a to z with or without a sign"):
        fractional_factorial(CUBE, "a b a*b")
    with pytest.raises(ValueError, match=r"multiplies \['c'\], which are letters of no parameter"):
        fractional_factorial(CUBE, "a b ac")
    with pytest.raises(ValueError, match="a single letter names one parameter"):
        fractional_factorial(CUBE, "a b -a")
    with pytest.raises(ValueError, match="two parameters or more"):
        central_composite(LINE)
    with pytest.raises(ValueError, match="three parameters or more, got 2"):
        box_behnken(SQUARE)
    with pytest.raises(ValueError, match=r"n must be in \[6, 25\]"):
        d_optimal(SQUARE, 5, rng=0)
    with pytest.raises(ValueError, match="do not fix a polynomial of degree 2"):
        d_optimal(SQUARE, 6, rng=0, candidates=np.stack([np.linspace(-1, 1, 9)] * 2, axis=1))
    with pytest.raises(ValueError, match="4 truth values"):
        keep(full_factorial(SQUARE, 2), lambda points: points)
    with pytest.raises(ValueError, match="no point of the 4 of the full_factorial"):
        keep(full_factorial(SQUARE, 2), lambda points: points[:, 0] <= -2.0)


@pytest.fixture
def linear() -> tuple[Likelihood, np.ndarray]:
    """Two parameters seen linearly by forty data, and the covariance of their optimum."""
    rng = np.random.default_rng(3)
    design = rng.standard_normal((40, 2)) * [30.0, 12.0]
    truth = np.array([0.4, 0.6])
    box = Box.of({"a": (0.0, 1.0), "b": (0.0, 1.0)})
    likelihood = Likelihood(box, lambda x: x @ design.T, design @ truth, [Channel("all", np.ones(40))])
    return likelihood, np.linalg.inv(design.T @ design)


def test_interval_is_longer_by_the_root_of_the_factor(linear: tuple[Likelihood, np.ndarray]) -> None:
    likelihood, covariance = linear
    found = profile_likelihoods(likelihood, [0.5, 0.5], correlation=[4.0, 1.0])
    for profile, factor, variance in zip(found.profiles, (4.0, 1.0), np.diag(covariance), strict=True):
        low, high = profile.interval
        assert low is not None
        assert high is not None
        # Closed form for a linear model; the ends are roots good to 1e-9 of the box.
        assert high - low == pytest.approx(2.0 * np.sqrt(3.841459 * factor * variance), rel=1e-5)
        assert profile.level == pytest.approx(3.841459 * factor, rel=1e-6)
    assert [verdict.kind.value for verdict in verdicts(likelihood, found)] == ["identified"] * 2


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan, [1.0, 0.0]])
def test_a_factor_that_is_no_factor_is_refused(
    linear: tuple[Likelihood, np.ndarray], wrong: float | list[float]
) -> None:
    with pytest.raises(ValueError, match="correlation must be > 0"):
        profile_likelihoods(linear[0], [0.5, 0.5], correlation=wrong)


@pytest.mark.slow
def test_power_of_the_likelihood_widens_the_posterior(linear: tuple[Likelihood, np.ndarray]) -> None:
    pytest.importorskip("emcee")
    likelihood, covariance = linear
    chains = sample_posterior(likelihood, [0.4, 0.6], rng=1, power=0.25)
    # About 40 x 32 independent samples: their standard deviation is known to 2 %.
    np.testing.assert_allclose(chains.samples.std(axis=0), 2.0 * np.sqrt(np.diag(covariance)), rtol=0.08)
    with pytest.raises(ValueError, match="power must be > 0"):
        sample_posterior(likelihood, [0.4, 0.6], rng=1, power=0.0)
