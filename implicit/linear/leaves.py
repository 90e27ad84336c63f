"""The matrices of the leaves of a dissected mesh: sums of element matrices, many leaves at a time."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import warp as wp

from explicit.arrays import FloatArray
from implicit.linear.dissection import Front
from implicit.linear.kernels.fronts import add_elements

GROUP = 4_000_000
"""Numbers in the blocks of the leaves that are assembled at a time, about."""

Blocks = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""F11, F21, F12 and F22 of a front, column by column; F12 is empty of a symmetric one."""


def leaves(fronts: list[Front], elements: FloatArray, *, lower: bool) -> Iterator[Blocks]:
    """Blocks of every leaf, in the order of the fronts; `lower`: only their lower triangles are filled in."""
    values = _wrapped(np.ascontiguousarray(elements))
    group: list[Front] = []
    size = 0
    for front in fronts:
        if not front.children:
            group.append(front)
            size += len(front.unknowns) ** 2
            if size > GROUP:
                yield from _assembled(group, values, lower=lower)
                group, size = [], 0
    if group:
        yield from _assembled(group, values, lower=lower)


def _assembled(group: list[Front], values: Any, *, lower: bool) -> list[Blocks]:
    kind = wp.dtype_to_numpy(values.dtype)
    shapes, blocks = np.zeros((len(group), 6), dtype=np.int32), []
    n_kept = n_left = 0
    for row, front in zip(shapes, group, strict=True):
        p, q = front.eliminated, front.left
        row[:] = p, q, n_kept, n_kept + p * p, n_kept + p * (p + q), n_left
        n_kept += p * (p + q) if lower else p * (p + 2 * q)
        n_left += q * q
    kept, left = np.zeros(n_kept, kind), np.zeros(n_left, kind)  # apart: what is left is given back sooner
    numbers = np.repeat(np.arange(len(group)), [len(front.cells) for front in group])
    given = (
        np.concatenate([front.cells for front in group]).astype(np.int32),
        np.concatenate([front.local for front in group]).astype(np.int32),
        numbers.astype(np.int32),
        shapes,
    )
    inputs = [values, *(_wrapped(one) for one in given), int(lower), _wrapped(kept), _wrapped(left)]
    wp.launch(add_elements, len(numbers), inputs=inputs, device="cpu")
    for p, q, at_11, at_21, at_12, at_22 in shapes.tolist():
        blocks.append(
            (
                _block(kept, at_11, p, p),
                _block(kept, at_21, q, p),
                _block(kept, at_12, p, 0 if lower else q),
                _block(left, at_22, q, q),
            )
        )
    return blocks


def _block(values: FloatArray, start: int, rows: int, columns: int) -> FloatArray:
    return values[start : start + rows * columns].reshape(rows, columns, order="F")


def _wrapped(values: Any) -> Any:
    """The same memory as an array of Warp."""
    return wp.array(values, device="cpu", copy=False)
