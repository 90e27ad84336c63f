"""Common errors of a shot's pictures, propagated to its flyer displacement and its outline.

Errors that are correlated in time and along a line are represented by a few patterns of one standard
deviation each.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.distance import cdist

from dic.result import Body, StereoResult
from dic.stereo.geometry import pixels_per_length, triangulate
from dic.stereo.reconstruction import SharedError, shared_error
from dic.surfaces.outline import beyond_noise, departures
from kolsky.base.arrays import FloatArray
from kolsky.base.records import CentreLine, FlyerMotion

PATTERN_VARIANCE = 0.95
"""Share of the variance in the patterns [-]. The rest is returned as an independent error."""
MOST_PATTERNS = 60
"""Largest number of patterns."""
PATTERN_NODES = 4.0
"""Number of nodes of the patterns per correlation length along the line."""


def error_patterns(
    time: FloatArray, place: FloatArray, *, sigma: float, memory: float, length: float
) -> tuple[FloatArray, float]:
    """Patterns of an error with covariance ``sigma^2 exp(-|dt| / memory) exp(-(dy / length)^2)``."""
    if not (time.size and memory > 0.0 and length > 0.0):
        raise ValueError(
            f"{time.size} data, memory {memory} s, length {length} m: there must be data, both must be > 0"
        )
    moments, row = np.unique(time, return_inverse=True)
    in_time, by_time = np.linalg.eigh(np.exp(-np.abs(moments[:, None] - moments) / memory))
    n_nodes = int(np.ceil(PATTERN_NODES * np.ptp(place) / length)) + 1
    nodes = np.linspace(place.min(), place.max(), n_nodes)
    along, by_place = np.linalg.eigh(np.exp(-(((nodes[:, None] - nodes) / length) ** 2)))
    size = np.maximum(np.outer(in_time, along), 0.0)
    order = np.argsort(-size, axis=None)
    share = np.cumsum(size.ravel()[order]) / size.sum()
    order = order[: min(int(np.searchsorted(share, PATTERN_VARIANCE)) + 1, MOST_PATTERNS)]
    i, j = np.unravel_index(order, size.shape)
    lines = np.array([np.interp(place, nodes, column) for column in by_place.T[np.unique(j)]])
    lines = lines[np.searchsorted(np.unique(j), j)]
    found = sigma * np.sqrt(size[i, j])[:, None] * by_time.T[i][:, row] * lines
    left = sigma**2 - float((found**2).sum(axis=0).mean())
    return found, float(np.sqrt(max(left, 0.0)))


MOST_POINTS = 200
"""Largest number of points from which the variance of a mean over many points is computed."""


@dataclass(frozen=True)
class PictureErrors:
    """The shared error of a shot's pictures, and the length of a pixel on its specimen."""

    shared: SharedError
    """Shared error of the epipolar distances [px]."""
    pixel_sigma: float
    """Standard deviation of positions in one camera, along each direction of the picture [px]."""
    outline_sigma: float
    """Resulting standard deviation of the outline's Z [m]."""
    pixel: float
    """Length on the specimen that corresponds to a pixel [m]."""
    interval: float
    """Time between frames [s]."""

    @property
    def length(self) -> float:
        """Distance over which the correlation falls to 1/e [m]."""
        return self.shared.length * self.pixel

    @property
    def memory(self) -> float:
        """Time over which the correlation falls to 1/e [s]."""
        return self.shared.memory * self.interval


def picture_errors(result: StereoResult) -> PictureErrors | None:
    """The shared error of a shot's pictures; None if none was found.

    ``result``: the result of its pictures.
    """
    body = result.specimen
    shared = shared_error(
        body.epipolar,
        body.surface.valid,
        body.points,
        subset=float(result.facts.get("settings", {}).get("subset", result.strain.gauge)),
    )
    if shared.sigma == 0.0:
        return None
    frame = int(np.argmax(body.n_valid))
    seen = body.surface.valid[frame]
    first, second = (pixels[frame, seen] for pixels in body.pixels)
    unit = np.broadcast_to(np.eye(2), (len(first), 2, 2))
    met = triangulate(result.rig, first, second, unit, unit)
    depth = result.placement.frame.covariances(met.covariance)[:, 2, 2]
    pixel_sigma = shared.sigma / float(np.median(met.epipolar_sigma))
    middle = np.median(met.position, axis=0)
    scale = pixels_per_length(result.rig.cameras[0], middle, result.placement.frame.rotation[1])
    return PictureErrors(
        shared=shared,
        pixel_sigma=pixel_sigma,
        outline_sigma=pixel_sigma * float(np.sqrt(np.median(depth))),
        pixel=1.0 / float(np.linalg.norm(scale)),
        interval=float(np.median(np.diff(result.t))),
    )


