"""Diagnosis of a stereo test with large epipolar distances: exchanged cameras, crop offset, synchronisation.

Explanations are tried in the order of their frequency in practice. An explanation is accepted if it makes the
epipolar distances as small as expected. A crop offset is found by robust Gauss-Newton steps. Components that
the points do not determine stay zero. If camera 1 is late by τ frames, a point has the epipolar distance ``τ
w``. w is its motion across its epipolar line in one frame. τ is estimated as a robust slope with an intercept
for each point.
"""

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from dic.basics import MAD, BoolArray, FloatArray, IntArray
from dic.camera import StereoRig
from dic.correlation import Noise, Shape
from dic.correlation.subsets import apply
from dic.outcome import PointOutcome
from dic.stereo.geometry import Rays, epipolar_distance, epipolar_slopes, slopes_between
from dic.tracking import Tracking, track

OFFSET_POINTS = 4000
"""Largest number of point pairs that are used, evenly spaced."""
INDEPENDENT = 100
"""Largest number of points that count as independent for a standard deviation: neighbours share the errors of
the calibration."""
DETERMINED = 8.0
"""Largest standard deviation of a determined component [px]."""
SURE, LEAST_FAINT = 3.5, 4.0
"""Smallest reported offset along the epipolar lines, in standard deviations [-] and in pixels [px]."""
CALIBRATED = 2.0
"""Standard deviation of such an offset for a good calibration [px]."""
REMAINING_SHARE = 0.5
"""Largest share of the distances that may remain after correction of the offset [-]."""
FARTHEST = 4096.0
"""Largest offset in the search [px]: the side of a large sensor."""

HYPOTHESES = {
    "camera 1": np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]),
    "both cameras": np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 1.0]]),
}
"""Pixels that a wrong offset shifts: (x0, y0, x1, y1) per (dx, dy). For the epipolar distances, an offset of
camera 0 only is equivalent to the opposite offset of camera 1."""


@dataclass(frozen=True)
class Offset:
    """A possible crop offset, with the epipolar distances before and after its correction."""

    where: str
    """A key of `HYPOTHESES`."""
    value: FloatArray
    """Shift to be added to the crop offset (x, y), whole pixels [px]; 0 where not determined."""
    sigma: FloatArray
    """Standard deviation of each component, from the remaining scatter [px]; infinite if fixed at 0."""
    before: float
    """Median absolute epipolar distance without the offset [px]."""
    after: float
    """The same with the offset added [px]."""

    @property
    def shifts(self) -> tuple[FloatArray, FloatArray]:
        """Shifts to be added to the pixels of camera 0 and of camera 1 [px]."""
        components = HYPOTHESES[self.where] @ self.value
        return components[:2], components[2:]


