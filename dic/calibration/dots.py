"""Dots of a target in a picture: found by their outlines, located by centroid and edges."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.calibration.centroids import MARGIN, WINDOW, centroids
from dic.calibration.corners import eight_bits, grey, noise_level, quantiles
from dic.calibration.edges import LARGEST, fit_discs
from dic.opencv import cv2

LEAST_AREA = 12.0
"""Area of the smallest dot that is looked for [px²]: below, an outline has too few pixels for an ellipse."""
ALIKE = 1.8
"""Dots of one target differ in radius by less than this, with all tilt and perspective."""
MOST_DOTS = 20_000
"""A picture with more dark patches than this shows no target, and is not searched to its end."""


@dataclass(frozen=True)
class Dots:
    """Dots of a picture, one row a dot."""

    centre: FloatArray
    """Centroid of the image of the dot [px], shape [n, 2]."""
    sigma: FloatArray
    """Standard deviation of a coordinate from the picture's noise [px], shape [n]."""
    mass: FloatArray
    """Sum of the darkness, each pixel between 0 (surroundings) and about 1 [px²], shape [n]."""
    radius: FloatArray
    """Root of the product of the semi-axes of the outline [px], shape [n]."""
    hollow: NDArray[np.bool_]
    """True if a bright hole lies in the middle, shape [n]."""


def find_dots(picture: NDArray[np.generic], *, dark: bool = True, round_dots: bool = True) -> Dots:
    """All dots of a picture that lie wholly inside it.

    Outlines come from thresholds relative to the mean brightness nearby, at window sizes in steps of two;
    the size with the most dots alike is kept. The centre of a dot is then the centroid of

        w = 1 - I / B

    with B a plane through the brightness around the dot, so that neither uneven light nor blur shifts it.
    Round dots without a hole are then fitted by their edges (`dic.calibration.edges`), and the more precise
    of the two is kept.

    Parameters
    ----------
    picture
        Grey values of any depth, shape [rows, columns].
    dark
        True for dark dots on a bright board, False for bright dots on a dark one.
    round_dots
        Whether outlines must be ellipses; False lets squares and other compact shapes pass.
    """
    image = grey(picture)
    if not dark:
        image = image.max() + image.min() - image
    eight = eight_bits(picture) if dark else 255 - eight_bits(picture)
    noise = noise_level(picture)
    low, high = quantiles(eight, (0.01, 0.99))
    step = 0.08 * max(float(high - low), 25.0)
    best: list[tuple[FloatArray, bool]] = []
    size, most = 15, 0.0
    while size <= max(16, min(eight.shape) // 2):
        outlines, score = _alike(_outlines(eight, size, step, round_dots))
        if score > most:
            best, most = outlines, score
        size = 2 * size + 1
    return _located(image, best, noise, round_dots)


def _alike(outlines: list[tuple[FloatArray, bool]]) -> tuple[list[tuple[FloatArray, bool]], float]:
    """The outlines of one size, with the sum of their radii: many dots outweigh specks and a few patches."""
    radius = np.array([0.5 * np.sqrt(ellipse[2] * ellipse[3]) for ellipse, _ in outlines])
    if not radius.size:
        return [], 0.0
    ordered = np.sort(radius)
    total = np.concatenate([[0.0], np.cumsum(ordered)])
    ends = np.searchsorted(ordered, ALIKE * ordered, side="right")
    smallest = ordered[np.argmax(total[ends] - total[:-1])]
    best = (radius >= smallest) & (radius <= ALIKE * smallest)
    alike = [outline for outline, kept in zip(outlines, best, strict=True) if kept]
    return alike, float(radius[best].sum())


def _nothing() -> Dots:
    return Dots(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool))


