"""Quality of a speckle pattern: size, coverage, gradient, and the predicted noise floor."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray, IntArray
from dic.images.noise import GreyNoise, gradient, noise_gain
from dic.images.pattern import coverage_and_diameter, illumination, width_of_autocorrelation

LARGEST_SUBSET = 101
"""Largest subset that is tried for a wanted floor [px]."""
_LEAST_SHARE = 0.5
_MOST_POINTS = 300_000
"""Points at which the subset for a wanted floor is sought; larger pictures are sampled."""


@dataclass(frozen=True)
class SpeckleQuality:
    """A speckle pattern and what can be expected from it."""

    subset: int
    """Side of the square subset that the floor is for [px]."""
    size: tuple[float, float]
    """Speckle size along x and y: full width at half height of the autocorrelation [px]."""
    size_by_edges: float
    """Speckle size from coverage and edges: the diameter of randomly thrown discs with as many edges, of the
    phase that covers less [px]."""
    coverage: float
    """Share of the pixels on the dark side of Otsu's threshold, illumination evened out [-]."""
    mean_gradient: float
    """Mean intensity gradient: mean of |∇f|, the noise's part taken off in the square [grey/px]."""
    noise: float
    """Standard deviation of the noise used, its root mean square over the mask [grey]."""
    floor: FloatArray
    """Predicted standard deviation of a match in x and y at each pixel taken as a subset's centre [px],
    shape [rows, columns, 2]; NaN where less than half of the subset lies in the mask, infinite where the
    subset has no contrast."""
    wanted: float | None
    """The floor that was asked for [px]."""
    needed: IntArray | None
    """Smallest subset that reaches the wanted floor, 0 where none up to `LARGEST_SUBSET` does or the floor
    is NaN; shape [rows, columns], in large pictures the same over blocks of some pixels. None if no floor
    was asked for."""

    @property
    def median_floor(self) -> float:
        """Median of the floor over all points and both directions [px]."""
        known = self.floor[~np.isnan(self.floor)]
        return float(np.median(known)) if known.size else float("nan")

    @property
    def too_small(self) -> NDArray[np.bool_]:
        """Places where the subset misses the wanted floor, shape [rows, columns]; none if none was asked
        for."""
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
    Opt. Express 16, 7037, 2008; Wang et al., Strain 45, 160, 2009): with ``H = Σ ∇f ∇fᵀ`` over the subset
    and the variance σ² of each pixel, ``cov = 2 H⁻¹ (Σ σ² ∇f ∇fᵀ) H⁻¹``. For constant σ and no cross
    terms this is √(2σ²/ΣG²). The part of the noise in ∇f is taken off in the square. It holds for the
    subset's middle and for rigid and affine shape functions; quadratic ones scatter more.

    The size by edges takes the pattern for discs of one diameter thrown at random, which may overlap
    (Serra, Image Analysis and Mathematical Morphology, 1982, ch. XIII): with a share p covered, their
    chords have the mean ``π d/4 · p/((1 - p) ln(1/(1 - p)))``.

    Parameters
    ----------
    picture
        Grey values, shape [rows, columns]; best the mean of static frames.
    mask
        The pixels of the specimen, shape [rows, columns]; all if None.
    subset
        Side of the square subset [px]: odd, 5 to 101.
    noise
        Standard deviation of a pixel of one frame [grey], or how it depends on the grey value.
    averaged
        How many frames the picture is the mean of.
    wanted
        Floor to be reached [px]; asks for `SpeckleQuality.needed`.

    Raises
    ------
    ValueError
        A value outside its range, or a picture without contrast in the mask.
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
    left = sigma / float(np.sqrt(averaged))  # the noise of the picture itself
    even = f - illumination(f, used)
    sums, steepness = _sums(f, used, variance, averaged)
    floor = _floor(sums, subset)
    coverage, by_edges = coverage_and_diameter(f, f - even, used, left)
    return SpeckleQuality(
        subset=subset,
        size=width_of_autocorrelation(even, used, left),
        size_by_edges=by_edges,
        coverage=coverage,
        mean_gradient=steepness,
        noise=sigma,
        floor=floor,
        wanted=wanted,
        needed=None if wanted is None else _needed(sums, wanted, ~np.any(np.isnan(floor), axis=2)),
    )


def _sums(
    f: FloatArray, used: NDArray[np.bool_], variance: FloatArray, averaged: int
) -> tuple[FloatArray, float]:
    """Summed-area tables of Gx², Gy², GxGy, the same three times σ², and the mask; and the mean of |∇f|.

    Returns
    -------
    tuple
        The tables, shape [7, rows + 1, columns + 1], and the mean intensity gradient [grey/px].
    """
    from dic.opencv import cv2

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
    (top, bottom), (left, right) = ends
    xx, yy, xy, sxx, syy, sxy, share = (
        table[np.ix_(bottom, right)]
        - table[np.ix_(top, right)]
        - table[np.ix_(bottom, left)]
        + table[np.ix_(top, left)]
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


def _needed(sums: FloatArray, wanted: float, asked: NDArray[np.bool_]) -> IntArray:
    """Smallest odd subset whose floor is at most `wanted` in x and y, shape [rows, columns]."""
    rows, columns = asked.shape
    stride = int(np.ceil(np.sqrt(asked.size / _MOST_POINTS)))
    here = asked[::stride, ::stride]
    needed = np.zeros(here.shape, dtype=np.int64)
    for side in range(5, LARGEST_SUBSET + 1, 2):
        left = here & (needed == 0)
        if not left.any():
            break
        needed[left & np.all(_floor(sums, side, stride) <= wanted, axis=2)] = side
    full = np.repeat(np.repeat(needed, stride, axis=0), stride, axis=1)[:rows, :columns]
    return np.where(asked, full, 0)
