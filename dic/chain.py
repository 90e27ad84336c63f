"""From two series of pictures and their cameras to surfaces: the whole way, in the order of the work."""

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic import remarks
from dic.bodies import Followed, Progress, Region, follow_body
from dic.body_motion import BodyMotion
from dic.camera import StereoRig
from dic.correlation import Correlation, Noise
from dic.correlation.warp import Shape
from dic.ends import past_the_ends, refined_end
from dic.images import PictureError, Pictures
from dic.images.health import frame_health
from dic.images.kept import kept
from dic.images.noise import GreyNoise, grey_noise
from dic.noise import noise_floor
from dic.outcome import FrameOutcome, PointOutcome
from dic.poses import flyer_poses
from dic.region import grid_points, polygon_mask
from dic.result import Body, Placement, StereoResult, SurfaceStrain, Travel
from dic.setup_check import check_setup, free_pairs
from dic.smoothness import off_surface
from dic.speckle_report import facts as speckle_facts
from dic.speckle_report import speckles
from dic.stereo import reconstruct
from dic.stereo.diagnose import Finding
from dic.surface import CentrePoints
from dic.surfaces import (
    fit_cylinder,
    on_cylinder,
    overlap_factor,
    referenced,
    static_mean,
    test_frame,
    to_surface,
)
from dic.surfaces.outline import outline
from dic.surfaces.strains import StrainGauge, strains
from dic.tracking import Tracking
from dic.travel import flyer_travel

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

VERSION = 9
"""Raised when the same pictures and settings give other numbers: results kept from before are made
anew."""
LEAST_GATE = 0.1
"""Smallest gate for epipolar distances [px]."""
GATE_SIGMAS = 6.0
"""The gate in standard deviations of the epipolar distances at rest."""
MOST_AVERAGED = 50
"""Static pictures that are averaged to find the specimen's edge."""
OWN_SIGMAS = 4.0
"""And in standard deviations of the point's own."""
DIRECTIONS = {"up": (0.0, -1.0), "down": (0.0, 1.0), "left": (-1.0, 0.0), "right": (1.0, 0.0)}
"""Directions in a picture (right, down)."""


@dataclass(frozen=True, kw_only=True)
class ChainSettings:
    """What the chain must be told, and how it matches."""

    toward_flyer: str
    """Where the flyer lies in the pictures of camera 0: a key of `DIRECTIONS`."""
    zero: tuple[float, float]
    """Where the specimen ends at the transmission platen in camera 0's first picture (x, y), to a pixel
    or two [px]: the edge is then found in both cameras' pictures."""
    strip_half_width: float
    """Points within this distance of the centre plane are its outline [m]."""
    radius: float | None = None
    """Radius of the specimen at rest, if it was measured otherwise [m]: the axis then lies by so much behind
    the surface. From the part of the circumference that is seen, a free radius and the place of the axis are
    known less well. None: free."""
    largest_sigma: float | None = None
    """Rows of the outline that are known less well than this are left out of it [m]; None: none."""
    length: float | None = None
    """Length of the specimen at rest [m]: with the flyer's travel it says where the specimen ends. None:
    points near that end are not judged by it."""
    step: int = 4
    """Distance of neighbouring points [px]."""
    margin: float = 2.0
    """Least distance of a point from its region's rim [px]."""
    strain_window: int = 5
    """Side of the window of points that a strain is fitted to; odd."""
    tracking: Tracking = field(default_factory=Tracking)
    """How points are followed in time."""
    stereo: Correlation = field(default_factory=lambda: Correlation(shape=Shape.QUADRATIC))
    """How points are matched between the cameras."""
    device: str = "cpu"
    """Where pictures are correlated."""

    @property
    def rigid(self) -> Tracking:
        """How points of the flyer are followed: they translate, and enter the picture from its rim."""
        subset = replace(self.tracking.correlation, shape=Shape.RIGID, least_pixels=0.4)
        return replace(self.tracking, correlation=subset)

    def __post_init__(self) -> None:
        checks = (
            ("toward_flyer", self.toward_flyer in DIRECTIONS, f"one of {', '.join(DIRECTIONS)}"),
            ("strip_half_width", self.strip_half_width > 0.0, "a positive length in metres"),
            ("radius", self.radius is None or self.radius > 0.0, "a positive length in metres, or None"),
            (
                "largest_sigma",
                self.largest_sigma is None or self.largest_sigma > 0.0,
                "a positive length in metres, or None",
            ),
            ("length", self.length is None or self.length > 0.0, "a positive length in metres, or None"),
            ("step", self.step >= 1, "at least 1 px"),
            ("margin", self.margin >= 0.0, "not negative"),
            ("strain_window", self.strain_window >= 3 and self.strain_window % 2 == 1, "odd, at least 3"),
        )
        for name, fine, allowed in checks:
            if not fine:
                raise ValueError(f"{name} must be {allowed}, got {getattr(self, name)}")


