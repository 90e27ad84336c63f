"""Subsets of pictures: shape functions, settings and result of a match, prepared pictures, shared pixels.

A point's subset is a square of pixels ξ around its place x0 in the *material picture*, the one that the
points were chosen in. A warp is always a total one, from the material picture to any picture of any camera::

    W(ξ) = x0 + ξ + (u, v) + ∇(u, v) ξ + ½ ξᵀ ∇∇(u, v) ξ

with twelve numbers in the order of `NAMES`; a lower shape function leaves the later ones zero.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dic.basics import FloatArray, IntArray
from dic.correlation.kernels import device as device_pictures

NAMES = ("u", "v", "ux", "uy", "vx", "vy", "uxx", "uxy", "uyy", "vxx", "vxy", "vyy")
"""The numbers of a warp; u, v in px, first derivatives in 1, second ones in 1/px."""


class Shape(IntEnum):
    """Shape functions; the value is the number of warp parameters that are searched for."""

    RIGID = 2
    AFFINE = 6
    QUADRATIC = 12


def identity(n: int) -> FloatArray:
    """Warps that move nothing, shape [n, 12]."""
    return np.zeros((n, len(NAMES)))


def apply(points: FloatArray, warp: FloatArray, xi: FloatArray | float = 0.0) -> FloatArray:
    """Warped places of material points [px], shape [..., 2].

    ``points``: places in the material picture [px], shape [..., 2]. ``warp``: their warps, shape [..., 12].
    ``xi``: offsets within the subset [px], shape [..., 2] or 0 for the points themselves.
    """
    if np.isscalar(xi) and xi == 0.0:
        return np.asarray(points + warp[..., :2])
    xi = np.broadcast_to(np.asarray(xi, dtype=np.float64), points.shape)
    x, y = xi[..., 0], xi[..., 1]
    terms = np.stack([x * x / 2.0, x * y, y * y / 2.0], axis=-1)
    u = warp[..., 0] + warp[..., 2] * x + warp[..., 3] * y + np.sum(warp[..., 6:9] * terms, axis=-1)
    v = warp[..., 1] + warp[..., 4] * x + warp[..., 5] * y + np.sum(warp[..., 9:12] * terms, axis=-1)
    return np.asarray(points + xi + np.stack([u, v], axis=-1))


def gradient(warp: FloatArray) -> FloatArray:
    """Deformation gradient F = I + ∇(u, v) of warps at the point itself, shape [..., 2, 2]."""
    return np.asarray(warp[..., 2:6].reshape(*warp.shape[:-1], 2, 2) + np.eye(2))


def neighbour_warp(warp: FloatArray, step: FloatArray) -> FloatArray:
    """The warp a neighbour suggests: of a point that lies `step` away in the material picture.

    ``warp``: warps of points already found, shape [..., 12]. ``step``: from them to the points to guess, in
    the material picture [px], shape [..., 2].
    """
    x, y = step[..., 0], step[..., 1]
    guess = np.array(np.broadcast_to(warp, (*np.broadcast_shapes(warp.shape[:-1], x.shape), 12)))
    for first, slope, bend in ((0, 2, 6), (1, 4, 9)):
        uxx, uxy, uyy = (warp[..., bend + k] for k in range(3))
        guess[..., first] += (
            warp[..., slope] * x + warp[..., slope + 1] * y + uxx * x * x / 2 + uxy * x * y + uyy * y * y / 2
        )
        guess[..., slope] += uxx * x + uxy * y
        guess[..., slope + 1] += uxy * x + uyy * y
    return guess


@dataclass(frozen=True, kw_only=True)
class Correlation:
    """Settings of the match of one subset.

    Raises
    ------
    ValueError
        A value outside its range; the message names it.
    """

    subset: int = 21
    """Side of the square subset in the material picture [px]: odd, 5 to 101."""
    shape: Shape = Shape.AFFINE
    prefilter: float = 0.0
    """Standard deviation of the Gaussian that both pictures are smoothed with [px]; 0: none."""
    max_iterations: int = 30
    """A point that needs more ends as NOT_CONVERGED."""
    tolerance: float = 1e-3
    """Converged when the last update moves no corner of the subset by more than this [px]."""
    least_zncc: float = 0.7
    """A point that ends below this zero-normalised cross-correlation is LOW_CORRELATION (1 - ZNSSD/2)."""
    least_pixels: float = 0.5
    """Share of the subset that must lie inside the mask and the pictures; less is OUT_OF_VIEW."""

    def __post_init__(self) -> None:
        checks = (
            ("subset", self.subset % 2 == 1 and 5 <= self.subset <= 101, "odd, from 5 to 101 px"),
            ("prefilter", 0.0 <= self.prefilter <= 5.0, "from 0 to 5 px"),
            ("max_iterations", self.max_iterations >= 1, "at least 1"),
            ("tolerance", 0.0 < self.tolerance < 0.1, "above 0 and below 0.1 px"),
            ("least_zncc", 0.0 <= self.least_zncc < 1.0, "from 0 to below 1"),
            ("least_pixels", 0.0 < self.least_pixels <= 1.0, "above 0, at most 1"),
        )
        for name, fine, allowed in checks:
            if not fine:
                raise ValueError(f"{name} must be {allowed}, got {getattr(self, name)}")


@dataclass(frozen=True)
class Match:
    """Result of matching subsets, one row a subset; a row that is not VALID holds the last iterate."""

    warp: FloatArray
    """Total warps from the material picture (`dic.correlation.subsets`), shape [n, 12]."""
    covariance: FloatArray
    """Of the position (x, y) from the pictures' noise [px²], shape [n, 2, 2]."""
    zncc: FloatArray
    """Zero-normalised cross-correlation at the end, 1 - ZNSSD/2, shape [n]."""
    iterations: IntArray
    """Updates made, shape [n]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n]."""


