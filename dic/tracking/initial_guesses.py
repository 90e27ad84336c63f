"""Initial guesses of displacements: extrapolated from earlier frames, or searched for without any."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dic.arrays import FloatArray, IntArray
from dic.opencv import cv2
from dic.robust import median
from dic.tracking.frames import Picture

ORDERS = (0, 1, 2)
"""At rest, constant velocity, constant acceleration."""
JURY = 300
"""Points that decide about the order, about."""
PARTS = (slice(0, 2), slice(2, 6), slice(6, 12))
"""Displacement, its first and its second derivatives: the noisier, the lower the order that serves."""


class Predictor:
    """Extrapolates the warps of the last three frames in which each point was found.

    The order of the extrapolation is that which would have foretold the last frame best, by the median over
    the points, for displacements and their derivatives each: a series that starts from rest, moves steadily
    or is shaken chooses its own. A point with too short a past takes the highest order it has.
    """

    def __init__(self, n: int) -> None:
        self.frame = np.zeros((3, n), dtype=np.int64)
        """Latest first, shape [3, n]."""
        self.warp = np.zeros((3, n, 12))
        """Warps in those frames, shape [3, n, 12]."""
        self.known = np.zeros(n, dtype=np.int64)
        """Number of them that are filled, shape [n]."""
        self.order = [0] * len(PARTS)
        """Order in use for each of `PARTS`."""
        self._foretold: dict[int, FloatArray] = {}

    def predict(self, frame: int) -> FloatArray:
        """Warps expected in `frame`, shape [n, 12]; those of a point never found are zero."""
        self._foretold = self._extrapolated(frame)
        guess = np.empty_like(self.warp[0])
        for part, order in zip(PARTS, self.order, strict=True):
            guess[:, part] = self._foretold[order][:, part]
        return guess

    def add(self, frame: int, rows: IntArray, warp: FloatArray) -> None:
        """Take in that points `rows` were found in `frame` with these warps, shape [len(rows), 12]."""
        highest = min(int(np.max(self.known[rows], initial=0)) - 1, max(ORDERS))
        if self._foretold and highest > 0:
            past = np.flatnonzero(self.known[rows] > highest)
            past = past[:: max(len(past) // JURY, 1)]
            found = warp[past]
            foretold = np.stack([self._foretold[k][rows[past]] for k in ORDERS[: highest + 1]])
            off = np.abs(foretold - found)
            for k, part in enumerate(PARTS):
                self.order[k] = int(np.argmin(median(off[..., part].max(axis=-1), axis=-1)))
        self._foretold = {}
        again = (self.known[rows] > 0) & (self.frame[0, rows] == frame)  # a first guess, now found
        later = rows[~again]
        for kept in (self.frame, self.warp):
            for place in (2, 1):
                kept[place, later] = kept[place - 1, later]
        self.frame[0, rows], self.warp[0, rows] = frame, warp
        self.known[later] = np.minimum(self.known[later] + 1, 3)

    def _extrapolated(self, frame: int) -> dict[int, FloatArray]:
        """Lagrange's polynomials through the latest order + 1 frames of each point, or as many as it has, at
        `frame`; of each of `ORDERS`, shape [n, 12]."""
        found = {0: self.warp[0].copy()}
        for order in ORDERS[1:]:
            found[order] = found[order - 1].copy()  # of a point with a shorter past
            known = self.known > order
            rows = slice(None) if known.all() else np.flatnonzero(known)
            times = self.frame[: order + 1, rows].astype(np.float64)
            total = np.zeros((times.shape[1], 12))
            for j in range(order + 1):
                weight = np.ones(times.shape[1])
                for i in range(order + 1):
                    if i != j:
                        weight *= (frame - times[i]) / (times[j] - times[i])
                total += weight[:, None] * self.warp[j, rows]
            found[order][rows] = total
        return found


RATIO = 0.8
"""A feature's best match must be this much nearer than its second best (Lowe 2004)."""
NEAREST = 16
"""Features around a point whose motion is asked for an affine consensus."""
CONSENSUS = 6
"""Features that must agree with it, to `AGREE`."""
AGREE = 2.0
"""Distance within which a feature agrees with the affine motion [px]."""
FEATURES = 4000
"""Features looked for in a picture."""


def spread(points: FloatArray, rows: IntArray, n: int) -> IntArray:
    """At most `n` of the points `rows`, far from each other (farthest-point sampling)."""
    if len(rows) <= n:
        return rows
    places = points[rows]
    picked = [int(np.argmin(np.sum((places - places.mean(axis=0)) ** 2, axis=1)))]
    distance = np.full(len(rows), np.inf)
    for _ in range(n - 1):
        distance = np.minimum(distance, np.sum((places - places[picked[-1]]) ** 2, axis=1))
        picked.append(int(np.argmax(distance)))
    return rows[np.array(picked)]


