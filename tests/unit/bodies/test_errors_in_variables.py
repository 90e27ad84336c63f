"""The fit with errors in force and displacement: closed forms of a linear spring, and planted constants."""

import numpy as np
import pytest

from kolsky.bodies.errors_in_variables import (
    Linearised,
    Samples,
    best_displacement,
    chi_square,
    reduce,
    search,
)

INFINITE = (np.array([0.0]), np.array([np.inf]))


def _spring(stiffness: np.ndarray, x: np.ndarray) -> Linearised:
    """f = p x, one end."""
    p = float(stiffness[0])
    return Linearised(p * x, x[..., None], np.full((*x.shape, 1), p))


def _samples(x: object, force: object, sd: float, sf: float) -> Samples:
    return Samples(np.array(x, dtype=float)[:, None], np.array(force, dtype=float)[:, None], sd, sf)


def test_objective_adds_both_errors() -> None:
    samples = _samples([1.0, 2.0], [3.0, 5.0], 0.1, 0.5)
    x = np.array([[1.1], [1.8]])
    assert chi_square(samples, x, np.array([[3.5], [4.0]])) == pytest.approx(1.0 + 4.0 + 1.0 + 4.0)
    exact = _samples([1.0, 2.0], [3.0, 5.0], 0.0, 0.5)
    assert chi_square(exact, exact.displacement, np.array([[3.5], [4.0]])) == pytest.approx(5.0)


def test_eliminated_displacement_of_a_spring() -> None:
    # Minimum of ((x - d)/sd)^2 + ((p x - F)/sf)^2 at one sample: x = (d/sd^2 + p F/sf^2) / (1/sd^2 +
    # p^2/sf^2), and what is left is (p d - F)^2 / (sf^2 + p^2 sd^2).
    p, d, F, sd, sf = 2.0, 1.0, 3.0, 0.3, 0.4
    samples = _samples([d], [F], sd, sf)
    start = np.array([[1.4]])  # wherever it is linearised
    there = _spring(np.array([p]), start)
    found = best_displacement(samples, start, there, np.zeros(1))
    expected = (d / sd**2 + p * F / sf**2) / (1.0 / sd**2 + p**2 / sf**2)
    assert found[0, 0] == pytest.approx(expected)
    left = reduce(samples, start, there).residual
    assert float(left @ left) == pytest.approx((p * d - F) ** 2 / (sf**2 + p**2 * sd**2))


def test_two_ends_are_coupled_through_the_stiffness() -> None:
    K = np.array([[3.0, 1.0], [1.0, 2.0]])
    sd, sf = 0.2, 0.5
    samples = Samples(np.zeros((1, 2)), np.array([[1.0, -1.0]]), sd, sf)
    there = Linearised(np.zeros((1, 2)), np.zeros((1, 2, 1)), K[None])
    left = reduce(samples, np.zeros((1, 2)), there).residual
    V = sf**2 * np.eye(2) + sd**2 * K @ K.T
    r = np.array([-1.0, 1.0])
    assert float(left @ left) == pytest.approx(r @ np.linalg.solve(V, r))
    moved = best_displacement(samples, np.zeros((1, 2)), there, np.zeros(1))[0]
    assert moved == pytest.approx(-(sd**2) * K.T @ np.linalg.solve(V, r))


def test_search_ends_at_the_line_with_errors_in_both() -> None:
    # Deming's slope with lambda = (sf / sd)^2 for a line through the origin.
    rng = np.random.default_rng(3)
    x = np.linspace(1.0, 6.0, 12)
    sd, sf = 0.2, 0.3
    d, F = x + sd * rng.standard_normal(12), 2.0 * x + sf * rng.standard_normal(12)
    ratio = (sf / sd) ** 2
    sxx, syy, sxy = d @ d, F @ F, d @ F
    slope = (syy - ratio * sxx + np.sqrt((syy - ratio * sxx) ** 2 + 4.0 * ratio * sxy**2)) / (2.0 * sxy)
    found = search(
        lambda p, at: (_spring(p, at[0]),),
        (_samples(d, F, sd, sf),),
        np.array([0.7]),
        bounds=INFINITE,
        scales=np.array([1.0]),
    )
    assert found.converged
    assert found.constants[0] == pytest.approx(slope, rel=1e-3 * 0.01)


def test_a_bound_holds_and_is_said() -> None:
    samples = (_samples([1.0, 2.0, 3.0], [2.0, 4.0, 6.0], 0.0, 0.1),)
    bounds = (np.array([0.0]), np.array([1.5]))
    found = search(
        lambda p, at: (_spring(p, at[0]),), samples, np.array([1.0]), bounds=bounds, scales=np.array([1.0])
    )
    assert found.constants[0] == 1.5
    assert found.at_bound == (True,)


def test_a_failed_simulation_shortens_the_step() -> None:
    tried = []

    def respond(p: np.ndarray, at: tuple[np.ndarray, ...]) -> tuple[Linearised, ...] | str:
        tried.append(float(p[0]))
        return "it folded" if 1.5 < p[0] < 1.9 and len(tried) < 4 else (_spring(p, at[0]),)

    samples = (_samples([1.0, 2.0, 3.0], [1.7, 3.4, 5.1], 0.0, 0.1),)
    found = search(respond, samples, np.array([1.0]), bounds=INFINITE, scales=np.array([1.0]))
    assert found.constants[0] == pytest.approx(1.7, rel=1e-4)
    assert found.simulations == len(tried) > 2
    with pytest.raises(ValueError, match="start failed: no way"):
        search(lambda p, at: "no way", samples, np.array([1.0]), bounds=INFINITE, scales=np.array([1.0]))
