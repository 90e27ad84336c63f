"""Speckle pictures computed in closed form, to test what measures displacements.

A pattern is a sum of Gaussians in the material. A picture asks for its grey value at the material place
that each pixel sees, so that no interpolation is in it and the motion is exact.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray

Inverse = Callable[[FloatArray], FloatArray]
"""From places in a picture (x, y) [px] to those in the material picture, both of shape [..., 2]."""

REACH = 5.0
"""Spreads from its centre within which a speckle is certainly counted; 4e-6 of its height is left there."""


@dataclass(frozen=True)
class SpecklePattern:
    """Grey values of a material: ``level + Σ h exp(-|X - c|² / (2 s²))``."""

    centres: FloatArray
    """c, in the material picture (x, y) [px], shape [n, 2]."""
    heights: FloatArray
    """h [grey], shape [n]."""
    spread: float
    """s [px]."""
    level: float
    """Grey value far from any speckle [grey]."""

    def grey(self, X: FloatArray) -> FloatArray:
        """Grey values at places of the material picture [grey], shape [...].

        Parameters
        ----------
        X
            Places (x, y) [px], shape [..., 2].
        """
        X = np.asarray(X, dtype=np.float64)
        places = X.reshape(-1, 2)
        return self._sum(places).reshape(X.shape[:-1])

    @cached_property
    def _cells(self) -> tuple[FloatArray, NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Cells as wide as the reach: corner and shape of their grid, speckles by cell, first of each."""
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
        """Grey values at places, shape [n, 2]: cell by cell, with the speckles of nine cells."""
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
    """Speckles at random places, half of them darker and half brighter than the ground.

    Their autocorrelation is a Gaussian, so that the mean square of a gradient component is
    ``contrast² / (2 s²)`` with ``s = size / (4 √ln 2)``.

    Parameters
    ----------
    shape
        Rows and columns of the material picture [px].
    size
        Full width of the pattern's autocorrelation at half its height [px].
    contrast, level
        Standard deviation and mean of the grey value [grey].
    margin
        Width of the pattern beyond the picture [px].
    seed
        Of the random places.

    Raises
    ------
    ValueError
        A size or contrast that is not positive.
    """
    for name, value in (("size", size), ("contrast", contrast)):
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} must be positive, got {value}")
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

    Parameters
    ----------
    pattern
        What the material carries.
    shape
        Rows and columns [px].
    material
        The inverse motion: which material place a place of the picture shows; None: the same.
    fill
        Width of the square a pixel gathers light on, over the pixel pitch, 0 to 1. 0 samples the pixel's
        centre; above it the mean over the square is formed by 3 x 3 Gauss points.
    gain, offset
        Grey values are ``gain × pattern + offset``, as under another light.
    noise
        Standard deviation of Gaussian noise, independent from pixel to pixel [grey].
    bits
        The camera's depth: grey values are rounded, and saturate at 0 and 2**bits - 1. None: neither.
    seed
        Of the noise.

    Raises
    ------
    ValueError
        A fill outside 0 to 1, a noise that is negative, bits outside 1 to 16.
    """
    if not 0.0 <= fill <= 1.0:
        raise ValueError(f"fill must be from 0 to 1, got {fill}")
    if not (np.isfinite(noise) and noise >= 0.0):
        raise ValueError(f"noise must be finite and not negative, got {noise}")
    if bits is not None and not 1 <= bits <= 16:
        raise ValueError(f"bits must be from 1 to 16 or None, got {bits}")
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
