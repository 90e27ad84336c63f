"""History of a surface in the test frame: from points in the rig's frame to centre line and noise floor."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dic.basics import BoolArray, FloatArray, IntArray, check_interval
from dic.outcome import PointOutcome
from dic.stereo.reconstruction import Reconstruction
from dic.surfaces.cylinder import SpecimenFrame
from dic.views import ResultViews


@dataclass(frozen=True)
class SurfaceHistory(ResultViews):
    """Points of a surface, tracked through the frames of a test.

    Components are (x, y, Z). y is the compression axis from the transmission platen toward the flyer. Z
    points toward the cameras; x completes a right-handed frame. A point that was lost in a frame keeps its
    entry. `outcome` gives the reason; ignore its `u` and `sigma` (normally NaN).

    Raises
    ------
    ValueError
        If shapes do not match, times do not increase, or an outcome is unknown. If the displacement of a
        valid point is not finite, or its sigma is not positive.
    """

    t: FloatArray
    """Frame times on the shot's clock [s], shape [n_frames]."""
    X: FloatArray
    """Reference positions [m], shape [n_points, 3]."""
    u: FloatArray
    """Displacements from the reference positions [m], shape [n_frames, n_points, 3]."""
    sigma: FloatArray
    """Standard deviations of the positions, by component [m], shape [n_frames, n_points, 3]."""
    outcome: IntArray
    """`PointOutcome` of every point in every frame, shape [n_frames, n_points]."""

    def __post_init__(self) -> None:
        n_frames, n_points = self.n_frames, self.n_points
        shapes = {
            "t": (n_frames,),
            "X": (n_points, 3),
            "u": (n_frames, n_points, 3),
            "sigma": (n_frames, n_points, 3),
            "outcome": (n_frames, n_points),
        }
        for name, shape in shapes.items():
            actual = np.shape(getattr(self, name))
            if actual != shape:
                raise ValueError(f"{name} has shape {actual}, must be {shape}")
        if not np.all(np.isfinite(self.X)):
            raise ValueError("X must be finite: a point without a reference position cannot be followed")
        if not np.all(np.isfinite(self.t)):
            raise ValueError(f"t must be finite, got {self.t}")
        if not np.all(np.diff(self.t) > 0.0):
            row = int(np.argmin(np.diff(self.t) > 0.0))
            raise ValueError(
                f"t must increase, got {self.t[row]} s then {self.t[row + 1]} s (frame {row + 1})"
            )
        unknown = ~np.isin(self.outcome, [int(member) for member in PointOutcome])
        if np.any(unknown):
            names = ", ".join(f"{member.value} {member.name}" for member in PointOutcome)
            raise ValueError(f"outcome {self.outcome[unknown][0]} is not one of {names}")
        bad = self.valid & ~np.all(np.isfinite(self.u) & np.isfinite(self.sigma) & (self.sigma > 0.0), axis=2)
        if np.any(bad):
            frame, point = np.argwhere(bad)[0]
            raise ValueError(
                f"frame {frame}, point {point} is VALID but has u {self.u[frame, point]} m and sigma "
                f"{self.sigma[frame, point]} m: u must be finite and sigma positive; set its outcome instead"
            )

    @property
    def n_frames(self) -> int:
        """Number of frames."""
        return len(self.t)

    @property
    def n_points(self) -> int:
        """Number of points."""
        return len(self.X)

    @property
    def valid(self) -> NDArray[np.bool_]:
        """True where a point was found, shape [n_frames, n_points]."""
        return np.asarray(self.outcome == PointOutcome.VALID)

    @property
    def position(self) -> FloatArray:
        """Current positions [m], shape [n_frames, n_points, 3]; meaningful where `valid`."""
        return self.X + self.u

    def __repr__(self) -> str:
        share = f", {100.0 * self.valid.mean():.3g} % found" if self.outcome.size else ""
        return f"SurfaceHistory({self.n_frames} frames, {self.n_points} points{share})"


@dataclass(frozen=True)
class CentrePoints:
    """The outline on the camera side: valid points only, one entry per point and frame."""

    t: FloatArray
    """Time of the point's frame on the shot's clock [s], shape [n]."""
    frame: IntArray
    """Frame number of the point, shape [n]."""
    y: FloatArray
    """Position along the compression axis [m], shape [n]."""
    Z: FloatArray
    """Distance from the specimen's axis, the model's r [m], shape [n]."""
    sigma: FloatArray
    """Standard deviation of Z [m], shape [n]."""
    left_out: Mapping[PointOutcome, int]
    """Number of omitted points of the strip over all frames, by outcome. An outcome without points has no
    entry."""


