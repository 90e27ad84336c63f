"""Solution with the factors of all fronts, for one right-hand side on a CPU.

Every number of the factors is read once and enters one product: the time is that of the memory, where a call
of BLAS for each of the many small fronts takes as long again.
"""

from functools import cache
from typing import Any

import warp as wp

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
    """The kernel for a precision: one thread solves L L^T x = b in place.

    `fronts` has of each front p, q, where its L11 (p, p) and L21 (q, p) start in `kept`, its first unknown in
    `x` and its first place in `outside`; `scratch` holds the largest q.
    """

    @wp.func_native(FORWARD)
    def forward(
        p: wp.int64,
        q: wp.int64,
        at_11: wp.int64,
        at_21: wp.int64,
        first: wp.int64,
        at_outside: wp.int64,
        kept: wp.array(dtype=kind),
        outside: wp.array(dtype=wp.int32),
        x: wp.array(dtype=kind),
        scratch: wp.array(dtype=kind),
    ): ...

    @wp.func_native(BACKWARD)
    def backward(
        p: wp.int64,
        q: wp.int64,
        at_11: wp.int64,
        at_21: wp.int64,
        first: wp.int64,
        at_outside: wp.int64,
        kept: wp.array(dtype=kind),
        outside: wp.array(dtype=wp.int32),
        x: wp.array(dtype=kind),
        scratch: wp.array(dtype=kind),
    ): ...

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
                fronts[i, 0],
                fronts[i, 1],
                fronts[i, 2],
                fronts[i, 3],
                fronts[i, 4],
                fronts[i, 5],
                kept,
                outside,
                x,
                scratch,
            )
        for k in range(n):
            j = n - 1 - k
            backward(
                fronts[j, 0],
                fronts[j, 1],
                fronts[j, 2],
                fronts[j, 3],
                fronts[j, 4],
                fronts[j, 5],
                kept,
                outside,
                x,
                scratch,
            )

    return substitute
