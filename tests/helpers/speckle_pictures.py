"""Speckle pictures in closed form, of a plane and of a cylinder, with known motion.

The grey value of a pixel is that of the pattern, a sum of Gaussians, at the visible material point. On a
cylinder this is where its undistorted ray meets the surface. No picture is warped or interpolated.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from dic.basics import FloatArray
from dic.camera import Camera, StereoRig

Inverse = Callable[[FloatArray], FloatArray]
"""From positions in a picture (x, y) [px] to positions in the material picture, both of shape [..., 2]."""

REACH = 5.0
"""A speckle is used within this number of standard deviations of its centre. Beyond, at most 4e-6 of its
height is neglected."""


@dataclass(frozen=True)
class SpecklePattern:
    """Grey values of a material: ``level + Σ h exp(-|X - c|² / (2 s²))``."""

    centres: FloatArray  # c, in the material picture (x, y) [px], shape [n, 2]
    heights: FloatArray  # h [grey], shape [n]
    spread: float  # s [px]
    level: float  # grey value far from any speckle [grey]

    def grey(self, X: FloatArray) -> FloatArray:
        """Grey values [grey] at positions (x, y) of the material picture [px], shape [..., 2]."""
        return self._sum(X.reshape(-1, 2)).reshape(X.shape[:-1])

    @cached_property
    def _cells(self) -> tuple[FloatArray, NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Cells as wide as the reach: corner and shape of their grid, speckles by cell, first speckle of each
        cell."""
        corner = self.centres.min(axis=0) - 2.0 * self._width  # no speckle in the outermost two cells
        cell = np.floor((self.centres - corner) / self._width).astype(np.int64)
        shape = cell.max(axis=0) + 3
        number = cell[:, 0] * shape[1] + cell[:, 1]
        order = np.argsort(number, kind="stable")
        first = np.searchsorted(number[order], np.arange(np.prod(shape) + 1))
        return corner, shape, order, first

    @property
    def _width(self) -> float:
        return REACH * self.spread

    def _sum(self, places: FloatArray) -> FloatArray:
        """Grey values at positions, shape [n, 2]. They are computed cell by cell with the speckles of nine
        cells."""
        corner, shape, speckles, first = self._cells
        cell = np.floor((places - corner) / self._width).astype(np.int64)
        total = np.full(len(places), self.level)
        near = np.all((cell >= 1) & (cell < shape - 1), axis=1)
        number = np.where(near, cell[:, 0] * shape[1] + cell[:, 1], -1)
        order = np.argsort(number, kind="stable")
        known, begin = np.unique(number[order], return_index=True)
        for here, start, end in zip(known, begin, [*begin[1:], len(order)], strict=True):
            if here < 0:
                continue
            rows = [here + step for step in (-shape[1], 0, shape[1])]
            who = np.concatenate([speckles[first[row - 1] : first[row + 2]] for row in rows])
            which = order[start:end]
            away = places[which, None] - self.centres[who]
            falls = np.exp(np.einsum("ijk,ijk->ij", away, away) / (-2.0 * self.spread**2))
            total[which] += falls @ self.heights[who]
        return total


def speckle_pattern(
    shape: tuple[int, int],
    *,
    size: float = 5.0,
    contrast: float = 37.5,
    level: float = 128.0,
    margin: float = 30.0,
    seed: int = 0,
) -> SpecklePattern:
    """Speckles at random positions. Half of them are darker and half are brighter than the ground.

    Their autocorrelation is a Gaussian. The mean square of a gradient component is
    ``contrast² / (2 s²)`` with ``s = size / (4 √ln 2)``.

    ``shape``: rows and columns of the material picture [px]. ``size``: full width of the pattern's
    autocorrelation at half its height [px]. ``contrast``, ``level``: standard deviation and mean of the grey
    value [grey]. ``margin``: width of the pattern beyond the picture [px].
    """
    spread, pitch = size / (4.0 * np.sqrt(np.log(2.0))), 0.7 * size
    rng = np.random.default_rng(seed)
    across, along = (np.arange(-margin, extent + margin, pitch) for extent in (shape[1], shape[0]))
    centres = np.stack(np.meshgrid(across, along), axis=-1).reshape(-1, 2)
    centres = centres + rng.uniform(0.0, pitch, centres.shape)
    # independent signs: variance = (speckles per area) x height² x integral of the squared Gaussian
    height = contrast * pitch / (np.sqrt(np.pi) * spread)
    return SpecklePattern(
        centres=centres,
        heights=height * rng.choice([-1.0, 1.0], len(centres)),
        spread=float(spread),
        level=level,
    )


