"""Match of all points in one frame; initial guesses from prediction, neighbours and search."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from dic.basics import BoolArray, FloatArray, IntArray, cv2, median
from dic.correlation import PictureStack
from dic.correlation.subsets import apply, neighbour_warp
from dic.outcome import PointOutcome
from dic.tracking.inputs import Picture, Tracking
from dic.tracking.matcher import Matcher, Template, gradient, relative

ORDERS = (0, 1, 2)
"""Orders of extrapolation: constant position, constant velocity, constant acceleration."""
JURY = 300
"""Approximate number of points from which the order is chosen."""
PARTS = (slice(0, 2), slice(2, 6), slice(6, 12))
"""Parameters with a common order: displacement, first derivatives, second derivatives. Noisy parameters need
a low order."""


class Predictor:
    """Extrapolates the warps of the last three frames in which each point was found.

    The order with the best prediction of the last frame (median over the points) is used. It is chosen
    separately for displacements and their derivatives. The order adapts to rest, steady motion or vibration.
    A point with too few earlier frames uses the highest possible order.
    """

    def __init__(self, n: int) -> None:
        self.frame = np.zeros((3, n), dtype=np.int64)
        """Frames in which each point was found, latest first, shape [3, n]."""
        self.warp = np.zeros((3, n, 12))
        """Warps in those frames, shape [3, n, 12]."""
        self.known = np.zeros(n, dtype=np.int64)
        """Number of filled entries, shape [n]."""
        self.order = [0] * len(PARTS)
        """Current order for each of `PARTS`."""
        self._foretold: dict[int, FloatArray] = {}

    def predict(self, frame: int) -> FloatArray:
        """Warps expected in `frame`, shape [n, 12]. They are zero for a point that was never found."""
        self._foretold = self._extrapolated(frame)
        guess = np.empty_like(self.warp[0])
        for part, order in zip(PARTS, self.order, strict=True):
            guess[:, part] = self._foretold[order][:, part]
        return guess

    def add(self, frame: int, rows: IntArray, warp: FloatArray) -> None:
        """Add the warps of points `rows` that were found in `frame`, shape [len(rows), 12]."""
        highest = min(int(np.max(self.known[rows], initial=0)) - 1, max(ORDERS))
        if self._foretold and highest > 0:
            past = np.flatnonzero(self.known[rows] > highest)
            past = past[:: max(len(past) // JURY, 1)]
            position = warp[past]
            foretold = np.stack([self._foretold[k][rows[past]] for k in ORDERS[: highest + 1]])
            off = np.abs(foretold - position)
            for k, part in enumerate(PARTS):
                self.order[k] = int(np.argmin(median(off[..., part].max(axis=-1), axis=-1)))
        self._foretold = {}
        repeated = (self.known[rows] > 0) & (self.frame[0, rows] == frame)  # a guess that led to a match
        advanced = rows[~repeated]
        for history in (self.frame, self.warp):
            for place in (2, 1):
                history[place, advanced] = history[place - 1, advanced]
        self.frame[0, rows], self.warp[0, rows] = frame, warp
        self.known[advanced] = np.minimum(self.known[advanced] + 1, 3)

    def _extrapolated(self, frame: int) -> dict[int, FloatArray]:
        """Value at `frame` of Lagrange's polynomial through the latest order + 1 frames of each point, by
        order, each of shape [n, 12]. If a point has fewer frames, all are used."""
        by_order = {0: self.warp[0].copy()}
        for order in ORDERS[1:]:
            by_order[order] = by_order[order - 1].copy()  # for points with fewer frames
            available = self.known > order
            rows = slice(None) if available.all() else np.flatnonzero(available)
            times = self.frame[: order + 1, rows].astype(np.float64)
            total = np.zeros((times.shape[1], 12))
            for j in range(order + 1):
                weight = np.ones(times.shape[1])
                for i in range(order + 1):
                    if i != j:
                        weight *= (frame - times[i]) / (times[j] - times[i])
                total += weight[:, None] * self.warp[j, rows]
            by_order[order][rows] = total
        return by_order


RATIO = 0.8
"""Largest distance of a feature's best match over that of its second best match (Lowe 2004)."""
NEAREST_FEATURES = 16
"""Number of features around a point from which an affine motion is estimated."""
CONSENSUS = 6
"""Smallest number of features that must agree with the affine motion within `AGREE`."""
AGREE = 2.0
"""Distance within which a feature agrees with the affine motion [px]."""
FEATURES = 4000
"""Largest number of features detected in a picture."""


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
    """Positions of windows of one picture in another, to one pixel, by normalised cross-correlation (FFT).

    The window of the reference picture is deformed by the guess. It is searched in the deformed picture
    around its guessed position.
    """
    f, g = (np.ascontiguousarray(picture, dtype=np.float32) for picture in (reference, deformed))
    places, score = np.full((len(origin), 2), np.nan), np.full(len(origin), -1.0)
    side = 2 * half + 1
    for i, (x0, centre, F_point) in enumerate(zip(origin, guess, F, strict=True)):
        if not (np.all(np.isfinite(centre)) and np.all(np.isfinite(F_point))):
            continue
        if abs(np.linalg.det(F_point)) < 1e-3:
            continue
        middle = np.round(centre).astype(int)
        low = np.maximum(middle - half - search, 0)
        high = np.minimum(middle + half + search + 1, g.shape[::-1])
        if np.any(high - low < side):
            continue
        back = np.linalg.inv(F_point)
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
        # the patch is centred on the point, so its position does not depend on the guess
        places[i] = low + np.array([column, row]) + half
        score[i] = float(scores[row, column])
    return places, score


