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
    """Warp 4-vector: the four corners of an element, or an axisymmetric tensor (rr, yy, ry, tt)."""
    dtype: Any
    """NumPy scalar type."""


PRECISIONS = {
    "fp32": Precision("fp32", wp.float32, wp.vec2f, wp.vec4f, np.float32),
    "fp64": Precision("fp64", wp.float64, wp.vec2d, wp.vec4d, np.float64),
}


def precision(name: str) -> Precision:
    """Find a precision by its name. Raises ValueError if the name is not "fp32" or "fp64"."""
    if name not in PRECISIONS:
        raise ValueError(f"precision must be one of {sorted(PRECISIONS)}, got {name!r}")
    return PRECISIONS[name]
