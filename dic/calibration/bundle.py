"""Bundle adjustment of two cameras and the target's poses, with exact covariance.

Least squares over all points of all pictures, weighted with their sigma, by Levenberg and Marquardt's
method. Every pose is seen in its own pictures only, so the poses are eliminated pair by pair (Schur's
complement) and the system that is solved has the size of the rig's parameters [Triggs2000]_.

.. [Triggs2000] B. Triggs, P. McLauchlan, R. Hartley, A. Fitzgibbon, Bundle adjustment - a modern synthesis,
   in Vision Algorithms: Theory and Practice, Springer, 2000, doi:10.1007/3-540-44480-7_21.
"""

from collections.abc import Iterable

import numpy as np

from dic.arrays import FloatArray
from dic.calibration.projection import SHARED, View, derivatives, joined, poses_of, seen
from dic.calibration.rig_state import Fit, Rig, Undetermined, moved
from dic.camera import PARAMETERS

MOST_STEPS = 100
DAMPED, HARDLY = 1e-4, 1e-12
"""Damping of the first step, from a start somewhere near the solution and from one that is all but it."""
ROUGH = 1e-8
"""A relative tolerance that is no less asks for no more than the way to the valley."""
SMALL = 3
"""Steps in a row without a gain: one alone may be short because of its damping, in a long, bent valley."""
FAR = 1e6
"""Residuals, over their sigma, of a trial that puts a point behind a camera."""


def adjust(
    rig: Rig,
    views: Iterable[View],
    columns: FloatArray,
    *,
    tolerance: float = 1e-10,
    damping: float = DAMPED,
) -> Fit:
    """The least squares over all views, from a start near enough.

    Parameters
    ----------
    rig
        The start; poses that no view asks for stay as they are.
    views
        What was seen.
    columns
        What is adjusted (`free_columns`), beside the poses.
    tolerance
        Relative decrease of the sum of squares at which the search ends.
    damping
        Of the first step.

    Raises
    ------
    Undetermined
        Fewer numbers measured than adjusted, or a combination of parameters that no picture depends on.
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
                trial = moved(rig, columns @ step[0], step[1])
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
    """Factor on variances for residuals that hang together within a pair.

    With g_p the pull of pair p on the parameters (its part of Jᵀ r, the pose eliminated) and S = Jᵀ J,

        F = Σ g_pᵀ S⁻¹ g_p / (s² m) · P / (P - 1)                                                   (C.4)

    for P pairs and m parameters: 1 on average if residuals are independent, more if those of a picture hang
    together (a bent target, a lens model too simple), when their number says more than they know
    [Moulton1986]_.

    .. [Moulton1986] B. R. Moulton, Random group effects and the precision of regression estimates, J. of
       Econometrics 32 (1986) 385-397, doi:10.1016/0304-4076(86)90021-7.
    """
    pairs: dict[int, list[View]] = {}
    for view in views:
        pairs.setdefault(view.pair, []).append(view)
    if len(pairs) < 2 or not columns.shape[1] or fit.unit == 0.0:
        return 1.0
    S, pulls = np.zeros((columns.shape[1],) * 2), []
    for pair, own in pairs.items():
        cameras = _by_camera(own)
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
    """U, its right side, and of each pair V, W and its right side; `off` is what `_weighted` says."""
    m = columns.shape[1]
    U, b = np.zeros((m, m)), np.zeros(m)
    pairs: dict[int, tuple[FloatArray, FloatArray, FloatArray]] = {}
    for (own, view), r in zip(cameras, off, strict=True):
        shared, pose = derivatives(rig.cameras[view.camera], view, *poses_of(own, rig.poses))
        weight = np.repeat(1.0 / view.sigma, 2)[:, None]
        A = weight * (shared.reshape(-1, SHARED) @ columns)
        P = weight * pose.reshape(-1, 6)
        U += A.T @ A
        b += A.T @ r
        last = 0
        for one in own:
            first, last = last, last + 2 * len(one.ids)
            A_own, P_own, r_own = A[first:last], P[first:last], r[first:last]
            V, W, c = pairs.get(one.pair, (0.0, 0.0, 0.0))
            pairs[one.pair] = (V + P_own.T @ P_own, W + A_own.T @ P_own, c + P_own.T @ r_own)
    return U, b, pairs


def _by_camera(views: list[View]) -> list[OneCamera]:
    """The views of each camera that has some, one by one and as one."""
    parts = [[view for view in views if view.camera == camera] for camera in (0, 1)]
    return [(part, joined(part)) for part in parts if part]


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
    """Residuals of each camera over their sigma, x and y in turn, and the sum of their squares."""
    off, total = [], 0.0
    for own, view in cameras:
        expected = seen(rig.cameras[view.camera], view, *poses_of(own, rig.poses))
        off.append(((view.pixels - expected) / view.sigma[:, None]).reshape(-1))
        total += float(np.sum(np.where(np.isfinite(off[-1]), off[-1], FAR) ** 2))
    return off, total
