"""Triangulation, epipolar distances and their sigmas: against OpenCV, SciPy, closed forms and Monte Carlo."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.optimize import least_squares

from dic import Camera, PointOutcome, StereoRig
from dic.stereo import reconstruction as subject
from dic.stereo.geometry import epipolar_curve, epipolar_distance, epipolar_sigma, pixel_slope, triangulate
from dic.stereo.reconstruction import calibration_sigma, calibration_slopes, narrow_gates, reconstruct
from dic.tracking.inputs import Track

LENS = (-0.18, 0.4, 1e-3, -2e-3, -0.3)
NOISE0 = np.array([[4e-4, 1e-4], [1e-4, 2e-4]])
NOISE1 = np.array([[9e-4, -2e-4], [-2e-4, 3e-4]])


def camera(turn: tuple[float, float, float], t: tuple[float, float, float], **changes: float) -> Camera:
    """A camera with the small field of a flyer test, with skew and a strong lens."""
    values = {"fx": 5406.0, "fy": 5380.0, "cx": 254.3, "cy": 258.3, "skew": 0.7, "distortion": LENS}
    rotation = cv2.Rodrigues(np.array(turn))[0]
    return Camera(**(values | changes), rotation=rotation, translation=np.array(t))


RIG = StereoRig(
    (
        camera((0.02, -0.11, 0.01), (0.030, 1e-3, 0.31)),
        camera((0.0, 0.12, -0.02), (-0.034, 2e-3, 0.30), fx=5300.0),
    )
)


def points(n: int, seed: int = 0) -> np.ndarray:
    """Points of a specimen's size around the rig's origin [m]."""
    return np.random.default_rng(seed).uniform(-8e-3, 8e-3, (n, 3))


def opencv(cam: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rotation vector, translation, matrix and distortion for OpenCV, which knows no skew."""
    matrix = cam.matrix.copy()
    matrix[0, 1] = 0.0
    return cv2.Rodrigues(cam.rotation)[0], cam.translation, matrix, np.array(cam.distortion)


def undistorted(pixels: np.ndarray, matrix: np.ndarray, lens: np.ndarray) -> np.ndarray:
    """Ideal points by OpenCV, iterated to its own end: the option has another name from version 5 on."""
    until = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-14)
    with_criteria = getattr(cv2, "undistortPointsIter", cv2.undistortPoints)
    return with_criteria(pixels[:, None], matrix, lens, R=None, P=None, criteria=until)[:, 0]


@pytest.mark.parametrize("skew", [0.0, 0.7])
@pytest.mark.parametrize("kept", [(), (0,), (1,), (4,), (0, 1), (2,), (3,), (0, 2, 3), (0, 1, 2, 3, 4)])
def test_lenses_with_some_coefficients(kept: tuple[int, ...], skew: float) -> None:
    """Brown's formula written out, its slope by differences, and the way back."""
    lens = tuple(value if k in kept else 0.0 for k, value in enumerate(LENS))
    k1, k2, p1, p2, k3 = lens
    cam = camera((0.0, 0.0, 0.0), (0.0, 0.0, 0.3), skew=skew, distortion=lens)
    ideal = np.random.default_rng(3).uniform(-0.2, 0.2, (40, 2))
    x, y = ideal.T
    r2 = x**2 + y**2
    radial = 1.0 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    across = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x**2)
    down = y * radial + p1 * (r2 + 2.0 * y**2) + 2.0 * p2 * x * y
    plane = cam.distort(ideal)
    np.testing.assert_allclose(plane, np.stack([across, down], axis=1), atol=1e-15)
    pixels = cam.to_pixels(plane)
    wanted = np.stack([cam.fx * across + skew * down + cam.cx, cam.fy * down + cam.cy], axis=1)
    np.testing.assert_allclose(pixels, wanted, rtol=1e-14)
    np.testing.assert_allclose(cam.undistort(pixels), ideal, atol=1e-12)
    steps = 1e-6 * np.eye(2)
    by_ideal = [
        (cam.to_pixels(cam.distort(ideal + h)) - cam.to_pixels(cam.distort(ideal - h))) / 2e-6 for h in steps
    ]
    np.testing.assert_allclose(pixel_slope(cam, ideal), np.stack(by_ideal, axis=-1), rtol=1e-7, atol=1e-3)


