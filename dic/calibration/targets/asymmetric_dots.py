"""Asymmetric dot grid: every second row is shifted by half a pitch."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.basics import cv2
from dic.calibration.dots import Dots, eight_bits, find_dots
from dic.calibration.targets.base import Detection, Geometry, TargetNotFound, counts, positive


@dataclass(frozen=True, kw_only=True)
class AsymmetricDots:
    """Rows of dots. Odd rows are shifted by half the distance between dots, as in OpenCV's pattern.

    Dot k of row i lies at ((2 k + i mod 2) step, i step) and has number ``i * columns + k``.
    """

    columns: int
    """Dots in a row."""
    rows: int
    step: float
    """Distance between rows, and half the distance between the dots of a row [m]."""
    diameter: float
    """Diameter of a dot [m]."""
    dark: bool = True
    """Black dots on white; False: white on black."""

    def __post_init__(self) -> None:
        counts(2, columns=self.columns, rows=self.rows)
        positive(step=self.step, diameter=self.diameter)
        if not self.diameter < np.sqrt(2.0) * self.step:
            raise ValueError(
                f"diameter must be below √2 step = {1.4142 * self.step} m, got {self.diameter} m"
            )

    def geometry(self) -> Geometry:
        """Its dots. With an even number of rows, half a turn gives a second numbering."""
        row, column = np.mgrid[: self.rows, : self.columns]
        n = self.rows * self.columns
        x, y = 2 * column + row % 2, row
        points = np.stack([x.ravel(), y.ravel(), np.zeros(n)], axis=1) * self.step
        normals = np.tile([0.0, 0.0, 1.0], (n, 1))
        numberings = [np.arange(n)] if self.rows % 2 else [np.arange(n), np.arange(n)[::-1]]
        spread = np.full(n, self.diameter**2 / 16.0)
        return Geometry(points, normals, spread, np.zeros((n, 3)), np.stack(numberings))

    def detect(self, picture: NDArray[np.generic]) -> Detection:
        """Its dots in a picture; the whole grid must be visible.

        `cv2.findCirclesGrid` orders the dots; their centres come from `dic.calibration.dots`.

        Raises TargetNotFound if the grid is not completely found.
        """
        dots = find_dots(picture, dark=self.dark)
        n = self.columns * self.rows
        complete, order = False, None
        if len(dots.radius) >= n:
            complete, order = cv2.findCirclesGrid(
                eight_bits(picture),
                (self.columns, self.rows),
                flags=cv2.CALIB_CB_ASYMMETRIC_GRID | cv2.CALIB_CB_CLUSTERING,
                blobDetector=_blob_detector(dots, self.dark),
            )
        if not complete or order is None:
            raise TargetNotFound(
                f"{len(dots.radius)} dots are no asymmetric grid of {self.columns} x {self.rows}; is it "
                "wholly in view, with a margin around it?"
            )
        places = np.asarray(order, dtype=np.float64).reshape(-1, 2)
        distance = np.hypot(*np.moveaxis(places[:, None] - dots.centre[None], -1, 0))
        numbers = np.argmin(distance, axis=1)
        if len(set(numbers.tolist())) != n or distance.min(axis=1).max() > float(dots.radius.max()):
            raise TargetNotFound("two places of the grid fell on one dot; is the target in focus?")
        return Detection(np.arange(n), dots.centre[numbers], dots.sigma[numbers])


def _blob_detector(dots: Dots, dark: bool) -> Any:
    """OpenCV's detector, set to the size and the colour of the dots already found."""
    opencv: Any = cv2  # its type stubs do not contain this detector
    options = opencv.SimpleBlobDetector_Params()
    areas = np.pi * dots.radius**2
    options.minArea, options.maxArea = 0.5 * float(areas.min()), 2.0 * float(areas.max())
    options.blobColor = 0 if dark else 255
    options.minDistBetweenBlobs = float(dots.radius.min())
    options.filterByInertia, options.minInertiaRatio = True, 0.05
    return opencv.SimpleBlobDetector_create(options)
