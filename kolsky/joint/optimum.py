"""Where a joint search ended."""

from dataclasses import dataclass

from kolsky.base.arrays import FloatArray
from kolsky.joint.records import Scatter


@dataclass(frozen=True)
class Optimum:
    """Where the search ended."""

    x: FloatArray
    """The optimum on the refined mesh, shape [d]."""
    start: FloatArray
    """That on the mesh of the search, shape [d]."""
    vector: FloatArray
    """All data as the refined mesh predicts them at `x`, shape [k]."""
    slopes: FloatArray
    """Derivatives there, shape [k, d]."""
    scatter: Scatter | None
    """Scatter between the shots; None if it was not asked for."""
    confirmed: bool
    """Whether the last run on the refined mesh left the optimum where it was."""
