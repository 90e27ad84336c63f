"""Speckle size and coverage of a pattern, from its autocorrelation and from its edges."""

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray

Mask = NDArray[np.bool_]

_LARGEST_WINDOW = 1024
"""Side of the field whose autocorrelation is computed [px]."""


def width_of_autocorrelation(detail: FloatArray, used: Mask, sigma: float) -> tuple[float, float]:
    """Full width at half height of the autocorrelation along x and y [px]; NaN if it never falls by half.

    Parameters
    ----------
    detail
        Grey values less the illumination, shape [rows, columns].
    used
        The pixels that count, shape [rows, columns]; of a large field the middle is taken.
    sigma
        Standard deviation of the noise, taken off the peak [grey].
    """
    window = tuple(_middle(np.flatnonzero(used.any(axis=1 - axis))) for axis in (0, 1))
    detail, used = np.where(used, detail, 0.0)[window], used[window]
    shape = [2 * side for side in detail.shape]  # zeros around: no wrap

    def correlated(a: FloatArray) -> FloatArray:
        spectrum = np.fft.rfft2(a, s=shape)
        return np.asarray(np.fft.irfft2(spectrum * np.conj(spectrum), s=shape))

    pairs = correlated(used.astype(np.float64))
    mean = np.where(pairs > 0.5, correlated(detail) / np.maximum(pairs, 1.0), 0.0)
    peak = mean[0, 0] - sigma**2
    if peak <= 0.0:
        return float("nan"), float("nan")
    along_x, along_y = (line[: len(line) // 2] / peak for line in (mean[0, :], mean[:, 0]))
    return _half_width(along_x), _half_width(along_y)


def _middle(places: NDArray[np.int64]) -> slice:
    """The middle `_LARGEST_WINDOW` of what lies between the first and the last."""
    low, high = int(places[0]), int(places[-1]) + 1
    spare = max(high - low - _LARGEST_WINDOW, 0)
    return slice(low + spare // 2, high - (spare - spare // 2))


def _half_width(line: FloatArray) -> float:
    """Twice the lag at which a correlation falls to one half; the peak is set to 1."""
    line = np.concatenate([[1.0], line[1:]])
    below = np.flatnonzero(line < 0.5)
    if not below.size:
        return float("nan")
    k = int(below[0])
    return float(2.0 * (k - 1 + (line[k - 1] - 0.5) / (line[k - 1] - line[k])))


def coverage_and_diameter(f: FloatArray, level: FloatArray, used: Mask, sigma: float) -> tuple[float, float]:
    """Share of dark pixels, and diameter of discs thrown at random with the chords of the lesser phase [px].

    The picture over its illumination `level` is cut at Otsu's threshold. An edge counts where the grey value
    goes from two standard deviations of the noise on one side to as far on the other.
    """
    from dic.opencv import cv2

    even = np.divide(f, level, out=np.zeros(f.shape), where=used & (level > 0.0))
    low, high = np.percentile(even[used], (0.1, 99.9))
    if high <= low:
        return float("nan"), float("nan")
    scaled = np.clip(np.rint((even[used] - low) / (high - low) * 255.0), 0, 255).astype(np.uint8)
    cut, _ = cv2.threshold(scaled.reshape(-1, 1), 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    threshold = (low + (cut + 0.5) / 255.0 * (high - low)) * level
    dark = float(np.mean((f < threshold)[used]))

    side = np.where(f < threshold - 2.0 * sigma, -1, np.where(f > threshold + 2.0 * sigma, 1, 0))
    edges, length = 0, 0
    for signs, inside in ((side, used), (side.T, used.T)):
        edges += _changes(signs, inside)
        length += int((inside[:, 1:] & inside[:, :-1]).sum())
    p = min(dark, 1.0 - dark)
    if not edges or p == 0.0:
        return dark, float("nan")
    chord = p * length / (edges / 2.0)
    return dark, float(4.0 / np.pi * chord * (1.0 - p) * -np.log1p(-p) / p)


def _changes(side: NDArray[np.int64], used: Mask) -> int:
    """Number of changes of the rows between -1 and 1, zeros passed over, within the mask."""
    known = (side != 0) | ~used
    column = np.where(known, np.arange(side.shape[1]), -1)
    last = np.maximum.accumulate(column, axis=1)
    rows = np.arange(side.shape[0])[:, None]
    held = np.where(last >= 0, np.where(used, side, 0)[rows, np.maximum(last, 0)], 0)
    return int(np.sum(held[:, 1:] * held[:, :-1] == -1))


def illumination(f: FloatArray, used: Mask) -> FloatArray:
    """Illumination: Gaussian mean of the pixels that count, over a sixth of the field [grey]."""
    from dic.opencv import cv2

    width = max(float(np.sqrt(used.sum())) / 6.0, 8.0)
    step = max(int(width / 8.0), 1)  # smooth enough to be computed on coarser pixels
    rows, columns = f.shape
    coarse = (max(columns // step, 1), max(rows // step, 1))

    def smooth(values: FloatArray) -> FloatArray:
        small = cv2.resize(values, coarse, interpolation=cv2.INTER_AREA) if step > 1 else values
        blurred = cv2.GaussianBlur(small, (0, 0), width / step)
        return np.asarray(cv2.resize(blurred, (columns, rows), interpolation=cv2.INTER_LINEAR))

    weight, total = smooth(used.astype(np.float64)), smooth(np.where(used, f, 0.0))
    return np.asarray(total / np.maximum(weight, 1e-9))
