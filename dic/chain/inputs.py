"""Inputs of a measurement: settings, and the inspection of pictures and cameras before tracking."""

from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from dic.basics import BoolArray, FloatArray, IntArray
from dic.bodies.follow import material_frame
from dic.bodies.region import Region, grid_points, polygon_mask
from dic.camera import StereoRig
from dic.correlation import Correlation, Noise
from dic.correlation.subsets import Shape
from dic.images import PictureError, Pictures
from dic.images.health import FrameHealth, check_series, frame_health
from dic.images.quality import GreyNoise, grey_noise
from dic.images.series import decode_once
from dic.outcome import FrameOutcome
from dic.stereo.diagnose import Finding, check_setup, free_pairs
from dic.tracking import Tracking

DIRECTIONS = {"up": (0.0, -1.0), "down": (0.0, 1.0), "left": (-1.0, 0.0), "right": (1.0, 0.0)}
"""Directions in a picture (right, down)."""


class ChainError(ValueError):
    """No surface can be measured in the pictures; the text gives the reason and the remedy."""


@dataclass(frozen=True, kw_only=True)
class ChainSettings:
    """Settings of the measurement from pictures to surfaces."""

    toward_flyer: str
    """Direction to the flyer in the pictures of camera 0: a key of `DIRECTIONS`."""
    zero: tuple[float, float]
    """End of the specimen at the transmission platen in camera 0's first picture (x, y) [px]. An error of a
    pixel or two is allowed: the edge is located in both cameras' pictures."""
    strip_half_width: float
    """Points within this distance of the centre plane belong to the outline [m]."""
    radius: float | None = None
    """Radius of the undeformed specimen from another measurement, e.g. with a calliper [m]. The axis then
    lies at this distance behind the surface. None: the radius is estimated. Radius and axis are then less
    certain, because only part of the circumference is visible."""
    largest_sigma: float | None = None
    """Rows of the outline with a larger standard deviation are left out [m]; None: all rows are kept."""
    length: float | None = None
    """Length of the undeformed specimen [m]; with the flyer's displacement it gives the position of the upper
    end. None: points near the upper end are not checked against it."""
    length_sigma: float = 0.0
    """Standard deviation of `length` [m]."""
    step: int = 4
    """Distance of neighbouring points [px]."""
    margin: float = 2.0
    """Smallest distance of a point from the boundary of its region [px]."""
    strain_window: int = 5
    """Side of the window of points for a strain fit; odd."""
    tracking: Tracking = field(default_factory=Tracking)
    """Settings of the tracking in time."""
    stereo: Correlation = field(default_factory=lambda: Correlation(shape=Shape.QUADRATIC))
    """Settings of the match between the cameras."""
    device: str = "cpu"

    @property
    def subset(self) -> int:
        """Side of the tracked subsets [px]."""
        return self.tracking.correlation.subset

    @property
    def rigid(self) -> Tracking:
        """Settings of the flyer's tracking: its points only translate, and may enter the picture at the
        border."""
        subset = replace(self.tracking.correlation, shape=Shape.RIGID, least_pixels=0.4)
        return replace(self.tracking, correlation=subset)

    @property
    def direction(self) -> tuple[float, float]:
        """Direction from the specimen to the flyer in the pictures of camera 0 (right, down)."""
        return DIRECTIONS[self.toward_flyer]

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
            ("length_sigma", self.length_sigma >= 0.0, "a length in metres, not negative"),
            ("step", self.step >= 1, "at least 1 px"),
            ("margin", self.margin >= 0.0, "not negative"),
            ("strain_window", self.strain_window >= 3 and self.strain_window % 2 == 1, "odd, at least 3"),
        )
        for name, fine, allowed in checks:
            if not fine:
                raise ValueError(f"{name} must be {allowed}, got {getattr(self, name)}")


