"""The two precisions a kernel can be generated in."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp


@dataclass(frozen=True)
class Precision:
    """Scalar and vector types of one precision."""

    name: str
    """ "fp32" or "fp64"."""
    real: Any
    """Warp scalar type."""
    vec2: Any
    """Warp 2-vector."""
    vec4: Any
    """Warp 4-vector: the four corners of an element."""
    vec5: Any
    """Warp 5-vector: an axisymmetric symmetric tensor (rr, yy, ry, tt) and one scalar."""
    dtype: Any
    """NumPy scalar type."""


_VEC5 = {real: wp.types.vector(length=5, dtype=real) for real in (wp.float32, wp.float64)}

PRECISIONS = {
    "fp32": Precision("fp32", wp.float32, wp.vec2f, wp.vec4f, _VEC5[wp.float32], np.float32),
    "fp64": Precision("fp64", wp.float64, wp.vec2d, wp.vec4d, _VEC5[wp.float64], np.float64),
}


def precision(name: str) -> Precision:
    """Look a precision up by name.

    Raises
    ------
    ValueError
        If the name is not "fp32" or "fp64".
    """
    if name not in PRECISIONS:
        raise ValueError(f"precision must be one of {sorted(PRECISIONS)}, got {name!r}")
    return PRECISIONS[name]