@pytest.mark.parametrize("k", [0, 1])
def test_projection_and_its_undoing_are_opencv_s(k: int) -> None:
    cam = camera(
        (0.3, -0.2, 0.5), (0.01, -0.02, 0.05), skew=0.0, distortion=LENS if k else (0.1, 0.0, 0.0, 0.0, 0.0)
    )
    X = points(200)  # up to 20 degrees off the axis: the lens moves points by up to a hundred pixels
    turn, t, matrix, lens = opencv(cam)
    expected = cv2.projectPoints(X, turn, t, matrix, lens)[0][:, 0]
    np.testing.assert_allclose(cam.project(X), expected, atol=1e-9)  # round-off of 1e3 px
    ideal = undistorted(expected, matrix, lens)
    np.testing.assert_allclose(cam.undistort(expected), ideal, atol=1e-11)  # undistort's own tolerance 1e-12


@pytest.mark.parametrize("pixel", [2200.0, 5000.0, 1e5, 1e200])
def test_a_lens_that_folds_back_is_told(pixel: float) -> None:
    # r (1 - 0.8 r²) is largest, 0.43, at r = 0.65: nothing is seen beyond 430 px from the middle.
    cam = Camera(1000.0, 1000.0, 0.0, 0.0, distortion=(-0.8, 0.0, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(cam.distort(cam.undistort(np.array([400.0, 0.0]))), [0.4, 0.0], atol=1e-12)
    pixels = np.array([[100.0, 50.0], [np.nan, 10.0], [pixel, 0.0]])
    with pytest.raises(ValueError, match=r"cannot be undone at pixel \["):
        cam.undistort(pixels)
    ideal = cam.undistort(pixels[:2])
    assert np.isfinite(ideal[0]).all()
    assert np.isnan(ideal[1]).all()


def test_points_come_back_exactly() -> None:
    X = points(500)
    found = triangulate(RIG, RIG.cameras[0].project(X), RIG.cameras[1].project(X), NOISE0, NOISE1)
    np.testing.assert_allclose(found.position, X, atol=1e-11)  # undistort to 1e-12 of 0.3 m, over sin(13°)
    np.testing.assert_allclose(found.epipolar, 0.0, atol=1e-7)  # 1e-12 of a focal length of 5e3 px


def test_nearest_point_is_that_of_a_general_optimiser() -> None:
    X = points(5)
    rng = np.random.default_rng(1)
    pixels = [cam.project(X) + rng.normal(0.0, 0.5, (5, 2)) for cam in RIG.cameras]
    found = triangulate(RIG, *pixels, NOISE0, NOISE1).position
    roots = [np.linalg.cholesky(np.linalg.inv(noise)).T for noise in (NOISE0, NOISE1)]
    for i in range(5):

        def residual(x: np.ndarray, i: int = i) -> np.ndarray:
            parts = [
                root @ (cam.project(X[i] + 1e-3 * x) - seen[i])
                for root, cam, seen in zip(roots, RIG.cameras, pixels, strict=True)
            ]
            return np.concatenate(parts)

        best = X[i] + 1e-3 * least_squares(residual, np.zeros(3), xtol=1e-15, ftol=1e-15, gtol=1e-12).x
        np.testing.assert_allclose(found[i], best, atol=1e-9)  # where SciPy stops, 1/1000 of a sigma of 3 µm


def test_noise_spreads_positions_and_epipolar_distances_as_predicted() -> None:
    n, X = 40_000, points(3, seed=4)
    rng = np.random.default_rng(2)
    for x in X:
        seen = [
            rng.multivariate_normal(cam.project(x), noise, n)
            for cam, noise in zip(RIG.cameras, (NOISE0, NOISE1), strict=True)
        ]
        found = triangulate(RIG, *seen, NOISE0, NOISE1)
        predicted = found.covariance[0]
        white = np.linalg.solve(np.linalg.cholesky(predicted), (found.position - x).T)
        # Each entry of the covariance of n unit normals has a sigma of at most sqrt(2/n); 5 of them.
        np.testing.assert_allclose(np.cov(white), np.eye(3), atol=5.0 * np.sqrt(2.0 / n))
        np.testing.assert_allclose(white.mean(axis=1), 0.0, atol=5.0 / np.sqrt(n))
        for sigma in (epipolar_sigma(RIG, seen[0][0], seen[1][0], NOISE0, NOISE1), found.epipolar_sigma[0]):
            assert found.epipolar.std() / sigma == pytest.approx(1.0, abs=5.0 / np.sqrt(2.0 * n))


def test_covariance_follows_each_point_s_own_noise() -> None:
    X = points(2)
    seen = [cam.project(X) for cam in RIG.cameras]
    scale = np.array([1.0, 9.0])[:, None, None]
    each = triangulate(RIG, *seen, scale * NOISE0, scale * NOISE1).covariance
    alone = triangulate(RIG, *seen, NOISE0, NOISE1).covariance
    np.testing.assert_allclose(each, scale * alone, rtol=1e-6)  # linear in the noise, but for EXACT over 2e-4


def test_a_chosen_place_is_exact() -> None:
    """A material point in its own picture has no noise: the position lies on its line of sight."""
    x = points(1, seed=3)[0]
    first, second = RIG.cameras
    seen1 = np.random.default_rng(6).multivariate_normal(second.project(x), NOISE1, 20_000)
    seen0 = np.broadcast_to(first.project(x), seen1.shape)
    found = triangulate(RIG, seen0, seen1, np.zeros((2, 2)), NOISE1)
    assert np.abs(first.project(found.position) - seen0).max() < 1e-4  # EXACT over NOISE1, times its noise
    along = (x - first.centre) / np.linalg.norm(x - first.centre)
    predicted = np.sqrt(along @ found.covariance[0] @ along)
    spread = ((found.position - x) @ along).std()
    assert spread / predicted == pytest.approx(1.0, abs=5.0 / np.sqrt(2.0 * len(seen1)))


def test_epipolar_distance_is_that_to_the_curve_opencv_draws() -> None:
    first, second = (
        camera(turn, t, skew=0.0)
        for turn, t in (((0.0, -0.1, 0.0), (0.03, 0.0, 0.3)), ((0.1, 0.12, 0.2), (-0.034, 2e-3, 0.3)))
    )
    rig = StereoRig((first, second))
    X = points(20)
    seen0 = first.project(X)
    _, _, matrix, lens = opencv(first)
    ideal = undistorted(seen0, matrix, lens)
    offset = np.random.default_rng(3).uniform(-3.0, 3.0, (20, 2))
    seen1 = second.project(X) + offset
    for i in range(20):
        depth = (first.in_camera(X[i])[2] + np.linspace(-2e-3, 2e-3, 40_001))[:, None]
        ray = (np.append(ideal[i], 1.0) * depth - first.translation) @ first.rotation
        turn, t, matrix, lens = opencv(second)
        curve = cv2.projectPoints(ray, turn, t, matrix, lens)[0][:, 0]
        to = seen1[i] - curve
        k = np.argmin(np.hypot(*to.T))
        assert 0 < k < 40_000
        expected = np.sign(to[k, 1]) * np.hypot(*to[k])
        # The curve bends by less than 1e-5 over 3 px; its points lie 1e-3 px apart.
        assert epipolar_distance(rig, seen0[i], seen1[i]) == pytest.approx(expected, abs=1e-4)


def test_sign_is_toward_larger_y_whichever_camera_is_on_the_right() -> None:
    X = points(10)
    seen = [cam.project(X) for cam in RIG.cameras]
    swapped = StereoRig((RIG.cameras[1], RIG.cameras[0]))
    low = np.array([0.0, 1.0])
    for rig, a, b in ((RIG, *seen), (swapped, *reversed(seen))):
        d = epipolar_distance(rig, a, b + low)
        assert np.all((d > 0.98) & (d <= 1.0 + 1e-6))  # lines lean by a few degrees
    over = StereoRig((camera((0.1, 0, 0), (0, 0.03, 0.3)), camera((-0.1, 0, 0), (0, -0.03, 0.3))))
    d = epipolar_distance(over, over.cameras[0].project(X), over.cameras[1].project(X) + low[::-1])
    assert np.all((d > 0.98) & (d <= 1.01))


def test_epipolar_curve_goes_through_the_point() -> None:
    X = points(4)
    depth = np.linalg.norm(X - RIG.cameras[0].centre, axis=-1)
    curve = epipolar_curve(RIG, RIG.cameras[0].project(X), np.array([*depth, -1.0]))
    np.testing.assert_allclose(curve[range(4), range(4)], RIG.cameras[1].project(X), atol=1e-7)  # undistort
    assert np.all(np.isnan(curve[:, -1]))


def test_a_projection_misses_by_half_the_epipolar_distance() -> None:
    X = points(50)
    seen0, seen1 = (cam.project(X) for cam in RIG.cameras)
    seen1 = seen1 + np.array([0.0, 0.2])
    found = triangulate(RIG, seen0, seen1, 1e-4 * np.eye(2), 1e-4 * np.eye(2))
    off = [cam.project(found.position) - seen for cam, seen in zip(RIG.cameras, (seen0, seen1), strict=True)]
    np.testing.assert_allclose(
        np.sqrt(0.5 * np.sum(np.square(off), axis=(0, 2))), np.abs(found.epipolar) / 2.0, rtol=0.03
    )  # unequal scales of the cameras


def test_points_without_a_meeting_are_nan_and_others_are_not_touched() -> None:
    X = points(4)
    seen0, seen1 = (cam.project(X) for cam in RIG.cameras)
    seen0[1] = np.nan
    seen1[2, 0] += 5000.0  # the lines of sight part in front of the cameras
    rig = StereoRig(
        tuple(
            camera(turn, t, distortion=(0.0,) * 5)
            for turn, t in (
                ((0.02, -0.11, 0.01), (0.030, 1e-3, 0.31)),
                ((0.0, 0.12, -0.02), (-0.034, 2e-3, 0.30)),
            )
        )
    )
    found = triangulate(rig, seen0, seen1, NOISE0, NOISE1)
    assert np.isnan(found.position).all(axis=1).tolist() == [False, True, True, False]
    assert np.isnan(found.covariance).all(axis=(1, 2)).tolist() == [False, True, True, False]
    assert np.isnan(found.epipolar).tolist() == [False, True, False, False]
    alone = triangulate(rig, seen0[3], seen1[3], NOISE0, NOISE1)
    np.testing.assert_allclose(found.position[3], alone.position, atol=1e-15)  # round-off of 0.3 m


def test_parallel_lines_of_sight_meet_nowhere() -> None:
    plain = {"fx": 1000.0, "fy": 1000.0, "cx": 0.0, "cy": 0.0}
    rig = StereoRig((Camera(**plain), Camera(**plain, translation=np.array([-0.1, 0.0, 0.0]))))
    found = triangulate(rig, np.zeros((1, 2)), np.zeros((1, 2)), NOISE0, NOISE1)
    assert np.all(np.isnan(found.position))
    with pytest.raises(ValueError, match="same centre"):
        epipolar_distance(StereoRig((rig.cameras[0], rig.cameras[0])), np.zeros(2), np.zeros(2))
    for name, shape in (("distortion", 5), ("rotation", (3, 3)), ("translation", 3)):
        with pytest.raises(ValueError, match=f"{name} must have the shape"):
            Camera(**plain, **{name: np.zeros(2)})
        with pytest.raises(ValueError, match=f"{name} must be finite, got nan"):
            Camera(**plain, **{name: np.full(shape, np.nan)})


@pytest.mark.parametrize(
    ("covariance", "words"),
    [
        (np.array([[1.0, 2.0], [2.0, 1.0]]), "covariance1 of point .*negative eigenvalue"),
        (np.full((2, 2), np.nan), "covariance1 of point"),
        (np.eye(3), r"shape \(3, 3\), must be \(2, 2\)"),
    ],
)
def test_a_covariance_that_is_none_is_refused(covariance: np.ndarray, words: str) -> None:
    seen = [cam.project(points(2)) for cam in RIG.cameras]
    with pytest.raises(ValueError, match=words):
        triangulate(RIG, *seen, NOISE0, covariance)


def test_calibration_moves_points_as_the_closed_form_of_parallel_cameras_says() -> None:
    # x0 = f X/Z, x1 = f (X - b)/Z: Z = f b/(x0 - x1), X = x0 Z/f, and y from both cameras alike.
    f, b = 4000.0, 0.05
    plain = {"fx": f, "fy": f, "cx": 0.0, "cy": 0.0}
    rig = StereoRig((Camera(**plain), Camera(**plain, translation=np.array([-b, 0.0, 0.0]))))
    X = np.array([0.02, 0.0, 0.3])
    S = dict(zip(rig.parameter_names, calibration_slopes(rig, X).T, strict=True))
    disparity = f * b / X[2]
    by_offset = X[2] / disparity  # dZ by a pixel that camera 0's principal point moves
    along = X / X[2]
    near = {"rtol": 1e-6, "atol": 1e-9}  # central differences of steps of 1e-5
    np.testing.assert_allclose(S["tx"], [-X[0] / b, 0.0, -X[2] / b], **near)
    np.testing.assert_allclose(S["cx0"], along * by_offset - [X[2] / f, 0.0, 0.0], **near)
    np.testing.assert_allclose(S["cx1"], -along * by_offset, **near)
    np.testing.assert_allclose(S["ry"], -along * (X[2] ** 2 + (X[0] - b) * X[0]) / b, **near)
    covariance = np.zeros((26, 26))
    covariance[23, 23], covariance[2, 2] = 1e-5**2, 0.1**2
    covariance[23, 2] = covariance[2, 23] = 0.5 * 1e-5 * 0.1
    a, c = S["tx"] * 1e-5, S["cx0"] * 0.1
    known = StereoRig(rig.cameras, covariance)
    np.testing.assert_allclose(calibration_sigma(known, X), np.sqrt(a * a + c * c + a * c), **near)


def test_every_parameter_moves_points_as_recomputed_by_scipy() -> None:
    x = points(1, seed=7)[0]
    seen = [cam.project(x) for cam in RIG.cameras]
    S = calibration_slopes(RIG, x)
    rng = np.random.default_rng(5)
    scale = np.array([*[1.0, 1.0, 0.5, 0.5, 0.1, 0.01, 0.1, 1e-3, 1e-3, 0.1] * 2, *[1e-4] * 3, *[1e-5] * 3])
    for _ in range(3):
        change = 0.1 * scale * rng.normal(size=26)
        first, second = RIG.cameras
        R, t = RIG.relative
        R = cv2.Rodrigues(change[20:23])[0] @ R
        t = t + change[23:]

        def cam(old: Camera, d: np.ndarray, **pose: np.ndarray) -> Camera:
            return Camera(
                old.fx + d[0], old.fy + d[1], old.cx + d[2], old.cy + d[3], old.skew + d[4],
                tuple(np.array(old.distortion) + d[5:]), **pose,
            )  # fmt: skip

        moved = StereoRig(
            (
                cam(first, change[:10], rotation=first.rotation, translation=first.translation),
                cam(
                    second, change[10:20], rotation=R @ first.rotation, translation=t + R @ first.translation
                ),
            )
        )

        def residual(u: np.ndarray, rig: StereoRig = moved) -> np.ndarray:
            return np.concatenate(
                [c.project(x + 1e-3 * u) - p for c, p in zip(rig.cameras, seen, strict=True)]
            )

        shift = 1e-3 * least_squares(residual, np.zeros(3), xtol=1e-15, ftol=1e-15, gtol=1e-14).x
        # Second order: relative changes of 1e-3 at most in the pose and focal lengths.
        np.testing.assert_allclose(S @ change, shift, atol=2e-3 * np.linalg.norm(shift))


def test_sigma_of_a_rig_without_covariance_is_refused() -> None:
    with pytest.raises(ValueError, match="no covariance"):
        calibration_sigma(RIG, points(1))
    with pytest.raises(ValueError, match=r"\(5, 5\), must be \(26, 26\)"):
        calibration_sigma(StereoRig(RIG.cameras, np.eye(5)), points(1))


N_FRAMES, N_POINTS = 4, 6


def tilted(angle: float, side: float) -> Camera:
    """A camera 0.3 m away that looks at the origin, turned about y."""
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    return Camera(5000.0, 5000.0, 64.0, 64.0, rotation=rotation, translation=np.array([side, 0.0, 0.3]))


TRACKED_RIG = StereoRig((tilted(-0.1, 0.0), tilted(0.1, 0.0)))


def followed(camera: Camera, X: np.ndarray, sigma: float = 0.01) -> Track:
    """A perfect track of points X [n_frames, n_points, 3]."""
    pixels = camera.project(X)
    shape = pixels.shape[:2]
    start = np.round(
        TRACKED_RIG.cameras[0].project(X[0])
    )  # both cameras: places in camera 0's material picture
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
    tracks = [followed(camera, X) for camera in TRACKED_RIG.cameras]
    found = reconstruct(TRACKED_RIG, *tracks)
    np.testing.assert_allclose(found.position, X, atol=1e-11)  # undistort to 1e-12 of 0.3 m, over sin(12°)
    assert np.all(found.outcome == PointOutcome.VALID)
    for k, camera in enumerate(TRACKED_RIG.cameras):
        np.testing.assert_allclose(found.pixels[k], camera.project(X), atol=1e-12)  # round-off
    # Depth of two cameras at ±5.7°: sigma Z0/(f √2 sin 5.7°), at the small field's edge to 1 %.
    sigma = np.sqrt(found.covariance[..., 2, 2])
    np.testing.assert_allclose(sigma, 0.01 * 0.3 / 5000.0 / np.sqrt(2.0) / np.sin(0.1), rtol=0.01)


def test_lost_points_keep_the_first_camera_s_outcome(X: np.ndarray) -> None:
    first, second = (followed(camera, X) for camera in TRACKED_RIG.cameras)
    first.outcome[1, 2] = PointOutcome.LOW_CONTRAST
    second.outcome[1, 2:4] = PointOutcome.NOT_CONVERGED
    first.warp[1, 2], first.covariance[1, 2] = np.nan, np.nan
    second.warp[1, 3] = 1e6
    found = reconstruct(TRACKED_RIG, first, second)
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
    first, second = (followed(camera, X) for camera in TRACKED_RIG.cameras)
    second.warp[2, 1, 1] += 0.6
    second.warp[2, 3, 1] += 0.4
    second.warp[3, 4, 0] += 2000.0  # along the line: the rays meet behind the cameras
    found = reconstruct(TRACKED_RIG, first, second)
    assert np.argwhere(found.outcome == PointOutcome.STEREO_MISMATCH).tolist() == [[2, 1], [3, 4]]
    assert np.all(np.isnan(found.position[2, 1]))
    assert found.epipolar[2, 1] == pytest.approx(0.6, abs=0.01)  # kept, for diagnosis; lines lean by < 0.1
    assert found.epipolar[2, 3] == pytest.approx(0.4, abs=0.01)


def test_noise_widens_the_gate(X: np.ndarray) -> None:
    first, second = (followed(camera, X, sigma=0.2) for camera in TRACKED_RIG.cameras)
    second.warp[2, :, 1] += 1.2
    # Its predicted sigma is 0.2 √2 px: 1.2 px is 4.2 of them.
    assert np.all(reconstruct(TRACKED_RIG, first, second).outcome == PointOutcome.VALID)
    narrow = reconstruct(TRACKED_RIG, first, second, gate_sigmas=4.0).outcome
    assert np.all(narrow[2] == PointOutcome.STEREO_MISMATCH)
    assert np.all(np.delete(narrow, 2, axis=0) == PointOutcome.VALID)


def test_tracks_that_do_not_fit_are_refused(X: np.ndarray) -> None:
    first, second = (followed(camera, X) for camera in TRACKED_RIG.cameras)
    with pytest.raises(ValueError, match=r"\(4, 6\) and \(3, 6\)"):
        reconstruct(TRACKED_RIG, first, followed(TRACKED_RIG.cameras[1], X[:3]))
    with pytest.raises(ValueError, match="must be positive, got 0"):
        reconstruct(TRACKED_RIG, first, second, gate=0.0)
    warp = second.warp.copy()
    warp[1, 5] = np.nan
    with pytest.raises(ValueError, match="camera 1, frame 1, point 5 is VALID but"):
        reconstruct(TRACKED_RIG, first, replace(second, warp=warp))
    covariance = second.covariance.copy()
    covariance[1, 5] = np.nan
    with pytest.raises(ValueError, match=r"covariance1 of point .* no negative eigenvalue"):
        reconstruct(TRACKED_RIG, first, replace(second, covariance=covariance))


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
                points=np.zeros((1, 2)), warp=warp, covariance=(own + shared) * np.eye(2)[None, None],
                zncc=np.ones((1, 1)), outcome=np.zeros((1, 1), dtype=np.int64),
                reference=np.zeros((1, 1), dtype=np.int64),
            )
        )  # fmt: skip
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
    tracks = [followed(camera, X) for camera in TRACKED_RIG.cameras]
    rng = np.random.default_rng(4)
    for track in tracks:
        track.warp[..., 1] += rng.normal(0.0, 0.15, track.outcome.shape)
        track.covariance[1] *= 100.0  # a frame whose noise allows more
    tracks[0].outcome[0, 2] = int(PointOutcome.LOW_CORRELATION)
    options = {"gate": 0.12, "gate_sigmas": 3.0}
    expected = reconstruct(TRACKED_RIG, *tracks, **options)
    found = reconstruct(TRACKED_RIG, *tracks, gate=0.5, gate_sigmas=5.0)
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
    first, second = (followed(camera, X) for camera in TRACKED_RIG.cameras)
    first.outcome[1, 2] = PointOutcome.LOW_CONTRAST
    whole = reconstruct(TRACKED_RIG, first, second)
    monkeypatch.setattr(subject, "AT_ONCE", N_POINTS)  # a frame at a time
    monkeypatch.setattr(subject, "cores", lambda: 3)
    parts = reconstruct(TRACKED_RIG, first, second)
    for name in ("position", "covariance", "epipolar", "pixels", "outcome", "epipolar_sigma"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name), err_msg=name)
    second.warp[2, 1] = np.nan  # VALID without a place: refused from any thread
    with pytest.raises(ValueError, match="camera 1, frame 2, point 1"):
        reconstruct(TRACKED_RIG, first, second)
