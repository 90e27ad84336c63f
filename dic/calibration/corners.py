"""Corners of squares: how well a picture's noise lets them be located."""

import cv2
import numpy as np
from numpy.typing import NDArray

from dic.calibration.noise import grey, noise_level

FloatArray = NDArray[np.float64]


def eight_bits(picture: NDArray[np.generic]) -> NDArray[np.uint8]:
    """The picture stretched to 0 to 255, as OpenCV's detectors take it."""
    image = grey(picture)
    low, high = float(image.min()), float(image.max())
    return np.asarray(np.round(255.0 * (image - low) / max(high - low, 1e-12)), dtype=np.uint8)


def refined(picture: NDArray[np.generic], corners: FloatArray, reach: int) -> FloatArray:
    """Corners to a fraction of a pixel, from the gradients within `reach` of them [px], shape [n, 2]."""
    image = grey(picture).astype(np.float32)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-5)
    start = np.array(corners, dtype=np.float32, order="C").reshape(-1, 1, 2)
    found = cv2.cornerSubPix(image, start, (reach, reach), (-1, -1), stop)
    return np.asarray(found, dtype=np.float64).reshape(-1, 2)


def corner_sigma(picture: NDArray[np.generic], corners: FloatArray, reach: float) -> FloatArray:
    """Standard deviation of a corner's coordinate from the grey values' noise [px], shape [n].

    A saddle is located by the gradients around it: with G = Σ ∇I ∇Iᵀ over the window, the covariance is
    σ² G⁻¹ (least squares); the root of its mean eigenvalue is given.

    Parameters
    ----------
    picture
        Grey values, shape [rows, columns].
    corners
        Places [px], shape [n, 2].
    reach
        Half side of the window [px].
    """
    image = grey(picture)
    noise = noise_level(picture)
    side = 2 * max(int(reach), 2) + 1
    gx, gy = (cv2.filter2D(image, cv2.CV_64F, k) for k in (_SLOPE, _SLOPE.T))
    sums = [cv2.boxFilter(p, cv2.CV_64F, (side, side), normalize=False) for p in (gx * gx, gx * gy, gy * gy)]
    column = np.clip(np.round(corners[:, 0]).astype(int), 0, image.shape[1] - 1)
    row = np.clip(np.round(corners[:, 1]).astype(int), 0, image.shape[0] - 1)
    xx, xy, yy = (part[row, column] for part in sums)
    determinant = np.maximum(xx * yy - xy * xy, 1e-6 * (xx + yy) ** 2 + 1e-12)
    return np.maximum(noise * np.sqrt(0.5 * (xx + yy) / determinant), 1e-4)


_SLOPE = np.array([[-0.5, 0.0, 0.5]])
