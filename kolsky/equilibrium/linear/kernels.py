"""Warp kernels of the factorisation.

They fill fronts, and solve one system with their factors.

The matrix of a front is a sum of element matrices, or of the remainders of its two halves. The sums are plain
loops over memory, written in C++ for a CPU. With Warp's index arithmetic they take ten times as long. A
substitution reads every number of the factors once. Its time is therefore limited by the memory.
"""

from functools import cache
from typing import Any

import warp as wp

ELEMENT = """
    const int* at = places.data + (long long)c * width;
    const int* take = order.data + (long long)c * width;
    const auto* values = elements.data + (long long)cells.data[c] * width * width;
    const int own = inside.data[2 * c], free = inside.data[2 * c + 1];
    auto* F11 = kept.data + at_11;
    auto* F21 = kept.data + at_21 - p;
    auto* F12 = kept.data + at_12;
    auto* F22 = left.data + at_22 - p;
    for (int b = 0; b < free; ++b) {
        const int j = at[b], first = lower ? b : 0, middle = first > own ? first : own;
        const auto* column = values + take[b] * width;
        auto* upper = j < p ? F11 + (long long)j * p : F12 + (long long)(j - p) * p;
        auto* under = j < p ? F21 + (long long)j * q : F22 + (long long)(j - p) * q;
        for (int a = first; a < own; ++a) upper[at[a]] += column[take[a]];
        for (int a = middle; a < free; ++a) under[at[a]] += column[take[a]];
        if (lower)  // two components of one unknown: both entries
            for (int a = b + 1; a < free && at[a] == j; ++a) (j < p ? upper : under)[j] += column[take[a]];
    }
"""
"""Adds the matrix of a cell, with its components in the order of their positions."""

HALF = """
    const auto* column = left.data + given;
    auto* F11 = kept.data + at_11;
    auto* F21 = kept.data + at_21 - p;
    auto* F12 = kept.data + at_12;
    auto* F22 = left.data + at_22 - p;
    const int* run = runs.data + 3 * first_run;
    for (int k = 0; k < n_runs; ++k) {
        for (int b = 0; b < run[3 * k + 2]; ++b) {
            const int j = run[3 * k + 1] + b;
            const auto* from = column + (long long)(run[3 * k] + b) * size;
            auto* upper = j < p ? F11 + (long long)j * p : F12 + (long long)(j - p) * p;
            auto* under = j < p ? F21 + (long long)j * q : F22 + (long long)(j - p) * q;
            for (int l = lower ? k : 0; l < n_runs; ++l) {
                const int source = run[3 * l], place = run[3 * l + 1], length = run[3 * l + 2];
                auto* into = (place < p ? upper : under) + place;
                for (int a = lower && l == k ? b : 0; a < length; ++a) into[a] += from[source + a];
            }
        }
    }
"""
"""Adds the remainder of a half, by runs of components that are contiguous in both."""


@cache
def assemble_kernel(kind: Any) -> Any:
    """The kernel for a precision. One thread adds to the front with the given number.

    F11, F21, F12 and F22 of a front are initially 0 and stored column by column. `shapes` has p, q and the
    front's first and last cell and half. `starts` has the starts of F11 (p, p), F21 (q, p) and F12 (p, q) in
    `kept`, and of F22 (q, q) in `left`. The components of a cell are in the order of their positions.
    `inside` has two numbers: the components that are eliminated here, and the unknowns. `elements` are
    transposed. `halves` has, for each half, the start of its matrix in `left`, its size, its first run and
    the number of runs. `runs` has, for each run, its start in the half, its start in the front, and its
    length. With `lower` 1, only entries on and below the diagonal are summed, and there is no F12.
    """

    @wp.func_native(ELEMENT)
    def add_element(
        c: int, p: int, q: int, at_11: wp.int64, at_21: wp.int64, at_12: wp.int64, at_22: wp.int64,
        width: int, lower: int, elements: wp.array3d(dtype=kind), cells: wp.array(dtype=wp.int32),
        order: wp.array2d(dtype=wp.int32), places: wp.array2d(dtype=wp.int32),
        inside: wp.array2d(dtype=wp.int32), kept: wp.array(dtype=kind), left: wp.array(dtype=kind),
    ): ...  # fmt: skip

    @wp.func_native(HALF)
    def add_half(
        given: wp.int64, size: wp.int64, first_run: wp.int64, n_runs: wp.int64, p: int, q: int,
        at_11: wp.int64, at_21: wp.int64, at_12: wp.int64, at_22: wp.int64, lower: int,
        runs: wp.array2d(dtype=wp.int32), kept: wp.array(dtype=kind), left: wp.array(dtype=kind),
    ): ...  # fmt: skip

    @wp.kernel(module="unique", enable_backward=False)
    def assemble(
        front: int,
        shapes: wp.array2d(dtype=wp.int32),
        starts: wp.array2d(dtype=wp.int64),
        elements: wp.array3d(dtype=kind),
        cells: wp.array(dtype=wp.int32),
        order: wp.array2d(dtype=wp.int32),
        places: wp.array2d(dtype=wp.int32),
        inside: wp.array2d(dtype=wp.int32),
        halves: wp.array2d(dtype=wp.int64),
        runs: wp.array2d(dtype=wp.int32),
        lower: int,
        kept: wp.array(dtype=kind),
        left: wp.array(dtype=kind),
    ):
        p, q = shapes[front, 0], shapes[front, 1]
        at_11, at_21, at_12, at_22 = starts[front, 0], starts[front, 1], starts[front, 2], starts[front, 3]
        width = places.shape[1]
        for c in range(shapes[front, 2], shapes[front, 3]):
            add_element(
                c, p, q, at_11, at_21, at_12, at_22, width, lower, elements, cells, order, places, inside,
                kept, left,
            )  # fmt: skip
        for h in range(shapes[front, 4], shapes[front, 5]):
            add_half(
                halves[h, 0], halves[h, 1], halves[h, 2], halves[h, 3], p, q, at_11, at_21, at_12, at_22,
                lower, runs, kept, left,
            )  # fmt: skip

    return assemble


