"""Multifrontal factorisation of element matrices on a dissected mesh, by dense BLAS and LAPACK.

The cells are repeatedly halved along the longest axis of their centres (recursive coordinate bisection;
Berger and Bokhari 1987) down to small groups. An unknown belongs to the smallest part of the mesh that
contains all its cells. It is eliminated in this part. A front is the dense matrix of a part's unknowns and of
those on its boundary, which belong to its ancestors (Duff and Reid 1983; George 1973). Each front is
assembled from its cells or its two halves and partly eliminated,

    F = [F11 .; F21 F22],   F11 = L11 L11^T,   L21 = F21 L11^-T,   F22 <- F22 - L21 L21^T,        (F.1)

and the remainder goes to the parent. A matrix that is not symmetric, or not positive definite, is eliminated
by F11 = P L U in the same fronts instead. Rows are exchanged only inside a front. This is sufficient if every
unknown has a stiffness on the diagonal.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from explicit.arrays import FloatArray, IntArray
from kolsky.equilibrium.linear.base import SingularError
from kolsky.equilibrium.linear.kernels import assemble_kernel, substitution_kernel

LEAF_COMPONENTS = 350
"""Approximate number of displacement components of a leaf's cells. A smaller number gives more and smaller
fronts."""


@dataclass(frozen=True)
class Front:
    """One part of the mesh."""

    cells: IntArray
    """Cells that are assembled in this front. Only leaves have such cells."""
    local: IntArray
    """Place in the front of each component of those cells, shape [., k d]. Held components are beyond the
    last place."""
    unknowns: IntArray
    """Unknowns of the front: first the eliminated ones, then the boundary in the order of elimination."""
    eliminated: int
    children: tuple[int, ...]
    """Fronts that are added here."""
    places: tuple[IntArray, ...]
    """Positions of each child's boundary in this front, in increasing order."""
    start: int
    """Start of the eliminated unknowns in the order of elimination."""
    outside: IntArray
    """Positions of the other unknowns in that order."""

    @property
    def own(self) -> slice:
        """The eliminated unknowns in the order of elimination."""
        return slice(self.start, self.start + self.eliminated)

    @property
    def left(self) -> int:
        """Number of unknowns that remain for the parent."""
        return len(self.unknowns) - self.eliminated


def dissect(centres: FloatArray, components: IntArray, count: int) -> list[Front]:
    """Fronts in the order of elimination, children before parents.

    ``centres``: of the cells [m], shape [m, d]. ``components``: unknown of each component of a cell, -1 for a
    held one, shape [m, k d]. ``count``: number of unknowns.
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
    """Order of the cells, range of each part in it, and the parts of each part. Children come first."""
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
    """Number of cells in the first half. In a structured mesh, the cut is between layers near the middle."""
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
    """For each unknown, the smallest part that contains its first and its last cell."""
    owner = np.full(len(first), len(ranges) - 1)
    for number in range(len(ranges) - 1, -1, -1):  # parents first
        for child in children[number]:
            start, stop = ranges[child]
            inside = (owner == number) & (first >= start) & (last < stop)
            owner[inside] = child
    return owner


Blocks = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""F11, F21, F12 and F22 of a front, column by column. F12 is empty for a symmetric front."""