MOST_TEMPLATES = 256 * 2**20
"""Memory that templates may take up [bytes]; more points than fit work theirs out anew in every call."""
PACK = 32
"""A subset's pixels are kept in whole packs of this many."""
ARRAYS = 4
"""Numbers of a pixel: grey value, its two slopes, whether it counts."""


@dataclass(frozen=True)
class Templates:
    """Templates of n points in their references, filled by `correlate` on a CPU.

    The owner must `forget` a point whose reference, or whose warp there, has changed.
    """

    pixels: NDArray[np.float32]
    """Of the subsets, shape [n, numbers]."""
    sums: NDArray[np.float64]
    """Over them, and the normal matrix of the match, shape [n, numbers]."""
    known: NDArray[np.int32]
    """1 where the others hold something, shape [n]."""
    settings: Correlation
    """Settings that they are for."""

    @classmethod
    def of(cls, n: int, settings: Correlation) -> "Templates | None":
        """Room for those of n points; None if there are too many to be kept."""
        k = int(settings.shape)
        pixels = ARRAYS * -(-(settings.subset**2) // PACK) * PACK
        sums = 9 + 3 * k + 2 * k * k
        if n * (4 * pixels + 8 * sums) > MOST_TEMPLATES:
            return None
        return cls(np.empty((n, pixels), np.float32), np.empty((n, sums)), np.zeros(n, np.int32), settings)

    def forget(self, rows: IntArray | slice) -> None:
        """These points have changed."""
        self.known[rows] = 0


TOGETHER = 64 * 2**20
"""Pictures that are sent to a GPU and filtered there in one go [bytes]."""


@dataclass(frozen=True)
class Noise:
    """Noise of grey values, independent from pixel to pixel: variance = floor² + gain × grey value.

    Raises ValueError: a number that is negative or not finite.
    """

    floor: float
    """Standard deviation in the dark [grey]."""
    gain: float = 0.0
    """Growth of the variance with the grey value, as of photons that are counted [grey]."""

    def __post_init__(self) -> None:
        for name in ("floor", "gain"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} of the noise must be finite and not negative, got {value}")


@dataclass(frozen=True)
class PictureStack:
    """Pictures of one camera, ready to be matched; make it with `prepare`."""

    n_pictures: int
    shape: tuple[int, int]
    """Rows and columns [px]."""
    noise: tuple[Noise, ...]
    """Of each picture, before any filter."""
    prefilter: float
    """Standard deviation of the Gaussian that the pictures were smoothed with [px]."""
    device: str
    """Device of the coefficients."""
    coefficients: tuple[Any, ...]
    """Of the quintic B-splines, fp32, with mirrored margins; arrays of the device."""
    addresses: Any
    """Start of each picture's on the device, an array of it."""
    noise_on_device: Any
    """Variance in the dark and gain of each picture, side by side, an array of the device."""

    @property
    def memory(self) -> int:
        """Bytes of the coefficients on the device: 4 a pixel, margins included."""
        return sum(int(part.size) for part in self.coefficients) * 4

    @classmethod
    def prepare(
        cls,
        pictures: ArrayLike | Iterable[ArrayLike],
        *,
        noise: float | Noise | Sequence[float | Noise],
        prefilter: float = 0.0,
        device: str = "cpu",
    ) -> "PictureStack":
        """Smooth pictures, if asked, and turn them into spline coefficients.

        ``pictures``: grey values, shape [rows, columns] or [n, rows, columns], or pictures of one shape one
        after the other, of which no more are held than go to the device at a time. ``noise``: standard
        deviation of a grey value, the same in all pictures or one a picture [grey]. ``prefilter``: standard
        deviation of the Gaussian [px], 0 to 5; that of the `Correlation` used later. ``device``: "cpu" or
        "cuda". Raises ValueError: no picture, pictures of several shapes or smaller than 8 x 8, grey values
        that are not finite, a noise for another number of pictures, a device that is not there.
        """
        if not 0.0 <= prefilter <= 5.0:
            raise ValueError(f"prefilter must be from 0 to 5 px, got {prefilter}")
        if isinstance(pictures, np.ndarray) and pictures.ndim == 2:
            pictures = pictures[None]
        planes: list[Any] = []
        waiting: list[Any] = []
        n_pictures = 0
        shape: tuple[int, int] | None = None
        for index, picture in enumerate(pictures):  # type: ignore[arg-type]
            grey = np.asarray(picture, dtype=np.float32)
            if grey.ndim != 2 or min(grey.shape) < 8:
                raise ValueError(
                    f"picture {index} must have two axes of at least 8 px, got shape {grey.shape}"
                )
            shape = shape or (grey.shape[0], grey.shape[1])
            if grey.shape != shape:
                raise ValueError(
                    f"picture {index} has shape {grey.shape}, those before have {shape}: "
                    "pictures of one stack come from one camera"
                )
            if not np.isfinite(grey.sum(dtype=np.float64)):
                raise ValueError(f"picture {index} has grey values that are not finite")
            waiting.append(grey)
            n_pictures += 1
            if len(waiting) * grey.nbytes >= TOGETHER or device == "cpu":
                planes.append(device_pictures.coefficients(waiting, prefilter, device))
                waiting = []
        if shape is None:
            raise ValueError("a stack needs at least one picture")
        if waiting:
            planes.append(device_pictures.coefficients(waiting, prefilter, device))
        single = isinstance(noise, (int, float, Noise))
        levels = [noise] * n_pictures if single else list(noise)  # type: ignore[arg-type]
        if len(levels) != n_pictures:
            raise ValueError(f"noise must be one value or {n_pictures}, one a picture; got {len(levels)}")
        coefficients = tuple(planes)
        greys = tuple(value if isinstance(value, Noise) else Noise(float(value)) for value in levels)  # type: ignore[arg-type]
        return cls(
            n_pictures=n_pictures,
            shape=shape,
            noise=greys,
            prefilter=prefilter,
            device=device,
            coefficients=coefficients,
            addresses=device_pictures.addresses(coefficients),
            noise_on_device=_on_device(greys, device),
        )

    @classmethod
    def join(cls, stacks: Sequence["PictureStack"]) -> "PictureStack":
        """One stack of the pictures of several, one after the other; the coefficients are shared.

        Raises ValueError: no stack, or stacks of several shapes, prefilters or devices.
        """
        kinds = {(stack.shape, stack.prefilter, stack.device) for stack in stacks}
        if len(kinds) != 1:
            raise ValueError(f"stacks to join must agree in shape, prefilter and device, got {sorted(kinds)}")
        if len(stacks) == 1:
            return stacks[0]
        shape, prefilter, device = kinds.pop()
        coefficients = tuple(part for stack in stacks for part in stack.coefficients)
        greys = tuple(noise for stack in stacks for noise in stack.noise)
        return cls(
            n_pictures=sum(stack.n_pictures for stack in stacks),
            shape=shape,
            noise=greys,
            prefilter=prefilter,
            device=device,
            coefficients=coefficients,
            addresses=device_pictures.addresses(coefficients),
            noise_on_device=_on_device(greys, device),
        )

    def single(self, index: int) -> "PictureStack":
        """A stack of one of its pictures, whose coefficients are shared."""
        place = index
        for part in self.coefficients:
            if place < part.shape[0]:
                break
            place -= part.shape[0]
        return PictureStack(
            n_pictures=1,
            shape=self.shape,
            noise=self.noise[index : index + 1],
            prefilter=self.prefilter,
            device=self.device,
            coefficients=(part[place : place + 1],),
            addresses=self.addresses[index : index + 1],
            noise_on_device=_on_device(self.noise[index : index + 1], self.device),
        )


@lru_cache(maxsize=64)
def _on_device(noise: tuple[Noise, ...], device: str) -> Any:
    values = np.array([(grey.floor**2, grey.gain) for grey in noise]).reshape(-1)
    return device_pictures.upload(values, device)


def overlap_correlation(
    first: ArrayLike, second: ArrayLike, subset: float, shape: Shape = Shape.AFFINE
) -> FloatArray:
    """Correlation of the errors of points whose square subsets have pixels in common.

    The error of a match is a sum over the subset of noise times gradient times a weight: that which a fit of
    the shape function gives its value in the middle. For even speckle the covariance of two such sums is that
    of the weights over the common area. A rigid or affine shape function weighs all pixels alike, which gives
    (1 - |Δx|/s)(1 - |Δy|/s), s the side. A quadratic one weighs them with ``7/2 - 15/4 (ξ² + η²)``, ξ and η
    from -1 to 1 over the subset: less than nothing in the corners, so that the errors of neighbours are less
    alike, and opposite farther apart.

    ``first``, ``second``: places in the material picture [px], shapes [n, 2] and [m, 2]. ``subset``: side of
    the subsets [px]. ``shape``: shape function of the match. Returns: shape [n, m].
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    return _alike(a[:, None, :] - b[None, :, :], subset, shape)


def _alike(apart: FloatArray, subset: float, shape: Shape) -> FloatArray:
    """Correlation of points that are `apart` [px], shape [..., 2]."""
    share = np.maximum(1.0 - np.abs(apart) / subset, 0.0)
    across, down = share[..., 0], share[..., 1]
    if shape <= Shape.AFFINE:
        return np.asarray(across * down)
    # half the overlap h along an axis, and half the distance e, in halves of the side: means over the overlap
    # of ξ² (alike for the other subset's, by symmetry) and of the product of both squares
    e2 = (1.0 - share) ** 2
    square = share**2 / 3.0 + e2
    product = share**4 / 5.0 - 2.0 * e2 * share**2 / 3.0 + e2**2
    x, y, xx, yy = square[..., 0], square[..., 1], product[..., 0], product[..., 1]
    mean = 3.5**2 - 2.0 * 3.5 * 3.75 * (x + y) + 3.75**2 * (xx + yy + 2.0 * x * y)
    return np.asarray(across * down * mean / 3.5)


def overlap_matrix(points: ArrayLike, subset: float, shape: Shape = Shape.AFFINE) -> csr_array:
    """`overlap_correlation` of points with themselves, of the pairs alone whose subsets overlap.

    ``points``: places in the material picture [px], shape [n, 2]. ``subset``: side of the subsets [px].
    ``shape``: shape function of the match. Returns: shape [n, n], symmetric, ones on its diagonal; a row
    holds as many numbers as subsets reach into the point's own.
    """
    grid = np.asarray(points, dtype=np.float64)
    tree = cKDTree(grid)
    pairs = tree.query_pairs(subset, p=np.inf, output_type="ndarray")
    value = _alike(grid[pairs[:, 0]] - grid[pairs[:, 1]], subset, shape)
    some = value != 0.0
    one, partner, value = pairs[some, 0], pairs[some, 1], value[some]
    diagonal = np.arange(len(grid))
    rows, columns = np.concatenate([diagonal, one, partner]), np.concatenate([diagonal, partner, one])
    values = np.concatenate([np.ones(len(grid)), value, value])
    return csr_array((values, (rows, columns)), shape=(len(grid), len(grid)))


def overlap_factor(points: ArrayLike, subset: float, valid: ArrayLike | None = None) -> FloatArray:
    """Variance factor of each point that lets points be combined as if they were independent.

    It is the sum of a point's correlations with all others that are valid in the frame. For a mean with
    equal weights the variance then comes out exactly; for slopes a little too large.

    ``points``: places in the material picture [px], shape [n_points, 2]. ``subset``: side of the subsets
    [px]. ``valid``: which points are used together, shape [..., n_points]; None: all. Returns: factors >= 1,
    shape [n_points] or that of `valid`; 1 where not valid. Raises ValueError if `subset` is not positive.
    """
    if not subset > 0.0:
        raise ValueError(f"subset must be a positive number of pixels, got {subset}")
    correlation = overlap_matrix(points, subset)
    if valid is None:
        return np.asarray(correlation.sum(axis=1))
    used = np.asarray(valid, dtype=bool)
    return np.where(used, used.astype(np.float64) @ correlation, 1.0)
