"""Corners of squares: how well a picture's noise lets them be located."""

import cv2
import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.calibration.noise import grey, noise_level


def eight_bits(picture: NDArray[np.generic]) -> NDArray[np.uint8]:
    """The picture stretched to 0 to 255, as OpenCV's detectors take it."""
    image = np.asarray(picture)
    checked = image if image.dtype in (np.uint8, np.uint16) and image.ndim == 2 else grey(image)
    stretched = cv2.normalize(checked, None, 0, 255, cv2.NORM_MINMAX, cv2.CV_8U)  # type: ignore[call-overload]
    return np.asarray(stretched, dtype=np.uint8)


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
    image, noise, w = grey(picture), noise_level(picture), max(int(reach), 2)
    sigma = np.empty(len(corners))
    for k, (x, y) in enumerate(np.round(corners).astype(int)):
        part = image[max(y - w, 0) : y + w + 1, max(x - w, 0) : x + w + 1]
        gy, gx = np.gradient(part)
        xx, xy, yy = float(np.sum(gx * gx)), float(np.sum(gx * gy)), float(np.sum(gy * gy))
        determinant = max(xx * yy - xy * xy, 1e-6 * (xx + yy) ** 2 + 1e-12)
        sigma[k] = max(noise * np.sqrt(0.5 * (xx + yy) / determinant), 1e-4)
    return sigma
