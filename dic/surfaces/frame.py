"""The test frame: y along the specimen's axis, Z out of plane toward the cameras, x right-handed.

Which way along the axis is positive, and where y is zero, are declared: the pictures do not know them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dic.arrays import FloatArray
from dic.camera import Camera, StereoRig
from dic.surfaces.cylinder import Cylinder

WIDEST_ANGLE = 45.0
"""Largest angle between the axis seen by camera 0 and the direction declared for it [degrees]."""


@dataclass(frozen=True)
class SpecimenFrame:
    """A frame (x, y, Z) placed in the rig's, and how well it is known."""

    rotation: FloatArray
    """Rows x, y, Z as unit vectors of the rig's frame, shape [3, 3]."""
    origin: FloatArray
    """The point of the axis at y = 0, in the rig's frame [m], shape [3]."""
    covariance: FloatArray
    """Of small rotations about x, y, Z [rad] and shifts of the origin along them [m], shape [6, 6].
    The rotation about y is fixed by the cameras and has no variance."""

    def positions(self, X: FloatArray) -> FloatArray:
        """Points of the rig's frame in this one [m], shape [..., 3]."""
        return np.asarray((X - self.origin) @ self.rotation.T)

    def in_rig(self, x: FloatArray) -> FloatArray:
        """Points of this frame in the rig's [m], shape [..., 3]."""
        return np.asarray(x @ self.rotation + self.origin)

    def covariances(self, C: FloatArray) -> FloatArray:
        """Covariances of the rig's frame in this one [m²], shape [..., 3, 3]."""
        return np.asarray(self.rotation @ C @ self.rotation.T)

    def variances(self, C: FloatArray) -> FloatArray:
        """Diagonals of `covariances` [m²], shape [..., 3]."""
        return np.einsum("ij,...jk,ik->...i", self.rotation, C, self.rotation)

    def sigma(self, x: FloatArray) -> FloatArray:
        """Standard deviation that the frame's own uncertainty adds at points of it, common to all of them.

        Parameters
        ----------
        x
            Points in this frame [m], shape [..., 3].

        Returns
        -------
        NDArray
            Standard uncertainties by component [m], shape [..., 3].
        """
        x = np.asarray(x, dtype=np.float64)
        J = np.zeros((*x.shape, 6))  # a frame turned by r and shifted by d sees x at x - r × x - d
        J[..., 0, 1], J[..., 0, 2] = -x[..., 2], x[..., 1]
        J[..., 1, 0], J[..., 1, 2] = x[..., 2], -x[..., 0]
        J[..., 2, 0], J[..., 2, 1] = -x[..., 1], x[..., 0]
        J[..., 3:] = -np.eye(3)
        return np.sqrt(np.einsum("...ij,jk,...ik->...i", J, self.covariance, J).clip(min=0.0))


def test_frame(
    cylinder: Cylinder,
    rig: StereoRig,
    *,
    toward_flyer: tuple[float, float],
    zero: ArrayLike,
    zero_sigma: float = 0.0,  # noqa: PT028
) -> SpecimenFrame:
    """Place the test frame on the cylinder of the undeformed specimen.

    y runs along the axis, positive toward the side declared by `toward_flyer`. Z is the part across the
    axis of the direction from the axis to the midpoint between the cameras. The origin lies on the axis
    in the plane y = 0.

    Parameters
    ----------
    cylinder
        Of the undeformed specimen, from points in the rig's frame.
    rig
        The cameras the points were measured with.
    toward_flyer
        Direction from the transmission side toward the flyer in camera 0's picture (right, down), of
        any length; (0, -1) is up.
    zero
        A point of the plane y = 0, the transmission platen's face, in the rig's frame [m], shape [3];
        `on_cylinder` finds it from a pixel.
    zero_sigma
        Standard uncertainty of its place along the axis [m].

    Raises
    ------
    ValueError
        A direction that the axis does not have in camera 0's picture within 45°, or numbers that are
        not finite.
    """
    zero = np.asarray(zero, dtype=np.float64)
    declared = np.asarray(toward_flyer, dtype=np.float64)
    if zero.shape != (3,) or not np.isfinite(zero).all() or not zero_sigma >= 0.0:
        raise ValueError(
            f"zero must be a point of the rig's frame [m] and zero_sigma >= 0 m, got {zero}, {zero_sigma}"
        )
    if declared.shape != (2,) or not np.isfinite(declared).all() or not np.any(declared):
        raise ValueError(f"toward_flyer must be a direction (right, down) in the picture, got {toward_flyer}")
    seen = _in_picture(rig.cameras[0], cylinder)
    cosine = float(seen @ declared / np.linalg.norm(declared))
    if abs(cosine) < np.cos(np.radians(WIDEST_ANGLE)):
        raise ValueError(
            f"toward_flyer is {toward_flyer} (right, down), but camera 0 sees the axis along "
            f"({seen[0]:.2f}, {seen[1]:.2f}) or its reverse: must agree within {WIDEST_ANGLE:g}°; declare "
            "the direction of the flyer in camera 0's picture, or check the cylinder's points"
        )
    y = cylinder.axis * np.sign(cosine)
    middle = 0.5 * (rig.cameras[0].centre + rig.cameras[1].centre)
    view = middle - cylinder.point
    Z = view - (view @ y) * y
    Z = Z / np.linalg.norm(Z)
    rotation = np.array([np.cross(y, Z), y, Z])
    origin = cylinder.point + ((zero - cylinder.point) @ y) * y
    return SpecimenFrame(rotation, origin, _covariance(cylinder, rotation, origin, zero, zero_sigma))


