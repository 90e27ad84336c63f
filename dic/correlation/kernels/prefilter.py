"""Spline coefficients of pictures: one symmetric filter along each axis, on the host or on a device.

The recursive filter of the quintic B-spline (Unser 1999) has a symmetric response that falls by 0.43 a pixel.
Cut off where it is below `LEAST` of its middle it is a finite one, which any pixel can be given without its
neighbours' coefficients. Pictures are mirrored at their edges, and so are their coefficients; a Gaussian
before the spline is part of the same filter.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray
from scipy import ndimage

from dic.arrays import FloatArray
from dic.correlation.kernels.pixel_noise import REACH
from dic.correlation.kernels.spline import PAD
from dic.opencv import cv2

LEAST = 1e-8
"""Response, over that in its middle, from which on the filter is cut off: below the rounding of fp32."""
LONGEST = 256
"""Half the length in which a response is looked for [px]."""
LINE = 16
"""Numbers of a row of coefficients come in whole cache lines."""


@cache
def response(prefilter: float) -> FloatArray:
    """Symmetric filter from grey values to coefficients, after a Gaussian of that standard deviation [px].

    Returns
    -------
    NDArray
        Its middle and one side, shape [n]; the sum of both sides and the middle is 1.
    """
    impulse = np.zeros(2 * LONGEST + 1)
    impulse[LONGEST] = 1.0
    if prefilter:
        impulse = ndimage.gaussian_filter1d(impulse, prefilter, mode="mirror", truncate=REACH)
    found = ndimage.spline_filter1d(impulse, order=5, mode="mirror")[LONGEST:]
    last = int(np.flatnonzero(np.abs(found) > LEAST * np.abs(found).max())[-1])
    side = found[: last + 1]
    return np.asarray(side / (2.0 * side.sum() - side[0]))


def room(columns: int) -> int:
    """Columns of a row of coefficients with its margins: rows begin on a cache line."""
    return columns + 2 * PAD + -(columns + 2 * PAD) % LINE


def on_host(grey: NDArray[np.float32], prefilter: float) -> NDArray[np.float32]:
    """Coefficients with mirrored margins of `PAD`, shape [rows + 2 PAD, columns + 2 PAD and more]."""
    side = response(prefilter)
    taps = np.concatenate([side[:0:-1], side]).astype(np.float32)
    level = np.float32(grey.mean(dtype=np.float64))  # the rounding is that of the contrast, not of the light
    found = cv2.sepFilter2D(
        np.ascontiguousarray(grey - level), cv2.CV_32F, taps, taps, borderType=cv2.BORDER_REFLECT_101
    )
    right = room(grey.shape[1]) - grey.shape[1] - PAD
    return np.asarray(cv2.copyMakeBorder(found + level, PAD, PAD, PAD, right, cv2.BORDER_REFLECT_101))


@wp.func
def _mirrored(k: wp.int32, n: wp.int32):
    """The pixel that stands for the k-th of n where the picture is mirrored at its edges."""
    period = 2 * (n - 1)
    inside = k % period
    if inside < 0:
        inside = inside + period
    return wp.min(inside, period - inside)


@wp.kernel(enable_backward=False)
def _along_rows(
    grey: wp.array3d(dtype=wp.float32), side: wp.array(dtype=wp.float32), found: wp.array3d(dtype=wp.float32)
):
    picture, row, column = wp.tid()
    columns = grey.shape[2]
    total = side[0] * grey[picture, row, column]
    for k in range(1, side.shape[0]):
        total = total + side[k] * (
            grey[picture, row, _mirrored(column - k, columns)]
            + grey[picture, row, _mirrored(column + k, columns)]
        )
    found[picture, row, column] = total


@wp.kernel(enable_backward=False)
def _along_columns(
    half: wp.array3d(dtype=wp.float32),
    side: wp.array(dtype=wp.float32),
    level: wp.array(dtype=wp.float32),
    pad: wp.int32,
    found: wp.array3d(dtype=wp.float32),
):
    picture, row, column = wp.tid()
    rows = half.shape[1]
    r, c = _mirrored(row - pad, rows), _mirrored(column - pad, half.shape[2])
    total = side[0] * half[picture, r, c]
    for k in range(1, side.shape[0]):
        total = total + side[k] * (
            half[picture, _mirrored(r - k, rows), c] + half[picture, _mirrored(r + k, rows), c]
        )
    found[picture, row, column] = total + level[picture]


@cache
def _side(prefilter: float, device: str) -> Any:
    return wp.array(response(prefilter), dtype=wp.float32, device=device)


def on_device(greys: Sequence[NDArray[np.float32]], prefilter: float, device: Any) -> Any:
    """`on_host` of several pictures by two launches on a device, shape [n, rows + 2 PAD, columns + 2 PAD and
    more].

    Parameters
    ----------
    greys
        Grey values, each of shape [rows, columns].
    prefilter
        Standard deviation of a Gaussian before [px].
    device
        A device of Warp.
    """
    levels = np.array([grey.mean(dtype=np.float64) for grey in greys], dtype=np.float32)
    side = _side(prefilter, device.alias)
    contrast = np.stack([grey - level for grey, level in zip(greys, levels, strict=True)])
    given: Any = wp.array(contrast, dtype=wp.float32, device=device)
    level: Any = wp.array(levels, dtype=wp.float32, device=device)
    half = wp.empty_like(given)
    n, rows, columns = contrast.shape
    wide = (n, rows + 2 * PAD, room(columns))
    found = wp.empty(wide, dtype=wp.float32, device=device)
    wp.launch(_along_rows, dim=contrast.shape, inputs=[given, side], outputs=[half], device=device)
    wp.launch(_along_columns, dim=wide, inputs=[half, side, level, PAD], outputs=[found], device=device)
    return found
