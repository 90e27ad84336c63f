"""Tracking of points through the frames of one camera, with updates of the reference pictures.

A point gets a later reference when the correlation with its reference is too low. It returns to an earlier
reference when it correlates with this one again.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from dic.basics import BoolArray, FloatArray, IntArray
from dic.correlation import Noise, Templates
from dic.correlation.subsets import identity
from dic.outcome import FrameOutcome, PointOutcome
from dic.tracking.frame_match import FrameMatch, Neighbours, Predictor, RetrySchedule
from dic.tracking.inputs import FramesAhead, Picture, Scene, Series, Track, Tracking, count
from dic.tracking.matcher import (
    Matcher,
    References,
    Template,
    compose,
    gradient,
    in_material,
    inherited_covariance,
    principal,
    relative,
    stretch,
)

JOIN = 0.7
"""Above this share of the limit of stretch (in ln stretch), a point changes its reference together with
others. Fewer pictures are then stored, and neighbours have a common reference."""
QUORUM = 0.02
"""References are changed if at least this share of the tracked points needs a change ..."""
URGENT = 1.5
"""... or if one point exceeds the limit by this factor (in ln stretch)."""
DROP = 0.05
"""A poor correlation leads to a new reference only if it has decreased by at least this since the last
change."""
GROWTH_STEP = 1.2
"""Factor of one growth step of a growing subset."""
LARGEST = 101
"""Largest subset of the match [px]."""
PROBATION = 5
"""Smallest number of frames between two emergency references of a point."""


@dataclass(frozen=True)
class LatestFrame:
    """The latest frame with a picture, as an emergency reference for lost points."""

    frame: int
    warp: FloatArray
    """Total warps, shape [n, 12]."""
    carried: FloatArray
    """Covariance of a chain of references through this frame [px²], shape [n, 2, 2]."""
    valid: BoolArray
    """Points found in this frame, shape [n]."""
    excess: FloatArray
    """Largest excess of the residuals in the chain that ends in this frame [-], shape [n]."""


def enlarged_subset(subset: int, warp: FloatArray, limit: float) -> IntArray:
    """Side of the subset that keeps the shortest side of a flattened subset in the picture [px], shape [n].

    ``subset``: side of the subset at rest [px]. ``warp``: total warps, shape [n, 12]. ``limit``: largest
    growth [-].
    """
    if limit == 1.0:
        return np.full(len(warp), subset)
    smallest = principal(gradient(warp))[1]
    growth = np.clip(1.0 / np.maximum(smallest, 1e-6), 1.0, limit)
    # few sizes: points of one size are matched together
    growth = np.minimum(GROWTH_STEP ** np.ceil(np.log(growth) / np.log(GROWTH_STEP) - 1e-9), limit)
    side = 2 * np.round((subset * growth - 1.0) / 2.0) + 1
    return np.asarray(np.minimum(side, LARGEST), dtype=np.int64)


class _ReferenceUpdates:
    """Decides when the references of n points change."""

    def __init__(self, references: References, settings: Tracking) -> None:
        n = len(references.level)
        self.references, self.settings = references, settings
        self.low = np.zeros(n, dtype=bool)
        """Points whose correlation was poor in the previous frame, shape [n]."""
        self.fresh = np.full(n, np.nan)
        """Correlation in the first frame after the reference was taken, shape [n]."""
        self.hurried = np.full(n, -PROBATION)
        """Frame, counted from the first, of the last emergency change of reference, shape [n]."""
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
        """Make a frame the reference of points `rows`. Warps, covariances and excess are those of all
        points."""
        subset = enlarged_subset(self.settings.correlation.subset, warp[rows], self.settings.growth)
        return matcher.template(rows, frame, warp[rows], carried[rows], subset, excess[rows])

    def match_last_frame(self, current: FrameMatch, last: LatestFrame | None) -> None:
        """Match lost points with the previous frame as reference. Points that are found in this way keep this
        reference."""
        if last is None:
            return
        calm = self.steps - self.hurried >= PROBATION
        rows = np.flatnonzero(~current.valid & last.valid & (current.template.frame != last.frame) & calm)
        if len(rows) == 0:
            return
        template = self._template(current.matcher, rows, last.frame, last.warp, last.carried, last.excess)
        guess = current.guess[rows]
        lean = current.neighbours.any(current.valid)[rows]
        guess[lean] = current.neighbours.best(current.warp, current.zncc, current.valid, rows[lean])
        matched = current.attempt(rows, guess, template)
        self.references.renew(matched, current.template.take(matched))
        self.fresh[matched], self.hurried[matched] = np.nan, self.steps
        if len(matched):
            current.propagate()

    def forward(self, current: FrameMatch, frame: int, carried: FloatArray, excess: FloatArray) -> None:
        """Use this frame as the reference of the points that need a new one."""
        # an emergency reference that fails soon must not be used for later searches
        failed = np.flatnonzero(~current.valid & (self.steps - self.hurried < PROBATION))
        self.references.go_back(failed[self.references.level[failed] > 0])
        self.hurried[failed] = -PROBATION
        valid = np.flatnonzero(current.valid)
        new = np.isnan(self.fresh[valid])
        self.fresh[valid[new]] = current.zncc[valid[new]]
        low = np.zeros_like(self.low)
        poor = current.zncc[valid] < np.minimum(self.settings.update_zncc, self.fresh[valid] - DROP)
        low[valid] = poor
        strain = np.log(stretch(relative(current.warp[valid], current.template.warp[valid])))
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
        self.references.renew(
            rows, self._template(current.matcher, rows, frame, current.warp, carried, excess)
        )
        self.fresh[rows], low[rows] = np.nan, False
        self.low = low

    def back(self, current: FrameMatch) -> None:
        """Return points to an earlier reference if they correlate with it again, and match them with it."""
        self.steps += 1
        if self.settings.return_every == 0 or self.steps % self.settings.return_every != 0:
            return
        rows = np.flatnonzero(current.valid & (self.references.level > 0))
        if len(rows) == 0:
            return
        earlier = self.references.template(rows, back=1)
        strain = np.log(stretch(relative(current.warp[rows], earlier.warp)))
        near = strain < JOIN * np.log(self.settings.update_stretch)
        rows, earlier = rows[near], earlier.take(np.flatnonzero(near))
        if len(rows) == 0:
            return
        match = current.matcher.match(current.stack, rows, current.warp[rows], earlier)
        off = np.hypot(*(match.warp[:, :2] - current.warp[rows, :2]).T)
        fits = match.outcome == int(PointOutcome.VALID)
        fits &= match.zncc >= np.minimum(self.settings.update_zncc, current.zncc[rows])
        fits &= off <= self.settings.neighbour_gate
        picked = np.flatnonzero(fits)
        rows = rows[picked]
        current.warp[rows], current.zncc[rows] = match.warp[picked], match.zncc[picked]
        current.covariance[rows] = match.covariance[picked]
        current.template.put(rows, earlier.take(picked))
        self.references.go_back(rows)
        self.fresh[rows], self.low[rows] = np.nan, False


def _compose_points(current: FrameMatch) -> tuple[FloatArray, FloatArray, FloatArray]:
    """`compose` for the tracked points, shapes [n, 2, 2], and the largest excess of the residuals in their
    chains, shape [n]. NaN for the others."""
    total, carried = np.full_like(current.covariance, np.nan), np.full_like(current.covariance, np.nan)
    rows = np.flatnonzero(current.valid)
    template, warp = current.template.take(rows), current.warp[rows]
    beyond = current.matcher.excess(current.zncc[rows], template)
    total[rows], carried[rows] = compose(current.covariance[rows], warp, template, beyond)
    largest = np.full(len(total), np.nan)
    largest[rows] = np.maximum(beyond, template.excess)
    return total, carried, largest


MATERIAL = -1
"""Frame number under which a material picture of another series is stored."""


def track(
    pictures: Series,
    points: FloatArray,
    settings: Tracking | None = None,
    *,
    noise: float | Noise,
    mask: BoolArray | None = None,
    start: FloatArray | None = None,
    start_covariance: FloatArray | None = None,
    material: Picture | None = None,
    first: int = 0,
    frame_outcome: IntArray | None = None,
    device: str = "cpu",
    progress: Callable[[int, int], None] | None = None,
) -> Track:
    """Track points through a series of pictures, which are read one at a time.

    A frame without a usable picture and a point that is not found get an outcome; tracking continues.

    Parameters
    ----------
    pictures
        The series, or an array of shape [n_frames, rows, columns].
    points
        Positions (x, y) in the material picture [px], shape [n_points, 2].
    settings
        Settings of matching and of the changes of reference; None: `Tracking()`.
    noise
        Standard deviation of a grey value [grey], or `dic.correlation.Noise` if it depends on the grey value.
    mask
        Pixels of the material picture that belong to the surface, shape [rows, columns]; None: all.
    start
        Total warps of the points in frame `first`, shape [n_points, 12]; None: no displacement. With
        `material` they are the initial guess; without it they are used unchanged.
    start_covariance
        Covariance of the positions given by `start`, from the match that found them [px²], shape [n_points,
        2, 2].
    material
        The material picture, shape [rows, columns], if it is not a frame of this series (e.g. of another
        camera); None: frame `first` is the first reference.
    first
        Frame in which tracking starts, forward to the end and then back to the beginning.
    frame_outcome
        `dic.FrameOutcome` of the frames from the caller, shape [n_frames]; frames that are not VALID are
        skipped. None: pictures are checked here.
    device
        Device on which the matches are computed.
    progress
        Called with the number of frames done and their total.

    Raises
    ------
    ValueError
        If points, mask, warps or frame numbers do not match the pictures, or there is no picture in frame
        `first`.
    """
    chosen = settings or Tracking()
    points = np.ascontiguousarray(points, dtype=np.float64)
    n = count(pictures)
    _check(points, n, start, start_covariance, material, first, frame_outcome)
    run = _Run(pictures, points, chosen, noise, mask, frame_outcome, device)
    run.begin(first, start, start_covariance, material)
    forward = range(first if material is not None else first + 1, n)
    backward = range(first - 1, -1, -1)
    run.frames.expect([*forward, *backward])
    try:
        for completed, frame in enumerate([*forward, *backward], start=n - len(forward) - len(backward)):
            if frame == first - 1:
                run.turn(first)
            run.step(frame)
            if progress is not None:
                progress(completed + 1, n)
    finally:
        run.frames.close()
    return run.track


def _check(
    points: FloatArray,
    n_frames: int,
    start: FloatArray | None,
    start_covariance: FloatArray | None,
    material: Picture | None,
    first: int,
    frame_outcome: IntArray | None,
) -> None:
    n = len(points)
    if points.ndim != 2 or points.shape[1] != 2 or n == 0 or not np.all(np.isfinite(points)):
        raise ValueError(
            f"points must be finite pixels of shape [n, 2], n at least 1, got shape {points.shape}"
        )
    if not 0 <= first < n_frames:
        raise ValueError(f"first must be a frame from 0 to {n_frames - 1}, got {first}")
    expected = (
        ("start", start, (n, 12)),
        ("start_covariance", start_covariance, (n, 2, 2)),
        ("frame_outcome", frame_outcome, (n_frames,)),
    )
    for name, value, shape in expected:
        if value is not None and np.shape(value) != shape:
            raise ValueError(f"{name} has shape {np.shape(value)}, must be {shape}")
        if value is not None and not np.all(np.isfinite(value)):
            raise ValueError(f"{name} must be finite: leave out the points that have no start")
    if start_covariance is not None and (start is None or material is not None):
        raise ValueError("start_covariance belongs to a start without a material picture")


class _Run:
    """State of a tracking run."""

    def __init__(
        self,
        pictures: Series,
        points: FloatArray,
        settings: Tracking,
        noise: float | Noise,
        mask: BoolArray | None,
        frame_outcome: IntArray | None,
        device: str,
    ) -> None:
        n_frames, n = count(pictures), len(points)
        self.points, self.settings = points, settings
        self.frames = FramesAhead(
            pictures, noise=noise, prefilter=settings.correlation.prefilter, device=device
        )
        self.declared = frame_outcome
        # a growing subset has no template of a fixed size
        templates = Templates.of(n, settings.correlation) if settings.growth == 1.0 else None
        self.references = References(n, templates)
        self.matcher = Matcher(
            points,
            settings.correlation,
            self.references,
            mask,
            noise if isinstance(noise, Noise) else Noise(noise),
        )
        self.neighbours = Neighbours.of(points)
        self.predictor = Predictor(n)
        self.retries, self.ended = RetrySchedule(n), np.full(n, int(PointOutcome.NO_FIRST_GUESS))
        self.scene: Scene
        self.updates = _ReferenceUpdates(self.references, settings)
        self.last: LatestFrame | None = None
        self.frame_outcome = np.full(n_frames, int(FrameOutcome.VALID))
        self.excess = np.full((n_frames, n), np.nan)
        self.track = Track(
            points=points,
            warp=np.full((n_frames, n, 12), np.nan),
            covariance=np.full((n_frames, n, 2, 2), np.nan),
            zncc=np.full((n_frames, n), np.nan),
            outcome=np.full((n_frames, n), int(PointOutcome.NO_PICTURE)),
            reference=np.full((n_frames, n), MATERIAL),
            excess=self.excess,
            frame_outcome=self.frame_outcome,
        )

    def begin(
        self,
        first: int,
        start: FloatArray | None,
        start_covariance: FloatArray | None,
        material: Picture | None,
    ) -> None:
        """Store the first reference. A match with itself shows which of its subsets can be used."""
        n = len(self.points)
        warp = identity(n) if start is None else np.array(start, dtype=np.float64)
        none = np.zeros((n, 2, 2))
        if material is not None:
            material_picture = np.asarray(material)
            self.scene = Scene.of(material_picture)
            self.references.add(MATERIAL, material_picture, self.frames.prepared(MATERIAL, material_picture))
            self.references.start(self._root(MATERIAL, identity(n), none, own=True))
            self.predictor.add(first, np.arange(n), warp)
            return
        picture = self.frames.read(first)
        outcome = FrameOutcome.UNREADABLE if picture is None else Scene.of(picture).judge(picture)
        if picture is None or not outcome.ok:
            raise ValueError(f"frame {first} cannot be the first reference: {outcome.cause}; choose another")
        self.scene = Scene.of(picture)
        stack = self.frames.prepared(first, picture)
        self.references.add(first, picture, stack)
        uncorrelated = start_covariance is None
        self.references.start(self._root(first, warp, none, own=uncorrelated))
        rows = np.arange(n)
        match = self.matcher.match(stack, rows, warp, self.references.template(rows))
        template = 0.5 * match.covariance  # match with itself: the searched picture causes the other half
        if start_covariance is not None:
            before = inherited_covariance(np.asarray(start_covariance), template, warp)
            self.references.start(self._root(first, warp, before, own=uncorrelated))
        else:
            blank = match.outcome != int(PointOutcome.VALID)
            template[blank] = np.nan
            self.track = replace(self.track, root=in_material(template, warp))
        self.predictor.add(first, rows, warp)
        track = self.track
        track.warp[first], track.zncc[first], track.outcome[first] = warp, match.zncc, match.outcome
        track.covariance[first] = none if start_covariance is None else start_covariance
        self.excess[first] = 0.0
        track.reference[first] = first

    def turn(self, first: int) -> None:
        """Restart at frame `first`, to track backward in time."""
        started = np.flatnonzero(self.track.outcome[first] == int(PointOutcome.VALID))
        self.predictor, self.retries = Predictor(len(self.points)), RetrySchedule(len(self.points))
        for frame in range(min(first + 2, len(self.track.warp) - 1), first - 1, -1):
            valid = started[self.track.outcome[frame, started] == int(PointOutcome.VALID)]
            self.predictor.add(frame, valid, self.track.warp[frame, valid])
        self.references.restart()
        self.updates = _ReferenceUpdates(self.references, self.settings)
        self.last = None

    def step(self, frame: int) -> None:
        """Match the points in one frame."""
        picture = self.frames.read(frame)
        if self.declared is not None and self.declared[frame] != int(FrameOutcome.VALID):
            outcome = FrameOutcome(int(self.declared[frame]))
        else:
            outcome = self.scene.judge(picture)
        if picture is None or not outcome.ok:
            self.frame_outcome[frame] = int(outcome)
            return
        stack = self.frames.prepared(frame, picture)
        self.references.add(frame, picture, stack)
        current = FrameMatch.begin(
            picture,
            stack,
            self.matcher,
            self.neighbours,
            self.settings,
            self.predictor.predict(frame),
            self.predictor.known > 0,
            self.retries.skipped,
            self.ended,
        )
        self.updates.match_last_frame(current, self.last)
        self.updates.back(current)
        covariance, carried, excess = _compose_points(current)
        self._record(frame, current, covariance, excess)
        self.ended = current.outcome
        self.retries.add(current.valid, self.neighbours)
        self.updates.forward(current, frame, carried, excess)
        valid = np.flatnonzero(current.valid)
        self.predictor.add(frame, valid, current.warp[valid])
        self.last = LatestFrame(frame, current.warp, carried, current.valid, excess)
        self.references.tidy(keep=frame)

    def _root(self, frame: int, warp: FloatArray, before: FloatArray, *, own: bool) -> Template:
        """The first reference of all points. ``own``: whether the noise of its template is part of their
        sigma."""
        n = len(self.points)
        subset = np.full(n, self.settings.correlation.subset)
        root = self.matcher.template(np.arange(n), frame, warp, before, subset, np.zeros(n))
        return replace(root, root=np.full(n, own))

    def _record(self, frame: int, current: FrameMatch, covariance: FloatArray, excess: FloatArray) -> None:
        track = self.track
        self.excess[frame] = excess
        track.warp[frame], track.covariance[frame] = current.warp, covariance
        track.zncc[frame], track.outcome[frame] = current.zncc, current.outcome
        track.reference[frame] = current.template.frame
        if not np.any(current.valid):
            self.frame_outcome[frame] = int(FrameOutcome.LOST)


__all__ = ["Track", "Tracking", "track"]
