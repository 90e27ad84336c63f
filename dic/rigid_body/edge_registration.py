"""Rest position of a body of which the static images show only an edge strip.

A subset needs several rows of speckle around its point; a body that only just reaches into the pictures at
rest has none. But its whole edge strip moves as one: the static pictures are compared, pixel by pixel and
both cameras together, with the material picture, in which the body's points were chosen. One unknown is left,
its translation along the axis.

The last rows of a picture are not like the others: optics and electronics, or whatever filtered the pictures,
blur them from one side only, so that they show a place a fraction of a pixel further in. This offset of each
row is measured in frames in which enough of the body is in view to know its translation
(`EdgeRegistration.fit_row_offsets`).
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from dic.arrays import BoolArray, FloatArray
from dic.camera import StereoRig
from dic.rigid_body.edge_pixels import (
    EDGE_ROWS,
    FEWEST,
    LEAST_ZNCC,
    VisiblePixels,
    edge_view,
    fitted,
    least_zncc,
    visible_pixels,
    zncc_of,
)
from dic.stereo.rays import pixels_per_length
from dic.surfaces import SpecimenFrame

LARGEST_EDGE = 0.1
"""Largest error of the row at the region's end, in frames whose translation is known, with which it may be
used where no other is in view [px]: beyond it the blur of the body's own edge is in it."""
FEWEST_ROW = 20
"""Pixels of a row that must show the body before the row's own place is found."""
FEWEST_FRAMES = 3
"""Frames in which a row must have shown it."""
SEARCH_STEP = 0.18
"""Distance of the translations that are tried [px]: a fraction of a speckle."""
MOST_STEPS, CONVERGED = 10, 2e-4
"""Gauss-Newton steps at most, and the step at which they end [px]."""
LARGEST_CORRECTION = 0.54
"""Largest distance of the result from the best of the translations tried [px]."""
BESIDE = 0.02
"""Step of the difference quotient of grey values [px]."""


@dataclass(frozen=True)
class RegisteredEdge:
    """A translation of the body."""

    y: float
    """Translation along the axis [m]."""
    sigma: float
    """Its standard deviation, from the residual of the comparison [m]."""
    common: float
    """Standard deviation common to frames that show the same rows, beside `sigma`, from the uncertainty of
    the rows' offsets, and of the row at the region's end where it is used [m]."""
    clear: bool
    """False where rows clear of the region's end are too few, and the row at its end counts too."""
    zncc: float
    """ZNCC of the edge strip."""
    n_pixels: int
    """Pixels that showed it."""