test_frame.__test__ = False  # type: ignore[attr-defined]  # a name that test runners collect


def on_cylinder(camera: Camera, pixel: ArrayLike, cylinder: Cylinder) -> FloatArray:
    """The point of the cylinder that a camera sees at a pixel [m], in the rig's frame, shape [3].

    Parameters
    ----------
    camera
        One camera of the rig that measured the cylinder.
    pixel
        Place in its picture (x, y) [px].
    cylinder
        Where the pixel's ray meets it first.

    Raises
    ------
    ValueError
        If the ray passes the cylinder by.
    """
    ideal = camera.undistort(np.asarray(pixel, dtype=np.float64))
    ray = camera.rotation.T @ np.array([ideal[0], ideal[1], 1.0])
    start = camera.centre - cylinder.point
    d, w = cylinder.basis[:2] @ ray, cylinder.basis[:2] @ start
    a, b, c = d @ d, d @ w, w @ w - cylinder.radius**2
    under = b * b - a * c
    if not under >= 0.0:
        raise ValueError(
            f"the ray of pixel {tuple(np.asarray(pixel).tolist())} passes the cylinder of radius "
            f"{cylinder.radius:.4g} m by; choose a pixel on the specimen"
        )
    return np.asarray(camera.centre + (-b - np.sqrt(under)) / a * ray)


def _in_picture(camera: Camera, cylinder: Cylinder) -> FloatArray:
    """Unit direction of the axis in a camera's picture (right, down)."""
    ends = cylinder.point + np.outer([-0.1, 0.1], cylinder.radius * cylinder.axis)
    seen = np.diff(camera.project(ends), axis=0)[0]
    return np.asarray(seen / np.linalg.norm(seen))


def _covariance(
    cylinder: Cylinder, rotation: FloatArray, origin: FloatArray, zero: FloatArray, zero_sigma: float
) -> FloatArray:
    """From shifts a, b and tilts α, β of the cylinder's axis: the direction y changes by
    t = ±(α e1 + β e2), the origin by a e1 + b e2 + s t; the plane y = 0 turns about the declared point."""
    across = rotation @ cylinder.basis[:2].T  # e1, e2 in the test frame, shape [3, 2]
    sense = float(np.sign(rotation[1] @ cylinder.axis))
    s = float((origin - cylinder.point) @ rotation[1])
    x0, _, Z0 = rotation @ (zero - origin)
    J = np.zeros((6, 5))
    turn = sense * across
    J[0, 2:4], J[2, 2:4] = turn[2], -turn[0]  # r × y = t: t_Z = r_x, t_x = -r_Z
    J[3:, 0:2] = across
    J[3:, 2:4] = s * turn
    J[4] = Z0 * J[0] - x0 * J[2]
    V = np.asarray(J @ cylinder.covariance @ J.T)
    V[4, 4] += zero_sigma**2
    return V
