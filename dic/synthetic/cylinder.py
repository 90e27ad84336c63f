"""Pictures of a speckled cylinder, ray by ray, with the answer known: to test the way from pictures to space.

Every sub-pixel ray is undone through the lens, cut with the cylinder and given the grey value of the speckle
pattern at that place of the surface, a function of the arc length and the height. No picture is warped or
interpolated, so that the true match of a pixel is known in closed form.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dic.arrays import FloatArray
from dic.camera import Camera

Pattern = Callable[[FloatArray, FloatArray], FloatArray]
"""Reflectance, 0 to 1, of places on a surface: arc length and height [m], both of one shape."""


@dataclass(frozen=True)
class RenderedCylinder:
    """An endless cylinder about an axis parallel to y of the rig's frame."""

    radius: float
    """Radius [m]."""
    x: float = 0.0
    """Place of the axis, x [m]."""
    z: float = 0.0
    """Place of the axis, z [m]."""

    def hit(self, camera: Camera, pixels: FloatArray) -> FloatArray:
        """Points of the cylinder that a camera sees at `pixels` [px] [m], shape [..., 3]; NaN beside it."""
        ideal = camera.undistort(pixels)
        ray = np.concatenate([ideal, np.ones((*ideal.shape[:-1], 1))], axis=-1) @ camera.rotation
        start = camera.centre - np.array([self.x, 0.0, self.z])
        # |start + s ray|² = radius² across the axis; the nearer of the two places
        a = ray[..., 0] ** 2 + ray[..., 2] ** 2
        b = start[0] * ray[..., 0] + start[2] * ray[..., 2]
        under = b * b - a * (start[0] ** 2 + start[2] ** 2 - self.radius**2)
        s = (-b - np.sqrt(np.where(under >= 0.0, under, np.nan))) / a
        return np.asarray(camera.centre + s[..., None] * ray)

    def normal(self, X: FloatArray) -> FloatArray:
        """Outward unit normals at places of the surface, shape [..., 3]."""
        out = np.stack([X[..., 0] - self.x, np.zeros(X.shape[:-1]), X[..., 2] - self.z], axis=-1)
        return np.asarray(out / np.linalg.norm(out, axis=-1, keepdims=True))

    def picture(
        self,
        camera: Camera,
        shape: tuple[int, int],
        pattern: Pattern,
        *,
        oversample: int = 5,
        background: float = 0.1,
    ) -> FloatArray:
        """The picture a camera takes, reflectances averaged over each pixel [-], shape [rows, columns].

        Parameters
        ----------
        camera
            The camera.
        shape
            Rows and columns [px].
        pattern
            Reflectance of the surface by arc length and height.
        oversample
            Rays a pixel along each axis.
        background
            Reflectance beside the cylinder.
        """
        rows, columns = shape
        offset = (np.arange(oversample) + 0.5) / oversample - 0.5
        x = (np.arange(columns)[:, None] + offset).reshape(-1)
        total = np.zeros(shape)
        for part in offset:  # one row of sub-pixels at a time keeps the memory low
            y = np.arange(rows) + part
            X = self.hit(camera, np.stack(np.meshgrid(x, y), axis=-1))
            seen = np.isfinite(X[..., 0])
            grey = np.full(seen.shape, background)
            arc = self.radius * np.arctan2(X[seen, 0] - self.x, X[seen, 2] - self.z)
            grey[seen] = pattern(arc, X[seen, 1])
            total += grey.reshape(rows, columns, oversample).mean(axis=2)
        return total / oversample


@dataclass(frozen=True)
class Speckles:
    """Dark discs on a bright ground: one a cell of a square grid, of random place and size, soft rims."""

    pitch: float
    """Side of a cell [m]."""
    seed: int = 0
    """Of the random numbers."""
    softness: float = 0.15
    """Width of the rim [pitch]."""
    cells: int = 256
    """After so many cells each way the pattern repeats."""

    def __call__(self, arc: FloatArray, height: FloatArray) -> FloatArray:
        """Reflectance, 0 to 1, of places on the surface."""
        rng = np.random.default_rng(self.seed)
        jitter = rng.uniform(-0.5, 0.5, (self.cells, self.cells, 2))
        radius = rng.uniform(0.25, 0.55, (self.cells, self.cells))
        u, v = arc / self.pitch, height / self.pitch
        i, j = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
        bright = np.ones(u.shape)
        for di in (-1, 0, 1):  # a disc reaches 1.05 cells and its rim from the middle of its own
            for dj in (-1, 0, 1):
                a, b = (i + di) % self.cells, (j + dj) % self.cells
                du = u - (i + di + 0.5 + jitter[a, b, 0])
                dv = v - (j + dj + 0.5 + jitter[a, b, 1])
                over = (np.hypot(du, dv) - radius[a, b]) / self.softness
                bright *= 1.0 / (1.0 + np.exp(-np.clip(over, -30.0, 30.0) * 2.0))
        return 0.15 + 0.7 * bright
