"""A camera that looks at the plane of bending: Zhang's calibration, blue markers in a picture, synthetic
pictures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from skimage.measure import label, regionprops
from skimage.segmentation import expand_labels

from dic.basics import cv2
from kolsky.base.arrays import FloatArray

BLUE, GREY = (200, 60, 20), (170, 170, 170)
"""Colours of markers and background in synthetic pictures (blue, green, red)."""
BOARD = (9, 6)
"""Inner corners of the chessboard."""
DOWN = np.array([1.0, -1.0])
"""Signs of a board's columns and rows along x and z."""
FINE = 4
"""Bits of a pixel's fraction with which OpenCV draws polygons."""
SHARP = 4
"""Number of fine pixels along a pixel of a synthetic chessboard."""


@dataclass(frozen=True)
class PlaneCamera:
    """A camera, and the plane of bending in front of it."""

    matrix: FloatArray
    """Focal lengths and principal point [px], shape [3, 3]."""
    distortion: FloatArray
    """Distortion coefficients of OpenCV [-], shape [5]."""
    rotation: FloatArray
    """Rotation vector from the plane's axes (x, z, out of it) to the camera's [rad], shape [3]."""
    translation: FloatArray
    """Origin of the plane in the camera's axes [m], shape [3]."""
    error: float = 0.0
    """Root mean square distance of the calibration's corners [px]."""

    def project(self, places: FloatArray) -> FloatArray:
        """Pixels of positions x, z in the plane [m], both of shape [n, 2]."""
        solid = np.column_stack([places, np.zeros(len(places))])
        pixels, _ = cv2.projectPoints(solid, self.rotation, self.translation, self.matrix, self.distortion)
        return np.asarray(pixels[:, 0], dtype=np.float64)

    def in_plane(self, pixels: FloatArray) -> FloatArray:
        """Positions x, z in the plane [m] of pixels, both of shape [n, 2]."""
        rays = cv2.undistortPoints(
            np.asarray(pixels, dtype=np.float64)[:, None], self.matrix, self.distortion,
            criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12),
        )  # fmt: skip
        R, _ = cv2.Rodrigues(self.rotation)
        # in the camera's axes the plane is R[:, :2] (x, z) + t: three equations for x, z and the depth
        found = []
        for ray in np.asarray(rays)[:, 0]:
            system = np.column_stack([R[:, 0], R[:, 1], -np.array([ray[0], ray[1], 1.0])])
            found.append(np.linalg.solve(system, -self.translation)[:2])
        return np.array(found)


def calibrate(
    views: Sequence[FloatArray],
    in_plane: FloatArray,
    square: float,
    size: tuple[int, int],
    *,
    first: tuple[float, float] = (0.0, 0.0),
) -> PlaneCamera:
    """Calibrate a camera by the corners of a chessboard.

    Parameters
    ----------
    views
        Corners of each view [px], each of shape [n, 2], row by row.
    in_plane
        Corners of the view in the plane of bending, whose rows run along x and follow each other along -z.
    square
        Edge of a square [m].
    size
        Width and height of the pictures [px].
    first
        Position x, z of the first of these corners in the plane [m].
    """
    board = board_corners(square)
    flat = np.column_stack([board, np.zeros(len(board))]).astype(np.float32)
    error, matrix, distortion, _, _ = cv2.calibrateCamera(
        [flat] * len(views), [view.astype(np.float32)[:, None] for view in views], size, None, None
    )
    coefficients = np.asarray(distortion, dtype=np.float64).ravel()[:5]
    _, rotation, translation = cv2.solvePnP(
        flat + np.array([*first, 0.0]), in_plane.astype(np.float64), matrix, coefficients
    )
    lens, turn, place = (np.asarray(v, dtype=np.float64) for v in (matrix, rotation, translation))
    return PlaneCamera(lens, coefficients, turn.ravel(), place.ravel(), float(error))


def board_corners(square: float) -> FloatArray:
    """Inner corners of the chessboard, row by row from the top: along x, then along -z [m], shape [n, 2]."""
    columns, rows = BOARD
    x, z = np.meshgrid(np.arange(columns), np.arange(rows))
    return np.asarray(square * np.column_stack([x.ravel(), -z.ravel()]), dtype=np.float64)


def find_corners(picture: np.ndarray) -> FloatArray:
    """Corners of the chessboard in a picture [px], row by row, shape [n, 2]."""
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if picture.ndim == 3 else picture
    ok, corners = cv2.findChessboardCornersSB(grey, BOARD)
    if not ok:
        raise ValueError(f"no chessboard with {BOARD[0]} x {BOARD[1]} inner corners is seen")
    found = np.asarray(corners, dtype=np.float64).reshape(-1, 2)
    # either end of a board may be the first: use the upper left one
    return found if found[0].sum() <= found[-1].sum() else found[::-1]


def draw_markers(
    camera: PlaneCamera,
    places: FloatArray,
    *,
    diameter: float,
    size: tuple[int, int],
    noise: float = 0.0,
    rng: np.random.Generator | None = None,
) -> np.ndarray:
    """Make a picture of blue discs at positions in the plane [m], shape [n, 2], with noise of the grey
    values."""
    picture = np.full((size[1], size[0], 3), GREY, dtype=np.uint8)
    turn = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
    ring = 0.5 * diameter * np.column_stack([np.cos(turn), np.sin(turn)])
    for place in places:
        outline = np.rint(2**FINE * camera.project(place + ring)).astype(np.int32)
        cv2.fillPoly(picture, [outline], BLUE, lineType=cv2.LINE_AA, shift=FINE)
    return _grainy(picture, noise, rng)


