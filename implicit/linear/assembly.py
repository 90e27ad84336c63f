"""The matrices of the fronts of a dissected mesh, one after the other."""

from itertools import pairwise
from typing import Any

import numpy as np
import warp as wp

from explicit.arrays import FloatArray, IntArray
from implicit.linear.dissection import Front
from implicit.linear.kernels.fronts import assemble_kernel

Blocks = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""F11, F21, F12 and F22 of a front, column by column; F12 is empty of a symmetric one."""


class Assembly:
    """Where every number goes: tables that are made once for a mesh.

    What a front leaves for its parent stands on one of two stacks, those of an even and of an odd depth: a
    front is put upon its siblings, and its halves, which are given back then, end the other stack.
    """

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
        """Numbers in both stacks together."""
        self._at_22 = self._starts[:, 1] + np.where(self._starts[:, 0] == 1, stacks[0], 0)
        self._halves = np.array(halves, dtype=np.int64).reshape(-1, 4)
        self._halves[:, 0] = self._at_22[self._halves[:, 0]]
        self._runs = np.array(runs, dtype=np.int32).reshape(-1, 3)
        self.outside = np.concatenate([front.outside for front in fronts]).astype(np.int32)
        """Places of what each front leaves in the order of elimination, front by front."""
        ends = np.cumsum([front.left for front in fronts])
        self.places = np.column_stack([[front.start for front in fronts], np.concatenate([[0], ends[:-1]])])
        """Where each front's own unknowns begin in that order, and its part of `outside`, shape [n, 2]."""
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
        """Begin with the element matrices [m, k d, k d]; `lower`: only lower triangles are filled in."""
        p, q = self.shapes[:, 0].astype(np.int64), self.shapes[:, 1].astype(np.int64)
        sizes = np.stack([p * p, p * q, np.zeros_like(p) if lower else p * q], axis=1)
        starts = np.concatenate([[0], np.cumsum(sizes)])
        at = np.column_stack([starts[:-1].reshape(-1, 3), self._at_22])
        kept, left = np.zeros(int(starts[-1]), elements.dtype), np.empty(self.stack, elements.dtype)
        given = elements if lower else np.swapaxes(elements, 1, 2)
        tables = [self.shapes, at, np.ascontiguousarray(given), *self._of_cells, self._halves, self._runs]
        inputs = [0, *(wrapped(one) for one in tables), int(lower), wrapped(kept), wrapped(left)]
        kernel = assemble_kernel(wp.dtype_from_numpy(elements.dtype))
        launch: Any = wp.launch(kernel, 1, inputs=inputs, device="cpu", record_cmd=True)
        return Assembled(
            launch, self.shapes[:, :2].astype(np.int64), at, kept, left, lower=lower, inputs=inputs
        )


class Assembled:
    """The fronts of one matrix, which must be asked for in their order."""

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
        """Where F11, F21 and F12 of each front start in `kept`, and F22 on the stacks, shape [n, 4]."""
        self._sizes, self._at = sizes.tolist(), at.tolist()

    def front(self, number: int) -> Blocks:
        """Blocks of a front; F22 is read when its parent is asked for, and may be overwritten after that."""
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
    """Runs of a half's unknowns that are neighbours here too, all eliminated or none: where a run starts
    there, where here, and its length."""
    if len(places) == 0:
        return []
    ends = (np.diff(places) != 1) | (places[1:] == eliminated)
    starts = np.concatenate([[0], np.flatnonzero(ends) + 1, [len(places)]])
    return [(int(a), int(places[a]), int(b - a)) for a, b in pairwise(starts)]


def _block(values: FloatArray, start: int, rows: int, columns: int) -> FloatArray:
    return values[start : start + rows * columns].reshape(rows, columns, order="F")


def wrapped(values: Any) -> Any:
    """The same memory as an array of Warp."""
    return wp.array(values, device="cpu", copy=False)
