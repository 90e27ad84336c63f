"""A scene: bodies of revolution at the instants of the exposures, a lamp, the air, and the lens."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.special import erf

from dic.basics import FloatArray
from dic.synthetic.paint import Texture


@dataclass(frozen=True)
class Instants:
    """Instants at which a series of frames is computed. Each frame is a weighted mean over some of them."""

    begin: np.ndarray
    """Index of the first instant of each frame, followed by the number of instants, shape [n_frames + 1]."""
    time: FloatArray
    """Times [s], shape [n_instants]."""
    weight: FloatArray
    """Weights, whose sum is 1 in each frame, shape [n_instants]."""

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.begin) - 1


def exposures(times: FloatArray, exposure: float, points: np.ndarray | int = 1) -> Instants:
    """Instants of frames whose shutters are open for `exposure`, centred on `times`.

    The instants are Gauss-Legendre points. n points integrate motion blur of a polynomial of degree 2 n - 1
    exactly.

    ``times``: middle of each exposure [s], shape [n_frames]. ``exposure``: time for which the shutter is open
    [s]; 0: no motion blur. ``points``: number of instants per frame: one number for all frames, or one for
    each frame. Raises ValueError if the exposure is negative or a number of points is below 1.
    """
    counts = np.broadcast_to(np.asarray(points, dtype=np.int64), (len(times),))
    if not (np.isfinite(exposure) and exposure >= 0.0):
        raise ValueError(f"exposure must be finite and not negative, got {exposure}")
    if np.any(counts < 1):
        raise ValueError(f"points must be at least 1 a frame, got {counts.min()}")
    at, share = [], []
    for time, count in zip(times, counts, strict=True):
        node, weight = np.polynomial.legendre.leggauss(int(count))
        at.append(time + 0.5 * exposure * node)
        share.append(0.5 * weight)
    begin = np.concatenate([[0], np.cumsum(counts)])
    return Instants(begin, np.concatenate(at), np.concatenate(share))


@dataclass(frozen=True)
class RevolvedBody:
    """A body of revolution about the y axis of its frame; its generator is a polyline that may move."""

    y: FloatArray
    """Nodes of the generator along the axis [m], shape [n_instants or 1, n_nodes]."""
    r: FloatArray
    """Their radii [m], shape [n_instants or 1, n_nodes]."""
    along: FloatArray
    """Material coordinate of the nodes along the generator, at which the texture is read [m], shape
    [n_nodes]."""
    radius: float
    """Radius that converts an angle to a material coordinate around, θ radius [m]."""
    texture: Texture
    """Its paint; θ = 0 faces +z."""
    place: FloatArray = field(default_factory=lambda: np.zeros((1, 3)))
    """Origin of its frame in the scene's frame [m], shape [n_instants or 1, 3]."""
    turn: FloatArray = field(default_factory=lambda: np.eye(3))
    """Rotation from the scene's frame to its frame, shape [3, 3] or [n_instants, 3, 3]."""
    shine: float = 0.0
    """Height of a highlight over white paint [-]."""
    patch: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Centre (around, along) and radius [m] of a sliding patch of detached paint; radius 0: none."""
    slip: FloatArray = field(default_factory=lambda: np.zeros((1, 2)))
    """Displacement of the patch's centre around and along [m], shape [n_instants or 1, 2]."""

    def __post_init__(self) -> None:
        n = len(self.along)
        if self.y.ndim != 2 or self.y.shape != self.r.shape or self.y.shape[1] != n or n < 2:
            raise ValueError(f"y, r and along need one node each, got {self.y.shape}, {self.r.shape}, {n}")
        if not (np.all(np.isfinite(self.y)) and np.all(np.isfinite(self.r)) and np.all(self.r >= 0.0)):
            raise ValueError("nodes of a generator must be finite, with radii that are not negative")

    @property
    def slope(self) -> FloatArray:
        """dr/dy at the nodes, shape [n_instants or 1, n_nodes]: the weighted mean of the two segments at a
        node.

        If one segment is a disc normal to the axis, only the other segment counts.
        """
        rise, run = np.diff(self.r, axis=1), np.diff(self.y, axis=1)
        flat = np.abs(run) < 1e-12
        each = np.where(flat, 0.0, rise / np.where(flat, 1.0, run))
        weight = np.where(flat, 0.0, np.hypot(rise, run))
        total, sides = np.zeros(self.y.shape), np.zeros(self.y.shape)
        for part in (slice(0, -1), slice(1, None)):
            total[:, part] += weight * each
            sides[:, part] += weight
        return np.asarray(total / np.where(sides > 0.0, sides, 1.0))