def _find_offset(rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray, where: str) -> Offset:
    """The whole-pixel crop offset that minimises the epipolar distances."""
    if len(pixels0) < 20:
        raise ValueError(f"an offset needs at least 20 point pairs, got {len(pixels0)}")
    step = -(-len(pixels0) // OFFSET_POINTS)
    p0, p1 = pixels0[::step], pixels1[::step]
    basis = HYPOTHESES[where]
    fixed = np.zeros(2, dtype=bool)
    value, sigma = _fit(rig, p0, p1, basis, fixed)
    fixed = (sigma > DETERMINED) | (np.abs(value) < 3.0 * sigma)
    if np.any(fixed):
        value, sigma = _fit(rig, p0, p1, basis, fixed)
    value = np.round(value)
    shift = basis @ value
    median = [
        float(np.median(np.abs(epipolar_slopes(rig, p0 + s * shift[:2], p1 + s * shift[2:])[0])))
        for s in (0.0, 1.0)
    ]
    return Offset(where, value, sigma, *median)


def faint_offset(rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray) -> Offset | None:
    """An offset of one camera along the epipolar lines, found by its small effect across these lines.

    Epipolar distances of hundredths of a pixel are normal. With perspective, a crop offset gives them a
    typical variation over the field. If an offset of whole pixels removes half of them, the crop offset is
    reported, because it affects depths and all lengths.
    """
    step = -(-len(pixels0) // OFFSET_POINTS)
    p0, p1 = pixels0[::step], pixels1[::step]
    basis = HYPOTHESES["camera 1"]
    value, sigma = _fit(rig, p0, p1, basis, np.zeros(2, dtype=bool))
    sure = (np.abs(value) >= SURE * sigma) & (np.abs(value) >= LEAST_FAINT)
    if not np.any(sure):
        return None
    fitted = np.where(sure, np.round(value), value)  # fractions of a pixel: calibration
    after = p1 + (basis @ fitted)[2:]
    sizes = [float(np.median(np.abs(epipolar_slopes(rig, p0, p)[0]))) for p in (p1, after)]
    if sizes[1] > REMAINING_SHARE * sizes[0]:
        return None
    determined = np.where(sure, np.hypot(sigma, CALIBRATED), np.inf)
    return Offset("camera 1", np.where(sure, fitted, 0.0), determined, *sizes)


def _fit(
    rig: StereoRig, p0: FloatArray, p1: FloatArray, basis: FloatArray, fixed: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Offset and standard deviation [px], shape [2] each. 0 ± infinite for fixed components, or if no offset
    is found."""
    value, sigma = np.zeros(2), np.full(2, np.inf)
    free = ~fixed
    if not np.any(free):
        return value, sigma
    for trial in range(30):
        shift = basis @ value
        try:
            e, slope0, slope1 = epipolar_slopes(rig, p0 + shift[:2], p1 + shift[2:])
        except ValueError:  # the lens model is not valid there: an impossible offset
            return np.zeros(2), np.full(2, np.inf)
        J = np.concatenate([slope0, slope1], axis=-1) @ basis[:, free]
        # At first all points have weight. Points that remain far off then lose their weight.
        spread = 2.5 * MAD * float(np.median(np.abs(e - np.median(e)))) + 1e-9
        spread = max(spread, 2.5 * float(np.median(np.abs(e)))) if trial < 6 else spread
        weight = 1.0 / (1.0 + (e / spread) ** 2)
        normal = (J * weight[:, None]).T @ J
        move = -np.linalg.lstsq(normal, J.T @ (weight * e), rcond=1e-12)[0]
        value[free] += move
        if np.abs(value).max() > FARTHEST:
            return np.zeros(2), np.full(2, np.inf)
        if trial > 6 and np.abs(move).max() < 1e-3:
            break
    noise = MAD * float(np.median(np.abs(e))) + 1e-9
    eigen, axes = np.linalg.eigh(normal)
    covariance = (axes / np.maximum(eigen, 1e-30)) @ axes.T * max(1.0, len(e) / INDEPENDENT)
    sigma[free] = noise * np.sqrt(np.diag(covariance))
    return value, sigma


LEAST_SYNCHRONISATION_PAIRS = 100
"""Smallest number of point pairs for a tested shift."""
LEAST_MOTION = 0.05
"""Smallest motion across the epipolar lines that distinguishes successive frames [px/frame]. The variation of
a calibration error along a path is as large."""
SYNCHRONISATION_POINTS = 500
"""Largest number of points that are used, evenly spaced."""


@dataclass(frozen=True)
class Synchronisation:
    """Time offset between the cameras' frames."""

    shifts: IntArray
    """Assumed delays of camera 1 [frames], shape [n_shifts]."""
    scatter: FloatArray
    """Robust standard deviation of the epipolar distances for each shift [px], shape [n_shifts]. Distances
    are relative to the point's value in the fifth of the frames with the least motion. Infinite where fewer
    than `LEAST_PAIRS` pairs remain."""
    motion: float
    """Root mean square motion across the epipolar lines, after subtraction of each point's mean
    [px/frame]."""
    late: float
    """Delay of camera 1 with fractions of a frame [frames]; NaN if it cannot be determined."""
    late_sigma: float
    """Standard deviation of `late` over the frames [frames]; NaN if it cannot be determined."""

    @property
    def decided(self) -> bool:
        """True if the motion across the epipolar lines is large enough to distinguish successive frames."""
        return bool(self.motion > LEAST_MOTION and self.late_sigma < 0.1)


def synchronisation(
    rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray, *, farthest: int = 2
) -> Synchronisation:
    """Estimate the delay between the two cameras in frames.

    ``rig``: the cameras. ``pixels0``, ``pixels1``: the same points in the frames of each camera (x, y) [px],
    NaN where lost, shapes [n_frames, n_points, 2]. ``farthest``: largest shift that is tried in both
    directions [frames]. Returns: the delay; `late` is meaningful only if `decided`. Raises ValueError if
    shapes do not match, if there are fewer than `farthest` + 3 frames, or if a lens distortion cannot be
    inverted.
    """
    if pixels0.shape != pixels1.shape or pixels0.ndim != 3:
        raise ValueError(
            f"pixels0 and pixels1 must have one shape [n_frames, n_points, 2], got {pixels0.shape} and "
            f"{pixels1.shape}"
        )
    n = len(pixels0)
    if not 1 <= farthest <= n - 3:
        raise ValueError(f"farthest must be from 1 to {n - 3} (of {n} frames), got {farthest}")
    step = -(-pixels0.shape[1] // SYNCHRONISATION_POINTS)
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
        if np.sum(np.isfinite(free)) >= LEAST_SYNCHRONISATION_PAIRS:
            scatter[i] = MAD * np.nanmedian(np.abs(free))
    late, late_sigma, motion = 0.0, float("nan"), 0.0
    for _ in range(3):  # w is the motion at the paired frame, so frames are paired again with the new shift
        best = int(np.clip(np.round(late), -farthest, farthest))
        e, _ = shifted[best]
        remainder, late_sigma, motion = _regression(e, _delayed(across, best))
        if not np.isfinite(remainder) or round(best + remainder) == best:
            late = best + remainder
            break
        late = best + remainder
    return Synchronisation(shifts, scatter, motion, late, late_sigma)


def _without_jumps(pixels: FloatArray) -> FloatArray:
    """Pixels. NaN replaces pixels far from the median of the five surrounding frames."""
    padded = np.pad(pixels, ((2, 2), (0, 0), (0, 0)), mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 5, axis=0)
    off = np.abs(pixels - _median(windows, axis=-1)).max(axis=-1)
    usual = np.nanmedian(off) if np.any(np.isfinite(off)) else 0.0
    return np.where((off <= max(1.0, 10.0 * usual))[..., None], pixels, np.nan)


def _shifted(rig: StereoRig, aim0: Rays, aim1: Rays, shift: int) -> tuple[FloatArray, FloatArray]:
    """Distances [n_frames, n_points] if camera 1 is late by `shift`, and their derivatives by its pixels."""
    e, _, slope1 = slopes_between(rig, aim0, Rays(*(_delayed(part, shift) for part in aim1)))
    return e, slope1


def _delayed(values: FloatArray, by: int) -> FloatArray:
    """Rows delayed by `by`: row f contains row f - by; NaN where that does not exist."""
    shifted = np.full_like(values, np.nan)
    if by >= 0:
        shifted[by:] = values[: len(values) - by]
    else:
        shifted[:by] = values[-by:]
    return shifted


def _median(values: FloatArray, axis: int) -> FloatArray:
    """Medians of the finite values; NaN where there are none."""
    # a sort puts NaN behind all numbers; `numpy.nanmedian` is slow, because it loops over the lines
    ordered = np.sort(np.where(np.isfinite(values), values, np.nan), axis=axis)
    count = np.sum(np.isfinite(values), axis=axis, keepdims=True)
    pair = [np.take_along_axis(ordered, k, axis) for k in (np.maximum(count - 1, 0) // 2, count // 2)]
    mean = np.squeeze(0.5 * (pair[0] + pair[1]), axis)
    return np.where(np.squeeze(count, axis) > 0, mean, np.nan)


def _regression(e: FloatArray, w: FloatArray) -> tuple[float, float, float]:
    """Slope of e over w with an intercept for each point, its sigma over the frames, and the rms of w."""
    used = np.isfinite(e) & np.isfinite(w)
    if np.sum(used) < LEAST_SYNCHRONISATION_PAIRS:
        return float("nan"), float("nan"), 0.0
    e, w = np.where(used, e, 0.0), np.where(used, w, 0.0)
    off = w - _median(np.where(used, w, np.nan), axis=1)[:, None]
    # A false point has a large motion w and would have more weight than all others.
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
        residual = e_free - slope * w_free
        weight = trust * _cauchy(residual, used)
    # Points of a frame share its error. The frames are therefore the independent observations.
    per_frame = np.sum(weight * w_free * residual, axis=1)
    sigma = float(np.sqrt(np.sum(per_frame**2)) / power)
    return slope, sigma, float(np.sqrt(power / weight.sum()))


def _cauchy(values: FloatArray, used: NDArray[np.bool_]) -> FloatArray:
    """Weights that decrease beyond 2.5 robust standard deviations."""
    spread = 2.5 * MAD * float(np.median(np.abs(values[used]))) + 1e-12
    return np.asarray(1.0 / (1.0 + (np.where(used, values, 0.0) / spread) ** 2))


LEAST_PAIRS = 20
"""Smallest number of point pairs for a report."""


LEAST_FAINT_COUNTS = 3, 60
"""Smallest number of frames and points for a report of an offset along the epipolar lines."""


class Fault(IntEnum):
    """Faults of a stereo test as a whole."""

    SWAPPED_CAMERAS = 1
    CROP_OFFSET = 2
    OUT_OF_STEP = 3
    CALIBRATION = 4


@dataclass(frozen=True)
class Finding:
    """One fault identified from the epipolar distances."""

    fault: Fault
    """Name of the fault."""
    what: str
    """Description with numbers."""
    cure: str
    """Cure for a user."""
    before: float
    """Median absolute epipolar distance; for OUT_OF_STEP the scatter [px]."""
    after: float
    """The same after correction of the fault [px]; equal to `before` for CALIBRATION."""
    value: tuple[float, ...]
    """CROP_OFFSET: correction to add to the offsets (x0, y0, x1, y1) [px]; OUT_OF_STEP: delay of camera 1
    [frames]; else empty."""


def diagnose(
    rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray, *, tolerance: float = 0.2, farthest: int = 2
) -> tuple[Finding, ...]:
    """Identify the cause of too large epipolar distances of matched points.

    ``pixels0``, ``pixels1``: the same points in the frames of each camera (x, y) [px], NaN where lost, shapes
    [n_frames, n_points, 2], e.g. `Reconstruction.pixels`. The matches must not be selected by their epipolar
    distance. ``tolerance``: upper bound of the median absolute epipolar distance for a good calibration [px].
    ``farthest``: largest tried shift between the cameras' frames, in both directions. Synchronisation is
    checked only if the series has at least `farthest` + 3 frames. Returns: the faults; empty if the epipolar
    distances show none. They do not show a motion along the epipolar lines, or an exchange of cameras that
    are aligned to `tolerance`. An offset along the lines is reported only if it is at least `LEAST_FAINT`
    (`dic.stereo.diagnose.faint_offset`). Raises ValueError if shapes do not match, if there are fewer than 20
    pairs, if the tolerance is not positive, or if a lens distortion cannot be inverted.
    """
    if not tolerance > 0.0:
        raise ValueError(f"tolerance must be positive, got {tolerance} px")
    if pixels0.shape != pixels1.shape or pixels0.ndim != 3 or pixels0.shape[-1] != 2:
        raise ValueError(
            f"pixels0 and pixels1 must have one shape [n_frames, n_points, 2], got {pixels0.shape} and "
            f"{pixels1.shape}"
        )
    pair = np.all(np.isfinite(pixels0) & np.isfinite(pixels1), axis=-1)
    if np.sum(pair) < LEAST_PAIRS:
        raise ValueError(f"a diagnosis needs at least {LEAST_PAIRS} point pairs, got {np.sum(pair)}")
    still = pair & _stillest(pixels1, pair)[:, None]
    findings, rig, shifts = _standing_faults(rig, pixels0[still], pixels1[still], tolerance)
    if not findings and len(pixels0) >= LEAST_FAINT_COUNTS[0]:
        rest_pixels = _at_rest(pixels0, pixels1, still)
        faint = faint_offset(rig, *rest_pixels) if len(rest_pixels[0]) >= LEAST_FAINT_COUNTS[1] else None
        findings += [] if faint is None else [_offset_finding(faint)]
    if len(pixels0) >= farthest + 3:
        sync = synchronisation(rig, pixels0 + shifts[0], pixels1 + shifts[1], farthest=farthest)
        if (finding := _out_of_step(sync)) is not None:
            findings.append(finding)
    return tuple(findings)


def _at_rest(
    pixels0: FloatArray, pixels1: FloatArray, still: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Mean positions of the points in frames with little motion, [n, 2]. Both cameras must see the points."""
    count = still.sum(axis=0)
    defined = count > 0
    first, second = (
        np.where(still[..., None], pixels, 0.0).sum(axis=0)[defined] / count[defined, None]
        for pixels in (pixels0, pixels1)
    )
    return first, second


def _stillest(pixels: FloatArray, pair: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The frames with the least motion to the next frame, shape [n_frames]. Together they have enough
    pairs."""
    n = len(pixels)
    motion = np.full(n, np.inf)
    for f in range(n - 1):
        step = np.linalg.norm(pixels[f + 1] - pixels[f], axis=-1)
        if np.any(np.isfinite(step)):
            motion[f] = np.nanmedian(step)
    order = np.argsort(motion, kind="stable")
    enough = int(np.searchsorted(np.cumsum(pair.sum(axis=1)[order]), 10 * LEAST_PAIRS)) + 1
    chosen = np.zeros(n, dtype=bool)
    chosen[order[: max(enough, n // 20)]] = True
    return chosen


def _standing_faults(
    rig: StereoRig, p0: FloatArray, p1: FloatArray, tolerance: float
) -> tuple[list[Finding], StereoRig, tuple[FloatArray, FloatArray]]:
    """Faults that do not depend on motion, and the corrections of rig and pixels."""
    none = (np.zeros(2), np.zeros(2))
    before = _size(rig, p0, p1)
    if before <= tolerance:
        return [], rig, none
    swapped = StereoRig((rig.cameras[1], rig.cameras[0]))
    try:
        after = _size(swapped, p0, p1)
    except ValueError:  # the other lens model is not valid there: the other camera did not take this picture
        after = np.inf
    if after <= tolerance:
        return [_swap(before, after)], swapped, none
    best = {}
    for name, cameras in (("as given", rig), ("exchanged", swapped if np.isfinite(after) else rig)):
        offsets = [_find_offset(cameras, p0, p1, where) for where in HYPOTHESES]
        best[name] = min(offsets, key=lambda offset: offset.after)
        if best[name].after <= tolerance:
            swap = [_swap(before, after)] if name == "exchanged" else []
            return [*swap, _offset_finding(best[name])], cameras, best[name].shifts
    text = (
        f"epipolar distances of {before:.2f} px (median) stay at {after:.2f} px with the cameras exchanged, "
        f"at {best['as given'].after:.2f} px with the best crop offset, "
        f"and at {best['exchanged'].after:.2f} px with both"
    )
    cure = "calibrate again: a camera or lens has moved, or this calibration is of another set-up"
    return [Finding(Fault.CALIBRATION, text, cure, before, before, ())], rig, none


def _swap(before: float, after: float) -> Finding:
    text = f"the cameras are exchanged: epipolar distances of {before:.2f} px are {after:.2f} px if swapped"
    cure = "give camera 0's pictures as camera 1's and the other way round, or swap them in the calibration"
    return Finding(Fault.SWAPPED_CAMERAS, text, cure, before, after, ())


def _size(rig: StereoRig, p0: FloatArray, p1: FloatArray) -> float:
    """Median absolute epipolar distance [px]."""
    return float(np.median(np.abs(epipolar_distance(rig, p0, p1))))


def _offset_finding(offset: Offset) -> Finding:
    parts = [
        f"{axis} by {value:+.0f} ± {sigma:.1f} px"
        for axis, value, sigma in zip("xy", offset.value, offset.sigma, strict=True)
        if np.isfinite(sigma)
    ]
    unknown = [axis for axis, sigma in zip("xy", offset.sigma, strict=True) if not np.isfinite(sigma)]
    text = (
        f"the crop offset of {offset.where} is off, {' and '.join(parts)}: with that added, epipolar "
        f"distances of {offset.before:.2g} px are {offset.after:.2g} px"
    )
    cure = "take the crop offsets from the camera's own file header, and add what is missing"
    if unknown:
        cure += f"; {' and '.join(unknown)} cannot be separated by epipolar distances, so check it too"
    if offset.where == "camera 1":
        cure += "; instead, an offset of camera 0 would explain it as well"
    shifts = offset.shifts
    value = (*(float(v) for v in shifts[0]), *(float(v) for v in shifts[1]))
    return Finding(Fault.CROP_OFFSET, text, cure, offset.before, offset.after, value)


def _out_of_step(sync: Synchronisation) -> Finding | None:
    """A finding if the motion shows that a camera is late by a quarter of a frame or more."""
    if not sync.decided or abs(sync.late) < 0.25:
        return None
    before = float(sync.scatter[sync.shifts == 0][0])
    whole = int(np.clip(round(sync.late), sync.shifts[0], sync.shifts[-1]))
    after = float(sync.scatter[sync.shifts == whole][0])
    late, early = ("1", "0") if sync.late > 0.0 else ("0", "1")
    frames = f"{abs(whole)} frame{'s' if abs(whole) > 1 else ''}"
    text = f"camera {late} is late by {abs(sync.late):.2f} ± {max(sync.late_sigma, 0.01):.2f} frames"
    cure = "look at the trigger: the cameras expose at different times within a frame"
    if whole:
        text += f": shifted by {frames}, epipolar distances scatter by {after:.3f} instead of {before:.3f} px"
        cure = f"leave out the first {frames} of camera {early}, and look at the trigger cables"
    return Finding(Fault.OUT_OF_STEP, text, cure, before, after, (sync.late,))


MOST_POINTS = 150
"""Largest number of matched points; it is sufficient for a diagnosis."""


def free_pairs(
    pictures: tuple[NDArray[np.generic], NDArray[np.generic]],
    points: FloatArray,
    tracking: Tracking,
    *,
    noise: float | Noise,
    mask: BoolArray | None = None,
    device: str = "cpu",
) -> tuple[FloatArray, FloatArray]:
    """Match points of one camera in the other camera. The cameras' parameters are not used.

    Camera 1's picture is treated as a later picture of camera 0 and searched by features and windows. Matches
    are checked against their neighbours only. On a strongly curved surface only the middle of the view is
    matched.

    ``pictures``: pictures of camera 0 and camera 1 at one instant, each of shape [rows, columns]. ``points``:
    positions in camera 0's picture [px], shape [n, 2]. ``tracking``: settings of the match; the shape
    function is at least affine. ``mask``: pixels of the body in camera 0's picture. Returns: the same points
    in both pictures, NaN where not found, shape [1, n, 2].
    """
    rows = np.unique(np.linspace(0, len(points) - 1, MOST_POINTS).astype(int))
    subset = tracking.correlation
    shape = max(subset.shape, Shape.AFFINE)
    wide = replace(tracking, correlation=replace(subset, shape=shape), search=max(tracking.search, 48))
    result = track(
        [pictures[1]], points[rows], wide, noise=noise, mask=mask, material=pictures[0], device=device
    )
    valid = (result.outcome[0] == PointOutcome.VALID)[:, None]
    pixels = apply(points[rows], result.warp[0])
    return np.where(valid, points[rows], np.nan)[None], np.where(valid, pixels, np.nan)[None]


def check_setup(rig: StereoRig, pixels0: FloatArray, pixels1: FloatArray) -> tuple[Finding, ...]:
    """Findings about cameras and crop offsets from the epipolar distances. None if there are too few pairs.

    ``rig``: the cameras, for the cropped pictures of the series. ``pixels0``, ``pixels1``: the same points in
    both cameras, NaN where lost [px], shape [n_frames, n_points, 2].
    """
    pairs = np.isfinite(pixels0).all(axis=-1) & np.isfinite(pixels1).all(axis=-1)
    if pairs.sum() < LEAST_PAIRS:
        return ()
    return diagnose(rig, pixels0, pixels1)
