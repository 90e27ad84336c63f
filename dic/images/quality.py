"""Quality of pictures: noise of the grey values, speckle size and coverage, predicted noise floor.

The noise is measured in static frames. Gradients are those of a picture's interpolating quintic B-spline. The
speckle size is measured by the autocorrelation and by the edges.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from dic.basics import FloatArray, IntArray
from dic.images.series import Pictures

Mask = NDArray[np.bool_]

_LARGEST_WINDOW = 1024
"""Side of the field whose autocorrelation is computed [px]."""


def _width_of_autocorrelation(detail: FloatArray, used: Mask, sigma: float) -> tuple[float, float]:
    """Full width at half height of the autocorrelation along x and y [px]; NaN if it does not fall to one
    half."""
    window = tuple(_middle(np.flatnonzero(used.any(axis=1 - axis))) for axis in (0, 1))
    detail, used = np.where(used, detail, 0.0)[window], used[window]
    shape = [2 * side for side in detail.shape]  # padded with zeros: no wrap-around

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
    """The middle `_LARGEST_WINDOW` pixels between the first and the last place."""
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
    """Share of dark pixels [-], and diameter of random discs with the same chord lengths as the minor phase
    [px].

    The picture divided by its illumination `level` is binarised with Otsu's threshold. An edge is counted
    where the grey value crosses the threshold by more than two standard deviations of the noise on both
    sides.
    """
    from skimage.filters import threshold_otsu  # 0.4 s

    even = np.divide(f, level, out=np.zeros(f.shape), where=used & (level > 0.0))
    low, high = np.percentile(even[used], (0.1, 99.9))
    if high <= low:
        return float("nan"), float("nan")
    threshold = threshold_otsu(np.clip(even[used], low, high)) * level
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
    """Number of changes between -1 and 1 along the rows within the mask; zeros are skipped."""
    decided = (side != 0) | ~used
    column = np.where(decided, np.arange(side.shape[1]), -1)
    last = np.maximum.accumulate(column, axis=1)
    rows = np.arange(side.shape[0])[:, None]
    last_side = np.where(last >= 0, np.where(used, side, 0)[rows, np.maximum(last, 0)], 0)
    return int(np.sum(last_side[:, 1:] * last_side[:, :-1] == -1))


def illumination(f: FloatArray, used: Mask) -> FloatArray:
    """Illumination: Gaussian mean of the masked pixels, over a sixth of the field [grey]."""
    from dic.basics import cv2

    width = max(float(np.sqrt(used.sum())) / 6.0, 8.0)
    step = max(int(width / 8.0), 1)  # it is smooth, so coarser pixels are sufficient
    rows, columns = f.shape
    coarse = (max(columns // step, 1), max(rows // step, 1))

    def smooth(values: FloatArray) -> FloatArray:
        small = cv2.resize(values, coarse, interpolation=cv2.INTER_AREA) if step > 1 else values
        blurred = cv2.GaussianBlur(small, (0, 0), width / step)
        return np.asarray(cv2.resize(blurred, (columns, rows), interpolation=cv2.INTER_LINEAR))

    weight, total = smooth(used.astype(np.float64)), smooth(np.where(used, f, 0.0))
    return np.asarray(total / np.maximum(weight, 1e-9))


_VALUE = np.array([1.0, 26.0, 66.0, 26.0, 1.0]) / 120.0
_SLOPE = np.array([-1.0, -10.0, 0.0, 10.0, 1.0]) / 24.0
"""The quintic B-spline and its derivative at whole pixels."""


def gradient(picture: NDArray[np.generic]) -> tuple[FloatArray, FloatArray]:
    """Derivatives along x (columns) and y (rows) at the pixel centres [grey/px].

    ``picture``: grey values, shape [rows, columns]. Returns: the two derivatives, each of shape [rows,
    columns].
    """
    from scipy import ndimage

    coefficients = ndimage.spline_filter(np.asarray(picture, dtype=np.float64), order=5, mode="mirror")

    def along(axis: int) -> FloatArray:
        sloped = ndimage.correlate1d(coefficients, _SLOPE, axis=axis, mode="mirror")
        return np.asarray(ndimage.correlate1d(sloped, _VALUE, axis=1 - axis, mode="mirror"))

    return along(1), along(0)


@cache
def noise_gain() -> float:
    """Variance of `gradient` over that of independent noise of the pixels [1/px²]."""
    impulse = np.zeros((65, 65))
    impulse[32, 32] = 1.0
    return float(np.sum(gradient(impulse)[0] ** 2))


_BINS = 20


@dataclass(frozen=True)
class GreyNoise:
    """Standard deviation of the grey values, and its dependence on the grey value."""

    sigma: float
    """Standard deviation of one pixel of one frame, over the whole mask [grey]."""
    intercept: float
    """Variance at grey value 0 of the straight line `intercept + slope * grey` [grey²]."""
    slope: float
    """Increase of the variance with the grey value [grey]. Photon noise makes it positive."""
    slope_sigma: float
    """Standard deviation of the slope [grey]."""
    gain: FloatArray
    """Brightness of each frame relative to the mean of all (flicker) [-], shape [n_frames]. The noise does
    not include it."""
    motion: FloatArray
    """Rigid motion (x, y) of each frame relative to the mean of all [px], shape [n_frames, 2]. The noise does
    not include it."""

    def variance(self, grey: NDArray[np.generic]) -> FloatArray:
        """Variance at given grey values [grey²], by the straight line, not below a tenth of `sigma²`."""
        line = self.intercept + self.slope * np.asarray(grey, dtype=np.float64)
        return np.asarray(np.maximum(line, 0.1 * self.sigma**2))


def grey_noise(
    pictures: Pictures | Sequence[NDArray[np.generic]],
    frames: Sequence[int],
    *,
    mask: NDArray[np.bool_] | None = None,
) -> GreyNoise:
    """Measure the noise in static frames.

    Each frame k is compared with the mean M of all: ``f_k = b (M - u·∇M) + c + noise``, by least squares over
    the mask. The gain b and offset c remove flicker; u removes a rigid motion of a small part of a pixel. The
    variance is half of that of the differences between successive frames' residuals. A slow change of the
    picture is then not taken as noise. The median over the pairs is ``sigma²``. The line is fitted to the
    mean variance of pixels of similar brightness, weighted by its precision.

    ``pictures``: a series, or pictures of shape [rows, columns]. ``frames``: numbers of the static frames, at
    least two. ``mask``: pixels that are used, shape [rows, columns]; None: all. Exclude saturated pixels.
    Raises ValueError if there are fewer than two frames, if the mask has another shape or fewer than 100
    pixels, or if there is no noise. Raises PictureError if a frame cannot be read.
    """
    if len(frames) < 2:
        raise ValueError(f"noise needs at least 2 static frames, got {len(frames)}")
    read = pictures.frame if isinstance(pictures, Pictures) else pictures.__getitem__
    stack = [np.asarray(read(index)) for index in frames]
    mean = np.asarray(np.mean(stack, axis=0, dtype=np.float64))
    used = np.ones(mean.shape, dtype=bool) if mask is None else np.asarray(mask, dtype=bool)
    if used.shape != mean.shape or used.sum() < 100:
        raise ValueError(
            f"mask must be of shape {mean.shape} with at least 100 pixels, "
            f"is of shape {used.shape} with {used.sum()}"
        )
    columns = np.stack([part[used] for part in (mean, np.ones_like(mean), *gradient(mean))], axis=1)
    normal = np.linalg.pinv(columns.T @ columns)
    fitted = np.array([normal @ (columns.T @ frame[used]) for frame in stack])
    squares, levels = np.zeros(len(columns)), []
    for k in range(len(stack) - 1):  # one pair at a time to save memory
        first, second = (stack[m][used] - columns @ fitted[m] for m in (k, k + 1))
        square = (second - first) ** 2 / 2.0  # the variance of one frame's noise
        squares += square / (len(stack) - 1)
        levels.append(square.mean())
    sigma2 = float(np.median(levels))
    if sigma2 <= 0.0:
        raise ValueError("the frames are equal to the last bit: give other frames, or the noise as a number")
    intercept, slope, error = _line(mean[used], squares)
    gain = np.array([frame[used].mean() for frame in stack])
    return GreyNoise(
        sigma=float(np.sqrt(sigma2)),
        intercept=intercept,
        slope=slope,
        slope_sigma=error,
        gain=np.asarray(gain / gain.mean()),
        motion=np.asarray(-fitted[:, 2:] / fitted[:, :1]),  # b M, moved by u, is b (M - u·∇M)
    )


def _line(grey: FloatArray, variance: FloatArray) -> tuple[float, float, float]:
    """Intercept, slope and the slope's standard deviation of variance over grey value."""
    order = np.argsort(grey, kind="stable")
    bins = [part for part in np.array_split(order, _BINS) if part.size > 1]
    x = np.array([grey[part].mean() for part in bins])
    y = np.array([variance[part].mean() for part in bins])
    weight = 1.0 / np.array([max(variance[part].std() ** 2 / part.size, 1e-12) for part in bins])
    centre = np.sum(weight * x) / np.sum(weight)
    spread = float(np.sum(weight * (x - centre) ** 2))
    if spread <= 0.0 or np.ptp(x) <= 1e-9 * max(1.0, abs(centre)):
        return float(np.average(y, weights=weight)), 0.0, float("inf")
    slope = float(np.sum(weight * (x - centre) * y) / spread)
    return float(np.average(y, weights=weight) - slope * centre), slope, float(spread**-0.5)


