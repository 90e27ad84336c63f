"""Edges between bodies in a picture by the looks of neighbouring rows of pixels.

Speckles are several pixels wide, so a row of pixels across the axis looks like the row but one beside it.
Where one body ends and another begins it does not: there the correlation of two rows, one between them, falls
from 0.7 or more to about nothing, even if both bodies carry the same kind of speckles. At rest this gives the
specimen's ends. The flyer's edge is then followed through all frames as the path of least correlation.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import gaussian_filter1d

from dic.arrays import FloatArray
from dic.images import PictureError, Pictures

TURNS = {"up": 0, "right": 1, "down": 2, "left": 3}
"""Quarter turns that bring the flyer to the top."""
EVEN = 20.0
"""Standard deviation of the Gaussian that evens out the light along a row [px]."""
CLEAR = 0.5
"""An edge's correlation is less than this share of the median in the bodies."""
APART = 0.15
"""And by so much less than anywhere else on the same half of the specimen."""
FASTEST = 6
"""Rows that the flyer's edge may go from frame to frame [px]."""


def row_correlation(picture: FloatArray) -> FloatArray:
    """Correlation of the rows above and below each row, shape [rows]; 1 in the first and last, which have
    none."""
    f = picture - gaussian_filter1d(picture, EVEN, axis=1)
    above, below = f[:-2], f[2:]
    scale = np.sqrt(np.sum(above**2, axis=1) * np.sum(below**2, axis=1))
    found = np.sum(above * below, axis=1) / np.where(scale > 0.0, scale, 1.0)
    return np.pad(found, 1, constant_values=1.0)


def turned(picture: FloatArray, toward: str) -> FloatArray:
    """The picture with the flyer at the top."""
    return np.rot90(picture, TURNS[toward])


def clear_edge(pairs: FloatArray, likeness: FloatArray, where: str) -> int:
    """The row before the one clear edge among rows."""
    k = int(np.argmin(pairs))
    median = float(np.median(likeness))
    others = np.delete(pairs, np.arange(max(k - 3, 0), min(k + 4, pairs.size)))
    second = float(others.min(initial=1.0))
    if pairs[k] > CLEAR * median or pairs[k] > second - APART:
        raise ValueError(
            f"no clear edge is seen {where}: rows that span it correlate by {pairs[k]:.2f}, others by "
            f"{second:.2f} and more; declare the regions specimen and flyer, and transmission_edge"
        )
    return k


def followed_by_looks(
    pictures: Pictures, frames: Sequence[int], toward: str, inner: slice, start: int, farthest: int
) -> tuple[int, FloatArray, int]:
    """Track the flyer's edge by the path of least correlation from row `start` of the first frame; it never
    comes to row `farthest`. Returns the last frame, its picture, and the row before the edge."""
    cost, back, kept = None, [], []
    picture = np.empty(0)
    for k in frames:
        try:
            picture = turned(pictures.frame(k).astype(np.float64), toward)
        except PictureError:
            continue
        likeness = row_correlation(picture[:, inner])
        here = 0.5 * (likeness[:-1] + likeness[1:])
        here[farthest:] = np.inf
        if cost is None:
            cost = np.full(here.size, np.inf)
            cost[start] = here[start]
        else:
            steps = np.stack([_shifted(cost, step) for step in range(-1, FASTEST + 1)])
            back.append(np.argmin(steps, axis=0) - 1)
            cost = here + steps.min(axis=0)
        kept.append((k, here, float(np.median(likeness[:farthest]))))
    assert cost is not None  # a usable static frame was there
    row = int(np.argmin(cost))
    last, here, median = kept[-1]
    if here[row] > CLEAR * median:
        raise ValueError(
            f"the flyer's edge is lost on the way to frame {last}: rows that span it correlate by "
            f"{here[row]:.2f}, others by {median:.2f}; declare flyer, in a frame that shows much of it"
        )
    return last, picture, row


def _shifted(cost: FloatArray, step: int) -> FloatArray:
    """The cost of having been `step` rows further up."""
    moved = np.full(cost.size, np.inf)
    if step >= 0:
        moved[step:] = cost[: cost.size - step]
    else:
        moved[:step] = cost[-step:]
    return moved
