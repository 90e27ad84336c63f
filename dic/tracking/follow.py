"""Follow points through the frames of one camera."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.correlation import Noise, Templates
from dic.correlation.warp import identity
from dic.outcome import FrameOutcome, PointOutcome
from dic.tracking.ahead import FramesAhead
from dic.tracking.frame_match import FrameMatch
from dic.tracking.frames import Picture, Scene, Series, count
from dic.tracking.history import Track
from dic.tracking.initial_guesses import Predictor
from dic.tracking.matcher import Matcher, carried_from, in_material
from dic.tracking.neighbours import Neighbours, RetrySchedule
from dic.tracking.references import References, Template
from dic.tracking.settings import Tracking
from dic.tracking.update import Last, ReferenceUpdates, composed

MATERIAL = -1
"""Frame number under which a material picture of another series is kept."""


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
    """Follow points through a series of pictures, read one at a time.

    A frame without a usable picture and a point that is not found are outcomes; the rest goes on.

    Parameters
    ----------
    pictures
        The series; an array of shape [n_frames, rows, columns] will do.
    points
        Places (x, y) in the material picture [px], shape [n_points, 2].
    settings
        How to match and when to change references; None: `Tracking()`.
    noise
        Standard deviation of a grey value, or `dic.correlation.Noise` where it grows with it [grey].
    mask
        Pixels of the material picture that belong to the surface, shape [rows, columns]; None: all.
    start
        Total warps of the points in frame `first`, shape [n_points, 12]; None: they have not moved. Without
        `material` they are taken as they are, with it as the first guess.
    start_covariance
        Of the places that `start` gives, as the match that found them tells [px²], shape [n_points, 2, 2].
    material
        The material picture, shape [rows, columns], if it is not a frame of this series (of another camera,
        say); None: frame `first` is the first reference.
    first
        Frame from which the points are followed, forward to the end and then back to the beginning.
    frame_outcome
        `dic.FrameOutcome` of the frames where the caller knows better, shape [n_frames]; frames that are not
        VALID there are skipped.
    device
        Where the matches are computed.
    progress
        Called with the frames done and their number.

    Raises
    ------
    ValueError
        Points, mask, warps or frame numbers that do not fit the pictures; no picture in frame `first`.
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
        for done, frame in enumerate([*forward, *backward], start=n - len(forward) - len(backward)):
            if frame == first - 1:
                run.turn(first)
            run.step(frame)
            if progress is not None:
                progress(done + 1, n)
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
    wanted = (
        ("start", start, (n, 12)),
        ("start_covariance", start_covariance, (n, 2, 2)),
        ("frame_outcome", frame_outcome, (n_frames,)),
    )
    for name, value, shape in wanted:
        if value is not None and np.shape(value) != shape:
            raise ValueError(f"{name} has shape {np.shape(value)}, must be {shape}")
        if value is not None and not np.all(np.isfinite(value)):
            raise ValueError(f"{name} must be finite: leave out the points that have no start")
    if start_covariance is not None and (start is None or material is not None):
        raise ValueError("start_covariance belongs to a start without a material picture")


class _Run:
    """A tracking under way."""

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
        # a subset that grows has no template of one size
        kept = Templates.of(n, settings.correlation) if settings.growth == 1.0 else None
        self.references = References(n, kept)
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
        self.updates = ReferenceUpdates(self.references, settings)
        self.last: Last | None = None
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
        """Take in the first reference, and match it with itself to learn which of its subsets are of use."""
        n = len(self.points)
        warp = identity(n) if start is None else np.array(start, dtype=np.float64)
        none = np.zeros((n, 2, 2))
        if material is not None:
            other = np.asarray(material)
            self.scene = Scene.of(other)
            self.references.add(MATERIAL, other, self.frames.prepared(MATERIAL, other))
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
        own = start_covariance is None
        self.references.start(self._root(first, warp, none, own=own))
        rows = np.arange(n)
        match = self.matcher.match(stack, rows, warp, self.references.template(rows))
        template = 0.5 * match.covariance  # of a picture with itself: the other half is that searched in
        if start_covariance is not None:
            before = carried_from(np.asarray(start_covariance), template, warp)
            self.references.start(self._root(first, warp, before, own=own))
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
        """Start again at frame `first`, to go back in time."""
        found = np.flatnonzero(self.track.outcome[first] == int(PointOutcome.VALID))
        self.predictor, self.retries = Predictor(len(self.points)), RetrySchedule(len(self.points))
        for frame in range(min(first + 2, len(self.track.warp) - 1), first - 1, -1):
            valid = found[self.track.outcome[frame, found] == int(PointOutcome.VALID)]
            self.predictor.add(frame, valid, self.track.warp[frame, valid])
        self.references.restart()
        self.updates = ReferenceUpdates(self.references, self.settings)
        self.last = None

    def step(self, frame: int) -> None:
        """Find the points in one frame."""
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
        here = FrameMatch.begin(
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
        self.updates.match_last_frame(here, self.last)
        self.updates.back(here)
        covariance, carried, excess = composed(here)
        self._record(frame, here, covariance, excess)
        self.ended = here.outcome
        self.retries.add(here.valid, self.neighbours)
        self.updates.forward(here, frame, carried, excess)
        found = np.flatnonzero(here.valid)
        self.predictor.add(frame, found, here.warp[found])
        self.last = Last(frame, here.warp, carried, here.valid, excess)
        self.references.tidy(keep=frame)

    def _root(self, frame: int, warp: FloatArray, before: FloatArray, *, own: bool) -> Template:
        """The first reference of all points; `own` if the noise of its template is part of their sigma."""
        n = len(self.points)
        subset = np.full(n, self.settings.correlation.subset)
        root = self.matcher.template(np.arange(n), frame, warp, before, subset, np.zeros(n))
        return replace(root, root=np.full(n, own))

    def _record(self, frame: int, here: FrameMatch, covariance: FloatArray, excess: FloatArray) -> None:
        track = self.track
        self.excess[frame] = excess
        track.warp[frame], track.covariance[frame] = here.warp, covariance
        track.zncc[frame], track.outcome[frame] = here.zncc, here.outcome
        track.reference[frame] = here.template.frame
        if not np.any(here.valid):
            self.frame_outcome[frame] = int(FrameOutcome.LOST)
