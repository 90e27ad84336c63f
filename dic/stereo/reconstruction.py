"""Points in space from points in two pictures."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class Reconstruction:
    """Material points in the rig's frame, through the frames.

    NaN where the outcome is not VALID; but distances remain where both cameras found a point that does not
    meet, and pixels where that camera found it.
    """

    position: FloatArray
    """Places in the rig's frame [m], shape [n_frames, n_points, 3]."""
    covariance: FloatArray
    """Of the places, from the noise of the matches [m²], shape [n_frames, n_points, 3, 3]."""
    epipolar: FloatArray
    """Distance of camera 1's point from the epipolar line of camera 0's, signed [px],
    shape [n_frames, n_points]."""
    pixels: tuple[FloatArray, FloatArray]
    """Where the two cameras see the points [px], each of shape [n_frames, n_points, 2]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n_frames, n_points]."""
