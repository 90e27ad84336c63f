"""Calibration of two cameras from their views of a target.

`calibrate` starts from focal lengths and single poses and adjusts the bundle. It rejects pairs and points
that disagree with the other pairs. Then it checks the residuals of left-out pairs and the distances on the
target.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from dic.basics import MAD, FloatArray, cv2
from dic.calibration.bundle import (
    HARDLY,
    SHARED_PARAMETERS,
    Fit,
    Pose,
    Rig,
    Undetermined,
    View,
    adjust,
    clustering,
    free_columns,
    project_points,
    residuals,
)
from dic.calibration.targets.base import Detection, Target, TargetNotFound
from dic.calibration.views import (
    Calibration,
    Checks,
    Pair,
    PairOutcome,
    PairView,
    all_views,
    finished_view,
    only,
)
from dic.camera import PARAMETERS, Camera, StereoRig
from dic.images import PictureError
from dic.processes import run_parallel

FOCAL = (0.3, 60.0)
"""Range of focal lengths that are tried, over the longer side of the picture."""
FOCAL_TRIALS = 6
"""Number of pictures for the choice of the focal length, and number of pairs whose relative pose is tried."""


def resection(camera: Camera, view: View) -> list[Pose]:
    """Poses of a target in the camera's frame, best first; two if a flat target is ambiguous."""
    return [pose for _, pose in _resect_all(camera, view)]


def _resect_all(camera: Camera, view: View) -> list[tuple[float, Pose]]:
    """The poses of `resection`, each with its `misfit` [px]."""
    pixels = camera.undistort(view.pixels)
    points = np.ascontiguousarray(view.points)
    flat = np.ptp(points[:, 2]) == 0.0
    if len(points) < (4 if flat else 6):
        return []
    shift = points.mean(axis=0) * [1.0, 1.0, 0.0] + [0.0, 0.0, points[0, 2] if flat else 0.0]
    method = cv2.SOLVEPNP_IPPE if flat else cv2.SOLVEPNP_SQPNP
    try:
        count, turns, shifts, _ = cv2.solvePnPGeneric(points - shift, pixels, np.eye(3), None, flags=method)
    except cv2.error:  # points on a line
        return []
    poses: list[Pose] = []
    for turn, translation in zip(turns[:count], shifts[:count], strict=True):
        R = np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
        t = translation.ravel() - R @ shift
        if np.all(np.isfinite(R)) and np.all(np.isfinite(t)) and t[2] + (R @ shift)[2] > 0.0:
            poses.append((R, t))
    return sorted(((misfit(camera, view, pose), pose) for pose in poses), key=lambda found: found[0])


def misfit(camera: Camera, view: View, pose: Pose) -> float:
    """Root mean square distance of the observed points from a pose's prediction [px]."""
    off = view.pixels - project_points(camera, view, *pose)
    value = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
    return value if np.isfinite(value) else np.inf


def focal_start(sensor: tuple[int, int], views: Sequence[View]) -> Camera:
    """A camera without distortion and with its principal point in the middle of the picture.

    A scan finds the focal length with the smallest median misfit over a few pictures. For a long lens and
    nearly parallel boards the closed form from homographies may diverge; the scan cannot.
    """
    middle = (0.5 * (sensor[0] - 1), 0.5 * (sensor[1] - 1))
    few = [views[k] for k in np.unique(np.linspace(0, len(views) - 1, FOCAL_TRIALS).round().astype(int))]

    def off(logarithm: float) -> float:
        f = float(np.exp(logarithm)) * max(sensor)
        camera = Camera(fx=f, fy=f, cx=middle[0], cy=middle[1], sensor=sensor)
        best = [next((value for value, _ in _resect_all(camera, s)), np.inf) for s in few]
        return float(np.median(best))

    low, high = np.log(FOCAL)
    grid = np.linspace(low, high, 16)
    values = [off(x) for x in grid]
    best = int(np.argmin(values))
    if not np.isfinite(values[best]):
        raise Undetermined(
            "no pose of the target explains the detected points; check its columns, rows and pitch"
        )
    a, b = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    fine = np.linspace(a, b, 7)
    f = float(np.exp(fine[int(np.argmin([off(x) for x in fine]))])) * max(sensor)
    return Camera(fx=f, fy=f, cx=middle[0], cy=middle[1], sensor=sensor)


