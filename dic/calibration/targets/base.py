"""Protocol of calibration targets, and what they share."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray, IntArray


class TargetNotFound(ValueError):
    """A picture in which a target could not be recognised; the text says what was seen instead."""


@dataclass(frozen=True)
class Detection:
    """Points of a target in one picture."""

    ids: IntArray
    """Numbers of the target's points, shape [n]."""
    pixels: FloatArray
    """Observed pixels [px], shape [n, 2]."""
    sigma: FloatArray
    """Standard deviation of a coordinate from the picture's noise [px], shape [n]."""

    def __post_init__(self) -> None:
        n = len(self.ids)
        if self.pixels.shape != (n, 2) or self.sigma.shape != (n,):
            raise ValueError(
                f"{n} ids need pixels [{n}, 2] and sigma [{n}], got {self.pixels.shape}, {self.sigma.shape}"
            )
        if len(np.unique(self.ids)) != n:
            raise ValueError("a point of a target can be seen once in a picture; ids hold one twice")
        if not (np.all(np.isfinite(self.pixels)) and np.all(self.sigma > 0.0)):
            raise ValueError("pixels must be finite and sigma positive")


@dataclass(frozen=True)
class Geometry:
    """A target's points in its own frame: what the solve needs to know of it."""

    points: FloatArray
    """Places [m], shape [n, 3]."""
    normals: FloatArray
    """Unit vectors off the surface, shape [n, 3]; they matter where `spread` is not zero."""
    spread: FloatArray
    """Second moment per axis, in the surface, of what a point's centroid is taken over [m²], shape [n]:
    r²/4 of a disc, zero of a corner."""
    bend: FloatArray
    """Direction of the surface's curvature times its root [m^-½], shape [n, 3]; zero if flat."""
    equivalents: IntArray
    """Numberings that look the same, each shape [n], the identity first, shape [m, n]."""


@runtime_checkable
class Target(Protocol):
    """A calibration target: a frozen dataclass with its dimensions in metres."""

    def geometry(self) -> Geometry:
        """Its points."""

    def detect(self, picture: NDArray[np.generic]) -> Detection:
        """Its points in a picture.

        Raises
        ------
        TargetNotFound
            If it is not seen, or not well enough to number its points.
        """


def positive(**lengths: float) -> None:
    """Refuse lengths that are not positive and finite.

    Raises
    ------
    ValueError
        Naming the length.
    """
    for name, value in lengths.items():
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} must be a positive length in metres, got {value}")


def counts(least: int, **numbers: int) -> None:
    """Refuse numbers of columns or rows outside `least` to 1000.

    Raises
    ------
    ValueError
        Naming the number.
    """
    for name, value in numbers.items():
        if not (isinstance(value, int) and least <= value <= 1000):
            raise ValueError(f"{name} must be a whole number from {least} to 1000, got {value}")
