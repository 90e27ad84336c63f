"""Shape functions: how a subset moves and deforms, and how such motions compose.

A point's subset is a square of pixels ξ = (ξx, ξy) around the point's place x0 in the *material picture*
(the one the points were chosen in). Wherever that subset is found later, in whatever picture of whatever
camera, is written with the same ξ::

    W(ξ) = x0 + ξ + (u, v) + ∇(u, v) ξ + ½ ξᵀ ∇∇(u, v) ξ

so a warp is always a total one, from the material picture. Twelve numbers, in the order of `NAMES`; a shape
function of lower order leaves its later ones zero.
"""

from enum import IntEnum

import numpy as np

from dic.arrays import FloatArray

NAMES = ("u", "v", "ux", "uy", "vx", "vy", "uxx", "uxy", "uyy", "vxx", "vxy", "vyy")
"""The numbers of a warp; u, v in px, first derivatives in 1, second ones in 1/px."""


class Shape(IntEnum):
    """Shape functions; the value is the number of warp parameters that are searched for."""

    RIGID = 2
    AFFINE = 6
    QUADRATIC = 12


def identity(n: int) -> FloatArray:
    """Warps that move nothing, shape [n, 12]."""
    return np.zeros((n, len(NAMES)))


def apply(points: FloatArray, warp: FloatArray, xi: FloatArray | float = 0.0) -> FloatArray:
    """Warped places of material points [px], shape [..., 2].

    Parameters
    ----------
    points
        Places in the material picture [px], shape [..., 2].
    warp
        Their warps, shape [..., 12].
    xi
        Offsets within the subset [px], shape [..., 2] or 0 for the points themselves.
    """
    if np.isscalar(xi) and xi == 0.0:
        return np.asarray(points + warp[..., :2])
    xi = np.broadcast_to(np.asarray(xi, dtype=np.float64), points.shape)
    x, y = xi[..., 0], xi[..., 1]
    terms = np.stack([x * x / 2.0, x * y, y * y / 2.0], axis=-1)
    u = warp[..., 0] + warp[..., 2] * x + warp[..., 3] * y + np.sum(warp[..., 6:9] * terms, axis=-1)
    v = warp[..., 1] + warp[..., 4] * x + warp[..., 5] * y + np.sum(warp[..., 9:12] * terms, axis=-1)
    return np.asarray(points + xi + np.stack([u, v], axis=-1))


def gradient(warp: FloatArray) -> FloatArray:
    """Deformation gradient F = I + ∇(u, v) of warps at the point itself, shape [..., 2, 2]."""
    return np.asarray(warp[..., 2:6].reshape(*warp.shape[:-1], 2, 2) + np.eye(2))


def carried(warp: FloatArray, step: FloatArray) -> FloatArray:
    """The warp a neighbour suggests: of a point that lies `step` away in the material picture.

    Parameters
    ----------
    warp
        Warps of points already found, shape [..., 12].
    step
        From them to the points to guess, in the material picture [px], shape [..., 2].
    """
    x, y = step[..., 0], step[..., 1]
    guess = np.array(np.broadcast_to(warp, (*np.broadcast_shapes(warp.shape[:-1], x.shape), 12)))
    for first, slope, bend in ((0, 2, 6), (1, 4, 9)):
        uxx, uxy, uyy = (warp[..., bend + k] for k in range(3))
        guess[..., first] += (
            warp[..., slope] * x + warp[..., slope + 1] * y + uxx * x * x / 2 + uxy * x * y + uyy * y * y / 2
        )
        guess[..., slope] += uxx * x + uxy * y
        guess[..., slope + 1] += uxy * x + uyy * y
    return guess