def relative(first: Pose, second: Pose) -> Pose:
    """Relative pose from camera 0 to camera 1, from the poses of one target in both."""
    R = second[0] @ first[0].T
    return R, second[1] - R @ first[1]


def in_camera_1(first: Pose, rel: Pose) -> Pose:
    """A pose in camera 0's frame, transformed to camera 1's frame."""
    return rel[0] @ first[0], rel[0] @ first[1] + rel[1]


def start(
    sensors: tuple[tuple[int, int], tuple[int, int]], views: Mapping[tuple[int, int], Sequence[View]]
) -> tuple[Rig, dict[tuple[int, int], View]]:
    """Initial cameras, relative pose and poses of the target, and the numbering of the target in each view.

    ``sensors``: columns and rows of the two cameras' pictures [px]. ``views``: (pair, camera) -> the view,
    once in each equivalent numbering. Raises Undetermined if a camera has no views, or no target was seen by
    both cameras.
    """
    cameras = []
    for camera in (0, 1):
        first_views = [views[0] for (_, k), views in sorted(views.items(), key=lambda i: i[0]) if k == camera]
        if not first_views:
            raise Undetermined(f"camera {camera} has no picture in which the target was recognised")
        cameras.append(focal_start(sensors[camera], first_views))
    pairs = sorted({pair for pair, _ in views})
    joint = [pair for pair in pairs if (pair, 0) in views and (pair, 1) in views]
    if not joint:
        raise Undetermined("no target was recognised by both cameras in the same pair of pictures")
    poses = {pair: resection(cameras[0], views[pair, 0][0]) if (pair, 0) in views else [] for pair in pairs}
    rel = _relative(cameras[0], cameras[1], joint, poses, views)
    rig_cameras = (cameras[0], replace(cameras[1], rotation=rel[0], translation=rel[1]))
    chosen: dict[tuple[int, int], View] = {}
    poses_of_pairs: dict[int, Pose] = {}
    for pair in pairs:
        options = poses[pair]
        if (pair, 0) not in views:  # seen by camera 1 only: use its transformed pose
            back = (rel[0].T, -rel[0].T @ rel[1])
            options = [in_camera_1(p, back) for p in resection(cameras[1], views[pair, 1][0])]
        if not options:
            continue
        if (pair, 0) in views:
            chosen[pair, 0] = views[pair, 0][0]
        numberings = views.get((pair, 1), ())
        if not numberings:
            poses_of_pairs[pair] = options[0]
            continue
        scores = [
            (misfit(cameras[1], view, in_camera_1(p, rel)), k, j)
            for k, view in enumerate(numberings)
            for j, p in enumerate(options)
        ]
        _, k, j = min(scores)
        chosen[pair, 1], poses_of_pairs[pair] = numberings[k], options[j]
    return Rig(rig_cameras, poses_of_pairs), chosen


def _relative(
    first: Camera,
    second: Camera,
    joint: Sequence[int],
    poses: Mapping[int, Sequence[Pose]],
    views: Mapping[tuple[int, int], Sequence[View]],
) -> Pose:
    """The relative pose that agrees with the most pairs. A flat board has two possible tilts in each
    picture."""
    few = [joint[k] for k in np.unique(np.linspace(0, len(joint) - 1, FOCAL_TRIALS).round().astype(int))]
    candidates = [
        relative(p, q)
        for pair in few
        for view in views[pair, 1]
        for q in resection(second, view)
        for p in poses[pair]
    ]

    def off(rel: Pose) -> float:
        best = [
            min(
                (misfit(second, view, in_camera_1(p, rel)) for view in views[pair, 1] for p in poses[pair]),
                default=np.inf,
            )
            for pair in few
        ]
        return float(np.median(best))

    scores = [off(rel) for rel in candidates]
    if not scores or not np.isfinite(min(scores)):
        raise Undetermined("no relative pose of the cameras explains what they see; are pairs in order?")
    return candidates[int(np.argmin(scores))]


def rms(rig: Rig, views: Sequence[View]) -> float:
    """Root mean square distance of all observed points from their predictions [px]."""
    off = np.concatenate([residuals(rig, view) for view in views])
    return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))


ENOUGH = 1e-7
"""Relative tolerance of the sum of squares for held-out pairs, from a start close to the solution."""


def _group_by_pair(views: Sequence[View]) -> dict[int, list[View]]:
    """Views of each pair."""
    ordered = sorted(views, key=lambda s: (s.pair, s.camera))
    return {pair: list(views) for pair, views in groupby(ordered, key=lambda s: s.pair)}


