"""Chessboard."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.basics import cv2
from dic.calibration.dots import corner_sigma, eight_bits, refined
from dic.calibration.targets.base import Detection, Geometry, TargetNotFound, counts, positive

LARGE = 1000
"""A picture with a side longer than this [px] is searched at reduced size."""


@dataclass(frozen=True, kw_only=True)
class Chessboard:
    """Inner corners of a chessboard; corner (column, row) has number ``row * columns + column``.

    Half a turn gives another numbering of the same board (quarter turns if it has as many rows as columns).
    Camera 0's picture defines the numbering. Camera 1 uses the numbering that fits it. One camera may
    therefore be rolled relative to the other.

    Raises ValueError if there are fewer than three corners in a row or column, or if the pitch is not
    positive.
    """

    columns: int
    """Inner corners in a row: number of squares minus one."""
    rows: int
    """Inner corners in a column."""
    pitch: float
    """Side of a square [m]."""

    def __post_init__(self) -> None:
        counts(3, columns=self.columns, rows=self.rows)
        positive(pitch=self.pitch)

    def geometry(self) -> Geometry:
        """Its corners; corners have no area, so their spread is zero."""
        row, column = np.mgrid[: self.rows, : self.columns]
        n = self.rows * self.columns
        points = np.stack([column.ravel(), row.ravel(), np.zeros(n)], axis=1) * self.pitch
        grid = np.arange(n).reshape(self.rows, self.columns)
        turns = range(4) if self.rows == self.columns else (0, 2)
        equivalents = np.stack([np.rot90(grid, k).ravel() for k in turns])
        return Geometry(points, np.tile([0.0, 0.0, 1.0], (n, 1)), np.zeros(n), np.zeros((n, 3)), equivalents)

    def detect(self, picture: NDArray[np.generic]) -> Detection:
        """Its corners in a picture; the whole board must be in view.

        `cv2.findChessboardCornersSB` finds them [Duda2018]_, `cv2.cornerSubPix` locates them in the full
        picture.

        .. [Duda2018] A. Duda, U. Frese, Accurate detection and localization of checkerboard corners for
           calibration, British Machine Vision Conference, 2018.

        Raises TargetNotFound if the board is not found whole.
        """
        image = eight_bits(picture)
        scale = max(1.0, max(image.shape) / LARGE)
        small = (
            image if scale == 1.0 else cv2.resize(image, None, fx=1 / scale, fy=1 / scale, interpolation=3)
        )
        size, corners = (self.columns, self.rows), None
        for flags in (cv2.CALIB_CB_ACCURACY, cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_EXHAUSTIVE):
            complete, corners = cv2.findChessboardCornersSB(
                small, size, flags=flags | cv2.CALIB_CB_NORMALIZE_IMAGE
            )
            if complete:
                break
        if not complete or corners is None or len(corners) != self.columns * self.rows:
            raise TargetNotFound(
                f"no chessboard of {self.columns} x {self.rows} inner corners" + self._other_count(small)
            )
        pixels = np.asarray(corners, dtype=np.float64).reshape(-1, 2)
        step = np.median(
            np.hypot(*np.diff(pixels.reshape(self.rows, self.columns, 2), axis=1).reshape(-1, 2).T)
        )
        reach = int(np.clip(0.3 * step * scale, 3, 15))
        pixels = refined(picture, scale * (pixels + 0.5) - 0.5, reach)
        sigma = corner_sigma(picture, pixels, reach)
        return Detection(np.arange(len(pixels)), pixels, sigma)

    def _other_count(self, image: "cv2.typing.MatLike") -> str:
        """Advice if the picture shows a board with one corner more or fewer per side."""
        for columns, rows in ((-1, -1), (-1, 0), (0, -1), (1, 1), (1, 0), (0, 1), (1, -1), (-1, 1)):
            size = self.columns + columns, self.rows + rows
            if min(size) >= 3 and cv2.findChessboardCornersSB(image, size)[0]:
                return (
                    f", but one of {size[0]} x {size[1]}: columns and rows count inner corners, which are "
                    "squares minus one (or the board is not wholly in view)"
                )
        return "; is it wholly in view, and do columns and rows count corners, not squares?"
