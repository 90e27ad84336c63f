"""Points of one camera through all frames."""

from dataclasses import dataclass

from dic.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Track:
    """Subsets followed through a series, material picture and points fixed for the whole of it."""

    points: FloatArray
    """Places in the material picture (x, y) [px], shape [n_points, 2]."""
    warp: FloatArray
    """Total warps, shape [n_frames, n_points, 12]; meaningful where the outcome is VALID."""
    covariance: FloatArray
    """Of the position, noise of the match and of all reference updates before it [px²],
    shape [n_frames, n_points, 2, 2]."""
    zncc: FloatArray
    """Correlation with the reference used, shape [n_frames, n_points]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n_frames, n_points]."""
    reference: IntArray
    """Frame whose picture served as the reference, shape [n_frames, n_points]."""
    frame_outcome: IntArray | None = None
    """`dic.FrameOutcome` of the pictures, shape [n_frames]; None if nobody judged them."""
    excess: FloatArray | None = None
    """Variance of the residual beyond that of the noise, over the latter, the largest of all matches from the
    material picture on through the references used [-], shape [n_frames, n_points]; NaN where not found, None
    if nobody asked."""
    root: FloatArray | None = None
    """Covariance that the noise of the first reference alone gives the places, in the material picture [px²],
    shape [n_points, 2, 2]; NaN where it has no template, None where it is not known."""
