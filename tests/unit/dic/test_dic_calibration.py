"""Calibration from synthetic views, projected by OpenCV: parameters, covariance, bad pairs, checks."""

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_dic_cylinder import RIG, patch

import dic.calibration.views
from dic import Camera
from dic.calibration import bundle
from dic.calibration.refine import (
    LEAST_GAIN,
    Refinement,
    baseline_normals,
    find_order,
    prior_root,
    refine,
    turn_rig,
)
from dic.calibration.solve import calibrate
from dic.calibration.targets import Chessboard, Detection, DottedCylinder, FiducialDots, TargetNotFound
from dic.calibration.views import Calibration, PairOutcome
from kolsky.base.errors import InputError
from kolsky.pictures import calibration
from kolsky.pictures.calibration import read_calibration_toml

SIZE = ((512, 512), (512, 512))
BOARD = FiducialDots(
    columns=9, rows=7, pitch=2e-3, diameter=0.8e-3, hollow=((1, 1), (6, 1), (1, 4)), hole=0.3e-3
)
CHESS = Chessboard(columns=9, rows=7, pitch=2e-3)
LENS = np.array([-0.18, 0.0, 0.0, 0.0, 0.0])
MATRICES = (
    np.array([[5400.0, 0.0, 254.3], [0.0, 5390.0, 258.3], [0.0, 0.0, 1.0]]),
    np.array([[5380.0, 0.0, 257.1], [0.0, 5385.0, 252.6], [0.0, 0.0, 1.0]]),
)
TURN, SHIFT = np.array([0.01, 0.22, -0.003]), np.array([-0.066, 0.0004, 0.0074])


def true_poses(n: int, seed: int = 4) -> list[tuple[np.ndarray, np.ndarray]]:
    """Boards tilted and spread over the field, in camera 0's frame."""
    rng = np.random.default_rng(seed)
    poses = []
    for _ in range(n):
        R = cv2.Rodrigues(rng.uniform([-0.5, -0.5, -0.6], [0.5, 0.5, 0.6]))[0]
        middle = np.array([*rng.uniform(-2.5e-3, 2.5e-3, 2), 0.3 + rng.uniform(-8e-3, 8e-3)])
        poses.append((R, middle - R @ [8e-3, 6e-3, 0.0]))
    return poses


def sightings(
    poses, *, noise: float = 0.02, seed: int = 7, target=CHESS, lens=LENS, points=None
) -> list[list[Detection]]:
    """What both cameras see of a board whose points are where they should be, or at `points`."""
    rng = np.random.default_rng(seed)
    X = target.geometry().points if points is None else points
    R01 = cv2.Rodrigues(TURN)[0]
    views: list[list[Detection]] = [[], []]
    for R, t in poses:
        for k, (turn, shift) in enumerate(((R, t), (R01 @ R, R01 @ t + SHIFT))):
            p = cv2.projectPoints(X, cv2.Rodrigues(turn)[0], shift, MATRICES[k], lens)[0][:, 0]
            p = p + noise * rng.standard_normal(p.shape)
            views[k].append(Detection(np.arange(len(X)), p, np.full(len(X), noise or 0.01)))
    return views


def parameters(found: Calibration) -> np.ndarray:
    """Found less true parameters of the rig."""
    true = []
    for K in MATRICES:
        true += [K[0, 0], K[1, 1], K[0, 2], K[1, 2], 0.0, *LENS]
    values = []
    for c in found.rig.cameras:
        values += [c.fx, c.fy, c.cx, c.cy, c.skew, *c.distortion]
    R, t = found.rig.relative
    turn = cv2.Rodrigues(R @ cv2.Rodrigues(TURN)[0].T)[0].ravel()
    return np.array([*np.subtract(values, true), *turn, *(t - SHIFT)])


