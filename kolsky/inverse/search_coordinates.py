"""The coordinates of a search: 1 - 2 nu, logarithmic, in place of Poisson's ratio."""

from __future__ import annotations

import numpy as np

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.valleys import VALLEY


def search_box(box: Box) -> Box:
    """The box in the coordinates of the search: 1 - 2 nu, logarithmic, in place of Poisson's ratio.

    What spans decades is logarithmic too.
    """
    bounds = {name: (low, high) for name, low, high in zip(box.names, box.lower, box.upper, strict=True)}
    decades = [name for name in box.names if PARAMETERS[name].logarithmic]
    if VALLEY in bounds:
        low, high = bounds[VALLEY]
        bounds[VALLEY] = 1.0 - 2.0 * high, 1.0 - 2.0 * low
        decades.append(VALLEY)
    return Box.of(bounds, logarithmic=decades) if decades else box


def to_search(box: Box, points: FloatArray) -> FloatArray:
    """Points in the coordinates of the search, shape [..., d]."""
    x = np.array(points, dtype=np.float64)
    if VALLEY in box.names:
        i = box.names.index(VALLEY)
        x[..., i] = 1.0 - 2.0 * x[..., i]
    return x


def from_search(box: Box, points: FloatArray) -> FloatArray:
    """The inverse of `to_search`."""
    x = np.array(points, dtype=np.float64)
    if VALLEY in box.names:
        i = box.names.index(VALLEY)
        x[..., i] = 0.5 * (1.0 - x[..., i])
    return x