def _eight_bits(picture: Picture) -> NDArray[np.uint8]:
    low, high = np.percentile(picture, (0.5, 99.5))
    grey = (np.asarray(picture, dtype=np.float64) - low) * (255.0 / max(float(high - low), 1e-12))
    return np.asarray(np.clip(grey, 0.0, 255.0), dtype=np.uint8)


def match_features(reference: Picture, deformed: Picture) -> tuple[FloatArray, FloatArray]:
    """Matching features of two pictures (SIFT with Lowe's ratio test) [px], each of shape [m, 2]."""
    sift = cv2.SIFT.create(nfeatures=FEATURES)
    keys, descriptors = [], []
    for picture in (reference, deformed):
        keys_of_picture, described = sift.detectAndCompute(_eight_bits(picture), None)
        keys.append(np.array([key.pt for key in keys_of_picture], dtype=np.float64).reshape(-1, 2))
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
    """Local affine motions around points, fitted to the matched features (RANSAC)."""
    places = np.full((len(origin), 2), np.nan)
    F = np.full((len(origin), 2, 2), np.nan)
    if len(places0) < CONSENSUS:
        return places, F
    tree = cKDTree(places0)
    _, near = tree.query(origin, k=min(NEAREST_FEATURES, len(places0)))
    for i, rows in enumerate(np.atleast_2d(near)):
        cv2.setRNGSeed(0)
        affine, agree = cv2.estimateAffine2D(
            places0[rows] - origin[i], places1[rows], method=cv2.RANSAC, ransacReprojThreshold=AGREE
        )
        if affine is None or int(np.sum(agree)) < CONSENSUS:
            continue
        places[i], F[i] = affine[:, 2], affine[:, :2]
    return places, F


NEIGHBOUR_COUNT = 8
"""Number of neighbours, as around a point of a square grid."""
REACH = 3.0
"""Largest distance of a neighbour, over the median distance of nearest neighbours [-]."""


