"""Subsets of pictures: shape functions, settings and result of a match, prepared pictures, shared pixels.

A point's subset is a square of pixels ξ around its position x0 in the *material picture*, in which the points
were chosen. A warp is always a total one, from the material picture to any picture of any camera::

    W(ξ) = x0 + ξ + (u, v) + ∇(u, v) ξ + ½ ξᵀ ∇∇(u, v) ξ

It has twelve parameters in the order of `NAMES`. For a shape function of lower order the later ones are zero.
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
"""Parameters of a warp; u, v [px], first derivatives [-], second derivatives [1/px]."""


class Shape(IntEnum):
    """Shape functions; the value is the number of warp parameters that are fitted."""

    RIGID = 2
    AFFINE = 6
    QUADRATIC = 12


def identity(n: int) -> FloatArray:
    """Identity warps (no displacement), shape [n, 12]."""
    return np.zeros((n, len(NAMES)))


def apply(points: FloatArray, warp: FloatArray, xi: FloatArray | float = 0.0) -> FloatArray:
    """Warped positions of material points [px], shape [..., 2].

    ``points``: positions in the material picture [px], shape [..., 2]. ``warp``: their warps, shape [...,
    12]. ``xi``: offsets within the subset [px], shape [..., 2] or 0 for the points themselves.
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
    """Warp of a point at distance `step` in the material picture, extrapolated from its neighbour's warp.

    ``warp``: warps of points already found, shape [..., 12]. ``step``: vectors from them to the points to
    guess, in the material picture [px], shape [..., 2].
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
        If a value is outside its range; the message names it.
    """

    subset: int = 21
    """Side of the square subset in the material picture [px]: odd, 5 to 101."""
    shape: Shape = Shape.AFFINE
    prefilter: float = 0.0
    """Standard deviation of the Gaussian filter for both pictures [px]; 0: no filter."""
    max_iterations: int = 30
    """Largest number of iterations; a point that needs more ends as NOT_CONVERGED."""
    tolerance: float = 1e-3
    """The search has converged if every corner of the subset is within this of its place [px]. The way left
    is computed from the last two steps if they shrink fast. Otherwise it counts as long as the last step."""
    least_zncc: float = 0.7
    """A point with a smaller zero-normalised cross-correlation (1 - ZNSSD/2) ends as LOW_CORRELATION."""
    least_pixels: float = 0.5
    """Share of the subset that must lie inside the mask and the pictures. With a smaller share a point is
    OUT_OF_VIEW."""

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
    """Result of matching subsets, one row per subset. A row that is not VALID contains the last iterate."""

    warp: FloatArray
    """Total warps from the material picture (`dic.correlation.subsets`), shape [n, 12]."""
    covariance: FloatArray
    """Covariance of the position (x, y) due to the pictures' noise [px²], shape [n, 2, 2]."""
    zncc: FloatArray
    """Final zero-normalised cross-correlation, 1 - ZNSSD/2, shape [n]."""
    iterations: IntArray
    """Number of updates, shape [n]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n]."""


MOST_TEMPLATES = 512 * 2**20
"""Largest memory for templates [bytes]. If the points need more, templates are recomputed in every call."""
PACK = 32
"""Number of pixels in a pack; a subset is stored in whole packs."""
ARRAYS = 4
"""Values stored per pixel: grey value, its two derivatives, and whether the pixel is used."""