def centre_line(
    surface: SurfaceHistory, *, half_width: float, axis_x: float = 0.0, axis_Z: float = 0.0
) -> CentrePoints:
    """Outline of an axisymmetric specimen from the points near its centre line.

    Exactly on the centre line x = `axis_x` the out-of-plane position is the radius, Z = r. A point at a small
    distance d = x - `axis_x` lies on the same circle, but its Z is smaller by d²/(2 r). Each point is
    therefore rotated about the axis to the centre line, ``Z = sqrt(d² + (Z - axis_Z)²)``; its sigma is
    propagated to first order for independent components. This is valid for any body of revolution about the
    line (axis_x, y, axis_Z), also a barrelled one. If the specimen is tilted or eccentric, Z depends on d.

    Parameters
    ----------
    surface
        The measured surface.
    half_width
        Points within this distance of the centre plane in their frame are used [m].
    axis_x, axis_Z
        Position of the specimen's axis in the surface's frame [m].

    Returns
    -------
    CentrePoints
        The points, frame by frame, in each frame by increasing y. An invalid point has no current position.
        `left_out` counts it if its reference position lies in the strip.

    Raises
    ------
    ValueError
        If `half_width` is not positive, if a position of the axis is not finite, or if a valid point of the
        strip is not on the camera side of the axis.
    """
    check_interval("(-inf, inf)", axis_x=axis_x, axis_Z=axis_Z)
    if not (np.isfinite(half_width) and half_width > 0.0):
        raise ValueError(f"half_width must be a positive length in metres, got {half_width}")
    position = surface.position
    d, depth = position[..., 0] - axis_x, position[..., 2] - axis_Z
    valid = surface.valid
    used = valid & (np.abs(d) <= half_width)
    if np.any(used & (depth <= 0.0)):
        frame, point = np.argwhere(used & (depth <= 0.0))[0]
        raise ValueError(
            f"frame {frame}, point {point} lies {depth[frame, point]} m from the axis toward the cameras, "
            f"must be > 0: check axis_Z (now {axis_Z} m)"
        )
    frame, point = np.nonzero(used)
    y = position[frame, point, 1]
    order = np.lexsort((y, frame))
    frame, point, y = frame[order], point[order], y[order]
    d, depth = d[frame, point], depth[frame, point]
    radius = np.hypot(d, depth)
    sigma = np.hypot(d * surface.sigma[frame, point, 0], depth * surface.sigma[frame, point, 2]) / radius

    outcomes = surface.outcome[:, np.abs(surface.X[:, 0] - axis_x) <= half_width]
    counts = {member: int(np.sum(outcomes == member)) for member in PointOutcome if not member.ok}
    return CentrePoints(
        t=surface.t[frame],
        frame=frame.astype(np.int64),
        y=y,
        Z=radius,
        sigma=sigma,
        left_out={member: count for member, count in counts.items() if count},
    )


def referenced(reconstruction: Reconstruction, reference: Sequence[int] = (0,)) -> BoolArray:
    """Points that are valid in at least one of the reference frames, shape [n_points]."""
    return np.asarray(np.any(reconstruction.outcome[list(reference)] == PointOutcome.VALID, axis=0))


def static_mean(
    reconstruction: Reconstruction, frames: Sequence[int], *, shared: float = 0.5
) -> tuple[FloatArray, FloatArray]:
    """Mean positions over static frames, and their covariances.

    The noise of the material picture is the same in every frame and does not average out. For two pictures of
    equal noise it causes half of the variance of a match.

    ``shared``: share of the variance that is common to all frames [-]. Returns: positions [m], shape
    [n_points, 3]; NaN for a point that is valid in none of the frames. Returns: covariances [m²], shape
    [n_points, 3, 3]; likewise. Raises ValueError if there are no frames, or if `shared` is outside [0, 1].
    """
    if not len(frames) or not 0.0 <= shared <= 1.0:
        raise ValueError(f"frames must be given and shared be in [0, 1], got {list(frames)} and {shared}")
    valid = reconstruction.outcome[list(frames)] == PointOutcome.VALID
    count = np.where(valid.any(axis=0), valid.sum(axis=0), np.nan)
    position = np.where(valid[..., None], reconstruction.position[list(frames)], 0.0)
    covariance = np.where(valid[..., None, None], reconstruction.covariance[list(frames)], 0.0)
    share = (shared + (1.0 - shared) / count) / count
    return position.sum(axis=0) / count[:, None], covariance.sum(axis=0) * share[:, None, None]


