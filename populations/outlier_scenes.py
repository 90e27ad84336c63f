"""Random scenes for the outlier gates: two cameras in front of a compressed specimen, with defects in the
pictures.

A cylindrical specimen is shortened uniformly at constant volume and rendered by ray casting
(`speckle_pictures.py`). The position of every material point has a closed form. One defect is a highlight
that moves over the surface, at a different position for each camera. The other is paint that is missing from
a frame on.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.basics import FloatArray
from dic.bodies.follow import TrackedBody, follow_bodies, match_body
from dic.bodies.region import Region
from dic.camera import Camera, StereoRig
from dic.correlation import Correlation, Noise, Shape
from dic.images.series import PicturesInMemory
from dic.outcome import FrameOutcome
from dic.tracking import Tracking
from tests.helpers.speckle_pictures import RenderedCylinder, Speckles, facing

SHAPE = (112, 112)
RADIUS = 4.75e-3
DISTANCE = 0.305
PIXEL = 56e-6
"""Length of a pixel on the specimen [m]."""
RIM = 8.0
"""Distance of the tracked region from the border of the picture [px]."""
WHITE = 4095.0
"""Largest grey value."""


@dataclass(frozen=True)
class Spoiled:
    """Defects in the pictures of a scene; 0: no defect."""

    height: float = 0.0
    """Brightness of the highlight over that of white paint [-]."""
    size: float = 6.0
    """Its standard deviation [px]."""
    pace: float = 3.0
    """Its motion from frame to frame [px]."""
    lost: float = 0.0
    """Radius of the missing paint [m]."""
    lost_from: int = 6
    """First frame without this paint."""
    bare: float = 0.5
    """Reflectance of the surface below the paint [-]."""


@dataclass(frozen=True)
class OutlierScene:
    """One scene of a population."""

    seed: int
    spoiled: Spoiled
    noise: float
    """Standard deviation of a grey value [grey]."""
    shortening: float
    """Relative shortening of the specimen in the last frame [-]."""
    angle: float
    """Angle between the cameras [rad]."""
    n_static: int = 4
    n_frames: int = 14

    def stretch(self, k: int) -> float:
        """Height of the specimen in frame `k` over that at rest [-]."""
        moved = max(k - self.n_static + 1, 0) / (self.n_frames - self.n_static)
        return 1.0 - self.shortening * moved

    def place(self, X: FloatArray, k: int) -> FloatArray:
        """Positions in frame `k` of the points that are at X at rest [m], shape [n, 3]."""
        stretch = self.stretch(k)
        return X * np.array([stretch**-0.5, stretch, stretch**-0.5])

    def pictures(self) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
        """Grey values of both cameras, each of shape [n_frames, rows, columns]."""
        rng = np.random.default_rng([self.seed, 1])
        highlight = _path(self, rng)
        lost = RADIUS * rng.uniform(-0.5, 0.5), PIXEL * rng.uniform(-30.0, 30.0)
        speckles = Speckles(4.5 * PIXEL, seed=self.seed)
        series = []
        for camera, at in zip(rig(self.angle).cameras, highlight, strict=True):
            frames = [self._picture(camera, k, at[k], lost, speckles, rng) for k in range(self.n_frames)]
            series.append(np.array(frames))
        return series[0], series[1]

    def _picture(
        self,
        camera: Camera,
        k: int,
        at: FloatArray,
        lost: tuple[float, float],
        speckles: Speckles,
        rng: np.random.Generator,
    ) -> NDArray[np.uint16]:
        stretch, spoiled = self.stretch(k), self.spoiled
        wider = stretch**-0.5

        def pattern(arc: FloatArray, height: FloatArray) -> FloatArray:
            around, along = arc / wider, height / stretch
            grey = speckles(around, along)
            if spoiled.lost > 0.0 and k >= spoiled.lost_from:
                off = np.hypot(around - lost[0], along - lost[1]) - spoiled.lost
                grey = np.where(off < 0.0, spoiled.bare, grey)
            return grey

        light = RenderedCylinder(RADIUS * wider).picture(camera, SHAPE, pattern, oversample=3)
        x, y = np.meshgrid(np.arange(SHAPE[1]), np.arange(SHAPE[0]))
        glare = np.exp(-0.5 * ((x - at[0]) ** 2 + ((y - at[1]) / 2.0) ** 2) / spoiled.size**2)
        grey = 0.6 * WHITE * (light + spoiled.height * glare) + self.noise * rng.standard_normal(SHAPE)
        return np.clip(np.rint(grey), 0.0, WHITE).astype(np.uint16)


def _path(scene: OutlierScene, rng: np.random.Generator) -> list[FloatArray]:
    """Positions of the highlight in both cameras' pictures [px], each of shape [n_frames, 2]."""
    begin, way = rng.uniform(25.0, 87.0, 2), rng.uniform(0.0, 2.0 * np.pi)
    step = scene.spoiled.pace * np.array([np.cos(way), np.sin(way)])
    first = begin + np.arange(scene.n_frames)[:, None] * step
    apart = rng.uniform(-12.0, 12.0)  # its position on the surface differs between the cameras
    return [first, first + np.array([apart, 0.0])]


