"""Arc that the rim of a bare platen, or the specimen's end on it, makes in a picture.

A camera that does not stand in the plane of the end sees a circle as an ellipse: several pixels higher in the
middle than at the flanks. Columns are taken in blocks; in each, rows of the specimen depart from the platen's
grey level, whether their paint is dark or bright, and rows of the platen do not. A parabola through the
blocks' edges, robust against one in which a spot ends early, is the arc.
"""

import numpy as np
from scipy.optimize import least_squares

from dic.arrays import FloatArray

BLOCKS = 8
"""Blocks of columns."""
NARROWEST = 8
"""Columns of a block, at least [px]."""
CLEAR = 4
"""Rows between the edge that is known roughly and those that are surely the platen's [px]."""
FEWEST = 3
"""Rows of the platen that tell its grey level."""
SHARE = 0.5
"""Share of what the specimen's rows depart from the platen's grey level by at which the edge is put."""
SPREAD = 0.4
"""Departure of a block's edge from the arc from which on it counts less [px]."""


def end_arc(picture: FloatArray, edge: float) -> FloatArray | None:
    """Row of a specimen's end in every column.

    Parameters
    ----------
    picture
        Mean picture at rest, the specimen above a bare platen, without its flanks, shape [rows, columns].
    edge
        Row at which the specimen ends in the mean of the columns [px].

    Returns
    -------
    array or None
        Shape [columns]; None where too little of the platen is in view, or too few columns.
    """
    rows, columns = picture.shape
    platen = int(np.ceil(edge)) + CLEAR
    if rows - platen < FEWEST or columns < BLOCKS * NARROWEST or platen - 3 * CLEAR < FEWEST:
        return None
    middles, edges = [], []
    for block in np.array_split(np.arange(columns), BLOCKS):
        middles.append(float(block.mean()))
        edges.append(block_edge(picture[:, block], platen))
    x, y = 2.0 * np.array(middles) / columns - 1.0, np.array(edges)
    basis = np.stack([np.ones(BLOCKS), x, x**2], axis=1)
    start = np.array([float(np.median(y)), 0.0, 0.0])
    fit = least_squares(lambda p: basis @ p - y, start, loss="soft_l1", f_scale=SPREAD)
    at = 2.0 * np.arange(columns) / columns - 1.0
    return np.asarray(np.stack([np.ones(columns), at, at**2], axis=1) @ fit.x)


def block_edge(block: FloatArray, platen: int) -> float:
    """Row at which a block of columns falls to the platen's grey level, between the last row of the specimen
    and the one below it [px].

    Parameters
    ----------
    block
        Grey values, shape [rows, columns].
    platen
        First row that is surely the platen's.
    """
    level = np.median(block[platen:])
    departs = np.sqrt(np.mean((block - level) ** 2, axis=1))
    limit = SHARE * float(np.median(departs[: platen - 2 * CLEAR]))
    last = int(np.flatnonzero(departs[:platen] >= limit)[-1])
    if last + 1 >= len(departs) or departs[last] <= departs[last + 1]:
        return float(last)
    return last + float((departs[last] - limit) / (departs[last] - departs[last + 1]))
