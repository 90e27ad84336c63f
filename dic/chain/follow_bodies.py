"""Specimen and flyer followed through both series, and what the flyer's points tell of its motion."""

from dic.bodies.follow import Followed, Progress, follow_body
from dic.bodies.region import Region
from dic.chain.inspect_images import Given
from dic.outcome import Remark
from dic.result import Placement
from dic.rigid_body.axial_displacement import Travel, flyer_travel
from dic.rigid_body.body_motion import BodyMotion
from dic.rigid_body.poses import flyer_poses
from dic.tracking import Tracking


def follow_specimen(given: Given, region: Region, progress: Progress | None) -> Followed:
    """The specimen through both series; errors as `dic.bodies.follow.follow_body`."""
    return _follow(given, region, "specimen", given.settings.tracking, progress)


def follow_flyer(given: Given, region: Region, progress: Progress | None) -> Followed:
    """The flyer through both series; errors as `dic.bodies.follow.follow_body`."""
    return _follow(given, region, "flyer", given.settings.rigid, progress, rigid=True)


def _follow(
    given: Given,
    region: Region,
    name: str,
    tracking: Tracking,
    progress: Progress | None,
    *,
    rigid: bool = False,
) -> Followed:
    settings = given.settings
    return follow_body(
        given.pictures,
        given.rig,
        region,
        step=settings.step,
        margin=settings.margin,
        tracking=tracking,
        stereo=settings.stereo,
        noise=given.noise,
        health=given.health,
        rigid=rigid,
        device=settings.device,
        name=name,
        progress=progress,
    )


def travel_of(given: Given, flyer: Followed | None, placement: Placement) -> Travel | None:
    """How far the flyer went, if there is one."""
    if flyer is None:
        return None
    return flyer_travel(
        flyer,
        given.rig,
        placement.frame,
        given.t,
        given.static,
        subset=given.settings.subset,
        pictures=given.pictures,
    )


def poses_of(
    given: Given, flyer: Followed | None, placement: Placement, travel: Travel | None
) -> tuple[BodyMotion | None, list[Remark]]:
    """The flyer's rigid motion, if there is a flyer and its travel is known, and why it has none."""
    if flyer is None or travel is None:
        return None, []
    return flyer_poses(
        flyer,
        given.rig,
        placement.frame,
        travel,
        given.static,
        subset=given.settings.subset,
        length=given.settings.length,
    )