def variance_of_mean(places: FloatArray, length: float) -> float:
    """Variance of the mean over places of a unit-variance error, correlated by `exp(-(r / length)^2)` [-]."""
    some = places[:: max(-(-len(places) // MOST_POINTS), 1)]
    return float(np.exp(-((cdist(some, some) / length) ** 2)).mean())


def mean_over_time(n: int, memory: float) -> float:
    """Variance of the mean of n successive values of a unit-variance error with a memory in frames [-]."""
    at = np.arange(n)
    return float(np.exp(-np.abs(at[:, None] - at) / memory).mean())


def with_flyer_errors(motion: FlyerMotion, result: StereoResult, errors: PictureErrors) -> FlyerMotion:
    """The flyer's motion with the shared error of its displacements.

    In each frame it is the error of the mean over a camera's visible points. It is averaged over the cameras
    that see any point. The cameras' errors are independent.
    """
    assert result.flyer is not None  # there is a motion
    frames = np.searchsorted(result.t, motion.time)
    share = np.array([_share_left_in_mean(result.flyer, int(k), errors.shared.length) for k in frames])
    sigma = errors.pixel * errors.pixel_sigma * np.sqrt(share)
    return replace(motion, shared_sigma=sigma, shared_memory=errors.memory)


def _share_left_in_mean(body: Body, frame: int, length: float) -> float:
    """Variance of the mean of an error with variance 1 over a body's points in a frame; 1 without points."""
    seen = [np.isfinite(pixels[frame]).all(axis=1) for pixels in body.pixels]
    means = [variance_of_mean(body.points[one], length) for one in seen if one.any()]
    return sum(means) / len(means) ** 2 if means else 1.0


def with_outline_errors(line: CentreLine, result: StereoResult, errors: PictureErrors) -> CentreLine:
    """The outline with the shared error of its Z as modes. The remaining variance is added to its sigma."""
    modes, left = error_patterns(
        line.time, line.y, sigma=errors.outline_sigma, memory=errors.memory, length=errors.length
    )
    return replace(line, sigma=np.hypot(line.sigma, left), modes=modes)


def with_departures(line: CentreLine, result: StereoResult, half_width: float) -> CentreLine:
    """The outline with one more mode.

    The mode is its deviation beyond noise from the surface on both sides of the strip. A highlight shifts all
    points of the strip equally while it lies there. If the cameras are arranged along the axis, the epipolar
    distances do not reveal it (`dic.surfaces.outline`).

    ``line``: the outline, with the same points as in the result. ``result``: the result of its pictures.
    ``half_width``: half width of the strip [m].
    """
    body = result.specimen
    found = departures(body.surface, body.points, result.centre, half_width=half_width)
    pattern = beyond_noise(*found)
    if not pattern.any():
        return line
    modes = pattern[None] if line.modes is None else np.vstack([line.modes, pattern])
    return replace(line, modes=modes)


def outline_offsets(result: StereoResult, errors: PictureErrors | None) -> dict[str, float]:
    """Standard uncertainties of the test frame's position, by their keys in [uncertainty] [m].

    Along y it is the uncertainty of the specimen's lower end. The axis is placed at the specimen's radius
    behind the mean surface at rest. The error of this mean in the static frames is an offset of all points.
    Late in the test, the offset is independent of the current frame's error. Early in the test, both are
    correlated and partly cancel. Their sum is therefore an upper bound.
    """
    own = np.diag(result.placement.frame.covariance)
    depth = float(own[5])
    if errors is not None:
        seen = result.specimen.surface.valid[result.static].any(axis=0)
        share = variance_of_mean(result.specimen.points[seen], errors.shared.length)
        share *= mean_over_time(max(int(result.static.sum()), 1), errors.shared.memory)
        depth += errors.outline_sigma**2 * share
    return {"Z_offset": float(np.sqrt(depth)), "y_offset": float(np.sqrt(own[4]))}
