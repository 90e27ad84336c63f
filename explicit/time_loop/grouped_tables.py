"""Tables of the mesh's constants, grouped so that neighbouring elements or nodes lie side by side.

Native accessors spend one address on what Warp's own subscripts would spend several instructions on;
`explicit.simd` gives them their meaning over packs.
"""

from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from explicit.precision import Precision

GROUP = 32
"""Elements or nodes whose constants lie side by side: those of a warp, or of a few packs."""
LOADED_BYTES = 16
"""What a thread of a GPU loads at once."""

_GROUP_OF = "const char* group = (const char*)table.data + (long long)((e >> SHIFT) * (int)table.strides[0]);"
_ENTRY = f"""
    {_GROUP_OF}
#if defined(__CUDA_ARCH__)
    return ((const TYPE*)group + (e & (GROUP - 1)) * MANY)[k / MANY * MANY * GROUP + k % MANY];
#else
    return ((const TYPE*)group + (e & (GROUP - 1)))[k * GROUP];
#endif
"""
_FOUR_ENTRIES = f"""
    {_GROUP_OF}
#if defined(__CUDA_ARCH__)
    const TYPE* first = (const TYPE*)group + (e & (GROUP - 1)) * MANY + k * GROUP;
    LOAD
#else
    const TYPE* number = (const TYPE*)group + (e & (GROUP - 1)) + k * GROUP;
    return wp::vec_t<4, TYPE>(number[0], number[GROUP], number[2 * GROUP], number[3 * GROUP]);
#endif
"""
_LOAD = {
    wp.float32: "const float4 x = *(const float4*)first;\n    return wp::vec_t<4, TYPE>(x.x, x.y, x.z, x.w);",
    wp.int32: "const int4 x = *(const int4*)first;\n    return wp::vec_t<4, TYPE>(x.x, x.y, x.z, x.w);",
    wp.float64: "const double2 x = *(const double2*)first, y = *(const double2*)(first + 2 * GROUP);\n"
    "    return wp::vec_t<4, TYPE>(x.x, x.y, y.x, y.y);",
}


@cache
def entry_function(dtype: Any) -> Any:
    """Generate ``entry(table, k, e)``: the k-th constant of element or node e of a grouped table."""

    @wp.func_native(snippet=_for_groups(_ENTRY, dtype))
    def entry(table: wp.array2d(dtype=dtype), k: int, e: int) -> dtype: ...

    return entry


@cache
def entries_function(dtype: Any) -> Any:
    """Generate ``entries(table, k, e) -> vec4``: constants k to k + 3; k is a multiple of four."""
    Four = wp.types.vector(4, dtype)

    @wp.func_native(snippet=_for_groups(_FOUR_ENTRIES, dtype))
    def entries(table: wp.array2d(dtype=dtype), k: int, e: int) -> Four: ...  # type: ignore[valid-type]

    return entries


@cache
def entries_if_function(dtype: Any) -> Any:
    """Generate ``entries_if(wanted, table, k, e) -> vec4``: the same where `wanted` is 1; elsewhere they may
    be anything, and a GPU does not load them."""
    Four = wp.types.vector(4, dtype)
    unwanted = f"if (wanted != 1) return wp::vec_t<4, wp::{dtype.__name__}>();"

    @wp.func_native(snippet=unwanted + _for_groups(_FOUR_ENTRIES, dtype))
    def entries_if(wanted: int, table: wp.array2d(dtype=dtype), k: int, e: int) -> Four: ...  # type: ignore[valid-type]

    return entries_if


def _for_groups(snippet: str, dtype: Any) -> str:
    many = LOADED_BYTES // np.dtype(wp.dtype_to_numpy(dtype)).itemsize
    snippet = snippet.replace("LOAD", _LOAD[dtype]).replace("TYPE", f"wp::{dtype.__name__}")
    snippet = snippet.replace("GROUP", str(GROUP)).replace("SHIFT", str(GROUP.bit_length() - 1))
    return snippet.replace("MANY", str(many))


_FOUR = """
#if defined(__CUDA_ARCH__)
    const TYPE* first = (const TYPE*)row.data + place;
    QUAD
#else
    const TYPE* number = (const TYPE*)row.data + place;
    return wp::vec_t<4, TYPE>(number[0], number[1], number[2], number[3]);
#endif
"""
_QUAD = {
    wp.float32: _LOAD[wp.float32],
    wp.float64: _LOAD[wp.float64].replace("2 * GROUP", "2"),
}
_FOUR_BACKWARD = """
    if (row.grad) for (int c = 0; c < 4; ++c) wp::atomic_add((TYPE*)row.grad + place + c, adj_ret[c]);
"""


@cache
def four_function(precision: Precision) -> Any:
    """Generate ``four(row, place)``: four numbers that follow each other in a row without gaps.

    A GPU loads them at once: `place` and the distance of rows are multiples of four.
    """
    real, vec4 = precision.real, precision.vec4
    whole = _FOUR.replace("QUAD", _QUAD[real])
    forward, backward = (text.replace("TYPE", f"wp::{real.__name__}") for text in (whole, _FOUR_BACKWARD))

    @wp.func_native(snippet=forward, adj_snippet=backward)
    def four(row: wp.array(dtype=real), place: int) -> vec4: ...

    return four


def grouped(table: NDArray[Any], *, loaded: int = 0) -> NDArray[Any]:
    """A table as `entry` and `entries` read it: from shape [constants, n] to [groups, constants * GROUP].

    In a group every constant has those of its elements side by side, so that a pack is one load. A GPU's
    thread loads `LOADED_BYTES` at once: with `loaded` bytes an element's next constants lie beside one.
    """
    constants, n = table.shape
    groups, many = -(-n // GROUP), max(loaded // table.dtype.itemsize, 1)
    padded = np.pad(table, [(0, -constants % many), (0, groups * GROUP - n)], mode="edge")
    split = padded.reshape(-1, many, groups, GROUP)
    return np.ascontiguousarray(split.transpose(2, 0, 3, 1)).reshape(groups, -1)
