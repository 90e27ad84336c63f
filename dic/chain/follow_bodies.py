"""Tracking of specimen and flyer through both series; the flyer's region, displacement and poses.

A camera below the flyer's face sees the face between the rim and the specimen. The face moves with the flyer,
so a region may contain part of it. At the same place the other camera sees the specimen. If only a few rows
are in view, this shifts the match by half a pixel.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from dic.basics import BoolArray, FloatArray
from dic.bodies.axial_displacement import (
    AxialDisplacement,
    Translations,
    from_rest,
    rim_of,
    stereo_translations,
    translations,
)
from dic.bodies.body_motion import BodyMotion, body_motion
from dic.bodies.edge_registration import rays_on_body
from dic.bodies.follow import MatchedBody, Progress, TrackedBody, follow_bodies, match_body, material_frame
from dic.bodies.region import Region, carry_region
from dic.bodies.rest_from_rim import RestGeometry, Rim
from dic.camera import Camera, StereoRig
from dic.chain.inputs import ChainError, Inputs
from dic.correlation.subsets import overlap_factor
from dic.outcome import PointOutcome, Remark
from dic.result import Placement
from dic.stereo.geometry import pixels_per_length
from dic.surfaces.cylinder import SpecimenFrame
from dic.tracking import Track, Tracking

CLEAR = 1.0
"""A region that contains part of the face is cut off at this distance from the rim, the blur of the edge
[px]. A detected region has the same distance."""


def before_rim(
    mask: BoolArray, camera: Camera, frame: SpecimenFrame, radius: float, move: FloatArray, rim: float
) -> tuple[BoolArray, float]:
    """Pixels of a region that are clear of the flyer's rim, and how far the region reaches past the rim
    [px]."""
    row, column = np.nonzero(mask)
    pixels = np.stack([column, row], axis=1).astype(np.float64)
    lateral = np.array([move[0], 0.0, move[2]])
    y = rays_on_body(camera, pixels, frame, radius, lateral)[:, 1] - move[1]
    place = frame.in_rig(np.array([0.0, rim, radius]) + move)
    scale = float(np.linalg.norm(pixels_per_length(camera, place, frame.rotation[1])))
    past = float(np.max((rim - y) * scale, initial=0.0, where=np.isfinite(y)))
    if past <= 0.0:
        return mask, 0.0
    clear = mask.copy()
    clear[row, column] = (y - rim) * scale >= CLEAR  # a ray that misses the flyer has no y and is left out
    return clear, past


LATERAL_SHARE = 0.05
"""Prior standard deviation of the change of direction of the velocity [rad]. It is the lateral displacement
from frame to frame over the axial displacement."""
MOST_FRAMES = 400
"""Largest number of frames whose poses are estimated together. If there are more, evenly spaced frames are
used."""
MOST_POINTS = 2000
"""Largest number of points for the estimate of poses. If there are more, evenly spaced points are used. The
memory grows with frames times points. More points add little information, because their subsets overlap."""
WIDE = 0.25
"""Smallest number of points of a frame, relative to the frame with the most points [-].