def render(
    pattern: SpecklePattern,
    shape: tuple[int, int],
    *,
    material: Inverse | None = None,
    fill: float = 0.0,
    gain: float = 1.0,
    offset: float = 0.0,
    noise: float = 0.0,
    bits: int | None = None,
    seed: int = 0,
) -> FloatArray:
    """A picture of the pattern [grey], shape [rows, columns].

    ``shape``: rows and columns [px]. ``material``: the inverse motion, from a position in the picture to its
    material point; None: no motion. ``fill``: width of a pixel's light-sensitive square over the pixel pitch,
    0 to 1. 0 samples the pixel's centre. A larger value gives the mean over the square by 3 x 3 Gauss points.
    ``gain``, ``offset``: grey values are ``gain × pattern + offset``, as under another light. ``noise``:
    standard deviation of Gaussian noise, independent from pixel to pixel [grey]. ``bits``: the camera's
    depth: grey values are rounded, and saturate at 0 and 2**bits - 1. None: neither.
    """
    rows, columns = np.meshgrid(np.arange(shape[0]), np.arange(shape[1]), indexing="ij")
    centres = np.stack([columns, rows], axis=-1).astype(np.float64)
    node, weight = (np.zeros(1), np.ones(1)) if fill == 0.0 else np.polynomial.legendre.leggauss(3)
    grey = np.zeros(shape)
    for i, j in np.ndindex(len(node), len(node)):
        places = centres + 0.5 * fill * np.array([node[i], node[j]])
        seen = pattern.grey(places if material is None else material(places))
        grey += weight[i] * weight[j] / weight.sum() ** 2 * seen
    grey = gain * grey + offset
    if noise:
        grey += np.random.default_rng(seed).normal(0.0, noise, shape)
    if bits is not None:
        grey = np.clip(np.round(grey), 0.0, 2.0**bits - 1.0)
    return grey


Pattern = Callable[[FloatArray, FloatArray], FloatArray]
"""Reflectance, 0 to 1, at positions on a surface: arc length and height [m], both of one shape."""


@dataclass(frozen=True)
class RenderedCylinder:
    """An endless cylinder about an axis parallel to y of the rig's frame."""

    radius: float  # radius [m]
    x: float = 0.0  # position of the axis, x [m]
    z: float = 0.0  # position of the axis, z [m]

    def hit(self, camera: Camera, pixels: FloatArray) -> FloatArray:
        """Points of the cylinder [m] that a camera sees at `pixels` [px], shape [..., 3]; NaN where it sees
        none."""
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
        """Outward unit normals at positions on the surface, shape [..., 3]."""
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

        ``shape``: rows and columns [px]. ``pattern``: reflectance of the surface by arc length and height.
        ``oversample``: number of rays of a pixel along each axis.
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
    """Dark discs with soft rims on a bright ground. Each cell of a square grid has one disc of random
    position and size."""

    pitch: float  # side of a cell [m]
    seed: int = 0  # of the random numbers
    softness: float = 0.15  # width of the rim [pitch]
    cells: int = 256  # the pattern repeats after this number of cells in each direction

    def __call__(self, arc: FloatArray, height: FloatArray) -> FloatArray:
        """Reflectance, 0 to 1, at positions on the surface."""
        rng = np.random.default_rng(self.seed)
        jitter = rng.uniform(-0.5, 0.5, (self.cells, self.cells, 2))
        radius = rng.uniform(0.25, 0.55, (self.cells, self.cells))
        u, v = arc / self.pitch, height / self.pitch
        i, j = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
        bright = np.ones(u.shape)
        for di in (-1, 0, 1):  # a disc with its rim reaches at most 1.05 cells from the middle of its cell
            for dj in (-1, 0, 1):
                a, b = (i + di) % self.cells, (j + dj) % self.cells
                du = u - (i + di + 0.5 + jitter[a, b, 0])
                dv = v - (j + dj + 0.5 + jitter[a, b, 1])
                over = (np.hypot(du, dv) - radius[a, b]) / self.softness
                bright *= 1.0 / (1.0 + np.exp(-np.clip(over, -30.0, 30.0) * 2.0))
        return 0.15 + 0.7 * bright


PLANE_TOML = """# a plane
[dic]
kind = "plane"
region = { x = [16, 111], y = [16, 111] }
scale = "0.01 mm"
static = 2
subset = 21

[pictures]
camera_0.pattern = "cam0_*.png"
"""
PLANE_SIDE = 128


def plane(folder: Path) -> Path:
    """Three pictures of a plane. Two are at rest; in the last one it is bent: Exx varies from -2 to 2 % along
    x."""
    folder.mkdir(parents=True)
    pattern, middle = speckle_pattern((PLANE_SIDE, PLANE_SIDE), seed=3), 0.5 * PLANE_SIDE

    def bent(places: FloatArray) -> FloatArray:
        x = places[..., 0] - middle
        return np.stack([middle + x - 1e-2 * x**2 / middle, places[..., 1]], axis=-1)

    for k in range(3):
        shape, inverse = (PLANE_SIDE, PLANE_SIDE), bent if k == 2 else None
        picture = render(pattern, shape, material=inverse, noise=2.0, bits=8, seed=k)
        cv2.imwrite(str(folder / f"cam0_{k:03d}.png"), picture.astype(np.uint8))
    (folder / "dic.toml").write_text(PLANE_TOML, encoding="utf-8")
    return folder


def facing(angle: float, distance: float, focal: float, shape: tuple[int, int], **lens: Any) -> StereoRig:
    """Two cameras side by side, `angle` [rad] apart, that look at the origin from a distance [m]; y is up."""
    cameras = []
    for a in (-0.5 * angle, 0.5 * angle):
        centre = distance * np.array([np.sin(a), 0.0, np.cos(a)])
        z = -centre / distance
        x = np.array([np.cos(a), 0.0, -np.sin(a)])
        R = np.stack([x, np.cross(z, x), z])
        cy, cx = (0.5 * (n - 1) for n in shape)
        cameras.append(Camera(focal, focal, cx, cy, rotation=R, translation=-R @ centre, **lens))
    return StereoRig((cameras[0], cameras[1]))