def _outlines(
    eight: NDArray[np.uint8], size: int, step: float, round_dots: bool
) -> list[tuple[FloatArray, bool]]:
    """Ellipses (x, y, major, minor diameter, angle in degrees) of dark patches, and whether hollow."""
    mask = cv2.adaptiveThreshold(eight, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY_INV, size, step)
    contours, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    if tree is None or len(contours) > MOST_DOTS:
        return []
    rows, columns = eight.shape
    # thousands of specks in every picture: few of them are worth a call of Python
    lengths = np.fromiter(map(len, contours), dtype=np.int64, count=len(contours))
    numbers, found = [], []
    area_of, box_of, ellipse_of = cv2.contourArea, cv2.boundingRect, cv2.fitEllipseDirect
    for k in np.flatnonzero((tree[0, :, 3] < 0) & (lengths >= 8)).tolist():
        contour = contours[k]
        area = area_of(contour) + 0.5 * len(contour)  # through pixel centres: half a pixel short
        if area < LEAST_AREA:
            continue
        x, y, w, h = box_of(contour)
        inside = x > 1 and y > 1 and x + w < columns - 1 and y + h < rows - 1
        # A patch larger than the window is filled only along its rim.
        if not inside or max(w, h) > 0.7 * size:
            continue
        centre, diameters, angle = ellipse_of(contour)
        numbers.append(k)
        found.append((*centre, *diameters, angle, area))
    ellipses, areas = np.split(np.reshape(found, (-1, 6)), [5], axis=1)
    ellipses[:, 2:4] += 1.0
    narrow, wide = np.sort(ellipses[:, 2:4], axis=1).T
    filled = areas[:, 0] / (0.25 * np.pi * narrow * wide)
    # A square fills more of its ellipse's outline, or less, than a disc does.
    least, most = (0.9, 1.1) if round_dots else (0.7, 1.3)
    fine = np.isfinite(ellipses).all(axis=1) & (narrow >= 0.2 * wide) & (least < filled) & (filled < most)
    return [
        (ellipses[k], _has_hole(contours, tree[0], numbers[k], ellipses[k], areas[k, 0]))
        for k in np.flatnonzero(fine)
    ]


def _has_hole(contours: Sequence[Any], tree: NDArray[Any], k: int, ellipse: FloatArray, area: float) -> bool:
    """True if a child outline lies in the middle and is large enough to be meant."""
    child = tree[k, 2]
    while child >= 0:
        hole = contours[child]
        if len(hole) >= 4:
            middle = hole[:, 0].mean(axis=0)
            inner = max(cv2.contourArea(hole) - 0.5 * len(hole), 1.0)
            near = np.hypot(*(middle - ellipse[:2])) < 0.25 * np.sqrt(area)
            if near and 0.015 < inner / area < 0.6:
                return True
        child = tree[child, 0]
    return False


def _located(
    image: FloatArray, outlines: list[tuple[FloatArray, bool]], noise: float, round_dots: bool
) -> Dots:
    """Centroids of the outlined dots; those whose darkness is unlike the others' are left out."""
    ellipses = np.array([ellipse for ellipse, _ in outlines]).reshape(-1, 5)
    values = centroids(image, ellipses, noise)
    good = np.isfinite(values).all(axis=1)
    if not good.any():
        return _nothing()
    values, ellipses = values[good], ellipses[good]
    radius = 0.5 * np.sqrt(ellipses[:, 2] * ellipses[:, 3])
    hollow = np.array([hole for _, hole in outlines])[good]
    depth = values[:, 4]
    kept = depth > 0.4 * np.percentile(depth, 80.0)  # printed dots are about equally dark
    centre, sigma = values[kept, :2], values[kept, 2]
    if round_dots:
        small = np.flatnonzero(~hollow[kept] & (radius[kept] <= LARGEST))
        outline = ellipses[kept][small]
        centre[small], sigma[small] = _fitted(image, centre[small], sigma[small], outline, noise)
    return Dots(centre, sigma, values[kept, 3], radius[kept], hollow[kept])


def _fitted(
    image: FloatArray, centre: FloatArray, sigma: FloatArray, ellipses: FloatArray, noise: float
) -> tuple[FloatArray, FloatArray]:
    """Centres from the edges where that is the more precise, with their sigma."""
    if not len(centre):
        return centre, sigma
    c, s = np.cos(np.deg2rad(ellipses[:, 4])), np.sin(np.deg2rad(ellipses[:, 4]))
    along, across = 4.0 / ellipses[:, 2] ** 2, 4.0 / ellipses[:, 3] ** 2
    shape = np.stack(
        [along * c * c + across * s * s, (along - across) * c * s, along * s * s + across * c * c], axis=1
    )
    reach = 0.5 * float(ellipses[:, 2:4].max()) * WINDOW + MARGIN
    found, noise_of_it = fit_discs(image, centre, shape, reach, noise)
    better = noise_of_it < sigma  # not where the fit failed: NaN
    return np.where(better[:, None], found, centre), np.where(better, noise_of_it, sigma)