class Assembly:
    """Tables of positions for the assembly. They are made once for a mesh. The remainder of a front is on one
    of two stacks, for even and for odd depth. A front is put on top of its siblings. Its halves are at the
    top of the other stack and are then released."""

    def __init__(self, fronts: list[Front]) -> None:
        n = len(fronts)
        self.shapes, self._starts = np.zeros((n, 6), dtype=np.int32), np.zeros((n, 2), dtype=np.int64)
        depth = np.zeros(n, dtype=np.int64)
        for number in range(n - 1, -1, -1):
            for child in fronts[number].children:
                depth[child] = depth[number] + 1
        tops, stacks = [0, 0], [0, 0]
        halves: list[tuple[int, int, int, int]] = []
        runs: list[tuple[int, int, int]] = []
        n_cells = 0
        for number, front in enumerate(fronts):
            p, q, stack = front.eliminated, front.left, int(depth[number] % 2)
            self.shapes[number] = p, q, n_cells, n_cells + len(front.cells), len(halves), 0
            n_cells += len(front.cells)
            self._starts[number] = stack, tops[stack]
            tops[stack] += q * q
            stacks[stack] = max(stacks[stack], tops[stack])
            for child, places in zip(front.children, front.places, strict=True):
                found = _runs(places, p)
                halves.append((child, len(places), len(runs), len(found)))
                runs += found
            if front.children:
                tops[1 - stack] = int(self._starts[front.children[0], 1])
            self.shapes[number, 5] = len(halves)
        self.stack = sum(stacks)
        """Size of both stacks together."""
        self._at_22 = self._starts[:, 1] + np.where(self._starts[:, 0] == 1, stacks[0], 0)
        self._halves = np.array(halves, dtype=np.int64).reshape(-1, 4)
        self._halves[:, 0] = self._at_22[self._halves[:, 0]]
        self._runs = np.array(runs, dtype=np.int32).reshape(-1, 3)
        self.outside = np.concatenate([front.outside for front in fronts]).astype(np.int32)
        """Positions of the remainder of each front in the order of elimination, front by front."""
        ends = np.cumsum([front.left for front in fronts])
        self.places = np.column_stack([[front.start for front in fronts], np.concatenate([[0], ends[:-1]])])
        """Start of each front's unknowns in that order, and its part of `outside`, shape [n, 2]."""
        self._cells(fronts)

    def _cells(self, fronts: list[Front]) -> None:
        """Components of every cell in the order of their places."""
        local = np.concatenate([front.local for front in fronts])
        sizes = np.repeat(self.shapes[:, :2], np.diff(self.shapes[:, 2:4]).ravel(), axis=0)
        order = np.argsort(local, axis=1, kind="stable")
        places = np.take_along_axis(local, order, axis=1)
        inside = [(places < limit[:, None]).sum(axis=1) for limit in (sizes[:, 0], sizes.sum(axis=1))]
        self._of_cells = [
            np.concatenate([front.cells for front in fronts]).astype(np.int32),
            order.astype(np.int32),
            places.astype(np.int32),
            np.stack(inside, axis=1).astype(np.int32),
        ]

    def start(self, elements: FloatArray, *, lower: bool) -> "Assembled":
        """Start with the element matrices [m, k d, k d]. `lower`: only lower triangles are filled."""
        p, q = self.shapes[:, 0].astype(np.int64), self.shapes[:, 1].astype(np.int64)
        sizes = np.stack([p * p, p * q, np.zeros_like(p) if lower else p * q], axis=1)
        starts = np.concatenate([[0], np.cumsum(sizes)])
        at = np.column_stack([starts[:-1].reshape(-1, 3), self._at_22])
        kept, left = np.zeros(int(starts[-1]), elements.dtype), np.empty(self.stack, elements.dtype)
        given = elements if lower else np.swapaxes(elements, 1, 2)
        tables = [self.shapes, at, np.ascontiguousarray(given), *self._of_cells, self._halves, self._runs]
        inputs = [0, *(_warp_array(one) for one in tables), int(lower), _warp_array(kept), _warp_array(left)]
        kernel = assemble_kernel(wp.dtype_from_numpy(elements.dtype))
        launch: Any = wp.launch(kernel, 1, inputs=inputs, device="cpu", record_cmd=True)
        return Assembled(
            launch, self.shapes[:, :2].astype(np.int64), at, kept, left, lower=lower, inputs=inputs
        )


class Assembled:
    """The fronts of one matrix. They must be requested in their order."""

    def __init__(
        self,
        launch: Any,
        sizes: IntArray,
        at: IntArray,
        kept: FloatArray,
        left: FloatArray,
        *,
        lower: bool,
        inputs: list[Any],
    ) -> None:
        self._launch, self.kept, self._left, self._lower = launch, kept, left, lower
        self._inputs = inputs  # the launch does not keep its arrays alive
        self.at = at
        """Starts of F11, F21 and F12 of each front in `kept`, and of F22 on the stacks, shape [n, 4]."""
        self._sizes, self._at = sizes.tolist(), at.tolist()

    def front(self, number: int) -> Blocks:
        """Blocks of a front. F22 is read when its parent is requested, and may then be overwritten."""
        (p, q), (at_11, at_21, at_12, at_22) = self._sizes[number], self._at[number]
        F22 = _block(self._left, at_22, q, q)
        F22.fill(0.0)
        self._launch.set_param_at_index_from_ctype(0, number)
        self._launch.launch()
        kept = self.kept
        return (
            _block(kept, at_11, p, p),
            _block(kept, at_21, q, p),
            _block(kept, at_12, p, 0 if self._lower else q),
            F22,
        )


