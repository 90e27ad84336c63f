"""Templates that are matched again and again, kept from one call to the next."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.arrays import IntArray
from dic.correlation.settings import Correlation

MOST_KEPT = 256 * 2**20
"""Memory that templates may take up [bytes]; more points than fit work theirs out anew in every call."""
PACK = 32
"""A subset's pixels are kept in whole packs of this many."""
ARRAYS = 4
"""Numbers of a pixel: grey value, its two slopes, whether it counts."""


@dataclass(frozen=True)
class Templates:
    """What the subsets of n points look like in their references, filled by `correlate` on a CPU.

    The owner must `forget` a point whose reference, or whose warp there, has changed.
    """

    pixels: NDArray[np.float32]
    """Of the subsets, shape [n, numbers]."""
    sums: NDArray[np.float64]
    """Over them, and the normal matrix of the match, shape [n, numbers]."""
    known: NDArray[np.int32]
    """1 where the others hold something, shape [n]."""
    settings: Correlation
    """What they are for."""
    bound: dict[str, Any] = field(default_factory=dict, compare=False, repr=False)
    """The arrays as a device names them; named anew in every call they would cost as much as some points."""

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
