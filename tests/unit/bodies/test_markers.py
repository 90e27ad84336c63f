"""Markers: pictures with known positions, closed forms of distance and interval, a known stiffness."""

import cv2
import numpy as np
import pytest

from kolsky.bodies.actuator_markers import (
    MarkerComparison,
    fit_stiffness,
    interval,
    marker_positions,
    marker_weights,
)
from kolsky.bodies.sheet import outliers, point_noise, project
from runs.actuator.camera import (
    NoMarkersError,
    PlaneCamera,
    board_corners,
    calibrate,
    chain,
    draw_board,
    draw_markers,
    find_corners,
    find_markers,
)
from tests.unit.bodies.small import DOWN, actuator

SIZE = (900, 700)
TRUE = PlaneCamera(
    np.array([[1400.0, 0.0, 455.0], [0.0, 1395.0, 345.0], [0.0, 0.0, 1.0]]),
    np.array([-0.12, 0.05, 0.0005, -0.0003, 0.0]),
    np.array([np.pi + 0.03, -0.02, 0.01]),
    np.array([-0.035, -0.02, 0.16]),
)
ARC = np.array([[0.05 * np.sin(a), -0.05 * (1.0 - np.cos(a))] for a in 1.2 * np.arange(1, 10) / 9])


def test_a_pixel_and_its_place_are_each_other() -> None:
    assert TRUE.in_plane(TRUE.project(ARC)) == pytest.approx(ARC, abs=1e-10)


def test_centroids_of_made_pictures() -> None:
    rng = np.random.default_rng(3)
    picture = draw_markers(TRUE, ARC, diameter=1.8e-3, size=SIZE, noise=3.0, rng=rng)
    found = find_markers(picture, 9, TRUE.project(np.zeros((1, 2)))[0])
    assert not found.split
    # a pixel is 0.11 mm; the centroid of a disc of 16 px is good to a few hundredths of one
    assert np.abs(TRUE.in_plane(found.pixels) - ARC).max() < 12e-6


def test_touching_markers_are_told_apart() -> None:
    close = ARC[:3] * 0.0 + np.array([[0.02, -0.01], [0.0216, -0.01], [0.0232, -0.01]])
    picture = draw_markers(TRUE, close, diameter=1.8e-3, size=SIZE)
    found = find_markers(picture, 3, TRUE.project(np.zeros((1, 2)))[0])
    assert found.split
    assert np.abs(TRUE.in_plane(found.pixels) - close).max() < 0.15e-3


def test_pictures_without_the_markers_are_refused() -> None:
    empty = draw_markers(TRUE, ARC[:0], diameter=2e-3, size=SIZE)
    with pytest.raises(NoMarkersError, match="no blue part"):
        find_markers(empty, 9, np.zeros(2))
    many = draw_markers(TRUE, ARC, diameter=2e-3, size=SIZE)
    with pytest.raises(NoMarkersError, match="9 blue parts are seen, 5"):
        find_markers(many, 5, np.zeros(2))


def test_chain_follows_neighbours() -> None:
    shuffled = ARC[[3, 0, 8, 1, 5, 2, 7, 4, 6]]
    assert chain(shuffled, np.zeros(2)) == pytest.approx(ARC)


def test_zhangs_calibration_of_made_boards() -> None:
    rng = np.random.default_rng(5)
    square, views = 6e-3, []
    for k in range(8):
        held = TRUE.rotation + np.array([0.35 * np.sin(k), 0.35 * np.cos(1.7 * k), 0.1 * k])
        R, _ = cv2.Rodrigues(held)
        middle = R @ np.append(board_corners(square).mean(axis=0), 0.0)
        place = np.array([0.004 * np.cos(k), 0.004 * np.sin(k), 0.15 + 0.01 * (k % 3)]) - middle
        board = PlaneCamera(TRUE.matrix, TRUE.distortion, held, place)
        views.append(find_corners(draw_board(board, square, size=SIZE, noise=2.0, rng=rng)))
    first = (0.008, -0.004)
    corners = find_corners(draw_board(TRUE, square, first=first, size=SIZE, noise=2.0, rng=rng))
    expected = TRUE.project(np.asarray(first) + board_corners(square))
    # drawn on fine pixels of 1/4 px whose polygons have their boundary's pixels, half of one more on each
    # side: 1/8 px at most, and some hundredths of the detector
    assert np.abs(corners - expected).max() < 0.16
    found = calibrate(views, corners, square, SIZE, first=first)
    assert found.error < 0.1
    inside = np.array([[0.01, -0.005], [0.03, -0.02], [0.045, -0.03]])
    assert np.abs(found.in_plane(TRUE.project(inside)) - inside).max() < 15e-6  # 0.14 px of 0.11 mm


def test_rmse_is_that_of_the_distances() -> None:
    there = np.zeros((4, 2))
    away = np.array([[3e-3, 4e-3], [0, 0], [0, 0], [0, 0]])  # one distance of 5 mm among four: 5 / sqrt 4
    one = MarkerComparison("down", 1e4, away, there, 1e-3)
    assert one.rmse == pytest.approx(2.5e-3)
    # chi-square 25 of 8 degrees: its 99.9 % quantile is 26.12
    assert one.explained
    assert not MarkerComparison("down", 1e4, 1.05 * away, there, 1e-3).explained


def test_interval_of_a_line() -> None:
    J, left = np.array([1.0, 2.0, 2.0]), np.array([2e-3, -2e-3, 1e-3])  # |J| = 3, |left| = 3e-3, J . left = 0
    found = interval(left, J, 3e-3, 1.0, converged=True)
    assert found.sigma == pytest.approx(1e-3)  # chi2 = 1 of 2 degrees: not widened
    assert found.high - found.factor == pytest.approx(4.302652729911275e-3)  # Student's t of 2 degrees
    wide = interval(left, J, 1e-3, 1.0, converged=True)  # chi2 = 9 of 2 degrees: widened by sqrt 4.5
    assert wide.sigma == pytest.approx(1e-3 / 3.0 * np.sqrt(4.5))


def test_planted_stiffness_comes_back_within_its_interval() -> None:
    small = actuator()
    rng = np.random.default_rng(11)
    pressures, sigma = np.array([15e3, 30e3]), 10e-6
    measured: dict[str, dict[float, np.ndarray]] = {}
    gravities = {"downward": DOWN, "upward": (0.0, 0.0, 9.81)}
    weights = marker_weights(small.mesh.points[small.mesh.nodes("line"), 0])
    for name, g in gravities.items():
        places = marker_positions(small.simulate(g, pressures, constants=small.constants(1.2)), weights)
        noisy = places + sigma * rng.standard_normal(places.shape)
        measured[name] = dict(zip(pressures.tolist(), noisy, strict=True))
    found = fit_stiffness(small, gravities, measured, sigma)
    assert found.converged
    assert found.explained
    assert found.low < 1.2 < found.high
    assert found.high - found.low < 0.1


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
