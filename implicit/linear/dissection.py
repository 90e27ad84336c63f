r"""Nested dissection of a mesh by its elements, and where every number of a front goes.

The cells are halved again and again along the longest axis of their centres (recursive coordinate
bisection; Berger and Bokhari 1987) until few are left. An unknown belongs to the smallest part of the mesh
that holds all its cells, and is eliminated there: those inside a leaf in the leaf, those of the common face
of two halves in their parent. A front is the dense matrix of a part's own unknowns and of those of its
boundary, which belong to its ancestors (Duff and Reid 1983; George 1973).
"""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray, IntArray

LEAF_COMPONENTS = 350
"""Displacement components of all cells of a leaf, about: fewer make more and smaller fronts."""


@dataclass(frozen=True)
class Front:
    """One part of the mesh."""

    cells: IntArray
    """Cells that are assembled here (of a leaf; none of others)."""
    local: IntArray
    """Place in the front of each component of those cells, beyond the last for held ones, shape [., k d]."""
    unknowns: IntArray
    """Unknowns of the front, the eliminated ones first, then the boundary in the order of elimination."""
    eliminated: int
    """How many are eliminated here."""
    children: tuple[int, ...]
    """Fronts that are added here."""
    places: tuple[IntArray, ...]
    """Places here of the boundary of each child, in rising order."""
    start: int
    """Where the eliminated ones begin in the order of elimination."""
    outside: IntArray
    """Places of the others in that order."""

    @property
    def own(self) -> slice:
        """The eliminated ones in the order of elimination."""
        return slice(self.start, self.start + self.eliminated)

    @property
    def left(self) -> int:
        """How many unknowns are left over for the parent."""
        return len(self.unknowns) - self.eliminated


def dissect(centres: FloatArray, components: IntArray, count: int) -> list[Front]:
    """Fronts in the order of elimination, children before parents.

    Parameters
    ----------
    centres : array, shape [m, d]
        Centres of the cells [m].
    components : array, shape [m, k d]
        Unknown of each component of a cell; -1: it is held.
    count : int
        Number of unknowns.
    """
    leaf_cells = max(1, LEAF_COMPONENTS // components.shape[1])
    order, ranges, children = _bisect(centres, leaf_cells)
    position = np.empty(len(order), dtype=np.int64)
    position[order] = np.arange(len(order))
    # first and last position of the cells of every unknown
    flat, where = components.ravel(), np.repeat(position, components.shape[1])
    free = flat >= 0
    first, last = np.full(count, len(order)), np.full(count, -1)
    np.minimum.at(first, flat[free], where[free])
    np.maximum.at(last, flat[free], where[free])
    owner = _owners(first, last, ranges, children)
    by_owner = np.argsort(owner, kind="stable")
    starts = np.searchsorted(owner[by_owner], np.arange(len(ranges) + 1))
    rank = np.empty(count, dtype=np.int64)
    rank[by_owner] = np.arange(count)  # the order of elimination: fronts come children first
    fronts: list[Front] = []
    boundaries: list[IntArray] = []
    place = np.full(count + 1, -1)
    for number, ((start, stop), below) in enumerate(zip(ranges, children, strict=True)):
        own = by_owner[starts[number] : starts[number + 1]]
        cells = order[start:stop] if not below else np.zeros(0, dtype=np.int64)
        touched = (
            np.unique(components[cells])
            if not below
            else np.unique(np.concatenate([boundaries[c] for c in below]))
        )
        touched = touched[touched >= 0]
        outside = touched[owner[touched] != number]
        outside = outside[np.argsort(rank[outside])]
        unknowns = np.concatenate([own, outside])
        place[unknowns] = np.arange(len(unknowns))
        place[-1] = len(unknowns)
        local = place[components[cells]]
        places = tuple(place[boundaries[c]] for c in below)
        boundaries.append(outside)
        starts_at = int(starts[number])
        fronts.append(Front(cells, local, unknowns, len(own), below, places, starts_at, rank[outside]))
    return fronts


def _bisect(
    centres: FloatArray, leaf_cells: int
) -> tuple[IntArray, list[tuple[int, int]], list[tuple[int, ...]]]:
    """Order of the cells, range of each part in it, and the parts of each part, children first."""
    order = np.arange(len(centres))
    ranges: list[tuple[int, int]] = []
    children: list[tuple[int, ...]] = []

    def part(start: int, stop: int) -> int:
        below: tuple[int, ...] = ()
        if stop - start > leaf_cells:
            inside = centres[order[start:stop]]
            axis = int(np.argmax(np.ptp(inside, axis=0)))
            along = inside[:, axis]
            order[start:stop] = order[start:stop][np.argsort(along, kind="stable")]
            middle = start + _cut(np.sort(along))
            below = part(start, middle), part(middle, stop)
        ranges.append((start, stop))
        children.append(below)
        return len(ranges) - 1

    part(0, len(centres))
    return order, ranges, children


def _cut(along: FloatArray) -> int:
    """How many cells go into the first half: a plane between layers of a structured mesh, near the middle."""
    half = len(along) // 2
    span = along[-1] - along[0]
    jumps = np.flatnonzero(np.diff(along) > 1e-6 * span) + 1
    near = jumps[np.abs(jumps - half) <= 0.2 * len(along)]
    if len(near) == 0:
        return half
    return int(near[np.argmin(np.abs(near - half))])


def _owners(
    first: IntArray, last: IntArray, ranges: list[tuple[int, int]], children: list[tuple[int, ...]]
) -> IntArray:
    """The smallest part that holds the cells from the first to the last, of each unknown."""
    owner = np.full(len(first), len(ranges) - 1)
    for number in range(len(ranges) - 1, -1, -1):  # parents first
        for child in children[number]:
            start, stop = ranges[child]
            inside = (owner == number) & (first >= start) & (last < stop)
            owner[inside] = child
    return owner