def _runs(places: IntArray, eliminated: int) -> list[tuple[int, int, int]]:
    """Runs (start in the half, start in the front, length) of a half's unknowns, all eliminated or none."""
    if len(places) == 0:
        return []
    ends = (np.diff(places) != 1) | (places[1:] == eliminated)
    starts = np.concatenate([[0], np.flatnonzero(ends) + 1, [len(places)]])
    return [(int(a), int(places[a]), int(b - a)) for a, b in pairwise(starts)]


def _block(values: FloatArray, start: int, rows: int, columns: int) -> FloatArray:
    return values[start : start + rows * columns].reshape(rows, columns, order="F")


def _warp_array(values: Any) -> Any:
    """A Warp array that shares the memory."""
    return wp.array(values, device="cpu", copy=False)


class _Substitution:
    """Factors that replace the fronts: L11 in F11 and L21 in F21."""

    def __init__(self, assembly: Assembly, assembled: Assembled) -> None:
        kept = assembled.kept
        sizes = assembly.shapes[:, :2].astype(np.int64)
        some = sizes[:, 0] > 0
        table = np.column_stack([sizes, assembled.at[:, :2], assembly.places])[some]
        self._scratch = np.empty(max(1, int(sizes[:, 1].max())), kept.dtype)
        self._given = [_warp_array(np.ascontiguousarray(one)) for one in (table, kept, assembly.outside)]
        self._kernel: Any = substitution_kernel(wp.dtype_from_numpy(kept.dtype))

    def solve(self, x: FloatArray) -> None:
        """Solve L L^T x = b in place, shape [n]. The unknowns are in the order of elimination."""
        inputs = [*self._given, _warp_array(x), _warp_array(self._scratch)]
        wp.launch(self._kernel, 1, inputs=inputs, device="cpu")


SMALLEST_PIVOT = {"d": 1e-13, "f": 1e-6}
"""Smallest pivot divided by the largest diagonal entry of the front, in double and single precision. Below
it, the matrix is singular."""
_BLAS, _LAPACK = ("trsm", "syrk", "gemm"), ("potrf", "getrf", "laswp")
ROUTINES: dict[str, dict[str, Any]] = {
    kind: dict(zip(_BLAS, get_blas_funcs(_BLAS, dtype=kind), strict=True))
    | dict(zip(_LAPACK, get_lapack_funcs(_LAPACK, dtype=kind), strict=True))
    for kind in "df"
}
"""Routines of BLAS and LAPACK in both precisions."""


class _IndefiniteError(ValueError):
    """Cholesky's factorisation does not exist."""


class Multifrontal:
    """A factorised matrix; see `kolsky.equilibrium.linear.base.Factors`."""

    def __init__(
        self, fronts: list[Front], assembly: Assembly, elements: FloatArray, count: int, *, symmetric: bool
    ) -> None:
        """Factorise the sum of element matrices of shape [m, k d, k d], in their precision. Raises
        SingularError if it is singular."""
        self.fronts, self.count, self.positive = fronts, count, symmetric
        self._order = np.concatenate([front.unknowns[: front.eliminated] for front in fronts])
        self._kind = elements.dtype
        if symmetric:
            try:
                self._blocks, assembled = _factorised(assembly, elements, _cholesky, lower=True)
                self._substitution = _Substitution(assembly, assembled)
                return
            except _IndefiniteError:
                self.positive = False
        self._blocks, _ = _factorised(assembly, elements, _lu, lower=False)

    def solve(self, right: FloatArray) -> FloatArray:
        """See `kolsky.equilibrium.linear.base.Factors`."""
        if self.positive and right.ndim == 1:
            return self._solve_one(right)
        x = np.asarray(right, dtype=self._kind).reshape(self.count, -1)[self._order]
        steps = [
            (front.own, front.outside, block, *_triangles(block))
            for front, block in zip(self.fronts, self._blocks, strict=True)
            if front.eliminated
        ]
        for own, outside, block, (triangle, options, beyond), _ in steps:
            given = x[own] if self.positive else x[own][block[1]]
            x[own] = _solved(triangle, given, **options)
            x[outside] -= beyond @ x[own]
        for own, outside, _, _, (triangle, options, beyond) in reversed(steps):
            x[own] = _solved(triangle, x[own] - beyond @ x[outside], **options)
        found = np.empty((self.count, x.shape[1]))
        found[self._order] = x
        return found.reshape(np.shape(right))

    def _solve_one(self, right: FloatArray) -> FloatArray:
        x = np.asarray(right, dtype=self._kind)[self._order]
        self._substitution.solve(x)
        found = np.empty(self.count)
        found[self._order] = x
        return found


