"""Tracking of one body by two cameras: points matched between them, tracked, reconstructed."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.bodies.region import Region, grid_points, polygon_mask
from dic.camera import StereoRig
from dic.correlation import Correlation, Noise
from dic.correlation.warp import identity
from dic.images import Pictures
from dic.outcome import FrameOutcome, PointOutcome
from dic.stereo import Reconstruction, StereoMatch, match_stereo, reconstruct
from dic.tracking import Track, Tracking, track
from dic.tracking.matcher import in_material, shares
from dic.tracking.rigid import track_rigid

Progress = Callable[[str, int, int], None]
"""Called as ``progress(stage, done, total)``."""

EXACT = 1e-8
"""Variance of a point in the picture it was chosen in [px²]: none but that of its rounding."""


@dataclass(frozen=True)
class TrackedBody:
    """One body through all frames of both cameras."""

    points: FloatArray
    """Places (x, y) in the material picture [px], shape [n_points, 2]."""
    cell: IntArray
    """Column and row of each point in the grid, shape [n_points, 2]."""
    mask: BoolArray
    """Pixels of the body in the material picture, shape [rows, columns]."""
    material: int
    """Frame of the material picture."""
    stereo: StereoMatch
    """The match between the cameras in that frame."""
    tracks: tuple[Track, Track]
    """Both cameras' tracks of all points; a point without a stereo match has that match's outcome in
    camera 1."""
    reconstruction: Reconstruction
    """Places in the rig's frame."""
    common: FloatArray | None
    """Noise that both tracks share (`dic.stereo.reconstruct`) [px²], shape [n_frames, n_points, 2, 2]."""


def follow_body(
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
    progress: Progress | None = None,
) -> TrackedBody:
    """Follow the points of a region through both series.

    Parameters
    ----------
    pictures
        The series of camera 0 and camera 1.
    rig
        The cameras, for pictures with their crop.
    region
        Where the body is. If a camera has no usable picture at its frame, the nearest frame with one is
        taken.
    step
        Distance of the points [px].
    margin
        Least distance from a point to the region's rim [px].
    tracking
        How points are followed in time.
    stereo
        How they are matched between the cameras.
    noise
        Of the grey values of the cameras.
    health
        `FrameOutcome` of the pictures of the cameras, each of shape [n_frames].
    mask
        Pixels of the body in the region's picture, shape [rows, columns]; None: those within its corners.
    rigid
        True for a body that only translates.
    device
        Where pictures are correlated.
    name
        What the stages are called to `progress`.
    progress
        Told of the frames done.

    Raises
    ------
    ValueError
        A region outside the picture, or no frame that both cameras saw.
    """
    material = material_frame(health, region.frame)
    if mask is None:
        mask = polygon_mask(region.corners, pictures[0].shape)
    points, cell = grid_points(mask, step, margin=margin)
    first, second = (series.frame(material) for series in pictures)
    match = match_stereo(first, second, points, rig, stereo, noise=noise, mask=mask, device=device)

    def one(camera: int) -> Track:
        known = np.ones(len(points), dtype=bool) if camera == 0 else match.valid
        if not known.any():
            return _empty_track(points, match, health[camera])
        found = _followed(
            pictures[camera],
            points[known],
            tracking,
            rigid=rigid,
            noise=noise[camera],
            mask=mask,
            start=None if camera == 0 else match.warp[known],
            start_covariance=None if camera == 0 else match.covariance[known],
            first=material,
            frame_outcome=health[camera],
            device=device,
            progress=None if progress is None else _named(progress, f"{name}, camera {camera}"),
        )
        return replace(found, covariance=found.covariance + EXACT * np.eye(2))

    with ThreadPoolExecutor(2) as pool:  # the match releases the interpreter
        tracks = list(pool.map(one, (0, 1)))
    tracks[1] = _all_points(tracks[1], points, match)
    common = None
    if not rigid:
        lower = tracks[0].root if tracking.correlation.shape <= stereo.shape else None
        common = _common(match, lower, len(health[0]))
    return TrackedBody(
        points=points,
        cell=cell,
        mask=mask,
        material=material,
        stereo=match,
        tracks=(tracks[0], tracks[1]),
        reconstruction=reconstruct(rig, tracks[0], tracks[1], common=common),
        common=common,
    )


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


def _common(match: StereoMatch, root: FloatArray | None, n_frames: int) -> FloatArray:
    """Noise of the material picture's template, which both cameras' tracks begin with [px²], shape
    [n_frames, n_points, 2, 2], alike in all frames and held once. In that picture itself, where the points
    were chosen, camera 0 has no noise to share, and `reconstruct` takes as much.

    Where the shape functions differ, what is common is the error of the lower one (`carried_from`): that of
    camera 0's track, its `root`, or that of the match between the cameras, None.
    """
    valid = match.valid
    common = np.zeros((len(valid), 2, 2))
    if root is not None:
        known = valid & np.isfinite(root).all(axis=(1, 2))
        common[known] = root[known]
    else:
        share = shares(match.warp[valid], identity(int(valid.sum())))[0][:, None, None]
        common[valid] = in_material(share * match.covariance[valid], match.warp[valid])
    return np.broadcast_to(common, (n_frames, *common.shape))


def _followed(
    pictures: Pictures, points: FloatArray, tracking: Tracking, *, rigid: bool, **given: Any
) -> Track:
    """One camera's track, of a body that deforms or only translates."""
    if rigid:
        return track_rigid(pictures, points, tracking.correlation, **given)
    return track(pictures, points, tracking, **given)


def _named(progress: Progress, stage: str) -> Callable[[int, int], None]:
    return lambda done, total: progress(stage, done, total)


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


def _all_points(found: Track, points: FloatArray, match: StereoMatch) -> Track:
    """A track of the matched points with rows for the others, which keep the outcome of their match."""
    n_frames, n, known = len(found.warp), len(points), match.valid
    wide = {
        name: np.full((n_frames, n, *getattr(found, name).shape[2:]), np.nan)
        for name in ("warp", "covariance", "zncc")
    }
    for name, values in wide.items():
        values[:, known] = getattr(found, name)
    outcome = np.array(np.broadcast_to(match.outcome, (n_frames, n)))
    outcome[:, known] = found.outcome
    if found.frame_outcome is not None:
        outcome[found.frame_outcome != FrameOutcome.VALID] = int(PointOutcome.NO_PICTURE)
    reference = np.full((n_frames, n), -1)
    reference[:, known] = found.reference
    excess = None
    if found.excess is not None:
        excess = np.full((n_frames, n), np.nan)
        excess[:, known] = found.excess
    return replace(found, points=points, outcome=outcome, reference=reference, excess=excess, **wide)