def true_rig() -> tuple[Camera, Camera]:
    """The cameras the sightings are of."""
    first, second = (
        Camera(fx=K[0, 0], fy=K[1, 1], cx=K[0, 2], cy=K[1, 2], distortion=tuple(LENS)) for K in MATRICES
    )
    return first, replace(second, rotation=cv2.Rodrigues(TURN)[0], translation=SHIFT)


def excess(found: Calibration, target=CHESS) -> float:
    """Chi-square of the true cameras: how much they raise the sum of squares above the minimum.

    Weakly known principal points turn with the pose along a curve that the covariance sees straight, so
    differences of parameters over their covariance will not do; this is the same test without that flaw.
    """
    g = target.geometry()
    sights = []
    for k, pair in enumerate(found.pairs):
        for c, v in enumerate(pair.views):
            if pair.outcome.used and v is not None:
                ids, n = v.ids[v.used], int(v.used.sum())
                sights.append(
                    bundle.View(k, c, ids, g.points[ids], g.normals[ids], g.spread[ids], g.bend[ids],
                          v.pixels[v.used], np.full(n, v.sigma[0]))
                )  # fmt: skip
    poses = {k: (p.rotation, p.translation) for k, p in enumerate(found.pairs) if p.rotation is not None}
    truth = bundle.adjust(bundle.Rig(true_rig(), poses), sights, np.zeros((bundle.SHARED_PARAMETERS, 0)))
    return (truth.chi2 - found.unit**2 * found.freedom) / found.unit**2


def test_sightings_without_noise_give_the_cameras():
    found = calibrate(*sightings(true_poses(8), noise=0.0), CHESS, sensors=SIZE, distortion="k1")
    off = parameters(found)
    # converged until the sum of squares falls by less than 1e-10 of itself; OpenCV's numbers are float64
    assert np.abs(off[:4]).max() < 1e-4
    assert np.abs(off[-6:]).max() < 1e-8
    assert found.rms < 1e-8
    assert found.checks.distance_ratio == pytest.approx(1.0, abs=1e-9)


def test_cameras_alone_are_those_of_a_calibration_that_is_checked():
    views = sightings(true_poses(8))
    whole = calibrate(*views, CHESS, sensors=SIZE, distortion="k1")
    alone = calibrate(*views, CHESS, sensors=SIZE, distortion="k1", predict=False)
    np.testing.assert_array_equal(parameters(alone), parameters(whole))
    np.testing.assert_array_equal(alone.rig.covariance, whole.rig.covariance)
    assert alone.rms == whole.rms
    assert np.isfinite([whole.checks.held_out_rms, whole.checks.distance_ratio]).all()
    assert np.isnan([alone.checks.held_out_rms, alone.checks.distance_ratio, alone.checks.distance_rms]).all()


def test_the_minimum_is_opencvs():
    """Same data, same parameters, its `stereoCalibrate`: the minimum of the same sum of squares."""
    views = sightings(true_poses(8))
    found = calibrate(*views, CHESS, sensors=SIZE, distortion="k1 k2 p1 p2 k3", reject=False, folds=0)
    X = [CHESS.geometry().points.astype(np.float32)] * 8
    seen0, seen1 = ([v.pixels.astype(np.float32) for v in own] for own in views)
    start = [np.array([[5400.0, 0, 255.5], [0, 5400.0, 255.5], [0, 0, 1]])] * 2
    ours = [camera.matrix for camera in found.rig.cameras]
    lenses = [np.array(camera.distortion) for camera in found.rig.cameras]
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 300, 1e-14)
    flags = cv2.CALIB_USE_INTRINSIC_GUESS
    from_far, from_here = (
        cv2.stereoCalibrate(X, seen0, seen1, K[0], D[0], K[1], D[1], (512, 512), flags=flags, criteria=stop)
        for K, D in ((start, [np.zeros(5), np.zeros(5)]), (ours, lenses))
    )
    assert found.rms < from_far[0] * (1 + 1e-5)  # it stops in the long valley of a narrow field
    assert found.rms == pytest.approx(from_here[0], rel=2e-6)  # its pixels are float32: 1e-5 px
    sigma = found.sigma
    for name, value in (("fx", from_here[1][0, 0]), ("cx", from_here[1][0, 2]), ("cy", from_here[1][1, 2])):
        assert getattr(found.rig.cameras[0], name) == pytest.approx(value, abs=0.1 * sigma[f"{name}0"])
    np.testing.assert_allclose(found.rig.relative[1], from_here[6].ravel(), atol=0.1 * sigma["tz"])


