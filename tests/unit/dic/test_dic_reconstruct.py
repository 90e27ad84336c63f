"""Two tracks to positions: what becomes of points that a camera lost or that do not meet."""

from dataclasses import replace

import numpy as np
import pytest

from dic import Camera, PointOutcome, StereoRig
from dic.stereo import reconstruction as subject
from dic.stereo.reconstruction import narrow_gates, reconstruct
from dic.tracking.inputs import Track

N_FRAMES, N_POINTS = 4, 6


def tilted(angle: float, side: float) -> Camera:
    """A camera 0.3 m away that looks at the origin, turned about y."""
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return Camera(5000.0, 5000.0, 64.0, 64.0, rotation=rotation, translation=np.array([side, 0.0, 0.3]))


RIG = StereoRig((tilted(-0.1, 0.0), tilted(0.1, 0.0)))


def followed(camera: Camera, X: np.ndarray, sigma: float = 0.01) -> Track:
    """A perfect track of points X [n_frames, n_points, 3]."""
    pixels = camera.project(X)
    shape = pixels.shape[:2]
    start = np.round(RIG.cameras[0].project(X[0]))  # both cameras: places in camera 0's material picture
    warp = np.zeros((*shape, 12))
    warp[..., :2] = pixels - start
    return Track(
        points=start,
        warp=warp,
        covariance=np.broadcast_to(sigma**2 * np.eye(2), (*shape, 2, 2)).copy(),
        zncc=np.ones(shape),
        outcome=np.zeros(shape, dtype=np.int64),
        reference=np.zeros(shape, dtype=np.int64),
    )


@pytest.fixture
def X() -> np.ndarray:
    """Six points that move upward and toward the cameras [m], shape [4, 6, 3]."""
    start = np.random.default_rng(0).uniform(-1e-3, 1e-3, (N_POINTS, 3))
    return start + np.arange(N_FRAMES)[:, None, None] * np.array([0.0, -2e-4, 1e-4])


def test_points_of_two_tracks_come_back(X: np.ndarray) -> None:
    tracks = [followed(camera, X) for camera in RIG.cameras]
    found = reconstruct(RIG, *tracks)
    np.testing.assert_allclose(found.position, X, atol=1e-11)  # undistort to 1e-12 of 0.3 m, over sin(12°)
    assert np.all(found.outcome == PointOutcome.VALID)
    for k, camera in enumerate(RIG.cameras):
        np.testing.assert_allclose(found.pixels[k], camera.project(X), atol=1e-12)  # round-off
    # Depth of two cameras at ±5.7°: sigma Z0/(f √2 sin 5.7°), at the small field's edge to 1 %.
    sigma = np.sqrt(found.covariance[..., 2, 2])
    np.testing.assert_allclose(sigma, 0.01 * 0.3 / 5000.0 / np.sqrt(2.0) / np.sin(0.1), rtol=0.01)


def test_lost_points_keep_the_first_camera_s_outcome(X: np.ndarray) -> None:
    first, second = (followed(camera, X) for camera in RIG.cameras)
    first.outcome[1, 2] = PointOutcome.LOW_CONTRAST
    second.outcome[1, 2:4] = PointOutcome.NOT_CONVERGED
    first.warp[1, 2], first.covariance[1, 2] = np.nan, np.nan
    second.warp[1, 3] = 1e6
    found = reconstruct(RIG, first, second)
    expected = np.zeros((N_FRAMES, N_POINTS), dtype=int)
    expected[1, 2], expected[1, 3] = PointOutcome.LOW_CONTRAST, PointOutcome.NOT_CONVERGED
    np.testing.assert_array_equal(found.outcome, expected)
    lost = expected != PointOutcome.VALID
    np.testing.assert_array_equal(np.isnan(found.position).any(axis=-1), lost)
    np.testing.assert_array_equal(np.isnan(found.covariance).any(axis=(-2, -1)), lost)
    np.testing.assert_array_equal(np.isnan(found.epipolar), lost)
    np.testing.assert_array_equal(np.isnan(found.pixels[1]).any(axis=-1), second.outcome != 0)
    np.testing.assert_allclose(found.position[~lost], X[~lost], atol=1e-11)


def test_rays_that_do_not_meet_are_a_mismatch(X: np.ndarray) -> None:
    first, second = (followed(camera, X) for camera in RIG.cameras)
    second.warp[2, 1, 1] += 0.6
    second.warp[2, 3, 1] += 0.4
    second.warp[3, 4, 0] += 2000.0  # along the line: the rays meet behind the cameras
    found = reconstruct(RIG, first, second)
    assert np.argwhere(found.outcome == PointOutcome.STEREO_MISMATCH).tolist() == [[2, 1], [3, 4]]
    assert np.all(np.isnan(found.position[2, 1]))
    assert found.epipolar[2, 1] == pytest.approx(0.6, abs=0.01)  # kept, for diagnosis; lines lean by < 0.1
    assert found.epipolar[2, 3] == pytest.approx(0.4, abs=0.01)


