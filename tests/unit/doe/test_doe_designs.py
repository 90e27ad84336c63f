"""Designs: levels, strata and discrepancy, and the battery that every entry of DESIGNS passes."""

import numpy as np
import pytest
from scipy.stats import qmc

from doe import DESIGNS, Box, Design, from_points, full_factorial, latin_hypercube, sobol
from doe.designs import DesignKind, design_kind

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
    made_up = DesignKind(one_in_the_middle, "middle", ("runs", "rng"), "one point in the middle")
    monkeypatch.setitem(DESIGNS, "one_in_the_middle", made_up)
    test_battery("one_in_the_middle")
    assert design_kind("middle") is made_up
    np.testing.assert_allclose(example("one_in_the_middle").unit_points[0], 0.5, rtol=1e-14)


def test_a_kind_is_asked_for_what_it_needs_alone() -> None:
    asked = []
    kind = DesignKind(lambda box, **given: asked.append(given), "x", ("levels", "rng"), "")  # type: ignore[arg-type,return-value]
    kind.make(BOX, levels=(2, 3, 4), runs=7, rng=5, generators="a b")
    assert asked == [{"levels": (2, 3, 4), "rng": 5}]


def test_names_at_the_command_line_are_different_and_an_unknown_one_lists_them() -> None:
    options = [kind.option for kind in DESIGNS.values()]
    assert len(set(options)) == len(options)
    with pytest.raises(ValueError, match=r"'grid'; choose from factorial, lhs, .*, csv"):
        design_kind("grid")


@pytest.mark.parametrize("kind", DESIGNS)
def test_battery(kind: str) -> None:
    design, again = example(kind), example(kind)
    assert design.kind == kind
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


def test_sobol_is_balanced() -> None:
    # (t, m, s)-net: each half, quarter, ... of each parameter holds the same number of points.
    cells = np.floor(sobol(BOX, 32, rng=3).unit_points * 32).astype(int)
    for column in cells.T:
        assert sorted(column) == list(range(32))


def test_unscrambled_sobol_by_hand() -> None:
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
