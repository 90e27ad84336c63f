"""Tracking of bodies by two cameras: points matched between them, tracked in each, reconstructed.

The two cameras of a body that deforms are tracked together, frame by frame. Other bodies are tracked in
parallel, if possible in another process. A forked process cannot use a GPU. It uses the CPU.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter

from dic.basics import BoolArray, FloatArray, IntArray
from dic.bodies.region import Region, grid_points, polygon_mask
from dic.camera import StereoRig
from dic.correlation import Correlation, Noise
from dic.correlation.subsets import identity
from dic.images import Pictures
from dic.outcome import FrameOutcome, PointOutcome
from dic.processes import background, may_fork
from dic.stereo.match import StereoMatch, match_stereo
from dic.stereo.reconstruction import Reconstruction, reconstruct
from dic.tracking import Track, Tracking, View, track_together
from dic.tracking.matcher import in_material, shares
from dic.tracking.rigid import track_rigid

EXACT = 1e-8
"""Variance of a point in the picture in which it was chosen [px²]: only rounding."""

STRIP = 0.75
"""Both pictures must show this share of the part of a subset that lies inside a strip."""


@dataclass(frozen=True)
class MatchedBody:
    """Points of a body in the material pictures of both cameras, and the settings of their tracking."""

    pictures: tuple[Pictures, Pictures]
    """The series of camera 0 and camera 1."""
    points: FloatArray
    """Positions (x, y) in the material picture [px], shape [n_points, 2]."""
    cell: IntArray
    """Column and row of each point in the grid, shape [n_points, 2]."""
    mask: BoolArray
    """Pixels of the body in the material picture, shape [rows, columns]."""
    material: int
    """Frame of the material picture."""
    match: StereoMatch
    """The match between the cameras in that frame."""
    tracking: Tracking
    """Settings of the tracking in time."""
    noise: tuple[Noise, Noise]
    """Noise of the grey values of both cameras."""
    health: tuple[IntArray, IntArray]
    """`FrameOutcome` of the pictures of the cameras, each of shape [n_frames]."""
    rigid: bool
    """True for a body that only translates."""
    device: str
    """Device on which pictures are correlated."""
    name: str
    """Name of the stages in progress reports."""

    @property
    def size(self) -> int:
        """Points times frames, the size of a track."""
        return len(self.points) * len(self.health[0])


def match_body(
    pictures: tuple[Pictures, Pictures],
    rig: StereoRig,
    region: Region,
    *,
    step: int,
    margin: float,
    tracking: Tracking,
    stereo: Correlation,
    noise: tuple[Noise, Noise],
    health: tuple[IntArray, IntArray],
    mask: BoolArray | None = None,
    rigid: bool = False,
    device: str = "cpu",
    name: str = "specimen",
) -> MatchedBody:
    """Choose the points of a region and match them between the cameras.

    ``pictures``: the series of camera 0 and camera 1. ``region``: region of the body. If a camera has no
    usable picture at its frame, the nearest frame with usable pictures is used. ``step``: distance of the
    points [px]. ``margin``: smallest distance of a point from the region's boundary [px]. ``health``:
    `FrameOutcome` of the pictures of the cameras, each of shape [n_frames]. ``mask``: pixels of the body in
    the region's picture, shape [rows, columns]; None: those within its corners. ``rigid``: True for a body
    that only translates. ``name``: name of the stages in progress reports of `follow_bodies`. Raises
    ValueError if the region is outside the picture, or if both cameras saw no common frame.
    """
    material = material_frame(health, region.frame)
    if mask is None:
        mask = polygon_mask(region.corners, pictures[0].shape)
    points, cell = grid_points(mask, step, margin=margin)
    if rigid:
        stereo = replace(stereo, least_pixels=least_in_strip(mask, points, stereo))
    first, second = (series.frame(material) for series in pictures)
    match = match_stereo(first, second, points, rig, stereo, noise=noise, mask=mask, device=device)
    return MatchedBody(
        pictures, points, cell, mask, material, match, tracking, noise, health, rigid, device, name
    )


def least_in_strip(mask: BoolArray, points: FloatArray, settings: Correlation) -> float:
    """Share of a subset that pictures must show if only a strip of the body is in view.

    A subset that is wider than the strip extends past it on both sides. The strip then contains little more
    than `Correlation.least_pixels` of its area. No margin would remain for pixels that the other camera does
    not see.
    """
    share = uniform_filter(mask.astype(np.float64), size=settings.subset, mode="constant")
    x, y = np.round(points).astype(int).T
    return min(settings.least_pixels, STRIP * float(share[y, x].max()))


def track_body(body: MatchedBody, progress: Callable[[int, int], None] | None = None) -> tuple[Track, Track]:
    """Track a body's points in both cameras. In camera 1 only the matched points are tracked."""
    points, match, tracking = body.points, body.match, body.tracking
    views = [View(body.pictures[0], points, body.noise[0], frame_outcome=body.health[0])]
    if match.valid.any():
        start, covariance = match.warp[match.valid], match.covariance[match.valid]
        views.append(
            View(body.pictures[1], points[match.valid], body.noise[1], start, covariance, body.health[1])
        )
    options: dict[str, Any] = {"mask": body.mask, "first": body.material, "device": body.device}
    if body.rigid:
        reports = [progress, None][: len(views)]
        tracks = [
            track_rigid(settings=tracking.correlation, progress=report, **vars(view), **options)
            for view, report in zip(views, reports, strict=True)
        ]
    else:
        tracks = track_together(views, tracking, progress=progress, **options)
    for one in tracks:
        variances = np.einsum("...ii->...i", one.covariance)
        variances += EXACT
    if len(tracks) == 1:
        tracks.append(Track.empty(points[:0], body.material, body.health[1]))
    first, second = tracks
    fields = dict(vars(second))
    del tracks, second  # each array can be freed after it is expanded
    return first, _all_points(fields, points, match)


