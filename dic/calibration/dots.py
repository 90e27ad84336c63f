"""Dots and corners of a target located in a picture, with their uncertainty.

A dot's outline gives a first ellipse. The centroid is weighted with the darkness relative to a plane through
the surrounding brightness. Then a blurred elliptical disc is fitted to the grey values at the edge. The
uncertainty of corners of squares follows from the noise of the grey values.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.basics import MAD, BoolArray, FloatArray, IntArray, cv2

WINDOW, RING = 1.35, 1.85
"""The first value is the extent of the centroid, the second that of the brightness around it [radii of the
dot]."""
MARGIN = 1.5
"""Added to both extents for the blur of the lens [px]."""
CENTROID_PIXELS_AT_ONCE = 60_000
"""Number of pixels processed at once. It is large, so other threads can work meanwhile. It is small enough to
reuse memory for each array."""
RING_PIXELS = 1000
"""Largest number of pixels around a dot for the fit of the plane. If there are more, evenly spaced ones are
used."""


def centroids(image: FloatArray, ellipses: FloatArray, noise: float) -> FloatArray:
    """Centroids of outlined dots, as defined in `dic.calibration.dots.find_dots`.

    ``image``: grey values, dots dark, shape [rows, columns]. ``ellipses``: outlines: centre x, y, diameters
    along both axes [px] and angle of the first [degrees], shape [n, 5]. ``noise``: standard deviation of the
    grey values. Returns: x, y and their standard deviation [px], mass [px²] and darkness [-] of each dot,
    shape [n, 5]; NaN where the surroundings of a dot cannot be distinguished from it.
    """
    result = np.full((len(ellipses), 5), np.nan)
    reach = np.ceil(0.5 * ellipses[:, 2:4].max(axis=1, initial=0.0) * RING + 2.0 * MARGIN).astype(int) + 2
    order = np.argsort(reach, kind="stable")
    first = 0
    while first < len(order):
        # dots of similar size are processed together with the window of the largest
        size = np.cumsum(np.ones(len(order) - first, dtype=int)) * (2 * reach[order[first:]] + 1) ** 2
        rows = order[
            first : first + max(1, int(np.searchsorted(size, CENTROID_PIXELS_AT_ONCE, side="right")))
        ]
        result[rows] = _batch_centroids(image, ellipses[rows], int(reach[rows].max()), noise)
        first += len(rows)
    return result


def _batch_centroids(image: FloatArray, ellipses: FloatArray, reach: int, noise: float) -> FloatArray:
    """`centroids` of dots with windows of one size, shape [n, 5]."""
    result = np.full((len(ellipses), 5), np.nan)
    rows, x0, y0 = np.arange(len(ellipses)), ellipses[:, 0].copy(), ellipses[:, 1].copy()
    for last in (False, True):  # a second time with the window about the centre from the first time
        part = _Window(image, x0[rows], y0[rows], ellipses[rows, 2:], reach)
        plane, fine = _plane(part)
        around = plane[:, :1] + plane[:, 1:2] * part.inner_x + plane[:, 2:] * part.inner_y
        least = np.where(part.inner, around, np.inf).min(axis=1, initial=np.inf)
        fine &= least > 4.0 * noise
        around = np.where(part.inner & fine[:, None], around, 1.0)
        w = np.where(part.inner & fine[:, None], 1.0 - part.inner_grey / around, 0.0)
        mass = w.sum(axis=1)
        major, minor = ellipses[rows, 2], ellipses[rows, 3]
        fine &= mass > 0.15 * 0.25 * np.pi * major * minor
        mass = np.where(fine, mass, 1.0)
        shift = np.stack([np.sum(w * part.inner_x, axis=1), np.sum(w * part.inner_y, axis=1)]) / mass
        fine &= np.hypot(*shift) <= 0.25 * minor
        x0[rows] += shift[0]
        y0[rows] += shift[1]
        if not last:
            rows = rows[fine]
    spread = (part.inner_x - shift[0][:, None]) ** 2 + (part.inner_y - shift[1][:, None]) ** 2
    variance = np.sum(np.where(part.inner, spread * (noise / around) ** 2, 0.0), axis=1)
    sigma = np.maximum(np.sqrt(0.5 * variance) / mass, 1e-4)
    centroids = np.stack([x0[rows], y0[rows], sigma, mass, _quantile(w, part.inner, 0.9)], axis=1)
    result[rows[fine]] = centroids[fine]
    return result


class _Window:
    """Lists of the pixels in and around n dots: offsets from the centre [px], grey values, and whether they
    count."""

    def __init__(
        self, image: FloatArray, x0: FloatArray, y0: FloatArray, ellipses: FloatArray, reach: int
    ) -> None:
        rows, columns = image.shape
        offsets = np.arange(-reach, reach + 1)
        along, down = np.tile(offsets, len(offsets)), np.repeat(offsets, len(offsets))
        x, y = np.round(x0).astype(int), np.round(y0).astype(int)
        dx, dy = x - x0, y - y0
        c, s = np.cos(np.deg2rad(ellipses[:, 2])), np.sin(np.deg2rad(ellipses[:, 2]))
        grid = np.stack([along * along, along * down, down * down, along, down, np.ones_like(along)], axis=0)

        def inside_of(by: float, margin: float) -> BoolArray:  # expanded in the whole offsets
            p, q = (1.0 / (0.5 * ellipses[:, k] * by + margin) ** 2 for k in (0, 1))
            xx, xy, yy = p * c * c + q * s * s, 2.0 * (p - q) * c * s, p * s * s + q * c * c
            slopes = 2.0 * xx * dx + xy * dy, xy * dx + 2.0 * yy * dy
            constant = xx * dx * dx + xy * dx * dy + yy * dy * dy
            return np.stack([xx, xy, yy, *slopes, constant], axis=1) @ grid.astype(np.float64) <= 1.0

        wide, ring = inside_of(WINDOW, MARGIN), inside_of(RING, 2.0 * MARGIN)
        ring &= ~wide
        far = (x < reach) | (y < reach) | (x >= columns - reach) | (y >= rows - reach)
        for k in np.flatnonzero(far):  # a window that extends past the picture's edge
            i, j = x[k] + along, y[k] + down
            inside = (i >= 0) & (j >= 0) & (i < columns) & (j < rows)
            wide[k] &= inside
            ring[k] &= inside

        flat, shift = image.reshape(-1), down * columns + along

        def pixels_of(index: IntArray, inside: BoolArray) -> tuple[FloatArray, FloatArray, FloatArray]:
            place = np.where(inside, (y * columns + x)[:, None] + shift[index], 0)
            return along[index] + (x - x0)[:, None], down[index] + (y - y0)[:, None], flat[place]

        index, self.inner = _pixel_lists(wide)
        self.inner_x, self.inner_y, self.inner_grey = pixels_of(index, self.inner)
        every = np.maximum(1, np.count_nonzero(ring, axis=1) // RING_PIXELS)
        index, self.ring = _pixel_lists(ring, every)
        self.ring_x, self.ring_y, self.ring_grey = pixels_of(index, self.ring)


def _pixel_lists(mask: BoolArray, every: IntArray | None = None) -> tuple[IntArray, BoolArray]:
    """Columns at which each row of a mask is true (of row i only every ``every[i]``-th one), padded to shape
    [n, m], and a mask of the valid entries."""
    row, column = np.nonzero(mask)
    count = np.count_nonzero(mask, axis=1)
    if every is not None and np.any(every > 1):
        place = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
        selected = place % every[row] == 0
        column, count = column[selected], np.bincount(row[selected], minlength=len(mask))
    valid = np.arange(max(int(count.max(initial=0)), 1)) < count[:, None]
    index = np.zeros(valid.shape, dtype=np.int64)
    index[valid] = column
    return index, valid


def _quantile(values: FloatArray, used: BoolArray, share: float) -> FloatArray:
    """Quantile of each row's valid values with linear interpolation, shape [n]; NaN without values."""
    ordered = np.sort(np.where(used, values, np.inf), axis=1)
    count = np.count_nonzero(used, axis=1)
    place = share * np.maximum(count - 1, 0)
    low = np.floor(place).astype(int)
    high = np.minimum(low + 1, np.maximum(count - 1, 0))
    rows = np.arange(len(values))
    a, b = ordered[rows, low], ordered[rows, high]
    quantile = a + (place - low) * np.where(count > 0, b - a, 0.0)
    return np.where(count > 0, quantile, np.nan)