class ChainError(ValueError):
    """Pictures from which no surface can be had; the text says why and what to do."""


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
) -> StereoResult:
    """Surfaces, outline and the flyer's travel from two series of pictures.

    Parameters
    ----------
    pictures
        The series of camera 0 and camera 1, frame by frame at the same times.
    rig
        The cameras, for pictures with the crop of the series (`StereoRig.cropped`).
    settings
        What to measure, and how.
    t
        Frame times [s], shape [n_frames].
    static
        Frames in which specimen and flyer rest, shape [n_frames].
    specimen
        Where the specimen is.
    flyer
        Where the flyer is; None if it is not to be measured.
    facts
        What else is known about the pictures, for the reporting table.
    progress
        Told of the frames done, stage by stage.

    Returns
    -------
    StereoResult
        A frame or point that failed has an outcome in it; nothing is left out in silence.

    Raises
    ------
    ChainError
        If nothing can be measured: no usable static frame, no point matched between the cameras, points that
        lie on no cylinder.
    """
    clock = _Clock()
    pictures = (kept(pictures[0]), kept(pictures[1]))
    health, grey = clock("look at the pictures", lambda: _look(pictures, static))
    noise = (_noise(grey[0]), _noise(grey[1]))

    def follow(region: Region, name: str, tracking: Tracking, *, rigid: bool = False) -> Followed:
        return follow_body(
            pictures,
            rig,
            region,
            step=settings.step,
            margin=settings.margin,
            tracking=tracking,
            stereo=settings.stereo,
            noise=noise,
            health=health,
            rigid=rigid,
            device=settings.device,
            name=name,
            progress=progress,
        )

    findings = clock("cameras", lambda: _check(pictures, rig, specimen, settings, noise, health))
    with ThreadPoolExecutor(1) as beside:  # the flyer's work waits for the specimen in two places only
        moving = None
        if flyer is not None:
            moving = beside.submit(
                clock, "flyer", partial(follow, flyer, "flyer", settings.rigid, rigid=True)
            )
        try:
            body = clock("specimen", lambda: follow(specimen, "specimen", settings.tracking))
            placement, rest, edges = clock(
                "test frame", lambda: _place(body, pictures, rig, settings, static)
            )
        except ChainError as error:
            said = [*(f"{f.what} ({f.cure})" for f in findings), str(error)]
            raise ChainError("; ".join(said)) from error
        followed = None if moving is None else moving.result()
        flying = beside.submit(
            clock,
            "flyer's travel",
            lambda: _travel(followed, pictures, rig, placement, settings, t, static),
        )
        in_time = clock("steps of the cameras", lambda: check_setup(rig, *body.reconstruction.pixels))
        gated = _gated(body, rig, rest)
        flyer_body = None if followed is None else _surface(followed, placement, t, [followed.material])[0]
        travel = flying.result()
        posing = beside.submit(
            clock,
            "flyer's poses",
            lambda: _poses(followed, rig, placement, settings, travel, static),
        )
        body = _inside(gated, rig, placement, settings, t, travel, rest)
        surface, left_out = _surface(body, placement, t, rest)
        subset = settings.tracking.correlation.subset
        centre = outline(surface.surface, surface.points, half_width=settings.strip_half_width, subset=subset)
        centre, uncertain = _certain(centre, settings.largest_sigma)
        strain = clock("strains", lambda: _strains(surface, settings))
        motion, unposed = posing.result()
    found = {finding.fault: finding for finding in (*in_time, *findings)}
    return StereoResult(
        t=t,
        frames=health,
        static=static,
        specimen=surface,
        flyer=flyer_body,
        travel=travel,
        centre=centre,
        strain=strain,
        placement=placement,
        noise=noise_floor(surface.surface, static),
        remarks=(
            *remarks.of_findings(found.values()),
            *remarks.of_edge(edges),
            *remarks.of_flyer(flyer is not None, travel),
            *unposed,
            *remarks.of_radius(placement, settings.radius),
            *remarks.of_missing_points(left_out),
            *remarks.of_uncertain_rows(uncertain, settings.largest_sigma),
            *remarks.of_frames(health),
            *remarks.of_material(body, specimen),
        ),
        rig=rig,
        facts={
            **(facts or {}),
            **_facts(pictures, settings, (grey[0].sigma, grey[1].sigma)),
            "speckle": clock("speckles", lambda: _speckles(surface, pictures, settings, grey, rest)),
        },
        seconds=clock.seconds,
        motion=motion,
    )


