"""The corners of an element: which nodes they are, and what a field has there."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from explicit.places import entries_function
from explicit.precision import Precision
from explicit.structs import Structs


@dataclass(frozen=True)
class CornerFunctions:
    """What a sweep over elements asks of their corners."""

    nodes: Any
    """``nodes(body, e) -> vec4i``: the corner nodes of element e."""
    values: Any
    """``values(field, corners) -> vec4``: a field there."""


@cache
def corner_functions(precision: Precision, structs: Structs) -> CornerFunctions:
    """Generate the corners' functions."""
    real, vec4, Body = precision.real, precision.vec4, structs.Body
    nodes_at = entries_function(wp.int32)

    @wp.func
    def nodes(body: Body, e: int):
        return nodes_at(body.quads, 0, e)

    @wp.func
    def values(field: wp.array(dtype=real), corners: wp.vec4i):
        return vec4(field[corners[0]], field[corners[1]], field[corners[2]], field[corners[3]])

    return CornerFunctions(nodes, values)