def test_derivatives_are_those_of_what_is_seen():
    """Central differences of `seen`; a dotted cylinder, so that offsets of curved patches take part."""
    body = DottedCylinder(columns=9, rows=7, radius=30e-3, pitch=2e-3, arc=2e-3, size=1e-3, square=True)
    g, ids = body.geometry(), np.arange(63)
    R1 = cv2.Rodrigues(TURN)[0]
    lens = (-0.2, 0.4, 1e-3, -2e-3, 0.5)
    common = {"fx": 5400.0, "fy": 5390.0, "cx": 254.0, "cy": 258.0, "skew": 0.6, "distortion": lens}
    rig = bundle.Rig((Camera(**common), Camera(**common, rotation=R1, translation=SHIFT)), {})
    turned = np.array([[-0.25, 0.97, 0.0], [0.0, 0.0, -1.0], [-0.97, -0.25, 0.0]])  # column 4 to the camera
    R = cv2.Rodrigues(np.array([0.1, 0.2, 0.3]))[0] @ np.linalg.qr(turned.T)[0].T
    R = R if np.linalg.det(R) > 0 else -R
    t = np.array([0.0, 0.0, 0.3]) - R @ [30e-3 * np.cos(8 / 30), 30e-3 * np.sin(8 / 30), 6e-3]
    for k, camera in enumerate(rig.cameras):
        sight = bundle.View(0, k, ids, g.points, g.normals, g.spread, g.bend, np.zeros((63, 2)), np.ones(63))
        shared, pose = bundle.derivatives(camera, sight, R, t)

        def slope(moved, h=1e-6, sight=sight):
            up, down = (bundle.project_points(c, sight, Q, s) for c, Q, s in moved)
            return (up - down) / (2 * h)

        for column, x in enumerate(1e-6 * np.eye(6)):
            numeric = slope([(camera, bundle.exponential(d[:3]) @ R, t + d[3:]) for d in (x, -x)])
            # the patches' offsets are held while the pose moves: (r/z)² and s κ/z, 1e-5 and 1e-4 here
            np.testing.assert_allclose(pose[:, :, column], numeric, atol=3e-4 * np.abs(numeric).max(), rtol=0)
            if k == 1:
                moved = [
                    replace(camera, rotation=bundle.exponential(d[:3]) @ R1, translation=SHIFT + d[3:])
                    for d in (x, -x)
                ]
                numeric = slope([(c, R, t) for c in moved])
                np.testing.assert_allclose(
                    shared[:, :, 20 + column], numeric, atol=3e-4 * np.abs(numeric).max(), rtol=0
                )
        numeric = []
        for name in ("fx", "fy", "cx", "cy", "skew"):
            moved = [replace(camera, **{name: getattr(camera, name) + h}) for h in (1e-3, -1e-3)]
            numeric.append(slope([(c, R, t) for c in moved], 1e-3))
        for x in 1e-5 * np.eye(5):
            moved = [replace(camera, distortion=tuple(lens + d)) for d in (x, -x)]
            numeric.append(slope([(c, R, t) for c in moved], 1e-5))
        columns = shared[:, :, 10 * k : 10 * k + 10]
        np.testing.assert_allclose(columns, np.stack(numeric, axis=-1), rtol=1e-5, atol=1e-8)