def _fit_pose(rig: Rig, views: Sequence[View], *, tolerance: float = 1e-10) -> Fit:
    """The best pose of one target for given cameras."""
    return adjust(rig, views, np.zeros((SHARED_PARAMETERS, 0)), tolerance=tolerance)


def cross_validation_error(fit: Fit, views: Sequence[View], columns: FloatArray, folds: int) -> float:
    """Root mean square residual of held-out pairs (cross-validation) [px].

    Pairs k, k + folds, ... are left out in turn and the others are solved again. For each held-out pair only
    the target's pose is adjusted. NaN if the remaining pairs are too few.
    """
    pairs = _group_by_pair(views)
    joint = [pair for pair, views in pairs.items() if len(views) == 2]
    if folds < 2 or len(joint) < 4:
        return float("nan")

    def part(k: int) -> tuple[float, int] | None:
        """Sum of squares and number of residuals of a part. None if there are too few other pairs."""
        out = set(joint[k::folds])
        try:
            remaining = [s for s in views if s.pair not in out]
            without = adjust(fit.rig, remaining, columns, tolerance=ENOUGH, damping=HARDLY)
        except ValueError:
            return None
        squares, count = 0.0, 0
        for pair in out:
            refit = _fit_pose(without.rig, pairs[pair], tolerance=ENOUGH)
            off = np.concatenate([residuals(refit.rig, s) for s in pairs[pair]])
            squares, count = squares + float(np.sum(off**2)), count + len(off)
        return squares, count

    parts = run_parallel([partial(part, k) for k in range(min(folds, len(joint)))])
    sums = [residual_sum for residual_sum in parts if residual_sum is not None]
    if len(sums) < len(parts):
        return float("nan")
    return float(np.sqrt(sum(squares for squares, _ in sums) / sum(count for _, count in sums)))


def triangulate_target(rig: Rig, views: Sequence[View]) -> tuple[FloatArray, FloatArray]:
    """Points of a target seen by both cameras: triangulated in space [m], and on the target [m].

    The offset of a dot's centroid from its centre's image is subtracted first.
    """
    # imported here, because the detection of a target does not need it
    from dic.stereo.geometry import triangulate

    first, second = views
    _, rows0, rows1 = np.intersect1d(first.ids, second.ids, return_indices=True)
    pixels = []
    for view, rows in ((first, rows0), (second, rows1)):
        camera = rig.cameras[view.camera]
        R, t = rig.poses[view.pair]
        shift = project_points(camera, view, R, t) - project_points(camera, view, R, t, patches=False)
        pixels.append((view.pixels - shift)[rows])
    positions = triangulate(StereoRig(rig.cameras), pixels[0], pixels[1], np.eye(2), np.eye(2)).position
    return positions, first.points[rows0]


def distances(rig: Rig, views: Sequence[View]) -> tuple[float, float, float]:
    """Ratio of triangulated to true distances on the target, its sigma, and the rms error of shape [m].

    The ratio is the scale of the best-fit similarity from the true points of each pair to the triangulated
    points. This gives each distance its length as weight.
    """
    ratios, squares, count = [], 0.0, 0
    for pair_views in _group_by_pair(views).values():
        if len(pair_views) != 2:
            continue
        measured, true = triangulate_target(rig, pair_views)
        if len(measured) < 4:
            continue
        a, b = true - true.mean(axis=0), measured - measured.mean(axis=0)
        u, _, v = np.linalg.svd(b.T @ a)
        R = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
        turned = a @ R.T
        ratios.append(float(np.sum(turned * b) / np.sum(a * a)))
        squares, count = squares + float(np.sum((b - turned) ** 2)), count + len(b)
    if not ratios:
        return float("nan"), float("nan"), float("nan")
    spread = float(np.std(ratios, ddof=1) / np.sqrt(len(ratios))) if len(ratios) > 1 else float("nan")
    return float(np.mean(ratios)), spread, float(np.sqrt(squares / count))


