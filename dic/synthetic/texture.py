"""Paint on a surface: reflectance by material place, on a grid of texels that is bilinear between them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray


@dataclass(frozen=True)
class Texture:
    """Reflectance of a surface on a grid, which is the pattern itself: all pictures read the same one."""

    grey: NDArray[np.float32]
    """Reflectance of the texels [-], 0 to 1; rows along the generator, columns around: [rows, columns]."""
    pitch: float
    """Distance of texels [m]."""
    origin: tuple[float, float]
    """Place of texel [0, 0]: around and along [m]."""

    def __post_init__(self) -> None:
        if self.grey.ndim != 2 or min(self.grey.shape) < 2:
            raise ValueError(f"grey must be a grid of at least 2 x 2 texels, got shape {self.grey.shape}")
        if not (np.isfinite(self.pitch) and self.pitch > 0.0):
            raise ValueError(f"pitch must be a positive length in metres, got {self.pitch}")

    def at(self, around: FloatArray, along: FloatArray) -> FloatArray:
        """Reflectance at places [m], bilinear; beyond the grid that of the nearest texel."""
        rows, columns = self.grey.shape
        u = np.clip((np.asarray(around) - self.origin[0]) / self.pitch, 0.0, columns - 1.001)
        v = np.clip((np.asarray(along) - self.origin[1]) / self.pitch, 0.0, rows - 1.001)
        i, j = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
        a, b = u - i, v - j
        g = self.grey.astype(np.float64)
        near = (1.0 - a) * g[j, i] + a * g[j, i + 1]
        far = (1.0 - a) * g[j + 1, i] + a * g[j + 1, i + 1]
        return np.asarray((1.0 - b) * near + b * far)


@dataclass(frozen=True)
class Area:
    """Part of a surface that a texture covers."""

    around: tuple[float, float]
    """First and last place around [m]."""
    along: tuple[float, float]
    """First and last place along the generator [m]."""

    def __post_init__(self) -> None:
        for name, (low, high) in (("around", self.around), ("along", self.along)):
            if not (np.isfinite(low) and np.isfinite(high) and high > low):
                raise ValueError(
                    f"{name} must be a first and a larger last place in metres, got {low}, {high}"
                )

    @property
    def size(self) -> float:
        """Area [m²]."""
        return (self.around[1] - self.around[0]) * (self.along[1] - self.along[0])

    def grid(self, pitch: float) -> tuple[FloatArray, FloatArray]:
        """Places of texels around and along [m], shapes [columns] and [rows]."""

        def places(low: float, high: float) -> FloatArray:
            return np.asarray(low + pitch * np.arange(int(np.ceil((high - low) / pitch)) + 2))

        return places(*self.around), places(*self.along)


def plain(area: Area, pitch: float, *, level: float, grain: float = 0.0, seed: int = 0) -> Texture:
    """Bare material: one reflectance, with a fine grain of that standard deviation [-]."""
    across, along = area.grid(pitch)
    noise = np.random.default_rng(seed).standard_normal((len(along), len(across)))
    grey = np.clip(level + grain * noise, 0.0, 1.0).astype(np.float32)
    return Texture(grey, pitch, (area.around[0], area.along[0]))


def waves(
    area: Area, pitch: float, *, vectors: FloatArray, phases: FloatArray, level: float, height: float
) -> Texture:
    """Sum of cosines ``level + height Σ cos(2π (kx around + ky along) + φ)``, with a known integral.

    Parameters
    ----------
    area
        What it covers.
    pitch
        Of the texels [m].
    vectors
        (kx, ky) [1/m], shape [n, 2].
    phases
        φ [rad], shape [n].
    level, height
        Mean and amplitude [-].
    """
    across, along = area.grid(pitch)
    grey = np.full((len(along), len(across)), level)
    for (kx, ky), phase in zip(vectors, phases, strict=True):
        grey += height * np.cos(2.0 * np.pi * (kx * across[None] + ky * along[:, None]) + phase)
    return Texture(grey.astype(np.float32), pitch, (area.around[0], area.along[0]))