def test_noise_widens_the_gate(X: np.ndarray) -> None:
    first, second = (followed(camera, X, sigma=0.2) for camera in RIG.cameras)
    second.warp[2, :, 1] += 1.2
    # Its predicted sigma is 0.2 √2 px: 1.2 px is 4.2 of them.
    assert np.all(reconstruct(RIG, first, second).outcome == PointOutcome.VALID)
    narrow = reconstruct(RIG, first, second, gate_sigmas=4.0).outcome
    assert np.all(narrow[2] == PointOutcome.STEREO_MISMATCH)
    assert np.all(np.delete(narrow, 2, axis=0) == PointOutcome.VALID)


def test_tracks_that_do_not_fit_are_refused(X: np.ndarray) -> None:
    first, second = (followed(camera, X) for camera in RIG.cameras)
    with pytest.raises(ValueError, match=r"\(4, 6\) and \(3, 6\)"):
        reconstruct(RIG, first, followed(RIG.cameras[1], X[:3]))
    with pytest.raises(ValueError, match="must be positive, got 0"):
        reconstruct(RIG, first, second, gate=0.0)
    warp = second.warp.copy()
    warp[1, 5] = np.nan
    with pytest.raises(ValueError, match="camera 1, frame 1, point 5 is VALID but"):
        reconstruct(RIG, first, replace(second, warp=warp))
    covariance = second.covariance.copy()
    covariance[1, 5] = np.nan
    with pytest.raises(ValueError, match=r"covariance1 of point .* no negative eigenvalue"):
        reconstruct(RIG, first, replace(second, covariance=covariance))


def test_a_place_that_both_tracks_share_moves_along_the_surface() -> None:
    """Closed form: cameras side by side at distance Z; what is common to both pixels is no depth."""
    half, distance, focal = 0.05, 0.3, 5000.0
    cameras = tuple(
        Camera(fx=focal, fy=focal, cx=0.0, cy=0.0, translation=np.array([-x, 0.0, distance]))
        for x in (-half, half)
    )
    rig = StereoRig((cameras[0], cameras[1]))
    X = np.zeros((1, 1, 3))
    own, shared = 1e-4, 4e-4  # px²
    tracks = []
    for camera in cameras:
        warp = np.zeros((1, 1, 12))
        warp[0, 0, :2] = camera.project(X)[0, 0]
        tracks.append(
            Track(
                points=np.zeros((1, 2)),
                warp=warp,
                covariance=(own + shared) * np.eye(2)[None, None],
                zncc=np.ones((1, 1)),
                outcome=np.zeros((1, 1), dtype=np.int64),
                reference=np.zeros((1, 1), dtype=np.int64),
            )
        )
    common = shared * np.eye(2)[None, None]
    found = reconstruct(rig, *tracks, common=common).covariance[0, 0]
    apart = reconstruct(rig, *tracks).covariance[0, 0]
    px = distance / focal  # metres per pixel at the surface
    # depth = Z²/(2 b f) x disparity: the variance of a disparity is twice that of a pixel
    depth = (distance**2 / (2.0 * half * focal)) ** 2 * 2.0
    assert found[2, 2] == pytest.approx(depth * own, rel=1e-3)
    assert apart[2, 2] == pytest.approx(depth * (own + shared), rel=1e-3)
    # x and y: the mean of the two pixels' own noise, and all of what they share
    for k in (0, 1):
        assert found[k, k] == pytest.approx(px**2 * (own / 2.0 + shared), rel=1e-2)


def test_narrower_gates_end_what_a_reconstruction_with_them_ends(X: np.ndarray) -> None:
    tracks = [followed(camera, X) for camera in RIG.cameras]
    rng = np.random.default_rng(4)
    for track in tracks:
        track.warp[..., 1] += rng.normal(0.0, 0.15, track.outcome.shape)
        track.covariance[1] *= 100.0  # a frame whose noise allows more
    tracks[0].outcome[0, 2] = int(PointOutcome.LOW_CORRELATION)
    options = {"gate": 0.12, "gate_sigmas": 3.0}
    expected = reconstruct(RIG, *tracks, **options)
    found = reconstruct(RIG, *tracks, gate=0.5, gate_sigmas=5.0)
    before = np.sum(found.outcome == PointOutcome.VALID)
    narrow_gates(found, **options)
    for name in ("position", "covariance", "epipolar", "epipolar_sigma", "outcome"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)
    after = [np.sum(frame == PointOutcome.VALID) for frame in found.outcome]
    assert 0 < sum(after) < before
    assert after[1] == N_POINTS  # 3 sigma of 0.1 px, over both cameras, are more than any distance
    with pytest.raises(ValueError, match="not known"):
        narrow_gates(replace(found, epipolar_sigma=None), **options)


def test_frames_shared_out_over_threads_are_those_of_one(X: np.ndarray, monkeypatch: pytest.MonkeyPatch):
    first, second = (followed(camera, X) for camera in RIG.cameras)
    first.outcome[1, 2] = PointOutcome.LOW_CONTRAST
    whole = reconstruct(RIG, first, second)
    monkeypatch.setattr(subject, "AT_ONCE", N_POINTS)  # a frame at a time
    monkeypatch.setattr(subject, "cores", lambda: 3)
    parts = reconstruct(RIG, first, second)
    for name in ("position", "covariance", "epipolar", "pixels", "outcome", "epipolar_sigma"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name), err_msg=name)
    second.warp[2, 1] = np.nan  # VALID without a place: refused from any thread
    with pytest.raises(ValueError, match="camera 1, frame 2, point 1"):
        reconstruct(RIG, first, second)
