"""Updates of references: forward when a point no longer correlates, back when it does again."""

from dataclasses import dataclass

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.outcome import PointOutcome
from dic.tracking.frame_match import FrameMatch
from dic.tracking.matcher import Matcher, compose
from dic.tracking.references import References, Template, gradient, principal, relative, stretch
from dic.tracking.settings import Tracking

JOIN = 0.7
"""Points that have come this far toward a change of reference (in ln stretch) join one that changes: fewer
pictures are kept and the neighbours keep a common reference."""
QUORUM = 0.02
"""References change when this share of the points found asks for it ..."""
URGENT = 1.5
"""... or one has gone this far beyond the limit (in ln stretch)."""
DROP = 0.05
"""A poor correlation asks for a new reference only if it has fallen by this much since the last change."""
GROWTH_STEP = 1.2
"""A growing subset grows by this factor at a time."""
LARGEST = 101
"""Largest subset of the match [px]."""
PROBATION = 5
"""Frames that a point must do with a reference taken in a hurry before it may take another one so."""


@dataclass(frozen=True)
class Last:
    """The latest frame with a picture, as a reference that a point may need in a hurry."""

    frame: int
    warp: FloatArray
    """Total warps, shape [n, 12]."""
    carried: FloatArray
    """Covariance that a chain through this frame carries [px²], shape [n, 2, 2]."""
    valid: BoolArray
    """Points found in it, shape [n]."""
    excess: FloatArray
    """Largest excess of the residuals in the chain that ends there [-], shape [n]."""


def grown(subset: int, warp: FloatArray, limit: float) -> IntArray:
    """Side that keeps the shortest side of a flattened subset in the picture [px], shape [n].

    Parameters
    ----------
    subset
        Side of the subset at rest [px].
    warp
        Total warps, shape [n, 12].
    limit
        Largest growth [-].
    """
    if limit == 1.0:
        return np.full(len(warp), subset)
    smallest = principal(gradient(warp))[1]
    growth = np.clip(1.0 / np.maximum(smallest, 1e-6), 1.0, limit)
    # few sizes, so that points can be matched together
    growth = np.minimum(GROWTH_STEP ** np.ceil(np.log(growth) / np.log(GROWTH_STEP) - 1e-9), limit)
    side = 2 * np.round((subset * growth - 1.0) / 2.0) + 1
    return np.asarray(np.minimum(side, LARGEST), dtype=np.int64)


