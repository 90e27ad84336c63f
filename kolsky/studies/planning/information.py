"""The information of a planned test. Its instruments, and the information of each datum on each parameter."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from doe.information import LinearData, SingularInformationError
from kolsky.base.arrays import FloatArray
from kolsky.inverse.forward import Forward
from kolsky.inverse.problem import PreparedShot
from kolsky.inverse.settings import Numerics
from kolsky.studies.local_sensitivity import (
    REACH,
    LocalSensitivity,
    ObservationGrid,
    local_sensitivity,
    observed,
)


@dataclass(frozen=True)
class Instruments:
    """The instruments of a planned test."""

    window: tuple[float, float]
    """First and last compared time, for a test at the rate of the shot [s]."""
    bin_width: float
    """Width of the bins over which the force is averaged [s]."""
    force_sigma: float
    """Standard deviation of a bin's mean [N]."""
    frame_interval: float
    """Time from picture to picture [s]."""
    points: float
    """Independent outline points per height of specimen [1/m]. 0 without cameras."""
    outline_sigma: float
    """Standard deviation of one of them [m]."""
    clearance: float = 0.0
    """Distance from a platen within which the outline cannot be measured [m]."""

    def __post_init__(self) -> None:
        if not self.window[0] < self.window[1]:
            raise ValueError(f"the window must start before it ends, got {self.window} s")
        for name in ("bin_width", "force_sigma", "frame_interval", "outline_sigma"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} must be finite and > 0, got {getattr(self, name)}")
        for name, unit in (("points", "per m"), ("clearance", "m")):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} must be finite and >= 0 {unit}, got {getattr(self, name)}")
        if self.bin_width > 0.5 * (self.window[1] - self.window[0]):
            raise ValueError(f"bin_width must be at most half the window, got {self.bin_width} s")


def instruments_of(prepared: PreparedShot) -> Instruments:
    """The instruments of the shot itself.

    Without an outline there are no points. The caller must then supply their density and sigma.
    """
    observations, window = prepared.observations, prepared.shot.window
    edges = observations.bins.edges
    points, sigma, interval, clearance = 0.0, 1e-6, float(np.diff(edges).mean()), 0.0
    if observations.has_shape:
        line = observations.centre_line
        density = []
        for time in observations.frame_times:
            y = line.y[line.time == time]
            if y.size > 1:
                density.append((y.size - 1) / np.ptp(y))
        points = float(np.median(density)) if density else 0.0
        sigma = float(np.median(line.sigma))
        gap = prepared.shot.specimen.length - prepared.path.position(line.time)
        clearance = max(0.0, float(min(line.y.min(), (gap - line.y).min())))
        if observations.frame_times.size > 1:
            interval = float(np.median(np.diff(observations.frame_times)))
    return Instruments(
        window=window, bin_width=float(np.diff(edges).mean()),
        force_sigma=float(np.median(observations.bins.sigma)), frame_interval=interval, points=points,
        outline_sigma=sigma, clearance=clearance,
    )  # fmt: skip


FRAMES = 97
"""Number of times in the map."""
HEIGHTS = 47
"""Number of heights in the map."""
FINER = 1.5
"""Ratio of the two meshes. Their difference is used as the model error."""


@dataclass(frozen=True)
class Expected:
    """Expected standard deviations of the parameters from a set of data."""

    deviations: FloatArray
    """Standard deviation of each parameter in its unit, with all estimated together, shape [d]. Infinite if
    some direction is unconstrained."""
    alone: FloatArray
    """Standard deviation of each parameter if the others were known, shape [d]. Infinite if it is
    unconstrained."""
    correlation: FloatArray | None
    """Correlation of the estimates [-], shape [d, d]; None if some direction is unconstrained."""
    unseen: str = ""
    """The unconstrained direction, in words."""

    @classmethod
    def of(cls, data: LinearData) -> "Expected":
        """Expected deviations from linear data."""
        try:
            return cls(data.deviations, data.conditional_deviations, data.correlation)
        except SingularInformationError as error:
            nothing = np.full(len(data.names), np.inf)
            return cls(nothing, data.conditional_deviations, None, str(error))


@dataclass(frozen=True)
class Information:
    """The data of one planned test, and the distribution of information over them."""

    sensitivity: LocalSensitivity
    data: LinearData
    """Force bins, then the visible points of the map. Each point represents the points around it."""
    seen: NDArray[np.bool_]
    """Mask of the visible points of the map, shape [n_frames, n_heights]."""

    @property
    def n_force(self) -> int:
        """Number of force bins at the start of the data."""
        return len(self.sensitivity.force)

    @property
    def is_force(self) -> NDArray[np.bool_]:
        """Mask of the data that are forces, shape [k]."""
        return np.arange(len(self.data.sigma)) < self.n_force

    @property
    def time(self) -> FloatArray:
        """Time of each datum [s], shape [k]."""
        grid = self.sensitivity.grid
        frames = np.broadcast_to(grid.frames[:, None], self.seen.shape)[self.seen]
        return np.concatenate([grid.times, frames])

    def mapped(self, column: FloatArray) -> tuple[FloatArray, FloatArray]:
        """A column over the data as forces, shape [n_bins], and as a map. The map is NaN at invisible
        points."""
        field = np.full(self.seen.shape, np.nan)
        field[self.seen] = column[self.n_force :]
        return column[: self.n_force], field

    def densities(self, *, alone: bool = False) -> tuple[FloatArray, FloatArray]:
        """Shares of the information on each parameter, per time, and per time and height. Per time [1/s],
        shape [d, n_bins]. Per time and height [1/(m s)], shape [d, n_frames, n_heights], NaN at invisible
        points. If some direction is unconstrained, the shares in the joint estimate are all NaN."""
        try:
            shares = self.data.conditional_shares if alone else self.data.shares
        except SingularInformationError:
            shares = np.full_like(self.data.jacobian, np.nan)
        grid = self.sensitivity.grid
        area = spacing(grid.frames) * spacing(grid.heights)
        parts = [self.mapped(column) for column in shares.T]
        force = np.array([f for f, _ in parts]) / np.diff(grid.edges)
        return force, np.array([field for _, field in parts]) / area

    def by_frame(self) -> FloatArray:
        """Information of each frame's outline, with parameters in units of their scale, shape [n_frames, d,
        d].
        """
        return self._grouped(np.nonzero(self.seen)[0], self.seen.shape[0])

    def by_height(self) -> FloatArray:
        """Information of the outline at each height over all frames, shape [n_heights, d, d]."""
        return self._grouped(np.nonzero(self.seen)[1], self.seen.shape[1])

    @property
    def of_force(self) -> FloatArray:
        """Information of the force, shape [d, d]."""
        return self.data.select(self.is_force).information

    def _grouped(self, label: NDArray[np.intp], count: int) -> FloatArray:
        rows = self.data.rows[self.n_force :]
        groups = np.zeros((count, rows.shape[1], rows.shape[1]))
        np.add.at(groups, label, rows[:, :, None] * rows[:, None, :])
        return groups


