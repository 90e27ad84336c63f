"""Inspection of the pictures before anything is tracked: usable frames, noise of the grey values, fit of the
cameras."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from dic.arrays import BoolArray, FloatArray, IntArray
from dic.bodies.matched import material_frame
from dic.bodies.region import Region, grid_points, polygon_mask
from dic.camera import StereoRig
from dic.chain.settings import ChainError, ChainSettings
from dic.correlation import Noise
from dic.forks import beside, parts
from dic.images import PictureError, Pictures
from dic.images.health import frame_health
from dic.images.kept import kept
from dic.images.noise import GreyNoise, grey_noise
from dic.images.series import Grey
from dic.outcome import FrameOutcome
from dic.stereo.diagnose import Finding
from dic.stereo.setup_check import check_setup, free_pairs

MOST_SENT = 2**25
"""Pixels of a series that a fork reads and sends back: to send them takes a tenth of the time to decode them,
but they are held twice until they were taken over."""


@dataclass(frozen=True)
class Inputs:
    """Inputs of all stages: the pictures with their health and noise, the cameras, the times."""

    pictures: tuple[Pictures, Pictures]
    """The series of camera 0 and camera 1; small ones stay in memory once they were read."""
    rig: StereoRig
    """The cameras, for pictures with their crop."""
    settings: ChainSettings
    """Settings of the measurement."""
    t: FloatArray
    """Frame times [s], shape [n_frames]."""
    static: BoolArray
    """Frames in which specimen and flyer rest, shape [n_frames]."""
    health: tuple[IntArray, IntArray]
    """`FrameOutcome` of each camera's pictures, each of shape [n_frames]."""
    grey: tuple[GreyNoise, GreyNoise]
    """Noise of each camera's grey values."""

    @property
    def noise(self) -> tuple[Noise, Noise]:
        """The same as the matches take it."""
        return _line(self.grey[0]), _line(self.grey[1])


@dataclass(frozen=True)
class Inspection:
    """What the pictures say before their cameras are known."""

    pictures: tuple[Pictures, Pictures]
    """As of `Inputs`."""
    health: tuple[IntArray, IntArray]
    """As of `Inputs`."""
    grey: tuple[GreyNoise, GreyNoise]
    """As of `Inputs`."""
    seconds: float
    """Wall time that it took [s]."""


def inspect_pictures(pictures: tuple[Pictures, Pictures], static: BoolArray) -> Inspection:
    """Inspect every picture: its outcome, and the noise of each camera's grey values.

    Parameters
    ----------
    pictures
        The series of camera 0 and camera 1.
    static
        Frames in which specimen and flyer rest, shape [n_frames].

    Raises
    ------
    ChainError
        If there are not as many pictures as frame times, or a camera has fewer than two usable static
        pictures.
    """
    started = perf_counter()
    series = (kept(pictures[0]), kept(pictures[1]))

    def other() -> tuple[tuple[IntArray, GreyNoise], dict[int, Grey]]:
        return _inspect_one(1, series[1], static), dict(series[1].held)

    if parts() > 1 and series[1].n_frames * int(np.prod(series[1].shape)) <= MOST_SENT:
        with beside(other) as later:
            health0, grey0 = _inspect_one(0, series[0], static)
            (health1, grey1), read = later()
        series[1].hold(read)
    else:
        (health0, grey0), (health1, grey1) = (_inspect_one(k, series[k], static) for k in (0, 1))
    return Inspection(series, (health0, health1), (grey0, grey1), perf_counter() - started)


def inspect_images(
    pictures: tuple[Pictures, Pictures],
    rig: StereoRig,
    settings: ChainSettings,
    *,
    t: FloatArray,
    static: BoolArray,
    inspection: Inspection | None = None,
) -> Inputs:
    """Inputs of all stages, from pictures that are inspected here or were `inspection`.

    Raises
    ------
    ChainError
        As `inspect_pictures`.
    """
    found = inspect_pictures(pictures, static) if inspection is None else inspection
    return Inputs(found.pictures, rig, settings, t, static, found.health, found.grey)


def _inspect_one(camera: int, series: Pictures, static: BoolArray) -> tuple[IntArray, GreyNoise]:
    """Inspect the pictures of one camera."""
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
    try:
        return outcome, grey_noise(series, rest.tolist())
    except (PictureError, ValueError) as error:
        raise ChainError(f"camera {camera}: {error}") from error


def _line(grey: GreyNoise) -> Noise:
    """The straight line of the noise where that is one, else its mean."""
    if grey.intercept > 0.0 and grey.slope > 0.0:
        return Noise(floor=grey.intercept**0.5, gain=grey.slope)
    return Noise(floor=grey.sigma)


def check_cameras(inputs: Inputs, region: Region) -> tuple[Finding, ...]:
    """Findings about the cameras from a first pair of pictures, matched without their parameters.

    Raises
    ------
    ChainError
        If no frame has a usable picture of both cameras.
    """
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
