"""A camera and a stereo rig: projection of points in space to pixels.

Pixel coordinates are (x, y) = (column, row); whole numbers are pixel centres, and (0, 0) is the centre of the
top left pixel. A point X of the rig's frame has the camera coordinates ``X_c = R X + t``: x to the right of
the picture, y down, z along the optical axis.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from dic.basics import FloatArray, check_shape

PARAMETERS = ("fx", "fy", "cx", "cy", "skew", "k1", "k2", "p1", "p2", "k3")
"""Names of a camera's intrinsic parameters, in the order of the covariance."""
POSE = ("rx", "ry", "rz", "tx", "ty", "tz")
"""Names of a pose: a small rotation [rad] applied after `Camera.rotation`, and the translation [m]."""


@dataclass(frozen=True)
class Camera:
    """A pinhole camera with Brown's lens distortion.

    Raises
    ------
    ValueError
        If a focal length is not positive, a matrix is not a rotation, a shape is wrong, or a number is not
        finite.

    Examples
    --------
    >>> from dic import Camera
    >>> Camera(1000.0, 1000.0, 50.0, 40.0).project([[0.01, 0.0, 1.0]]).tolist()
    [[60.0, 40.0]]
    """

    fx: float
    """Focal length over pixel pitch, along x [px]."""
    fy: float
    """Focal length over pixel pitch, along y [px]."""
    cx: float
    """Principal point, x coordinate [px]."""
    cy: float
    """Principal point, y coordinate [px]."""
    skew: float = 0.0
    """Shear of the pixel grid: x = fx x' + skew y' + cx [px]."""
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    """Brown's k1, k2, p1, p2, k3, in OpenCV's order [-]."""
    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    """R, from the rig's frame to the camera's, shape [3, 3]."""
    translation: FloatArray = field(default_factory=lambda: np.zeros(3))
    """t, of the rig's origin in the camera's frame [m], shape [3]."""
    sensor: tuple[int, int] | None = None
    """Columns and rows of the pictures that the parameters refer to [px]."""

    def __post_init__(self) -> None:
        check_shape((5,), distortion=self.distortion)
        check_shape((3, 3), rotation=self.rotation)
        check_shape((3,), translation=self.translation)
        numbers = np.array([self.fx, self.fy, self.cx, self.cy, self.skew, *self.distortion])
        if not np.all(np.isfinite(numbers)):
            raise ValueError(f"a camera's parameters must be finite, got {numbers}")
        if self.fx <= 0.0 or self.fy <= 0.0:
            raise ValueError(f"focal lengths must be positive, got fx = {self.fx}, fy = {self.fy} px")
        off = np.abs(self.rotation @ self.rotation.T - np.eye(3)).max()
        if not off < 1e-6 or np.linalg.det(self.rotation) < 0.0:
            raise ValueError(f"rotation must be orthonormal and right-handed to 1e-6, is off by {off:.1e}")

    @property
    def matrix(self) -> FloatArray:
        """The camera matrix K [px], shape [3, 3]."""
        return np.array([[self.fx, self.skew, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def centre(self) -> FloatArray:
        """Centre of projection in the rig's frame [m], shape [3]."""
        return np.asarray(-self.rotation.T @ self.translation)

    def cropped(self, offset: tuple[float, float]) -> "Camera":
        """The same camera for pictures whose top left pixel lies at `offset` (x, y) of the sensor [px]."""
        return replace(self, cx=self.cx - offset[0], cy=self.cy - offset[1])

    def in_camera(self, X: FloatArray) -> FloatArray:
        """Points of the rig's frame, transformed to the camera's frame [m], shape [..., 3]."""
        return np.asarray(X @ self.rotation.T + self.translation)

    def distort(self, ideal: FloatArray) -> FloatArray:
        """Distorted image points from ideal image points, both on the plane z = 1 [-], shape [..., 2]."""
        k1, k2, p1, p2, k3 = self.distortion
        x, y = ideal[..., 0], ideal[..., 1]
        r2 = x * x + y * y
        # Terms with a coefficient of 0 are skipped, here and below: most lenses have one or two coefficients.
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3) if k2 or k3 else k1)
        distorted = np.empty(ideal.shape)  # for few points np.stack takes longer than the sums
        if p1 or p2:
            distorted[..., 0] = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
            distorted[..., 1] = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
        else:
            np.multiply(x, radial, out=distorted[..., 0])
            np.multiply(y, radial, out=distorted[..., 1])
        return distorted

    def project(self, X: FloatArray) -> FloatArray:
        """Pixels of points [px], shape [..., 2]; NaN for a point behind the camera.

        Parameters
        ----------
        X
            Points in the rig's frame [m], shape [..., 3].
        """
        inside = self.in_camera(np.asarray(X, dtype=np.float64))
        depth = np.where(inside[..., 2:] > 0.0, inside[..., 2:], np.nan)
        return self.to_pixels(self.distort(inside[..., :2] / depth))

    def to_pixels(self, plane: FloatArray) -> FloatArray:
        """Pixels of distorted points on the plane z = 1 [px], shape [..., 2]."""
        pixels = np.empty(plane.shape)
        sheared = self.fx * plane[..., 0]
        if self.skew:
            sheared = sheared + self.skew * plane[..., 1]
        pixels[..., 0] = sheared + self.cx
        pixels[..., 1] = self.fy * plane[..., 1] + self.cy
        return pixels

    def undistort(self, pixels: FloatArray) -> FloatArray:
        """Undistorted points on the plane z = 1 for `pixels` [-], shape [..., 2].

        Newton's method on `distort`, to 1e-12 of a focal length.

        Raises
        ------
        ValueError
            If it does not converge, because the lens model is not unique there.
        """
        pixels = np.asarray(pixels, dtype=np.float64)
        y = (pixels[..., 1] - self.cy) / self.fy
        target = np.stack([(pixels[..., 0] - self.cx - self.skew * y) / self.fx, y], axis=-1)
        if not any(self.distortion):
            return target
        ideal = target.copy()
        missing = np.any(np.isnan(target), axis=-1)  # a NaN pixel stays NaN and does not stop the iteration
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # divergence is reported below
            for _ in range(30):
                off = self.distort(ideal) - target
                (a, b), (c, d) = np.moveaxis(self.distortion_slope(ideal), (-2, -1), (0, 1))
                u, v = off[..., 0], off[..., 1]
                area = a * d - b * c
                ideal = ideal - np.stack([d * u - b * v, a * v - c * u], axis=-1) / area[..., None]
                upright = (area > 0.0) & (a + d > 0.0)  # beyond this limit the image is mirrored
                converged = (np.all(np.abs(off) <= 1e-12, axis=-1) & upright) | missing
                if np.all(converged):
                    return ideal
        worst = pixels.reshape(-1, 2)[np.argmin(converged.reshape(-1))]
        raise ValueError(
            f"the lens distortion {self.distortion} cannot be undone at pixel {worst}: it folds back there; "
            "use fewer distortion coefficients, or a calibration that covers the whole picture"
        )

    def distortion_slope(self, ideal: FloatArray) -> FloatArray:
        """Derivative of `distort` with respect to its argument [-], shape [..., 2, 2]."""
        k1, k2, p1, p2, k3 = self.distortion
        x, y = ideal[..., 0], ideal[..., 1]
        r2 = x * x + y * y
        higher = k2 or k3
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3) if higher else k1)
        # d radial / d x = growth x
        growth = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3) if higher else k1)
        xx, xy, yy = radial + growth * x * x, growth * x * y, radial + growth * y * y
        if p1 or p2:
            xx = xx + 2.0 * p1 * y + 6.0 * p2 * x
            xy = xy + 2.0 * p1 * x + 2.0 * p2 * y
            yy = yy + 6.0 * p1 * y + 2.0 * p2 * x
        slope = np.empty((*ideal.shape, 2))
        slope[..., 0, 0], slope[..., 1, 1] = xx, yy
        slope[..., 0, 1] = slope[..., 1, 0] = xy
        return slope


