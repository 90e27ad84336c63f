"""Noise floors: apparent motion of a specimen at rest, in time and in space, from static frames."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.surfaces.surface_history import SurfaceHistory

SMALLEST_SERIES = 3
"""Static frames that a noise floor needs."""


@dataclass(frozen=True)
class NoiseFloor:
    """Apparent motion of points that rest; each by component (x, y, Z) [m], shape [3].

    A picture's own noise shows in `time` and `space` alike. A bias that a point keeps through all frames, as
    from interpolation or the lens, shows in neither: it is part of the static reference position.
    """

    n_frames: int
    """Static frames it is from."""
    n_points: int
    """Points that were valid in all of them."""
    time: FloatArray
    """Standard deviation of a point through the frames, root mean square over the points."""
    space: FloatArray
    """Standard deviation over the points of a frame, root mean square over the frames."""
    common: FloatArray
    """Standard deviation through the frames of the mean of all points: motion of the cameras or the bench."""
    sigma: FloatArray
    """Prediction of the matches: root mean square of `SurfaceHistory.sigma`."""

    @property
    def ratio(self) -> FloatArray:
        """Measured over predicted noise [-], shape [3]; 1 if sigma is right."""
        return np.asarray(self.time / self.sigma)


def noise_floor(surface: SurfaceHistory, static: NDArray[np.bool_]) -> NoiseFloor:
    """Noise floor of displacements from static frames.

    Parameters
    ----------
    surface
        Points of a specimen.
    static
        Which frames show it at rest, shape [n_frames].

    Raises
    ------
    ValueError
        Fewer than three static frames with points, or no point that is valid in all of them.
    """
    frames = np.flatnonzero(static & surface.valid.any(axis=1))
    if frames.size < SMALLEST_SERIES:
        raise ValueError(
            f"a noise floor needs {SMALLEST_SERIES} static frames with points, got {frames.size}: "
            "record more pictures before the test"
        )
    points = surface.valid[frames].all(axis=0)
    if not points.any():
        raise ValueError(f"no point is valid in all of the {frames.size} static frames")
    u = surface.u[frames][:, points]
    off = u - u.mean(axis=0)
    count = frames.size
    variance = np.sum(off**2, axis=0) / (count - 1)
    mean = off.mean(axis=1)
    apart = (off - mean[:, None]) * np.sqrt(count / (count - 1))  # the mean through the frames took its share
    return NoiseFloor(
        n_frames=count,
        n_points=int(points.sum()),
        time=np.sqrt(variance.mean(axis=0)),
        space=np.sqrt(np.sum(apart**2, axis=(0, 1)) / (count * max(int(points.sum()) - 1, 1))),
        common=np.sqrt(np.sum(mean**2, axis=0) / (count - 1)),
        sigma=np.sqrt(np.mean(surface.sigma[frames][:, points] ** 2, axis=(0, 1))),
    )
