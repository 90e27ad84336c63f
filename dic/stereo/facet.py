"""Plane facets: how both cameras see a small piece of surface.

A facet at X = C0 + s d, seen by camera 0 along the unit vector d(p) of its pixel p, with normal n. A step
of p moves the point on the plane by ::

    dX = s (I - d nᵀ / n·d) B dp,         B = ∂d/∂p

and what camera 1 sees of it by A dp with ``A = P (dX/dp)``, P = ∂π1/∂X: the homography of the plane to
first order (Hartley and Zisserman, Multiple View Geometry, 2nd ed., section 13.1), lens distortion included.
With q = n / n·d this is ``A = s P B - s (P d) (qᵀ B)``. The last term lies along the epipolar line P d: only
there can a surface's slope show. Across it every surface gives the same two numbers, a test of any match
that knows nothing of where the match lies.
"""

from typing import NamedTuple

import numpy as np

from dic.arrays import FloatArray
from dic.camera import StereoRig
from dic.stereo.rays import directions, pixel_slope, projection_slope


class FacetGeometry(NamedTuple):
    """Facets' places in space and how both cameras' pixels depend on them; arrays of shape [..., n, n]."""

    X: FloatArray
    """Places in the rig's frame [m], shape [..., 3]."""
    d: FloatArray
    """Unit vectors from camera 0 to them, shape [..., 3]."""
    B: FloatArray
    """Derivative of d by camera 0's pixel, up to multiples of d [1/px], shape [..., 3, 2]."""
    P: FloatArray
    """Derivative of camera 1's pixel by X [px/m], shape [..., 2, 3]."""


def facet_geometry(rig: StereoRig, pixels0: FloatArray, distance: FloatArray) -> FacetGeometry:
    """The geometry of facets seen by camera 0 at `pixels0` [px], `distance` [m] along its ray."""
    first, second = rig.cameras
    ideal = first.undistort(pixels0)
    v = np.concatenate([ideal, np.ones((*ideal.shape[:-1], 1))], axis=-1) @ first.rotation
    length = np.linalg.norm(v, axis=-1)
    B = first.rotation.T[:, :2] @ np.linalg.inv(pixel_slope(first, ideal)) / length[..., None, None]
    d = v / length[..., None]
    X = first.centre + np.asarray(distance)[..., None] * d
    return FacetGeometry(X, d, np.broadcast_to(B, (*X.shape[:-1], 3, 2)), projection_slope(second, X))


def normals(rig: StereoRig, X: FloatArray, turns: FloatArray) -> FloatArray:
    """Normals turned away from the one that faces both cameras alike.

    Parameters
    ----------
    rig
        The cameras.
    X
        Places of the facets in the rig's frame [m], shape [..., 3].
    turns
        Angles within the epipolar plane, where they stretch what one camera sees against the other, and out
        of it, where they shear it, shape [m, 2] [rad].

    Returns
    -------
    NDArray
        Unit vectors toward the cameras, shape [..., m, 3].
    """
    to = [_unit(camera.centre - X) for camera in rig.cameras]
    middle = _unit(to[0] + to[1])
    axis = _unit(np.cross(to[0], to[1]))
    side = np.cross(axis, middle)
    within, out = np.asarray(turns)[:, :1], np.asarray(turns)[:, 1:]
    parts = ((middle, np.cos(within)), (side, np.sin(within)))
    level = sum(direction[..., None, :] * share for direction, share in parts)
    return np.asarray(level * np.cos(out) + axis[..., None, :] * np.sin(out))


def gradient(seen: FacetGeometry, distance: FloatArray, normal: FloatArray) -> FloatArray:
    """A: how camera 1's pixel of a facet changes with camera 0's [-], shape [..., 2, 2].

    Parameters
    ----------
    seen
        The facets' geometry.
    distance
        Along camera 0's rays [m], shape [...].
    normal
        The facets' normals, shape [..., 3]; of any length, not across the ray.
    """
    q = normal / np.sum(normal * seen.d, axis=-1, keepdims=True)
    plane = seen.B - seen.d[..., :, None] * (q[..., None, :] @ seen.B)
    return np.asarray(np.asarray(distance)[..., None, None] * (seen.P @ plane))


class FacetFit(NamedTuple):
    """The facet that a measured gradient speaks of."""

    normal: FloatArray
    """Unit normal toward camera 0, shape [..., 3]."""
    incidence: tuple[FloatArray, FloatArray]
    """Angles between the normal and the rays of the two cameras [rad], each of shape [...]."""
    across: FloatArray
    """Misfit that no facet can explain: the part of the gradient across the epipolar line that is wrong [-],
    shape [...]."""


def fit_facet(rig: StereoRig, pixels0: FloatArray, distance: FloatArray, A: FloatArray) -> FacetFit:
    """The facet with the gradient `A` of camera 1's pixel by camera 0's, and how far it is from being one.

    Parameters
    ----------
    rig
        The cameras.
    pixels0
        Where camera 0 sees the facets [px], shape [n, 2].
    distance
        Along camera 0's rays [m], shape [n].
    A
        Measured gradients [-], shape [n, 2, 2].
    """
    seen = facet_geometry(rig, pixels0, distance)
    s = np.asarray(distance)[..., None]
    epipole = (seen.P @ seen.d[..., None])[..., 0]  # along the epipolar line [px/m]
    length = np.linalg.norm(epipole, axis=-1, keepdims=True)
    along = epipole / length
    across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
    excess = s[..., None] * (seen.P @ seen.B) - A
    tilt = np.einsum("...i,...ij->...j", along, excess) / (s * length)  # qᵀ B
    wrong = np.linalg.norm(np.einsum("...i,...ij->...j", across, excess), axis=-1)
    # q: its component along d is 1, the others follow from qᵀ B, whose columns span the rest with d
    basis = np.concatenate([seen.B, seen.d[..., None]], axis=-1)
    q = np.linalg.solve(
        np.swapaxes(basis, -1, -2), np.concatenate([tilt, np.ones_like(s)], axis=-1)[..., None]
    )
    normal = -_unit(q[..., 0])
    to1 = _unit(rig.cameras[1].centre - seen.X)
    cosines = -np.sum(normal * seen.d, axis=-1), np.sum(normal * to1, axis=-1)
    angles = tuple(np.arccos(np.clip(cosine, -1.0, 1.0)) for cosine in cosines)
    return FacetFit(normal, (angles[0], angles[1]), wrong)


def distance_along(rig: StereoRig, pixels0: FloatArray, X: FloatArray) -> FloatArray:
    """Distance of points along camera 0's rays [m], shape [...]."""
    return np.asarray(np.sum((X - rig.cameras[0].centre) * directions(rig.cameras[0], pixels0), axis=-1))


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))
