"""Spline coefficients of pictures, and their way to a device."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import warp as wp
from numpy.typing import NDArray
from scipy import ndimage

from dic.correlation.kernels.device import select_device
from dic.correlation.kernels.grain import REACH
from dic.correlation.kernels.spline import PAD


def coefficients(grey: NDArray[np.float32], prefilter: float) -> NDArray[np.float32]:
    """Coefficients of the quintic B-spline through a picture, with mirrored margins of `PAD`."""
    smooth = grey.astype(np.float64)
    if prefilter:
        smooth = ndimage.gaussian_filter(smooth, prefilter, mode="mirror", truncate=REACH)
    found = ndimage.spline_filter(smooth, order=5, output=np.float64, mode="mirror")
    right = PAD + -(grey.shape[1] + 2 * PAD) % 16  # rows begin on a cache line
    wide = cv2.copyMakeBorder(found.astype(np.float32), PAD, PAD, PAD, right, cv2.BORDER_REFLECT_101)
    return np.asarray(wide)


def upload(planes: list[NDArray[np.float32]], device: str) -> Any:
    """The planes on a device, shape [n, rows + 2 PAD, columns + 2 PAD and more]."""
    return wp.array(np.stack(planes), dtype=wp.float32, device=select_device(device), copy=False)


def addresses(parts: Sequence[Any]) -> Any:
    """Where each picture's coefficients begin in the memory of their device, shape [n]."""
    begin = [part.ptr + k * part.strides[0] for part in parts for k in range(part.shape[0])]
    return wp.array(np.array(begin, dtype=np.uint64), dtype=wp.uint64, device=parts[0].device)
