"""Calibration from pictures against truth files, DICe's gold files and MultiDIC's cylinder."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import chi2
from shared_data import data, grey
from synthetic_dic import true_rig

from dic import StereoRig
from dic.calibration.bundle import Rig, View
from dic.calibration.solve import calibrate, triangulate_target
from dic.calibration.targets import Chessboard, DottedCylinder, FiducialDots
from dic.calibration.views import Calibration, PairOutcome, detect
from dic.camera_files import read_rig

pytestmark = pytest.mark.slow  # some hundred pictures are searched

SHOT_GRID = FiducialDots(columns=14, rows=10, pitch=1.2e-3, diameter=0.6e-3, hollow=((2, 2), (11, 2), (2, 7)))


NAMES = ("fx0", "cx0", "cy0", "k10", "fx1", "cx1", "cy1", "k11", "rx", "ry", "rz", "tx", "ty", "tz")
"""What is adjusted with square pixels and k1."""


def difference(found: StereoRig, true: StereoRig) -> np.ndarray:
    """Parameters of `found` less those of `true`, in the order of `parameter_names`."""
    values = [
        np.array([c.fx, c.fy, c.cx, c.cy, c.skew, *c.distortion])
        for rig in (found, true)
        for c in rig.cameras
    ]
    (R, t), (R_true, t_true) = found.relative, true.relative
    turn = Rotation.from_matrix(R @ R_true.T).as_rotvec()
    return np.concatenate([values[0] - values[2], values[1] - values[3], turn, t - t_true])


def normalised(found: Calibration, true: StereoRig, names: tuple[str, ...]) -> tuple[np.ndarray, float]:
    """Differences over sigma, and their chi-square with all correlations."""
    rows = [found.rig.parameter_names.index(name) for name in names]
    off = difference(found.rig, true)[rows]
    C = found.rig.covariance[np.ix_(rows, rows)]
    return off / np.sqrt(np.diag(C)), float(off @ np.linalg.solve(C, off))


def say(found: Calibration, z: np.ndarray | None = None, total: float = float("nan"), **more: float) -> None:
    """The numbers that docs/validation/cameras.md quotes; `pytest -s` shows them."""
    facts = {
        "rms": found.rms, "held out": found.checks.held_out_rms, "unit": found.unit,
        "clustering": found.clustering, "shape": found.checks.distance_rms, **more,
    }  # fmt: skip
    if z is not None:
        facts |= {"largest z": float(np.abs(z).max()), "chi2": total, "of": len(z)}
    print("\n  " + ", ".join(f"{name} {value:.4g}" for name, value in facts.items()), end="")


@pytest.fixture(scope="module", params=["open-01", pytest.param("open-02", marks=pytest.mark.long)])
def shot(request):
    """What was detected in the calibration series of a shot with known cameras, and these cameras."""
    folder = data("shots", request.param)
    views = [
        [detect(grey(folder / "calibration" / f"cam{c}_{k:02d}.png"), SHOT_GRID) for k in range(20)]
        for c in (0, 1)
    ]
    return views, true_rig(folder)


def test_the_cameras_of_known_shots(shot):
    views, true = shot
    assert all(len(view.ids) == 140 for own in views for view in own)
    found = calibrate(
        *views, SHOT_GRID, sensors=((512, 512), (512, 512)), distortion="k1", square_pixels=True
    )
    say(found, *normalised(found, true, NAMES))
    assert not found.rejected
    assert found.rms < 0.022  # 0.0195 px: noise 0.008 px, the rest is how the dots were rendered
    assert found.checks.held_out_rms < 1.02 * found.rms
    z, total = normalised(found, true, NAMES)
    assert np.all(np.abs(z) < 4.0)
    assert total < chi2.ppf(0.999, len(NAMES))
    # the sigmas are worth something: focal lengths to 1e-3, principal points to 2 px, the angle to 0.03°
    assert found.sigma["fx0"] < 5.4
    assert max(found.sigma[name] for name in ("cx0", "cy0", "cx1", "cy1")) < 2.0
    assert max(found.sigma[name] for name in ("rx", "ry")) < np.deg2rad(0.03)


def test_two_bad_pairs_of_a_real_series_are_named_and_nothing_else(shot):
    views, true = shot
    second = list(views[1])
    second[4], second[13] = second[13], second[4]
    found = calibrate(
        views[0], second, SHOT_GRID, sensors=((512, 512),) * 2, distortion="k1", square_pixels=True, folds=0
    )
    assert [pair.name for pair in found.rejected] == ["4", "13"]
    z, _ = normalised(found, true, ("fx0", "fx1", "tx", "tz"))
    assert np.all(np.abs(z) < 4.0)


SETS = {
    "sim_dot": (
        FiducialDots(columns=14, rows=10, pitch=7e-3, diameter=1.5e-3, hollow=((2, 2), (11, 2), (2, 7))),
        0.007,
    ),
    "sim_checker": (Chessboard(columns=12, rows=8, pitch=5e-3), 0.025),
}


@pytest.mark.parametrize("name", SETS)
def test_dices_simulated_sets(name):
    """The gold file holds another program's solution of all 15 and 21 pairs; here are 4 of each."""
    folder = data("dic", "dice_calibration_targets")
    target, residual = SETS[name]
    views = [[detect(grey(folder / f"{name}_{k:02d}_{c}.jpeg"), target) for k in range(4)] for c in (0, 1)]
    found = calibrate(*views, target, sensors=((1920, 1200), (1920, 1200)), distortion="k1 k2")
    gold = read_rig(folder / "sim_dot_cal_gold.xml")  # both files hold the same cameras but for k1, k2, k3
    assert found.rms < residual  # 0.0059 and 0.0214 px
    own = [f"{n}{k}" for k in (0, 1) for n in ("fx", "fy", "cx", "cy")]
    names = (*own, "tx", "ty", "tz")
    z, total = normalised(found, gold, names)
    say(found, z, total)
    assert np.all(np.abs(z) < 4.0)
    if name == "sim_checker":  # the dots were drawn with light added and black cut off, which no camera does:
        assert total < chi2.ppf(0.999, len(names))  # dots move with the light's slope, all in one way
    # distortion by what it does in the field that the targets covered, not by coefficients that trade places
    for camera, true in zip(found.rig.cameras, gold.cameras, strict=True):
        corner = np.array([900.0, 550.0]) / camera.fx
        shift = camera.fx * (camera.distort(corner) - true.distort(corner))
        assert np.hypot(*shift) < 0.5  # px at the corner, where the lens moves points by 10 px