@dataclass(frozen=True)
class Neighbours:
    """The nearest points of every point in the material picture."""

    index: IntArray
    """Rows of the neighbours, nearest first, shape [n, k]; the point itself where `exists` is False."""
    step: FloatArray
    """Vectors from the neighbours to the point [px], shape [n, k, 2]."""
    exists: BoolArray
    """True where there is such a neighbour, shape [n, k]."""

    @cached_property
    def _across(self) -> FloatArray:
        """x and y components of the steps, shape [2, n, k]. Each is contiguous in memory."""
        return np.ascontiguousarray(np.moveaxis(self.step, -1, 0))

    @classmethod
    def joined(cls, sets: Sequence["Neighbours"]) -> "Neighbours":
        """Neighbours in several sets of points, which are numbered one set after the other."""
        k, parts, first = max(one.exists.shape[1] for one in sets), [], 0
        for one in sets:
            n, missing = len(one.index), k - one.exists.shape[1]
            itself = np.repeat(np.arange(n)[:, None], missing, axis=1)
            index = np.concatenate([one.index, itself], axis=1) + first
            room = ((0, 0), (0, missing))
            parts.append((index, np.pad(one.step, (*room, (0, 0))), np.pad(one.exists, room)))
            first += n
        return cls(*(np.concatenate(part) for part in zip(*parts, strict=True)))

    @classmethod
    def of(cls, points: FloatArray) -> "Neighbours":
        """Neighbours of `points` (x, y) [px], shape [n, 2]."""
        n = len(points)
        k = min(NEIGHBOUR_COUNT, n - 1)
        if k < 1:
            empty = np.zeros((n, 1), dtype=np.int64)
            return cls(empty, np.zeros((n, 1, 2)), np.zeros((n, 1), dtype=bool))
        distance, index = cKDTree(points).query(points, k=k + 1)
        # two coincident points may each be the nearest point of the other
        itself = index == np.arange(n)[:, None]
        itself[~itself.any(axis=1), -1] = True
        distance, index = distance[~itself].reshape(n, k), index[~itself].reshape(n, k)
        close = distance <= REACH * np.median(distance[:, 0])
        index = np.where(close, index, np.arange(n)[:, None])
        return cls(index, points[:, None, :] - points[index], close)

    def guesses(self, warp: FloatArray, rows: IntArray) -> FloatArray:
        """Warps of points `rows`, extrapolated from each neighbour, shape [len(rows), k, 12]."""
        return neighbour_warp(warp[self.index[rows]], self.step[rows])

    def best(self, warp: FloatArray, zncc: FloatArray, usable: BoolArray, rows: IntArray) -> FloatArray:
        """Warps extrapolated from the neighbours with the best correlation, shape [len(rows), 12].

        ``warp``: warps of all points, shape [n, 12]. ``zncc``: their correlations, shape [n]. ``usable``:
        points that have been found, shape [n]. ``rows``: points with at least one usable neighbour.
        """
        index = self.index[rows]
        score = np.where(self.exists[rows] & usable[index], zncc[index], -np.inf)
        pick = np.argmax(score, axis=1)
        indices = np.arange(len(rows))
        return neighbour_warp(warp[index[indices, pick]], self.step[rows][indices, pick])

    def any(self, usable: BoolArray) -> BoolArray:
        """Points that have a neighbour among the `usable` ones, shape [n]."""
        return np.asarray((self.exists & usable[self.index]).any(axis=1))

    def votes(
        self, warp: FloatArray, usable: BoolArray, rows: IntArray, gate: float
    ) -> tuple[IntArray, IntArray]:
        """Number of neighbours that agree with the positions of points `rows`.

        ``warp``, ``usable``, ``rows``: as in `best`. ``gate``: largest distance [px]. Returns: numbers of
        neighbours that agree and of neighbours that have been found, shape [len(rows)] each.
        """
        index = self.index[rows]
        x, y = self._across[:, rows]
        # column by column: twice as fast as by rows
        shift, near = warp[rows, :2], np.take(np.ascontiguousarray(warp[:, :6].T), index, axis=1)
        u = near[0] + near[2] * x + near[3] * y - shift[:, :1]
        v = near[1] + near[4] * x + near[5] * y - shift[:, 1:]
        counted = self.exists[rows] & usable[index]
        agree = counted & (u * u + v * v <= gate * gate)
        return np.count_nonzero(agree, axis=1), np.count_nonzero(counted, axis=1)

    def agreeing(self, warp: FloatArray, usable: BoolArray, rows: IntArray, gate: float) -> BoolArray:
        """Points whose positions agree with at least two of their neighbours, shape [len(rows)].

        Two neighbours are sufficient, because at the border of two bodies most neighbours may belong to the
        other body. A point with fewer than three tracked neighbours is not checked and agrees. Parameters as
        in `votes`.
        """
        votes, voters = self.votes(warp, usable, rows, gate)
        return np.asarray((votes >= 2) | (voters < 3))


