"""Tracking of specimen and flyer through both series; the flyer's displacement and poses."""

from collections.abc import Callable, Sequence

import numpy as np

from dic.bodies.carried_region import carry_region
from dic.bodies.follow import Progress, TrackedBody, follow_bodies
from dic.bodies.matched import MatchedBody, match_body, material_frame
from dic.bodies.region import Region
from dic.chain.inspect_images import Inputs
from dic.chain.settings import ChainError
from dic.outcome import Remark
from dic.result import Placement
from dic.rigid_body.axial_displacement import AxialDisplacement, from_rest
from dic.rigid_body.axial_translations import Translations, rim_of, translations
from dic.rigid_body.body_motion import BodyMotion
from dic.rigid_body.poses import flyer_poses
from dic.rigid_body.rest_from_rim import RestGeometry
from dic.tracking import Tracking


def match_specimen(inputs: Inputs, region: Region) -> MatchedBody:
    """The specimen's points matched between the cameras; errors as `dic.bodies.follow.follow_body`."""
    return _matched(inputs, region, "specimen", inputs.settings.tracking)


def match_flyer(inputs: Inputs, region: Region) -> MatchedBody:
    """The flyer's points matched between the cameras; errors as `dic.bodies.follow.follow_body`."""
    return _matched(inputs, region, "flyer", inputs.settings.rigid, rigid=True)


def follow(
    inputs: Inputs, bodies: Sequence[MatchedBody], progress: Progress | None = None
) -> list[TrackedBody]:
    """The bodies through both series."""
    return follow_bodies(bodies, inputs.rig, inputs.settings.stereo, progress=progress)


def _matched(
    inputs: Inputs, region: Region, name: str, tracking: Tracking, *, rigid: bool = False
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


def displacement_of(
    inputs: Inputs,
    flyer: TrackedBody | None,
    placement: Placement,
    seen: Callable[[], Translations | None] | None = None,
) -> AxialDisplacement | None:
    """Axial displacement of the flyer, if there is one.

    Parameters
    ----------
    inputs, flyer, placement
        The pictures, the flyer followed, and the specimen at rest.
    seen
        Gives its translations, of which the rim of its face needs none; None: `translations_of`.
    """
    if flyer is None:
        return None
    settings, geometry = inputs.settings, None
    if settings.length is not None:
        radius = placement.radius if settings.radius is None else settings.radius
        lower = float(np.sqrt(placement.frame.covariance[4, 4]))
        geometry = RestGeometry(settings.length, float(np.hypot(settings.length_sigma, lower)), radius)
    rig, frame = inputs.rig, placement.frame
    rim = None if geometry is None else rim_of(flyer, rig, frame, inputs.pictures, geometry)
    found = translations_of(inputs, flyer, placement) if seen is None else seen()
    return from_rest(found, rim, rig, frame, inputs.t, inputs.static, geometry)


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
