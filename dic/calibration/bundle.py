"""Bundle adjustment of two cameras and the target's poses, with exact covariance.

Weighted least squares over all points of all pictures by Levenberg and Marquardt's method. The poses are
eliminated pair by pair (Schur's complement; Triggs et al. 2000, doi:10.1007/3-540-44480-7_21). The image of a
dot is an ellipse, whose centre has a closed form (Heikkilä 2000, doi:10.1109/34.879788). A curved target adds
a shift. See Eqs. (CC.1) and (CC.2) of docs/theory/pictures.md. A patch with the second moment s per axis is
treated as a disc of r² = 4 s. A ring has s = (r² + h²)/4, a square has a²/12.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dic.basics import FloatArray
from dic.camera import PARAMETERS, POSE, Camera

CAMERA_PARAMETERS = len(PARAMETERS)
SHARED_PARAMETERS = 2 * CAMERA_PARAMETERS + len(POSE)
"""Parameters of a rig, in the order of `StereoRig.parameter_names`."""


@dataclass(frozen=True)
class View:
    """Points of the target in one camera's picture of one pair."""

    pair: int
    camera: int
    """0 or 1."""
    ids: NDArray[np.int64]
    """Numbers of the points, shape [n]."""
    points: FloatArray
    """Their positions on the target [m], shape [n, 3]."""
    normals: FloatArray
    """Their normals, shape [n, 3]."""
    spread: FloatArray
    """Their second moments [m²], shape [n]."""
    bend: FloatArray
    """Directions of the surface's curvature times the root of the curvature [m^-½], shape [n, 3]."""
    pixels: FloatArray
    """Observed pixels [px], shape [n, 2]."""
    sigma: FloatArray
    """Standard deviations of the coordinates [px], shape [n]."""


def exponential(r: FloatArray) -> FloatArray:
    """Rotation about r by the angle |r| [rad], shape [3, 3]."""
    angle = float(np.linalg.norm(r))
    K = np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])
    a = np.sinc(angle / np.pi)
    b = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    return np.asarray(np.eye(3) + a * K + b * K @ K)


def crossed(v: FloatArray, rows: FloatArray) -> FloatArray:
    """Cross products v x w of each v with the w in its rows, shape [n, m, 3]; three times as fast as
    `numpy.cross`."""
    (x, y, z), (a, b, c) = v.T[:, :, None], np.moveaxis(rows, 2, 0)
    product = np.empty(rows.shape)
    product[..., 0], product[..., 1], product[..., 2] = y * c - z * b, z * a - x * c, x * b - y * a
    return product


def centroids(inside: FloatArray, normals: FloatArray, spread: FloatArray) -> FloatArray:
    """Centroids on the plane z = 1 of patches in the camera's frame, Eq. (CC.1), shape [n, 2]."""
    z, nz, r2 = inside[:, 2], normals[:, 2], 4.0 * spread
    below = z * z - r2 * (1.0 - nz * nz)
    return np.asarray((inside[:, :2] * z[:, None] + (r2 * nz)[:, None] * normals[:, :2]) / below[:, None])


def _bent_middles(
    inside: FloatArray, normals: FloatArray, spread: FloatArray, bend: FloatArray
) -> FloatArray:
    """Centres of patches in the camera's frame, shifted by curvature, Eq. (CC.2) [m], shape [n, 3]."""
    oblique = np.sum(bend * inside, axis=1) / np.sum(normals * inside, axis=1)
    curvature = np.sum(bend * bend, axis=1)
    return np.asarray(
        inside + spread[:, None] * (oblique[:, None] * bend - 0.5 * curvature[:, None] * normals)
    )


def join_views(views: Sequence[View]) -> View:
    """Join several views of one camera to one view; `poses_of` gives the target's poses."""
    parts = {
        name: np.concatenate([getattr(view, name) for view in views])
        for name in ("ids", "points", "normals", "spread", "bend", "pixels", "sigma")
    }
    return View(pair=-1, camera=views[0].camera, **parts)


def poses_of(
    views: Sequence[View], poses: Mapping[int, tuple[FloatArray, FloatArray]]
) -> tuple[FloatArray, FloatArray]:
    """R and t of each point of joined views, for `project_points` and `derivatives`, [n, 3, 3] and [n, 3]."""
    count = [len(view.ids) for view in views]
    R, t = (np.repeat([poses[view.pair][k] for view in views], count, axis=0) for k in (0, 1))
    return R, t


