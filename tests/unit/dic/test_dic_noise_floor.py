"""Noise floors in closed form: displacements whose variances can be counted on the fingers."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_dic import synthetic_result

from dic import SurfaceHistory
from dic.surfaces.surface_history import noise_floor


def at_rest(u: np.ndarray, sigma: float = 2e-6) -> SurfaceHistory:
    """Points that seem to move by u [n_frames, n_points] in every direction, twice and three times as much
    along y and Z."""
    n_frames, n_points = u.shape
    return SurfaceHistory(
        t=np.arange(n_frames) * 1e-3,
        X=np.zeros((n_points, 3)),
        u=u[..., None] * np.array([1.0, 2.0, 3.0]),
        sigma=np.full((n_frames, n_points, 3), sigma),
        outcome=np.zeros((n_frames, n_points), dtype=np.int64),
    )


def test_points_that_move_alike_are_motion_of_the_cameras():
    u = 1e-6 * np.array([-1.0, 0.0, 1.0])[:, None] * np.ones(5)
    found = noise_floor(at_rest(u), np.ones(3, dtype=bool))
    # (1 + 0 + 1) / (3 - 1) = 1; nothing is left between the points.
    np.testing.assert_allclose(found.time, [1e-6, 2e-6, 3e-6], rtol=1e-12)
    np.testing.assert_allclose(found.common, [1e-6, 2e-6, 3e-6], rtol=1e-12)
    np.testing.assert_allclose(found.space, 0.0, atol=1e-18)
    np.testing.assert_allclose(found.ratio, [0.5, 1.0, 1.5], rtol=1e-12)
    assert (found.n_frames, found.n_points) == (3, 5)


def test_points_that_move_against_each_other_are_noise_in_space():
    u = 1e-6 * np.array([[1.0, -1.0], [-1.0, 1.0], [0.0, 0.0]])
    found = noise_floor(at_rest(u), np.ones(3, dtype=bool))
    np.testing.assert_allclose(found.time[0], 1e-6, rtol=1e-12)  # (1 + 1 + 0) / 2 of either point
    np.testing.assert_allclose(found.common[0], 0.0, atol=1e-18)
    # Squares 4e-12, by 3/2 for the mean through the frames, over 3 frames of 2 - 1 points each.
    np.testing.assert_allclose(found.space[0], np.sqrt(4.0 * 1.5 / 3.0) * 1e-6, rtol=1e-12)


def test_lost_points_and_moving_frames_do_not_count():
    u = 1e-6 * np.array([[-1.0, 50.0], [0.0, 70.0], [1.0, 90.0], [1e3, 1e3]])
    surface = at_rest(u)
    outcome = surface.outcome.copy()
    outcome[1, 1] = 1
    found = noise_floor(replace(surface, outcome=outcome), np.array([True, True, True, False]))
    np.testing.assert_allclose(found.time[0], 1e-6, rtol=1e-12)
    assert (found.n_frames, found.n_points) == (3, 1)
    with pytest.raises(ValueError, match="needs 3 static frames with points, got 2"):
        noise_floor(surface, np.array([True, True, False, False]))


def test_strain_noise_is_that_of_points_with_a_strain_in_every_static_frame():
    result = synthetic_result()
    value = np.zeros_like(result.strain.value)
    rest = np.flatnonzero(result.static)
    ramp = np.zeros(len(rest))
    ramp[:2] = 1e-3 * np.array([1.0, -1.0])
    value[rest] = ramp[:, None, None] * np.array([1.0, 2.0, 3.0])
    value[rest[0], 3] = np.nan  # left out, whatever it says elsewhere
    value[rest[1], 3] = 1.0
    found = replace(result, strain=replace(result.strain, value=value)).strain_noise
    expected = 1e-3 * np.sqrt(2.0 / (len(rest) - 1))
    np.testing.assert_allclose(found, expected * np.array([1.0, 2.0, 3.0]), rtol=1e-12)
