"""Bias of a match between two cameras from the curvature inside its subset, where the surface is a cylinder.

Camera 1 sees the pixels of camera 0's subset displaced by a field u(ξ) that a polynomial of first or second
order, the shape function, cannot follow: what is left of it moves the fitted centre,

    b = c₀ - u(0),        c = argmin Σ_ξ |u(ξ) - Σ_j c_j φ_j(ξ)|²

φ_j the terms of the shape function, φ₀ = 1, ξ the pixels of the subset that lie in the mask. For u = a x⁴
over [-h, h] and a second order, b = 3/35 a h⁴ in size; for u = a x² and a first order, a h²/3. At the rim of
a mask half of a subset is missing, its centre is extrapolated, and b is many times as large. A radius that is
free over a part of the circumference changes by many times what the points do. With a cylinder near the true
one, u is known in closed form from the rays and b is taken off.
"""

from dataclasses import replace

import numpy as np

from dic.arrays import BoolArray, FloatArray
from dic.camera import Camera, StereoRig
from dic.correlation.warp import Shape, gradient
from dic.surfaces.cylinder import Cylinder
from dic.tracking import Track

NODES = 15
"""Places along each side of a subset that stand for its pixels."""
LEAST_SEEN = 0.2
"""Share of them that must lie on the cylinder and in the mask."""


def polynomial_bias(field: FloatArray, shape: Shape) -> FloatArray:
    """Value at the centre of the polynomial that fits a field over a square best, less the field's own.

    Parameters
    ----------
    field
        The field at `subset_nodes`, its value at the centre in the middle, NaN where it is not known, shape
        [n, NODES², m].
    shape
        AFFINE for a polynomial of first order, QUADRATIC for one of second.

    Returns
    -------
    NDArray
        Shape [n, m]; NaN where less than `LEAST_SEEN` of the field, or not its centre, is known.
    """
    x, y = subset_nodes(2.0).T  # from -1 to 1: the result has no length in it
    terms = [np.ones_like(x), x, y] + ([x * x, x * y, y * y] if shape == Shape.QUADRATIC else [])
    T = np.stack(terms, axis=1)
    known = np.asarray(np.isfinite(field).all(axis=2))
    middle = field[:, NODES**2 // 2]
    fine = (known.mean(axis=1) >= LEAST_SEEN) & np.isfinite(middle).all(axis=1)
    bias = np.full(middle.shape, np.nan)
    away = np.where(known[..., None], field - middle[:, None], 0.0)[fine]
    used = known[fine].astype(np.float64)
    normal = np.einsum("nk,ka,kb->nab", used, T, T, optimize=True)
    bias[fine] = np.linalg.solve(normal, np.einsum("ka,nkm->nam", T, away))[:, 0]
    return bias


def subset_nodes(side: float) -> FloatArray:
    """Centres of NODES x NODES equal squares that make up a square about zero, shape [NODES², 2]."""
    places = ((np.arange(NODES) + 0.5) / NODES - 0.5) * side
    x, y = np.meshgrid(places, places)
    return np.column_stack([x.ravel(), y.ravel()])


def on_cylinder(camera: Camera, pixels: FloatArray, cylinder: Cylinder) -> FloatArray:
    """Points of a cylinder that a camera sees at `pixels` [m], shape [..., 3]; NaN beside it."""
    ideal = camera.undistort(pixels)
    ray = np.concatenate([ideal, np.ones((*ideal.shape[:-1], 1))], axis=-1) @ camera.rotation
    d, w = ray @ cylinder.basis[:2].T, cylinder.basis[:2] @ (camera.centre - cylinder.point)
    a, b, c = np.sum(d * d, axis=-1), d @ w, w @ w - cylinder.radius**2
    under = b * b - a * c
    s = (-b - np.sqrt(np.where(under >= 0.0, under, np.nan))) / a
    return np.asarray(camera.centre + s[..., None] * ray)


def match_bias(
    rig: StereoRig, cylinder: Cylinder, points: FloatArray, mask: BoolArray, subset: int, shape: Shape
) -> FloatArray:
    """Bias of the places in camera 1 of points matched from camera 0 [px], shape [n, 2].

    Parameters
    ----------
    rig
        The cameras.
    cylinder
        In the rig's frame, from points of this rig.
    points
        Centres of the subsets in camera 0's picture [px], shape [n, 2].
    mask
        Pixels of that picture that count, shape [rows, columns].
    subset
        Their side [px].
    shape
        Shape function of the match.

    Returns
    -------
    NDArray
        NaN where too little of the subset lies on the cylinder and in the mask.
    """
    pixels = points[:, None] + subset_nodes(float(subset))
    X = on_cylinder(rig.cameras[0], pixels, cylinder)
    rows, columns = mask.shape
    x, y = np.round(np.moveaxis(pixels, -1, 0)).astype(np.int64)
    inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    inside &= mask[np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)]
    return polynomial_bias(np.where(inside[..., None], rig.cameras[1].project(X), np.nan), shape)


def without_bias(track: Track, bias: FloatArray, material: int) -> Track:
    """Camera 1's track of the points that were meant.

    Its points were matched beside them by `bias` in the material frame and follow the place found there: by
    ``F F₀⁻¹ bias`` beside it in another frame, F the deformation gradients of the track.

    Parameters
    ----------
    track
        Camera 1's track.
    bias
        Bias in the material frame [px], shape [n_points, 2]; a NaN corrects nothing.
    material
        That frame.
    """
    known = np.where(np.isfinite(bias), bias, 0.0)
    F = gradient(track.warp)
    with np.errstate(invalid="ignore"):  # of points that were lost
        start = np.where(np.isfinite(F[material]), F[material], np.eye(2))
        now = np.where(np.isfinite(F), F, np.eye(2))
    moved = now @ (np.linalg.inv(start) @ known[..., None])
    warp = track.warp.copy()
    warp[..., :2] -= moved[..., 0]
    return replace(track, warp=warp)
