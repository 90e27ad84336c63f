"""Grey values with their noise, and the uncertainty of a corner of squares located in them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.opencv import cv2
from dic.robust import MAD

BANDS, BAND = 16, 24
"""Number of bands, and of their rows, that the noise is taken from."""


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


def quantiles(values: NDArray[np.generic], shares: Sequence[float]) -> FloatArray:
    """`numpy.quantile`, of few-bit grey values by counting them."""
    if values.dtype not in (np.uint8, np.uint16):
        return np.asarray(np.quantile(values.astype(np.float64), shares))
    rank = np.asarray(shares, dtype=np.float64) * (values.size - 1)
    below = np.cumsum(np.bincount(values.reshape(-1)))
    low, high = (np.searchsorted(below, k(rank), side="right") for k in (np.floor, np.ceil))
    return np.asarray(low + (rank - np.floor(rank)) * (high - low), dtype=np.float64)


def noise_level(picture: NDArray[np.generic]) -> float:
    """Standard deviation of the grey values' noise, at least that of rounding.

    From second differences along both axes, N = [1 -2 1; -2 4 -2; 1 -2 1], which no plane and no straight
    edge along an axis passes [Immerkær1996]_; bright pixels away from dots count. Bands of rows
    spread over the picture stand for all of it.

    .. [Immerkær1996] J. Immerkær, Fast noise variance estimation, Computer Vision and Image
       Understanding 64 (1996) 300-302, doi:10.1006/cviu.1996.0060.
    """
    image = np.asarray(picture)
    starts = np.unique(np.linspace(0, max(len(image) - BAND, 0), BANDS).astype(int))
    bands = [grey(image[k : k + BAND]) for k in starts]
    kernel = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])
    responses = [np.abs(cv2.filter2D(band, cv2.CV_64F, kernel)) for band in bands]
    limit = 0.5 * float(
        np.sum(quantiles(np.concatenate([image[k : k + BAND] for k in starts]), (0.02, 0.98)))
    )
    bright = [(band > limit).astype(np.uint8) for band in bands]
    part = np.concatenate([response[1:-1, 1:-1].ravel() for response in responses])
    for size in (9, 5, 3):  # as far from dots and corners as leaves enough pixels
        away = [cv2.erode(b, np.ones((size, size)), borderType=cv2.BORDER_REPLICATE) > 0 for b in bright]
        kept = [r[1:-1, 1:-1][a[1:-1, 1:-1]] for r, a in zip(responses, away, strict=True)]
        if sum(map(len, kept)) > 1000:
            part = np.concatenate(kept)
            break
    return max(MAD * float(np.median(part)) / 6.0, 1.0 / np.sqrt(12.0))


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
