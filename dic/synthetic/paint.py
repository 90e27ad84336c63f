"""Paint on a surface: texels of reflectance, speckles, printed dots and damage, calibration boards."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.basics import FloatArray
from dic.calibration.targets import Charuco, Chessboard, FiducialDots


@dataclass(frozen=True)
class Texture:
    """Reflectance of a surface on a grid; all pictures of a series read the same grid."""

    grey: NDArray[np.float32]
    """Reflectance of the texels [-], 0 to 1; rows along the generator, columns around: [rows, columns]."""
    pitch: float
    """Distance between texels [m]."""
    origin: tuple[float, float]
    """Position of texel [0, 0]: around and along [m]."""

    def __post_init__(self) -> None:
        if self.grey.ndim != 2 or min(self.grey.shape) < 2:
            raise ValueError(f"grey must be a grid of at least 2 x 2 texels, got shape {self.grey.shape}")
        if not (np.isfinite(self.pitch) and self.pitch > 0.0):
            raise ValueError(f"pitch must be a positive length in metres, got {self.pitch}")

    def at(self, around: FloatArray, along: FloatArray) -> FloatArray:
        """Reflectance at positions [m], bilinear. Outside the grid it is the value of the nearest texel."""
        rows, columns = self.grey.shape
        u = np.clip((np.asarray(around) - self.origin[0]) / self.pitch, 0.0, columns - 1.001)
        v = np.clip((np.asarray(along) - self.origin[1]) / self.pitch, 0.0, rows - 1.001)
        i, j = np.floor(u).astype(np.int64), np.floor(v).astype(np.int64)
        a, b = u - i, v - j
        g = self.grey.astype(np.float64)
        near = (1.0 - a) * g[j, i] + a * g[j, i + 1]
        far = (1.0 - a) * g[j + 1, i] + a * g[j + 1, i + 1]
        return np.asarray((1.0 - b) * near + b * far)


@dataclass(frozen=True)
class Area:
    """Part of a surface that a texture covers."""

    around: tuple[float, float]
    """First and last position around [m]."""
    along: tuple[float, float]
    """First and last position along the generator [m]."""

    def __post_init__(self) -> None:
        for name, (low, high) in (("around", self.around), ("along", self.along)):
            if not (np.isfinite(low) and np.isfinite(high) and high > low):
                raise ValueError(
                    f"{name} must be a first and a larger last place in metres, got {low}, {high}"
                )

    @property
    def size(self) -> float:
        """Area [m²]."""
        return (self.around[1] - self.around[0]) * (self.along[1] - self.along[0])

    def grid(self, pitch: float) -> tuple[FloatArray, FloatArray]:
        """Positions of the texels around and along [m], shapes [columns] and [rows]."""

        def places(low: float, high: float) -> FloatArray:
            return np.asarray(low + pitch * np.arange(int(np.ceil((high - low) / pitch)) + 2))

        return places(*self.around), places(*self.along)


def plain(area: Area, pitch: float, *, level: float, grain: float = 0.0, seed: int = 0) -> Texture:
    """Unpainted material: mean reflectance `level` with a fine grain of standard deviation `grain` [-]."""
    across, along = area.grid(pitch)
    noise = np.random.default_rng(seed).standard_normal((len(along), len(across)))
    grey = np.clip(level + grain * noise, 0.0, 1.0).astype(np.float32)
    return Texture(grey, pitch, (area.around[0], area.along[0]))


def waves(
    area: Area, pitch: float, *, vectors: FloatArray, phases: FloatArray, level: float, height: float
) -> Texture:
    """Sum of cosines ``level + height Σ cos(2π (kx around + ky along) + φ)``, with a known integral.

    ``area``: covered area. ``pitch``: distance between texels [m]. ``vectors``: (kx, ky) [1/m], shape [n, 2].
    ``phases``: φ [rad], shape [n]. ``level``, ``height``: mean and amplitude [-].
    """
    across, along = area.grid(pitch)
    grey = np.full((len(along), len(across)), level)
    for (kx, ky), phase in zip(vectors, phases, strict=True):
        grey += height * np.cos(2.0 * np.pi * (kx * across[None] + ky * along[:, None]) + phase)
    return Texture(grey.astype(np.float32), pitch, (area.around[0], area.along[0]))


@dataclass(frozen=True)
class Paint:
    """Reflectances of drops and ground, and the width of a drop's rim.

    Raises ValueError if a reflectance or the softness is outside 0 to 1.
    """

    dark: float = 0.16
    """Reflectance of a drop [-]."""
    bright: float = 0.97
    """Reflectance of the ground [-]."""
    softness: float = 0.3
    """Width of the rim between ground and drop over the drop's diameter [-]. The rim has at least 1.5
    texels."""

    def __post_init__(self) -> None:
        for name in ("dark", "bright", "softness"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must be 0 to 1, got {getattr(self, name)}")


def sprayed_drops(
    area: Area, *, size: float, spread: float, coverage: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Centres (around, along) and diameters of random drops [m], shapes [n, 2] and [n].

    The drops are independent of each other: n drops of mean area A leave a share exp(-n A / area) uncovered.
    Hence ``n = -ln(1 - coverage) area / A``, with ``A = π/4 size² (1 + spread²)``. Diameters are log-normal.

    ``area``: area of the pattern. Centres also lie on a margin around it. ``size``: mean diameter [m].
    ``spread``: standard deviation of the diameters over their mean [-]. ``coverage``: expected covered share
    of the area [-].
    """
    if not (0.0 < coverage < 1.0 and size > 0.0 and spread >= 0.0):
        raise ValueError(
            f"0 < coverage < 1, size > 0 and spread >= 0 are needed, got {coverage}, {size} m, {spread}"
        )
    margin = size * (1.0 + 3.0 * spread)
    low = np.array([area.around[0], area.along[0]]) - margin
    high = np.array([area.around[1], area.along[1]]) + margin
    mean_area = 0.25 * np.pi * size**2 * (1.0 + spread**2)
    n = rng.poisson(-np.log1p(-coverage) * float(np.prod(high - low)) / mean_area)
    sigma = np.sqrt(np.log1p(spread**2))
    diameters = size * np.exp(sigma * rng.standard_normal(n) - 0.5 * sigma**2)
    return rng.uniform(low, high, (n, 2)), diameters