class EdgeRegistration:
    """Registration of the edge strip of a body of revolution with its material picture, in any frame.

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
        along = pixels_per_length(rig.cameras[0], frame.in_rig(middle), frame.rotation[1])
        self.pixel = 1.0 / float(np.linalg.norm(along))
        """Length along the axis that a pixel shows [m]."""
        self._views = [
            edge_view(*both, frame, radius, along) for both in zip(rig.cameras, material, strict=True)
        ]
        self._offset, self._offset_sigma = np.zeros((2, EDGE_ROWS)), np.zeros((2, EDGE_ROWS))
        self._least = LEAST_ZNCC

    def fit_row_offsets(
        self, known: Iterable[tuple[tuple[FloatArray, FloatArray], FloatArray]]
    ) -> tuple[FloatArray, FloatArray]:
        """Offset with which each row at the border shows the body; `register` then subtracts it, and accepts
        no strip that looks much less like the body than these frames.

        Parameters
        ----------
        known
            Pairs of pictures, shape [rows, columns] each, with the body's translation in them [m], shape [3].

        Returns
        -------
        offset : array
            Of each camera's rows from the border inward, along y [m], shape [2, `EDGE_ROWS`]; 0 where
            unknown.
        sigma : array
            Its standard deviation, from the scatter of the frames [m], same shape.
        """
        seen = [self._row_offsets(pictures, move) for pictures, move in known]
        self._least = least_zncc([zncc for _, zncc in seen if zncc > 0.0])
        found = np.stack([offsets for offsets, _ in seen])  # frame, camera, row
        count = np.isfinite(found).sum(axis=0)
        enough = count >= FEWEST_FRAMES
        values = np.where(np.isfinite(found), found, 0.0)
        mean = values.sum(axis=0) / np.maximum(count, 1)
        square = np.where(np.isfinite(found), (found - mean) ** 2, 0.0).sum(axis=0)
        self._offset = np.where(enough, mean, 0.0)
        self._offset_sigma = np.where(enough, np.sqrt(square / np.maximum(count * (count - 1), 1)), 0.0)
        return self._offset, self._offset_sigma

    def register(
        self, pictures: tuple[FloatArray, FloatArray], near: FloatArray, tried: FloatArray
    ) -> RegisteredEdge | None:
        """Translation of the body in a pair of pictures.

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
        score = np.array([zncc_of(self._visible(pictures, near, y, whole)) for y in tried])
        best = int(np.argmax(score))
        if score[best] < 0.0:
            return None
        y, fit = self._converged(pictures, near, float(tried[best]), clear)
        is_clear = fit[-1] >= FEWEST
        if not is_clear:
            y, fit = self._converged(pictures, near, float(tried[best]), whole)
        zncc, _, variance, offset, n = fit
        if zncc < self._least or abs(y - tried[best]) > LARGEST_CORRECTION * self.pixel:
            return None
        return RegisteredEdge(
            y=y,
            sigma=float(np.sqrt(variance)),
            common=offset,
            zncc=zncc,
            n_pixels=n,
            clear=is_clear,
        )

    def end_error(self, known: Iterable[tuple[tuple[FloatArray, FloatArray], FloatArray]]) -> float | None:
        """Error with which the row at the region's end shows the body where its translation is known [m].

        Parameters
        ----------
        known
            Pairs of pictures with the body's translation, as `fit_row_offsets`; that row is in view there.

        Returns
        -------
        float or None
            Root mean square, its mean included; None if fewer than `FEWEST_FRAMES` frames show it, or it is
            more than `LARGEST_EDGE`.
        """
        end = self._masks[0] & ~self._masks[1]
        steps = []
        for pictures, move in known:
            parts = self._visible(pictures, move, float(move[1]), end)
            if sum(len(part.grey) for part in parts) < FEWEST:
                continue
            grey = np.concatenate([part.grey for part in parts])
            reference = np.concatenate([part.reference for part in parts])
            slope = np.concatenate([part.slope(self._frame, BESIDE * self.pixel) for part in parts])
            steps.append(fitted(grey, reference, slope)[0])
        error = float(np.sqrt(np.mean(np.square(steps)))) if len(steps) >= FEWEST_FRAMES else np.inf
        return error if error <= LARGEST_EDGE * self.pixel else None

    def _converged(
        self, pictures: tuple[FloatArray, FloatArray], near: FloatArray, y: float, mask: BoolArray
    ) -> tuple[float, tuple[float, float, float, float, int]]:
        """Gauss-Newton from y to the translation that fits best [m], and `_compare` there."""
        for _ in range(MOST_STEPS):
            fit = self._compare(pictures, near, y, mask)
            longest = SEARCH_STEP * self.pixel
            step = float(np.clip(fit[1], -longest, longest))
            if abs(step) < CONVERGED * self.pixel:
                break
            y += step
        return y, fit

    def _row_offsets(
        self, pictures: tuple[FloatArray, FloatArray], move: FloatArray
    ) -> tuple[FloatArray, float]:
        """Offset along y from `move` at which each row shows the body [m], shape [2, `EDGE_ROWS`]; NaN: not
        known. And the strip's ZNCC, -1 for too few pixels."""
        off, parts = np.full((2, EDGE_ROWS), np.nan), []
        for camera, (view, picture) in enumerate(zip(self._views, pictures, strict=True)):
            visible = visible_pixels(
                view,
                picture,
                self._first,
                self._frame,
                self._masks[1],
                self._move - move,
                np.zeros(EDGE_ROWS),
            )
            parts.append(visible)
            slope = visible.slope(self._frame, BESIDE * self.pixel)
            for k in range(EDGE_ROWS):
                of = visible.row == k
                if of.sum() >= FEWEST_ROW:
                    step, variance = fitted(visible.grey[of], visible.reference[of], slope[of])
                    off[camera, k] = step if np.isfinite(variance) else np.nan
        return off, zncc_of(parts)

    def _visible(
        self, pictures: tuple[FloatArray, FloatArray], near: FloatArray, y: float, mask: BoolArray
    ) -> list["VisiblePixels"]:
        """Pixels of both cameras that show the body at a translation y."""
        motion = self._move - np.array([near[0], y, near[2]])
        return [
            visible_pixels(view, picture, self._first, self._frame, mask, motion, offset)
            for view, picture, offset in zip(self._views, pictures, self._offset, strict=True)
        ]

    def _compare(
        self, pictures: tuple[FloatArray, FloatArray], near: FloatArray, y: float, mask: BoolArray
    ) -> tuple[float, float, float, float, int]:
        """Correlation at a translation y, the step of y by Gauss-Newton [m], its variance, what the rows'
        offsets add to its sigma [m], and the pixels."""
        parts = self._visible(pictures, near, y, mask)
        zncc, n = zncc_of(parts), sum(len(part.grey) for part in parts)
        if zncc <= -1.0:
            return -1.0, 0.0, np.inf, 0.0, n
        grey = np.concatenate([part.grey for part in parts])
        reference = np.concatenate([part.reference for part in parts])
        slope = np.concatenate([part.slope(self._frame, BESIDE * self.pixel) for part in parts])
        step, variance = fitted(grey, reference, slope)
        weight = slope**2 / float(slope @ slope)
        known = np.concatenate(
            [sigma[part.row] for sigma, part in zip(self._offset_sigma, parts, strict=True)]
        )
        # An offset is common to its row's pixels; the plain sum over rows is the most they can add up to.
        return zncc, step, variance, float(weight @ known), n
