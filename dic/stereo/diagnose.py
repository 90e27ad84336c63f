"""Diagnosis of a stereo test whose rays do not meet: named faults with numbers and cures.

The epipolar distance of a correct match is the noise of the match plus the error of the calibration, some
hundredths of a pixel. Where it is more, one explanation after another is tried, in the order of what a
laboratory gets wrong: cameras exchanged, a crop offset wrong or left out, frames out of step. An explanation
holds if with it the distances are what they should be; if none does, the calibration is named.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.camera import StereoRig
from dic.stereo.epipolar import epipolar_distance
from dic.stereo.offsets import HYPOTHESES, Offset, faint_offset, find_offset
from dic.stereo.synchronisation import Synchronisation, synchronisation

LEAST_PAIRS = 20
"""Point pairs without which nothing is said."""


LEAST_FAINT = 3, 60
"""Frames and points without which nothing is said of an offset along the epipolar lines."""


class Fault(IntEnum):
    """Faults of a stereo test as a whole."""

    SWAPPED_CAMERAS = 1
    CROP_OFFSET = 2
    OUT_OF_STEP = 3
    CALIBRATION = 4


@dataclass(frozen=True)
class Finding:
    """One fault that the epipolar distances show."""

    fault: Fault
    """Its name."""
    what: str
    """Description with numbers."""
    cure: str
    """Cure for a user."""
    before: float
    """Epipolar distances as they are: median magnitude; for OUT_OF_STEP the scatter [px]."""
    after: float
    """The same with the fault undone [px]; equal to `before` for CALIBRATION."""
    value: tuple[float, ...]
    """CROP_OFFSET: what to add to the offsets (x0, y0, x1, y1) [px]; OUT_OF_STEP: frames by which camera 1 is
    late; else empty."""


def diagnose(
    rig: StereoRig,
    pixels0: FloatArray,
    pixels1: FloatArray,
    *,
    tolerance: float = 0.2,
    farthest: int = 2,
) -> tuple[Finding, ...]:
    """Name what makes the epipolar distances of matched points too large.

    Parameters
    ----------
    rig
        The cameras as they were assumed, cropped.
    pixels0, pixels1
        The same points in the frames of each camera (x, y) [px], NaN where lost, shapes
        [n_frames, n_points, 2]; `Reconstruction.pixels` fits. The matches must not have been chosen by their
        epipolar distance.
    tolerance
        Median magnitude of the epipolar distances that a good calibration stays below [px].
    farthest
        Shifts between the frames of the cameras that are tried, either way; the series needs three frames
        more, and is not examined for them otherwise.

    Returns
    -------
    tuple of Finding
        Empty if nothing is wrong that epipolar distances show. They do not show a motion along the epipolar
        lines, or the exchange of cameras that are aligned to `tolerance`; an offset along them of some
        pixels only from `LEAST_FAINT` on (`dic.stereo.offsets.faint_offset`).

    Raises
    ------
    ValueError
        Shapes that do not fit, fewer than 20 pairs, a tolerance that is not positive, a lens distortion that
        cannot be undone.
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
    if not findings and len(pixels0) >= LEAST_FAINT[0]:
        rest = _at_rest(pixels0, pixels1, still)
        faint = faint_offset(rig, *rest) if len(rest[0]) >= LEAST_FAINT[1] else None
        findings += [] if faint is None else [_offset_finding(faint)]
    if len(pixels0) >= farthest + 3:
        sync = synchronisation(rig, pixels0 + shifts[0], pixels1 + shifts[1], farthest=farthest)
        if (found := _out_of_step(sync)) is not None:
            findings.append(found)
    return tuple(findings)