@pytest.mark.slow
def test_the_covariance_is_that_of_repeated_calibrations():
    """30 draws of the noise: errors follow the stated sigma, and chi-square says 16 numbers were adjusted."""
    poses = true_poses(10)
    normalised, chi2, clustering = [], [], []
    for seed in range(30):
        found = calibrate(*sightings(poses, seed=seed), CHESS, sensors=SIZE, distortion="k1", folds=0)
        scale = np.sqrt(max(1.0, found.clustering))  # the noise is independent, so the factor is chance here
        sigma = np.array(list(found.sigma.values())) / scale
        normalised.append(parameters(found)[sigma > 0.0] / sigma[sigma > 0.0])
        chi2.append(excess(found))
        clustering.append(found.clustering)
    # the mean of 30 chi-squares of 16 degrees of freedom has a sigma of sqrt(2 * 16 / 30) = 1.03
    assert abs(np.mean(chi2) - 16.0) < 3 * 1.03
    # of each number the rms of 30 is 1 ± 0.13, and the largest of 16, partly the same, deviates by 2.5 sigma
    rms = np.sqrt(np.mean(np.square(normalised), axis=0))
    assert np.all(np.abs(rms - 1.0) < 0.4)
    assert np.mean(clustering) == pytest.approx(1.0, abs=0.2)  # each scatters by 0.3


BAD = {
    "two pictures of one camera swapped": lambda v: v[1].__setitem__(slice(2, 6, 3), v[1][5:1:-3]),
    "the board slipped by 20 µm between the exposures, twice": lambda v: [
        v[1].__setitem__(k, replace(v[1][k], pixels=v[1][k].pixels + np.array([0.0, 0.36]))) for k in (2, 5)
    ],
    "two blurred pictures": lambda v: [
        v[k].__setitem__(
            j,
            replace(v[k][j], pixels=v[k][j].pixels + 0.1 * np.random.default_rng(3).standard_normal((63, 2))),
        )
        for k, j in ((0, 2), (1, 5))
    ],
    "another numbering": lambda v: [
        v[0].__setitem__(k, replace(v[0][k], pixels=np.roll(v[0][k].pixels, 1, axis=0))) for k in (2, 5)
    ],
}


@pytest.mark.parametrize(
    "what", [next(iter(BAD)), *(pytest.param(w, marks=pytest.mark.slow) for w in list(BAD)[1:])]
)
def test_two_bad_pairs_are_named_and_nothing_else(what):
    views = sightings(true_poses(9))
    BAD[what](views)
    names = [f"pair {k}" for k in range(9)]
    found = calibrate(*views, CHESS, sensors=SIZE, distortion="k1", names=names, folds=0)
    assert [pair.name for pair in found.rejected] == ["pair 2", "pair 5"]
    for pair in found.rejected:
        assert pair.outcome is PairOutcome.INCONSISTENT
        assert "limit" in pair.reason
        assert pair.rms > 2 * found.rms
    assert excess(found) < 39.3  # chi-square of 16 numbers exceeds this once in 1000
    kept = calibrate(*views, CHESS, sensors=SIZE, distortion="k1", reject=False, folds=0)
    assert not kept.rejected
    assert kept.rms > 2 * found.rms


@pytest.mark.slow
def test_good_pairs_are_all_kept():
    for seed in range(3):
        found = calibrate(
            *sightings(true_poses(8, seed), seed=seed), CHESS, sensors=SIZE, distortion="k1", folds=0
        )
        assert not found.rejected
        assert all(view.used.all() for pair in found.pairs for view in pair.views)


def test_one_bad_point_is_dropped_and_its_view_kept():
    views = sightings(true_poses(6))
    views[1][3].pixels[17] += (0.4, -0.3)
    found = calibrate(*views, CHESS, sensors=SIZE, distortion="k1", folds=0)
    assert not found.rejected
    unused = [(k, c) for k, pair in enumerate(found.pairs) for c in (0, 1) if not pair.views[c].used.all()]
    assert unused == [(3, 1)]
    assert np.flatnonzero(~found.pairs[3].views[1].used).tolist() == [17]