LARGEST_SUBSET = 101
"""Largest subset that is tried for a wanted noise floor [px]."""
_LEAST_SHARE = 0.5
_MOST_POINTS = 300_000
"""Largest number of points at which the subset for a wanted floor is computed. Larger pictures are
sampled."""


@dataclass(frozen=True)
class SpeckleQuality:
    """Properties of a speckle pattern and its predicted noise floor."""

    subset: int
    """Side of the square subset for which the floor is predicted [px]."""
    size: tuple[float, float]
    """Speckle size along x and y: full width at half height of the autocorrelation [px]."""
    size_by_edges: float
    """Speckle size from coverage and edges [px]: the diameter of random discs with the same number of edges.
    It is that of the phase with the smaller area."""
    coverage: float
    """Share of the pixels below Otsu's threshold, after correction of the illumination [-]."""
    mean_gradient: float
    """Mean intensity gradient: mean of |∇f|, with the noise's contribution to |∇f|² subtracted [grey/px]."""
    noise: float
    """Standard deviation of the noise, root mean square over the mask [grey]."""
    floor: FloatArray
    """Predicted standard deviation of a match in x and y, for a subset centred at each pixel [px], shape
    [rows, columns, 2]. It is NaN where less than half of the subset lies in the mask, and infinite where the
    subset has no contrast."""
    wanted: float | None
    """The requested floor [px]; None if there was no request."""
    needed: IntArray | None
    """Side of the smallest subset that reaches the wanted floor [px]. 0 where no subset up to
    `LARGEST_SUBSET` reaches it, or where the floor is NaN. Shape [rows, columns]; in large pictures constant
    over small blocks of pixels. None if no floor was requested."""

    @property
    def median_floor(self) -> float:
        """Median of the floor over all points and both directions [px]."""
        finite = self.floor[~np.isnan(self.floor)]
        return float(np.median(finite)) if finite.size else float("nan")

    @property
    def too_small(self) -> NDArray[np.bool_]:
        """Pixels where the subset does not reach the wanted floor, shape [rows, columns]; all False without a
        wanted floor."""
        if self.wanted is None:
            return np.zeros(self.floor.shape[:2], dtype=bool)
        return np.asarray(np.any(self.floor > self.wanted, axis=2))


