"""Points of one body in one camera's series: matched between the cameras, then followed there."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.bodies.region import Region, grid_points, polygon_mask
from dic.camera import StereoRig
from dic.correlation import Correlation, Noise
from dic.images import Pictures
from dic.outcome import FrameOutcome, PointOutcome
from dic.stereo import StereoMatch, match_stereo
from dic.tracking import Track, Tracking, track
from dic.tracking.rigid import track_rigid

EXACT = 1e-8
"""Variance of a point in the picture it was chosen in [px²]: none but that of its rounding."""

STRIP = 0.75
"""Share of what a strip holds of a subset that both pictures must show."""


@dataclass(frozen=True)
class MatchedBody:
    """Points of a body in the material pictures of both cameras, and how they are to be followed."""

    pictures: tuple[Pictures, Pictures]
    """The series of camera 0 and camera 1."""
    points: FloatArray
    """Places (x, y) in the material picture [px], shape [n_points, 2]."""
    cell: IntArray
    """Column and row of each point in the grid, shape [n_points, 2]."""
    mask: BoolArray
    """Pixels of the body in the material picture, shape [rows, columns]."""
    material: int
    """Frame of the material picture."""
    match: StereoMatch
    """The match between the cameras in that frame."""
    tracking: Tracking
    """How points are followed in time."""
    noise: tuple[Noise, Noise]
    """Of the grey values of the cameras."""
    health: tuple[IntArray, IntArray]
    """`FrameOutcome` of the pictures of the cameras, each of shape [n_frames]."""
    rigid: bool
    """True for a body that only translates."""
    device: str
    """Where pictures are correlated."""
    name: str
    """What the stages are called to who asks for progress."""

    @property
    def size(self) -> int:
        """Points times frames: what a track of it holds."""
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
    """Choose the points of a region and match them between the cameras: `dic.bodies.follow.follow_body`."""
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
    """Share of a subset that pictures must show of a body of which a strip is in view.

    A subset that is wider than the strip hangs over it on both sides, and the strip holds little more of it
    than `Correlation.least_pixels` of its area, if that: nothing would be left for what the other camera does
    not see.

    Parameters
    ----------
    mask
        Pixels of the body, shape [rows, columns].
    points
        Its points (x, y) [px], shape [n, 2].
    settings
        The subset, and the share that is asked for of a body that fills it.

    Returns
    -------
    float
        `STRIP` of the largest share of a subset that lies inside the mask, `settings.least_pixels` at most.
    """
    held = uniform_filter(mask.astype(np.float64), size=settings.subset, mode="constant")
    x, y = np.round(points).astype(int).T
    return min(settings.least_pixels, STRIP * float(held[y, x].max()))


def track_body(body: MatchedBody, camera: int, progress: Callable[[int, int], None] | None = None) -> Track:
    """Follow a body's points in one camera; in camera 1 those that were matched.

    Parameters
    ----------
    body
        The body.
    camera
        0 or 1.
    progress
        Called with the frames done and their number.
    """
    first, points, match = camera == 0, body.points, body.match
    known = np.ones(len(points), dtype=bool) if first else match.valid
    if not known.any():
        return _all_points(dict(vars(_empty_track(points, match, body.health[camera]))), points, match)
    start, covariance = (None, None) if first else (match.warp[known], match.covariance[known])
    if body.rigid:
        found = track_rigid(
            body.pictures[camera], points[known], body.tracking.correlation, noise=body.noise[camera],
            mask=body.mask, start=start, start_covariance=covariance, first=body.material,
            frame_outcome=body.health[camera], device=body.device, progress=progress,
        )  # fmt: skip
    else:
        found = track(
            body.pictures[camera], points[known], body.tracking, noise=body.noise[camera],
            mask=body.mask, start=start, start_covariance=covariance, first=body.material,
            frame_outcome=body.health[camera], device=body.device, progress=progress,
        )  # fmt: skip
    variances = np.einsum("...ii->...i", found.covariance)
    variances += EXACT
    if first:
        return found
    fields = dict(vars(found))
    del found  # so that each array can go as soon as it was spread out
    return _all_points(fields, points, match)


def material_frame(health: tuple[IntArray, IntArray], wanted: int) -> int:
    """Frame nearest to the wanted one of which both cameras have a usable picture, the earlier of two.

    Parameters
    ----------
    health
        `FrameOutcome` of the pictures of the cameras, each of shape [n_frames].
    wanted
        The frame in which the region is declared.

    Raises
    ------
    ValueError
        If no frame has a usable picture of both cameras.
    """
    usable = np.flatnonzero((health[0] == FrameOutcome.VALID) & (health[1] == FrameOutcome.VALID))
    if not usable.size:
        raise ValueError("no frame has a usable picture of both cameras")
    return int(usable[np.argmin(np.abs(usable - wanted))])


def _empty_track(points: FloatArray, match: StereoMatch, health: IntArray) -> Track:
    """The track of camera 1 when no point was matched between the cameras."""
    return Track(
        points=points[:0],
        warp=np.empty((len(health), 0, 12)),
        covariance=np.empty((len(health), 0, 2, 2)),
        zncc=np.empty((len(health), 0)),
        outcome=np.empty((len(health), 0), dtype=np.int64),
        reference=np.empty((len(health), 0), dtype=np.int64),
        frame_outcome=health,
    )


def _all_points(fields: dict[str, Any], points: FloatArray, match: StereoMatch) -> Track:
    """A track of the matched points with rows for the others, which keep the outcome of their match.

    Parameters
    ----------
    fields
        Fields of the track, whose arrays are taken out one by one: two of the largest are held at a time.
    points
        All points, shape [n, 2].
    match
        Their match between the cameras.
    """
    known, n_frames, n = match.valid, len(fields["warp"]), len(points)
    for name in ("warp", "covariance", "zncc", "excess", "reference"):
        if fields[name] is None or known.all():
            continue
        narrow = fields.pop(name)
        wide = np.full((n_frames, n, *narrow.shape[2:]), -1 if name == "reference" else np.nan)
        wide[:, known] = narrow
        fields[name] = wide
    outcome = np.array(np.broadcast_to(match.outcome, (n_frames, n)))
    outcome[:, known] = fields["outcome"]
    if fields["frame_outcome"] is not None:
        outcome[fields["frame_outcome"] != FrameOutcome.VALID] = int(PointOutcome.NO_PICTURE)
    return Track(**{**fields, "points": points, "outcome": outcome})