def printed_dots(
    area: Area, *, size: float, coverage: float, jitter: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Centres and diameters of equal dots near the points of a hexagonal lattice [m], shapes [n, 2] and [n].

    The area of the lattice per dot is √3/2 step². Hence ``step = size √(π / (2 √3 coverage))`` if dots do not
    overlap.
    """
    if not (0.0 < coverage < 0.95 and size > 0.0 and 0.0 <= jitter <= 0.5):
        raise ValueError(
            f"0 < coverage < 0.95, size > 0, 0 <= jitter <= 0.5 are needed, got {coverage}, {size} m, "
            f"{jitter}"
        )
    step = size * np.sqrt(np.pi / (2.0 * np.sqrt(3.0) * coverage))
    rise = 0.5 * np.sqrt(3.0) * step
    rows = np.arange(int((area.along[1] - area.along[0]) / rise) + 4) - 1
    columns = np.arange(int((area.around[1] - area.around[0]) / step) + 4) - 1
    j, i = np.meshgrid(rows, columns, indexing="ij")
    places = np.stack([(i + 0.5 * (j % 2)) * step + area.around[0], j * rise + area.along[0]], axis=-1)
    places = places.reshape(-1, 2) + rng.uniform(0.0, 1.0, 2) * [step, rise]
    places = places + jitter * step * rng.uniform(-1.0, 1.0, places.shape)
    return places, np.full(len(places), size)


def painted(
    area: Area, pitch: float, centres: FloatArray, diameters: FloatArray, paint: Paint | None = None
) -> Texture:
    """Texture of drops on a ground; overlapping drops are as dark as one drop.

    ``area``, ``pitch``: covered area, and distance between texels [m]. ``centres``, ``diameters``: of the
    drops [m], shapes [n, 2] and [n]. ``paint``: reflectances and rims.
    """
    paint = paint or Paint()
    across, along = area.grid(pitch)
    bare = np.ones((len(along), len(across)), dtype=np.float32)
    origin = np.array([across[0], along[0]])
    rims = np.maximum(paint.softness * diameters, 1.5 * pitch)
    reach = 0.5 * (diameters + rims)
    first = np.maximum(np.ceil((centres - origin - reach[:, None]) / pitch).astype(np.int64), 0)
    last = np.floor((centres - origin + reach[:, None]) / pitch).astype(np.int64) + 1
    last = np.minimum(last, [len(across), len(along)])
    for k in np.flatnonzero(np.all(last > first, axis=1)):
        (i0, j0), (i1, j1) = first[k], last[k]
        du, dv = across[i0:i1] - centres[k, 0], along[j0:j1] - centres[k, 1]
        inside = 0.5 + (0.5 * diameters[k] - np.sqrt(du**2 + dv[:, None] ** 2)) / rims[k]
        part = np.clip(inside, 0.0, 1.0)
        bare[j0:j1, i0:i1] *= 1.0 - part * part * (3.0 - 2.0 * part)
    grey = paint.dark + (paint.bright - paint.dark) * bare
    return Texture(grey.astype(np.float32), pitch, (float(across[0]), float(along[0])))


def scratched(
    texture: Texture, *, start: tuple[float, float], end: tuple[float, float], width: float, level: float
) -> Texture:
    """A texture with a scratch of a width [m] and reflectance `level` from `start` to `end` (around, along)
    [m]."""
    u, v = _places(texture)
    (x0, y0), (x1, y1) = start, end
    length = np.hypot(x1 - x0, y1 - y0)
    t = np.clip(((u - x0) * (x1 - x0) + (v - y0) * (y1 - y0)) / length**2, 0.0, 1.0)
    off = np.hypot(u - x0 - t * (x1 - x0), v - y0 - t * (y1 - y0))
    return _bared(texture, 0.5 * width - off, level)


def flaked(
    texture: Texture, *, middle: tuple[float, float], radius: float, level: float, rng: np.random.Generator
) -> Texture:
    """A texture whose paint is missing within about `radius` [m] of `middle` (around, along) [m]; the rim is
    irregular."""
    u, v = _places(texture)
    angle = np.arctan2(v - middle[1], u - middle[0])
    ragged = np.ones(angle.shape)
    for order in range(2, 7):
        ragged += rng.normal(0.0, 0.25 / order) * np.cos(order * angle + rng.uniform(0.0, 2.0 * np.pi))
    return _bared(texture, radius * ragged - np.hypot(u - middle[0], v - middle[1]), level)


def _places(texture: Texture) -> tuple[FloatArray, FloatArray]:
    rows, columns = texture.grey.shape
    u = texture.origin[0] + texture.pitch * np.arange(columns)
    v = texture.origin[1] + texture.pitch * np.arange(rows)
    return np.asarray(u[None, :]), np.asarray(v[:, None])


def _bared(texture: Texture, depth: FloatArray, level: float) -> Texture:
    """The texture with reflectance `level` where `depth` [m] is positive, with a rim of two texels."""
    share = np.clip(0.5 + depth / (2.0 * texture.pitch), 0.0, 1.0)
    grey: NDArray[np.float32] = (texture.grey * (1.0 - share) + level * share).astype(np.float32)
    return Texture(grey, texture.pitch, texture.origin)


BLACK, WHITE = 0.06, 0.97
"""Reflectances of a board [-]."""
HOLE = 0.45
"""Diameter of the hole in a hollow dot over the dot's diameter, if the target does not define it [-]."""


def board_texture(target: Any, pitch: float) -> tuple[Texture, FloatArray]:
    """Paint of a target in the frame of its points, and the corners of the board.

    ``target``: a `FiducialDots`, `Chessboard` or `Charuco`. ``pitch``: largest distance of texels [m]; x is
    around, y along. Returns: the paint. Returns: of the board [m], shape [4, 2].
    """
    if isinstance(target, FiducialDots):
        texture = _dots(target, pitch)
    elif isinstance(target, Chessboard):
        texture = _chessboard(target, pitch)
    elif isinstance(target, Charuco):
        texture = _charuco(target, pitch)
    else:
        raise TypeError(
            f"a target of {type(target).__name__} cannot be drawn; draw dots, chessboard or ChArUco"
        )
    rows, columns = texture.grey.shape
    x0, y0 = texture.origin
    x1, y1 = x0 + (columns - 1) * texture.pitch, y0 + (rows - 1) * texture.pitch
    return texture, np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def _dots(target: FiducialDots, pitch: float) -> Texture:
    p, d = target.pitch, target.diameter
    area = Area((-0.8 * p, (target.columns - 0.2) * p), (-0.8 * p, (target.rows - 0.2) * p))
    row, column = np.mgrid[: target.rows, : target.columns]
    centres = np.stack([column.ravel(), row.ravel()], axis=1) * p
    dots = painted(area, pitch, centres, np.full(len(centres), d), Paint(BLACK, WHITE, 0.0))
    hole = target.hole or HOLE * d
    middle = np.array(target.hollow, dtype=np.float64) * p
    holes = painted(area, pitch, middle, np.full(3, hole), Paint(0.0, 1.0, 0.0)).grey
    return Texture((dots.grey * holes + WHITE * (1.0 - holes)).astype(np.float32), pitch, dots.origin)


def _chessboard(target: Chessboard, pitch: float) -> Texture:
    p = target.pitch
    margin = 1.8 * p  # beyond the inner corners: a square and a bright rim
    area = Area((-margin, (target.columns - 1) * p + margin), (-margin, (target.rows - 1) * p + margin))
    x, y = area.grid(pitch)
    sign = _alternating(x, target.columns, p, pitch) * _alternating(y, target.rows, p, pitch)[:, None]
    grey = 0.5 * (WHITE + BLACK) + 0.5 * (WHITE - BLACK) * sign
    inside = _within(x, target.columns, p, pitch) * _within(y, target.rows, p, pitch)[:, None]
    return Texture((grey * inside + WHITE * (1.0 - inside)).astype(np.float32), pitch, (x[0], y[0]))


def _alternating(x: FloatArray, n: int, p: float, pitch: float) -> FloatArray:
    """Alternating 1 and -1 with sign changes at 0, p, ..., (n - 1) p, over a rim of 1.5 texels."""
    nearest = np.clip(np.rint(x / p), 0, n - 1)
    sign = np.where(nearest % 2 == 0, 1.0, -1.0)
    return np.asarray(sign * np.clip((x - nearest * p) / (0.75 * pitch), -1.0, 1.0))


def _within(x: FloatArray, n: int, p: float, pitch: float) -> FloatArray:
    """1 between -p and n p, 0 beyond."""
    return np.asarray(np.clip(0.5 + np.minimum(x + p, n * p - x) / (1.5 * pitch), 0.0, 1.0))


def _charuco(target: Charuco, pitch: float) -> Texture:
    """The board as OpenCV draws it, with squares of a whole number of texels."""
    square = int(np.ceil(target.pitch / pitch))
    margin = square // 3
    size = (target.columns * square + 2 * margin, target.rows * square + 2 * margin)
    board = target._board().generateImage(size, marginSize=margin, borderBits=1)
    grey = BLACK + (WHITE - BLACK) * (board.astype(np.float32) / 255.0)
    texel = target.pitch / square
    first = (0.5 - margin) * texel  # middle of the first texel, from the board's corner on
    return Texture(grey, texel, (first, first))
