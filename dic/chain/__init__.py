"""Measurement of surfaces from two series of pictures and their calibrated cameras.

`measure` runs the stages one after the other and records their wall times. Each stage is a module of this
package. The flyer is tracked in parallel with the specimen. The flyer's motion and the specimen's surface are
also computed in parallel.
"""

from collections.abc import Callable, Mapping
from functools import partial
from time import perf_counter
from typing import Any, TypeVar

from dic.basics import BoolArray, FloatArray
from dic.bodies.follow import MatchedBody, Progress
from dic.bodies.region import Region
from dic.camera import StereoRig
from dic.chain import remarks
from dic.chain.follow_bodies import (
    clear_of_rim,
    displacement_of,
    follow,
    follow_before_rim,
    match_flyer,
    match_specimen,
    poses_of,
    rim_in,
    translations_of,
)
from dic.chain.inputs import (
    DIRECTIONS,
    ChainError,
    ChainSettings,
    Inputs,
    Inspection,
    check_cameras,
    inspect_pictures,
)
from dic.chain.outliers import gate_ends, gate_epipolar, gate_residual, gate_surface
from dic.chain.remarks import facts_of, of_travel, speckle_settings_facts
from dic.chain.test_frame import fit_test_frame, outline_of, strains_of, surface_of, surface_of_flyer
from dic.images import Pictures
from dic.processes import background, background_pool
from dic.result import StereoResult
from dic.stereo.diagnose import check_setup
from dic.surfaces.surface_history import noise_floor

Result = TypeVar("Result")