A strip of a few rows at the border of the picture is too narrow to determine a rotation. The border shifts
its points by 0.1 px in all frames, which turns the strip by several mrad.
"""
ZERO_FRAMES = 6
"""Number of frames that define the zero of the motion, if no static frame shows the flyer."""


def flyer_poses(
    body: TrackedBody,
    rig: StereoRig,
    frame: SpecimenFrame,
    axial: AxialDisplacement,
    static: BoolArray,
    *,
    subset: int,
    length: float | None,
) -> tuple[BodyMotion | None, list[Remark]]:
    """The rigid motion of the flyer in the frames with enough points, and remarks if no motion was
    estimated."""
    body = subsample(body, MOST_POINTS)
    r = body.reconstruction
    visible = np.logical_or(*(track.outcome == PointOutcome.VALID for track in body.tracks))
    selected = np.zeros(len(static), dtype=bool)
    selected[:: -(-len(static) // MOST_FRAMES)] = True
    outcome = np.where(selected[:, None], r.outcome, int(PointOutcome.NO_PICTURE))
    count = (outcome == PointOutcome.VALID).sum(axis=1)
    selected &= count >= max(WIDE * count.max(initial=0), 3)
    outcome = np.where(selected[:, None], outcome, int(PointOutcome.NO_PICTURE))
    tracks = (_keep_frames(body.tracks[0], selected), _keep_frames(body.tracks[1], selected))
    rest_frames = np.flatnonzero(static & selected)
    if not rest_frames.size:
        rest_frames = np.flatnonzero(selected)[:ZERO_FRAMES]
    step = float(np.median(np.abs(np.diff(axial.displacement[~static[axial.frame]])), axis=0))
    radius = float(np.nanmedian(np.hypot(*frame.positions(r.position)[..., [0, 2]].reshape(-1, 2).T)))
    try:
        middle = _middle(frame.positions(r.position[rest_frames]), length)
        motion = body_motion(
            [replace(r, outcome=outcome)],
            frame,
            at=middle,
            rest_frames=rest_frames.tolist(),
            overlaps=[overlap_factor(body.points, subset, visible)],
            rig=rig,
            tracks=[tracks],
            rotation_change=LATERAL_SHARE * step / radius,
            lateral_change=LATERAL_SHARE * step,
        )
    except ValueError as error:
        return None, [
            Remark(
                name="no direction of the flyer",
                text=f"the poses of the flyer cannot be had: {error}",
                cure="declare a larger region of it, or a frame that shows more of it",
            )
        ]
    return motion, []


def subsample(body: TrackedBody, most: int) -> TrackedBody:
    """A body with at most `most` evenly chosen points. A body with fewer points is returned unchanged."""
    n = len(body.points)
    if n <= most:
        return body
    selected, r = slice(None, None, -(-n // most)), body.reconstruction
    first, second = (
        replace(
            track,
            points=track.points[selected],
            excess=None if track.excess is None else track.excess[:, selected],
            root=None if track.root is None else track.root[selected],
            **{
                name: getattr(track, name)[:, selected]
                for name in ("warp", "covariance", "zncc", "outcome", "reference")
            },
        )
        for track in body.tracks
    )
    return replace(
        body,
        points=body.points[selected],
        cell=body.cell[selected],
        tracks=(first, second),
        reconstruction=replace(
            r,
            pixels=(r.pixels[0][:, selected], r.pixels[1][:, selected]),
            **{
                name: getattr(r, name)[:, selected]
                for name in ("position", "covariance", "epipolar", "outcome")
            },
        ),
        common=None if body.common is None else body.common[:, selected],
    )


def _keep_frames(track: Track, selected: BoolArray) -> Track:
    """The track without the frames that are not kept."""
    return replace(track, outcome=np.where(selected[:, None], track.outcome, int(PointOutcome.NO_PICTURE)))


def _middle(places: FloatArray, length: float | None) -> FloatArray:
    """The point of the body whose displacement is given [m], shape [3]."""
    if length is not None:
        return np.array([0.0, length, 0.0])
    finite = places[np.isfinite(places).all(axis=-1)]
    if not len(finite):
        raise ValueError("no point of it was seen by both cameras at rest or later")
    return np.array([0.0, float(finite[:, 1].mean()), 0.0])


def match_specimen(inputs: Inputs, region: Region) -> MatchedBody:
    """The specimen's points, matched between the cameras; raises as `dic.bodies.follow.match_body`."""
    return _matched(inputs, region, "specimen", inputs.settings.tracking)


def match_flyer(inputs: Inputs, region: Region, mask: BoolArray | None = None) -> MatchedBody:
    """The flyer's points, matched between the cameras; raises as `dic.bodies.follow.match_body`. ``mask``:
    pixels of the region to be used, in the picture in which the points are chosen."""
    return _matched(inputs, region, "flyer", inputs.settings.rigid, rigid=True, mask=mask)


def follow(
    inputs: Inputs, bodies: Sequence[MatchedBody], progress: Progress | None = None
) -> list[TrackedBody]:
    """Track the bodies through both series."""
    return follow_bodies(bodies, inputs.rig, inputs.settings.stereo, progress=progress)


def _matched(
    inputs: Inputs,
    region: Region,
    name: str,
    tracking: Tracking,
    *,
    rigid: bool = False,
    mask: BoolArray | None = None,
) -> MatchedBody:
    settings = inputs.settings
    return match_body(
        inputs.pictures,
        inputs.rig,
        usable_region(inputs, region, name),
        step=settings.step,
        margin=settings.margin,
        tracking=tracking,
        stereo=settings.stereo,
        noise=inputs.noise,
        health=inputs.health,
        mask=mask,
        rigid=rigid,
        device=settings.device,
        name=name,
    )


