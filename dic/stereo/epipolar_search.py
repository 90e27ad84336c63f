"""Candidates for a stereo match: templates compared along the whole epipolar curve, in equal steps.

For each point the subset is laid on camera 1's picture at every step of its epipolar curve, deformed as a
facet there would be seen, and correlated (ZNCC). The best place is an initial guess; the best of all other
places is the *second peak*; their ratio says how unique it is. Nothing here starts from a neighbour or an
earlier match.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.camera import Camera, StereoRig
from dic.stereo.facet import distance_along, facet_geometry
from dic.stereo.kernels.launch import Curves
from dic.stereo.kernels.launch import search as search_kernel
from dic.stereo.template import Subsets, smoothed
from dic.stereo.triangulation import midpoint
from dic.stereo.visible import visible_piece

RANGE = 20.0
"""Nearest and farthest distance that a whole curve is walked through, over that of the crossing axes."""


def fold(camera: Camera) -> float:
    """Squared radius on the plane z = 1 at which a lens model begins to fold back [-]; inf if it does not.

    Parameters
    ----------
    camera
        The camera; the radius is that where r (1 + k1 r² + k2 r⁴ + k3 r⁶) turns.
    """
    k1, k2, _, _, k3 = camera.distortion
    turning = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
    real = (root.real for root in turning if abs(root.imag) < 1e-12 and root.real > 0.0)
    return float(min(real, default=np.inf))


class Candidates(NamedTuple):
    """The best place of each point on its epipolar curve, and how it compares with the others."""

    warp: FloatArray
    """Affine total warps to the best place, shape [n, 12]; NaN where the curve misses the picture."""
    zncc: FloatArray
    """Correlation there, shape [n]; -1 where the curve misses the picture."""
    second_peak: FloatArray
    """Largest correlation outside the best place's own peak, shape [n]; -1 if there is no other place."""
    distance: FloatArray
    """Of the best place along camera 0's ray [m], shape [n]."""


def search(
    rig: StereoRig,
    wanted: Subsets,
    picture1: NDArray[np.float32],
    *,
    limits: tuple[float, float] | None,
    turns: FloatArray | None = None,
    gradients: FloatArray | None = None,
    device: str = "cpu",
    threads: int | None = None,
) -> Candidates:
    """The best place of each subset on its epipolar curve, and the second peak.

    Parameters
    ----------
    rig
        The cameras.
    wanted
        What to look for.
    picture1
        Camera 1's picture, shape [rows, columns].
    limits
        Nearest and farthest distance along camera 0's rays [m]; None: the whole curve.
    turns
        Turns of the facet that are tried at every place (`facet.normals`) [rad], shape [h, 2].
    gradients
        Instead of `turns`: the gradient of camera 1's pixel by camera 0's, one for each point, shape
        [n, 2, 2], the same all along its curve.
    device
        Where the curves are walked, "cpu" or "cuda".
    threads
        CPU threads; None: all cores the process may use. A result does not depend on it.

    Returns
    -------
    Candidates
        One row a point.
    """
    n, places = len(wanted.points), wanted.places
    if not n:
        nothing = np.zeros(0)
        return Candidates(np.zeros((0, 12)), nothing, nothing, nothing)
    meet = _axes_meet(rig)
    near, far = limits if limits is not None else (meet / RANGE, meet * RANGE)
    seen = facet_geometry(rig, places, np.ones(n))
    own = np.eye(2) + wanted.reference[:, 2:6].reshape(-1, 2, 2)
    given = np.zeros((n, 2, 2)) if gradients is None else np.asarray(gradients)
    piece = visible_piece(rig, seen.d, (picture1.shape[0], picture1.shape[1]), (near, far))
    angle = np.zeros((1, 2)) if turns is None or gradients is not None else np.asarray(turns)
    within, out = angle.T
    curves = Curves(
        camera=_numbers(rig),
        picture=np.ascontiguousarray(smoothed(picture1, wanted.stride)),
        given=np.concatenate([part.reshape(n, -1) for part in (seen.d, seen.B, own, given, piece)], axis=1),
        has_gradient=gradients is not None,
        turns=np.stack([np.cos(within), np.sin(within), np.cos(out), np.sin(out)], axis=1),
        step=float(wanted.stride),
        xi=wanted.xi,
        template=wanted.template,
        weight=wanted.weight,
    )
    found = search_kernel(curves, device, threads)
    nowhere = found[:, 6] <= -1.0
    warp = np.zeros((n, 12))
    warp[:, :2] = found[:, :2] - wanted.points
    warp[:, 2:6] = found[:, 2:6] - np.eye(2).reshape(-1)
    warp[nowhere] = np.nan
    return Candidates(warp, found[:, 6], found[:, 7], np.where(nowhere, np.nan, found[:, 8]))


def _numbers(rig: StereoRig) -> FloatArray:
    """Camera 1 and camera 0's centre as the kernel reads them, shape [29]."""
    first, second = rig.cameras
    grid = [second.fx, second.fy, second.cx, second.cy, second.skew, *second.distortion, fold(second)]
    return np.concatenate(
        [second.rotation.reshape(-1), second.translation, grid, second.centre, first.centre]
    )


def _axes_meet(rig: StereoRig) -> float:
    """Distance before camera 0 at which the optical axes come nearest to each other [m]."""
    first, second = rig.cameras
    centres = np.array([[camera.cx, camera.cy] for camera in rig.cameras])
    meet = midpoint(rig, centres[0], centres[1])
    s = float(distance_along(rig, centres[0], meet))
    if not (np.isfinite(s) and s > 0.0):
        baseline = float(np.linalg.norm(second.centre - first.centre))
        s = 3.0 * baseline
    return s
