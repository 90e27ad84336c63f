"""Sums of element matrices in the blocks of the leaves of a dissected mesh, for a CPU."""

from typing import Any

import warp as wp


@wp.kernel(enable_backward=False)
def add_elements(
    elements: wp.array3d(dtype=Any),
    cells: wp.array(dtype=wp.int32),
    places: wp.array2d(dtype=wp.int32),
    leaves: wp.array(dtype=wp.int32),
    shapes: wp.array2d(dtype=wp.int32),
    lower: int,
    kept: wp.array(dtype=Any),
    left: wp.array(dtype=Any),
):
    """Add every cell's matrix to the blocks of its leaf; launched over the cells.

    A leaf has p unknowns that are eliminated and q that are left; `shapes` has p, q and where its F11 (p, p),
    F21 (q, p) and F12 (p, q) start in `kept`, and its F22 (q, q) in `left`, each column by column. A
    component whose place is p + q is held. With `lower` 1 only entries on and below the diagonal are summed,
    and there is no F12. Several cells add to one entry: on a CPU a launch is one loop.
    """
    c = wp.tid()
    cell, leaf = cells[c], leaves[c]
    p, q = shapes[leaf, 0], shapes[leaf, 1]
    at_11, at_21, at_12, at_22 = shapes[leaf, 2], shapes[leaf, 3], shapes[leaf, 4], shapes[leaf, 5]
    for b in range(places.shape[1]):
        j = places[c, b]
        if j < p + q:
            for a in range(places.shape[1]):
                i = places[c, a]
                if i < p + q and (lower == 0 or i >= j):
                    value = elements[cell, a, b]
                    if j < p:
                        if i < p:
                            kept[at_11 + j * p + i] += value
                        else:
                            kept[at_21 + j * q + i - p] += value
                    elif i >= p:
                        left[at_22 + (j - p) * q + i - p] += value
                    else:
                        kept[at_12 + (j - p) * p + i] += value