def speckle_quality(
    picture: NDArray[np.generic],
    mask: NDArray[np.bool_] | None,
    subset: int,
    noise: float | GreyNoise,
    *,
    averaged: int = 1,
    wanted: float | None = None,
) -> SpeckleQuality:
    """Report on a speckle pattern.

    The floor follows from the sum of squared differences of two pictures with the same noise (Pan et al.,
    Opt. Express 16, 7037, 2008; Wang et al., Strain 45, 160, 2009): with ``H = Σ ∇f ∇fᵀ`` over the subset and
    the variance σ² of each pixel, ``cov = 2 H⁻¹ (Σ σ² ∇f ∇fᵀ) H⁻¹``. For constant σ and no cross terms this
    is √(2σ²/ΣG²). The noise's contribution to ∇f is subtracted in the square. The floor is valid at the
    subset's centre for rigid and affine shape functions; quadratic ones scatter more.

    The size by edges assumes randomly placed discs of one diameter. The discs may overlap (Serra, Image
    Analysis and Mathematical Morphology, 1982, ch. XIII). If they cover a share p, the mean length of their
    chords is ``π d/4 · p/((1 - p) ln(1/(1 - p)))``.

    ``picture``: grey values, shape [rows, columns]; preferably the mean of static frames. ``mask``: the
    pixels of the specimen, shape [rows, columns]; None: all. ``subset``: side of the square subset [px]: odd,
    5 to 101. ``noise``: standard deviation of a pixel of one frame [grey], or its dependence on the grey
    value. ``averaged``: number of averaged frames in the picture. ``wanted``: requested floor [px]; if given,
    `SpeckleQuality.needed` is computed. Raises ValueError if a value is outside its range, or if the picture
    has no contrast in the mask.
    """
    f = np.asarray(picture, dtype=np.float64)
    used = np.ones(f.shape, dtype=bool) if mask is None else np.asarray(mask, dtype=bool)
    if f.ndim != 2 or used.shape != f.shape or used.sum() < 100:
        raise ValueError(
            f"mask must be of the picture's shape {f.shape} with at least 100 pixels, "
            f"is of shape {used.shape} with {used.sum()}"
        )
    if subset % 2 == 0 or not 5 <= subset <= LARGEST_SUBSET:
        raise ValueError(f"subset must be odd, from 5 to {LARGEST_SUBSET} px, got {subset}")
    if averaged < 1:
        raise ValueError(f"averaged must be at least 1 frame, got {averaged}")
    if wanted is not None and not wanted > 0.0:
        raise ValueError(f"wanted must be a positive floor in px, got {wanted}")
    variance = noise.variance(f) if isinstance(noise, GreyNoise) else np.full(f.shape, float(noise) ** 2)
    if not np.all(np.isfinite(variance)) or np.any(variance <= 0.0):
        raise ValueError(f"noise must be a positive standard deviation in grey values, got {noise}")
    if np.ptp(f[used]) == 0.0:
        raise ValueError(f"the picture has one grey value in the mask, {f[used][0]}: there are no speckles")

    sigma = float(np.sqrt(variance[used].mean()))
    mean_noise = sigma / float(np.sqrt(averaged))  # noise of the averaged picture
    even = f - illumination(f, used)
    sums, steepness = _sums(f, used, variance, averaged)
    floor = _floor(sums, subset)
    coverage, by_edges = coverage_and_diameter(f, f - even, used, mean_noise)
    return SpeckleQuality(
        subset=subset,
        size=_width_of_autocorrelation(even, used, mean_noise),
        size_by_edges=by_edges,
        coverage=coverage,
        mean_gradient=steepness,
        noise=sigma,
        floor=floor,
        wanted=wanted,
        needed=None if wanted is None else _smallest_subset(sums, wanted, ~np.any(np.isnan(floor), axis=2)),
    )


