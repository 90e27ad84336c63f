"""Tracking of specimen and flyer through both series; the flyer's displacement and poses."""

from collections.abc import Sequence

import numpy as np

from dic.arrays import BoolArray
from dic.bodies.carried_region import carry_region
from dic.bodies.follow import Progress, TrackedBody, follow_bodies
from dic.bodies.matched import MatchedBody, match_body, material_frame
from dic.bodies.region import Region
from dic.bodies.second_camera import SecondCamera
from dic.chain.inspect_images import Inputs
from dic.chain.settings import ChainError
from dic.outcome import PointOutcome, Remark
from dic.result import Placement
from dic.rigid_body.axial_displacement import AxialDisplacement, from_rest
from dic.rigid_body.axial_translations import Translations, rim_of, seen_twice, translations
from dic.rigid_body.body_motion import BodyMotion
from dic.rigid_body.past_rim import before_rim
from dic.rigid_body.poses import flyer_poses
from dic.rigid_body.rest_from_rim import RestGeometry, Rim
from dic.tracking import Tracking


def match_specimen(inputs: Inputs, region: Region) -> MatchedBody:
    """The specimen's points matched between the cameras; errors as `dic.bodies.follow.follow_body`."""
    return _matched(inputs, region, "specimen", inputs.settings.tracking)


def match_flyer(inputs: Inputs, region: Region, mask: BoolArray | None = None) -> MatchedBody:
    """The flyer's points matched between the cameras; errors as `dic.bodies.follow.follow_body`. With `mask`
    those of some pixels of the region, in the picture that its points are chosen in."""
    return _matched(inputs, region, "flyer", inputs.settings.rigid, rigid=True, mask=mask)


def follow(
    inputs: Inputs,
    bodies: Sequence[MatchedBody],
    progress: Progress | None = None,
    second: SecondCamera | None = None,
) -> list[TrackedBody]:
    """The bodies through both series, camera 1 by a process of its own if there is one."""
    return follow_bodies(bodies, inputs.rig, inputs.settings.stereo, progress=progress, second=second)


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
    """The region in the nearest frame with a usable picture of both cameras, if it is known to show the same.

    Raises
    ------
    ChainError
        If that is another frame than the region's own, the body does not rest in both, and it cannot be
        followed from one to the other.
    ValueError
        If no frame has a usable picture of both cameras.
    """
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
    """Translations of the flyer along the axis, if there is one."""
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


def rest_geometry(inputs: Inputs, placement: Placement) -> RestGeometry | None:
    """What is known of the specimen at rest; None without a declared length."""
    settings = inputs.settings
    if settings.length is None:
        return None
    radius = placement.radius if settings.radius is None else settings.radius
    lower = float(np.sqrt(placement.frame.covariance[4, 4]))
    return RestGeometry(settings.length, float(np.hypot(settings.length_sigma, lower)), radius)


def rim_in(inputs: Inputs, flyer: TrackedBody | None, placement: Placement) -> Rim | None:
    """The rim of the flyer's face; None if it is not known."""
    geometry = rest_geometry(inputs, placement)
    if flyer is None or geometry is None:
        return None
    return rim_of(flyer, inputs.rig, placement.frame, inputs.pictures, geometry)


def clear_of_rim(
    inputs: Inputs, flyer: TrackedBody | None, placement: Placement, rim: Rim | None
) -> tuple[BoolArray, float]:
    """Pixels of the flyer's region before the rim of its face, and how far the region reaches past it [px].

    All of it and 0 if the rim, or where the flyer was when its points were chosen, is not known.
    """
    if flyer is None or rim is None:
        return np.empty((0, 0), dtype=bool), 0.0
    places, moves = seen_twice(flyer, placement.frame)
    known, move = np.isfinite(places).all(axis=1), moves[flyer.material]
    if not np.isfinite(move).all():
        return flyer.mask, 0.0
    radius = float(np.median(np.hypot(places[known, 0], places[known, 2])))
    return before_rim(flyer.mask, inputs.rig.cameras[0], placement.frame, radius, move, rim.y)


def follow_before_rim(
    inputs: Inputs, region: Region, mask: BoolArray, progress: Progress | None = None
) -> TrackedBody | None:
    """The flyer followed by some pixels of its region; None if they hold no point that both cameras see."""
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
    seen: Translations | None,
) -> AxialDisplacement | None:
    """Axial displacement of the flyer, if there is one.

    Parameters
    ----------
    inputs, flyer, placement
        The pictures, the flyer followed, and the specimen at rest.
    rim, seen
        The rim of its face, and its translations, where they are known (`rim_in`, `translations_of`).
    """
    if flyer is None:
        return None
    geometry = rest_geometry(inputs, placement)
    return from_rest(seen, rim, inputs.rig, placement.frame, inputs.t, inputs.static, geometry)


def poses_of(
    inputs: Inputs, flyer: TrackedBody | None, placement: Placement, axial: AxialDisplacement | None
) -> tuple[BodyMotion | None, list[Remark]]:
    """Rigid motion of the flyer, if its axial displacement is known, and remarks on why it has none."""
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
