"""What became of a batch of subsets."""

from dataclasses import dataclass

from dic.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Match:
    """Where subsets were found, one row a subset; a row that is not VALID holds the last iterate."""

    warp: FloatArray
    """Total warps from the material picture (`dic.correlation.warp`), shape [n, 12]."""
    covariance: FloatArray
    """Of the position (x, y) from the pictures' noise [px²], shape [n, 2, 2]."""
    zncc: FloatArray
    """Zero-normalised cross-correlation at the end, 1 - ZNSSD/2, shape [n]."""
    iterations: IntArray
    """Updates made, shape [n]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n]."""
