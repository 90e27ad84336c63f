"""Match of all points in one frame: predicted, propagated from neighbours, searched for."""

from dataclasses import dataclass

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.correlation import PictureStack
from dic.correlation.warp import apply
from dic.outcome import PointOutcome
from dic.tracking.frames import Picture
from dic.tracking.initial_guesses import affine_consensus, correlate_windows, match_features, spread
from dic.tracking.matcher import Matcher
from dic.tracking.neighbours import Neighbours
from dic.tracking.references import Template, gradient, relative
from dic.tracking.settings import Tracking

SEEDS = 40
"""Points searched for when a frame is started from nothing."""


@dataclass
class FrameMatch:
    """State of the match of n points in one frame."""

    picture: Picture
    """As recorded, shape [rows, columns]."""
    stack: PictureStack
    """The same, prepared."""
    matcher: Matcher
    neighbours: Neighbours
    settings: Tracking
    guess: FloatArray
    """Total warps expected, shape [n, 12]."""
    warp: FloatArray
    """Total warps found, or the latest iterate, shape [n, 12]."""
    template: Template
    """References of the points."""
    covariance: FloatArray
    """Of the last match alone [px²], shape [n, 2, 2]."""
    zncc: FloatArray
    """Correlations, shape [n]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n]."""
    skipped: BoolArray
    """Lost points that this frame leaves alone (`dic.tracking.neighbours`), shape [n]."""
    propagated: FloatArray
    """The guess that each point was handed last by a neighbour; NaN: none yet, shape [n, 12]."""

    @classmethod
    def begin(
        cls,
        picture: Picture,
        stack: PictureStack,
        matcher: Matcher,
        neighbours: Neighbours,
        settings: Tracking,
        guess: FloatArray,
        known: BoolArray,
        skipped: BoolArray,
        before: IntArray,
    ) -> "FrameMatch":
        """Match the points with a guess (`known`, shape [n]), then all that these lead to.

        Points `skipped`, shape [n], keep the outcome `before`, shape [n], unless the frame needs seeds.
        """
        n = len(guess)
        here = cls(
            picture, stack, matcher, neighbours, settings, guess, np.array(guess),
            matcher.references.template(np.arange(n)),
            np.full((n, 2, 2), np.nan), np.full(n, np.nan),
            np.where(skipped, before, int(PointOutcome.NO_FIRST_GUESS)), np.array(skipped),
            np.full((n, 12), np.nan),
        )  # fmt: skip
        rows = np.flatnonzero(known & ~skipped)
        here.attempt(rows, guess[rows])
        here.propagate()
        if np.mean(here.valid) < settings.least_valid and settings.search > 0:
            here.skipped[:] = False
            here.seed()
            here.propagate()
        here.confirm()
        here.propagate()
        return here

    @property
    def valid(self) -> BoolArray:
        """Points found so far, shape [n]."""
        return np.asarray(self.outcome == int(PointOutcome.VALID))

    def attempt(self, rows: IntArray, guess: FloatArray, template: Template | None = None) -> IntArray:
        """Match points `rows` from these guesses, shape [len(rows), 12]; returns the rows that were found.

        What is found but lies where the neighbours do not expect it is LOW_CORRELATION.
        """
        if len(rows) == 0:
            return rows
        own = self.template.take(rows) if template is None else template
        match = self.matcher.match(self.stack, rows, guess, own, current=template is None)
        self.warp[rows], self.zncc[rows], self.outcome[rows] = match.warp, match.zncc, match.outcome
        self.covariance[rows] = match.covariance
        found = rows[self.valid[rows]]
        gate = self.settings.neighbour_gate
        agree = self.neighbours.agreeing(self.warp, self.valid, found, gate)
        self.outcome[found[~agree]] = int(PointOutcome.LOW_CORRELATION)
        found = found[agree]
        if template is not None:
            self.template.put(found, template.take(np.flatnonzero(np.isin(rows, found))))
        return found

    def propagate(self) -> None:
        """Propagate the warps of found points to their neighbours, round by round (reliability-guided).

        The neighbour with the best correlation gives the guess. A round takes all points at the front at
        once, and a point is tried again only when one of its neighbours has been found since and has another
        guess than the last.
        """
        fresh = self.valid
        while True:
            rows = np.flatnonzero(~self.valid & ~self.skipped & self.neighbours.any(fresh))
            if len(rows) == 0:
                return
            guess = self.neighbours.best(self.warp, self.zncc, self.valid, rows)
            new = np.any(guess != self.propagated[rows], axis=1)
            rows, guess = rows[new], guess[new]
            self.propagated[rows] = guess
            found = self.attempt(rows, guess)
            fresh = np.zeros_like(fresh)
            fresh[found] = True

    def confirm(self) -> None:
        """Reject points that neither their neighbours nor their prediction confirm.

        In a picture of another scene single subsets find something alike; they lie where nobody expects them.
        """
        valid = np.flatnonzero(self.valid)
        gate = self.settings.neighbour_gate
        votes, found = self.neighbours.votes(self.warp, self.valid, valid, gate)
        surprising = np.hypot(*(self.warp[valid, :2] - self.guess[valid, :2]).T) > gate
        crowded = np.sum(self.neighbours.there[valid], axis=1) >= 3
        wrong = (votes < 2) & ((found >= 3) | (crowded & surprising))
        self.outcome[valid[wrong]] = int(PointOutcome.LOW_CORRELATION)

    def seed(self) -> None:
        """Search for some of the points far from where they were expected, by features and by windows."""
        references = self.matcher.references
        lost = np.flatnonzero(~self.valid)
        rows = spread(self.matcher.points, lost, SEEDS)
        template = self.template.take(rows)
        expected = apply(self.matcher.points[rows], self.guess[rows])
        origin = apply(self.matcher.points[rows], template.warp)
        since = relative(self.guess[rows], template.warp)
        half = self.settings.correlation.subset // 2
        for frame in np.unique(template.frame):
            part = np.flatnonzero(template.frame == frame)
            reference = references.pictures[int(frame)]
            ways = (
                affine_consensus(*match_features(reference, self.picture), origin[part]),
                (
                    correlate_windows(
                        reference, self.picture, origin[part], expected[part], since[part],
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