def draw_board(
    camera: PlaneCamera,
    square: float,
    *,
    first: tuple[float, float] = (0.0, 0.0),
    size: tuple[int, int],
    noise: float = 0.0,
    rng: np.random.Generator | None = None,
) -> np.ndarray:
    """Make a picture of the chessboard in the plane of a camera."""
    # OpenCV also fills the boundary's pixels of a polygon. On fine pixels, whose mean is the picture, this
    # error is small
    picture = np.full((SHARP * size[1], SHARP * size[0]), 255, dtype=np.uint8)
    edge = np.linspace(0.0, 1.0, 9)[:-1]
    corners = [(edge, 0 * edge), (1 + 0 * edge, edge), (1 - edge, 1 + 0 * edge), (0 * edge, 1 - edge)]
    outline = np.concatenate([np.column_stack(side) for side in corners])
    for i in range(-1, BOARD[0]):
        for j in range(-1, BOARD[1]):
            if (i + j) % 2 == 0:
                place = camera.project(np.asarray(first) + square * DOWN * (np.array([i, j]) + outline))
                pixels = np.rint(2**FINE * (SHARP * (place + 0.5) - 0.5)).astype(np.int32)
                cv2.fillPoly(picture, [pixels], 0, shift=FINE)
    mean = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return _grainy(cv2.cvtColor(mean, cv2.COLOR_GRAY2BGR), noise, rng)


def _grainy(picture: np.ndarray, noise: float, rng: np.random.Generator | None) -> np.ndarray:
    soft = cv2.GaussianBlur(picture, (5, 5), 0.8)
    if noise == 0.0 or rng is None:
        return soft
    return np.clip(np.rint(soft + noise * rng.standard_normal(soft.shape)), 0, 255).astype(np.uint8)


_HUE = (100, 130)
"""Range of hue of the markers, in OpenCV's half degrees."""
LEAST = 90, 60
"""Smallest saturation and value of a blue pixel."""
SMALLEST = 12
"""Smallest number of pixels of a marker [px]."""
RIM = 3
"""Width around a part in which the blueness is used [px]."""
ROUNDS = 10
"""Number of starts of k-means."""


class NoMarkersError(ValueError):
    """The picture does not show the markers."""


@dataclass(frozen=True)
class Markers:
    """Markers of one picture."""

    pixels: FloatArray
    """Centroids [px], shape [n, 2], in the order of the chain from the start."""
    split: bool
    """Whether markers touched and were separated by clustering."""


def find_markers(picture: np.ndarray, count: int, start: FloatArray) -> Markers:
    """Find blue markers in a picture in blue, green, red.

    ``picture``: grey values, shape [height, width, 3]. ``count``: number of markers. ``start``: pixel of the
    first marker of the row, shape [2].
    """
    labels = label(_blue_mask(picture), connectivity=2)
    kept = [part.label for part in regionprops(labels) if part.area >= SMALLEST]
    if not kept:
        raise NoMarkersError(
            "no blue part is large enough for a marker; check the light and the range of hue"
        )
    if len(kept) > count:
        raise NoMarkersError(f"{len(kept)} blue parts are seen, {count} markers are wanted; cover other blue")
    labels = np.where(np.isin(labels, kept), labels, 0)
    if len(kept) == count:
        wide = regionprops(expand_labels(labels, RIM), intensity_image=blueness(picture))
        found = np.array([part.centroid_weighted[::-1] for part in wide])
        return Markers(chain(found, start), False)
    places = np.argwhere(labels > 0)[:, ::-1].astype(np.float32)
    if len(places) < SMALLEST * count:
        raise NoMarkersError(f"{len(kept)} blue parts are seen, too small for {count} markers")
    cv2.setRNGSeed(1)
    rule = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    nearest = np.zeros((len(places), 1), dtype=np.int32)
    _, _, centres = cv2.kmeans(places, count, nearest, rule, ROUNDS, cv2.KMEANS_PP_CENTERS)
    return Markers(chain(centres.astype(np.float64), start), True)


def _blue_mask(picture: np.ndarray) -> np.ndarray:
    """255 where a pixel is blue, without single pixels, shape [height, width]."""
    hsv = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)
    mask = cv2.inRange(hsv, (_HUE[0], *LEAST), (_HUE[1], 255, 255))
    return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)))


def blueness(picture: np.ndarray) -> FloatArray:
    """Blue minus red, at least the picture's median, shape [height, width]."""
    difference = picture[..., 0].astype(np.float64) - picture[..., 2]
    return np.maximum(difference - np.median(difference), 0.0)


def chain(places: FloatArray, start: FloatArray) -> FloatArray:
    """Positions, shape [n, 2], in the order of neighbours. The first is the one nearest to `start`."""
    left, here, found = list(range(len(places))), np.asarray(start, dtype=float), []
    while left:
        nearest = min(left, key=lambda k: float(np.linalg.norm(places[k] - here)))
        left.remove(nearest)
        found.append(nearest)
        here = places[nearest]
    return places[found]
