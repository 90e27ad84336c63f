"""What a lens makes of light: the weights of a pixel's rays, defocus with distance, and the air before it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.special import erf

from dic.arrays import FloatArray

SPREADS = 4.0
"""Reach of a lens in its standard deviations; 6e-5 of a point's light is left outside."""
LEVELS = 65
"""Lenses of different defocus whose weights are tabulated."""


@dataclass(frozen=True)
class Lens:
    """Point spread of a camera.

    Raises
    ------
    ValueError
        A negative spread or aperture, a distance of focus that is not positive, fewer than 2 rays.
    """

    spread: float = 0.45
    """Standard deviation of its point spread in focus [px]."""
    aperture: float = 0.0
    """Diameter of its entrance pupil [m]; 0: sharp at every distance."""
    focus: float = 0.3
    """Distance along the view at which it is in focus [m]."""
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
        """Diameter of the circle of confusion [px] of points at `depth` [m] along the view."""
        return np.asarray(focal * self.aperture * np.abs(1.0 / self.focus - 1.0 / np.asarray(depth)))

    def total(self, focal: float, depth: FloatArray | float) -> FloatArray:
        """Standard deviation of the point spread at `depth` [px]: an even disc has a variance of d²/16."""
        return np.asarray(np.hypot(self.spread, self.disc(focal, depth) / 4.0))


def weights(spread: float, reach: int, rays: int) -> FloatArray:
    """Weights of rays along one axis, from `reach` pixels before a pixel's own to `reach` behind it, sum 1.

    The light of a ray at x reaches the pixel with the integral of the point spread over the pixel,
    ``(Φ((x + ½)/s) - Φ((x - ½)/s))``.
    """
    x = (np.arange((2 * reach + 1) * rays) + 0.5) / rays - 0.5 - reach
    if spread < 1e-3:
        found = (np.abs(x) < 0.5).astype(np.float64)
    else:
        scale = np.sqrt(0.5) / spread
        found = erf((x + 0.5) * scale) - erf((x - 0.5) * scale)
    return np.asarray(found / found.sum())


def reach_of(spread: float) -> int:
    """Pixels on each side that a lens of this standard deviation [px] gathers light from."""
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

    A Gaussian field, smooth over `length`, that forgets itself over `memory` frames (an autoregression);
    its nodes
    are `length` apart.

    Parameters
    ----------
    n_frames, shape
        Frames, and rows and columns of the pictures [px].
    size
        Standard deviation of a displacement [px].
    length
        Distance over which it is smooth [px].
    memory
        Frames after which 1/e of it is left.
    rng
        Random numbers.
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