def rig(angle: float) -> StereoRig:
    """Cameras on both sides of the line of sight to the axis."""
    return facing(angle, DISTANCE, (DISTANCE - RADIUS) / PIXEL, SHAPE)


def drawn(population: str, seed: int) -> OutlierScene:
    """Scene number `seed` of a population, "tuned" or "judged". Of four scenes one has a highlight, one has
    missing paint, one has both and one has no defect."""
    rng = np.random.default_rng([{"tuned": 1, "judged": 2}[population], seed])
    kind = seed % 4
    spoiled = Spoiled(
        height=float(rng.uniform(0.2, 1.5)) if kind in (0, 2) else 0.0,
        size=float(rng.uniform(2.5, 9.0)),
        pace=float(rng.uniform(0.5, 5.0)),
        lost=float(rng.uniform(3.0, 9.0)) * PIXEL if kind in (1, 2) else 0.0,
        lost_from=int(rng.integers(4, 10)),
        bare=float(rng.uniform(0.1, 0.9)),
    )
    return OutlierScene(
        seed=1000 * {"tuned": 1, "judged": 2}[population] + seed,
        spoiled=spoiled,
        noise=float(rng.uniform(15.0, 60.0)),
        shortening=float(rng.uniform(0.1, 0.45)),
        angle=float(rng.uniform(0.18, 0.5)),
    )


def followed(scene: OutlierScene, *, device: str = "cpu") -> TrackedBody:
    """The specimen of a scene tracked through both series, in the cameras' frame, which is the test frame."""
    first, second = (PicturesInMemory(grey, bits=12) for grey in scene.pictures())
    match, stereo = Correlation(subset=21), Correlation(subset=21, shape=Shape.QUADRATIC)
    noise = Noise(scene.noise), Noise(scene.noise)
    return track_body((first, second), rig(scene.angle), match, stereo, noise, step=4, device=device)


def track_body(
    series: tuple[PicturesInMemory, PicturesInMemory],
    cameras: StereoRig,
    match: Correlation,
    stereo: Correlation,
    noise: tuple[Noise, Noise],
    *,
    step: int,
    device: str,
) -> TrackedBody:
    """The body in the pictures inside `RIM`, a point every `step` pixels, tracked through both series."""
    last = SHAPE[0] - 1 - RIM
    fine = np.full(series[0].n_frames, int(FrameOutcome.VALID), dtype=np.int64)
    matched = match_body(
        series,
        cameras,
        Region(((RIM, RIM), (last, RIM), (last, last), (RIM, last)), 0),
        step=step,
        margin=2.0,
        tracking=Tracking(correlation=match),
        stereo=stereo,
        noise=noise,
        health=(fine, fine),
        device=device,
    )
    return follow_bodies([matched], cameras, stereo)[0]
