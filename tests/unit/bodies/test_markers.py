"""Markers: pictures with planted places, closed forms of distance and interval, a planted stiffness."""

import cv2
import numpy as np
import pytest

from kolsky.bodies.actuator_camera import (
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
from kolsky.bodies.actuator_markers import (
    MarkerComparison,
    fit_stiffness,
    interval,
    marker_positions,
    marker_weights,
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
    stiff = small.solid.with_parameters(1.2 * small.solid.parameters())
    weights = marker_weights(small)
    for name, g in gravities.items():
        places = marker_positions(small.simulate(g, pressures, solid=stiff), weights)
        noisy = places + sigma * rng.standard_normal(places.shape)
        measured[name] = dict(zip(pressures.tolist(), noisy, strict=True))
    found = fit_stiffness(small, gravities, measured, sigma)
    assert found.converged
    assert found.explained
    assert found.low < 1.2 < found.high
    assert found.high - found.low < 0.1
