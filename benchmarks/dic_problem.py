"""Pictures of the `dic` benchmark: pairs of 512² px with a known motion, and the errors of a measurement."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.helpers.speckle_pictures import render, speckle_pattern

FloatArray = NDArray[np.float64]

SIDE, STEP, SUBSET, MARGIN = 512, 5, 21, 30
"""Picture, distance of points, subset and margin without points [px]."""
SIGMA = 2.0
"""Noise of a grey value [grey]."""
OFF = 0.3
"""Error of the initial guesses along x [px]."""
PAIRS = 4
"""Number of pairs. Each has different noise. The mean error of one pair has an uncertainty of 0.4 mpx."""


@dataclass(frozen=True)
class Problem:
    """Pairs of pictures and the motion between them."""

    name: str
    """Name of the motion."""
    first: NDArray[np.uint8]
    """First pictures, shape [pairs, rows, columns]."""
    second: NDArray[np.uint8]
    """The moved pictures."""
    points: FloatArray
    """(x, y) in the first picture [px], shape [n, 2]."""
    warp: FloatArray
    """True warps from the first to the second picture, shape [n, 12]."""


@dataclass(frozen=True)
class Errors:
    """Errors of the displacement along x, over all pairs."""

    bias: float
    """Their mean [px]."""
    spread: float
    """Their standard deviation [px]."""
    found: float
    """Share of the points that were measured [-]."""


def problems() -> list[Problem]:
    """Two problems with noise and eight bits: a shift by 0.3 px and a stretch by 2 %."""
    shape, centre = (SIDE, SIDE), (SIDE - 1) / 2
    pattern = speckle_pattern(shape)
    still = render(pattern, shape)
    along = np.arange(MARGIN, SIDE - MARGIN, STEP, dtype=np.float64)
    points = np.stack(np.meshgrid(along, along), axis=-1).reshape(-1, 2)
    found = []
    for name, stretch, shift in (("shift by 0.3 px", 1.0, 0.3), ("stretch by 2 %", 1.02, 0.0)):

        def material(x: FloatArray, stretch: float = stretch, shift: float = shift) -> FloatArray:
            return np.stack([(x[..., 0] - centre - shift) / stretch + centre, x[..., 1]], axis=-1)

        moved = render(pattern, shape, material=material)
        warp = np.zeros((len(points), 12))
        warp[:, 0] = (points[:, 0] - centre) * (stretch - 1.0) + shift
        warp[:, 2] = stretch - 1.0
        found.append(Problem(name, _recorded(still, 1), _recorded(moved, 2), points, warp))
    return found


def _recorded(picture: FloatArray, seed: int) -> NDArray[np.uint8]:
    noise = np.random.default_rng(seed).normal(0.0, SIGMA, (PAIRS, *picture.shape))
    return np.clip(np.round(picture + noise), 0.0, 255.0).astype(np.uint8)


def errors(problem: Problem, points: FloatArray, u: FloatArray) -> Errors:
    """Errors of displacements `u` [px] measured at `points`, of all pairs together; unmeasured points are
    absent."""
    stretch = problem.warp[0, 2]
    start = problem.warp[0, 0] - stretch * problem.points[0, 0]
    off = u - (start + stretch * points[:, 0])
    return Errors(float(off.mean()), float(off.std()), len(points) / (PAIRS * len(problem.points)))
