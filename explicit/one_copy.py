"""Several small arrays on a device from one allocation and one copy.

Each allocation and copy of its own takes some ten microseconds, whatever its size, and a batch has twenty.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

APART = 256
"""Every array begins at a multiple of so many bytes, as one of its own would."""


def in_one_copy(values: Mapping[str, tuple[NDArray[Any], Any]], where: Any) -> dict[str, Any]:
    """Arrays on a device, by name.

    Parameters
    ----------
    values
        Numbers and the Warp type that they are to have there, by name.
    where
        The device.
    """
    found = {name: (_as(numbers, dtype), dtype) for name, (numbers, dtype) in values.items()}
    places, end = {}, 0
    for name, (numbers, _) in found.items():
        places[name] = end
        end += -(-max(numbers.nbytes, 1) // APART) * APART
    piece = np.zeros(end, dtype=np.uint8)
    for name, (numbers, _) in found.items():
        piece[places[name] : places[name] + numbers.nbytes] = numbers.reshape(-1).view(np.uint8)
    memory: Any = wp.array(piece, dtype=wp.uint8, device=where)
    arrays = {}
    for name, (numbers, dtype) in found.items():
        array: Any = wp.array(ptr=memory.ptr + places[name], dtype=dtype, shape=numbers.shape, device=where)
        array._ref = memory  # which lives as long as its parts
        arrays[name] = array
    return arrays


def _as(numbers: NDArray[Any], dtype: Any) -> NDArray[Any]:
    """Numbers as a Warp type has them in memory; those of a struct are of its own type already."""
    if numbers.dtype.names is not None:
        return np.ascontiguousarray(numbers)
    return np.ascontiguousarray(numbers, wp.dtype_to_numpy(dtype))
