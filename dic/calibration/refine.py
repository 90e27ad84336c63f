"""Corrections of a calibration: relative pose refined from matched points, order of picture pairs.

The rays of a matched point must meet. The relative pose minimises the epipolar distances robustly, Eq. (CC.5)
of docs/theory/pictures.md; the calibration's covariance is the prior. The length of the baseline is not
observable and is kept. `Refinement.helps` checks the result on points that were not fitted. For the order of
picture pairs, the target's poses in camera 0 predict its positions in camera 1. The order with the most
correct predictions is chosen.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares, linear_sum_assignment

from dic.basics import BoolArray, FloatArray
from dic.calibration.bundle import Pose, View, exponential
from dic.calibration.solve import focal_start, in_camera_1, relative, resection
from dic.calibration.views import all_views
from dic.camera import Camera, StereoRig
from dic.correlation import Correlation, Noise
from dic.stereo.epipolar_search import StereoGates
from dic.stereo.geometry import Rays, epipolar_sigma, slopes_between
from dic.stereo.match import match_stereo

LEAST_POINTS = 40
"""Smallest number of points for a refinement."""
MOST_POINTS = 400
"""Largest number of points that are matched for it."""
GATE = 5.0
"""Largest epipolar distance of a match for the refinement [px]."""
LEAST_GAIN = 0.2
"""Smallest relative decrease of the median distance of held-out points [-]."""
SHARE = 0.6745
"""Median absolute value of a standard normal variable."""


@dataclass(frozen=True)
class Refinement:
    """A relative pose that fits the matched points, and the evidence for it."""

    rig: StereoRig
    """The cameras with the refined pose; camera 0's pose and the intrinsic parameters are unchanged."""
    turn: FloatArray
    """Rotation of camera 1 relative to the calibration [rad], shape [3]."""
    tilt: FloatArray
    """Change of the direction of the baseline, along two axes across it [rad], shape [2]."""
    covariance: FloatArray
    """Covariance of turn and tilt [rad²], shape [5, 5]."""
    before: float
    """Median absolute epipolar distance with the original calibration [px]."""
    after: float
    """The same with the refined pose [px]."""
    held_out_before: float
    """Median absolute epipolar distance of held-out points with the original calibration [px]."""
    held_out_after: float
    """The same with the poses fitted to the other points [px]."""
    n_points: int
    """Number of points in the fit."""

    @property
    def helps(self) -> bool:
        """True if the distances of held-out points decrease by `LEAST_GAIN` or more."""
        return self.held_out_after <= (1.0 - LEAST_GAIN) * self.held_out_before

    @property
    def words(self) -> dict[str, object]:
        """The values as JSON types."""
        return {
            "points": self.n_points,
            "epipolar_median_before_px": self.before,
            "epipolar_median_after_px": self.after,
            "held_out_before_px": self.held_out_before,
            "held_out_after_px": self.held_out_after,
            "turn_mrad": (1e3 * self.turn).tolist(),
            "baseline_tilt_mrad": (1e3 * self.tilt).tolist(),
            "helps": self.helps,
        }


