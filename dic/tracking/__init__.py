"""Tracking of points through the frames of one camera, with updates of the reference pictures.

A point gets a later reference when the correlation with its reference is too low. It returns to an earlier
reference when it correlates with this one again.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from dic.basics import BoolArray, FloatArray, IntArray
from dic.correlation import Noise, PictureStack, Templates
from dic.correlation.subsets import identity
from dic.images import Pictures
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
MATERIAL = -1
"""Frame number under which a material picture of another series is stored."""
PROBATION = 5
"""Smallest number of frames between two emergency references of a point."""


@dataclass(frozen=True)
class LatestFrame:
    """The latest frame of each camera with a picture, as an emergency reference for lost points."""

    frame: IntArray
    """Number of the frame as a reference of each point, shape [n]."""
    warp: FloatArray
    """Total warps, shape [n, 12]."""
    carried: FloatArray
    """Covariance of a chain of references through this frame [px²], shape [n, 2, 2]."""
    valid: BoolArray
    """Points found in this frame, shape [n]."""
    excess: FloatArray
    """Largest excess of the residuals in the chain that ends in this frame [-], shape [n]."""

    @classmethod
    def none(cls, n: int) -> "LatestFrame":
        """No frame."""
        lost = np.full((n, 16), np.nan)
        return cls(
            np.full(n, MATERIAL), lost[:, :12], lost[:, 12:].reshape(n, 2, 2), np.zeros(n, bool), lost[:, 0]
        )

    def updated(self, latest: "LatestFrame", seen: BoolArray) -> "LatestFrame":
        """A later frame where a camera has a picture (`seen`, shape [n])."""
        if seen.all():
            return latest
        values = {name: np.array(value) for name, value in vars(self).items()}
        for name, value in values.items():
            value[seen] = getattr(latest, name)[seen]
        return LatestFrame(**values)


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
    """Decides when the references of n points change. ``parts``: the points of each camera."""

    def __init__(self, references: References, settings: Tracking, parts: Sequence[slice]) -> None:
        n = len(references.level)
        self.references, self.settings, self.parts = references, settings, parts
        self.low = np.zeros(n, dtype=bool)
        """Points whose correlation was poor in the previous frame, shape [n]."""
        self.fresh = np.full(n, np.nan)
        """Correlation in the first frame after the reference was taken, shape [n]."""
        self.hurried = np.full(n, -PROBATION)
        """Value of `steps` at the last emergency change of reference, shape [n]."""
        self.steps = np.zeros(n, dtype=np.int64)
        """Number of frames with a picture, shape [n]."""

    def _template(
        self,
        matcher: Matcher,
        rows: IntArray,
        frame: IntArray,
        warp: FloatArray,
        carried: FloatArray,
        excess: FloatArray,
    ) -> Template:
        """Make frames the references of points `rows`. Frames, warps, covariances and excess are those of all
        points."""
        subset = enlarged_subset(self.settings.correlation.subset, warp[rows], self.settings.growth)
        return matcher.template(rows, frame[rows], warp[rows], carried[rows], subset, excess[rows])

    def match_last_frame(self, current: FrameMatch, last: LatestFrame, seen: BoolArray) -> None:
        """Match lost points with the previous frame as reference. Points that are found in this way keep this
        reference. ``seen``: points with a picture, shape [n]."""
        open_ = seen & last.valid & (self.steps - self.hurried >= PROBATION)
        rows = np.flatnonzero(open_ & ~current.valid & (current.template.frame != last.frame))
        if len(rows) == 0:
            return
        template = self._template(current.matcher, rows, last.frame, last.warp, last.carried, last.excess)
        guess = current.guess[rows]
        lean = current.neighbours.any(current.valid)[rows]
        guess[lean] = current.neighbours.best(current.warp, current.zncc, current.valid, rows[lean])
        matched = current.attempt(rows, guess, template)
        self.references.renew(matched, current.template.take(matched))
        self.fresh[matched], self.hurried[matched] = np.nan, self.steps[matched]
        if len(matched):
            current.propagate(matched)

    def forward(
        self, current: FrameMatch, frame: IntArray, carried: FloatArray, excess: FloatArray, seen: BoolArray
    ) -> None:
        """Use this frame as the reference of the points that need a new one. ``frame``: its numbers as a
        reference, ``seen``: points with a picture, shape [n] each."""
        # an emergency reference that fails soon must not be used for later searches
        failed = np.flatnonzero(seen & ~current.valid & (self.steps - self.hurried < PROBATION))
        self.references.go_back(failed[self.references.level[failed] > 0])
        self.hurried[failed] = -PROBATION
        valid = np.flatnonzero(current.valid)
        new = np.isnan(self.fresh[valid])
        self.fresh[valid[new]] = current.zncc[valid[new]]
        low = self.low & ~seen
        poor = current.zncc[valid] < np.minimum(self.settings.update_zncc, self.fresh[valid] - DROP)
        low[valid] = poor
        strain = np.log(stretch(relative(current.warp[valid], current.template.warp[valid])))
        limit = np.log(self.settings.update_stretch)
        asks = (strain > limit) | (poor & self.low[valid])
        for part in self.parts:
            of = slice(*np.searchsorted(valid, (part.start, part.stop)))
            if np.sum(asks[of]) < QUORUM * len(asks[of]):
                asks[of] = strain[of] > URGENT * limit
            if np.any(asks[of]):
                asks[of] |= strain[of] > JOIN * limit
        rows = valid[asks]
        if len(rows) == 0:
            self.low = low
            return
        self.references.renew(
            rows, self._template(current.matcher, rows, frame, current.warp, carried, excess)
        )
        self.fresh[rows], low[rows] = np.nan, False
        self.low = low

    def back(self, current: FrameMatch, seen: BoolArray) -> None:
        """Return points to an earlier reference if they correlate with it again, and match them with it.
        ``seen``: points with a picture, shape [n]."""
        self.steps += seen
        if self.settings.return_every == 0:
            return
        due = self.steps % self.settings.return_every == 0
        rows = np.flatnonzero(current.valid & due & (self.references.level > 0))
        if len(rows) == 0:
            return
        earlier = self.references.template(rows, back=1)
        strain = np.log(stretch(relative(current.warp[rows], earlier.warp)))
        near = strain < JOIN * np.log(self.settings.update_stretch)
        rows, earlier = rows[near], earlier.take(np.flatnonzero(near))
        if len(rows) == 0:
            return
        match = current.matcher.match(current.stack, current.searched, rows, current.warp[rows], earlier)
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
    beyond = current.matcher.excess(rows, current.zncc[rows], template)
    total[rows], carried[rows] = compose(current.covariance[rows], warp, template, beyond)
    largest = np.full(len(total), np.nan)
    largest[rows] = np.maximum(beyond, template.excess)
    return total, carried, largest


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
    view = View(pictures, points, noise, start, start_covariance, frame_outcome)
    return track_together(
        [view], settings, mask=mask, material=material, first=first, device=device, progress=progress
    )[0]


@dataclass(frozen=True)
class View:
    """Points of one camera, with the arguments of `track` of the same names."""

    pictures: Series
    points: FloatArray
    noise: float | Noise
    start: FloatArray | None = None
    start_covariance: FloatArray | None = None
    frame_outcome: IntArray | None = None

    @property
    def size(self) -> tuple[int, ...]:
        """Number of frames, and shape of the pictures if all have one shape."""
        pictures = self.pictures
        shape = pictures.shape if isinstance(pictures, Pictures) else np.shape(pictures[0])
        return (count(pictures), *shape)


def track_together(
    views: Sequence[View],
    settings: Tracking | None = None,
    *,
    mask: BoolArray | None = None,
    material: Picture | None = None,
    first: int = 0,
    device: str = "cpu",
    progress: Callable[[int, int], None] | None = None,
) -> list[Track]:
    """Track the points of several cameras frame by frame, with the results of `track`.

    The points of all cameras are matched in one launch if the pictures have one size. ``mask``, ``material``:
    as for `track`; a material picture only with one view.
    """
    chosen = settings or Tracking()
    if len(views) > 1 and len({view.size for view in views}) > 1:
        alone = partial(track_together, settings=chosen, mask=mask, first=first, device=device)
        return [alone([view], progress=progress)[0] for view in views]
    views = [replace(view, points=np.ascontiguousarray(view.points, dtype=np.float64)) for view in views]
    for view in views:
        _check(view, material, first)
    run = _Run(views, chosen, mask, device)
    run.begin(first, material)
    n = run.n_frames
    forward = range(first if material is not None else first + 1, n)
    backward = range(first - 1, -1, -1)
    for frames in run.frames:
        frames.expect([*forward, *backward])
    try:
        for completed, frame in enumerate([*forward, *backward], start=n - len(forward) - len(backward)):
            if frame == first - 1:
                run.turn(first)
            run.step(frame)
            if progress is not None:
                progress(completed + 1, n)
    finally:
        for frames in run.frames:
            frames.close()
    return run.tracks


def _check(view: View, material: Picture | None, first: int) -> None:
    points, n, n_frames = view.points, len(view.points), count(view.pictures)
    if points.ndim != 2 or points.shape[1] != 2 or n == 0 or not np.all(np.isfinite(points)):
        raise ValueError(
            f"points must be finite pixels of shape [n, 2], n at least 1, got shape {points.shape}"
        )
    if not 0 <= first < n_frames:
        raise ValueError(f"first must be a frame from 0 to {n_frames - 1}, got {first}")
    expected = {"start": (n, 12), "start_covariance": (n, 2, 2), "frame_outcome": (n_frames,)}
    for name, shape in expected.items():
        value = getattr(view, name)
        if value is not None and np.shape(value) != shape:
            raise ValueError(f"{name} has shape {np.shape(value)}, must be {shape}")
        if value is not None and not np.all(np.isfinite(value)):
            raise ValueError(f"{name} must be finite: leave out the points that have no start")
    if view.start_covariance is not None and (view.start is None or material is not None):
        raise ValueError("start_covariance belongs to a start without a material picture")


class _Run:
    """State of a tracking run.

    The points of all views are numbered one view after the other. Frame f of view c has the number c n_frames
    + f as a reference.
    """

    def __init__(
        self, views: Sequence[View], settings: Tracking, mask: BoolArray | None, device: str
    ) -> None:
        sizes, prefilter = [len(view.points) for view in views], settings.correlation.prefilter
        ends = np.cumsum([0, *sizes]).tolist()
        self.n_frames, n = count(views[0].pictures), ends[-1]
        self.views, self.settings = views, settings
        self.parts = [slice(*ends[c : c + 2]) for c in range(len(views))]
        self.camera = np.repeat(np.arange(len(views)), sizes)
        noises = tuple(view.noise if isinstance(view.noise, Noise) else Noise(view.noise) for view in views)
        self.frames = [
            FramesAhead(view.pictures, noise=noise, prefilter=prefilter, device=device)
            for view, noise in zip(views, noises, strict=True)
        ]
        # a growing subset has no template of a fixed size
        templates = Templates.of(n, settings.correlation) if settings.growth == 1.0 else None
        self.references = References(n, templates)
        points = np.concatenate([view.points for view in views])
        self.matcher = Matcher(points, settings.correlation, self.references, mask, noises, self.camera)
        self.neighbours = Neighbours.joined([Neighbours.of(view.points) for view in views])
        self.predictors = [Predictor(size) for size in sizes]
        self.retries, self.ended = RetrySchedule(n), np.full(n, int(PointOutcome.NO_FIRST_GUESS))
        self.scenes: list[Scene] = []
        self.updates = _ReferenceUpdates(self.references, settings, self.parts)
        self.last = LatestFrame.none(n)
        self.frame_outcome = np.full((len(views), self.n_frames), int(FrameOutcome.VALID))
        self.excess = [np.full((self.n_frames, size), np.nan) for size in sizes]
        self.tracks = [
            replace(Track.empty(view.points, MATERIAL, outcome), excess=excess)
            for view, outcome, excess in zip(views, self.frame_outcome, self.excess, strict=True)
        ]

    def begin(self, first: int, material: Picture | None) -> None:
        """Store the first references. A match with itself shows which subsets can be used."""
        n = len(self.camera)
        warp = np.concatenate(
            [identity(len(v.points)) if v.start is None else np.asarray(v.start, float) for v in self.views]
        )
        none = np.zeros((n, 2, 2))
        if material is not None:
            picture = np.asarray(material)
            self.scenes = [Scene.of(picture)]
            self.references.add(MATERIAL, picture, self.frames[0].prepared(MATERIAL, picture))
            self.references.start(self._root(np.full(n, MATERIAL), identity(n), none, np.ones(n, bool)))
            self.predictors[0].add(first, np.arange(n), warp)
            return
        stacks = []
        for camera, frames in enumerate(self.frames):
            found = frames.read(first)
            outcome = FrameOutcome.UNREADABLE if found is None else Scene.of(found).judge(found)
            if found is None or not outcome.ok:
                raise ValueError(
                    f"frame {first} cannot be the first reference: {outcome.cause}; choose another"
                )
            self.scenes.append(Scene.of(found))
            stacks.append(frames.prepared(first, found))
            self.references.add(self._key(camera, first), found, stacks[-1])
        rows, keys = np.arange(n), self.camera * self.n_frames + first
        own = np.array([view.start_covariance is None for view in self.views])[self.camera]
        self.references.start(self._root(keys, warp, none, own))
        match = self.matcher.match(
            PictureStack.join(stacks), np.arange(len(stacks)), rows, warp, self.references.template(rows)
        )
        template = 0.5 * match.covariance  # match with itself: the searched picture causes the other half
        before = none.copy()
        for view, part in zip(self.views, self.parts, strict=True):
            if view.start_covariance is not None:
                start = np.asarray(view.start_covariance)
                before[part] = inherited_covariance(start, template[part], warp[part])
        self.references.start(self._root(keys, warp, before, own))
        template[match.outcome != int(PointOutcome.VALID)] = np.nan
        for c, (view, part) in enumerate(zip(self.views, self.parts, strict=True)):
            if view.start_covariance is None:
                self.tracks[c] = replace(self.tracks[c], root=in_material(template[part], warp[part]))
            self.predictors[c].add(first, np.arange(len(view.points)), warp[part])
            covariance = none[part] if view.start_covariance is None else view.start_covariance
            track = self.tracks[c]
            track.warp[first], track.covariance[first] = warp[part], covariance
            track.zncc[first], track.outcome[first] = match.zncc[part], match.outcome[part]
            track.reference[first], self.excess[c][first] = first, 0.0

    def _key(self, camera: int, frame: int) -> int:
        """Number of a frame of a view as a reference."""
        return camera * self.n_frames + frame

    def turn(self, first: int) -> None:
        """Restart at frame `first`, to track backward in time."""
        for c, track in enumerate(self.tracks):
            started = np.flatnonzero(track.outcome[first] == int(PointOutcome.VALID))
            self.predictors[c] = Predictor(len(track.points))
            for frame in range(min(first + 2, self.n_frames - 1), first - 1, -1):
                valid = started[track.outcome[frame, started] == int(PointOutcome.VALID)]
                self.predictors[c].add(frame, valid, track.warp[frame, valid])
        self.retries, self.last = RetrySchedule(len(self.camera)), LatestFrame.none(len(self.camera))
        self.references.restart()
        self.updates = _ReferenceUpdates(self.references, self.settings, self.parts)

    def step(self, frame: int) -> None:
        """Match the points in one frame of all views."""
        pictures: dict[int, Picture] = {}
        stacks: list[PictureStack] = []
        searched = np.full(len(self.views), -1)
        guess, predicted = np.zeros((len(self.camera), 12)), np.zeros(len(self.camera), dtype=bool)
        for camera, (view, frames, part) in enumerate(zip(self.views, self.frames, self.parts, strict=True)):
            picture, declared = frames.read(frame), view.frame_outcome
            if declared is not None and declared[frame] != int(FrameOutcome.VALID):
                outcome = FrameOutcome(int(declared[frame]))
            else:
                outcome = self.scenes[camera].judge(picture)
            if picture is None or not outcome.ok:
                self.frame_outcome[camera, frame] = int(outcome)
                continue
            searched[camera] = len(stacks)
            stacks.append(frames.prepared(frame, picture))
            pictures[camera] = picture
            self.references.add(self._key(camera, frame), picture, stacks[-1])
            predictor = self.predictors[camera]
            guess[part], predicted[part] = predictor.predict(frame), predictor.known > 0
        if not stacks:
            return
        current = FrameMatch.begin(
            pictures, PictureStack.join(stacks), searched, self.matcher, self.neighbours, self.settings,
            guess, predicted, self.retries.skipped, self.ended,
        )  # fmt: skip
        seen, keys = searched[self.camera] >= 0, self.camera * self.n_frames + frame
        self.updates.match_last_frame(current, self.last, seen)
        self.updates.back(current, seen)
        covariance, carried, excess = _compose_points(current)
        self.ended = np.where(seen, current.outcome, self.ended)
        self.retries.add(current.valid, seen, self.neighbours)
        self.updates.forward(current, keys, carried, excess, seen)
        for camera in pictures:
            part, track = self.parts[camera], self.tracks[camera]
            track.warp[frame], track.covariance[frame] = current.warp[part], covariance[part]
            track.zncc[frame], track.outcome[frame] = current.zncc[part], current.outcome[part]
            track.reference[frame] = current.template.frame[part] - self._key(camera, 0)
            self.excess[camera][frame] = excess[part]
            valid = np.flatnonzero(track.outcome[frame] == int(PointOutcome.VALID))
            if not len(valid):
                self.frame_outcome[camera, frame] = int(FrameOutcome.LOST)
            self.predictors[camera].add(frame, valid, track.warp[frame, valid])
        self.last = self.last.updated(LatestFrame(keys, current.warp, carried, current.valid, excess), seen)
        self.references.tidy(keep=set(self.last.frame.tolist()))

    def _root(self, frame: IntArray, warp: FloatArray, before: FloatArray, own: BoolArray) -> Template:
        """The first references of all points. ``own``: whether the noise of the templates is part of their
        sigma."""
        n = len(warp)
        subset = np.full(n, self.settings.correlation.subset)
        root = self.matcher.template(np.arange(n), frame, warp, before, subset, np.zeros(n))
        return replace(root, root=own)


__all__ = ["Track", "Tracking", "View", "track", "track_together"]
