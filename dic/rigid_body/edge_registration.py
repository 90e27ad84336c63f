"""Where a rigid body rests of which the static pictures show no more than a rim.

A subset needs several rows of speckle around its point; a body that only just reaches into the pictures at
rest has none. But its whole rim moves as one: the static pictures are compared, pixel by pixel and both
cameras together, with the picture in which the body's points were chosen. One unknown is left, its place
along the axis.

The last rows of a picture are not like the others: optics and electronics, or whatever filtered the pictures,
blur them from one side only, so that they show a place a fraction of a pixel further in. By how much, row by
row, is measured in frames in which enough of the body is in view to say where it is (`RimSearch.learn`).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.camera import Camera, StereoRig
from dic.surfaces import SpecimenFrame

RIM = 12
"""Rows of pixels that are looked at, from the border that the body comes in by."""
FEWEST = 40
"""Pixels of both cameras that must show the body."""
EDGE = 0.02
"""What a body may be off, beside its noise, of which only the last pixel of its region is in view [px]:
the blur of its own edge is near. On `open-02` such rows are off by 0.02 px (1 µm)."""
FEWEST_ROW = 20
"""Pixels of a row that must show the body before the row's own place is found."""
FEWEST_FRAMES = 3
"""Frames in which a row must have shown it."""
STRIDE = 10e-6
"""Distance of the places that are tried [m]: a fraction of a speckle."""
LEAST_ZNCC = 0.9
"""Least correlation of the place that is taken."""
MOST_STEPS, SETTLED = 10, 1e-8
"""Gauss-Newton steps at most, and the step at which they end [m]."""
CORE = 30e-6
"""How far the search may end from the best of the places tried [m]."""


@dataclass(frozen=True)
class Rim:
    """A place of the body."""

    y: float
    """Translation along the axis [m]."""
    sigma: float
    """Its standard deviation, from the residual of the comparison [m]."""
    common: float
    """What frames that show the same rows have in common beside it: `EDGE`, and what is not known of the
    rows' offsets [m]."""
    zncc: float
    """Correlation of the rim."""
    n_pixels: int
    """Pixels that showed it."""


@dataclass(frozen=True)
class View:
    """What one camera knows of the body."""

    camera: Camera
    coefficients: FloatArray
    """Quintic spline of the picture in which the points were chosen, shape [rows, columns]."""
    x: IntArray
    """Pixels of the rim (x, y), shape [n, 2]."""
    X: FloatArray
    """Where their rays meet the body's cylinder, in the test frame, shape [n, 3]; those that miss it are
    left out."""
    row: IntArray
    """Their rows, counted from the border that the body comes in by, shape [n]."""

    def grey(self, places: FloatArray) -> FloatArray:
        """Grey values of the picture in which the points were chosen [grey], at places (x, y) [px]."""
        at = places[:, ::-1].T
        grey = ndimage.map_coordinates(self.coefficients, at, order=5, mode="mirror", prefilter=False)
        return np.asarray(grey)


