"""Whether two cameras recorded a moving specimen at the same times, from its epipolar distances.

Camera 1 late by τ frames sees every point where it will be τ frames later. Across the epipolar lines that
shows as an epipolar distance ``τ w``, with w the motion of the point across its line in one frame. Motion
along the lines only changes depth and tells nothing. A constant distance of a point, from the calibration, is
taken out, so w has to vary: a rest before the motion is best.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.camera import StereoRig
from dic.stereo.epipolar import epipolar_slopes

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LEAST_PAIRS = 100
"""Point pairs that a shift must leave to be judged."""


@dataclass(frozen=True)
class Synchronisation:
    """How far apart the cameras' frames are."""

    shifts: IntArray
    """Frames by which camera 1 was assumed to be late, shape [n_shifts]."""
    scatter: FloatArray
    """Robust standard deviation of the epipolar distances for each shift, each point's median taken out [px],
    shape [n_shifts]; infinite where fewer than `LEAST_PAIRS` pairs are left."""
    motion: float
    """Root mean square motion across the epipolar lines, each point's mean taken out [px/frame]."""
    late: float
    """How late camera 1 is, parts of a frame included [frames]; NaN if it cannot be told."""
    late_sigma: float
    """Standard deviation of `late` over the frames [frames]; NaN if it cannot be told."""

    @property
    def shift(self) -> int:
        """Whole frames with the least scatter."""
        return int(self.shifts[np.argmin(self.scatter)])

    @property
    def decided(self) -> bool:
        """Whether the motion across the epipolar lines is large enough to tell one frame from the next."""
        return bool(self.motion > self.scatter.min() and self.late_sigma < 0.1)


def synchronisation(
    rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray, *, farthest: int = 2
) -> Synchronisation:
    """Find by how many frames the two cameras are apart.

    Parameters
    ----------
    rig
        The cameras.
    pixels0, pixels1
        The same points in the frames of each camera (x, y) [px], NaN where lost, shapes
        [n_frames, n_points, 2].
    farthest
        Shifts up to this many frames, either way, are tried.

    Returns
    -------
    Synchronisation
        Its `shift` means something where it is `decided`.

    Raises
    ------
    ValueError
        Shapes that do not fit, fewer than `farthest` + 3 frames, a lens distortion that cannot be undone.
    """
    if pixels0.shape != pixels1.shape or pixels0.ndim != 3:
        raise ValueError(
            f"pixels0 and pixels1 must have one shape [n_frames, n_points, 2], got {pixels0.shape} and "
            f"{pixels1.shape}"
        )
    n = len(pixels0)
    if not 1 <= farthest <= n - 3:
        raise ValueError(f"farthest must be from 1 to {n - 3} (of {n} frames), got {farthest}")
    shifts = np.arange(-farthest, farthest + 1)
    scatter = np.full(len(shifts), np.inf)
    for i, shift in enumerate(shifts):
        e, _ = _shifted(rig, pixels0, pixels1, int(shift))
        free = e - _median(e, axis=0)
        if np.sum(np.isfinite(free)) >= LEAST_PAIRS:
            scatter[i] = 1.4826 * np.nanmedian(np.abs(free))
    e, slope1 = _shifted(rig, pixels0, pixels1, 0)
    velocity = np.full_like(pixels1, np.nan)
    velocity[1:-1] = (pixels1[2:] - pixels1[:-2]) / 2.0
    across = np.sum(slope1 * velocity, axis=-1)
    best = int(shifts[np.argmin(scatter)])
    rest, across_best = _shifted(rig, pixels0, pixels1, best)[0], _moved(across, best)
    used = np.isfinite(rest) & np.isfinite(across_best)
    late, late_sigma = _regression(np.where(used, rest, np.nan), np.where(used, across_best, np.nan))
    moving = across - _mean(across)
    return Synchronisation(
        shifts=shifts,
        scatter=scatter,
        motion=float(np.sqrt(np.nanmean(moving**2))) if np.any(np.isfinite(moving)) else 0.0,
        late=best + late,
        late_sigma=late_sigma,
    )


def _shifted(rig: StereoRig, p0: FloatArray, p1: FloatArray, shift: int) -> tuple[FloatArray, FloatArray]:
    """Distances [n_frames, n_points] with camera 1 late by `shift`, and their slopes by its pixels.

    Rows are the frames of camera 0; those without a partner are NaN.
    """
    partner = _moved(p1, shift)
    e, _, slope1 = epipolar_slopes(rig, p0, partner)
    return e, slope1


def _moved(values: FloatArray, by: int) -> FloatArray:
    """Row f holds what row f - by held; NaN where there is none."""
    moved = np.full_like(values, np.nan)
    if by >= 0:
        moved[by:] = values[: len(values) - by]
    else:
        moved[:by] = values[-by:]
    return moved


def _median(values: FloatArray, axis: int) -> FloatArray:
    """Medians of what is finite, NaN where nothing is."""
    some = np.any(np.isfinite(values), axis=axis)
    return np.where(some, np.nanmedian(np.where(some, values, 0.0), axis=axis), np.nan)


def _mean(values: FloatArray) -> FloatArray:
    """Means over the frames of what is finite, NaN where nothing is."""
    some = np.any(np.isfinite(values), axis=0)
    return np.where(some, np.nanmean(np.where(some, values, 0.0), axis=0), np.nan)


def _regression(e: FloatArray, w: FloatArray) -> tuple[float, float]:
    """Slope of e over w with an intercept for each point, and its standard deviation over the frames."""
    w, e = w - _mean(w), e - _mean(e)
    per_frame, power = np.nansum(w * e, axis=1), float(np.nansum(w * w))
    if not power > 0.0:
        return float("nan"), float("nan")
    slope = float(per_frame.sum() / power)
    # Points of a frame share its error: frames, not points, are the independent observations.
    rest = np.nansum(w * (e - slope * w), axis=1)
    return slope, float(np.sqrt(np.sum(rest**2)) / power)
