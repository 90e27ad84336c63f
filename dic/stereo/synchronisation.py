"""Synchronisation of two cameras of a moving specimen, from its epipolar distances.

Camera 1 late by τ frames sees every point where it will be τ frames later. Across the epipolar lines that
shows as an epipolar distance ``τ w``, with w the motion of the point across its line in one frame. Motion
along the lines only changes depth and tells nothing. A constant distance of a point, from the calibration, is
left free, so w has to vary: a rest before the motion is best. τ is the slope of a regression of the distances
over w with an intercept for each point, outliers weighted down by Cauchy's function.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray, IntArray
from dic.camera import StereoRig
from dic.robust import MAD
from dic.stereo.epipolar import Rays, slopes_between

LEAST_PAIRS = 100
"""Point pairs that a shift must leave to be judged."""
LEAST_MOTION = 0.05
"""Motion across the epipolar lines that tells one frame from the next [px/frame]: as much as the error of
a calibration may vary along a path."""
POINTS = 500
"""Points that are used at most, evenly taken from all."""


@dataclass(frozen=True)
class Synchronisation:
    """Time by which the cameras' frames are apart."""

    shifts: IntArray
    """Frames by which camera 1 was assumed to be late, shape [n_shifts]."""
    scatter: FloatArray
    """Robust standard deviation of the epipolar distances for each shift, less what each point has in the
    fifth of the frames with the least motion [px], shape [n_shifts]; infinite where fewer than `LEAST_PAIRS`
    pairs are left."""
    motion: float
    """Root mean square motion across the epipolar lines, each point's mean taken out [px/frame]."""
    late: float
    """Delay of camera 1, parts of a frame included [frames]; NaN if it cannot be told."""
    late_sigma: float
    """Standard deviation of `late` over the frames [frames]; NaN if it cannot be told."""

    @property
    def decided(self) -> bool:
        """True if the motion across the epipolar lines is large enough to tell one frame from the next."""
        return bool(self.motion > LEAST_MOTION and self.late_sigma < 0.1)


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
        Its `late` means something where it is `decided`.

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
    step = -(-pixels0.shape[1] // POINTS)
    pixels0, pixels1 = (_without_jumps(pixels[:, ::step]) for pixels in (pixels0, pixels1))
    aims = Rays.of(rig.cameras[0], pixels0), Rays.of(rig.cameras[1], pixels1)
    shifts = np.arange(-farthest, farthest + 1)
    shifted = {int(shift): _shifted(rig, *aims, int(shift)) for shift in shifts}
    slope1 = shifted[0][1]
    velocity = np.full_like(pixels1, np.nan)
    velocity[1:-1] = (pixels1[2:] - pixels1[:-2]) / 2.0
    across = np.sum(slope1 * velocity, axis=-1)
    speed = _median(np.abs(across), axis=1)
    calm = speed <= np.nanquantile(speed, 0.2) if np.any(np.isfinite(speed)) else np.zeros(n, dtype=bool)

    scatter = np.full(len(shifts), np.inf)
    for i, (e, _) in enumerate(shifted.values()):
        free = e - _median(np.where(calm[:, None], e, np.nan), axis=0)
        if np.sum(np.isfinite(free)) >= LEAST_PAIRS:
            scatter[i] = MAD * np.nanmedian(np.abs(free))
    late, late_sigma, motion = 0.0, float("nan"), 0.0
    for _ in range(3):  # w is the motion at the frame paired: pair anew once the shift is known
        best = int(np.clip(np.round(late), -farthest, farthest))
        e, _ = shifted[best]
        rest, late_sigma, motion = _regression(e, _moved(across, best))
        if not np.isfinite(rest) or round(best + rest) == best:
            late = best + rest
            break
        late = best + rest
    return Synchronisation(shifts, scatter, motion, late, late_sigma)


def _without_jumps(pixels: FloatArray) -> FloatArray:
    """Pixels with NaN for those that lie far from the median of five frames around them."""
    padded = np.pad(pixels, ((2, 2), (0, 0), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 5, axis=0)
    off = np.abs(pixels - _median(windows, axis=-1)).max(axis=-1)
    usual = np.nanmedian(off) if np.any(np.isfinite(off)) else 0.0
    return np.where((off <= max(1.0, 10.0 * usual))[..., None], pixels, np.nan)


def _shifted(rig: StereoRig, aim0: Rays, aim1: Rays, shift: int) -> tuple[FloatArray, FloatArray]:
    """Distances [n_frames, n_points] with camera 1 late by `shift`, and their slopes by its pixels.

    Rows are the frames of camera 0; those without a partner are NaN.
    """
    e, _, slope1 = slopes_between(rig, aim0, Rays(*(_moved(part, shift) for part in aim1)))
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
    # NaN is sorted behind all numbers; `numpy.nanmedian` goes through the lines one by one
    ordered = np.sort(np.where(np.isfinite(values), values, np.nan), axis=axis)
    count = np.sum(np.isfinite(values), axis=axis, keepdims=True)
    pair = [np.take_along_axis(ordered, k, axis) for k in (np.maximum(count - 1, 0) // 2, count // 2)]
    both = np.squeeze(0.5 * (pair[0] + pair[1]), axis)
    return np.where(np.squeeze(count, axis) > 0, both, np.nan)


def _regression(e: FloatArray, w: FloatArray) -> tuple[float, float, float]:
    """Slope of e over w with an intercept for each point, its sigma over the frames, and the rms of w."""
    used = np.isfinite(e) & np.isfinite(w)
    if np.sum(used) < LEAST_PAIRS:
        return float("nan"), float("nan"), 0.0
    e, w = np.where(used, e, 0.0), np.where(used, w, 0.0)
    off = w - _median(np.where(used, w, np.nan), axis=1)[:, None]
    # A false point moves unlike its frame, and as w would outweigh all others.
    trust = used & (np.abs(off) <= 4.0 * MAD * np.median(np.abs(off[used])))
    weight, slope = trust.astype(np.float64), 0.0
    for _ in range(20):
        total = np.maximum(weight.sum(axis=0), 1e-30)
        w_free = w - (weight * w).sum(axis=0) / total
        e_free = e - (weight * e).sum(axis=0) / total
        power = float(np.sum(weight * w_free**2))
        if not power > 0.0:
            return float("nan"), float("nan"), 0.0
        slope = float(np.sum(weight * w_free * e_free) / power)
        rest = e_free - slope * w_free
        weight = trust * _cauchy(rest, used)
    # Points of a frame share its error: frames, not points, are the independent observations.
    per_frame = np.sum(weight * w_free * rest, axis=1)
    sigma = float(np.sqrt(np.sum(per_frame**2)) / power)
    return slope, sigma, float(np.sqrt(power / weight.sum()))


def _cauchy(values: FloatArray, used: NDArray[np.bool_]) -> FloatArray:
    """Weights that fall beyond 2.5 robust standard deviations."""
    spread = 2.5 * MAD * float(np.median(np.abs(values[used]))) + 1e-12
    return np.asarray(1.0 / (1.0 + (np.where(used, values, 0.0) / spread) ** 2))