def advice(rig: StereoRig, free: Sequence[str]) -> tuple[str, ...]:
    """Parameters that the pictures do not determine, with advice."""
    assert rig.covariance is not None
    sigma = dict(zip(rig.parameter_names, np.sqrt(np.diag(rig.covariance)), strict=True))
    warnings = []
    for k, camera in enumerate(rig.cameras):
        values = dict(
            zip(("skew", "k1", "k2", "p1", "p2", "k3"), (camera.skew, *camera.distortion), strict=True)
        )
        warnings += [
            f"camera {k}: {name} = {values[name]:.3g} ± {sigma[f'{name}{k}']:.2g} is not determined "
            "(its sigma exceeds its value): leave it out"
            for name in values
            if name in free and sigma[f"{name}{k}"] > abs(values[name])
        ]
        if camera.sensor is None:
            continue
        size = dict(zip(("cx", "cy"), camera.sensor, strict=True))
        warnings += [
            f"camera {k}: {name} is known to ± {sigma[f'{name}{k}']:.1f} px only; a stronger tilt and roll "
            "of the target would settle it (with a long lens it is correlated with the pose)"
            for name in size
            if name in free and sigma[f"{name}{k}"] > 0.02 * size[name]
        ]
    return tuple(warnings)


Z_PAIR, TIMES = 6.0, 2.0
"""A bad pair has an rms residual above both limits. The first limit is this number of robust standard
deviations above the median of the pairs. The second is this multiple of the median. The first limit alone
would reject the worst of very similar pictures. The second alone would reject the blurred pictures of a mixed
set."""
Z_POINT = 7.0
"""A point is rejected if its residual exceeds this many robust standard deviations of its view."""
REWEIGHTINGS = 4
"""Number of reweighting rounds before any pair is rejected."""
LEAST_PAIRS = 4
"""Smallest number of pairs for the rejection of bad pairs."""


@dataclass(frozen=True)
class Verdicts:
    """Used and rejected pairs and points."""

    good: list[View]
    """Views with the points used."""
    used: dict[tuple[int, int], NDArray[np.bool_]]
    """Mask of the used points of a view, by (pair, camera)."""
    bad: dict[int, str]
    """Pair -> reason why it was left out."""


def _solve_without_bad(
    rig: Rig, views: Sequence[View], columns: tuple[FloatArray, FloatArray], *, reject: bool
) -> tuple[Fit, Verdicts]:
    """Least-squares solution for the consistent pairs and points."""
    pairs = _group_by_pair([s for s in views if s.pair in rig.poses])
    bad: dict[int, str] = {}
    if reject:
        first = {pair: rms(rig, views) for pair, views in pairs.items()}
        # The start is rough, so only extreme outliers are left out here. They are checked again below.
        limit = 10.0 * float(np.median(list(first.values()))) + 1.0
        bad = {pair: "" for pair, value in first.items() if value > limit}
    fit = _solve(rig, pairs, bad, columns[0])
    if reject and len(pairs) >= LEAST_PAIRS:
        fit, bad = _robust(fit, pairs, bad, columns[1])
    for _ in range(len(pairs)):
        fit = _solve(fit.rig, pairs, bad, columns[1])
        if not reject:
            break
        errors = {pair: _error(fit, views, pair in bad) for pair, views in pairs.items()}
        now = _judge(errors, bad)
        if set(now) == set(bad):
            bad = now
            break
        bad = now
    used = _points(fit, pairs, bad, reject)
    good = [only(s, used[s.pair, s.camera]) for p, views in pairs.items() if p not in bad for s in views]
    fit = adjust(fit.rig, good, columns[1], damping=HARDLY)
    poses = dict(fit.rig.poses)
    for pair in bad:
        poses[pair] = _fit_pose(fit.rig, pairs[pair]).rig.poses[pair]
    return Fit(
        Rig(fit.rig.cameras, poses), fit.covariance, fit.chi2, fit.freedom, fit.pose_covariance
    ), Verdicts(good, used, bad)


def _solve(rig: Rig, pairs: dict[int, list[View]], bad: dict[int, str], columns: FloatArray) -> Fit:
    good = [s for pair, views in pairs.items() if pair not in bad for s in views]
    if not any(len(views) == 2 for pair, views in pairs.items() if pair not in bad):
        raise Undetermined("no pair in which both cameras saw the target agrees with the others")
    return adjust(rig, good, columns, tolerance=1e-5)