def test_pairs_that_were_not_found_keep_their_row_and_reason():
    views = sightings(true_poses(7))
    views[0][1] = views[1][1] = TargetNotFound("0 hollow among 3 dots")
    views[1][4] = None
    found = calibrate(*views, CHESS, sensors=SIZE, distortion="k1", folds=0)
    outcomes = [pair.outcome for pair in found.pairs]
    assert outcomes[1] is PairOutcome.NOT_FOUND
    assert "camera 0: 0 hollow among 3 dots" in found.pairs[1].reason
    assert outcomes[4] is PairOutcome.ONE_CAMERA
    assert found.pairs[4].views[1] is None
    assert found.pairs[4].views[0].used.all()
    assert [outcomes[k] for k in (0, 2, 3, 5, 6)] == [PairOutcome.VALID] * 5


@pytest.mark.slow
def test_a_camera_upside_down_numbers_the_chessboard_the_other_way_round():
    views = sightings(true_poses(6))
    # what detection does when the second camera is rolled: the same corners, counted from the other end
    turned = [
        replace(v, pixels=([511.0, 511.0] - v.pixels)[::-1].copy()) for v in views[1]
    ]  # fmt: skip
    found = calibrate(views[0], turned, CHESS, sensors=SIZE, distortion="k1", folds=0)
    straight = calibrate(*views, CHESS, sensors=SIZE, distortion="k1", folds=0)
    assert not found.rejected
    assert found.rms == pytest.approx(straight.rms, rel=1e-6)  # the same least squares
    R = found.rig.relative[0]
    np.testing.assert_allclose(R, np.diag([-1.0, -1.0, 1.0]) @ straight.rig.relative[0], atol=1e-5)


@pytest.mark.slow
def test_a_bent_board_shows_in_the_clustering_and_widens_the_covariance():
    X = CHESS.geometry().points.copy()
    X[:, 2] = 4e-5 * np.cos(X[:, 0] / 16e-3 * 2 * np.pi)  # 40 µm of warp: 0.3 px where the board is tilted
    views = sightings(true_poses(10), points=X)
    bent = calibrate(*views, CHESS, sensors=SIZE, distortion="k1", folds=0)
    straight = calibrate(*sightings(true_poses(10)), CHESS, sensors=SIZE, distortion="k1", folds=0)
    assert straight.clustering < 2.0  # 1 ± 0.3
    assert bent.clustering > 4.0
    assert bent.sigma["fx0"] > 2 * bent.unit * straight.sigma["fx0"] / straight.unit


@pytest.mark.slow
def test_what_the_pictures_do_not_determine_is_said():
    poses = true_poses(8)
    found = calibrate(*sightings(poses), CHESS, sensors=SIZE, distortion="k1 k2 k3", folds=0)
    assert any("k3" in line and "leave it out" in line for line in found.advice)
    R, t = poses[0]
    same = [(R, t + np.array([0.0, 0.0, 1e-3 * k])) for k in range(6)]
    frontal = [(np.eye(3), np.array([-8e-3, -6e-3, 0.3])) for _ in range(6)]
    weak = calibrate(*sightings(same), CHESS, sensors=SIZE, distortion="k1", folds=0)
    assert weak.sigma["fx0"] > 5 * found.sigma["fx0"]
    with pytest.raises(bundle.Undetermined, match="do not determine"):
        calibrate(*sightings(frontal), CHESS, sensors=SIZE, distortion="k1", folds=0)


