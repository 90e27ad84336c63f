"""Health of whole frames: unreadable, black, saturated, repeated, or with a specular flash.

The limits are shares of pixels or ratios and do not depend on the grey range. Brightness is compared with
that of the surrounding frames, so a flickering lamp is not reported as a fault.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import blake2b
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from dic.basics import FloatArray, IntArray
from dic.images.series import PictureError, Pictures, PictureSizeError
from dic.outcome import FrameOutcome

AROUND = 11
"""Number of frames with which a frame's brightness is compared; the frame itself is in the middle."""
MOST_REPEATS = 0.1
"""Largest share of pictures equal to the previous one, in a series with noise."""
_LEAST_CORRELATION = 0.2
_FLASH_ABOVE = 1.2
"""A flash is brighter than the brightest spots of the surrounding frames by this factor."""
_BRIGHT = 99.5
"""Percentile of a frame's grey values that represents its brightest spots."""


@dataclass(frozen=True)
class FrameHealth:
    """Health of each frame of a series; numbers of an unreadable frame are NaN."""

    outcome: IntArray
    """`dic.FrameOutcome`: VALID, UNREADABLE, BLACK, SATURATED or REPEATED, shape [n_frames]."""
    mean: FloatArray
    """Mean grey value, shape [n_frames]."""
    gain: FloatArray
    """Median grey value over its median in the surrounding frames: flicker [-], shape [n_frames]."""
    contrast: FloatArray
    """Standard deviation of the signal that neighbouring pixels share [grey], shape [n_frames]. It contains
    no noise."""
    correlation: FloatArray
    """Correlation of neighbouring pixels; 0 if there is only noise [-], shape [n_frames]."""
    saturated: FloatArray
    """Share of pixels at `ceiling`, shape [n_frames]."""
    flash: FloatArray
    """Share of pixels that are brighter than the brightest spots of the surrounding frames, or saturated more
    often than in these frames. Flicker is corrected. NaN if more than `flash_share` of the pixels is usually
    saturated: a flash cannot then be detected. Shape [n_frames]."""
    flashed: NDArray[np.bool_]
    """Frames with a specular flash; points outside the flash remain valid. Shape [n_frames]."""
    ceiling: int
    """Grey value at which pixels saturate: 2**bits - 1, or lower if the histogram has a peak below it."""
    notes: Mapping[int, str]
    """Finding in one line by frame number, for frames that are not VALID or have a flash."""
    mismatched: tuple[int, ...]
    """Frames whose size or bits differ from those of the series."""
    constant: NDArray[np.bool_]
    """Frames whose grey values are all equal, below the largest possible one. Shape [n_frames]."""