def _robust(
    fit: Fit, pairs: dict[int, list[View]], bad: dict[int, str], columns: FloatArray
) -> tuple[Fit, dict[int, str]]:
    """Cameras, and the pairs that do not fit, by iteratively reweighted least squares with Cauchy's weights
    1 / (1 + (e / m)²) of a pair with the rms residual e, m the median of all pairs."""
    weights = dict.fromkeys(pairs, 1.0)
    for _ in range(REWEIGHTINGS):
        views = [
            replace(s, sigma=s.sigma / np.sqrt(weights[pair]))
            for pair, views in pairs.items()
            if pair not in bad
            for s in views
        ]
        fit = adjust(fit.rig, views, columns, tolerance=1e-4)
        errors = {pair: _error(fit, views, pair in bad) for pair, views in pairs.items()}
        median = float(np.median(list(errors.values())))
        weights = {pair: 1.0 / (1.0 + (value / median) ** 2) for pair, value in errors.items()}
    limit = _limit(list(errors.values()))[0]
    return fit, {pair: "" for pair, value in errors.items() if value > limit}


def _limit(errors: Sequence[float]) -> tuple[float, float]:
    """Rms residual above which a pair is bad, and the median [px]."""
    median = float(np.median(errors))
    spread = MAD * float(np.median(np.abs(np.array(errors) - median)))
    return max(median + Z_PAIR * spread, TIMES * median), median


def _error(fit: Fit, views: list[View], out: bool) -> float:
    """Rms residual of a pair [px]; ``out``: the pair was not used, so its pose is adjusted first."""
    return rms(_fit_pose(fit.rig, views).rig if out else fit.rig, views)


def _judge(errors: dict[int, float], bad: dict[int, str]) -> dict[int, str]:
    """Bad pairs: rejected pairs that still do not fit, and the worst of the used pairs if it does not fit."""
    if len(errors) < LEAST_PAIRS:
        return {}
    limit, median = _limit([value for pair, value in errors.items() if pair not in bad])

    def reason(value: float) -> str:
        return (
            f"rms residual {value:.3g} px with the cameras of the other pairs, median of these "
            f"{median:.3g} px, limit {limit:.3g} px"
        )

    now = {pair: reason(errors[pair]) for pair in bad if errors[pair] > limit}
    worst = max((pair for pair in errors if pair not in bad), key=lambda pair: errors[pair])
    if errors[worst] > limit:
        now[worst] = reason(errors[worst])
    return now


def _points(
    fit: Fit, pairs: dict[int, list[View]], bad: dict[int, str], reject: bool
) -> dict[tuple[int, int], NDArray[np.bool_]]:
    """Mask of the used points for each view."""
    used = {}
    for pair, views in pairs.items():
        for view in views:
            off = np.hypot(*residuals(fit.rig, view).T)
            # The median length of a plane Gaussian vector is 1.1774 of its coordinates' sigma.
            limit = Z_POINT * float(np.median(off)) / 1.1774
            near = off <= limit if reject else np.ones(len(off), dtype=bool)
            used[pair, view.camera] = near & (pair not in bad)
    return used


CameraDetections = Detection | TargetNotFound | PictureError | None
Size = tuple[int, int]

MODELS: dict[str, tuple[str, ...]] = {
    "none": (),
    "k1": ("k1",),
    "k1 k2": ("k1", "k2"),
    "k1 k2 k3": ("k1", "k2", "k3"),
    "k1 p1 p2": ("k1", "p1", "p2"),
    "k1 k2 p1 p2": ("k1", "k2", "p1", "p2"),
    "k1 k2 p1 p2 k3": ("k1", "k2", "p1", "p2", "k3"),
}
"""Distortion models: the adjusted coefficients; all others are zero."""


