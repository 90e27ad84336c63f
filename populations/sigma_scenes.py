"""Random scenes for tests of standard deviations: a plane with one camera, a cylinder with two.

Every position has a closed form. Planes are rendered from a sum of Gaussians, cylinders by ray casting
(`speckle_pictures.py`). After frames at rest the surface is shifted as a rigid body, or stretched or
compressed by up to 20 %. Pictures have eight bits.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dic.basics import FloatArray
from dic.camera import StereoRig
from dic.correlation import Correlation, Shape
from populations.outlier_scenes import PIXEL, RADIUS, SHAPE, rig
from tests.helpers.speckle_pictures import RenderedCylinder, Speckles, render, speckle_pattern

WHITE = 255.0
STATIC, MOVED = 4, 4
"""Number of frames at rest, and of frames after them."""
LEVELS = (1.0, 2.0, 5.0)
"""Standard deviations of a grey value [grey]."""
KINDS = ("plane, shift", "plane, strain", "cylinder, shift", "cylinder, strain")
POPULATIONS = {"chosen": 11, "judged": 12}


@dataclass(frozen=True)
class SigmaScene:
    """One scene of a population."""

    kind: str
    """One of `KINDS`."""
    seed: int
    noise: float
    """Standard deviation of a grey value [grey]."""
    speckle: float
    """Size of the speckles [px]."""
    strain: float
    """Strain along the axis in the last frame [-]; 0 for a shift."""
    shifts: FloatArray
    """Shifts of the frames after those at rest [px], shape [MOVED, 3]."""
    angle: float
    """Angle between the cameras [rad]."""
    match: Correlation
    """Settings of the tracking."""
    stereo: Correlation
    """Settings of the match between the cameras."""

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return STATIC + MOVED

    @property
    def static(self) -> NDArray[np.bool_]:
        """Frames at rest, shape [n_frames]."""
        return np.arange(self.n_frames) < STATIC

    def stretch(self, k: int) -> float:
        """Length along the axis in frame `k` over that at rest [-]."""
        return 1.0 + self.strain * max(k - STATIC + 1, 0) / MOVED

    def shift(self, k: int) -> FloatArray:
        """Rigid shift in frame `k` [px], shape [3]."""
        return np.zeros(3) if k < STATIC or self.strain else self.shifts[k - STATIC]

    def place(self, X: FloatArray, k: int) -> FloatArray:
        """Positions in frame `k` of points that are at X at rest: [px], shape [n, 2] for a plane; [m], shape
        [n, 3] for a cylinder."""
        stretch = self.stretch(k)
        if self.kind.startswith("plane"):
            middle = 0.5 * (SHAPE[0] - 1)
            return (X - middle) * np.array([stretch**-0.5, stretch]) + middle + self.shift(k)[:2]
        return X * np.array([stretch**-0.5, stretch, stretch**-0.5]) + PIXEL * self.shift(k)

    def pictures(self) -> list[NDArray[np.uint8]]:
        """Grey values of one or two cameras, each of shape [n_frames, rows, columns]."""
        rng = np.random.default_rng([self.seed, 3])
        if self.kind.startswith("plane"):
            return [np.array([self._recorded(self._plane(k), rng) for k in range(self.n_frames)])]
        return [
            np.array([self._recorded(self._cylinder(camera, k), rng) for k in range(self.n_frames)])
            for camera in (0, 1)
        ]

    def _recorded(self, grey: FloatArray, rng: np.random.Generator) -> NDArray[np.uint8]:
        noisy = grey + self.noise * rng.standard_normal(grey.shape)
        return np.clip(np.rint(noisy), 0.0, WHITE).astype(np.uint8)

    def _plane(self, k: int) -> FloatArray:
        pattern = speckle_pattern(SHAPE, size=self.speckle, contrast=35.0, seed=self.seed)
        stretch, middle, shift = self.stretch(k), 0.5 * (SHAPE[0] - 1), self.shift(k)[:2]

        def material(x: FloatArray) -> FloatArray:
            return np.asarray((x - middle - shift) / np.array([stretch**-0.5, stretch]) + middle)

        return render(pattern, SHAPE, material=material)

    def _cylinder(self, camera: int, k: int) -> FloatArray:
        stretch = self.stretch(k)
        wider, speckles = stretch**-0.5, Speckles(0.8 * self.speckle * PIXEL, seed=self.seed)

        def pattern(arc: FloatArray, height: FloatArray) -> FloatArray:
            return speckles(arc / wider, height / stretch)

        seen_by = rig(self.angle).cameras[camera]
        moved = replace(seen_by, translation=seen_by.translation + PIXEL * seen_by.rotation @ self.shift(k))
        light = RenderedCylinder(RADIUS * wider).picture(moved, SHAPE, pattern, oversample=4)
        return 0.75 * WHITE * light

    @property
    def rig(self) -> StereoRig:
        """The cameras in front of a cylinder."""
        return rig(self.angle)


def drawn(population: str, number: int) -> SigmaScene:
    """Scene of a population: kinds and noises alternate, the other values are random."""
    rng = np.random.default_rng([POPULATIONS[population], number])
    kind = KINDS[number % len(KINDS)]
    level = LEVELS[(number // len(KINDS)) % len(LEVELS)]
    strain = float(rng.uniform(0.1, 0.2) * rng.choice([-1.0, 1.0]))
    subset = int(rng.choice([17, 21, 25]))
    shape = Shape.AFFINE if rng.uniform() < 0.5 else Shape.QUADRATIC
    return SigmaScene(
        kind=kind,
        seed=1000 * POPULATIONS[population] + number,
        noise=level,
        speckle=float(rng.uniform(4.0, 7.0)),
        strain=strain if kind.endswith("strain") else 0.0,
        shifts=rng.uniform(-2.0, 2.0, (MOVED, 3)),
        angle=float(rng.uniform(0.2, 0.5)),
        match=Correlation(subset=subset, shape=shape),
        stereo=Correlation(subset=subset, shape=Shape.QUADRATIC),
    )
