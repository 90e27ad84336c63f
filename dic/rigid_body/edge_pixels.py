"""Pixels of an edge strip: what a camera sees of a body beside its edge, and how alike two strips are."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.camera import Camera
from dic.surfaces import SpecimenFrame

EDGE_ROWS = 12
"""Rows of pixels that are compared, from the border that the body comes in by."""


FEWEST = 40
"""Pixels of both cameras that must show the body."""
LEAST_ZNCC = 0.9
"""Least ZNCC of a strip that is taken for the body, whatever it has in other frames."""
UNLIKE, TIMES = 0.03, 6.0
"""Least 1 - ZNCC at which it is not, and in medians of those of frames whose translation is known [-]. A
strip of speckles of some four pixels that is half a pixel off leaves 0.03; what noise leaves, it leaves in
all frames."""


@dataclass(frozen=True)
class EdgeView:
    """The edge strip as one camera sees it, and its material picture."""

    camera: Camera
    coefficients: FloatArray
    """Quintic spline of the picture in which the points were chosen, shape [rows, columns]."""
    x: IntArray
    """Pixels of the edge strip (x, y), shape [n, 2]."""
    X: FloatArray
    """Intersections of their rays with the body's cylinder, in the test frame, shape [n, 3]; those that miss
    it are left out."""
    row: IntArray
    """Their rows, counted from the border that the body comes in by, shape [n]."""

    def grey(self, places: FloatArray) -> FloatArray:
        """Grey values of the picture in which the points were chosen [grey], at places (x, y) [px]."""
        at = places[:, ::-1].T
        grey = ndimage.map_coordinates(self.coefficients, at, order=5, mode="mirror", prefilter=False)
        return np.asarray(grey)


@dataclass(frozen=True)
class VisiblePixels:
    """The pixels of a camera that show the body, beside the same places of the material picture."""

    view: EdgeView
    X: FloatArray
    """Their places on the body at the time of the material picture, in the test frame [m], shape [n, 3]."""
    grey: FloatArray
    """Grey values of the pixels, shape [n]."""
    reference: FloatArray
    """Grey values of the same places in the material picture, shape [n]."""
    row: IntArray
    """The pixels' rows from the border, shape [n]."""

    def slope(self, frame: SpecimenFrame, step: float) -> FloatArray:
        """Derivative of `reference` with respect to the translation along y [grey/m], shape [n]: a difference
        quotient over `step` [m]."""
        beside = self.view.camera.project(frame.in_rig(self.X - [0.0, step, 0.0]))
        return (self.view.grey(beside) - self.reference) / step


def zncc_of(parts: list[VisiblePixels]) -> float:
    """ZNCC over the pixels of both cameras; -1 for too few pixels, or constant grey values."""
    grey = np.concatenate([part.grey for part in parts])
    reference = np.concatenate([part.reference for part in parts])
    if len(grey) < FEWEST:
        return -1.0
    f, g = grey - grey.mean(), reference - reference.mean()
    energy = float((f @ f) * (g @ g))
    return float(f @ g) / float(np.sqrt(energy)) if energy > 0.0 else -1.0


def least_zncc(known: Sequence[float]) -> float:
    """Least ZNCC at which a strip is taken for the body.

    Parameters
    ----------
    known
        Those of frames in which its translation is known.
    """
    if not known:
        return LEAST_ZNCC
    return max(LEAST_ZNCC, 1.0 - max(UNLIKE, TIMES * (1.0 - float(np.median(known)))))


