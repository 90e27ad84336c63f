"""Subsets as templates to look for: few samples of a smoothed picture."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.arrays import BoolArray, FloatArray
from dic.correlation import warp as warps
from dic.opencv import cv2

Array = NDArray[np.floating[Any]]

SAMPLES = 12
"""A subset is sampled at about this many places each way, the picture smoothed to match."""
ROWS = 4_000
"""Subsets looked at in one go, to stay in the cache; OpenCV takes arrays of up to 32766 rows."""


@dataclass(frozen=True)
class Subsets:
    """Templates, one a row."""

    points: FloatArray
    """Places in the material picture [px], shape [n, 2]."""
    reference: FloatArray
    """Their warps to camera 0's picture, shape [n, 12]."""
    xi: FloatArray
    """Offsets of the samples within the subset [px], shape [m, 2]."""
    template: NDArray[np.float32]
    """Samples less their mean, over their norm; 0 outside mask and picture; shape [n, m]."""
    weight: NDArray[np.float32]
    """1 inside mask and picture, 0 outside, shape [n, m]."""
    stride: int
    """Distance between samples [px]."""

    @property
    def places(self) -> FloatArray:
        """Places of the points in camera 0 [px], shape [n, 2]."""
        return warps.apply(self.points, self.reference)

    def take(self, rows: NDArray[np.int64]) -> "Subsets":
        """Some of them."""
        points, reference = self.points[rows], self.reference[rows]
        return Subsets(points, reference, self.xi, self.template[rows], self.weight[rows], self.stride)


def subsets(
    picture: NDArray[np.float32],
    points: FloatArray,
    reference: FloatArray,
    subset: int,
    mask: BoolArray | None,
) -> Subsets:
    """Templates of `subset` [px] about `points`; samples outside the mask of the material picture count 0."""
    stride = max(1, round(subset / SAMPLES))
    steps = np.arange(-(subset // 2), subset // 2 + 1, stride, dtype=np.float64)
    xi = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    everywhere = (len(points), len(xi), 2)
    base = np.broadcast_to(points[:, None], everywhere)
    at = warps.apply(base, reference[:, None], xi)
    grey = sample(smoothed(picture, stride), at[..., 0], at[..., 1])
    weight = inside_picture(at, (picture.shape[0], picture.shape[1])).astype(np.float32)
    if mask is not None:
        weight *= in_mask(base + xi, mask)
    total = np.maximum(weight.sum(axis=1, keepdims=True), 1.0)
    grey = (grey - np.sum(grey * weight, axis=1, keepdims=True) / total) * weight
    norm = np.linalg.norm(grey, axis=1, keepdims=True)
    template = np.divide(grey, norm, out=np.zeros_like(grey), where=norm > 0.0)
    return Subsets(points, reference, xi, template, weight, stride)


def inside_picture(places: FloatArray, shape: tuple[int, int]) -> BoolArray:
    """True where places [px] lie between a picture's outermost pixel centres, shape [...]; NaN does not."""
    return np.asarray(np.all((places >= 0.0) & (places <= (shape[1] - 1.0, shape[0] - 1.0)), axis=-1))


def in_mask(places: FloatArray, mask: BoolArray) -> BoolArray:
    """True where the pixels nearest to places [px] belong to the mask, shape [...]."""
    column, row = np.moveaxis(np.rint(places).astype(np.int64), -1, 0)
    there = (column >= 0) & (row >= 0) & (column < mask.shape[1]) & (row < mask.shape[0])
    return np.asarray(there & mask[np.where(there, row, 0), np.where(there, column, 0)])


def smoothed(picture: NDArray[np.float32], stride: int) -> NDArray[np.float32]:
    """The picture less its mean (for single precision), averaged over `stride` pixels each way."""
    centred = np.asarray(picture - picture.mean(dtype=np.float64), dtype=np.float32)
    return centred if stride == 1 else np.asarray(cv2.blur(centred, (stride, stride)), dtype=np.float32)


def sample(picture: NDArray[np.float32], x: Array, y: Array) -> NDArray[np.float32]:
    """Grey values between pixels, bilinear, the edge continued, shape [n, m] as x and y."""
    grey = np.empty(x.shape, dtype=np.float32)
    for a in range(0, len(x), ROWS):
        column, row = (np.ascontiguousarray(k[a : a + ROWS], dtype=np.float32) for k in (x, y))
        grey[a : a + ROWS] = cv2.remap(
            picture, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )
    return grey