def _plane(part: _Window) -> tuple[FloatArray, BoolArray]:
    """Brightness a + b x + c y around the dots without other objects, [n, 3], and whether pixels suffice."""
    basis = np.stack([np.ones_like(part.ring_x), part.ring_x, part.ring_y], axis=1)
    used, fine = part.ring, np.ones(len(basis), dtype=bool)
    for last in (False, False, True):
        fine = fine & (np.count_nonzero(used, axis=1) >= 12)
        weighted = basis * (used & fine[:, None])[:, None]
        normal = weighted @ np.swapaxes(basis, 1, 2)
        normal[~fine] = np.eye(3)
        normal += 1e-12 * normal[:, :1, :1] * np.eye(3)  # pixels on one line determine no plane
        solution = np.linalg.solve(normal, weighted @ part.ring_grey[..., None])
        if last:
            break
        off = np.abs(part.ring_grey - (np.swapaxes(solution, 1, 2) @ basis)[:, 0])
        middle = np.where(fine, _quantile(off, used, 0.5), 0.0)
        limit = 4.0 * MAD * middle + 1e-9 * np.abs(solution[:, 0, 0])
        used = part.ring & (off <= limit[:, None])
    return solution[..., 0], fine


Single = NDArray[np.float32]

STEPS = 8
"""Largest number of Gauss-Newton steps."""
CONVERGED = 1e-5
"""A dot has converged if a step moves its centre by less than this [px]; noise is about a hundred times
larger."""
EDGE_PIXELS_AT_ONCE = 250_000
"""Number of pixels of the dots that are fitted at once. It is large, so other threads can process
pictures."""
ROOT = float(np.sqrt(2.0 * np.pi))
"""√(2π)"""
HASTINGS = (0.3275911, 0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429)
"""Coefficients p and a1 to a5 of Hastings' approximation of the error function."""
PILOT = 16
"""Every such dot is fitted first. Its blur and size, relative to the outline, are the start of the others."""
LARGEST = 25.0
"""Largest radius of a dot for the fit of its outline [px]. The centroid of a larger dot is accurate to a few
mpx. Its printed outline deviates from an ellipse by the same amount."""