def refine(rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray, sigma: FloatArray) -> Refinement:
    """Refine the relative pose from matched points.

    ``rig``: the cameras; their covariance, if it is known, is the prior. ``pixels0``, ``pixels1``: the same
    points in both pictures [px], shape [n, 2]. ``sigma``: standard deviations of their epipolar distances
    [px], shape [n]. Raises ValueError if there are fewer than `LEAST_POINTS` points, if shapes do not match,
    or if a sigma is not positive.
    """
    n = len(pixels0)
    if n < LEAST_POINTS or pixels1.shape != pixels0.shape or np.shape(sigma) != (n,):
        raise ValueError(
            f"a refinement needs {LEAST_POINTS} pairs of points and a sigma each, got shapes "
            f"{pixels0.shape}, {pixels1.shape} and {np.shape(sigma)}"
        )
    if not np.all(sigma > 0.0):
        raise ValueError("every sigma must be positive")
    aims = [  # only the pose changes, so pixels are undistorted once
        Rays.of(camera, pixels) for camera, pixels in zip(rig.cameras, (pixels0, pixels1), strict=True)
    ]

    def signed(x: FloatArray, rows: NDArray[np.int64]) -> FloatArray:
        """Epipolar distances of some of the points [px]."""
        first, second = (Rays(aim.x[rows], aim.slope[rows]) for aim in aims)
        return slopes_between(turn_rig(rig, x), first, second)[0]

    def fitted(rows: NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
        """Turn and tilt for some of the points, and their covariance."""

        def residuals(x: FloatArray) -> FloatArray:
            d = signed(x, rows) / sigma[rows]
            robust = np.sign(d) * np.sqrt(2.0 * (np.sqrt(1.0 + d * d) - 1.0))
            return np.concatenate([robust, prior @ x])

        solution = least_squares(residuals, np.zeros(5), x_scale=1e-4, method="lm")
        return solution.x, np.linalg.inv(solution.jac.T @ solution.jac)

    def distances(x: FloatArray, rows: NDArray[np.int64]) -> FloatArray:
        return np.abs(signed(x, rows))

    every = np.arange(n)
    first, second = rig.cameras
    now = float(np.median(np.abs(signed(np.zeros(5), every))))
    prior = prior_root(rig, now / SHARE / (0.5 * (first.fx + second.fx)))
    parts = [every[k::2] for k in (0, 1)]
    cross_checked = [(distances(np.zeros(5), b), distances(fitted(a)[0], b)) for a, b in (parts, parts[::-1])]
    x, covariance = fitted(every)
    return Refinement(
        rig=turn_rig(rig, x),
        turn=x[:3],
        tilt=x[3:],
        covariance=covariance,
        before=float(np.median(distances(np.zeros(5), every))),
        after=float(np.median(distances(x, every))),
        held_out_before=float(np.median(np.concatenate([one[0] for one in cross_checked]))),
        held_out_after=float(np.median(np.concatenate([one[1] for one in cross_checked]))),
        n_points=n,
    )


def turn_rig(rig: StereoRig, x: FloatArray) -> StereoRig:
    """The rig with camera 1 rotated by x[:3] and the baseline tilted by x[3:]; its length is unchanged."""
    R, t = rig.relative
    length = float(np.linalg.norm(t))
    direction = t / length + baseline_normals(t) @ x[3:]
    R, t = exponential(x[:3]) @ R, length * direction / np.linalg.norm(direction)
    first, second = rig.cameras
    u, _, v = np.linalg.svd(R @ first.rotation)  # removes the rounding error of the rotation
    second = replace(second, rotation=u @ v, translation=t + R @ first.translation)
    return replace(rig, cameras=(first, second))


def baseline_normals(t: FloatArray) -> FloatArray:
    """Two unit vectors perpendicular to a baseline, as columns, shape [3, 2]."""
    return np.asarray(np.linalg.svd(t[None])[2][1:].T)


def prior_root(rig: StereoRig, since: float) -> FloatArray:
    """A root A of the prior: AᵀA is the inverse covariance of turns and tilts, shape [5, 5]."""
    C = max(since, 1e-9) ** 2 * np.eye(5)
    if rig.covariance is not None:
        _, t = rig.relative
        J = np.zeros((5, 6))
        J[:3, :3] = np.eye(3)
        J[3:, 3:] = baseline_normals(t).T / np.linalg.norm(t)
        C = C + J @ rig.covariance[-6:, -6:] @ J.T
    return np.asarray(np.linalg.inv(np.linalg.cholesky(C)))


def refine_from_pictures(
    pictures: tuple[NDArray[np.generic], NDArray[np.generic]],
    rig: StereoRig,
    points: FloatArray,
    settings: Correlation,
    *,
    noise: tuple[Noise, Noise],
    mask: BoolArray | None = None,
    device: str = "cpu",
) -> Refinement:
    """Match points of one pair of pictures with a wide epipolar gate. Refine the pose from them.

    ``pictures``: pictures of camera 0 and camera 1 at one instant, each of shape [rows, columns]. ``points``:
    positions in camera 0's picture [px], shape [n, 2]; about `MOST_POINTS` of them are matched. ``mask``:
    pixels of the body in camera 0's picture. Raises ValueError as `refine`, if too few points are matched.
    """
    rows = np.unique(np.linspace(0, len(points) - 1, MOST_POINTS).astype(int))
    match = match_stereo(
        *pictures,
        points[rows],
        rig,
        settings,
        noise=noise,
        mask=mask,
        gates=StereoGates(epipolar=GATE),
        device=device,
    )
    valid = match.valid
    pixels = (points[rows][valid], points[rows][valid] + match.warp[valid, :2])
    sigma = epipolar_sigma(rig, *pixels, np.zeros((2, 2)), match.covariance[valid])
    return refine(rig, *pixels, sigma)


MOST_FIRST = 4
"""Number of pictures of camera 0 for which all partners are tried."""
NEAR = 0.03
"""Largest distance of agreeing positions, over the picture's longer side [-]."""
LEAST_SHARE = 0.8
"""Smallest share of the pictures that must have a partner."""


def find_order(
    detections: tuple[Sequence[object], Sequence[object]],
    targets: Sequence[object],
    sensors: tuple[tuple[int, int], tuple[int, int]],
) -> list[int] | None:
    """Find the picture of camera 1 that belongs to each picture of camera 0.

    ``detections``: detections of each camera, one entry per picture, as for `dic.calibrate`; equal numbers
    for both. ``sensors``: columns and rows of the two cameras' pictures [px]. Returns: the picture of camera
    1 for each one of camera 0, each used once; pictures without a detection get the remaining ones. None if
    no order fits `LEAST_SHARE` of them.
    """
    views = all_views(detections, targets)  # type: ignore[arg-type]
    by_camera: list[dict[int, View]] = [
        {k: v[0] for (k, c), v in views.items() if c == camera} for camera in (0, 1)
    ]
    if min(len(by_camera[0]), len(by_camera[1])) < 3:
        return None
    cameras = [focal_start(sensors[c], [view for _, view in sorted(by_camera[c].items())]) for c in (0, 1)]
    poses = [{k: resection(cameras[c], view) for k, view in by_camera[c].items()} for c in (0, 1)]
    first, second = ([k for k in sorted(p) if p[k]] for p in poses)
    if not first or not second:
        return None
    centres = np.array([by_camera[1][j].pixels.mean(axis=0) for j in second])
    limit = NEAR * max(sensors[1])
    best: tuple[int, float, FloatArray, FloatArray] | None = None
    for i in first[:MOST_FIRST]:
        for j in second:
            for p in poses[0][i]:
                for q in poses[1][j]:
                    places = _places(relative(p, q), cameras[1], poses[0], by_camera[0], first)
                    away = np.linalg.norm(places[:, None] - centres, axis=2)
                    rows, columns = linear_sum_assignment(np.minimum(away, limit))
                    near = away[rows, columns] < limit
                    score = (int(near.sum()), -float(away[rows, columns][near].sum()))
                    if best is None or score > best[:2]:
                        best = (*score, rows[near], columns[near])
    if best is None or best[0] < LEAST_SHARE * min(len(first), len(second)):
        return None
    order = {first[r]: second[c] for r, c in zip(best[2], best[3], strict=True)}
    unpaired = [j for j in range(len(detections[1])) if j not in order.values()]
    return [order[k] if k in order else unpaired.pop(0) for k in range(len(detections[0]))]


def _places(
    rel: Pose,
    camera: Camera,
    poses: Mapping[int, list[Pose]],
    views: Mapping[int, View],
    indices: Sequence[int],
) -> FloatArray:
    """Predicted positions in camera 1 of the target's centre in camera 0's pictures [px], shape [n, 2]."""
    middles = np.array([poses[k][0][0] @ views[k].points.mean(axis=0) + poses[k][0][1] for k in indices])
    relative_pose, camera = in_camera_1((np.eye(3), np.zeros(3)), rel), replace(camera, rotation=np.eye(3))
    return np.asarray(camera.project(middles @ relative_pose[0].T + relative_pose[1]))