def correlate_windows(
    reference: Picture,
    deformed: Picture,
    origin: FloatArray,
    guess: FloatArray,
    F: FloatArray,
    *,
    half: int,
    search: int,
) -> tuple[FloatArray, FloatArray]:
    """Places of windows of one picture in another, by normalised cross-correlation (FFT), to a pixel.

    The window is cut out of the reference picture as the guess says that it looks in the deformed one, and
    searched for around its guessed place.

    Parameters
    ----------
    reference, deformed
        Grey values, shape [rows, columns].
    origin
        Places in the reference picture (x, y) [px], shape [n, 2].
    guess
        Places expected in the deformed picture [px], shape [n, 2].
    F
        Expected deformation gradient from the reference to the deformed picture, shape [n, 2, 2].
    half
        Half the side of the window, in the deformed picture [px].
    search
        Half the side of the area searched [px].

    Returns
    -------
    tuple
        Places found [px], shape [n, 2], and their correlations, shape [n]; NaN and -1 where window or area
        leave the pictures.
    """
    f, g = (np.ascontiguousarray(picture, dtype=np.float32) for picture in (reference, deformed))
    places, score = np.full((len(origin), 2), np.nan), np.full(len(origin), -1.0)
    side = 2 * half + 1
    for i, (x0, centre, gradient) in enumerate(zip(origin, guess, F, strict=True)):
        if not (np.all(np.isfinite(centre)) and np.all(np.isfinite(gradient))):
            continue
        if abs(np.linalg.det(gradient)) < 1e-3:
            continue
        middle = np.round(centre).astype(int)
        low = np.maximum(middle - half - search, 0)
        high = np.minimum(middle + half + search + 1, g.shape[::-1])
        if np.any(high - low < side):
            continue
        back = np.linalg.inv(gradient)
        window = np.array(
            [[x - half, y - half] for x, y in ((0, 0), (2 * half, 0), (0, 2 * half), (2 * half,) * 2)]
        )
        corners = x0 + window @ back.T
        if np.any(corners < 0.0) or np.any(corners > np.array(f.shape[::-1]) - 1.0):
            continue
        to_reference = np.column_stack([back, x0 - back @ np.full(2, float(half))])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        patch = cv2.warpAffine(f, to_reference, (side, side), flags=flags)
        if float(patch.std()) <= 0.0:
            continue
        scores = cv2.matchTemplate(g[low[1] : high[1], low[0] : high[0]], patch, cv2.TM_CCOEFF_NORMED)
        row, column = np.unravel_index(int(np.argmax(scores)), scores.shape)
        # the patch is centred on the point itself, so its place may be read off without the guess
        places[i] = low + np.array([column, row]) + half
        score[i] = float(scores[row, column])
    return places, score


def _eight_bits(picture: Picture) -> NDArray[np.uint8]:
    low, high = np.percentile(picture, (0.5, 99.5))
    grey = (np.asarray(picture, dtype=np.float64) - low) * (255.0 / max(float(high - low), 1e-12))
    return np.asarray(np.clip(grey, 0.0, 255.0), dtype=np.uint8)


def match_features(reference: Picture, deformed: Picture) -> tuple[FloatArray, FloatArray]:
    """Places that look alike in two pictures (SIFT with Lowe's ratio test) [px], each of shape [m, 2]."""
    sift = cv2.SIFT.create(nfeatures=FEATURES)
    keys, descriptors = [], []
    for picture in (reference, deformed):
        found, described = sift.detectAndCompute(_eight_bits(picture), None)
        keys.append(np.array([key.pt for key in found], dtype=np.float64).reshape(-1, 2))
        descriptors.append(described)
    if min(len(k) for k in keys) < 2:
        return np.zeros((0, 2)), np.zeros((0, 2))
    pairs = cv2.BFMatcher(cv2.NORM_L2).knnMatch(descriptors[0], descriptors[1], k=2)
    good = [p[0] for p in pairs if len(p) == 2 and p[0].distance < RATIO * p[1].distance]
    first = np.array([m.queryIdx for m in good], dtype=np.int64)
    second = np.array([m.trainIdx for m in good], dtype=np.int64)
    return keys[0][first], keys[1][second]


def affine_consensus(
    places0: FloatArray, places1: FloatArray, origin: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Local affine motions that the matched features around points agree on (RANSAC).

    Parameters
    ----------
    places0, places1
        Matched features in the reference and the deformed picture [px], each of shape [m, 2].
    origin
        Points in the reference picture [px], shape [n, 2].

    Returns
    -------
    tuple
        Places in the deformed picture [px], shape [n, 2], and deformation gradients, shape [n, 2, 2]; NaN
        where fewer than `CONSENSUS` of the `NEAREST` features agree.
    """
    places = np.full((len(origin), 2), np.nan)
    F = np.full((len(origin), 2, 2), np.nan)
    if len(places0) < CONSENSUS:
        return places, F
    tree = cKDTree(places0)
    _, near = tree.query(origin, k=min(NEAREST, len(places0)))
    for i, rows in enumerate(np.atleast_2d(near)):
        cv2.setRNGSeed(0)
        affine, agree = cv2.estimateAffine2D(
            places0[rows] - origin[i], places1[rows], method=cv2.RANSAC, ransacReprojThreshold=AGREE
        )
        if affine is None or int(np.sum(agree)) < CONSENSUS:
            continue
        places[i], F[i] = affine[:, 2], affine[:, :2]
    return places, F