def frame_health(
    pictures: Pictures,
    *,
    mask: NDArray[np.bool_] | None = None,
    noise: float = 0.0,
    most_saturated: float = 0.5,
    least_contrast: float = 0.05,
    flash_share: float = 0.01,
) -> FrameHealth:
    """Inspect every frame of a series.

    A frame is SATURATED if more than `most_saturated` of its pixels are at the ceiling. It is BLACK if it
    shows only noise. Then the correlation of neighbouring pixels is less than 0.2, or the contrast is below
    `noise` or below `least_contrast` of the series' median contrast. It is REPEATED if every pixel equals
    that of the previous frame: the noise of two exposures would differ.

    ``pictures``: the series. ``mask``: pixels that are inspected, shape [rows, columns]; None: all.
    ``noise``: standard deviation of a pixel's noise [grey], if known. ``most_saturated``, ``least_contrast``,
    ``flash_share``: limits, each from 0 to 1; a frame has a flash if its `flash` exceeds `flash_share`.
    Raises ValueError if a limit is out of range, or if the mask has another shape or no two neighbouring
    pixels.
    """
    for name, limit in (("most_saturated", most_saturated), ("least_contrast", least_contrast)):
        if not 0.0 < limit <= 1.0:
            raise ValueError(f"{name} must be above 0 and at most 1, got {limit}")
    if not 0.0 < flash_share <= 1.0 or not noise >= 0.0:
        raise ValueError(
            f"flash_share must be above 0 and at most 1, got {flash_share}; noise >= 0, got {noise}"
        )
    used = np.ones(pictures.shape, dtype=bool) if mask is None else np.asarray(mask, dtype=bool)
    if used.shape != pictures.shape or not np.any(used[:, 1:] & used[:, :-1]):
        raise ValueError(f"mask must be of shape {pictures.shape} with neighbouring pixels, is {used.shape}")

    statistics = _scan(pictures, used)
    readable = ~np.isnan(statistics.mean)
    ceiling = _ceiling(statistics.total)
    saturated = np.where(statistics.top >= ceiling, statistics.at_top, np.where(readable, 0.0, np.nan))
    gain = statistics.middle / np.maximum(_around(statistics.middle), 1.0)
    above = _brighter(statistics.histograms, gain)
    # in a bright scene a flash is only a little brighter than the bright spots, but it saturates
    usual = _around(saturated)
    flash = np.where(usual <= flash_share, np.fmax(above, saturated - usual), np.nan)

    outcome = np.full(pictures.n_frames, int(FrameOutcome.VALID))
    if (
        statistics.repeats.sum() <= MOST_REPEATS * pictures.n_frames
    ):  # otherwise the pictures have no noise and may be equal
        outcome[statistics.repeats] = int(FrameOutcome.REPEATED)
    typical = float(np.nanmedian(statistics.contrast)) if readable.any() else 0.0
    black = statistics.correlation < _LEAST_CORRELATION
    black |= statistics.contrast < max(noise, least_contrast * typical)
    outcome[black & readable] = int(FrameOutcome.BLACK)
    outcome[saturated > most_saturated] = int(FrameOutcome.SATURATED)
    # All grey values equal, below the largest: no light reached the sensor, or the file is no picture.
    constant = (statistics.contrast == 0.0) & (statistics.correlation == 0.0)
    constant &= statistics.mean < 2**pictures.bits - 1
    outcome[constant] = int(FrameOutcome.BLACK)
    outcome[~readable] = int(FrameOutcome.UNREADABLE)
    flashed = (flash > flash_share) & (outcome == FrameOutcome.VALID)
    notes = dict(statistics.unreadable)
    for index in np.flatnonzero(readable & ((outcome != FrameOutcome.VALID) | flashed)).tolist():
        name = "flash" if flashed[index] else FrameOutcome(int(outcome[index])).name.lower()
        name = "constant" if constant[index] else name
        notes[index] = (
            f"{pictures.path}, frame {index}: {name}: mean {statistics.mean[index]:.4g}, "
            f"contrast {statistics.contrast[index]:.3g} (usual {typical:.3g}), neighbours correlate "
            f"{statistics.correlation[index]:.2f}, {saturated[index]:.1%} at {ceiling}, "
            f"{flash[index]:.1%} in a flash"
        )
    return FrameHealth(
        outcome=outcome,
        mean=statistics.mean,
        gain=gain,
        contrast=statistics.contrast,
        correlation=statistics.correlation,
        saturated=saturated,
        flash=flash,
        flashed=flashed,
        ceiling=ceiling,
        notes=MappingProxyType(notes),
        mismatched=statistics.mismatched,
        constant=constant,
    )


_CURES = {
    "unreadable": "",  # its error has a finding
    "constant": "was the lens cap on, or the light off? is it the right file?",
    "black": "was the lens cap on, or the light off? is it the right file?",
    "saturated": "expose shorter, or close the lens; declare bits where the camera has fewer than stored",
    "repeated": "export each frame once",
}
"""Cure by the fault of an unusable picture (one word)."""


def check_series(pictures: Pictures, health: FrameHealth) -> None:
    """Reject a series that cannot be correlated.

    ``pictures``, ``health``: the series and its health by `frame_health`. Raises PictureError if a picture
    has another size or other bits than the series, or if fewer than two pictures are usable. Usable pictures
    are readable and not constant, black, saturated or repeated. The error names the first file or frame and
    the cause.
    """
    count = pictures.n_frames
    if health.mismatched:
        raise PictureError(
            pictures.path,
            f"{len(health.mismatched)} of {count} pictures are not like the others, the first: "
            f"{health.notes[health.mismatched[0]]}",
            cure="is a picture of another recording among them? leave it out, or export all alike",
        )
    bad = np.flatnonzero(health.outcome != FrameOutcome.VALID).tolist()
    if count - len(bad) >= 2 or count < 2:  # a correlation needs two pictures
        return
    kinds = [
        "constant" if health.constant[i] else FrameOutcome(int(health.outcome[i])).name.lower() for i in bad
    ]
    most = max(dict.fromkeys(kinds), key=kinds.count)
    words = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    raise PictureError(
        pictures.path,
        f"{len(bad)} of {count} pictures cannot be used ({words}), the first: {health.notes[bad[0]]}",
        cure=_CURES[most],
    )


