"""A target in a picture."""

import numpy as np
from numpy.typing import NDArray

from dic.calibration.targets.base import Detection, Target


def detect(picture: NDArray[np.generic], target: Target) -> Detection:
    """Points of a target in a picture.

    Parameters
    ----------
    picture
        Grey values of any depth, shape [rows, columns].
    target
        One of `dic.calibration.TARGETS`.

    Raises
    ------
    TargetNotFound
        If it is not seen, or not well enough to number its points.
    ValueError
        If the picture is not one grey picture.
    """
    return target.detect(picture)