class RimSearch:
    """Finds a body of revolution by its rim, in any frame.

    Parameters
    ----------
    material
        Pictures of camera 0 and camera 1 at the time when the body's points were chosen, shape
        [rows, columns] each.
    mask
        Pixels of the body in camera 0's picture of that time, shape [rows, columns].
    rig, frame
        The cameras and the test frame, about whose y the body is one of revolution.
    places
        Points of its surface at translation zero, in the test frame [m], shape [n, 3].
    move
        Translation at the time of `material` [m], shape [3].
    """

    def __init__(
        self,
        material: tuple[FloatArray, FloatArray],
        mask: BoolArray,
        rig: StereoRig,
        frame: SpecimenFrame,
        places: FloatArray,
        move: FloatArray,
    ) -> None:
        radius = float(np.median(np.hypot(places[:, 0], places[:, 2])))
        self._masks = (mask, ndimage.binary_erosion(mask, border_value=1))
        self._first, self._frame, self._move = rig.cameras[0], frame, move
        middle = np.median(places, axis=0) + move
        ends = rig.cameras[0].project(frame.in_rig(middle + np.array([[0.0, 0.0, 0.0], [0.0, 1e-4, 0.0]])))
        self._scale = float(np.linalg.norm(ends[1] - ends[0])) / 1e-4
        self._views = [
            _view(*both, frame, radius, ends[1] - ends[0]) for both in zip(rig.cameras, material, strict=True)
        ]
        self._offset, self._offset_sigma = np.zeros((2, RIM)), np.zeros((2, RIM))

    def learn(
        self, known: Iterable[tuple[tuple[FloatArray, FloatArray], FloatArray]]
    ) -> tuple[FloatArray, FloatArray]:
        """By how much each row at the border shows the body elsewhere than it is; `find` then takes it off.

        Parameters
        ----------
        known
            Pairs of pictures, shape [rows, columns] each, with the body's translation in them [m], shape [3].

        Returns
        -------
        offset : array
            Of each camera's rows from the border inward, along y [m], shape [2, `RIM`]; 0 where unknown.
        sigma : array
            Its standard deviation, from the scatter of the frames [m], same shape.
        """
        found = np.stack([self._rows(pictures, move) for pictures, move in known])  # frame, camera, row
        count = np.isfinite(found).sum(axis=0)
        enough = count >= FEWEST_FRAMES
        values = np.where(np.isfinite(found), found, 0.0)
        mean = values.sum(axis=0) / np.maximum(count, 1)
        square = np.where(np.isfinite(found), (found - mean) ** 2, 0.0).sum(axis=0)
        self._offset = np.where(enough, mean, 0.0)
        self._offset_sigma = np.where(enough, np.sqrt(square / np.maximum(count * (count - 1), 1)), 0.0)
        return self._offset, self._offset_sigma

    def find(
        self, pictures: tuple[FloatArray, FloatArray], near: FloatArray, tried: FloatArray
    ) -> Rim | None:
        """Where the body is in a pair of pictures.

        Parameters
        ----------
        pictures
            Of camera 0 and camera 1, shape [rows, columns] each.
        near
            A translation across the axis (x and Z count) [m], shape [3].
        tried
            Translations along the axis to begin with, increasing or decreasing [m], shape [n].

        Returns
        -------
        Rim or None
            None if too few pixels show the body, or no place tried looks like it.
        """
        whole, clear = self._masks
        score = np.array([_zncc(self._shown(pictures, near, y, whole)) for y in tried])
        best = int(np.argmax(score))
        if score[best] < 0.0:
            return None
        y, fit = self._settled(pictures, near, float(tried[best]), clear)
        edge = 0.0
        if fit[-1] < FEWEST:
            y, fit = self._settled(pictures, near, float(tried[best]), whole)
            edge = EDGE / self._scale
        zncc, _, variance, offset, n = fit
        if zncc < LEAST_ZNCC or abs(y - tried[best]) > CORE:
            return None
        return Rim(
            y=y, sigma=float(np.sqrt(variance)), common=float(np.hypot(edge, offset)), zncc=zncc, n_pixels=n
        )

    def _settled(
        self, pictures: tuple[FloatArray, FloatArray], near: FloatArray, y: float, mask: BoolArray
    ) -> tuple[float, tuple[float, float, float, float, int]]:
        """The translation near y that fits best [m], and what `_compare` says of it."""
        for _ in range(MOST_STEPS):
            fit = self._compare(pictures, near, y, mask)
            step = float(np.clip(fit[1], -STRIDE, STRIDE))
            if abs(step) < SETTLED:
                break
            y += step
        return y, fit

    def _rows(self, pictures: tuple[FloatArray, FloatArray], move: FloatArray) -> FloatArray:
        """How much further along y than `move` each row shows the body [m], shape [2, `RIM`]; NaN: not
        known."""
        off = np.full((2, RIM), np.nan)
        for camera, (view, picture) in enumerate(zip(self._views, pictures, strict=True)):
            shown = _pair(
                view, picture, self._first, self._frame, self._masks[1], self._move - move, np.zeros(RIM)
            )
            slope = shown.slope(self._frame)
            for k in range(RIM):
                of = shown.row == k
                if of.sum() >= FEWEST_ROW:
                    step, variance = _fit(shown.still[of], shown.moved[of], slope[of])
                    off[camera, k] = step if np.isfinite(variance) else np.nan
        return off

    def _shown(
        self, pictures: tuple[FloatArray, FloatArray], near: FloatArray, y: float, mask: BoolArray
    ) -> list["Shown"]:
        """What both cameras show of the body at a translation y."""
        motion = self._move - np.array([near[0], y, near[2]])
        return [
            _pair(view, picture, self._first, self._frame, mask, motion, offset)
            for view, picture, offset in zip(self._views, pictures, self._offset, strict=True)
        ]

    def _compare(
        self, pictures: tuple[FloatArray, FloatArray], near: FloatArray, y: float, mask: BoolArray
    ) -> tuple[float, float, float, float, int]:
        """Correlation at a translation y, the step of y by Gauss-Newton [m], its variance, what the rows'
        offsets add to its sigma [m], and the pixels."""
        parts = self._shown(pictures, near, y, mask)
        zncc, n = _zncc(parts), sum(len(part.still) for part in parts)
        if zncc <= -1.0:
            return -1.0, 0.0, np.inf, 0.0, n
        still = np.concatenate([part.still for part in parts])
        moved = np.concatenate([part.moved for part in parts])
        slope = np.concatenate([part.slope(self._frame) for part in parts])
        step, variance = _fit(still, moved, slope)
        weight = slope**2 / float(slope @ slope)
        known = np.concatenate(
            [sigma[part.row] for sigma, part in zip(self._offset_sigma, parts, strict=True)]
        )
        # An offset is common to its row's pixels; the plain sum over rows is the most they can add up to.
        return zncc, step, variance, float(weight @ known), n