FORWARD = """
    const auto* L = kept.data + at_11;
    const auto* low = kept.data + at_21;
    auto* own = x.data + first;
    auto* sum = scratch.data;
    for (int i = 0; i < q; ++i) sum[i] = 0;
    for (int j = 0; j < p; ++j) {
        const auto value = own[j] / L[j];
        own[j] = value;
        for (int i = j + 1; i < p; ++i) own[i] -= L[i] * value;
        for (int i = 0; i < q; ++i) sum[i] += low[i] * value;
        L += p;
        low += q;
    }
    for (int i = 0; i < q; ++i) x.data[outside.data[at_outside + i]] -= sum[i];
"""
"""y1 = L11^-1 x1, x2 -= L21 y1."""

BACKWARD = """
    const auto* L = kept.data + at_11 + (long long)(p - 1) * p;
    const auto* low = kept.data + at_21 + (long long)(p - 1) * q;
    auto* own = x.data + first;
    auto* given = scratch.data;
    for (int i = 0; i < q; ++i) given[i] = x.data[outside.data[at_outside + i]];
    for (int j = p - 1; j >= 0; --j) {
        auto sum = own[j];
        decltype(sum) part[16] = {0};
        int i = 0;
        for (; i + 16 <= q; i += 16)
            for (int k = 0; k < 16; ++k) part[k] += low[i + k] * given[i + k];
        for (; i < q; ++i) sum -= low[i] * given[i];
        for (i = j + 1; i + 16 <= p; i += 16)
            for (int k = 0; k < 16; ++k) part[k] += L[i + k] * own[i + k];
        for (; i < p; ++i) sum -= L[i] * own[i];
        for (int k = 0; k < 16; ++k) sum -= part[k];
        own[j] = sum / L[j];
        L -= p;
        low -= q;
    }
"""
"""x1 = L11^-T (y1 - L21^T x2)."""


@cache
def substitution_kernel(kind: Any) -> Any:
    """The kernel for a precision. One thread solves L L^T x = b in place. For each front, `fronts` has p, q,
    the starts of its L11 (p, p) and L21 (q, p) in `kept`, its first unknown in `x` and its first place in
    `outside`. `scratch` has room for the largest q."""

    @wp.func_native(FORWARD)
    def forward(
        p: wp.int64, q: wp.int64, at_11: wp.int64, at_21: wp.int64, first: wp.int64, at_outside: wp.int64,
        kept: wp.array(dtype=kind), outside: wp.array(dtype=wp.int32), x: wp.array(dtype=kind),
        scratch: wp.array(dtype=kind),
    ): ...  # fmt: skip

    @wp.func_native(BACKWARD)
    def backward(
        p: wp.int64, q: wp.int64, at_11: wp.int64, at_21: wp.int64, first: wp.int64, at_outside: wp.int64,
        kept: wp.array(dtype=kind), outside: wp.array(dtype=wp.int32), x: wp.array(dtype=kind),
        scratch: wp.array(dtype=kind),
    ): ...  # fmt: skip

    @wp.kernel(module="unique", enable_backward=False)
    def substitute(
        fronts: wp.array2d(dtype=wp.int64),
        kept: wp.array(dtype=kind),
        outside: wp.array(dtype=wp.int32),
        x: wp.array(dtype=kind),
        scratch: wp.array(dtype=kind),
    ):
        n = fronts.shape[0]
        for i in range(n):
            forward(
                fronts[i, 0], fronts[i, 1], fronts[i, 2], fronts[i, 3], fronts[i, 4], fronts[i, 5], kept,
                outside, x, scratch,
            )  # fmt: skip
        for k in range(n):
            j = n - 1 - k
            backward(
                fronts[j, 0], fronts[j, 1], fronts[j, 2], fronts[j, 3], fronts[j, 4], fronts[j, 5], kept,
                outside, x, scratch,
            )  # fmt: skip

    return substitute