def usable_region(inputs: Inputs, region: Region, name: str) -> Region:
    """The region in the nearest frame with usable pictures of both cameras, if the body has not moved
    there."""
    frame = material_frame(inputs.health, region.frame)
    if frame == region.frame or (inputs.static[frame] and inputs.static[region.frame]):
        return region
    carried = carry_region(
        inputs.pictures[0], inputs.health[0], region, frame, direction=inputs.settings.direction
    )
    if carried is None:
        raise ChainError(
            f"the region of the {name} is declared in frame {region.frame}, of which a camera has no usable "
            f"picture, and what it shows could not be followed to frame {frame}, the nearest that has both; "
            f"declare it in frame {frame} or in one between {frame} and the static frames"
        )
    return carried


def translations_of(inputs: Inputs, flyer: TrackedBody | None, placement: Placement) -> Translations | None:
    """Translations of the flyer along the axis; None if there is no flyer."""
    if flyer is None:
        return None
    return translations(
        flyer,
        inputs.rig,
        placement.frame,
        inputs.t,
        inputs.static,
        subset=inputs.settings.subset,
        pictures=inputs.pictures,
    )


def _rest_geometry(inputs: Inputs, placement: Placement) -> RestGeometry | None:
    """Geometry of the specimen at rest; None without a declared length."""
    settings = inputs.settings
    if settings.length is None:
        return None
    radius = placement.radius if settings.radius is None else settings.radius
    lower = float(np.sqrt(placement.frame.covariance[4, 4]))
    return RestGeometry(settings.length, float(np.hypot(settings.length_sigma, lower)), radius)


def rim_in(inputs: Inputs, flyer: TrackedBody | None, placement: Placement) -> Rim | None:
    """The rim of the flyer's face; None if it is not known."""
    geometry = _rest_geometry(inputs, placement)
    if flyer is None or geometry is None:
        return None
    return rim_of(flyer, inputs.rig, placement.frame, inputs.pictures, geometry)


def clear_of_rim(
    inputs: Inputs, flyer: TrackedBody | None, placement: Placement, rim: Rim | None
) -> tuple[BoolArray, float]:
    """Pixels of the flyer's region before the rim of its face, and how far the region reaches past it [px].

    The whole region and 0 if the rim is not known, or the flyer's position when its points were chosen.
    """
    if flyer is None or rim is None:
        return np.empty((0, 0), dtype=bool), 0.0
    places, moves = stereo_translations(flyer, placement.frame)
    finite, move = np.isfinite(places).all(axis=1), moves[flyer.material]
    if not np.isfinite(move).all():
        return flyer.mask, 0.0
    radius = float(np.median(np.hypot(places[finite, 0], places[finite, 2])))
    return before_rim(flyer.mask, inputs.rig.cameras[0], placement.frame, radius, move, rim.y)


def follow_before_rim(
    inputs: Inputs, region: Region, mask: BoolArray, progress: Progress | None = None
) -> TrackedBody | None:
    """The flyer, tracked with some pixels of its region. None if both cameras see no point in them."""
    try:
        flyer = follow(inputs, [match_flyer(inputs, region, mask)], progress)[0]
    except ValueError:  # no room for a point
        return None
    return flyer if (flyer.reconstruction.outcome == PointOutcome.VALID).any() else None


def displacement_of(
    inputs: Inputs,
    flyer: TrackedBody | None,
    placement: Placement,
    rim: Rim | None,
    motion: Translations | None,
) -> AxialDisplacement | None:
    """Axial displacement of the flyer; None if there is no flyer.

    ``inputs``, ``flyer``, ``placement``: the pictures, the tracked flyer, and the specimen at rest. ``rim``,
    ``motion``: the rim of its face and its translations, if known (`rim_in`, `translations_of`).
    """
    if flyer is None:
        return None
    geometry = _rest_geometry(inputs, placement)
    return from_rest(motion, rim, inputs.rig, placement.frame, inputs.t, inputs.static, geometry)


def poses_of(
    inputs: Inputs, flyer: TrackedBody | None, placement: Placement, axial: AxialDisplacement | None
) -> tuple[BodyMotion | None, list[Remark]]:
    """Rigid motion of the flyer, if its axial displacement is known, and remarks that explain its absence."""
    if flyer is None or axial is None:
        return None, []
    return flyer_poses(
        flyer,
        inputs.rig,
        placement.frame,
        axial,
        inputs.static,
        subset=inputs.settings.subset,
        length=inputs.settings.length,
    )
