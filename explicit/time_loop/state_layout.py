"""Where a simulation's state and a mesh's constants lie, and how the time loop reaches them.

On a GPU the state of a simulation is in shared memory where it fits. Native accessors spend one address on
what Warp's own subscripts would spend several instructions on; `explicit.simd` gives them their meaning over
packs.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.precision import Precision

ON_CHIP_NODES, ON_CHIP_ELEMENTS, ON_CHIP_BOUNDARY, ON_CHIP_CONTROL = 448, 384, 96, 272
"""Places in shared memory for the state of a simulation in fp64; in fp32 there are twice as many nodes and
elements. Together with what reductions need, they fill the 48 KiB a block gets without a request."""


_FIELD = """
    wp::array_t<TYPE> row;
    row.data = (TYPE*)((char*)fields.data + (long long)sample * fields.strides[0]);
    row.shape[0] = 0; // nothing is counted from the end, so no subscript need be tested
    row.strides[0] = sizeof(TYPE);
    row.ndim = 1;
    return row;
"""
_FIELD_ON_CHIP = """
    wp::array_t<TYPE> row;
#if defined(__CUDA_ARCH__)
    __shared__ TYPE pool[ROOM];
    row.data = pool + offset;
#else
    row.data = (TYPE*)((char*)fields.data + (long long)sample * fields.strides[0]);
#endif
    row.shape[0] = 0; // nothing is counted from the end, so no subscript need be tested
    row.strides[0] = sizeof(TYPE);
    row.ndim = 1;
    return row;
"""
_PLACES = """
#if defined(__CUDA_ARCH__)
    return PLACES;
#else
    return n;
#endif
"""


@dataclass(frozen=True)
class StateLayout:
    """Where the state of a simulation lies."""

    field: Any
    """``field(fields, sample, offset)``: a simulation's row of an array of fields or corner forces; in shared
    memory at an offset in numbers, where the state is on the chip."""
    sums: Any
    """The same for sums of the boundary."""
    marks: Any
    """The same for its marks."""
    remembered: Any
    """The same for what elements remember, which is too much for a chip."""
    elements: int
    """Places for elements on the chip."""
    node_stride: Any
    """``node_stride(n)``: places for the nodes of a field, n or what the chip has."""
    corner_stride: Any
    """``corner_stride(n)``: places for corner forces of one corner, n or what the chip has."""


@cache
def state_layout(precision: Precision, on_chip: bool) -> StateLayout:
    """Generate the places of the state."""
    more = 8 // precision.dtype().itemsize
    nodes, elements = more * ON_CHIP_NODES, more * ON_CHIP_ELEMENTS
    return StateLayout(
        field=_field(precision.real, 4 * nodes + 8 * elements + 2, on_chip),
        sums=_field(wp.float64, 3 * ON_CHIP_BOUNDARY + ON_CHIP_CONTROL, on_chip),
        marks=_field(wp.int32, ON_CHIP_BOUNDARY, on_chip),
        remembered=_field(precision.real, 0, False),
        elements=elements,
        node_stride=_places(nodes, on_chip),
        corner_stride=_places(elements, on_chip),
    )


def _field(dtype: Any, room: int, on_chip: bool) -> Any:
    snippet = (_FIELD_ON_CHIP if on_chip else _FIELD).replace("TYPE", f"wp::{dtype.__name__}")

    @wp.func_native(snippet=snippet.replace("ROOM", str(room)))
    def field(fields: wp.array2d(dtype=dtype), sample: int, offset: int) -> wp.array(dtype=dtype): ...

    return field


def _places(count: int, on_chip: bool) -> Any:
    snippet = _PLACES.replace("PLACES", str(count)) if on_chip else "return n;"

    @wp.func_native(snippet=snippet)
    def places(n: int) -> int: ...

    return places


def fits(n_nodes: int, n_elements: int, n_boundary: int, precision: Precision) -> bool:
    """Whether the state of one simulation fits into a GPU's shared memory."""
    more = 8 // precision.dtype().itemsize
    room = (more * ON_CHIP_NODES, more * ON_CHIP_ELEMENTS, ON_CHIP_BOUNDARY)
    return n_nodes <= room[0] and n_elements <= room[1] and n_boundary <= room[2]
