"""What a match leaves unexplained beyond the pictures' noise, and the sigma that it stands for.

A pattern flattened until its speckles are hardly wider than a pixel is sampled too coarsely: what lies beyond
half a period per pixel comes back as another pattern, which changes from frame to frame. It is not noise of
the pixels, but it shows in the correlation: a match whose only error is noise of variance σ² per picture ends
at ``2 (1 - ZNCC) var f = 2 σ²``. How much a larger residual moves the point was measured on rendered pictures
(verification page of the tracking): its covariance grows by ``1 + κ e``, e the excess of the residual over
the noise, with κ = `ALONG` in the direction that is flattened most and `ACROSS` at right angles to it. The
match itself scales both by ``1 + e``, as if the residual were noise.
"""

import cv2
import numpy as np

from dic.arrays import FloatArray
from dic.correlation import Noise
from dic.tracking.frames import Picture

ALONG = 6.0
"""κ in the direction of the smallest principal stretch."""
ACROSS = 1.0
"""κ in the direction of the largest one."""


def local_variance(picture: Picture, places: FloatArray, side: int) -> FloatArray:
    """Variance of the grey values in squares around places [grey²], shape [n].

    Parameters
    ----------
    picture
        Grey values, shape [rows, columns].
    places
        Centres (x, y) [px], shape [n, 2]; one outside the picture takes the value at its border.
    side
        Side of the squares [px].
    """
    grey = np.asarray(picture, dtype=np.float64)
    grey = grey - grey.mean()
    mean, square = (cv2.boxFilter(values, -1, (side, side)) for values in (grey, grey * grey))
    limit = np.array(grey.shape[::-1]) - 1
    column, row = np.clip(np.round(places), 0, limit).astype(np.int64).T
    return np.asarray(np.maximum(square - mean**2, 0.0)[row, column])


def excess(zncc: FloatArray, variance: FloatArray, noise: Noise, grey: float) -> FloatArray:
    """By how much the residual's variance exceeds that of the noise, over the latter [-], shape [n].

    Parameters
    ----------
    zncc
        Correlations, shape [n].
    variance
        Of the templates' grey values [grey²], shape [n].
    noise
        Of the pictures.
    grey
        Mean grey value [grey].
    """
    expected = noise.floor**2 + noise.gain * grey
    if expected <= 0.0:
        return np.zeros_like(zncc)
    return np.asarray(np.maximum((1.0 - zncc) * variance / expected - 1.0, 0.0))


def enlarged(covariance: FloatArray, F: FloatArray, by: FloatArray) -> FloatArray:
    """Covariances with the share that an excess residual adds [px²], shape [n, 2, 2].

    Parameters
    ----------
    covariance
        Of matches, scaled by 1 + e [px²], shape [n, 2, 2].
    F
        Deformation gradients from the material picture, shape [n, 2, 2].
    by
        Excess of the residuals, shape [n].
    """
    # the principal directions as the picture shows them are those of F Fᵀ
    B = F @ np.swapaxes(F, -1, -2)
    largest = 0.5 * np.arctan2(2.0 * B[:, 0, 1], B[:, 0, 0] - B[:, 1, 1])
    along = np.sqrt((1.0 + ALONG * by) / (1.0 + by))[:, None, None]
    across = np.sqrt((1.0 + ACROSS * by) / (1.0 + by))[:, None, None]
    e = np.stack([np.cos(largest), np.sin(largest)], axis=-1)
    Q = along * np.eye(2) + (across - along) * e[:, :, None] * e[:, None, :]
    return np.asarray(Q @ covariance @ Q)