@dataclass(frozen=True)
class Inputs:
    """Inputs of all stages: the pictures with their health and noise, the cameras, the times."""

    pictures: tuple[Pictures, Pictures]
    """The series of camera 0 and camera 1; small series stay in memory after the first reading."""
    rig: StereoRig
    """The cameras, for the cropped pictures."""
    settings: ChainSettings
    t: FloatArray
    """Frame times [s], shape [n_frames]."""
    static: BoolArray
    """Static frames: specimen and flyer are at rest, shape [n_frames]."""
    health: tuple[IntArray, IntArray]
    """`FrameOutcome` of each camera's pictures, each of shape [n_frames]."""
    grey: tuple[GreyNoise, GreyNoise]
    """Noise of each camera's grey values."""

    @property
    def noise(self) -> tuple[Noise, Noise]:
        """Noise of both cameras in the form that the matches use."""
        return _line(self.grey[0]), _line(self.grey[1])


@dataclass(frozen=True)
class Inspection:
    """Results of the inspection of the pictures, which does not need the cameras."""

    pictures: tuple[Pictures, Pictures]
    """Pictures of both cameras, see `Inputs`."""
    health: tuple[IntArray, IntArray]
    """Health of their frames, see `Inputs`."""
    grey: tuple[GreyNoise, GreyNoise]
    """Noise of their grey values, see `Inputs`."""
    seconds: float
    """Wall time of the inspection [s]."""

    def with_cameras(
        self, rig: StereoRig, settings: ChainSettings, t: FloatArray, static: BoolArray
    ) -> Inputs:
        """Inputs of all stages."""
        return Inputs(self.pictures, rig, settings, t, static, self.health, self.grey)


def inspect_pictures(
    pictures: tuple[Pictures, Pictures],
    static: BoolArray,
    health: tuple[FrameHealth | None, FrameHealth | None] = (None, None),
) -> Inspection:
    """Inspect every picture: its outcome, and the noise of each camera's grey values.

    ``pictures``: the series of camera 0 and camera 1. ``static``: frames in which specimen and flyer are at
    rest, shape [n_frames]. ``health``: `frame_health` of both series, if known. Raises ChainError if there
    are not as many pictures as frame times, or a camera has fewer than two usable static pictures.
    """
    started = perf_counter()
    series = (decode_once(pictures[0]), decode_once(pictures[1]))
    (health0, grey0), (health1, grey1) = (_inspect_one(k, series[k], static, health[k]) for k in (0, 1))
    return Inspection(series, (health0, health1), (grey0, grey1), perf_counter() - started)


def _inspect_one(
    camera: int, series: Pictures, static: BoolArray, health: FrameHealth | None
) -> tuple[IntArray, GreyNoise]:
    """Inspect the pictures of one camera."""
    if series.n_frames != static.size:
        raise ChainError(
            f"camera {camera} has {series.n_frames} pictures, there are {static.size} frame times"
        )
    health = health or frame_health(series)
    try:
        check_series(series, health)
    except PictureError as error:
        raise ChainError(f"camera {camera}: {error}") from error
    outcome = health.outcome
    rest_frames = np.flatnonzero(static & (outcome == FrameOutcome.VALID))
    if rest_frames.size < 2:
        raise ChainError(
            f"camera {camera} has {rest_frames.size} usable static pictures, needs 2 or more: export those "
            "before the test too, or look at their exposure"
        )
    try:
        return outcome, grey_noise(series, rest_frames.tolist())
    except (PictureError, ValueError) as error:
        raise ChainError(f"camera {camera}: {error}") from error


def _line(grey: GreyNoise) -> Noise:
    """The straight line of variance over grey value if the noise has one; otherwise the mean variance."""
    if grey.intercept > 0.0 and grey.slope > 0.0:
        return Noise(floor=grey.intercept**0.5, gain=grey.slope)
    return Noise(floor=grey.sigma)


def check_cameras(inputs: Inputs, region: Region) -> tuple[Finding, ...]:
    """Findings about the cameras from a first pair of pictures, matched without the camera parameters."""
    pictures, settings, health = inputs.pictures, inputs.settings, inputs.health
    try:
        frame = material_frame(health, region.frame)
    except ValueError as error:
        raise ChainError(str(error)) from error
    mask = polygon_mask(region.corners, pictures[0].shape)
    points, _ = grid_points(mask, settings.step, margin=settings.margin)
    pair = (pictures[0].frame(frame), pictures[1].frame(frame))
    pixels = free_pairs(
        pair, points, settings.tracking, noise=inputs.noise[1], mask=mask, device=settings.device
    )
    return check_setup(inputs.rig, *pixels)