class Clock:
    """Wall time of the stages."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        """Wall time of each finished stage, by its name [s]."""

    def __call__(self, stage: str, work: Callable[[], Result]) -> Result:
        """Run a stage and record its time. A stage that raises an exception has no time."""
        return self.of(stage, timed(work))

    def of(self, stage: str, timed_result: tuple[Result, float]) -> Result:
        """Record the time of a stage that was run by `timed`, and return its result."""
        result, self.seconds[stage] = timed_result
        return result


def timed(work: Callable[..., Result], *arguments: Any) -> tuple[Result, float]:
    """Result of a function, and its wall time [s]."""
    started = perf_counter()
    return work(*arguments), perf_counter() - started


VERSION = 22
"""Increased when a change of the code changes the numbers. Stored results are then recomputed."""


def _matched(inputs: Inputs, specimen: Region, flyer: Region | None) -> list[MatchedBody]:
    """The bodies that are tracked, the specimen first."""
    return [match_specimen(inputs, specimen), *([] if flyer is None else [match_flyer(inputs, flyer)])]


def measure(
    pictures: tuple[Pictures, Pictures],
    rig: StereoRig,
    settings: ChainSettings,
    *,
    t: FloatArray,
    static: BoolArray,
    specimen: Region,
    flyer: Region | None = None,
    facts: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
    inspection: Inspection | None = None,
) -> StereoResult:
    """Measure surfaces, outline and the flyer's displacement in two series of pictures.

    Parameters
    ----------
    pictures
        The series of camera 0 and camera 1, frame by frame at the same times.
    rig
        The cameras, for the cropped pictures of the series (`StereoRig.cropped`).
    settings
        What to measure, and how.
    t
        Frame times [s], shape [n_frames].
    static
        Static frames: specimen and flyer are at rest, shape [n_frames].
    specimen
        Region of the specimen.
    flyer
        Region of the flyer; None if the flyer is not measured.
    facts
        Further facts about the pictures, for the reporting table.
    progress
        Called as ``progress(stage, done, total)`` with the frames done.
    inspection
        Inspection of these pictures and static frames (`inspect_pictures`). None: `measure` inspects them.

    Returns
    -------
    StereoResult
        The result. Every frame or point that failed is kept, with an outcome that gives the reason.

    Raises
    ------
    ChainError
        If nothing can be measured. Examples: no static frame is usable, no point was matched between the
        cameras, or the points lie on no cylinder.
    """
    clock = Clock()
    inspection = inspection or inspect_pictures(pictures, static)
    clock.seconds["inspection of the pictures"] = inspection.seconds
    inputs = inspection.with_cameras(rig, settings, t, static)
    findings = clock("cameras", lambda: check_cameras(inputs, specimen))
    try:
        matched = clock("match between the cameras", lambda: _matched(inputs, specimen, flyer))
        body, *flyers = clock("tracking", lambda: follow(inputs, matched, progress))
        tracked_flyer = flyers[0] if flyers else None
        rest_state = clock("test frame", partial(fit_test_frame, inputs, body, tracked_flyer))
    except ChainError as error:
        causes = [*(f"{f.what} ({f.cure})" for f in findings), str(error)]
        raise ChainError("; ".join(causes)) from error
    placement, rest_frames = rest_state.placement, rest_state.frames
    works: list[Callable[[], Any]] = [
        partial(timed, translations_of, inputs, tracked_flyer, placement),
        partial(rim_in, inputs, tracked_flyer, placement),
        partial(timed, check_setup, rig, *body.reconstruction.pixels),
    ]
    with background_pool(works) as joined:
        gated = timed(gate_epipolar, inputs, body, rest_state)
        displacement, rim, checked = joined()
    in_time, body = clock.of("synchronisation of the cameras", checked), clock.of("gates", gated)
    before, past = clear_of_rim(inputs, tracked_flyer, placement, rim)
    narrower = None
    if flyer is not None and past > 0.0:
        narrower = clock("flyer again", partial(follow_before_rim, inputs, flyer, before, progress))
    if narrower is None:
        travel = clock.of("flyer's displacement", displacement)
    else:
        tracked_flyer, rim = narrower, rim_in(inputs, narrower, placement)
        travel = clock("flyer's displacement", partial(translations_of, inputs, tracked_flyer, placement))
    axial = displacement_of(inputs, tracked_flyer, placement, rim, travel)
    flyer_surface = surface_of_flyer(inputs, tracked_flyer, placement)
    with background(partial(timed, poses_of, inputs, tracked_flyer, placement, axial)) as motion_later:
        body = gate_ends(inputs, body, rest_state, axial)
        body = gate_residual(body)  # one at a time, because each holds a copy of all positions
        body = gate_surface(body, rest_state)
        surface, left_out = surface_of(inputs, body, placement, rest_frames)
        another_frame = remarks.of_material(body, specimen)
        del body  # its tracks take as much memory as all later stages
        centre, uncertain = outline_of(surface, settings)
        with background(partial(timed, speckle_settings_facts, inputs, surface, rest_frames)) as speckled:
            strain = clock("strains", lambda: strains_of(surface, settings))
            speckle = clock.of("speckles", speckled())
        motion, unposed = clock.of("flyer's poses", motion_later())
    by_fault = {finding.fault: finding for finding in (*in_time, *findings)}
    return StereoResult(
        t=t,
        frames=inputs.health,
        static=static,
        specimen=surface,
        flyer=flyer_surface,
        axial_displacement=axial,
        centre=centre,
        strain=strain,
        placement=placement,
        noise=noise_floor(surface.surface, static),
        remarks=(
            *remarks.of_findings(by_fault.values()),
            *remarks.of_edge(rest_state.edges),
            *remarks.of_flyer(flyer is not None, axial),
            *remarks.of_rim(past, narrower is not None),
            *of_travel(axial, surface),
            *unposed,
            *remarks.of_radius(placement, settings.radius),
            *remarks.of_missing_points(left_out),
            *remarks.of_uncertain_rows(uncertain, settings.largest_sigma),
            *remarks.of_frames(inputs.health),
            *another_frame,
        ),
        rig=rig,
        facts={**(facts or {}), **facts_of(inputs), "speckle": speckle},
        seconds=clock.seconds,
        motion=motion,
    )


__all__ = [
    "DIRECTIONS",
    "VERSION",
    "ChainError",
    "ChainSettings",
    "Inspection",
    "inspect_pictures",
    "measure",
]
