"""The averaging surrogate: exact for quadratics, roughness that of the noise, leave-one-out a refit."""

import numpy as np
import pytest

from doe import Box, latin_hypercube, sobol
from doe.surrogates import QuadraticSurrogate, SurrogateError
from doe.surrogates.quadratic import runs_wanted, terms

BOX = Box(("m", "f", "beta"), (0.9, 0.1, 1e-6), (1.3, 0.5, 1e-4), (False, False, True))


def quadratic(points: np.ndarray) -> np.ndarray:
    """Two entries, quadratic in the unit coordinates."""
    u = BOX.unit(points)
    first = 3.0 + u[:, 0] - 2.0 * u[:, 1] * u[:, 2] + u[:, 2] ** 2
    return np.stack([first, 1e-3 * (u[:, 0] * u[:, 1] - u[:, 1])], axis=1)


def test_a_quadratic_is_found_exactly() -> None:
    points = sobol(BOX, 16, rng=0).points
    surrogate = QuadraticSurrogate.fit(BOX, points, quadratic(points))
    other = sobol(BOX, 32, rng=1).points
    # Round-off of a well-conditioned solve.
    np.testing.assert_allclose(surrogate.predict(other), quadratic(other), rtol=1e-11, atol=1e-14)
    assert surrogate.degrees_of_freedom == 6
    assert (terms(3), runs_wanted(3)) == (10, 25)


def test_roughness_is_the_scatter_of_single_runs() -> None:
    gain = np.array([[0.5, 0.0], [1.0, 2000.0]])
    noise = np.array([0.2, 3e-4])
    expected = gain @ np.diag(noise**2) @ gain.T
    found = []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        points = latin_hypercube(BOX, 25, rng=rng).points
        values = quadratic(points) + noise * rng.standard_normal((25, 2))
        found.append(QuadraticSurrogate.fit(BOX, points, values).roughness(gain))
    # Each has 15 degrees of freedom: a variance of 200 of them scatters by sqrt(2 / 3000) = 2.6 %; 4 sigma.
    np.testing.assert_allclose(np.mean(found, axis=0), expected, rtol=0.11)


def test_averaging_flattens_what_an_interpolant_follows() -> None:
    rng = np.random.default_rng(3)
    points = latin_hypercube(BOX, 40, rng=rng).points
    values = quadratic(points) + 0.1 * rng.standard_normal((40, 2))
    surrogate = QuadraticSurrogate.fit(BOX, points, values)
    error = surrogate.predict(points)[:, 0] - quadratic(points)[:, 0]
    # Ten terms of forty runs keep a quarter of the variance, an interpolant all of it; 3 sigma of chi^2(10).
    assert 0.1**2 * 10 / 40 * 0.1 < np.mean(error**2) < 0.1**2 * 10 / 40 * 2.4


def test_leave_one_out_is_the_refit() -> None:
    rng = np.random.default_rng(1)
    points = latin_hypercube(BOX, 18, rng=rng).points
    values = quadratic(points) + 0.1 * rng.standard_normal((18, 2))
    surrogate = QuadraticSurrogate.fit(BOX, points, values)
    for left in (0, 7):
        rest = np.arange(18) != left
        other = QuadraticSurrogate.fit(BOX, points[rest], values[rest])
        missed = values[left] - other.predict(points[left : left + 1])[0]
        np.testing.assert_allclose(surrogate.loo_residuals[left], missed, rtol=1e-9)


def test_what_does_not_determine_it_is_refused() -> None:
    points = sobol(BOX, 32, rng=0).points.copy()
    with pytest.raises(
        SurrogateError, match=r"has 10 terms and takes at least 11 runs, better 25; there are 8"
    ):
        QuadraticSurrogate.fit(BOX, points[:8], quadratic(points[:8]))
    points[:, 1] = 0.3
    with pytest.raises(SurrogateError, match=r"the 32 runs do not determine a quadratic of 3 variables"):
        QuadraticSurrogate.fit(BOX, points, quadratic(points))


def test_roughness_of_four_runs_by_hand() -> None:
    # A parabola through four evenly spaced values leaves their third difference, (-1, 3, -3, 1) / sqrt(20).
    box = Box(("m",), (0.0,), (3.0,))
    contrast = np.array([-1.0, 3.0, -3.0, 1.0]) / np.sqrt(20.0)
    values = (2.0 + np.arange(4.0) ** 2 + 0.6 * contrast)[:, None]
    surrogate = QuadraticSurrogate.fit(box, np.arange(4.0)[:, None], values)
    assert surrogate.degrees_of_freedom == 1
    np.testing.assert_allclose(surrogate.residuals[:, 0], 0.6 * contrast, atol=1e-12)  # round-off
    # The whole of 0.6^2 over one degree of freedom, through a gain of 2.
    np.testing.assert_allclose(surrogate.roughness(np.array([[2.0]])), [[4.0 * 0.36]], rtol=1e-9)