Eliminate = Callable[[Blocks], tuple[FloatArray, ...]]
"""Function that eliminates a front in place and returns the factors; F22 becomes the remainder."""


def _factorised(
    assembly: Assembly, elements: FloatArray, eliminate: Eliminate, *, lower: bool
) -> tuple[list[tuple[FloatArray, ...]], Assembled]:
    """Factors of every front, and their storage; `lower`: only lower triangles are filled."""
    assembled = assembly.start(elements, lower=lower)
    return [eliminate(assembled.front(number)) for number in range(len(assembly.shapes))], assembled


def _cholesky(blocks: Blocks) -> tuple[FloatArray, ...]:
    F11, low, _, F22 = blocks
    if F11.size == 0:
        return F11, low
    largest = F11.diagonal().max()
    use = ROUTINES[F11.dtype.char]
    L, info = use["potrf"](F11, lower=1, clean=0, overwrite_a=1)
    if info != 0 or L.diagonal().min() ** 2 < SMALLEST_PIVOT[F11.dtype.char] * largest:
        raise _IndefiniteError
    if F22.size:
        low = use["trsm"](1.0, L, low, side=1, lower=1, trans_a=1, overwrite_b=1)
        use["syrk"](-1.0, low, beta=1.0, c=F22, lower=1, overwrite_c=1)
    return L, low


def _lu(blocks: Blocks) -> tuple[FloatArray, ...]:
    F11, low, right, F22 = blocks
    if F11.size == 0:
        return F11, np.zeros(0), low, right
    largest = max(np.abs(F11.diagonal()).max(), np.abs(F22.diagonal()).max(initial=0.0))
    use = ROUTINES[F11.dtype.char]
    LU, pivots, info = use["getrf"](F11, overwrite_a=1)
    least = np.abs(LU.diagonal()).min()
    if info != 0 or not least > SMALLEST_PIVOT[F11.dtype.char] * largest:
        raise SingularError(f"a pivot is {least:.3g} N/m: the stiffness is singular")
    if F22.size:
        right = use["laswp"](right, pivots, overwrite_a=1)
        right = use["trsm"](1.0, LU, right, lower=1, diag=1, overwrite_b=1)
        low = use["trsm"](1.0, LU, low, side=1, lower=0, overwrite_b=1)
        use["gemm"](-1.0, low, right, beta=1.0, c=F22, overwrite_c=1)
    rows = use["laswp"](np.arange(len(LU), dtype=LU.dtype)[:, None], pivots)[:, 0].astype(np.int64)
    return LU, rows, low, right


Triangle = tuple[FloatArray, dict[str, int], FloatArray]
"""A triangle of a front with its options for ``trsm``, and the block that couples it to the boundary."""


def _triangles(block: tuple[FloatArray, ...]) -> tuple[Triangle, Triangle]:
    """Lower and upper triangle of a front in the order of the substitutions."""
    if len(block) == 2:
        L, low = block
        return (L, {"lower": 1}, low), (L, {"lower": 1, "trans_a": 1}, low.T)
    LU, _rows, low, right = block
    return (LU, {"lower": 1, "diag": 1}, low), (LU, {"lower": 0}, right)


def _solved(L: FloatArray, right: FloatArray, **options: int) -> FloatArray:
    """Solution of a triangular system."""
    return np.asarray(ROUTINES[L.dtype.char]["trsm"](1.0, L, right, **options))