class ReferenceUpdates:
    """Decides about the references of n points."""

    def __init__(self, references: References, settings: Tracking) -> None:
        n = len(references.level)
        self.references, self.settings = references, settings
        self.low = np.zeros(n, dtype=bool)
        """Points whose correlation was poor in the frame before, shape [n]."""
        self.fresh = np.full(n, np.nan)
        """Correlation in the first frame after the reference was taken, shape [n]."""
        self.hurried = np.full(n, -PROBATION)
        """Frame, counted from the first, of the last change of reference in a hurry, shape [n]."""
        self.steps = 0

    def _template(
        self,
        matcher: Matcher,
        rows: IntArray,
        frame: int,
        warp: FloatArray,
        carried: FloatArray,
        excess: FloatArray,
    ) -> Template:
        """A frame as the reference of points `rows`; warps, covariances and excess of all points."""
        subset = grown(self.settings.correlation.subset, warp[rows], self.settings.growth)
        return matcher.template(rows, frame, warp[rows], carried[rows], subset, excess[rows])

    def match_last_frame(self, here: FrameMatch, last: Last | None) -> None:
        """Match lost points with the frame before as their reference; those found so keep it."""
        if last is None:
            return
        calm = self.steps - self.hurried >= PROBATION
        rows = np.flatnonzero(~here.valid & last.valid & (here.template.frame != last.frame) & calm)
        if len(rows) == 0:
            return
        template = self._template(here.matcher, rows, last.frame, last.warp, last.carried, last.excess)
        guess = here.guess[rows]
        lean = here.neighbours.any(here.valid)[rows]
        guess[lean] = here.neighbours.best(here.warp, here.zncc, here.valid, rows[lean])
        found = here.attempt(rows, guess, template)
        self.references.renew(found, here.template.take(found))
        self.fresh[found], self.hurried[found] = np.nan, self.steps
        here.propagate()

    def forward(self, here: FrameMatch, frame: int, carried: FloatArray, excess: FloatArray) -> None:
        """Give the points that ask for it this frame as their reference."""
        # a reference taken in a hurry that does not last shall not be what the point is searched with later
        failed = np.flatnonzero(~here.valid & (self.steps - self.hurried < PROBATION))
        self.references.go_back(failed[self.references.level[failed] > 0])
        self.hurried[failed] = -PROBATION
        valid = np.flatnonzero(here.valid)
        new = np.isnan(self.fresh[valid])
        self.fresh[valid[new]] = here.zncc[valid[new]]
        low = np.zeros_like(self.low)
        poor = here.zncc[valid] < np.minimum(self.settings.update_zncc, self.fresh[valid] - DROP)
        low[valid] = poor
        strain = np.log(stretch(relative(here.warp[valid], here.template.warp[valid])))
        limit = np.log(self.settings.update_stretch)
        asks = (strain > limit) | (poor & self.low[valid])
        if np.sum(asks) < QUORUM * len(asks):
            asks = strain > URGENT * limit
        if np.any(asks):
            asks |= strain > JOIN * limit
        rows = valid[asks]
        if len(rows) == 0:
            self.low = low
            return
        self.references.renew(rows, self._template(here.matcher, rows, frame, here.warp, carried, excess))
        self.fresh[rows], low[rows] = np.nan, False
        self.low = low

    def back(self, here: FrameMatch) -> None:
        """Return points to an earlier reference that they look like again, and match them with it."""
        self.steps += 1
        if self.settings.return_every == 0 or self.steps % self.settings.return_every != 0:
            return
        rows = np.flatnonzero(here.valid & (self.references.level > 0))
        if len(rows) == 0:
            return
        earlier = self.references.template(rows, back=1)
        strain = np.log(stretch(relative(here.warp[rows], earlier.warp)))
        near = strain < JOIN * np.log(self.settings.update_stretch)
        rows, earlier = rows[near], earlier.take(np.flatnonzero(near))
        if len(rows) == 0:
            return
        match = here.matcher.match(here.stack, rows, here.warp[rows], earlier)
        off = np.hypot(*(match.warp[:, :2] - here.warp[rows, :2]).T)
        fits = match.outcome == int(PointOutcome.VALID)
        fits &= match.zncc >= np.minimum(self.settings.update_zncc, here.zncc[rows])
        fits &= off <= self.settings.neighbour_gate
        picked = np.flatnonzero(fits)
        rows = rows[picked]
        here.warp[rows], here.zncc[rows] = match.warp[picked], match.zncc[picked]
        here.covariance[rows] = match.covariance[picked]
        here.template.put(rows, earlier.take(picked))
        self.references.go_back(rows)
        self.fresh[rows], self.low[rows] = np.nan, False


def composed(here: FrameMatch) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`compose` for the points found, each of shape [n, 2, 2], and the largest excess of the residuals in
    their chains, shape [n]; NaN for the others."""
    total, carried = np.full_like(here.covariance, np.nan), np.full_like(here.covariance, np.nan)
    rows = np.flatnonzero(here.valid)
    template, warp = here.template.take(rows), here.warp[rows]
    beyond = here.matcher.excess(here.zncc[rows], template)
    total[rows], carried[rows] = compose(here.covariance[rows], warp, template, beyond)
    largest = np.full(len(total), np.nan)
    largest[rows] = np.maximum(beyond, template.excess)
    return total, carried, largest