def _speckles(
    body: Body,
    pictures: tuple[Pictures, Pictures],
    settings: ChainSettings,
    grey: tuple[GreyNoise, GreyNoise],
    rest: list[int],
) -> list[dict[str, Any]]:
    """The speckle report of both cameras; where there can be none, why."""
    found: list[dict[str, Any]] = []
    for series, noise, pixels in zip(pictures, grey, body.pixels, strict=True):
        try:
            judged = speckles(
                series, rest, noise, pixels[rest[0]], subset=settings.tracking.correlation.subset
            )
        except (PictureError, ValueError) as error:
            found.append({"problem": str(error)})
        else:
            found.append(speckle_facts(judged.quality))
    return found


def _travel(
    body: Followed | None,
    pictures: tuple[Pictures, Pictures],
    rig: StereoRig,
    placement: Placement,
    settings: ChainSettings,
    t: FloatArray,
    static: BoolArray,
) -> Travel | None:
    """How far the flyer went, if there is one."""
    if body is None:
        return None
    subset = settings.rigid.correlation.subset
    return flyer_travel(body, rig, placement.frame, t, static, subset=subset, pictures=pictures)


def _poses(
    body: Followed | None,
    rig: StereoRig,
    placement: Placement,
    settings: ChainSettings,
    travel: Travel | None,
    static: BoolArray,
) -> tuple[BodyMotion | None, list[remarks.Remark]]:
    """The flyer's rigid motion, if there is a flyer and its travel is known."""
    if body is None or travel is None:
        return None, []
    return flyer_poses(
        body,
        rig,
        placement.frame,
        travel,
        static,
        subset=settings.rigid.correlation.subset,
        length=settings.length,
    )


def _check(
    pictures: tuple[Pictures, Pictures],
    rig: StereoRig,
    region: Region,
    settings: ChainSettings,
    noise: tuple[Noise, Noise],
    health: tuple[IntArray, IntArray],
) -> tuple[Finding, ...]:
    """What a first pair of pictures says of the cameras, found without their parameters."""
    usable = np.flatnonzero((health[0] == FrameOutcome.VALID) & (health[1] == FrameOutcome.VALID))
    if usable.size == 0:
        raise ChainError("no frame has a usable picture of both cameras")
    frame = int(usable[np.argmin(np.abs(usable - region.frame))])
    mask = polygon_mask(region.corners, pictures[0].shape)
    points, _ = grid_points(mask, settings.step, margin=settings.margin)
    pair = (pictures[0].frame(frame), pictures[1].frame(frame))
    pixels = free_pairs(pair, points, settings.tracking, noise=noise[1], mask=mask, device=settings.device)
    return check_setup(rig, *pixels)


def _strains(surface: Body, settings: ChainSettings) -> SurfaceStrain:
    """Green-Lagrange strains of the specimen over the declared window."""
    gauge = StrainGauge(
        window=settings.strain_window, step=settings.step, subset=settings.tracking.correlation.subset
    )
    history = strains(surface.surface, surface.points, gauge)
    measured = history.green_lagrange
    return SurfaceStrain(
        value=measured.value, sigma=measured.sigma, outcome=history.outcome, gauge=history.gauge
    )


def _certain(line: CentrePoints, largest: float | None) -> tuple[CentrePoints, int]:
    """The outline without rows of larger sigma, and how many those were."""
    if largest is None:
        return line, 0
    fine = line.sigma <= largest
    kept = {name: getattr(line, name)[fine] for name in ("t", "frame", "y", "Z", "sigma")}
    return replace(line, **kept), int(np.sum(~fine))