def _turned(v: FloatArray, R: FloatArray) -> FloatArray:
    """R v for each row, shape [n, 3]; R of shape [3, 3] or one per row."""
    return np.asarray(v @ R.T if R.ndim == 2 else np.einsum("nij,nj->ni", R, v))


def project_points(
    camera: Camera, view: View, R: FloatArray, t: FloatArray, *, patches: bool = True
) -> FloatArray:
    """Pixels of a target's points in a camera, shape [n, 2]; NaN behind it.

    ``R``, ``t``: from the target's frame to the rig's, shapes [3, 3] and [3], or one per point. ``patches``:
    True for centroids of the patches, which are measured; False for the points themselves.
    """
    inside = camera.in_camera(_turned(view.points, R) + t)
    inside = np.where(inside[:, 2:] > 0.0, inside, np.nan)
    normals = _turned(view.normals, R) @ camera.rotation.T
    if patches and view.bend.any():
        inside = _bent_middles(inside, normals, view.spread, _turned(view.bend, R) @ camera.rotation.T)
    return camera.to_pixels(camera.distort(centroids(inside, normals, view.spread * patches)))


def derivatives(camera: Camera, view: View, R: FloatArray, t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Derivatives of `project_points` by the rig's parameters and by the target's pose.

    Changes of (CC.1) and (CC.2) with the pose are neglected. Relative to the other terms they are only (r/z)²
    and s κ/z.

    Returns: derivatives by the parameters, shape [n, 2, SHARED], in the order of `StereoRig.parameter_names`.
    Returns: derivatives by a small rotation applied after R, and by t, shape [n, 2, 6].
    """
    n = len(view.points)
    turned = _turned(view.points, R)
    first = turned + t
    inside = camera.in_camera(first)
    normals = _turned(view.normals, R) @ camera.rotation.T
    patch = inside
    if view.bend.any():
        patch = _bent_middles(inside, normals, view.spread, _turned(view.bend, R) @ camera.rotation.T)
    ideal = centroids(patch, normals, view.spread)
    plane = camera.distort(ideal)
    x, y = ideal.T
    r2 = x * x + y * y

    shared = np.zeros((n, 2, SHARED_PARAMETERS))
    by_camera = shared[:, :, view.camera * CAMERA_PARAMETERS : (view.camera + 1) * CAMERA_PARAMETERS]
    by_camera[:, 0, 0], by_camera[:, 1, 1] = plane[:, 0], plane[:, 1]
    by_camera[:, 0, 2] = by_camera[:, 1, 3] = 1.0
    by_camera[:, 0, 4] = plane[:, 1]
    lens = (
        (x * r2, y * r2),
        (x * r2**2, y * r2**2),
        (2 * x * y, r2 + 2 * y * y),
        (r2 + 2 * x * x, 2 * x * y),
        (x * r2**3, y * r2**3),
    )
    for k, (across, down) in enumerate(lens, start=5):
        by_camera[:, 0, k] = camera.fx * across + camera.skew * down
        by_camera[:, 1, k] = camera.fy * down

    z = inside[:, 2]
    perspective = np.zeros((n, 2, 3))
    perspective[:, 0, 0] = perspective[:, 1, 1] = 1.0 / z
    perspective[:, :, 2] = -inside[:, :2] / (z * z)[:, None]
    by_place = camera.matrix[:2, :2] @ camera.distortion_slope(ideal) @ perspective
    if view.camera == 1:
        shared[:, :, 2 * CAMERA_PARAMETERS : 2 * CAMERA_PARAMETERS + 3] = crossed(
            first @ camera.rotation.T, by_place
        )
        shared[:, :, 2 * CAMERA_PARAMETERS + 3 :] = by_place
        by_place = by_place @ camera.rotation
    pose = np.concatenate([crossed(turned, by_place), by_place], axis=2)
    return shared, pose


Pose = tuple[FloatArray, FloatArray]


class Undetermined(ValueError):
    """The pictures do not determine the requested parameters."""


@dataclass(frozen=True)
class Rig:
    """State of the solution: two cameras, camera 0 at the origin, and the target's pose in each pair."""

    cameras: tuple[Camera, Camera]
    poses: Mapping[int, Pose]


@dataclass(frozen=True)
class Fit:
    """Result of a bundle adjustment."""

    rig: Rig
    covariance: FloatArray
    """Covariance of the rig's parameters for residuals of unit variance, shape [SHARED, SHARED]."""
    chi2: float
    """Sum of squares of the residuals over their sigmas."""
    freedom: int
    """Degrees of freedom: number of measured coordinates minus adjusted parameters."""
    pose_covariance: Mapping[int, FloatArray]
    """Covariance of each pose for residuals of unit variance, shape [6, 6]."""

    @property
    def unit(self) -> float:
        """Root of the variance of unit weight: 1 if the points' sigmas explain the residuals."""
        return float(np.sqrt(self.chi2 / max(self.freedom, 1)))


def free_columns(free: Iterable[str], *, square_pixels: bool, relative: bool) -> FloatArray:
    """Matrix from the adjusted parameters to the rig's parameters, shape [SHARED, m].

    ``free``: names of `PARAMETERS` that are adjusted, in both cameras. ``square_pixels``: whether fx and fy
    are equal. ``relative``: whether the relative pose is adjusted.
    """
    columns = []
    names = list(free)
    for camera in (0, 1):
        for name in names:
            if name == "fy" and square_pixels:
                continue
            column = np.zeros(SHARED_PARAMETERS)
            column[camera * CAMERA_PARAMETERS + PARAMETERS.index(name)] = 1.0
            if name == "fx" and square_pixels:
                column[camera * CAMERA_PARAMETERS + PARAMETERS.index("fy")] = 1.0
            columns.append(column)
    for k in range(6 * relative):
        column = np.zeros(SHARED_PARAMETERS)
        column[2 * CAMERA_PARAMETERS + k] = 1.0
        columns.append(column)
    return np.stack(columns, axis=1) if columns else np.zeros((SHARED_PARAMETERS, 0))


def residuals(rig: Rig, view: View) -> FloatArray:
    """Observed minus predicted pixels [px], shape [n, 2]."""
    R, t = rig.poses[view.pair]
    return np.asarray(view.pixels - project_points(rig.cameras[view.camera], view, R, t))


def _step_rig(rig: Rig, shared: FloatArray, poses: Mapping[int, FloatArray]) -> Rig:
    """The state after a step."""
    cameras = []
    for k, camera in enumerate(rig.cameras):
        change = shared[k * CAMERA_PARAMETERS : (k + 1) * CAMERA_PARAMETERS]
        R, t = camera.rotation, camera.translation
        if k == 1:
            turn = shared[2 * CAMERA_PARAMETERS : 2 * CAMERA_PARAMETERS + 3]
            R, t = _orthonormal(exponential(turn) @ R), t + shared[2 * CAMERA_PARAMETERS + 3 :]
        cameras.append(
            replace(
                camera,
                fx=camera.fx + change[0],
                fy=camera.fy + change[1],
                cx=camera.cx + change[2],
                cy=camera.cy + change[3],
                skew=camera.skew + change[4],
                distortion=tuple(np.add(camera.distortion, change[5:]).tolist()),
                rotation=R,
                translation=t,
            )
        )
    new = dict(rig.poses)
    for pair, step in poses.items():
        R, t = rig.poses[pair]
        new[pair] = (_orthonormal(exponential(step[:3]) @ R), t + step[3:])
    return Rig((cameras[0], cameras[1]), new)


def _orthonormal(R: FloatArray) -> FloatArray:
    u, _, v = np.linalg.svd(R)
    return np.asarray(u @ v)


MOST_STEPS = 100
DAMPED, HARDLY = 1e-4, 1e-12
"""Damping of the first step, for a start near the solution and for one very close to it."""
ROUGH = 1e-8
"""With a relative tolerance of this value or more, the search ends once it is near the minimum."""
SMALL = 3
"""The search ends after this number of successive steps without gain. Damping may make a single step
short."""
FAR = 1e6
"""A trial with a point behind a camera gets these residuals [sigma]."""


def adjust(
    rig: Rig, views: Iterable[View], columns: FloatArray, *, tolerance: float = 1e-10, damping: float = DAMPED
) -> Fit:
    """Least-squares solution over all views, from a sufficiently close start.

    ``rig``: the start; poses without a view are not changed. ``views``: the observed points. ``columns``: the
    adjusted parameters (`free_columns`), in addition to the poses. ``tolerance``: relative decrease of the
    sum of squares at which the search ends. ``damping``: damping of the first step. Raises Undetermined if
    there are fewer measured coordinates than adjusted parameters, or if no picture depends on a combination
    of parameters.
    """
    views = list(views)
    pairs = sorted({view.pair for view in views})
    freedom = sum(2 * len(s.ids) for s in views) - columns.shape[1] - 6 * len(pairs)
    if freedom <= 0:
        raise Undetermined(
            f"{freedom + columns.shape[1] + 6 * len(pairs)} coordinates were measured, too few for "
            f"{columns.shape[1]} parameters and {len(pairs)} poses; take more pictures, or free fewer "
            "parameters"
        )
    cameras = _by_camera(views)
    off, cost = _weighted(rig, cameras)
    normal = _normal_equations(rig, cameras, columns, off)
    small = 0
    for _ in range(MOST_STEPS):
        step = _step(normal, damping)
        trial_cost = np.inf
        if step is not None:
            try:
                trial = _step_rig(rig, columns @ step[0], step[1])
                off, trial_cost = _weighted(trial, cameras)
            except (ValueError, FloatingPointError):  # a focal length below zero
                trial_cost = np.inf
        if trial_cost <= cost:
            gain = (cost - trial_cost) / max(cost, 1e-300)
            rig, cost, damping = trial, trial_cost, max(damping / 10.0, 1e-15)
            normal = _normal_equations(rig, cameras, columns, off)
            small = small + 1 if gain < tolerance else 0
            if small == (SMALL if tolerance < ROUGH else 1):
                break
        elif damping > 1e12:
            break
        else:
            damping *= 10.0
    covariance, poses = _covariances(normal, columns)
    return Fit(rig, covariance, cost, freedom, poses)


def clustering(fit: Fit, views: Iterable[View], columns: FloatArray) -> float:
    """Factor on variances for residuals that are correlated within a pair.

    With g_p the contribution of pair p to Jᵀ r (its pose eliminated) and S = Jᵀ J,

        F = Σ g_pᵀ S⁻¹ g_p / (s² m) · P / (P - 1)                                                  (CC.4)

    for P pairs and m parameters. F is 1 on average if residuals are independent. It is larger if the
    residuals of a picture are correlated, for example by a bent target or a too simple lens model. They then
    contain less information than their number suggests [Moulton1986]_.

    .. [Moulton1986] B. R. Moulton, Random group effects and the precision of regression estimates, J. of
       Econometrics 32 (1986) 385-397, doi:10.1016/0304-4076(86)90021-7.
    """
    pairs: dict[int, list[View]] = {}
    for view in views:
        pairs.setdefault(view.pair, []).append(view)
    if len(pairs) < 2 or not columns.shape[1] or fit.unit == 0.0:
        return 1.0
    S, pulls = np.zeros((columns.shape[1],) * 2), []
    for pair, views_of_pair in pairs.items():
        cameras = _by_camera(views_of_pair)
        U, b, parts = _normal_equations(fit.rig, cameras, columns, _weighted(fit.rig, cameras)[0])
        V, W, c = parts[pair]
        back = np.linalg.solve(V, np.column_stack([W.T, c]))
        S += U - W @ back[:, :-1]
        pulls.append(b - W @ back[:, -1])
    scale = 1.0 / np.sqrt(np.diag(S))
    g = np.array(pulls) * scale
    total = float(np.sum(g * np.linalg.solve(S * np.outer(scale, scale), g.T).T))
    return total / (fit.unit**2 * columns.shape[1]) * len(pulls) / (len(pulls) - 1)


OneCamera = tuple[list[View], View]
Normal = tuple[FloatArray, FloatArray, dict[int, tuple[FloatArray, FloatArray, FloatArray]]]


def _normal_equations(
    rig: Rig, cameras: list[OneCamera], columns: FloatArray, off: list[FloatArray]
) -> Normal:
    """U and its right side, and for each pair V, W and the right side. ``off``: residuals from
    `_weighted`."""
    m = columns.shape[1]
    U, b = np.zeros((m, m)), np.zeros(m)
    pairs: dict[int, tuple[FloatArray, FloatArray, FloatArray]] = {}
    for (group, view), r in zip(cameras, off, strict=True):
        shared, pose = derivatives(rig.cameras[view.camera], view, *poses_of(group, rig.poses))
        weight = np.repeat(1.0 / view.sigma, 2)[:, None]
        A = weight * (shared.reshape(-1, SHARED_PARAMETERS) @ columns)
        P = weight * pose.reshape(-1, 6)
        U += A.T @ A
        b += A.T @ r
        last = 0
        for one in group:
            first, last = last, last + 2 * len(one.ids)
            A_own, P_own, r_own = A[first:last], P[first:last], r[first:last]
            V, W, c = pairs.get(one.pair, (0.0, 0.0, 0.0))
            pairs[one.pair] = (V + P_own.T @ P_own, W + A_own.T @ P_own, c + P_own.T @ r_own)
    return U, b, pairs


def _by_camera(views: list[View]) -> list[OneCamera]:
    """The views of each camera with views, separately and joined."""
    parts = [[view for view in views if view.camera == camera] for camera in (0, 1)]
    return [(part, join_views(part)) for part in parts if part]


def _step(normal: Normal, damping: float) -> tuple[FloatArray, dict[int, FloatArray]] | None:
    """A damped Gauss-Newton step; None if its system cannot be solved."""
    U, b, pairs = normal
    S, right = U + damping * np.diag(np.diag(U)), b.copy()
    inverses = {}
    try:
        for pair, (V, W, c) in pairs.items():
            inverses[pair] = np.linalg.inv(V + damping * np.diag(np.diag(V)))
            S = S - W @ inverses[pair] @ W.T
            right = right - W @ inverses[pair] @ c
        scale = 1.0 / np.sqrt(np.maximum(np.diag(S), 1e-300))
        shared = scale * np.linalg.solve(S * np.outer(scale, scale), scale * right)
    except np.linalg.LinAlgError:
        return None
    return shared, {pair: inverses[pair] @ (c - W.T @ shared) for pair, (V, W, c) in pairs.items()}


def _covariances(normal: Normal, columns: FloatArray) -> tuple[FloatArray, dict[int, FloatArray]]:
    U, _, pairs = normal
    scale = 1.0 / np.sqrt(np.maximum(np.diag(U), 1e-300))
    S = U.copy()
    inverses = {}
    for pair, (V, W, _) in pairs.items():
        inverses[pair] = np.linalg.inv(V)
        S -= W @ inverses[pair] @ W.T
    S = 0.5 * (S + S.T) * np.outer(scale, scale)
    if len(S):
        values, vectors = np.linalg.eigh(S)
        if values[0] < 1e-13:
            worst = np.abs(columns @ (scale * vectors[:, 0]))
            names = [f"{n}{k}" for k in (0, 1) for n in PARAMETERS] + ["pose"] * 6
            raise Undetermined(
                f"the pictures do not determine {names[int(np.argmax(worst))]} together with the others; "
                "take pictures with the target tilted, rolled and spread over the field, or free fewer "
                "parameters"
            )
        C = np.outer(scale, scale) * (vectors / values @ vectors.T)
    else:
        C = np.zeros((0, 0))
    poses = {}
    for pair, (_, W, _) in pairs.items():
        back = inverses[pair] @ W.T
        poses[pair] = inverses[pair] + back @ C @ back.T
    return columns @ C @ columns.T, poses


def _weighted(rig: Rig, cameras: list[OneCamera]) -> tuple[list[FloatArray], float]:
    """Residuals of each camera over their sigmas, x and y alternating, and the sum of their squares."""
    off, total = [], 0.0
    for group, view in cameras:
        expected = project_points(rig.cameras[view.camera], view, *poses_of(group, rig.poses))
        off.append(((view.pixels - expected) / view.sigma[:, None]).reshape(-1))
        total += float(np.sum(np.where(np.isfinite(off[-1]), off[-1], FAR) ** 2))
    return off, total