@dataclass(frozen=True)
class Shown:
    """The pixels of a camera that show the body, side by side with the picture of its points."""

    view: View
    X: FloatArray
    """Where the body was when the points were chosen, in the test frame [m], shape [n, 3]."""
    still: FloatArray
    """Grey values here, shape [n]."""
    moved: FloatArray
    """Those of the same places in the picture of the points, shape [n]."""
    row: IntArray
    """The pixels' rows from the border, shape [n]."""

    def slope(self, frame: SpecimenFrame) -> FloatArray:
        """By how much `moved` grows if the body is further along y here [grey/m], shape [n]."""
        beside = self.view.camera.project(frame.in_rig(self.X - [0.0, 1e-6, 0.0]))
        return (self.view.grey(beside) - self.moved) / 1e-6


def _zncc(parts: list[Shown]) -> float:
    """Correlation of what all cameras show; -1 for too few pixels, or grey values that are all one."""
    still, moved = (np.concatenate([getattr(part, name) for part in parts]) for name in ("still", "moved"))
    if len(still) < FEWEST:
        return -1.0
    f, g = still - still.mean(), moved - moved.mean()
    energy = float((f @ f) * (g @ g))
    return float(f @ g) / float(np.sqrt(energy)) if energy > 0.0 else -1.0


def _fit(still: FloatArray, moved: FloatArray, slope: FloatArray) -> tuple[float, float]:
    """Step of y that makes ``grey = gain (moved + slope step) + offset`` fit best, gain and offset free [m],
    and its variance; infinite where grey values are all one."""
    f, g = still - still.mean(), moved - moved.mean()
    cross, energy, n = float(f @ g), float(g @ g), len(still)
    if not (energy > 0.0 and f @ f > 0.0):
        return 0.0, np.inf
    A = np.stack([1e-6 * slope * cross / energy, g, np.ones(n)], axis=1)  # the step in micrometres
    inverse = np.linalg.pinv(A.T @ A)
    solution = inverse @ (A.T @ still)
    scatter = float(np.sum((still - A @ solution) ** 2)) / (n - 3)
    return 1e-6 * float(solution[0]), 1e-12 * scatter * float(inverse[0, 0])


def _view(
    camera: Camera, material: FloatArray, frame: SpecimenFrame, radius: float, outward: FloatArray
) -> View:
    """What a camera knows of the body, which comes in by the border that `outward` (x, y) points to."""
    rows, columns = material.shape
    y, x = np.mgrid[0:rows, 0:columns]
    axis = int(np.argmax(np.abs(outward)))
    along = (x, y)[axis]
    row = (columns, rows)[axis] - 1 - along if outward[axis] > 0.0 else along
    near = row < RIM
    pixels = np.stack([x[near], y[near]], axis=1).astype(np.float64)
    ideal = camera.undistort(pixels)
    rays = np.concatenate([ideal, np.ones((len(ideal), 1))], axis=1) @ camera.rotation
    start = frame.positions(camera.centre)
    d = rays @ frame.rotation.T
    a = d[:, 0] ** 2 + d[:, 2] ** 2
    b = d[:, 0] * start[0] + d[:, 2] * start[2]
    under = b * b - a * (start[0] ** 2 + start[2] ** 2 - radius**2)
    depth = np.where(under >= 0.0, (-b - np.sqrt(np.maximum(under, 0.0))) / a, np.nan)
    smooth = ndimage.spline_filter(np.asarray(material, dtype=np.float64), order=5, mode="mirror")
    X = start + depth[:, None] * d
    hit = np.isfinite(X).all(axis=1)
    return View(camera, smooth, pixels[hit].astype(np.int64), X[hit], row[near][hit].astype(np.int64))


def _pair(
    view: View,
    picture: FloatArray,
    first: Camera,
    frame: SpecimenFrame,
    inner: BoolArray,
    motion: FloatArray,
    offset: FloatArray,
) -> Shown:
    """The pixels that show the body, moved by `motion` to where it was when its points were chosen."""
    X = view.X + motion
    X[:, 1] -= offset[view.row]
    chosen = first.project(frame.in_rig(X))
    at = np.round(chosen).astype(np.int64)
    rows, columns = inner.shape
    within = (at[:, 0] >= 0) & (at[:, 0] < columns) & (at[:, 1] >= 0) & (at[:, 1] < rows)
    within[within] = inner[at[within, 1], at[within, 0]]
    seen = chosen[within] if view.camera is first else view.camera.project(frame.in_rig(X[within]))
    held = np.all((seen >= 3.0) & (seen <= np.array([columns, rows]) - 4.0), axis=1)
    shown = np.flatnonzero(within)[held]
    x, y = view.x[shown].T
    return Shown(view, X[shown], picture[y, x], view.grey(seen[held]), view.row[shown])
