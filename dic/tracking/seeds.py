"""First guesses from nothing: where a few points went when no neighbour and no earlier frame can tell."""

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dic.arrays import FloatArray, IntArray
from dic.tracking.frames import Picture

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
    """Where windows of one picture lie in another, by normalised cross-correlation (FFT), to a pixel.

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
