"""Halton, maximin, fractional factorial, central composite, Box-Behnken, D-optimal, constraints."""

from itertools import combinations, product

import numpy as np
import pytest

from doe import Box, full_factorial, latin_hypercube
from doe.designs.optimal import d_optimal, keep, monomials
from doe.designs.response_surface import box_behnken, central_composite, fractional_factorial
from doe.designs.space_filling import halton, maximin

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
    with pytest.raises(ValueError, match="tries must be at least 1, got 0"):
        maximin(CUBE, 10, rng=4, tries=0)


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
    inscribed = central_composite(CUBE, shape="inscribed").points
    # alpha = 8^(1/4): the axis points at the faces leave the corners at 1/alpha.
    corner = np.abs(inscribed[np.all(inscribed != 0.0, axis=1)])
    assert len(corner) == 8
    np.testing.assert_allclose(corner, 8.0**-0.25, rtol=1e-12)  # round-off


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


def test_refusals() -> None:
    with pytest.raises(ValueError, match=r"one word a parameter \(3\)"):
        fractional_factorial(CUBE, "a b")
    with pytest.raises(ValueError, match="letters a to z with or without a sign"):
        fractional_factorial(CUBE, "a b a*b")
    with pytest.raises(ValueError, match=r"multiplies \['c'\], which stand for no parameter"):
        fractional_factorial(CUBE, "a b ac")
    with pytest.raises(ValueError, match="stands for one parameter"):
        fractional_factorial(CUBE, "a b -a")
    with pytest.raises(ValueError, match="two parameters or more"):
        central_composite(LINE)
    with pytest.raises(ValueError, match="shape must be one of"):
        central_composite(SQUARE, shape="circumscribed")  # type: ignore[arg-type]
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