def test_what_cannot_be_solved_is_refused():
    views = sightings(true_poses(4))
    nothing = [TargetNotFound("no")] * 4
    with pytest.raises(bundle.Undetermined, match="camera 1 has no picture"):
        calibrate(views[0], nothing, CHESS, sensors=SIZE)
    with pytest.raises(bundle.Undetermined, match="by both cameras"):
        calibrate([*views[0][:2], None, None], [None, None, *views[1][2:]], CHESS, sensors=SIZE)
    few = [[Detection(v.ids[:4], v.pixels[:4], v.sigma[:4]) for v in own[:1]] for own in views]
    with pytest.raises((bundle.Undetermined, ValueError), match=r"too few|explains"):
        calibrate(*few, CHESS, sensors=SIZE)
    with pytest.raises(ValueError, match="equally many"):
        calibrate(views[0], views[1][:2], CHESS, sensors=SIZE)
    with pytest.raises(ValueError, match="distortion must be one of"):
        calibrate(*views, CHESS, sensors=SIZE, distortion="k7")
    with pytest.raises(ValueError, match="ids must lie"):
        calibrate(*views, Chessboard(columns=5, rows=4, pitch=1e-3), sensors=SIZE)


def test_held_out_pairs_and_distances_are_predicted():
    found = calibrate(*sightings(true_poses(10)), CHESS, sensors=SIZE, distortion="k1")
    checks = found.checks
    # 2520 coordinates, 76 numbers adjusted: rms 0.0283 sqrt(1 - 76/2520), known to 1.4 %
    assert checks.fit_rms == pytest.approx(0.02 * np.sqrt(2) * np.sqrt(1 - 76 / 2520), rel=0.05)
    assert checks.fit_rms < checks.held_out_rms < 1.05 * checks.fit_rms
    assert abs(checks.distance_ratio - 1.0) < 4 * max(checks.distance_sigma, 1e-6)
    # 0.02 px are 1.1 µm across, and 1 / tan of half of 12.6° as much in depth: 0.8, 0.8, 7 µm
    assert checks.distance_rms == pytest.approx(7e-6, rel=0.3)


@pytest.mark.slow
def test_the_offset_of_a_dot_is_part_of_the_model():
    """Dots a tenth as wide as they are deep: with their eccentricity the fit is exact, without it is not."""
    big = replace(BOARD, diameter=1.9e-3, hole=0.0)
    poses = true_poses(8)
    exact = sightings(poses, noise=0.0, target=big)
    cameras = tuple(
        Camera(fx=K[0, 0], fy=K[1, 1], cx=K[0, 2], cy=K[1, 2], distortion=tuple(LENS)) for K in MATRICES
    )
    R01 = cv2.Rodrigues(TURN)[0]
    g = big.geometry()
    for k, views in enumerate(exact):
        for view, (R, t) in zip(views, poses, strict=True):
            turn, shift = (R, t) if k == 0 else (R01 @ R, R01 @ t + SHIFT)
            sight = bundle.View(
                0, 0, view.ids, g.points, g.normals, g.spread, g.bend, view.pixels, view.sigma
            )
            view.pixels[:] = bundle.project_points(cameras[k], sight, turn, shift)
    found = calibrate(*exact, big, sensors=SIZE, distortion="k1", folds=0)
    centres = calibrate(*exact, CHESS, sensors=SIZE, distortion="k1", folds=0)
    assert found.rms < 1e-6
    assert centres.rms > 100 * found.rms


def test_square_pixels_and_held_parameters_have_no_freedom():
    found = calibrate(
        *sightings(true_poses(6)), CHESS, sensors=SIZE, distortion="none", square_pixels=True, folds=0
    )
    assert found.free == ("fx", "fy", "cx", "cy")
    for camera in found.rig.cameras:
        assert camera.fx == camera.fy
        assert camera.distortion == (0.0,) * 5
    assert found.sigma["k10"] == 0.0
    assert found.sigma["fx0"] == pytest.approx(found.sigma["fy0"])


def test_a_rig_for_cropped_pictures_sees_the_same_points_shifted():
    found = calibrate(*sightings(true_poses(6)), CHESS, sensors=SIZE, distortion="k1", folds=0)
    X = np.array([[1e-3, -2e-3, 0.3], [0.0, 3e-3, 0.29]])
    cropped = found.rig.cropped((192, 160), (100, 120))
    for camera, whole, offset in zip(
        cropped.cameras, found.rig.cameras, ((192, 160), (100, 120)), strict=True
    ):
        np.testing.assert_allclose(camera.project(X), whole.project(X) - offset, atol=1e-9)