@dataclass(frozen=True)
class _Scan:
    """Statistics from one pass over the frames: one value per frame, NaN for an unreadable frame."""

    mean: FloatArray
    middle: FloatArray
    contrast: FloatArray
    correlation: FloatArray
    top: FloatArray
    """Largest grey value."""
    at_top: FloatArray
    """Share of the pixels with the largest grey value."""
    histograms: list[IntArray | None]
    """Coarse histograms of at most 1024 bins, fine enough to detect a flash."""
    total: IntArray
    """Fine histogram of all frames."""
    unreadable: dict[int, str]
    mismatched: tuple[int, ...]
    repeats: NDArray[np.bool_]
    """True where every pixel equals that of the previous readable frame."""


def _scan(pictures: Pictures, used: NDArray[np.bool_]) -> _Scan:
    mean, middle, contrast, correlation, top, at_top = np.full((6, pictures.n_frames), np.nan)
    total = np.zeros(2**pictures.bits, dtype=np.int64)
    starts = np.arange(0, len(total), max(len(total) // 1024, 1))
    histograms: list[IntArray | None] = []
    unreadable: dict[int, str] = {}
    mismatched: list[int] = []
    repeats, before = np.zeros(pictures.n_frames, dtype=bool), b""
    for index in range(pictures.n_frames):
        try:
            picture = pictures.frame(index)
        except PictureError as error:
            unreadable[index] = str(error)
            mismatched += [index] if isinstance(error, PictureSizeError) else []
            histograms.append(None)
            continue
        digest = blake2b(picture.tobytes(), digest_size=16).digest()
        repeats[index], before = digest == before, digest
        values = picture[used]
        counts = np.bincount(values, minlength=len(total))
        total += counts
        histograms.append(np.add.reduceat(counts, starts))
        top[index] = np.flatnonzero(counts)[-1]
        at_top[index] = counts[int(top[index])] / values.size
        mean[index] = counts @ np.arange(len(counts)) / values.size
        middle[index] = np.searchsorted(np.cumsum(counts), values.size / 2.0)
        contrast[index], correlation[index] = _shared(picture, used)
    return _Scan(
        mean,
        middle,
        contrast,
        correlation,
        top,
        at_top,
        histograms,
        total,
        unreadable,
        tuple(mismatched),
        repeats,
    )


def _brighter(histograms: list[IntArray | None], gain: FloatArray) -> FloatArray:
    """Share of each frame's pixels that are brighter than the brightest spots of the surrounding frames."""
    bright = _around(np.array([_percentile(counts, _BRIGHT) for counts in histograms]))
    limits = _FLASH_ABOVE * bright * np.clip(gain, 0.5, 2.0)
    return np.array([_share_from(counts, limit) for counts, limit in zip(histograms, limits, strict=True)])


def _shared(picture: NDArray[np.generic], used: NDArray[np.bool_]) -> tuple[float, float]:
    """Standard deviation that neighbouring pixels share, without noise, and their correlation."""
    grey = np.where(used, picture.astype(np.float64) - picture[used].mean(), 0.0)
    variance = float(np.sum(grey * grey) / used.sum())
    if variance == 0.0:
        return 0.0, 0.0
    total, pairs = 0.0, 0
    for a, b, overlap in (
        (grey[:, 1:], grey[:, :-1], used[:, 1:] & used[:, :-1]),
        (grey[1:], grey[:-1], used[1:] & used[:-1]),
    ):
        total, pairs = total + float(np.sum(a * b)), pairs + int(overlap.sum())
    common = total / pairs
    return float(np.sqrt(max(common, 0.0))), common / variance


def _around(values: FloatArray) -> FloatArray:
    """Median over the `AROUND` frames around each frame; frames without a value are left out."""
    half = AROUND // 2
    with_ends = np.pad(values, half, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(with_ends, AROUND)
    medians = np.full(len(values), np.nan)
    some = ~np.all(np.isnan(windows), axis=1)
    medians[some] = np.nanmedian(windows[some], axis=1)
    return medians


def _share_from(counts: IntArray | None, level: float) -> float:
    """Share of the pixels at or above a level."""
    if counts is None or np.isnan(level):
        return float("nan")
    return float(counts[min(int(np.ceil(level)), len(counts)) :].sum() / counts.sum())


def _percentile(counts: IntArray | None, percent: float) -> float:
    """Bin below which `percent` of the pixels lie."""
    if counts is None:
        return float("nan")
    return float(np.searchsorted(np.cumsum(counts), percent / 100.0 * counts.sum()))


def _ceiling(counts: IntArray) -> int:
    """Saturation level: a peak at the largest grey value, far higher than the counts just below it."""
    full = len(counts) - 1
    top = int(np.max(np.flatnonzero(counts), initial=0))
    band = counts[int(0.98 * top) : top]
    piled = top > 0 and band.size > 0 and counts[top] > 20 and counts[top] > 20.0 * max(band.mean(), 0.05)
    return top if piled and top < full else full
