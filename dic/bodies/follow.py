"""Tracking of bodies by two cameras: points matched between them, tracked, reconstructed."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.bodies.matched import MatchedBody, match_body, track_body
from dic.bodies.region import Region
from dic.bodies.second_camera import SecondCamera
from dic.camera import StereoRig
from dic.correlation import Correlation, Noise
from dic.correlation.warp import identity
from dic.forks import beside, side_by_side
from dic.images import Pictures
from dic.stereo import Reconstruction, StereoMatch, reconstruct
from dic.tracking import Track, Tracking
from dic.tracking.matcher import in_material, shares

Progress = Callable[[str, int, int], None]
"""Called as ``progress(stage, done, total)``."""

MOST_SENT = 400_000
"""Points times frames, of all bodies, whose tracks a fork sends back: some 70 MB. The tracks of more points
are worked out in threads, which wait for one another less the more points a match has."""


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
    matched = match_body(
        pictures, rig, region, step=step, margin=margin, tracking=tracking, stereo=stereo, noise=noise,
        health=health, mask=mask, rigid=rigid, device=device, name=name,
    )  # fmt: skip
    return follow_bodies([matched], rig, stereo, progress=progress)[0]


def follow_bodies(
    bodies: Sequence[MatchedBody],
    rig: StereoRig,
    stereo: Correlation,
    *,
    progress: Progress | None = None,
    second: SecondCamera | None = None,
) -> list[TrackedBody]:
    """Follow bodies that were matched, the two cameras side by side.

    Parameters
    ----------
    bodies
        The bodies, on one device.
    rig
        The cameras, for pictures with their crop.
    stereo
        How they were matched between the cameras.
    progress
        Told of the frames done; of those of camera 1 when all are.
    second
        A process that can follow camera 1, see `dic.bodies.second_camera`.
    """
    told = progress or (lambda stage, done, total: None)

    def seen_by(camera: int) -> list[Track]:
        return [
            track_body(body, camera, partial(told, f"{body.name}, camera 0") if camera == 0 else None)
            for body in bodies
        ]

    small = sum(body.size for body in bodies) <= MOST_SENT
    if small and second is not None and second.can_follow(bodies):
        later = second.follow(bodies)
        tracks = list(zip(seen_by(0), later(), strict=True))
    else:
        # a fork cannot use the GPU that this process has opened
        forked = small and all(body.device == "cpu" for body in bodies)
        with beside(partial(seen_by, 1), fork=None if forked else False) as later:
            tracks = list(zip(seen_by(0), later(), strict=True))
    for body in bodies:
        told(f"{body.name}, camera 1", len(body.health[1]), len(body.health[1]))
    common = [_common_of(body, stereo, found) for body, found in zip(bodies, tracks, strict=True)]
    works = [
        partial(reconstruct, rig, *found, common=shared) for found, shared in zip(tracks, common, strict=True)
    ]
    made = side_by_side(works) if small else [work() for work in works]
    return [_tracked(*of) for of in zip(bodies, tracks, made, common, strict=True)]


def _common_of(body: MatchedBody, stereo: Correlation, tracks: tuple[Track, Track]) -> FloatArray | None:
    """Noise that both tracks of a body share; None of a rigid one."""
    if body.rigid:
        return None
    lower = tracks[0].root if body.tracking.correlation.shape <= stereo.shape else None
    return _common(body.match, lower, len(body.health[0]))


def _tracked(
    body: MatchedBody, tracks: tuple[Track, Track], made: Reconstruction, common: FloatArray | None
) -> TrackedBody:
    """The body with its points in space."""
    return TrackedBody(
        points=body.points,
        cell=body.cell,
        mask=body.mask,
        material=body.material,
        stereo=body.match,
        tracks=tracks,
        reconstruction=made,
        common=common,
    )


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