def test_dices_real_pairs_fit_no_worse_than_its_own_route():
    """DICe's own test accepts 0.75 px; its route, centroids of outlines into OpenCV, is taken beside it."""
    folder = data("dic", "dice_calibration_targets")
    target = FiducialDots(columns=10, rows=8, pitch=3.5e-3, diameter=1.4e-3, hollow=((2, 2), (7, 2), (2, 5)))
    pictures = [[grey(folder / f"CalB-sys2-{k:04d}_{c}.jpeg") for k in range(1, 6)] for c in (0, 1)]
    views = [[detect(picture, target) for picture in own] for own in pictures]
    found = calibrate(
        *views, target, sensors=((2448, 2048), (2448, 2048)), distortion="k1 k2 p1 p2 k3", folds=0
    )
    assert not found.rejected
    assert found.rms < 0.75
    points = target.geometry().points
    X, seen = [], ([], [])
    for first, second in zip(*views, strict=True):
        common = np.intersect1d(first.ids, second.ids)
        X.append(points[common].astype(np.float32))
        for k, view in enumerate((first, second)):
            picture = pictures[k][len(X) - 1]
            rows = np.searchsorted(view.ids, common)
            seen[k].append(np.array([outline_centroid(picture, p) for p in view.pixels[rows]], np.float32))
    start = [np.array([[c.fx, 0, c.cx], [0, c.fy, c.cy], [0, 0, 1]]) for c in found.rig.cameras]
    lens = [np.array(c.distortion) for c in found.rig.cameras]
    theirs = cv2.stereoCalibrate(
        X, *seen, start[0], lens[0], start[1], lens[1], (2448, 2048),
        flags=cv2.CALIB_USE_INTRINSIC_GUESS, criteria=(3, 200, 1e-12),
    )[0]  # fmt: skip
    say(found, theirs=theirs)
    assert found.rms <= theirs


