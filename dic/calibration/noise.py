"""Grey values and their noise."""

import cv2
import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def grey(picture: NDArray[np.generic]) -> FloatArray:
    """A picture in float64.

    Raises
    ------
    ValueError
        If it is not one grey picture of at least 16 x 16 finite values.
    """
    image = np.asarray(picture)
    if image.ndim != 2 or min(image.shape) < 16:
        raise ValueError(
            f"a target's picture must be grey, [rows, columns] of at least 16 x 16 px, got "
            f"shape {image.shape}"
        )
    image = image.astype(np.float64)
    if not np.all(np.isfinite(image)):
        raise ValueError("a target's picture must have finite grey values")
    return image


def noise_level(picture: NDArray[np.generic]) -> float:
    """Standard deviation of the grey values' noise, at least that of rounding.

    From second differences along both axes, N = [1 -2 1; -2 4 -2; 1 -2 1], which no plane and no straight
    edge along an axis passes [Immerkær1996]_; the median keeps dots and corners out of it.

    .. [Immerkær1996] J. Immerkær, Fast noise variance estimation, Computer Vision and Image
       Understanding 64 (1996) 300-302, doi:10.1006/cviu.1996.0060.
    """
    image = grey(picture)
    kernel = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])
    response = np.abs(cv2.filter2D(image, cv2.CV_64F, kernel)[1:-1, 1:-1])
    bright = image[1:-1, 1:-1] > 0.5 * (np.percentile(image, 2.0) + np.percentile(image, 98.0))
    part = response[bright] if bright.sum() > 100 else response.ravel()
    return max(1.4826 * float(np.median(part)) / 6.0, 1.0 / np.sqrt(12.0))