def _at_rest(
    pixels0: FloatArray, pixels1: FloatArray, still: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Mean places of the points in frames that hardly differ, as far as both cameras saw them, [n, 2]."""
    count = still.sum(axis=0)
    known = count > 0
    first, second = (
        np.where(still[..., None], pixels, 0.0).sum(axis=0)[known] / count[known, None]
        for pixels in (pixels0, pixels1)
    )
    return first, second


def _stillest(pixels: FloatArray, pair: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The frames with the least motion to the next one that together hold enough pairs, shape [n_frames]."""
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
    """Faults that are there without motion; then the rig and what to add to the pixels that undo them."""
    none = (np.zeros(2), np.zeros(2))
    before = _size(rig, p0, p1)
    if before <= tolerance:
        return [], rig, none
    swapped = StereoRig((rig.cameras[1], rig.cameras[0]))
    try:
        after = _size(swapped, p0, p1)
    except ValueError:  # where the other lens folds back, the other camera did not take this picture
        after = np.inf
    if after <= tolerance:
        return [_swap(before, after)], swapped, none
    best = {}
    for name, cameras in (("as given", rig), ("exchanged", swapped if np.isfinite(after) else rig)):
        offsets = [find_offset(cameras, p0, p1, where) for where in HYPOTHESES]
        best[name] = min(offsets, key=lambda offset: offset.after)
        if best[name].after <= tolerance:
            swap = [_swap(before, after)] if name == "exchanged" else []
            return [*swap, _offset_finding(best[name])], cameras, best[name].shifts
    what = (
        f"epipolar distances of {before:.2f} px (median) stay at {after:.2f} px with the cameras exchanged, "
        f"at {best['as given'].after:.2f} px with the best crop offset, "
        f"and at {best['exchanged'].after:.2f} px with both"
    )
    cure = "calibrate again: a camera or lens has moved, or this calibration is of another set-up"
    return [Finding(Fault.CALIBRATION, what, cure, before, before, ())], rig, none


def _swap(before: float, after: float) -> Finding:
    what = f"the cameras are exchanged: epipolar distances of {before:.2f} px are {after:.2f} px if swapped"
    cure = "give camera 0's pictures as camera 1's and the other way round, or swap them in the calibration"
    return Finding(Fault.SWAPPED_CAMERAS, what, cure, before, after, ())


def _size(rig: StereoRig, p0: FloatArray, p1: FloatArray) -> float:
    """Median magnitude of the epipolar distances [px]."""
    return float(np.median(np.abs(epipolar_distance(rig, p0, p1))))


def _offset_finding(offset: Offset) -> Finding:
    parts = [
        f"{axis} by {value:+.0f} ± {sigma:.1f} px"
        for axis, value, sigma in zip("xy", offset.value, offset.sigma, strict=True)
        if np.isfinite(sigma)
    ]
    unknown = [axis for axis, sigma in zip("xy", offset.sigma, strict=True) if not np.isfinite(sigma)]
    what = (
        f"the crop offset of {offset.where} is off, {' and '.join(parts)}: with that added, epipolar "
        f"distances of {offset.before:.2g} px are {offset.after:.2g} px"
    )
    cure = "take the crop offsets from the camera's own file header, and add what is missing"
    if unknown:
        cure += f"; {' and '.join(unknown)} cannot be told from epipolar distances, so check it too"
    if offset.where == "camera 1":
        cure += "; instead, an offset of camera 0 would explain it as well"
    shifts = offset.shifts
    value = (*(float(v) for v in shifts[0]), *(float(v) for v in shifts[1]))
    return Finding(Fault.CROP_OFFSET, what, cure, offset.before, offset.after, value)


def _out_of_step(sync: Synchronisation) -> Finding | None:
    """A finding if the motion tells that the cameras are apart by a quarter of a frame or more."""
    if not sync.decided or abs(sync.late) < 0.25:
        return None
    before = float(sync.scatter[sync.shifts == 0][0])
    whole = int(np.clip(round(sync.late), sync.shifts[0], sync.shifts[-1]))
    after = float(sync.scatter[sync.shifts == whole][0])
    who, other = ("1", "0") if sync.late > 0.0 else ("0", "1")
    frames = f"{abs(whole)} frame{'s' if abs(whole) > 1 else ''}"
    what = f"camera {who} is late by {abs(sync.late):.2f} ± {max(sync.late_sigma, 0.01):.2f} frames"
    cure = "look at the trigger: the cameras expose at different times within a frame"
    if whole:
        what += f": shifted by {frames}, epipolar distances scatter by {after:.3f} instead of {before:.3f} px"
        cure = f"leave out the first {frames} of camera {other}, and look at the trigger cables"
    return Finding(Fault.OUT_OF_STEP, what, cure, before, after, (sync.late,))
