"""Poses of the flyer: rotation and displacement of a rigid body from its tracked points."""

from dataclasses import replace

import numpy as np

from dic.arrays import BoolArray, FloatArray
from dic.bodies.follow import TrackedBody
from dic.camera import StereoRig
from dic.outcome import PointOutcome, Remark
from dic.rigid_body.axial_displacement import AxialDisplacement
from dic.rigid_body.body_motion import BodyMotion, body_motion
from dic.surfaces import SpecimenFrame, overlap_factor
from dic.tracking import Track

LATERAL_SHARE = 0.05
"""Prior standard deviation of the lateral displacement from frame to frame, over the axial displacement in
that time: the change of direction of the velocity [rad]."""
MOST_FRAMES = 400
"""Frames whose poses are solved for together; of more, evenly chosen ones."""
MOST_POINTS = 2000
"""Points from which they are solved for; of more, evenly chosen ones. The memory grows with frames times
points, and beyond so many subsets overlap and tell little more."""
WIDE = 0.25
"""Share of the points of the best frame that a frame must see.

A strip of a few rows at the border of the picture has a lever too short for a rotation: what the border does
to its places, 0.1 px alike in all frames, turns it by several mrad.
"""
ZERO_FRAMES = 6
"""Frames that give it."""


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
    """The rigid motion of the flyer, where its points tell it.

    Parameters
    ----------
    body
        The flyer, followed.
    rig, frame
        The cameras and the test frame.
    axial
        Its axial displacement, which scales the prior of the lateral motion from frame to frame.
    static
        Frames in which it rests, shape [n_frames].
    subset
        Side of the subsets [px].
    length
        Length of the specimen at rest [m]: the displacement is that of the middle of the flyer's face. None:
        of the middle of the points.

    Returns
    -------
    motion : BodyMotion or None
        Its zero is the mean at rest, or that of the first frames with a wide view if too little of the body
        is in view at rest. LOST frames: too little of it is in view. None if no poses can be had.
    remarks : list of Remark
        Why there are none.
    """
    body = thinned(body, MOST_POINTS)
    r = body.reconstruction
    seen = np.logical_or(*(track.outcome == PointOutcome.VALID for track in body.tracks))
    kept = np.zeros(len(static), dtype=bool)
    kept[:: -(-len(static) // MOST_FRAMES)] = True
    outcome = np.where(kept[:, None], r.outcome, int(PointOutcome.NO_PICTURE))
    both = (outcome == PointOutcome.VALID).sum(axis=1)
    kept &= both >= max(WIDE * both.max(initial=0), 3)
    outcome = np.where(kept[:, None], outcome, int(PointOutcome.NO_PICTURE))
    tracks = (_kept(body.tracks[0], kept), _kept(body.tracks[1], kept))
    rest = np.flatnonzero(static & kept)
    if not rest.size:
        rest = np.flatnonzero(kept)[:ZERO_FRAMES]
    step = float(np.median(np.abs(np.diff(axial.displacement[~static[axial.frame]])), axis=0))
    radius = float(np.nanmedian(np.hypot(*frame.positions(r.position)[..., [0, 2]].reshape(-1, 2).T)))
    try:
        middle = _middle(frame.positions(r.position[rest]), length)
        motion = body_motion(
            [replace(r, outcome=outcome)],
            frame,
            at=middle,
            rest=rest.tolist(),
            overlaps=[overlap_factor(body.points, subset, seen)],
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


def thinned(body: TrackedBody, most: int) -> TrackedBody:
    """A body with at most so many of its points, evenly chosen; itself if it has no more."""
    n = len(body.points)
    if n <= most:
        return body
    kept, r = slice(None, None, -(-n // most)), body.reconstruction
    first, second = (
        replace(
            track,
            points=track.points[kept],
            excess=None if track.excess is None else track.excess[:, kept],
            root=None if track.root is None else track.root[kept],
            **{
                name: getattr(track, name)[:, kept]
                for name in ("warp", "covariance", "zncc", "outcome", "reference")
            },
        )
        for track in body.tracks
    )
    return replace(
        body,
        points=body.points[kept],
        cell=body.cell[kept],
        tracks=(first, second),
        reconstruction=replace(
            r,
            pixels=(r.pixels[0][:, kept], r.pixels[1][:, kept]),
            **{name: getattr(r, name)[:, kept] for name in ("position", "covariance", "epipolar", "outcome")},
        ),
        common=None if body.common is None else body.common[:, kept],
    )


def _kept(track: Track, kept: BoolArray) -> Track:
    """The track without the frames that are not kept."""
    return replace(track, outcome=np.where(kept[:, None], track.outcome, int(PointOutcome.NO_PICTURE)))


def _middle(places: FloatArray, length: float | None) -> FloatArray:
    """The point of the body whose displacement is wanted [m], shape [3]."""
    if length is not None:
        return np.array([0.0, length, 0.0])
    known = places[np.isfinite(places).all(axis=-1)]
    if not len(known):
        raise ValueError("no point of it was seen by both cameras at rest or later")
    return np.array([0.0, float(known[:, 1].mean()), 0.0])
