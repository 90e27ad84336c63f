"""Refinement of the relative pose from matched points, on made rigs whose error is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_dic_cylinder import patch, rig

from dic.calibration.refine import LEAST_GAIN, Refinement, baseline_normals, prior_root, refine, turn_rig

NOISE = 0.02


def seen(cameras, seed=0, n=300, noise=NOISE):
    rng = np.random.default_rng(seed)
    X = patch(rng, 50.0, n)
    return (
        X,
        [camera.project(X) + noise * rng.standard_normal((n, 2)) for camera in cameras.cameras],
        np.full(n, noise * np.sqrt(2.0)),
    )


def turned(cameras, x):
    """Independent of the code: camera 1 turned by SciPy, its baseline rotated about axes across it."""
    R, t = cameras.relative
    R = Rotation.from_rotvec(x[:3]).as_matrix() @ R
    first, second = cameras.cameras
    assert np.allclose(first.rotation @ first.rotation.T, np.eye(3))
    direction = t / np.linalg.norm(t) + baseline_normals(t) @ x[3:]
    t = np.linalg.norm(t) * direction / np.linalg.norm(direction)
    return replace(
        cameras,
        cameras=(first, replace(second, rotation=R @ first.rotation, translation=t + R @ first.translation)),
    )


def test_a_pose_moves_by_its_turns_and_tilts_and_keeps_its_length():
    x = np.array([1e-3, -2e-3, 3e-3, 4e-3, -5e-3])
    cameras = rig()
    (R, t), (Q, s) = turn_rig(cameras, x).relative, turned(cameras, x).relative
    np.testing.assert_allclose(R, Q, atol=1e-12)
    np.testing.assert_allclose(t, s, atol=1e-15)
    assert np.linalg.norm(t) == pytest.approx(np.linalg.norm(cameras.relative[1]), rel=1e-12)
    base = cameras.relative[1]
    np.testing.assert_allclose(baseline_normals(base).T @ base, 0.0, atol=1e-15)
    np.testing.assert_allclose(baseline_normals(base).T @ baseline_normals(base), np.eye(2), atol=1e-12)


def test_a_camera_that_was_knocked_is_put_back_as_far_as_the_rays_tell():
    true = rig()
    _, pixels, sigma = seen(true)
    wrong = turned(true, np.array([4e-4, 1e-4, -3e-4, 2e-4, 0.0]))
    found = refine(wrong, *pixels, sigma)
    assert found.before > 0.5
    # |normal deviate| has the median 0.6745 of its sigma; 300 points tell it to 7 %
    assert found.after == pytest.approx(0.6745 * sigma[0], rel=0.2)
    assert found.held_out_after == pytest.approx(0.6745 * sigma[0], rel=0.2)
    assert found.helps
    assert found.n_points == 300


def test_right_cameras_are_left_alone():
    """Made sets of points of the true rig: the rule must not be moved by their noise."""
    for seed in range(6):
        _, pixels, sigma = seen(rig(), seed)
        assert not refine(rig(), *pixels, sigma).helps


def test_false_matches_pull_little():
    true = rig()
    _, pixels, sigma = seen(true)
    wrong = turned(true, np.array([4e-4, 0.0, 0.0, 0.0, 0.0]))
    pixels[1][:15] += np.random.default_rng(1).uniform(-4.0, 4.0, (15, 2))
    found = refine(wrong, *pixels, sigma)
    assert found.after < 1.4 * 0.6745 * sigma[0]


def test_the_rule_wants_a_fifth_on_points_that_were_left_out():
    zero = np.zeros(3)
    made = Refinement(rig(), zero, zero[:2], np.eye(5), 1.0, 0.1, 1.0, 1.0 - LEAST_GAIN, 100)
    assert made.helps
    assert not replace(made, held_out_after=1.0 - LEAST_GAIN + 1e-6).helps
    assert LEAST_GAIN == 0.2
    assert made.words["epipolar_median_after_px"] == 0.1


def test_the_prior_is_the_calibrations_covariance_of_turns_and_tilts():
    cameras = rig()
    rng = np.random.default_rng(2)
    A = rng.standard_normal((26, 26)) * 1e-4
    with_covariance = replace(cameras, covariance=A @ A.T)
    t = cameras.relative[1]
    J = np.zeros((5, 6))
    J[:3, :3], J[3:, 3:] = np.eye(3), baseline_normals(t).T / np.linalg.norm(t)
    root = prior_root(with_covariance, 3e-4)
    C = J @ (A @ A.T)[-6:, -6:] @ J.T + 9e-8 * np.eye(5)
    np.testing.assert_allclose(root.T @ root, np.linalg.inv(C), rtol=1e-6)
    np.testing.assert_allclose(prior_root(cameras, 2e-3), np.eye(5) / 2e-3)


def test_what_the_points_do_not_tell_stays_as_small_as_the_fault():
    """Over a small specimen some turns and tilts are hardly seen; with noise alone they would run away."""
    true = rig()
    for seed in range(3):
        _, pixels, sigma = seen(true, seed)
        found = refine(turned(true, np.array([2e-4, 0.0, 0.0, 0.0, 0.0])), *pixels, sigma)
        fault = found.before / 0.6745 / 5400.0  # the turn that the distances amount to [rad]
        assert np.linalg.norm([*found.turn, *found.tilt]) < 3.0 * fault
        assert np.all(np.sqrt(np.diag(found.covariance)) < 1.01 * fault)


@pytest.mark.parametrize("n", [39, 5])
def test_too_few_points_are_refused(n):
    _, pixels, sigma = seen(rig())
    with pytest.raises(ValueError, match="needs 40 pairs"):
        refine(rig(), pixels[0][:n], pixels[1][:n], sigma[:n])
    with pytest.raises(ValueError, match="positive"):
        refine(rig(), *pixels, 0.0 * sigma)


def test_points_left_out_take_no_part():
    """Every second point moved by 3 px: fitted to the others, a pose says so; fitted to themselves, less."""
    _, pixels, sigma = seen(rig())
    pixels[1][::2, 1] += 3.0
    found = refine(rig(), *pixels, sigma)
    # each half fits its own points; the other half is then 3 px off
    assert found.held_out_after == pytest.approx(3.0, rel=0.1)
