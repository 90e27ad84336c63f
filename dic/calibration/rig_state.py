"""State of a calibration of two cameras: rig and poses of the target, its parameters, a step of them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from dic.arrays import FloatArray
from dic.calibration.projection import OWN, SHARED, View, exponential, seen
from dic.camera import PARAMETERS, Camera

Pose = tuple[FloatArray, FloatArray]


class Undetermined(ValueError):
    """The pictures do not determine the parameters asked for."""


@dataclass(frozen=True)
class Rig:
    """The state of the solve: two cameras, camera 0 at the origin, and the target's pose in each pair."""

    cameras: tuple[Camera, Camera]
    poses: Mapping[int, Pose]


@dataclass(frozen=True)
class Fit:
    """A minimum."""

    rig: Rig
    covariance: FloatArray
    """Of the rig's parameters for residuals of unit variance, shape [SHARED, SHARED]."""
    chi2: float
    """Sum of the squares of the residuals over their sigma."""
    freedom: int
    """Numbers measured less numbers adjusted."""
    pose_covariance: Mapping[int, FloatArray]
    """Of each pose, for residuals of unit variance, shape [6, 6]."""

    @property
    def unit(self) -> float:
        """Root of the variance of unit weight: 1 if the points' sigma say all."""
        return float(np.sqrt(self.chi2 / max(self.freedom, 1)))


def free_columns(free: Iterable[str], *, square_pixels: bool, relative: bool) -> FloatArray:
    """From the numbers adjusted to the rig's parameters, shape [SHARED, m].

    Parameters
    ----------
    free
        Names of `PARAMETERS` that are adjusted, in both cameras.
    square_pixels
        Whether fx and fy are one number.
    relative
        Whether the relative pose is adjusted.
    """
    columns = []
    names = list(free)
    for camera in (0, 1):
        for name in names:
            if name == "fy" and square_pixels:
                continue
            column = np.zeros(SHARED)
            column[camera * OWN + PARAMETERS.index(name)] = 1.0
            if name == "fx" and square_pixels:
                column[camera * OWN + PARAMETERS.index("fy")] = 1.0
            columns.append(column)
    for k in range(6 * relative):
        column = np.zeros(SHARED)
        column[2 * OWN + k] = 1.0
        columns.append(column)
    return np.stack(columns, axis=1) if columns else np.zeros((SHARED, 0))


def residuals(rig: Rig, view: View) -> FloatArray:
    """Seen less expected [px], shape [n, 2]."""
    R, t = rig.poses[view.pair]
    return np.asarray(view.pixels - seen(rig.cameras[view.camera], view, R, t))


def moved(rig: Rig, shared: FloatArray, poses: Mapping[int, FloatArray]) -> Rig:
    """The state after a step."""
    cameras = []
    for k, camera in enumerate(rig.cameras):
        own = shared[k * OWN : (k + 1) * OWN]
        R, t = camera.rotation, camera.translation
        if k == 1:
            turn = shared[2 * OWN : 2 * OWN + 3]
            R, t = _orthonormal(exponential(turn) @ R), t + shared[2 * OWN + 3 :]
        cameras.append(
            replace(
                camera,
                fx=camera.fx + own[0],
                fy=camera.fy + own[1],
                cx=camera.cx + own[2],
                cy=camera.cy + own[3],
                skew=camera.skew + own[4],
                distortion=tuple(np.add(camera.distortion, own[5:]).tolist()),
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