def test_adjusting_a_pose_alone_leaves_the_cameras():
    g = CHESS.geometry()
    R, t = true_poses(1)[0]
    camera = Camera(fx=5400.0, fy=5390.0, cx=254.3, cy=258.3, distortion=tuple(LENS))
    view = sightings([(R, t)], noise=0.0)[0][0]
    sight = bundle.View(0, 0, view.ids, g.points, g.normals, g.spread, g.bend, view.pixels, view.sigma)
    start = bundle.Rig(
        (camera, camera), {0: (bundle.exponential(np.array([0.05, -0.05, 0.1])) @ R, t + 1e-3)}
    )
    fit = bundle.adjust(start, [sight], np.zeros((bundle.SHARED_PARAMETERS, 0)))
    assert fit.rig.cameras[0] == camera
    np.testing.assert_allclose(fit.rig.poses[0][1], t, atol=1e-9)
    assert np.abs(bundle.residuals(fit.rig, sight)).max() < 1e-6
    assert bundle.free_columns((), square_pixels=False, relative=True).shape == (bundle.SHARED_PARAMETERS, 6)


N = 8
SHUFFLED = [3, 0, 6, 1, 7, 2, 4, 5]


def mixed(poses):
    """What both cameras see, camera 1's pictures out of order; and the order that puts them right."""
    first, second = sightings(poses, target=BOARD)
    return first, [second[k] for k in SHUFFLED]


def test_the_order_of_the_pictures_is_found():
    first, second = mixed(true_poses(N))
    found = find_order((first, second), [BOARD] * N, SIZE)
    assert found == np.argsort(SHUFFLED).tolist()
    ordered = [second[k] for k in found]
    assert find_order((first, ordered), [BOARD] * N, SIZE) == list(range(N))


def test_pictures_of_other_poses_have_no_order():
    first, _ = sightings(true_poses(N), target=BOARD)
    _, second = sightings(true_poses(N, seed=99), target=BOARD)
    assert find_order((first, second), [BOARD] * N, SIZE) is None
    assert find_order((first[:2], second[:2]), [BOARD] * 2, SIZE) is None


TEXT = """
[calibration]
camera_0 = "cam0_*.png"
camera_1 = "cam1_*.png"
distortion = "k1"

[calibration.target]
kind = "fiducial_dots"
columns = 9
rows = 7
pitch = "2 mm"
diameter = "0.8 mm"
hole = "0.3 mm"
hollow = [[1, 1], [6, 1], [1, 4]]
"""


def test_pairs_out_of_order_are_refused_with_the_order_that_would_fit(tmp_path, monkeypatch):
    (tmp_path / "calibration.toml").write_text(TEXT)
    toml, section = read_calibration_toml(tmp_path)
    series = SimpleNamespace(n_frames=N, shape=SIZE[0][::-1], numbers=tuple(range(N)))
    monkeypatch.setattr(calibration, "calibration_pictures", lambda *given: [series, series])
    views = mixed(true_poses(N))
    seen = nullcontext(lambda progress: views)
    monkeypatch.setattr(dic.calibration.views, "detect_in_background", lambda *given: seen)
    with pytest.raises(InputError, match="do not fit two cameras") as refused:
        calibration.calibration_of(toml, section, lambda *told: None, predict=False)
    order = ", ".join(str(k) for k in np.argsort(SHUFFLED))
    assert f"beside 0, 1, 2, 3, 4, 5, 6, 7 of camera 0, {order} of camera 1 would fit" in str(refused.value)
    views = sightings(true_poses(N), target=BOARD)  # the same name: what is seen from now on
    assert calibration.calibration_of(toml, section, lambda *told: None, predict=False).rms < 0.1


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
    cameras = RIG
    (R, t), (Q, s) = turn_rig(cameras, x).relative, turned(cameras, x).relative
    np.testing.assert_allclose(R, Q, atol=1e-12)
    np.testing.assert_allclose(t, s, atol=1e-15)
    assert np.linalg.norm(t) == pytest.approx(np.linalg.norm(cameras.relative[1]), rel=1e-12)
    base = cameras.relative[1]
    np.testing.assert_allclose(baseline_normals(base).T @ base, 0.0, atol=1e-15)
    np.testing.assert_allclose(baseline_normals(base).T @ baseline_normals(base), np.eye(2), atol=1e-12)


