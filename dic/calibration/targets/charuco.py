"""ChArUco board: a chessboard whose white squares carry numbered markers."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.basics import cv2
from dic.calibration.dots import corner_sigma, eight_bits, refined
from dic.calibration.targets.base import Detection, Geometry, TargetNotFound, counts, positive


@dataclass(frozen=True, kw_only=True)
class Charuco:
    """Inner corners of a ChArUco board, numbered as OpenCV numbers them; part of it may be out of view.

    Raises ValueError if there are too few squares, if a marker is not smaller than its square, or if the
    dictionary is unknown or too small.
    """

    columns: int
    """Squares in a row."""
    rows: int
    """Squares in a column."""
    pitch: float
    """Side of a square [m]."""
    marker: float
    """Side of a marker [m]."""
    dictionary: str = "DICT_5X5_100"
    """OpenCV's name of the markers' dictionary."""
    legacy: bool = False
    """True for boards with an even number of rows that were printed with OpenCV before 4.6: they begin with a
    white square."""

    def __post_init__(self) -> None:
        counts(3, columns=self.columns, rows=self.rows)
        positive(pitch=self.pitch, marker=self.marker)
        if not self.marker < self.pitch:
            raise ValueError(f"marker must be below the square's side {self.pitch} m, got {self.marker} m")
        dictionaries = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
        if self.dictionary not in dictionaries:
            raise ValueError(f"dictionary must be one of {', '.join(dictionaries)}, got {self.dictionary!r}")
        markers = self._dictionary().bytesList.shape[0]
        if self.columns * self.rows // 2 > markers:
            raise ValueError(
                f"{self.dictionary} has {markers} markers, {self.columns} x {self.rows} squares need "
                f"{self.columns * self.rows // 2}"
            )

    def _dictionary(self) -> Any:
        return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))

    def _board(self) -> Any:
        board = cv2.aruco.CharucoBoard((self.columns, self.rows), self.pitch, self.marker, self._dictionary())
        board.setLegacyPattern(self.legacy)
        return board

    def geometry(self) -> Geometry:
        """Its corners. The markers identify every corner, so there is only one numbering."""
        points = np.asarray(self._board().getChessboardCorners(), dtype=np.float64).reshape(-1, 3)
        n = len(points)
        return Geometry(
            points, np.tile([0.0, 0.0, 1.0], (n, 1)), np.zeros(n), np.zeros((n, 3)), np.arange(n)[None]
        )

    def detect(self, picture: NDArray[np.generic]) -> Detection:
        """Its corners in a picture, found by OpenCV and located by `cv2.cornerSubPix`.

        Raises TargetNotFound if fewer than eight corners are recognised.
        """
        image = eight_bits(picture)
        corners, numbers, _, _ = cv2.aruco.CharucoDetector(self._board()).detectBoard(image)
        n = 0 if numbers is None else len(numbers)
        if n < 8:
            raise TargetNotFound(
                f"{n} corners of a ChArUco board recognised, 8 are needed; check the dictionary, and that "
                "markers are sharp"
            )
        rough = np.asarray(corners, dtype=np.float64).reshape(-1, 2)
        step = self._step(rough, np.ravel(numbers))
        gap = 0.5 * (1.0 - self.marker / self.pitch) * step
        reach = int(np.clip(0.8 * gap, 3, 15))  # clear of the markers in neighbouring squares
        pixels = refined(picture, rough, reach)
        ids = np.ravel(numbers).astype(np.int64)
        order = np.argsort(ids)
        pixels = pixels[order]
        return Detection(ids[order], pixels, corner_sigma(picture, pixels, reach))

    def _step(self, pixels: NDArray[np.float64], ids: NDArray[Any]) -> float:
        """Median distance between neighbours in a row [px]."""
        order = np.argsort(ids)
        adjacent = np.diff(ids[order]) == 1
        lengths = np.hypot(*np.diff(pixels[order], axis=0).T)
        return float(np.median(lengths[adjacent])) if adjacent.any() else float(np.median(lengths))