def material_frame(health: tuple[IntArray, IntArray], preferred: int) -> int:
    """Frame nearest to the preferred one with a usable picture of both cameras; the earlier of two.

    ``health``: `FrameOutcome` of the pictures of the cameras, each of shape [n_frames]. ``preferred``: the
    frame in which the region is declared. Raises ValueError if no frame has a usable picture of both cameras.
    """
    usable = np.flatnonzero((health[0] == FrameOutcome.VALID) & (health[1] == FrameOutcome.VALID))
    if not usable.size:
        raise ValueError("no frame has a usable picture of both cameras")
    return int(usable[np.argmin(np.abs(usable - preferred))])


def _all_points(fields: dict[str, Any], points: FloatArray, match: StereoMatch) -> Track:
    """The track of the matched points with rows for the other points. Those rows have the outcome of the
    match."""
    valid, n_frames, n = match.valid, len(fields["warp"]), len(points)
    for name in ("warp", "covariance", "zncc", "excess", "reference"):
        if fields[name] is None or valid.all():
            continue
        narrow = fields.pop(name)
        wide = np.full((n_frames, n, *narrow.shape[2:]), -1 if name == "reference" else np.nan)
        wide[:, valid] = narrow
        fields[name] = wide
    outcome = np.array(np.broadcast_to(match.outcome, (n_frames, n)))
    outcome[:, valid] = fields["outcome"]
    if fields["frame_outcome"] is not None:
        outcome[fields["frame_outcome"] != FrameOutcome.VALID] = int(PointOutcome.NO_PICTURE)
    return Track(**{**fields, "points": points, "outcome": outcome})


Progress = Callable[[str, int, int], None]
"""Called as ``progress(stage, done, total)``."""

MOST_SENT = 400_000
"""Largest number of points times frames for tracks in a forked process, which sends back about
180 MB. Larger tracks are computed in threads: with more points per match, threads block each other less."""


@dataclass(frozen=True)
class TrackedBody:
    """One body through all frames of both cameras."""

    points: FloatArray
    """Positions (x, y) in the material picture [px], shape [n_points, 2]."""
    cell: IntArray
    """Column and row of each point in the grid, shape [n_points, 2]."""
    mask: BoolArray
    """Pixels of the body in the material picture, shape [rows, columns]."""
    material: int
    """Frame of the material picture."""
    stereo: StereoMatch
    """The match between the cameras in that frame."""
    tracks: tuple[Track, Track]
    """Both cameras' tracks of all points. A point without a stereo match has the outcome of the match in
    camera 1."""
    reconstruction: Reconstruction
    """Positions in the rig's frame."""
    common: FloatArray | None
    """Noise that both tracks share (`dic.reconstruct`) [px²], shape [n_frames, n_points, 2, 2]. None for a
    rigid body."""


def follow_bodies(
    bodies: Sequence[MatchedBody], rig: StereoRig, stereo: Correlation, *, progress: Progress | None = None
) -> list[TrackedBody]:
    """Track matched bodies in both cameras, the first in parallel with the others.

    ``progress``: called with the number of finished frames of the first body. For other bodies it is called
    once, at the end.
    """
    report = progress or (lambda stage, done, total: None)
    first, *others = bodies
    forked = may_fork() and 0 < sum(body.size for body in others) <= MOST_SENT
    placed = [replace(body, device="cpu") if forked else body for body in others]
    with background(lambda: [_follow(body, rig, stereo) for body in placed], fork=forked) as followed:
        result = [_follow(first, rig, stereo, partial(report, first.name)), *followed()]
    for body in others:
        report(body.name, len(body.health[1]), len(body.health[1]))
    return result


def _follow(
    body: MatchedBody, rig: StereoRig, stereo: Correlation, progress: Callable[[int, int], None] | None = None
) -> TrackedBody:
    """The body with its points tracked and reconstructed in space."""
    tracks, common = track_body(body, progress), None
    if not body.rigid:
        lower = tracks[0].root if body.tracking.correlation.shape <= stereo.shape else None
        common = _common(body.match, lower, len(body.health[0]))
    return TrackedBody(
        points=body.points,
        cell=body.cell,
        mask=body.mask,
        material=body.material,
        stereo=body.match,
        tracks=tracks,
        reconstruction=reconstruct(rig, *tracks, common=common),
        common=common,
    )


def _common(match: StereoMatch, root: FloatArray | None, n_frames: int) -> FloatArray:
    """Noise of the material picture's template [px²], shape [n_frames, n_points, 2, 2]. Both cameras' tracks
    start from this template. The noise is equal in all frames and stored once. In the material picture camera
    0 has no noise, and `reconstruct` limits the common part accordingly.

    If the shape functions differ, the common part is the error of the lower order. It is that of camera 0's
    track (`root`) or of the match between the cameras (None).
    """
    valid = match.valid
    common = np.zeros((len(valid), 2, 2))
    if root is not None:
        finite = valid & np.isfinite(root).all(axis=(1, 2))
        common[finite] = root[finite]
    else:
        share = shares(match.warp[valid], identity(int(valid.sum())))[0][:, None, None]
        common[valid] = in_material(share * match.covariance[valid], match.warp[valid])
    return np.broadcast_to(common, (n_frames, *common.shape))
