"""Settings of a subset match, its result, and templates kept from one call to the next."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray, IntArray
from dic.correlation.warp import Shape


@dataclass(frozen=True, kw_only=True)
class Correlation:
    """Settings of the match of one subset.

    Raises
    ------
    ValueError
        A value outside its range; the message names it.
    """

    subset: int = 21
    """Side of the square subset in the material picture [px]: odd, 5 to 101."""
    shape: Shape = Shape.AFFINE
    """Shape function."""
    prefilter: float = 0.0
    """Standard deviation of the Gaussian that both pictures are smoothed with [px]; 0: none."""
    max_iterations: int = 30
    """A point that needs more ends as NOT_CONVERGED."""
    tolerance: float = 1e-3
    """Converged when the last update moves no corner of the subset by more than this [px]."""
    least_zncc: float = 0.7
    """A point that ends below this zero-normalised cross-correlation is LOW_CORRELATION (1 - ZNSSD/2)."""
    least_pixels: float = 0.5
    """Share of the subset that must lie inside the mask and the pictures; less is OUT_OF_VIEW."""

    def __post_init__(self) -> None:
        checks = (
            ("subset", self.subset % 2 == 1 and 5 <= self.subset <= 101, "odd, from 5 to 101 px"),
            ("prefilter", 0.0 <= self.prefilter <= 5.0, "from 0 to 5 px"),
            ("max_iterations", self.max_iterations >= 1, "at least 1"),
            ("tolerance", 0.0 < self.tolerance < 0.1, "above 0 and below 0.1 px"),
            ("least_zncc", 0.0 <= self.least_zncc < 1.0, "from 0 to below 1"),
            ("least_pixels", 0.0 < self.least_pixels <= 1.0, "above 0, at most 1"),
        )
        for name, fine, allowed in checks:
            if not fine:
                raise ValueError(f"{name} must be {allowed}, got {getattr(self, name)}")


@dataclass(frozen=True)
class Match:
    """Result of matching subsets, one row a subset; a row that is not VALID holds the last iterate."""

    warp: FloatArray
    """Total warps from the material picture (`dic.correlation.warp`), shape [n, 12]."""
    covariance: FloatArray
    """Of the position (x, y) from the pictures' noise [px²], shape [n, 2, 2]."""
    zncc: FloatArray
    """Zero-normalised cross-correlation at the end, 1 - ZNSSD/2, shape [n]."""
    iterations: IntArray
    """Updates made, shape [n]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n]."""


MOST_KEPT = 256 * 2**20
"""Memory that templates may take up [bytes]; more points than fit work theirs out anew in every call."""
PACK = 32
"""A subset's pixels are kept in whole packs of this many."""
ARRAYS = 4
"""Numbers of a pixel: grey value, its two slopes, whether it counts."""


@dataclass(frozen=True)
class Templates:
    """Templates of n points in their references, filled by `correlate` on a CPU.

    The owner must `forget` a point whose reference, or whose warp there, has changed.
    """

    pixels: NDArray[np.float32]
    """Of the subsets, shape [n, numbers]."""
    sums: NDArray[np.float64]
    """Over them, and the normal matrix of the match, shape [n, numbers]."""
    known: NDArray[np.int32]
    """1 where the others hold something, shape [n]."""
    settings: Correlation
    """Settings that they are for."""

    @classmethod
    def of(cls, n: int, settings: Correlation) -> "Templates | None":
        """Room for those of n points; None if there are too many to be kept."""
        k = int(settings.shape)
        pixels = ARRAYS * -(-(settings.subset**2) // PACK) * PACK
        sums = 9 + 3 * k + 2 * k * k
        if n * (4 * pixels + 8 * sums) > MOST_KEPT:
            return None
        return cls(np.empty((n, pixels), np.float32), np.empty((n, sums)), np.zeros(n, np.int32), settings)

    def forget(self, rows: IntArray | slice) -> None:
        """These points have changed."""
        self.known[rows] = 0