class _Clock:
    """Wall time of the stages."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def __call__(self, stage: str, work: Any) -> Any:
        started = perf_counter()
        result = work()
        self.seconds[stage] = perf_counter() - started
        return result


def _look(
    pictures: tuple[Pictures, Pictures], static: BoolArray
) -> tuple[tuple[IntArray, IntArray], tuple[GreyNoise, GreyNoise]]:
    """Outcome of every picture, and the noise of each camera's grey values."""
    outcomes, noise = [], []
    for camera, series in enumerate(pictures):
        if series.n_frames != static.size:
            raise ChainError(
                f"camera {camera} has {series.n_frames} pictures, there are {static.size} frame times"
            )
        outcome = frame_health(series).outcome
        rest = np.flatnonzero(static & (outcome == FrameOutcome.VALID))
        if rest.size < 2:
            raise ChainError(
                f"camera {camera} has {rest.size} usable static pictures, needs 2 or more: export those "
                "before the test too, or look at their exposure"
            )
        outcomes.append(outcome)
        try:
            noise.append(grey_noise(series, rest.tolist()))
        except (PictureError, ValueError) as error:
            raise ChainError(f"camera {camera}: {error}") from error
    return (outcomes[0], outcomes[1]), (noise[0], noise[1])


def _noise(grey: GreyNoise) -> Noise:
    """The straight line of the noise where that is one, else its mean."""
    if grey.intercept > 0.0 and grey.slope > 0.0:
        return Noise(floor=grey.intercept**0.5, gain=grey.slope)
    return Noise(floor=grey.sigma)


def _place(
    body: Followed,
    pictures: tuple[Pictures, Pictures],
    rig: StereoRig,
    settings: ChainSettings,
    static: BoolArray,
) -> tuple[Placement, list[int], int]:
    """The test frame from the specimen at rest, the static frames that both cameras saw, edges found."""
    r = body.reconstruction
    rest = np.flatnonzero(static & np.any(r.outcome == PointOutcome.VALID, axis=1)).tolist()
    if not rest:
        failed = [f"{gate.name} {count}" for gate, count in body.stereo.count().items() if count]
        raise ChainError(
            f"no point of the specimen was found by both cameras at rest; of {len(body.points)} points the "
            f"match between the cameras failed by {', '.join(failed)}: check the calibration, the crop "
            "offsets and which camera is which"
        )
    position, covariance = static_mean(r, rest)
    known = np.isfinite(position).all(axis=1)
    try:
        overlap = overlap_factor(body.points[known], settings.tracking.correlation.subset)
        free = fit_cylinder(position[known], covariance[known], overlap=overlap)
        cylinder = free
        if settings.radius is not None:
            cylinder = fit_cylinder(
                position[known], covariance[known], overlap=overlap, radius=settings.radius
            )
        toward = DIRECTIONS[settings.toward_flyer]
        declared = on_cylinder(rig.cameras[0], settings.zero, cylinder)
        means = [_mean_picture(series, rest) for series in pictures]
        zero, zero_sigma, edges = refined_end((means[0], means[1]), rig, cylinder, declared, toward)
        frame = test_frame(cylinder, rig, toward_flyer=toward, zero=zero, zero_sigma=zero_sigma)
    except ValueError as error:
        raise ChainError(f"the specimen at rest gives no test frame: {error}") from error
    return (
        Placement(
            frame=frame,
            radius=free.radius,
            radius_sigma=float(free.sigma[4]),
            rms=cylinder.rms,
            chi2_per_dof=cylinder.chi2_per_dof,
            n_points=int(cylinder.used.sum()),
        ),
        rest,
        edges,
    )


def _mean_picture(pictures: Pictures, frames: list[int]) -> FloatArray:
    """The mean of some static pictures, at most `MOST_AVERAGED`."""
    chosen = frames[:MOST_AVERAGED]
    total = np.zeros(pictures.shape)
    for frame in chosen:
        total += pictures.frame(frame)
    return total / len(chosen)


def _gated(body: Followed, rig: StereoRig, rest: list[int]) -> Followed:
    """The body with the epipolar gate that its own static frames ask for."""
    r = body.reconstruction
    at_rest = r.epipolar[rest][r.outcome[rest] == PointOutcome.VALID]
    gate = max(LEAST_GATE, GATE_SIGMAS * float(np.median(np.abs(at_rest))) / 0.6745)
    return replace(
        body,
        reconstruction=reconstruct(rig, *body.tracks, gate=gate, gate_sigmas=OWN_SIGMAS, common=body.common),
    )