def outline_centroid(picture: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Centroid of a dot's outline at the middle of its grey values, as DICe takes it [px]."""
    x, y = np.round(place).astype(int)
    left, top = max(x - 34, 0), max(y - 34, 0)
    part = picture[top : y + 35, left : x + 35]
    _, mask = cv2.threshold(part, 0, 255, cv2.THRESH_BINARY_INV | cv2.THRESH_OTSU)
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    m = cv2.moments(
        min(
            outlines,
            key=lambda o: (
                abs(cv2.pointPolygonTest(o, (float(x - left), float(y - top)), True))
                if cv2.contourArea(o) < 50
                else -cv2.contourArea(o)
            ),
        )
    )
    return np.array([m["m10"] / m["m00"] + left, m["m01"] / m["m00"] + top])


def scatter_about_own_axis(X: np.ndarray) -> float:
    """Standard deviation of the distances from the best-fit cylinder near the z axis [m]."""

    def distance(p: np.ndarray) -> np.ndarray:
        axis = np.array([p[0], p[1], 1.0]) / np.sqrt(1.0 + p[0] ** 2 + p[1] ** 2)
        return np.linalg.norm(np.cross(1e3 * X - [p[2], p[3], 0.0], axis), axis=1) - p[4]

    return 1e-3 * float(np.std(least_squares(distance, [0.0, 0.0, 0.0, 0.0, 57.0]).fun))


BODY = DottedCylinder(columns=14, rows=20, radius=57e-3, pitch=12e-3, arc=12e-3, size=4e-3, square=True)
ANCHORS = {  # read off the pictures: columns are printed above them, rows count from the bottom
    "201": ((2, 0, 906.0, 2574.0), (4, 0, 1101.0, 2604.0), (2, 2, 908.0, 2348.0)),
    "202": ((4, 0, 799.0, 2518.0), (6, 0, 973.0, 2557.0), (4, 2, 803.0, 2304.0)),
}
BOARDS = {"201": ("02", "06", "22", "35", "44"), "202": ("01", "09", "13", "21", "25")}


def test_multidics_cylinder_and_boards():
    """One pair of a dotted cylinder for the pose, boards of one camera for its lens, solved together."""
    folder = data("dic", "multidic_cylinder")
    board = Chessboard(
        columns=14, rows=19, pitch=10e-3
    )  # the square is not stated; single views do not need it
    views, targets = [[], []], [BODY]
    for c, name in enumerate(("201", "202")):
        body = replace(BODY, anchors=ANCHORS[name])
        views[c].append(detect(grey(folder / "calib_cylinder" / f"{name}.jpg"), body))
    for c, name in enumerate(("201", "202")):
        for number in BOARDS[name]:
            views[c].append(detect(grey(folder / "checkerboard" / f"{name}_{number}.jpg"), board))
            views[1 - c].append(None)
            targets.append(board)
    found = calibrate(*views, targets, sensors=((2464, 3280), (2464, 3280)), distortion="k1 k2 p1 p2 k3")
    assert [pair.outcome for pair in found.pairs] == [PairOutcome.VALID] + [PairOutcome.ONE_CAMERA] * 10
    assert found.rms < 0.6  # 0.51 px; OpenCV's own calibration of all 25 boards a camera leaves 0.46 px
    # The paper round the cylinder is wrapped 0.14 mm askew over its columns and the boards are warped: the
    # calibration says so itself, and what it states is that much wider.
    assert found.clustering > 10.0

    g = BODY.geometry()
    pair = found.pairs[0]
    sights = [
        View(0, c, v.ids[v.used], g.points[v.ids[v.used]], g.normals[v.ids[v.used]], g.spread[v.ids[v.used]],
              g.bend[v.ids[v.used]], v.pixels[v.used], v.sigma[v.used])
        for c, v in enumerate(pair.views)
    ]  # fmt: skip
    X, true = triangulate_target(Rig(found.rig.cameras, {0: (pair.rotation, pair.translation)}), sights)
    body = (X - pair.translation) @ pair.rotation
    radius = np.hypot(body[:, 0], body[:, 1])
    assert len(radius) >= 78  # as many as the reference's
    assert abs(radius.mean() - 57e-3) < 0.05e-3  # the reference's mean is off by 0.009 mm
    assert scatter_about_own_axis(body) < 0.039e-3  # the reference's scatter
    rms = np.sqrt(np.mean((body - true) ** 2, axis=0))
    # MultiDIC's own: 0.020, 0.049, 0.028 mm; the skew of the paper shows in the second, 0.075 mm
    assert np.all(rms < [0.03e-3, 0.09e-3, 0.04e-3])

    reference = json.loads((folder / "reference_calibration.json").read_text())
    R, t = found.rig.relative
    turn = Rotation.from_matrix(R @ np.array(reference["R"]).T).as_rotvec()
    off = np.concatenate([turn, t - 1e-3 * np.ravel(reference["t"])])
    sigma = np.array([found.sigma[name] for name in ("rx", "ry", "rz", "tx", "ty", "tz")])
    say(found, off / sigma, radius=radius.mean(), scatter=scatter_about_own_axis(body))
    assert np.all(np.abs(off / sigma) < 4.0)
