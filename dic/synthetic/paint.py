"""Speckle paint: drops of random places and sizes, printed dots, and damage done to them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.synthetic.texture import Area, Texture


@dataclass(frozen=True)
class Paint:
    """Reflectances of drops and ground, and how sharp a drop's rim is.

    Raises
    ------
    ValueError
        A reflectance outside 0 to 1, a softness outside 0 to 1.
    """

    dark: float = 0.16
    """Of a drop [-]."""
    bright: float = 0.97
    """Of the ground [-]."""
    softness: float = 0.3
    """Width of the rim, from ground to drop, over the drop's diameter [-]; at least 1.5 texels."""

    def __post_init__(self) -> None:
        for name in ("dark", "bright", "softness"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must be 0 to 1, got {getattr(self, name)}")


def sprayed_drops(
    area: Area, *, size: float, spread: float, coverage: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Centres (around, along) and diameters of drops that cover that share of an area [m], [n, 2] and [n].

    Drops fall independently of each other, so that n drops of mean area A leave a share exp(-n A / area)
    bare:
    ``n = -ln(1 - coverage) area / A``, with ``A = π/4 size² (1 + spread²)``. Diameters are log-normal.

    Parameters
    ----------
    area
        Where they fall; also half of the largest ones beside it.
    size
        Mean diameter [m].
    spread
        Standard deviation of the diameters over their mean [-].
    coverage
        Share of the area that is covered in the end [-].
    rng
        Random numbers.
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
    """Centres and diameters of even dots close to a hexagonal lattice [m], [n, 2] and [n].

    A dot's own share of the lattice is √3/2 step²: ``step = size √(π / (2 √3 coverage))``, as long as no dots
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
    """Texture of drops on a ground; where drops overlap the surface is as dark as one.

    Parameters
    ----------
    area, pitch
        What it covers, and the distance of its texels [m].
    centres, diameters
        Of the drops [m], shapes [n, 2] and [n].
    paint
        Reflectances and rims.
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
    """A texture with a scratch of that width [m] from `start` to `end` (around, along), down to `level`."""
    u, v = _places(texture)
    (x0, y0), (x1, y1) = start, end
    length = np.hypot(x1 - x0, y1 - y0)
    t = np.clip(((u - x0) * (x1 - x0) + (v - y0) * (y1 - y0)) / length**2, 0.0, 1.0)
    off = np.hypot(u - x0 - t * (x1 - x0), v - y0 - t * (y1 - y0))
    return _bared(texture, 0.5 * width - off, level)


def flaked(
    texture: Texture, *, middle: tuple[float, float], radius: float, level: float, rng: np.random.Generator
) -> Texture:
    """A texture with a patch about `middle` (around, along) whose paint is gone; its rim is ragged."""
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
    """The texture at `level` where `depth` [m] is positive, over a rim of two texels."""
    share = np.clip(0.5 + depth / (2.0 * texture.pitch), 0.0, 1.0)
    grey: NDArray[np.float32] = (texture.grey * (1.0 - share) + level * share).astype(np.float32)
    return Texture(grey, texture.pitch, texture.origin)