def calibrate(
    views0: Sequence[CameraDetections],
    views1: Sequence[CameraDetections],
    target: Target | Sequence[Target],
    *,
    sensors: tuple[Size, Size],
    distortion: str = "k1 k2",
    square_pixels: bool = False,
    skew: bool = False,
    names: Sequence[str] | None = None,
    reject: bool = True,
    folds: int = 5,
    predict: bool = True,
) -> Calibration:
    """Calibrate two cameras from pairs of pictures of a target: parameters, relative pose and covariance.

    All points of all pairs are adjusted together (`dic.calibration.bundle`). A pair that only one camera saw
    is used for that camera. Pairs that are inconsistent with the others are left out with a reason. Outlying
    points are left out too.

    Parameters
    ----------
    views0, views1
        Detections of camera 0 and camera 1, one entry per pair. An entry is a `Detection`, the
        `TargetNotFound` of a failed detection, the `PictureError` of an unusable picture, or None without a
        picture.
    target
        The target, or one target for each pair.
    sensors
        Columns and rows of the two cameras' calibration pictures [px]. For test pictures cropped from the
        same sensor use ``calibration.rig.cropped``.
    distortion
        A key of `MODELS`.
    square_pixels
        Adjust one focal length per camera, fx = fy.
    skew
        Also adjust the shear of the pixel grid.
    names
        Names of the pairs for the report; their numbers if not given.
    reject
        Reject bad pairs and points; False keeps all.
    folds
        Number of parts for the cross-validation with held-out pairs; 0: no cross-validation.
    predict
        Check the calibration with held-out pairs and distances on the target. False: only the cameras are
        computed, and the `Checks` are NaN.

    Raises
    ------
    dic.calibration.bundle.Undetermined
        If the pictures do not determine the requested parameters.
    ValueError
        If lists have different lengths, or the distortion model is unknown.
    """
    n = len(views0)
    targets = list(target) if isinstance(target, Sequence) else [target] * n
    names = [str(k) for k in range(n)] if names is None else list(names)
    if not len(views1) == len(targets) == len(names) == n:
        raise ValueError(
            f"views0, views1, targets and names must be equally many, got {n}, {len(views1)}, "
            f"{len(targets)}, {len(names)}"
        )
    if distortion not in MODELS:
        raise ValueError(f"distortion must be one of {', '.join(map(repr, MODELS))}, got {distortion!r}")
    free = ("fx", "fy", "cx", "cy", *(("skew",) if skew else ()), *MODELS[distortion])
    views = all_views((views0, views1), targets)
    rig, chosen = start(sensors, views)
    rough = free_columns(("fx", "fy"), square_pixels=True, relative=True)
    columns = free_columns(free, square_pixels=square_pixels, relative=True)
    fit, verdicts = _solve_without_bad(rig, list(chosen.values()), (rough, columns), reject=reject)

    good = verdicts.good
    together = clustering(fit, good, columns)
    calibrated = StereoRig(fit.rig.cameras, fit.covariance * fit.unit**2 * max(1.0, together))
    off = np.concatenate([finished_view(fit.rig, s, np.ones(len(s.ids), dtype=bool)).residual for s in good])
    ratio, ratio_sigma, shape = distances(fit.rig, good) if predict else 3 * (float("nan"),)
    return Calibration(
        rig=calibrated,
        free=tuple(name for name in PARAMETERS if name in free),
        pairs=tuple(
            _pair(k, name, (views0[k], views1[k]), chosen, fit, verdicts) for k, name in enumerate(names)
        ),
        unit=fit.unit,
        clustering=together,
        freedom=fit.freedom,
        checks=Checks(
            fit_rms=float(np.sqrt(np.mean(np.sum(off**2, axis=1)))),
            held_out_rms=cross_validation_error(fit, good, columns, folds if predict else 0),
            folds=folds if predict else 0,
            distance_ratio=ratio,
            distance_sigma=ratio_sigma,
            distance_rms=shape,
        ),
        advice=advice(calibrated, free),
    )


def _message(view: TargetNotFound | PictureError | None) -> str:
    """Reason why there is no detection."""
    if view is None:
        return "no picture"
    return f"the picture cannot be used: {view}" if isinstance(view, PictureError) else str(view)


def _pair(
    k: int,
    name: str,
    views: tuple[CameraDetections, CameraDetections],
    chosen: dict[tuple[int, int], View],
    fit: Fit,
    verdicts: Verdicts,
) -> Pair:
    """The record of one pair."""
    missing = [
        f"camera {camera}: {_message(view)}"
        for camera, view in enumerate(views)
        if not isinstance(view, Detection)
    ]
    unusable = any(isinstance(view, PictureError) for view in views)
    if k not in fit.rig.poses:
        cause = "; ".join(missing) or "no pose of the target explains what is seen"
        return Pair(name, PairOutcome.NOT_FOUND, cause, (None, None), None, None, unusable)
    parts: list[PairView | None] = []
    for camera in (0, 1):
        view = chosen.get((k, camera))
        if view is None:
            parts.append(None)
        else:
            used = verdicts.used.get((k, camera), np.zeros(len(view.ids), dtype=bool))
            parts.append(finished_view(fit.rig, replace(view), used))
    R, t = fit.rig.poses[k]
    outcome, reason = PairOutcome.VALID, ""
    if k in verdicts.bad:
        outcome, reason = PairOutcome.INCONSISTENT, verdicts.bad[k]
    elif missing:
        outcome, reason = PairOutcome.ONE_CAMERA, "; ".join(missing)
    return Pair(name, outcome, reason, (parts[0], parts[1]), R, t, unusable)