TRIES = 4
"""A lost point is searched in this number of successive frames; then it is skipped."""
EVERY = 8
"""A skipped point is searched again in every n-th frame, or as soon as a neighbour is found again."""


class RetrySchedule:
    """Schedule of searches for lost points; counts the frames since each point was lost."""

    def __init__(self, n: int) -> None:
        self.lost = np.zeros(n, dtype=np.int64)
        """Number of frames with a picture since the point was last found, shape [n]."""

    @property
    def skipped(self) -> BoolArray:
        """Points that are not searched in the next frame, shape [n]."""
        return np.asarray((self.lost >= TRIES) & (self.lost % EVERY != 0))

    def add(self, valid: BoolArray, seen: BoolArray, neighbours: Neighbours) -> None:
        """Update the counts with the points found in a frame, and the points with a picture, shape [n]
        each."""
        back = valid & (self.lost > 0)
        self.lost = np.where(valid, 0, self.lost + seen)
        self.lost[seen & ~valid & neighbours.any(back)] = 0


SEEDS = 40
"""Number of points that are searched when a frame has no usable guesses."""


@dataclass
class FrameMatch:
    """State of the match of n points of one or more cameras in one frame."""

    pictures: dict[int, Picture]
    """Pictures by camera as recorded, shape [rows, columns] each; only usable ones."""
    stack: PictureStack
    """The prepared pictures."""
    searched: IntArray
    """Index of each camera's picture in the stack; -1: no usable picture."""
    matcher: Matcher
    neighbours: Neighbours
    settings: Tracking
    guess: FloatArray
    """Predicted total warps, shape [n, 12]."""
    warp: FloatArray
    """Total warps found, or the last iterate, shape [n, 12]."""
    template: Template
    """References of the points."""
    covariance: FloatArray
    """Covariance of the last match only [px²], shape [n, 2, 2]."""
    zncc: FloatArray
    """Correlations, shape [n]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n]."""
    skipped: BoolArray
    """Lost points that are not searched in this frame (`RetrySchedule`), shape [n]."""
    propagated: FloatArray
    """The last guess of each point from a neighbour, shape [n, 12]; NaN: none yet."""

    @classmethod
    def begin(
        cls,
        pictures: dict[int, Picture],
        stack: PictureStack,
        searched: IntArray,
        matcher: Matcher,
        neighbours: Neighbours,
        settings: Tracking,
        guess: FloatArray,
        predicted: BoolArray,
        skipped: BoolArray,
        before: IntArray,
    ) -> "FrameMatch":
        """Match the points with a guess (`predicted`, shape [n]), then their neighbours by propagation.

        Points in `skipped`, shape [n], keep the outcome `before`, shape [n]. If the frame of a camera needs
        seeds, they are searched too. Points of a camera without a usable picture are not searched.
        """
        n = len(guess)
        seen = searched[matcher.camera] >= 0
        outcome = np.where(skipped, before, int(PointOutcome.NO_FIRST_GUESS))
        match = cls(
            pictures, stack, searched, matcher, neighbours, settings, guess, np.array(guess),
            matcher.references.template(np.arange(n)),
            np.full((n, 2, 2), np.nan), np.full(n, np.nan),
            np.where(seen, outcome, int(PointOutcome.NO_PICTURE)), skipped | ~seen,
            np.full((n, 12), np.nan),
        )  # fmt: skip
        rows = np.flatnonzero(predicted & ~match.skipped)
        match.attempt(rows, guess[rows])
        match.propagate()
        found = [match.valid[matcher.camera == camera] for camera in pictures]
        poor = [c for c, valid in zip(pictures, found, strict=True) if np.mean(valid) < settings.least_valid]
        if poor and settings.search > 0:
            for camera in poor:
                match.seed(camera)
            match.propagate()
        if match.confirm():
            match.propagate()
        return match

    @property
    def valid(self) -> BoolArray:
        """Points found so far, shape [n]."""
        return np.asarray(self.outcome == int(PointOutcome.VALID))

    def attempt(self, rows: IntArray, guess: FloatArray, template: Template | None = None) -> IntArray:
        """Match points `rows` from these guesses, shape [len(rows), 12]; returns the rows that were found.

        A point whose position contradicts its neighbours ends as LOW_CORRELATION.
        """
        if len(rows) == 0:
            return rows
        template_rows = self.template.take(rows) if template is None else template
        match = self.matcher.match(
            self.stack, self.searched, rows, guess, template_rows, current=template is None
        )
        self.warp[rows], self.zncc[rows], self.outcome[rows] = match.warp, match.zncc, match.outcome
        self.covariance[rows] = match.covariance
        matched = rows[self.valid[rows]]
        gate = self.settings.neighbour_gate
        agree = self.neighbours.agreeing(self.warp, self.valid, matched, gate)
        self.outcome[matched[~agree]] = int(PointOutcome.LOW_CORRELATION)
        matched = matched[agree]
        if template is not None:
            self.template.put(matched, template.take(np.flatnonzero(np.isin(rows, matched))))
        return matched

    def propagate(self, found: IntArray | None = None) -> None:
        """Propagate the warps of found points to their neighbours, round by round (reliability-guided).

        The neighbour with the best correlation gives the guess. A round matches all points that have found
        neighbours at once. A point is tried again only if a new neighbour gives a different guess. ``found``:
        points found since the last call, if none was rejected since. None: all.
        """
        fresh = self.valid if found is None else np.isin(np.arange(len(self.outcome)), found)
        while True:
            valid = self.valid
            rows = np.flatnonzero(~valid & ~self.skipped & self.neighbours.any(fresh))
            if len(rows) == 0:
                return
            guess = self.neighbours.best(self.warp, self.zncc, valid, rows)
            new = np.any(guess != self.propagated[rows], axis=1)
            rows, guess = rows[new], guess[new]
            if len(rows) == 0:
                return
            self.propagated[rows] = guess
            matched = self.attempt(rows, guess)
            fresh = np.zeros_like(fresh)
            fresh[matched] = True

    def confirm(self) -> bool:
        """Reject points that disagree with both their neighbours and their prediction; True if there are any.

        In a picture of another scene a few subsets may correlate by chance, but at unexpected positions.
        """
        valid = np.flatnonzero(self.valid)
        gate = self.settings.neighbour_gate
        votes, voters = self.neighbours.votes(self.warp, self.valid, valid, gate)
        surprising = np.hypot(*(self.warp[valid, :2] - self.guess[valid, :2]).T) > gate
        crowded = np.sum(self.neighbours.exists[valid], axis=1) >= 3
        wrong = (votes < 2) & ((voters >= 3) | (crowded & surprising))
        self.outcome[valid[wrong]] = int(PointOutcome.LOW_CORRELATION)
        return bool(wrong.any())

    def seed(self, camera: int) -> None:
        """Search some of a camera's points far from their predicted positions, by features and by windows.

        Its other points are not skipped.
        """
        references, picture = self.matcher.references, self.pictures[camera]
        seen = self.matcher.camera == camera
        self.skipped[seen] = False
        failed = np.flatnonzero(seen & ~self.valid)
        rows = spread(self.matcher.points, failed, SEEDS)
        template = self.template.take(rows)
        expected = apply(self.matcher.points[rows], self.guess[rows])
        origin = apply(self.matcher.points[rows], template.warp)
        since = relative(self.guess[rows], template.warp)
        half = self.settings.correlation.subset // 2
        for frame in np.unique(template.frame):
            part = np.flatnonzero(template.frame == frame)
            reference = references.pictures[int(frame)]
            ways = (
                affine_consensus(*match_features(reference, picture), origin[part]),
                (
                    correlate_windows(
                        reference, picture, origin[part], expected[part], since[part],
                        half=half, search=self.settings.search,
                    )[0],
                    since[part],
                ),
            )  # fmt: skip
            for places, F in ways:
                open_ = np.flatnonzero(np.all(np.isfinite(places), axis=1) & ~self.valid[rows[part]])
                guess = np.zeros((len(open_), 12))
                chosen = rows[part][open_]
                guess[:, :2] = places[open_] - self.matcher.points[chosen]
                total = F[open_] @ gradient(template.warp[part][open_])
                guess[:, 2:6] = (total - np.eye(2)).reshape(-1, 4)
                self.attempt(chosen, guess)