def _sums(
    f: FloatArray, used: NDArray[np.bool_], variance: FloatArray, averaged: int
) -> tuple[FloatArray, float]:
    """Summed-area tables of Gx², Gy², GxGy, the same three times σ², and the mask; and the mean of |∇f|."""
    from dic.basics import cv2

    gx, gy = gradient(f)
    excess = noise_gain() * variance / averaged
    xx, yy, xy = gx * gx - excess, gy * gy - excess, gx * gy
    mean = float(np.sqrt(np.maximum((xx + yy)[used], 0.0)).mean())
    parts = (xx, yy, xy, xx * variance, yy * variance, xy * variance, np.ones_like(f))
    return np.stack([cv2.integral(np.where(used, part, 0.0), sdepth=cv2.CV_64F) for part in parts]), mean


def _floor(sums: FloatArray, subset: int, stride: int = 1) -> FloatArray:
    """Predicted standard deviations of x and y around every `stride`-th pixel, shape [rows, columns, 2]."""
    half = subset // 2
    ends = []
    for size in (sums.shape[1] - 1, sums.shape[2] - 1):
        middle = np.arange(0, size, stride)
        ends.append((np.maximum(middle - half, 0), np.minimum(middle + half + 1, size)))
    (top, bottom), (near_side, far_side) = ends
    xx, yy, xy, sxx, syy, sxy, share = (
        table[np.ix_(bottom, far_side)]
        - table[np.ix_(top, far_side)]
        - table[np.ix_(bottom, near_side)]
        + table[np.ix_(top, near_side)]
        for table in sums
    )
    determinant = xx * yy - xy * xy
    firm = (xx > 0.0) & (yy > 0.0) & (determinant > 1e-9 * xx * yy)
    scale = np.where(firm, determinant, 1.0)
    a, b, c = yy / scale, -xy / scale, xx / scale  # H⁻¹ = [[a, b], [b, c]]
    x = 2.0 * (a * a * sxx + 2.0 * a * b * sxy + b * b * syy)
    y = 2.0 * (b * b * sxx + 2.0 * b * c * sxy + c * c * syy)
    floor = np.sqrt(np.maximum(np.stack([x, y], axis=-1), 0.0))
    floor[~firm] = np.inf
    floor[share < _LEAST_SHARE * subset**2] = np.nan
    return np.asarray(floor)


def _smallest_subset(sums: FloatArray, wanted: float, judged: NDArray[np.bool_]) -> IntArray:
    """Smallest odd subset whose floor is at most `wanted` in x and y, shape [rows, columns]."""
    rows, columns = judged.shape
    stride = int(np.ceil(np.sqrt(judged.size / _MOST_POINTS)))
    sampled = judged[::stride, ::stride]
    smallest = np.zeros(sampled.shape, dtype=np.int64)
    for side in range(5, LARGEST_SUBSET + 1, 2):
        open_points = sampled & (smallest == 0)
        if not open_points.any():
            break
        smallest[open_points & np.all(_floor(sums, side, stride) <= wanted, axis=2)] = side
    full = np.repeat(np.repeat(smallest, stride, axis=0), stride, axis=1)[:rows, :columns]
    return np.where(judged, full, 0)