def to_surface(
    reconstruction: Reconstruction,
    frame: SpecimenFrame,
    t: ArrayLike,
    *,
    reference: Sequence[int] = (0,),
    points: BoolArray | None = None,
) -> SurfaceHistory:
    """Express reconstructed points in the test frame.

    ``reconstruction``: points in the rig's frame. ``frame``: the test frame. ``t``: times of the frames on
    the shot's clock [s], shape [n_frames]. ``reference``: static frames whose mean gives the reference
    positions. ``points``: mask of the points to use, shape [n_points]; None: all. `referenced` returns the
    points that can be used. Returns: the surface, with the noise of the matches as sigma. Errors common to
    all points are not included: see `SpecimenFrame.sigma` for the frame, and the covariance of the rig for
    the calibration. Raises ValueError if a point has no valid position in any reference frame, or shapes do
    not match.
    """
    defined = referenced(reconstruction, reference)
    selected = np.ones(defined.size, dtype=bool) if points is None else np.asarray(points, dtype=bool)
    if selected.shape != defined.shape:
        raise ValueError(f"points has shape {selected.shape}, must be {defined.shape}")
    missing = int(np.sum(selected & ~defined))
    if missing:
        raise ValueError(
            f"{missing} of {int(selected.sum())} points are valid in none of the reference frames "
            f"{list(reference)} and have no reference position; name more static frames, or leave them out: "
            "points=referenced(reconstruction, reference)"
        )
    position = frame.positions(reconstruction.position[:, selected])
    X = frame.positions(static_mean(reconstruction, reference)[0][selected])
    variance = frame.variances(reconstruction.covariance[:, selected])
    outcome = reconstruction.outcome[:, selected]
    lost_here = (outcome != PointOutcome.VALID)[..., None]
    with np.errstate(invalid="ignore"):  # a negative variance gives NaN, which is rejected below
        sigma = np.sqrt(np.where(lost_here, np.nan, variance))
    return SurfaceHistory(
        t=np.asarray(t, dtype=np.float64),
        X=X,
        u=np.where(lost_here, np.nan, position - X),
        sigma=sigma,
        outcome=outcome,
    )


SMALLEST_SERIES = 3
"""Smallest number of static frames for a noise floor."""


@dataclass(frozen=True)
class NoiseFloor:
    """Apparent motion of points at rest; each by component (x, y, Z) [m], shape [3].

    The noise of the pictures contributes to both `time` and `space`. A bias that is constant over all frames,
    e.g. from interpolation or the lens, is part of the static reference position. It contributes to neither.
    """

    n_frames: int
    """Number of static frames used."""
    n_points: int
    """Number of points that were valid in all of them."""
    time: FloatArray
    """Standard deviation of a point over the frames, root mean square over the points."""
    space: FloatArray
    """Standard deviation over the points of a frame, root mean square over the frames."""
    common: FloatArray
    """Standard deviation over the frames of the mean of all points: motion of the cameras or the bench."""
    sigma: FloatArray
    """Noise predicted by the matches: root mean square of `SurfaceHistory.sigma`."""

    @property
    def ratio(self) -> FloatArray:
        """Measured over predicted noise [-], shape [3]; 1 if sigma is right."""
        return np.asarray(self.time / self.sigma)


def noise_floor(surface: SurfaceHistory, static: NDArray[np.bool_]) -> NoiseFloor:
    """Noise floor of displacements from static frames.

    ``static``: True for frames at rest, shape [n_frames]. Raises ValueError if there are fewer than
    three static frames with points, or if no point is valid in all of them.
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
    apart = (off - mean[:, None]) * np.sqrt(count / (count - 1))  # the mean uses one degree of freedom
    return NoiseFloor(
        n_frames=count,
        n_points=int(points.sum()),
        time=np.sqrt(variance.mean(axis=0)),
        space=np.sqrt(np.sum(apart**2, axis=(0, 1)) / (count * max(int(points.sum()) - 1, 1))),
        common=np.sqrt(np.sum(mean**2, axis=0) / (count - 1)),
        sigma=np.sqrt(np.mean(surface.sigma[frames][:, points] ** 2, axis=(0, 1))),
    )