def _fit_discs(
    image: FloatArray, centre: FloatArray, shape: FloatArray, reach: float, noise: float
) -> tuple[FloatArray, FloatArray]:
    """Centres of dark discs and their standard deviations, all dots of a picture at once.

    Let d be the offset from the centre and q = √(dᵀ M d); the outline is q = 1. The model is

        I = (B + g · d) (1 - D Φ(-δ / s)),     δ = (q - 1) q / |M d|                               (CC.3)

    δ is the distance from the outline to first order, Φ the normal distribution and s the blur. The
    brightness, its slope, D, M, s and the centre are found by Gauss-Newton steps. Only the edge determines
    the position. Unlike in a centroid, the noise of the surrounding surface has no effect.
    """
    w = int(np.ceil(reach))
    pilot = _fit_block(image, centre[::PILOT], shape[::PILOT], 0.8, w, noise)
    pilot = pilot[np.isfinite(pilot[:, 0])]
    blur, scale = np.median(pilot[:, 3:], axis=0) if len(pilot) > 2 else (0.8, 1.0)
    step = max(1, EDGE_PIXELS_AT_ONCE // (2 * w + 1) ** 2)
    parts = [slice(first, first + step) for first in range(0, len(centre), step)]
    fits = [_fit_block(image, centre[rows], scale * shape[rows], blur, w, noise) for rows in parts]
    fitted = np.concatenate(fits)
    return fitted[:, :2], fitted[:, 2]


def _fit_block(
    image: FloatArray, centre: FloatArray, shape: FloatArray, blur: float, w: int, noise: float
) -> FloatArray:
    """`_fit_discs` of some dots, with windows of half side `w`: x, y, their sigma, s, and M relative to its
    start, shape [n, 5]."""
    n, offsets = len(centre), np.arange(-w, w + 1)
    column, row = np.round(centre).astype(int).T
    inside = (column >= w) & (row >= w) & (column < image.shape[1] - w) & (row < image.shape[0] - w)
    column, row = np.where(inside, column, w), np.where(inside, row, w)
    across, down = np.tile(offsets, len(offsets)), np.repeat(offsets, len(offsets))
    values = image[row[:, None] + down, column[:, None] + across].astype(np.float32)
    xx, yy = across.astype(np.float32), down.astype(np.float32)
    bottom, top = np.sort(values, axis=1)[:, [xx.size // 10, -1 - xx.size // 10]].T
    p = np.zeros((n, 10))  # x, y, Mxx, Mxy, Myy, s, B, gx, gy, D
    p[:, :2] = np.where(inside[:, None], centre - np.stack([column, row], axis=1), 0.0)
    p[:, 2:5], p[:, 5], p[:, 6], p[:, 9] = shape, blur, top, 1.0 - bottom / np.maximum(top, 1e-9)
    start = p[:, :2].copy()
    normal, last = np.tile(np.eye(10), (n, 1, 1)), np.full((n, 2), np.nan)
    rows, room = np.arange(n), np.empty((n, 11, xx.size), dtype=np.float32)
    with np.errstate(all="ignore"):  # a dot whose fit diverges becomes NaN; the caller handles it
        for _ in range(STEPS):
            J = room[: len(rows)]  # and the residual as its last row
            np.subtract(values[rows], _model(p[rows], xx, yy, J), out=J[:, 10])
            product = (J @ np.swapaxes(J[:, :10], 1, 2)).astype(np.float64)
            N, right = product[:, :10], product[:, 10]
            bad = ~(np.isfinite(N).all(axis=(1, 2)) & np.isfinite(right).all(axis=1))
            N[bad], right[bad] = np.eye(10), np.nan
            scaled, scale = _scale(N)
            step = scale * np.linalg.solve(scaled, (scale * right)[..., None])[..., 0]
            p[rows] += step
            p[rows, 5] = np.maximum(p[rows, 5], 0.3)  # an edge sharper than a pixel's width is noise
            normal[rows], last[rows] = N, step[:, :2]
            rows = rows[np.abs(step[:, :2]).max(axis=1) > CONVERGED]
            if not len(rows):
                break
        scaled, scale = _scale(normal)
        inverse = np.linalg.inv(scaled)
        sigma = noise * np.sqrt(
            0.5 * np.sum(np.einsum("nkk->nk", inverse)[:, :2] * scale[:, :2] ** 2, axis=1)
        )
        off = np.hypot(*(p[:, :2] - start).T)
        fine = inside & (off < 0.5) & (np.abs(last).max(axis=1) < 0.01) & np.isfinite(sigma)
        ratio = (p[:, 2] + p[:, 4]) / (shape[:, 0] + shape[:, 2])
    result = np.stack([p[:, 0] + column, p[:, 1] + row, sigma, p[:, 5], ratio], axis=1)
    return np.where(fine[:, None], result, np.nan)


def _scale(normal: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Slightly damped normal matrices with a diagonal of 1, shape [n, 10, 10], and their scales, shape [n,
    10]."""
    scale = 1.0 / np.sqrt(np.einsum("nkk->nk", normal) + 1e-300)
    return normal * scale[:, :, None] * scale[:, None] + 1e-9 * np.eye(10), scale


def _model(p: FloatArray, xx: Single, yy: Single, J: Single) -> Single:
    """Grey values, Eq. (CC.3), shape [n, pixels]; their derivatives go to J, shape [n, 10, pixels]."""
    x0, y0, a, b, c, s, B, Bx, By, D = (p[:, k : k + 1].astype(np.float32) for k in range(10))
    dx, dy = xx - x0, yy - y0
    mx, my = a * dx + b * dy, b * dx + c * dy
    q = np.sqrt(np.maximum(dx * mx + dy * my, 1e-12))
    slope = np.maximum(np.sqrt(mx * mx + my * my), 1e-9)
    delta = (q - 1.0) * q / slope
    x = np.clip(delta / s, -8.0, 8.0)  # products of even smaller slopes would be subnormal, which is slow
    bell = np.exp(-0.5 * x**2)
    S = _upper(x, bell)
    light, loss = B + Bx * dx + By * dy, 1.0 - D * S
    edge = light * bell * (-D / (ROOT * s))  # by -δ
    by_slope = edge / slope
    across, down = -by_slope * dx, -by_slope * dy
    pairs = ((by_slope, mx), (by_slope, my), (0.5 * across, dx), (across, dy), (0.5 * down, dy), (edge, x))
    for k, (one, other) in enumerate((*pairs, (loss, 1.0), (loss, dx), (loss, dy), (-light, S))):
        np.multiply(one, other, out=J[:, k])
    return light * loss


def _upper(x: Single, bell: Single) -> Single:
    """Normal distribution Φ(-x) to 1e-7, given exp(-x²/2), by Hastings (Abramowitz and Stegun 7.1.26) in a
    tenth of SciPy's time."""
    t = 1.0 / (1.0 + HASTINGS[0] / np.sqrt(2.0, dtype=x.dtype) * np.abs(x))
    total = HASTINGS[-1] * t
    for a in HASTINGS[-2:0:-1]:
        total += a
        total *= t
    return np.asarray(0.5 - np.sign(x) * (0.5 - 0.5 * total * bell))


BANDS, BAND = 16, 24
"""Number of bands for the noise estimate, and number of rows of a band."""


def grey(picture: NDArray[np.generic]) -> FloatArray:
    """A picture in float64.

    Raises ValueError if it is not one grey picture of at least 16 x 16 finite values.
    """
    image = np.asarray(picture)
    if image.ndim != 2 or min(image.shape) < 16:
        raise ValueError(
            f"a target's picture must be grey, [rows, columns] of at least 16 x 16 px, got "
            f"shape {image.shape}"
        )
    image = image.astype(np.float64)
    if not np.all(np.isfinite(image)):
        raise ValueError("a target's picture must have finite grey values")
    return image


def quantiles(values: NDArray[np.generic], shares: Sequence[float]) -> FloatArray:
    """`numpy.quantile`. Grey values of few bits are counted instead of sorted."""
    if values.dtype not in (np.uint8, np.uint16):
        return np.asarray(np.quantile(values.astype(np.float64), shares))
    rank = np.asarray(shares, dtype=np.float64) * (values.size - 1)
    below = np.cumsum(np.bincount(values.reshape(-1)))
    low, high = (np.searchsorted(below, k(rank), side="right") for k in (np.floor, np.ceil))
    return np.asarray(low + (rank - np.floor(rank)) * (high - low), dtype=np.float64)


def noise_level(picture: NDArray[np.generic]) -> float:
    """Standard deviation of the grey values' noise, at least that of rounding.

    It is computed from second differences along both axes, N = [1 -2 1; -2 4 -2; 1 -2 1] [Immerkær1996]_.
    They are 0 for a plane and for a straight edge along an axis. Only bright pixels away from dots are used.
    Bands of rows distributed over the picture represent the whole picture.

    .. [Immerkær1996] J. Immerkær, Fast noise variance estimation, Computer Vision and Image
       Understanding 64 (1996) 300-302, doi:10.1006/cviu.1996.0060.
    """
    image = np.asarray(picture)
    starts = np.unique(np.linspace(0, max(len(image) - BAND, 0), BANDS).astype(int))
    bands = [grey(image[k : k + BAND]) for k in starts]
    kernel = np.array([[1.0, -2.0, 1.0], [-2.0, 4.0, -2.0], [1.0, -2.0, 1.0]])
    responses = [np.abs(cv2.filter2D(band, cv2.CV_64F, kernel)) for band in bands]
    limit = 0.5 * float(
        np.sum(quantiles(np.concatenate([image[k : k + BAND] for k in starts]), (0.02, 0.98)))
    )
    bright = [(band > limit).astype(np.uint8) for band in bands]
    part = np.concatenate([response[1:-1, 1:-1].ravel() for response in responses])
    for size in (9, 5, 3):  # as far from dots and corners as possible with enough pixels
        away = [cv2.erode(b, np.ones((size, size)), borderType=cv2.BORDER_REPLICATE) > 0 for b in bright]
        samples = [r[1:-1, 1:-1][a[1:-1, 1:-1]] for r, a in zip(responses, away, strict=True)]
        if sum(map(len, samples)) > 1000:
            part = np.concatenate(samples)
            break
    return max(MAD * float(np.median(part)) / 6.0, 1.0 / np.sqrt(12.0))


def eight_bits(picture: NDArray[np.generic]) -> NDArray[np.uint8]:
    """The picture scaled to 0 to 255, as OpenCV's detectors require."""
    image = np.asarray(picture)
    checked = image if image.dtype in (np.uint8, np.uint16) and image.ndim == 2 else grey(image)
    stretched = cv2.normalize(checked, None, 0, 255, cv2.NORM_MINMAX, cv2.CV_8U)  # type: ignore[call-overload]
    return np.asarray(stretched, dtype=np.uint8)


def refined(picture: NDArray[np.generic], corners: FloatArray, reach: int) -> FloatArray:
    """Corners to a fraction of a pixel, from the gradients within `reach` of them [px], shape [n, 2]."""
    image = grey(picture).astype(np.float32)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-5)
    start = np.array(corners, dtype=np.float32, order="C").reshape(-1, 1, 2)
    refined_corners = cv2.cornerSubPix(image, start, (reach, reach), (-1, -1), stop)
    return np.asarray(refined_corners, dtype=np.float64).reshape(-1, 2)


def corner_sigma(picture: NDArray[np.generic], corners: FloatArray, reach: float) -> FloatArray:
    """Standard deviation of a corner's coordinate from the grey values' noise [px], shape [n].

    The gradients around a saddle locate it. With G = Σ ∇I ∇Iᵀ over the window, the covariance is σ² G⁻¹
    (least squares). The root of its mean eigenvalue is returned.

    ``picture``: grey values, shape [rows, columns]. ``corners``: places [px], shape [n, 2]. ``reach``: half
    side of the window [px].
    """
    image, noise, w = grey(picture), noise_level(picture), max(int(reach), 2)
    sigma = np.empty(len(corners))
    for k, (x, y) in enumerate(np.round(corners).astype(int)):
        part = image[max(y - w, 0) : y + w + 1, max(x - w, 0) : x + w + 1]
        gy, gx = np.gradient(part)
        xx, xy, yy = float(np.sum(gx * gx)), float(np.sum(gx * gy)), float(np.sum(gy * gy))
        determinant = max(xx * yy - xy * xy, 1e-6 * (xx + yy) ** 2 + 1e-12)
        sigma[k] = max(noise * np.sqrt(0.5 * (xx + yy) / determinant), 1e-4)
    return sigma


LEAST_AREA = 12.0
"""Area of the smallest dot that is searched for [px²]. The outline of a smaller dot has too few pixels for an
ellipse."""
ALIKE = 1.8
"""Largest difference in radius of the dots of one target, including tilt and perspective."""
MOST_DOTS = 20_000
"""Largest number of dark patches. If a picture has more, it shows no target, and the search stops."""


@dataclass(frozen=True)
class Dots:
    """Dots of a picture, one row per dot."""

    centre: FloatArray
    """Centroid of the image of the dot [px], shape [n, 2]."""
    sigma: FloatArray
    """Standard deviation of a coordinate from the picture's noise [px], shape [n]."""
    mass: FloatArray
    """Sum of the darkness, each pixel between 0 (surroundings) and about 1 [px²], shape [n]."""
    radius: FloatArray
    """Root of the product of the semi-axes of the outline [px], shape [n]."""
    hollow: NDArray[np.bool_]
    """True if a bright hole lies in the middle, shape [n]."""


def find_dots(picture: NDArray[np.generic], *, dark: bool = True, round_dots: bool = True) -> Dots:
    """All dots that lie completely inside a picture.

    Outlines come from thresholds relative to the mean brightness nearby. Several window sizes in steps of two
    are tried; the size with the most similar dots is used. The centre of a dot is then the centroid of

        w = 1 - I / B

    where B is a plane through the brightness around the dot. Uneven light and blur therefore do not shift the
    centre. Round dots without a hole are also fitted by their edges (`dic.calibration.dots`). The more
    precise of the two centres is used.

    ``picture``: grey values of any depth, shape [rows, columns]. ``dark``: True for dark dots on a bright
    board, False for bright dots on a dark one. ``round_dots``: whether outlines must be ellipses; False lets
    squares and other compact shapes pass.
    """
    image = grey(picture)
    if not dark:
        image = image.max() + image.min() - image
    eight = eight_bits(picture) if dark else 255 - eight_bits(picture)
    noise = noise_level(picture)
    low, high = quantiles(eight, (0.01, 0.99))
    step = 0.08 * max(float(high - low), 25.0)
    best: list[tuple[FloatArray, bool]] = []
    size, most = 15, 0.0
    while size <= max(16, min(eight.shape) // 2):
        outlines, score = _alike(_outlines(eight, size, step, round_dots))
        if score > most:
            best, most = outlines, score
        size = 2 * size + 1
    return _locate_dots(image, best, noise, round_dots)


def _alike(outlines: list[tuple[FloatArray, bool]]) -> tuple[list[tuple[FloatArray, bool]], float]:
    """The outlines of one size, and the sum of their radii, which many dots make larger than a few specks."""
    radius = np.array([0.5 * np.sqrt(ellipse[2] * ellipse[3]) for ellipse, _ in outlines])
    if not radius.size:
        return [], 0.0
    ordered = np.sort(radius)
    total = np.concatenate([[0.0], np.cumsum(ordered)])
    ends = np.searchsorted(ordered, ALIKE * ordered, side="right")
    smallest = ordered[np.argmax(total[ends] - total[:-1])]
    best = (radius >= smallest) & (radius <= ALIKE * smallest)
    alike = [outline for outline, selected in zip(outlines, best, strict=True) if selected]
    return alike, float(radius[best].sum())


def _outlines(
    eight: NDArray[np.uint8], size: int, step: float, round_dots: bool
) -> list[tuple[FloatArray, bool]]:
    """Ellipses (x, y, major, minor diameter, angle in degrees) of dark patches, and whether they are
    hollow."""
    mask = cv2.adaptiveThreshold(eight, 255, cv2.ADAPTIVE_THRESH_MEAN_C, cv2.THRESH_BINARY_INV, size, step)
    contours, tree = cv2.findContours(mask, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    if tree is None or len(contours) > MOST_DOTS:
        return []
    rows, columns = eight.shape
    # a picture has thousands of specks; most are removed before a call of Python
    lengths = np.fromiter(map(len, contours), dtype=np.int64, count=len(contours))
    numbers = np.flatnonzero((tree[0, :, 3] < 0) & (lengths >= 8))
    if not len(numbers):
        return []
    points = np.concatenate([contours[k][:, 0] for k in numbers.tolist()]).astype(np.int64)
    start = np.cumsum(lengths[numbers]) - lengths[numbers]
    after = np.roll(points, -1, axis=0)
    after[np.append(start[1:], len(points)) - 1] = points[start]
    low, high = (extreme.reduceat(points, start) for extreme in (np.minimum, np.maximum))
    twice = np.add.reduceat(points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0], start)
    area = 0.5 * (np.abs(twice) + lengths[numbers])  # through pixel centres: half a pixel too small
    inside = np.all((low > 1) & (high < [columns - 2, rows - 2]), axis=1)
    # Of a patch larger than the window only the rim is filled.
    chosen = (area >= LEAST_AREA) & inside & ((high - low).max(axis=1) + 1 <= 0.7 * size)
    numbers, area = numbers[chosen], area[chosen]
    fits = [cv2.fitEllipseDirect(contours[k]) for k in numbers.tolist()]
    ellipses = np.reshape([(*centre, *diameters, angle) for centre, diameters, angle in fits], (-1, 5))
    ellipses[:, 2:4] += 1.0
    narrow, wide = np.sort(ellipses[:, 2:4], axis=1).T
    filled = area / (0.25 * np.pi * narrow * wide)
    # A square fills more or less of its ellipse's outline than a disc.
    least, most = (0.9, 1.1) if round_dots else (0.7, 1.3)
    fine = np.isfinite(ellipses).all(axis=1) & (narrow >= 0.2 * wide) & (least < filled) & (filled < most)
    return [
        (ellipses[k], _has_hole(contours, tree[0], int(numbers[k]), ellipses[k], area[k]))
        for k in np.flatnonzero(fine)
    ]


def _has_hole(contours: Sequence[Any], tree: NDArray[Any], k: int, ellipse: FloatArray, area: float) -> bool:
    """True if a child outline lies in the middle and is large enough for an intended hole."""
    child = tree[k, 2]
    while child >= 0:
        hole = contours[child]
        if len(hole) >= 4:
            middle = hole[:, 0].mean(axis=0)
            inner = max(cv2.contourArea(hole) - 0.5 * len(hole), 1.0)
            near = np.hypot(*(middle - ellipse[:2])) < 0.25 * np.sqrt(area)
            if near and 0.015 < inner / area < 0.6:
                return True
        child = tree[child, 0]
    return False


def _locate_dots(
    image: FloatArray, outlines: list[tuple[FloatArray, bool]], noise: float, round_dots: bool
) -> Dots:
    """Centroids of the outlined dots; dots with a different darkness are left out."""
    ellipses = np.array([ellipse for ellipse, _ in outlines]).reshape(-1, 5)
    values = centroids(image, ellipses, noise)
    good = np.isfinite(values).all(axis=1)
    if not good.any():
        return Dots(np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool))
    values, ellipses = values[good], ellipses[good]
    radius = 0.5 * np.sqrt(ellipses[:, 2] * ellipses[:, 3])
    hollow = np.array([hole for _, hole in outlines])[good]
    depth = values[:, 4]
    dark = depth > 0.4 * np.percentile(depth, 80.0)  # printed dots are about equally dark
    centre, sigma = values[dark, :2], values[dark, 2]
    if round_dots:
        small = np.flatnonzero(~hollow[dark] & (radius[dark] <= LARGEST))
        outline = ellipses[dark][small]
        centre[small], sigma[small] = _fit_dots(image, centre[small], sigma[small], outline, noise)
    return Dots(centre, sigma, values[dark, 3], radius[dark], hollow[dark])


def _fit_dots(
    image: FloatArray, centre: FloatArray, sigma: FloatArray, ellipses: FloatArray, noise: float
) -> tuple[FloatArray, FloatArray]:
    """Centres with their sigma. The edges are used where they are more precise."""
    if not len(centre):
        return centre, sigma
    c, s = np.cos(np.deg2rad(ellipses[:, 4])), np.sin(np.deg2rad(ellipses[:, 4]))
    along, across = 4.0 / ellipses[:, 2] ** 2, 4.0 / ellipses[:, 3] ** 2
    shape = np.stack(
        [along * c * c + across * s * s, (along - across) * c * s, along * s * s + across * c * c], axis=1
    )
    reach = 0.5 * float(ellipses[:, 2:4].max()) * WINDOW + MARGIN
    fitted, noise_of_it = _fit_discs(image, centre, shape, reach, noise)
    better = noise_of_it < sigma  # NaN where the fit failed
    return np.where(better[:, None], fitted, centre), np.where(better, noise_of_it, sigma)