def test_a_camera_that_was_knocked_is_put_back_and_false_matches_pull_little():
    true = RIG
    _, pixels, sigma = seen(true)
    wrong = turned(true, np.array([4e-4, 1e-4, -3e-4, 2e-4, 0.0]))
    found = refine(wrong, *pixels, sigma)
    assert found.before > 0.5
    # |normal deviate| has the median 0.6745 of its sigma; 300 points tell it to 7 %
    assert found.after == pytest.approx(0.6745 * sigma[0], rel=0.2)
    assert found.held_out_after == pytest.approx(0.6745 * sigma[0], rel=0.2)
    assert found.helps
    assert found.n_points == 300
    wrong = turned(true, np.array([4e-4, 0.0, 0.0, 0.0, 0.0]))
    pixels[1][:15] += np.random.default_rng(1).uniform(-4.0, 4.0, (15, 2))
    found = refine(wrong, *pixels, sigma)
    assert found.after < 1.4 * 0.6745 * sigma[0]


def test_right_cameras_are_left_alone():
    """Made sets of points of the true rig: the rule must not be moved by their noise."""
    for seed in range(6):
        _, pixels, sigma = seen(RIG, seed)
        assert not refine(RIG, *pixels, sigma).helps


def test_the_rule_wants_a_fifth_on_points_that_were_left_out():
    zero = np.zeros(3)
    made = Refinement(RIG, zero, zero[:2], np.eye(5), 1.0, 0.1, 1.0, 1.0 - LEAST_GAIN, 100)
    assert made.helps
    assert not replace(made, held_out_after=1.0 - LEAST_GAIN + 1e-6).helps
    assert LEAST_GAIN == 0.2
    assert made.words["epipolar_median_after_px"] == 0.1


def test_the_prior_is_the_calibrations_covariance_of_turns_and_tilts():
    cameras = RIG
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
    true = RIG
    for seed in range(3):
        _, pixels, sigma = seen(true, seed)
        found = refine(turned(true, np.array([2e-4, 0.0, 0.0, 0.0, 0.0])), *pixels, sigma)
        fault = found.before / 0.6745 / 5400.0  # the turn that the distances amount to [rad]
        assert np.linalg.norm([*found.turn, *found.tilt]) < 3.0 * fault
        assert np.all(np.sqrt(np.diag(found.covariance)) < 1.01 * fault)


@pytest.mark.parametrize("n", [39, 5])
def test_too_few_points_are_refused(n):
    _, pixels, sigma = seen(RIG)
    with pytest.raises(ValueError, match="needs 40 pairs"):
        refine(RIG, pixels[0][:n], pixels[1][:n], sigma[:n])
    with pytest.raises(ValueError, match="positive"):
        refine(RIG, *pixels, 0.0 * sigma)


def test_points_left_out_take_no_part():
    """Every second point moved by 3 px: fitted to the others, a pose says so; fitted to themselves, less."""
    _, pixels, sigma = seen(RIG)
    pixels[1][::2, 1] += 3.0
    found = refine(RIG, *pixels, sigma)
    # each half fits its own points; the other half is then 3 px off
    assert found.held_out_after == pytest.approx(3.0, rel=0.1)