@dataclass(frozen=True)
class Templates:
    """Templates of n points in their references, filled by `correlate` on a CPU.

    The owner must call `forget` for a point if its reference or its warp in the reference has changed.
    """

    pixels: NDArray[np.float32]
    """Pixel values of the subsets, shape [n, numbers]."""
    sums: NDArray[np.float64]
    """Sums over the pixels, and the normal matrix of the match, shape [n, numbers]."""
    known: NDArray[np.int32]
    """1 where a template is stored, shape [n]."""
    settings: Correlation
    """Settings for which the templates were made."""

    @classmethod
    def of(cls, n: int, settings: Correlation) -> "Templates | None":
        """Empty storage for n points; None if it would be too large."""
        k = int(settings.shape)
        pixels = ARRAYS * -(-(settings.subset**2) // PACK) * PACK
        sums = 9 + 3 * k + 2 * k * k
        if n * (4 * pixels + 8 * sums) > MOST_TEMPLATES:
            return None
        return cls(np.empty((n, pixels), np.float32), np.empty((n, sums)), np.zeros(n, np.int32), settings)

    def forget(self, rows: IntArray | slice) -> None:
        """Discard the templates of points that have changed."""
        self.known[rows] = 0


TOGETHER = 64 * 2**20
"""Memory of the pictures that are sent to a GPU and filtered together [bytes]."""


@dataclass(frozen=True)
class Noise:
    """Noise of grey values, independent from pixel to pixel: variance = floor² + gain × grey value.

    Raises ValueError if a number is negative or not finite.
    """

    floor: float
    """Standard deviation in the dark [grey]."""
    gain: float = 0.0
    """Increase of the variance with the grey value, due to photon noise [grey]."""

    def __post_init__(self) -> None:
        for name in ("floor", "gain"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} of the noise must be finite and not negative, got {value}")


@dataclass(frozen=True)
class PictureStack:
    """Pictures of one camera, prepared for matching by `prepare`."""

    n_pictures: int
    shape: tuple[int, int]
    """Rows and columns [px]."""
    noise: tuple[Noise, ...]
    """Noise of each picture, before any filter."""
    prefilter: float
    """Standard deviation of the Gaussian filter of the pictures [px]."""
    device: str
    """Device that holds the coefficients."""
    coefficients: tuple[Any, ...]
    """Coefficients of the quintic B-splines, fp32, with mirrored margins; arrays on the device."""
    addresses: Any
    """Start address of each picture's coefficients, an array on the device."""
    noise_on_device: Any
    """Dark variance and gain of each picture, interleaved in an array on the device."""

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
        """Filter pictures, if requested, and compute their spline coefficients.

        ``pictures``: grey values, shape [rows, columns] or [n, rows, columns], or an iterable of pictures of
        one shape. Only the pictures that are sent together are in memory. ``noise``: standard deviation of a
        grey value, one for all pictures or one per picture [grey]. ``prefilter``: standard deviation of the
        Gaussian [px], 0 to 5; that of the `Correlation` used later. ``device``: "cpu" or "cuda". Raises
        ValueError if there is no picture, if shapes differ or are smaller than 8 x 8, or if a grey value is
        not finite. Also if the noise is for another number of pictures, or the device does not exist.
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
        """One stack with the pictures of several stacks, in their order; the coefficients are shared.

        Raises ValueError if there is no stack, or if shapes, prefilters or devices differ.
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
        """A stack with one of its pictures; the coefficients are shared."""
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
    """Correlation of the errors of points whose square subsets overlap.

    The error of a match is a sum over the subset of noise times gradient times a weight. It is the weight of
    a pixel in the least-squares fit of the shape function's central value. For a uniform speckle pattern the
    covariance of two such sums is the integral of both weights over the common area. For a rigid or affine
    shape function all weights are equal. The correlation is then (1 - |Δx|/s)(1 - |Δy|/s) with the side s.
    For a quadratic one the weight is ``7/2 - 15/4 (ξ² + η²)``, with ξ and η from -1 to 1 over the subset.
    This weight is negative in the corners. The errors of neighbours are then less correlated, and
    anticorrelated at larger distances.

    ``first``, ``second``: positions in the material picture [px], shapes [n, 2] and [m, 2]. ``subset``: side
    of the subsets [px]. ``shape``: shape function of the match. Returns: shape [n, m].
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    return _alike(a[:, None, :] - b[None, :, :], subset, shape)


def _alike(apart: FloatArray, subset: float, shape: Shape) -> FloatArray:
    """Correlation of the errors of points at the distances `apart` [px], shape [..., 2]."""
    share = np.maximum(1.0 - np.abs(apart) / subset, 0.0)
    across, down = share[..., 0], share[..., 1]
    if shape <= Shape.AFFINE:
        return np.asarray(across * down)
    # h: half the overlap along an axis, e: half the distance, in halves of the side. Means over the overlap:
    # of ξ² (equal for the other subset, by symmetry) and of the product of both squares
    e2 = (1.0 - share) ** 2
    square = share**2 / 3.0 + e2
    product = share**4 / 5.0 - 2.0 * e2 * share**2 / 3.0 + e2**2
    x, y, xx, yy = square[..., 0], square[..., 1], product[..., 0], product[..., 1]
    mean = 3.5**2 - 2.0 * 3.5 * 3.75 * (x + y) + 3.75**2 * (xx + yy + 2.0 * x * y)
    return np.asarray(across * down * mean / 3.5)


def overlap_matrix(points: ArrayLike, subset: float, shape: Shape = Shape.AFFINE) -> csr_array:
    """`overlap_correlation` between all points of a set. Only pairs whose subsets overlap are stored.

    ``points``: positions in the material picture [px], shape [n, 2]. ``subset``: side of the subsets [px].
    ``shape``: shape function of the match. Returns: a sparse symmetric matrix, shape [n, n], with ones on its
    diagonal.
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
    """Variance factor of each point. With it points can be combined as if they were independent.

    It is the sum of a point's correlations with all valid points of the frame, including the point itself.
    The resulting variance is exact for a mean with equal weights. For slopes it is a little too large.

    ``points``: positions in the material picture [px], shape [n_points, 2]. ``subset``: side of the subsets
    [px]. ``valid``: mask of the points that are combined, shape [..., n_points]; None: all. Returns: factors
    >= 1, shape [n_points] or that of `valid`; 1 where not valid. Raises ValueError if `subset` is not
    positive.
    """
    if not subset > 0.0:
        raise ValueError(f"subset must be a positive number of pixels, got {subset}")
    correlation = overlap_matrix(points, subset)
    if valid is None:
        return np.asarray(correlation.sum(axis=1))
    used = np.asarray(valid, dtype=bool)
    return np.where(used, used.astype(np.float64) @ correlation, 1.0)