def spacing(places: FloatArray) -> float:
    """Distance of evenly spaced places."""
    return float(places[-1] - places[0]) / (len(places) - 1)


def _at_rate(forward: Forward, factor: float) -> Forward:
    """The same test with a flyer path that is `factor` times as fast."""
    if factor == 1.0:
        return forward
    return replace(forward, paths=(forward.paths[0].faster(factor),))


def information(
    forward: Forward,
    instruments: Instruments,
    names: Sequence[str],
    *,
    held: Mapping[str, float] | None = None,
    rate: float = 1.0,
    reach: float = REACH,
    numerics: Numerics | None = None,
    discrepancy: tuple[float, float] = (0.0, 0.0),
) -> Information:
    """The information of a planned test on some parameters.

    ``instruments``: the measurements and their uncertainties. ``rate``: speed of the flyer divided by that of
    the shot, > 0. The path is the same and the window ends at the same displacement. The specimen therefore
    reaches the same compression earlier. ``discrepancy``: standard deviations of the model error in a force
    bin [N] and an outline point [m], in addition to the noise. Raises ValueError if a value is outside its
    range, or if a run does not complete.
    """
    grid = _observation_grid(forward, instruments, rate)
    moved = _at_rate(forward, rate)
    slopes = local_sensitivity(moved, grid, names, held=held, reach=reach, numerics=numerics)
    gap = forward.shot.specimen.length - moved.paths[0].position(grid.frames)
    seen = (
        np.isfinite(slopes.radius_slope).all(axis=0)
        & (grid.heights >= instruments.clearance)
        & (grid.heights <= gap[:, None] - instruments.clearance)
        & (instruments.points > 0.0)
    )
    # A point of the map represents the pictures and points around it.
    count = spacing(grid.frames) / instruments.frame_interval * spacing(grid.heights) * instruments.points
    sigma_force = np.hypot(instruments.force_sigma, discrepancy[0])
    sigma_point = np.hypot(instruments.outline_sigma, discrepancy[1]) / np.sqrt(count) if count > 0.0 else 1.0
    bins = len(grid.times)
    data = LinearData(
        names=slopes.names,
        jacobian=np.concatenate([slopes.force_slope.T, slopes.radius_slope[:, seen].T]),
        sigma=np.concatenate([np.full(bins, sigma_force), np.full(int(seen.sum()), sigma_point)]),
        scale=slopes.scale,
    )
    return Information(slopes, data, seen)


def discrepancies(
    forward: Forward,
    instruments: Instruments,
    values: Mapping[str, float],
    *,
    rate: float = 1.0,
    numerics: Numerics,
) -> tuple[float, float]:
    """Smallest discrepancies of the model.

    They are the root mean square changes to a mesh `FINER` times as fine [N], [m].

    Raises ValueError if a run does not complete.
    """
    across, along = numerics.mesh
    finer = numerics.with_mesh((round(FINER * across), round(FINER * along)))
    moved, grid = _at_rate(forward, rate), _observation_grid(forward, instruments, rate)
    columns = {name: np.array([value]) for name, value in values.items()}
    here, there = (observed(moved, grid, columns, one) for one in (numerics, finer))
    force, radius = (a[0] - b[0] for a, b in zip(here, there, strict=True))
    both = np.isfinite(radius)
    outline = float(np.sqrt((radius[both] ** 2).mean())) if both.any() else 0.0
    return float(np.sqrt((force**2).mean())), outline


def _observation_grid(forward: Forward, instruments: Instruments, rate: float) -> ObservationGrid:
    """Bins, times and heights of the map of a test at some rate."""
    (start, end), path = instruments.window, forward.paths[0]
    if not (path.start <= start and end <= path.end):
        raise ValueError(
            f"the window {start:.9g} to {end:.9g} s must lie within the flyer's motion, "
            f"{path.start:.9g} to {path.end:.9g} s"
        )
    first, last = (path.start + (t - path.start) / rate for t in (start, end))
    bins = max(2, round((last - first) / instruments.bin_width))
    return ObservationGrid(
        edges=np.linspace(first, last, bins + 1),
        frames=np.linspace(first, last, FRAMES),
        heights=np.linspace(0.0, forward.shot.specimen.length, HEIGHTS + 2)[1:-1],
    )
