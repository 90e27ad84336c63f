"""Projection of point values on nodes, and the gate for outliers: cases with a known answer."""

import numpy as np
import pytest

from kolsky.bodies.sheet import outliers, point_noise, project

GRID = np.stack(np.meshgrid(np.arange(12.0), np.arange(9.0), indexing="ij"), -1).reshape(-1, 2) * 1e-3


def _quadratic(x: np.ndarray) -> np.ndarray:
    a, b = 1e3 * x.T
    return np.stack([1.0 + 2.0 * a - b + 0.3 * a * a - 0.2 * a * b + 0.1 * b * b, 5.0 * b - 0.7 * a * a], -1)


def test_a_quadratic_is_reproduced() -> None:
    targets = np.array([[0.0041, 0.0033], [0.0002, 0.0079], [0.0118, -0.0004]])
    found = project(GRID, _quadratic(GRID), targets)
    assert found == pytest.approx(_quadratic(targets), rel=1e-9, abs=1e-9)


def test_weights_are_those_of_the_centre() -> None:
    # Of points on a line no quadratic in two coordinates exists: the mean with weights e + (1-e)(1-r/R)^2.
    line = np.stack([np.arange(9.0), np.zeros(9)], -1)
    values = np.arange(9.0)[:, None] ** 2
    weight = 1e-4 + (1.0 - 1e-4) * (1.0 - np.arange(9.0) / 8.0) ** 2
    found = project(line, values, np.zeros((1, 2)))
    assert found[0, 0] == pytest.approx(weight @ values[:, 0] / weight.sum())


def test_the_gate_takes_what_neighbours_do_not_predict_and_nothing_else() -> None:
    rng = np.random.default_rng(5)
    values = _quadratic(GRID) + 0.02 * rng.standard_normal((len(GRID), 2))
    spoilt = values.copy()
    bad = [17, 18, 63]
    spoilt[bad, 1] += [1.0, -0.8, 0.6]
    assert np.flatnonzero(outliers(GRID, spoilt)).tolist() == bad
    assert not outliers(GRID, values).any()


def test_gate_counts_in_standard_deviations() -> None:
    # With noise of 0.02 a point off by 4 sigma stays, one by 12 sigma goes.
    rng = np.random.default_rng(6)
    values = _quadratic(GRID) + 0.02 * rng.standard_normal((len(GRID), 2))
    values[40, 0] = _quadratic(GRID)[40, 0] + 0.08
    values[70, 0] = _quadratic(GRID)[70, 0] + 0.24
    assert np.flatnonzero(outliers(GRID, values)).tolist() == [70]


def test_too_few_points_are_refused() -> None:
    with pytest.raises(ValueError, match="at least 9"):
        project(GRID[:8], np.zeros((8, 1)), GRID[:1])
    with pytest.raises(ValueError, match="finite"):
        project(GRID, np.full((len(GRID), 1), np.nan), GRID[:1])


def test_noise_of_a_smooth_field() -> None:
    fine = np.stack(np.meshgrid(np.arange(40.0), np.arange(40.0), indexing="ij"), -1).reshape(-1, 2) * 1e-3
    noise = 0.02 * np.random.default_rng(7).standard_normal((len(fine), 2))
    # 3200 deviations: the median of their sizes is known to 2 %.
    assert point_noise(fine, _quadratic(fine) + noise) == pytest.approx(0.02, rel=0.06)
    assert point_noise(fine, _quadratic(fine)) < 1e-9