def closed(y: FloatArray, r: FloatArray, along: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """A side surface with a disc at each end: nodes of the whole generator, `y`, `r` and `along`."""
    end = np.zeros((len(y), 1))
    first, last = along[0] - r[:, 0].max(), along[-1] + r[:, -1].max()
    return (
        np.concatenate([y[:, :1], y, y[:, -1:]], axis=1),
        np.concatenate([end, r, end], axis=1),
        np.concatenate([[first], along, [last]]),
    )


def cylinder(
    radius: float, length: float, texture: Texture, *, place: FloatArray, turn: FloatArray | None = None,
    shine: float = 0.0,
) -> RevolvedBody:  # fmt: skip
    """A rigid right cylinder from y = 0 to y = length of its frame, with material coordinate 0 at y = 0."""
    y, r, along = closed(np.array([[0.0, length]]), np.array([[radius, radius]]), np.array([0.0, length]))
    return RevolvedBody(
        y=y, r=r, along=along, radius=radius, texture=texture, place=place,
        turn=np.eye(3) if turn is None else turn, shine=shine,
    )  # fmt: skip


@dataclass(frozen=True)
class Lamp:
    """Light on the scene."""

    direction: tuple[float, float, float] = (0.0, 0.3, 1.0)
    """Direction toward the lamp, of any length."""
    ambient: float = 1.0
    """Share of the light that comes from all directions; 1: no shading."""
    gloss: float = 60.0
    """Exponent of the highlights [-]; a larger one gives smaller highlights."""


@dataclass(frozen=True)
class Scene:
    """Bodies, lamp and background of a series of frames."""

    instants: Instants
    """Instants of the frames."""
    bodies: tuple[RevolvedBody, ...]
    """All bodies of the scene."""
    lamp: Lamp = field(default_factory=Lamp)
    background: float = 0.05
    """Reflectance where there is no body [-]."""


SPREADS = 4.0
"""Reach of a lens in standard deviations of its point spread; 6e-5 of a point's light is neglected."""
LEVELS = 65
"""Number of defocus levels for which weights are tabulated."""


@dataclass(frozen=True)
class Lens:
    """Point spread of a camera.

    Raises ValueError if spread or aperture is negative, if the focus distance is not positive, or if there
    are fewer than 2 rays.
    """

    spread: float = 0.45
    """Standard deviation of the point spread in focus [px]."""
    aperture: float = 0.0
    """Diameter of the entrance pupil [m]; 0: sharp at every distance."""
    focus: float = 0.3
    """Distance of the focal plane along the optical axis [m]."""
    rays: int = 4
    """Rays of a pixel along each axis."""

    def __post_init__(self) -> None:
        if not (0.0 <= self.spread <= 10.0 and 0.0 <= self.aperture < np.inf):
            raise ValueError(
                f"spread must be 0 to 10 px and aperture >= 0, got {self.spread}, {self.aperture}"
            )
        if not 0.0 < self.focus < np.inf:
            raise ValueError(f"focus must be a positive distance in metres, got {self.focus}")
        if not 2 <= self.rays <= 16:
            raise ValueError(f"rays must be 2 to 16 along an axis, got {self.rays}")

    def disc(self, focal: float, depth: FloatArray | float) -> FloatArray:
        """Diameter of the circle of confusion [px] of points at `depth` [m] along the optical axis."""
        return np.asarray(focal * self.aperture * np.abs(1.0 / self.focus - 1.0 / np.asarray(depth)))

    def total(self, focal: float, depth: FloatArray | float) -> FloatArray:
        """Standard deviation of the point spread at `depth` [px]; a uniform disc of diameter d has a variance
        of d²/16."""
        return np.asarray(np.hypot(self.spread, self.disc(focal, depth) / 4.0))


def weights(spread: float, reach: int, rays: int) -> FloatArray:
    """Weights of rays along one axis, from `reach` pixels before a pixel to `reach` pixels after it, sum 1.

    The weight of a ray at x is the integral of the point spread over the pixel, ``(Φ((x + ½)/s) - Φ((x -
    ½)/s))``.
    """
    x = (np.arange((2 * reach + 1) * rays) + 0.5) / rays - 0.5 - reach
    if spread < 1e-3:
        values = (np.abs(x) < 0.5).astype(np.float64)
    else:
        scale = np.sqrt(0.5) / spread
        values = erf((x + 0.5) * scale) - erf((x - 0.5) * scale)
    return np.asarray(values / values.sum())


def reach_of(spread: float) -> int:
    """Number of pixels on each side that a lens of this standard deviation [px] blurs into one pixel."""
    return int(np.ceil(SPREADS * spread))


def weight_table(sharpest: float, widest: float, rays: int) -> tuple[NDArray[np.float32], float, int]:
    """Weights of lenses from `sharpest` to `widest` [px], the step between them [px] and their reach [px]."""
    reach = reach_of(widest)
    if widest <= sharpest:
        return weights(sharpest, reach, rays)[None].astype(np.float32), 1.0, reach
    spreads = np.linspace(sharpest, widest, LEVELS)
    rows = [weights(spread, reach, rays) for spread in spreads]
    return np.stack(rows).astype(np.float32), float(spreads[1] - spreads[0]), reach


def haze(
    n_frames: int,
    shape: tuple[int, int],
    *,
    size: float,
    length: float,
    memory: float,
    rng: np.random.Generator,
) -> NDArray[np.float32]:
    """Displacements of the picture by warm air [px], shape [n_frames, n_down, n_across, 2].

    They are a Gaussian random field with correlation length `length` and correlation time `memory` (an
    autoregression). The distance between its nodes is `length`.

    ``n_frames``, ``shape``: frames, and rows and columns of the pictures [px]. ``size``: standard deviation
    of a displacement [px]. ``length``: correlation length [px]. ``memory``: number of frames after which the
    correlation is 1/e. ``rng``: random numbers.
    """
    nodes = tuple(int(np.ceil(n / length)) + 3 for n in shape)
    keep = np.exp(-1.0 / memory) if memory > 0.0 else 0.0
    margin = 4
    fields = np.empty((n_frames, *nodes, 2), dtype=np.float32)
    state = None
    for k in range(n_frames):
        raw = rng.standard_normal((nodes[0] + 2 * margin, nodes[1] + 2 * margin, 2))
        smooth = gaussian_filter(raw, (1.0, 1.0, 0.0)) * np.sqrt(4.0 * np.pi)  # unit variance again
        fresh = smooth[margin:-margin, margin:-margin]
        state = fresh if state is None else keep * state + np.sqrt(1.0 - keep**2) * fresh
        fields[k] = size * state
    return fields