@dataclass(frozen=True)
class StereoRig:
    """Two calibrated cameras that view one specimen, and the covariance of their parameters."""

    cameras: tuple[Camera, Camera]
    """Camera 0 and camera 1; their poses refer to one frame, usually that of camera 0."""
    covariance: FloatArray | None = None
    """Covariance of the parameters, in the order of `parameter_names`, in m, rad and px; None if not
    known."""

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the rows of `covariance`: both cameras' `PARAMETERS`, then the relative pose.

        The relative pose is ``R = exp([r]) R1 R0ᵀ``, ``t = t1 - R t0``; its `POSE` rotation is the small r.
        """
        return tuple([f"{name}{k}" for k in (0, 1) for name in PARAMETERS] + list(POSE))

    @property
    def relative(self) -> tuple[FloatArray, FloatArray]:
        """R [3, 3] and t [m, 3] from camera 0 to camera 1: X_1 = R X_0 + t."""
        first, second = self.cameras
        R = second.rotation @ first.rotation.T
        return R, second.translation - R @ first.translation

    def cropped(self, first: tuple[float, float], second: tuple[float, float]) -> "StereoRig":
        """The rig for pictures cropped at these offsets (x, y) of the sensors [px]."""
        a, b = self.cameras
        return replace(self, cameras=(a.cropped(first), b.cropped(second)))