def _inside(
    body: Followed,
    rig: StereoRig,
    placement: Placement,
    settings: ChainSettings,
    t: FloatArray,
    travel: Travel | None,
    rest: list[int],
) -> Followed:
    """The body without points whose subset reaches past an end, and without those off the surface."""
    upper = np.full(t.size, np.nan)
    if settings.length is not None and travel is not None and travel.t.size:
        upper = settings.length - np.interp(t, travel.t, travel.displacement)
    past = past_the_ends(
        body,
        rig.cameras[0],
        placement.frame,
        settings.tracking.correlation.subset,
        DIRECTIONS[settings.toward_flyer],
        (np.zeros(t.size), upper),
    )
    body = _without(body, past, PointOutcome.AT_END)
    r = body.reconstruction
    variance = np.einsum("...ii->...i", placement.frame.covariances(r.covariance))
    # Against the cylinder: its own curvature is none of the surface through a few neighbours.
    at_rest = placement.frame.positions(static_mean(r, rest)[0])
    depth = np.sqrt(np.maximum(placement.radius**2 - at_rest[:, 0] ** 2, 0.0))
    cylinder = np.stack([at_rest[:, 0], at_rest[:, 1], depth], axis=1)
    off = off_surface(
        placement.frame.positions(r.position) - cylinder,
        np.sqrt(variance),
        np.asarray(r.outcome == PointOutcome.VALID) & np.isfinite(cylinder).all(axis=1),
        body.cell,
    )
    return _without(body, off, PointOutcome.OFF_SURFACE)


def _without(body: Followed, points: BoolArray, outcome: PointOutcome) -> Followed:
    """The body with some points of some frames ended."""
    r, gone = body.reconstruction, points[..., None]
    return replace(
        body,
        reconstruction=replace(
            r,
            position=np.where(gone, np.nan, r.position),
            covariance=np.where(gone[..., None], np.nan, r.covariance),
            outcome=np.where(points, int(outcome), r.outcome),
        ),
    )


def _surface(
    body: Followed, placement: Placement, t: FloatArray, reference: list[int]
) -> tuple[Body, IntArray]:
    """The points of a body that have a place at rest, and the outcomes of those that have none."""
    r = body.reconstruction
    kept = referenced(r, reference)
    surface = to_surface(r, placement.frame, t, reference=reference, points=kept)
    sigma = [np.sqrt(0.5 * np.trace(track.covariance[:, kept], axis1=2, axis2=3)) for track in body.tracks]
    return (
        Body(
            surface=surface,
            pixels=(r.pixels[0][:, kept], r.pixels[1][:, kept]),
            match_sigma=(sigma[0], sigma[1]),
            zncc=(body.tracks[0].zncc[:, kept], body.tracks[1].zncc[:, kept]),
            epipolar=r.epipolar[:, kept],
            points=body.points[kept],
            cell=body.cell[kept],
        ),
        r.outcome[body.material, ~kept],
    )


def _facts(
    pictures: tuple[Pictures, Pictures], settings: ChainSettings, noise: tuple[float, float]
) -> dict[str, Any]:
    """Settings and facts for the reporting table, as JSON can hold them."""
    subset = settings.tracking.correlation
    return {
        "pictures": {
            "shape": list(pictures[0].shape),
            "bits": pictures[0].bits,
            "crop_offset": [list(series.crop_offset) for series in pictures],
            "noise_grey": list(noise),
        },
        "settings": {
            "subset": subset.subset,
            "step": settings.step,
            "strain_window": settings.strain_window,
            "prefilter": subset.prefilter,
            "shape": subset.shape.name.lower(),
            "stereo_shape": settings.stereo.shape.name.lower(),
            "criterion": "ZNSSD, inverse-compositional Gauss-Newton",
            "interpolant": "quintic B-spline",
            "reference": "a point's own earlier picture, renewed where its correlation or stretch asks "
            "for it",
            "strip_half_width_m": settings.strip_half_width,
            "toward_flyer": settings.toward_flyer,
            "zero_px": list(settings.zero),
        },
    }
