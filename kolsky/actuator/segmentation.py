"""Blue markers in a picture: segmentation, clustering, centroids.

Pixels are blue where their hue, saturation and value lie in a range; single ones are removed by an opening.
The centroid of a marker weighs each pixel by how blue it is, so that the grey rim of a disc counts by its
share. Markers that touch are one connected part; parts are then told apart by k-means into the number that
is known.
"""

from dataclasses import dataclass

import numpy as np

from dic.opencv import cv2
from kolsky.base.arrays import FloatArray

HUE = (100, 130)
"""Range of hue of the markers, in OpenCV's half degrees."""
LEAST = 90, 60
"""Least saturation and value of a blue pixel."""
SMALLEST = 12
"""Fewest pixels of a marker [px]."""
RIM = 3
"""Pixels around a part whose blueness counts [px]."""
ROUNDS = 10
"""Starts of k-means."""


class NoMarkersError(ValueError):
    """The picture does not show the markers."""


@dataclass(frozen=True)
class Markers:
    """Markers of one picture."""

    pixels: FloatArray
    """Centroids [px], shape [n, 2], in the order of the chain from the start."""
    split: bool
    """Whether markers touched and were told apart by clustering."""


def find_markers(picture: np.ndarray, count: int, start: FloatArray) -> Markers:
    """Find blue markers in a picture in blue, green, red.

    Parameters
    ----------
    picture
        Grey values, shape [height, width, 3].
    count
        Number of markers.
    start
        Pixel at which the row of markers begins, shape [2].

    Raises
    ------
    NoMarkersError
        If there are fewer blue pixels than so many markers need, or more parts than markers.
    """
    mask = blue_mask(picture)
    n, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    kept = [k for k in range(1, n) if stats[k, cv2.CC_STAT_AREA] >= SMALLEST]
    if not kept:
        raise NoMarkersError(
            "no blue part is large enough for a marker; check the light and the range of hue"
        )
    if len(kept) > count:
        raise NoMarkersError(f"{len(kept)} blue parts are seen, {count} markers are wanted; cover other blue")
    weight = blueness(picture)
    if len(kept) == count:
        found = np.array([_centroid(weight, labels == k) for k in kept])
        return Markers(chain(found, start), False)
    places = np.argwhere(np.isin(labels, kept))[:, ::-1].astype(np.float32)
    if len(places) < SMALLEST * count:
        raise NoMarkersError(f"{len(kept)} blue parts are seen, too small for {count} markers")
    cv2.setRNGSeed(1)
    rule = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    nearest = np.zeros((len(places), 1), dtype=np.int32)
    _, _, centres = cv2.kmeans(places, count, nearest, rule, ROUNDS, cv2.KMEANS_PP_CENTERS)
    return Markers(chain(centres.astype(np.float64), start), True)


def blue_mask(picture: np.ndarray) -> np.ndarray:
    """255 where a pixel is blue, single ones removed, shape [height, width]."""
    hsv = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV)
    mask = cv2.inRange(hsv, (HUE[0], *LEAST), (HUE[1], 255, 255))
    return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)))


def blueness(picture: np.ndarray) -> FloatArray:
    """Blue less red, not below the picture's median, shape [height, width]."""
    difference = picture[..., 0].astype(np.float64) - picture[..., 2]
    return np.maximum(difference - np.median(difference), 0.0)


def _centroid(weight: FloatArray, part: np.ndarray) -> FloatArray:
    near = cv2.dilate(part.astype(np.uint8), np.ones((2 * RIM + 1, 2 * RIM + 1), np.uint8)) > 0
    rows, columns = np.nonzero(near)
    w = weight[rows, columns]
    return np.array([w @ columns, w @ rows]) / w.sum()


def chain(places: FloatArray, start: FloatArray) -> FloatArray:
    """Places of shape [n, 2] in the order of their neighbours, from the one nearest to `start` on."""
    left, here, found = list(range(len(places))), np.asarray(start, dtype=float), []
    while left:
        nearest = min(left, key=lambda k: float(np.linalg.norm(places[k] - here)))
        left.remove(nearest)
        found.append(nearest)
        here = places[nearest]
    return places[found]