def fitted(grey: FloatArray, reference: FloatArray, slope: FloatArray) -> tuple[float, float]:
    """Least-squares step of y in ``grey = gain (reference + slope step) + offset``, gain and offset free [m],
    and its variance; infinite where grey values are constant."""
    f, g = grey - grey.mean(), reference - reference.mean()
    cross, energy, n = float(f @ g), float(g @ g), len(grey)
    if not (energy > 0.0 and f @ f > 0.0):
        return 0.0, np.inf
    A = np.stack([1e-6 * slope * cross / energy, g, np.ones(n)], axis=1)  # the step in micrometres
    inverse = np.linalg.pinv(A.T @ A)
    solution = inverse @ (A.T @ grey)
    scatter = float(np.sum((grey - A @ solution) ** 2)) / (n - 3)
    return 1e-6 * float(solution[0]), 1e-12 * scatter * float(inverse[0, 0])


def rays_on_body(
    camera: Camera,
    pixels: FloatArray,
    frame: SpecimenFrame,
    radius: float,
    across: FloatArray | tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> FloatArray:
    """Where the rays of pixels meet a cylinder about the axis, in the test frame [m], shape [n, 3]; NaN for
    those that miss it.

    Parameters
    ----------
    camera, frame
        The camera and the test frame.
    pixels
        Pixels (x, y) [px], shape [n, 2].
    radius
        Of the cylinder [m].
    across
        A point of its axis in the test frame [m], shape [3].
    """
    ideal = camera.undistort(pixels)
    rays = np.concatenate([ideal, np.ones((len(ideal), 1))], axis=1) @ camera.rotation
    centre = frame.positions(camera.centre)
    start = centre - np.asarray(across)
    d = rays @ frame.rotation.T
    a = d[:, 0] ** 2 + d[:, 2] ** 2
    b = d[:, 0] * start[0] + d[:, 2] * start[2]
    under = b * b - a * (start[0] ** 2 + start[2] ** 2 - radius**2)
    depth = np.where(under >= 0.0, (-b - np.sqrt(np.maximum(under, 0.0))) / a, np.nan)
    return np.asarray(centre + depth[:, None] * d)


def edge_view(
    camera: Camera, material: FloatArray, frame: SpecimenFrame, radius: float, outward: FloatArray
) -> EdgeView:
    """The edge strip in one camera; the body comes in by the border that `outward` (x, y) points to."""
    rows, columns = material.shape
    y, x = np.mgrid[0:rows, 0:columns]
    axis = int(np.argmax(np.abs(outward)))
    along = (x, y)[axis]
    row = (columns, rows)[axis] - 1 - along if outward[axis] > 0.0 else along
    near = row < EDGE_ROWS
    pixels = np.stack([x[near], y[near]], axis=1).astype(np.float64)
    X = rays_on_body(camera, pixels, frame, radius)
    smooth = ndimage.spline_filter(np.asarray(material, dtype=np.float64), order=5, mode="mirror")
    hit = np.isfinite(X).all(axis=1)
    return EdgeView(camera, smooth, pixels[hit].astype(np.int64), X[hit], row[near][hit].astype(np.int64))


def visible_pixels(
    view: EdgeView,
    picture: FloatArray,
    first: Camera,
    frame: SpecimenFrame,
    inner: BoolArray,
    motion: FloatArray,
    offset: FloatArray,
) -> VisiblePixels:
    """The pixels that show the body, moved by `motion` to its place in the material picture."""
    X = view.X + motion
    X[:, 1] -= offset[view.row]
    chosen = first.project(frame.in_rig(X))
    at = np.round(chosen).astype(np.int64)
    rows, columns = inner.shape
    within = (at[:, 0] >= 0) & (at[:, 0] < columns) & (at[:, 1] >= 0) & (at[:, 1] < rows)
    within[within] = inner[at[within, 1], at[within, 0]]
    seen = chosen[within] if view.camera is first else view.camera.project(frame.in_rig(X[within]))
    held = np.all((seen >= 3.0) & (seen <= np.array([columns, rows]) - 4.0), axis=1)
    visible = np.flatnonzero(within)[held]
    x, y = view.x[visible].T
    return VisiblePixels(view, X[visible], picture[y, x], view.grey(seen[held]), view.row[visible])
