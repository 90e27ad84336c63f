"""Check of the cameras against their calibration, from pairs found without it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dic.arrays import BoolArray, FloatArray
from dic.camera import StereoRig
from dic.correlation import Noise, Shape
from dic.correlation.warp import apply
from dic.outcome import PointOutcome
from dic.stereo.diagnose import LEAST_PAIRS, Finding, diagnose
from dic.tracking import Tracking, track

MOST_POINTS = 150
"""Points that are looked for: enough for a diagnosis."""


def free_pairs(
    pictures: tuple[NDArray[np.generic], NDArray[np.generic]],
    points: FloatArray,
    tracking: Tracking,
    *,
    noise: float | Noise,
    mask: BoolArray | None = None,
    device: str = "cpu",
) -> tuple[FloatArray, FloatArray]:
    """Points of one camera found in the other without use of the cameras' parameters.

    Camera 1's picture is taken for a later one of camera 0, and searched by features and windows; only the
    neighbours judge a match. On a strongly curved surface the middle of the view is found.

    Parameters
    ----------
    pictures
        One instant, camera 0 and camera 1, each of shape [rows, columns].
    points
        Places in camera 0's picture [px], shape [n, 2].
    tracking
        How subsets are matched; an affine shape function at least is used.
    noise
        Standard deviation of the grey values.
    mask
        Pixels of the body in camera 0's picture.
    device
        Where pictures are correlated.

    Returns
    -------
    pixels0, pixels1 : array
        The same points in both pictures, NaN where not found, shape [1, n, 2].
    """
    rows = np.unique(np.linspace(0, len(points) - 1, MOST_POINTS).astype(int))
    subset = tracking.correlation
    shape = max(subset.shape, Shape.AFFINE)
    wide = replace(tracking, correlation=replace(subset, shape=shape), search=max(tracking.search, 48))
    found = track(
        [pictures[1]], points[rows], wide, noise=noise, mask=mask, material=pictures[0], device=device
    )
    valid = (found.outcome[0] == PointOutcome.VALID)[:, None]
    seen = apply(points[rows], found.warp[0])
    return np.where(valid, points[rows], np.nan)[None], np.where(valid, seen, np.nan)[None]


def check_setup(rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray) -> tuple[Finding, ...]:
    """Findings about cameras and crop offsets from the epipolar distances; none if there are too few pairs.

    Parameters
    ----------
    rig
        The cameras, for pictures with the crop of the series.
    pixels0, pixels1
        The same points in both cameras, NaN where lost [px], shape [n_frames, n_points, 2].
    """
    pairs = np.isfinite(pixels0).all(axis=-1) & np.isfinite(pixels1).all(axis=-1)
    if pairs.sum() < LEAST_PAIRS:
        return ()
    return diagnose(rig, pixels0, pixels1)
