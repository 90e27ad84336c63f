"""Measurements inside the window, and predictions of the same quantities from simulations of the shot.

Force samples are averaged over bins; the outline is compared at the measured heights. The side surface of the
model is a monotone cubic through its nodes, evaluated at these heights.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from dic.basics import check_interval
from explicit import Response
from kolsky.bars.signals.transducers import CAMERA_FRAME, ForceBins, bin_force
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.base.records import CentreLine, ForceHistory

LEAST_STEP = 1e-7
"""Nodes nearer than this in y lie on one platen [m]; far above round-off, far below two free nodes."""
HEIGHT_TOLERANCE = 1e-12
"""Tolerance of y at the measured height [m]."""
MOST_BISECTIONS = 100


def radius_at(
    surface_r: FloatArray, surface_y: FloatArray, frame: NDArray[np.intp], y: FloatArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Radius of the free side surface at given heights.

    Parameters
    ----------
    surface_r, surface_y : ndarray
        The surface's nodes, transmission platen first [m], shape [n_frames, n_nodes].
    frame : ndarray
        Row of `surface_r` in which each point lies, shape [n_points].
    y : ndarray
        Height of each point [m], shape [n_points].

    Returns
    -------
    r : ndarray
        Radius [m], shape [n_points]; NaN where `inside` is False.
    inside : ndarray of bool
        True if the free surface reaches the point's height, shape [n_points].

    Raises
    ------
    ValueError
        If a node is not finite, if a frame has no free surface, or if a row is not one of the surface's.
    """
    check_interval(f"[0, {len(surface_r) - 1}]", frame=frame)
    if not (np.isfinite(surface_r).all() and np.isfinite(surface_y).all()):
        raise ValueError("the surface has nodes that are not finite; leave out simulations that ended early")
    first, last = free_part(surface_y)
    slope_r = _slopes(surface_r, first, last)
    slope_y = _monotone(surface_y, _slopes(surface_y, first, last), first, last)
    node = np.arange(surface_y.shape[1])
    free_y = np.where(node < first[:, None], -np.inf, np.where(node > last[:, None], np.inf, surface_y))
    inside = (y >= surface_y[frame, first[frame]]) & (y <= surface_y[frame, last[frame]])
    f, at = frame[inside], y[inside]
    left = np.minimum(np.count_nonzero(free_y[f] <= at[:, None], axis=1) - 1, last[f] - 1)
    x = _solve(_cubic(surface_y, slope_y, f, left), at)
    r = np.full(y.shape, np.nan)
    r[inside] = _value(_cubic(surface_r, slope_r, f, left), x)
    return r, inside


def free_part(surface_y: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last node of the free surface: the nodes of increasing y around its widest interval."""
    step = np.diff(surface_y, axis=1)
    interval = np.arange(step.shape[1])
    widest = step.argmax(axis=1)[:, None]
    stops = step < LEAST_STEP
    if stops[np.arange(len(step)), widest[:, 0]].any():
        row = int(np.flatnonzero(stops[np.arange(len(step)), widest[:, 0]])[0])
        raise ValueError(
            f"the side surface of frame row {row} has no free part: no y exceeds its predecessor"
        )
    first = np.where(stops & (interval < widest), interval + 1, 0).max(axis=1)
    last = np.where(stops & (interval > widest), interval, step.shape[1]).min(axis=1)
    return first, last


def _slopes(f: FloatArray, first: NDArray[np.intp], last: NDArray[np.intp]) -> FloatArray:
    """df per node: central differences inside the free part, a parabola's slope at its ends; the chord's for
    2 nodes.
    """
    slope = np.zeros_like(f)
    slope[:, 1:-1] = 0.5 * (f[:, 2:] - f[:, :-2])
    row = np.arange(len(f))
    for end, inward in ((first, 1), (last, -1)):
        third = np.where(last - first >= 2, end + 2 * inward, end)
        chord = f[row, end + inward] - f[row, end]
        bend = f[row, third] - 2.0 * f[row, end + inward] + f[row, end]
        slope[row, end] = inward * np.where(last - first >= 2, chord - 0.5 * bend, chord)
    return slope


def _monotone(
    f: FloatArray, slope: FloatArray, first: NDArray[np.intp], last: NDArray[np.intp]
) -> FloatArray:
    """Slopes limited to 0 ... 3 times the smaller neighbouring difference (Fritsch and Carlson 1980).

    Without it, y would not be monotone near a node about to touch a platen: three solutions at a height.
    """
    step = np.diff(f, axis=1)
    interval = np.arange(step.shape[1])
    step = np.where((interval >= first[:, None]) & (interval < last[:, None]), step, np.inf)
    edge = np.full((len(f), 1), np.inf)
    smaller = np.minimum(np.hstack([edge, step]), np.hstack([step, edge]))
    return np.clip(slope, 0.0, 3.0 * smaller)


Cubic = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def _cubic(f: FloatArray, slope: FloatArray, row: NDArray[np.intp], left: NDArray[np.intp]) -> Cubic:
    """Coefficients c0 + c1 x + c2 x^2 + c3 x^3 of the interval right of node `left`, x in [0, 1]."""
    f0, f1, d0, d1 = f[row, left], f[row, left + 1], slope[row, left], slope[row, left + 1]
    return f0, d0, 3.0 * (f1 - f0) - 2.0 * d0 - d1, 2.0 * (f0 - f1) + d0 + d1


def _value(c: Cubic, x: FloatArray) -> FloatArray:
    return c[0] + x * (c[1] + x * (c[2] + x * c[3]))


def _solve(c: Cubic, at: FloatArray) -> FloatArray:
    """x in [0, 1] where the increasing cubic has the value `at`, by Newton's method inside a bracket."""
    low, high = np.zeros_like(at), np.ones_like(at)
    x = np.clip((at - c[0]) / (c[1] + c[2] + c[3]), 0.0, 1.0)
    for _ in range(MOST_BISECTIONS):
        miss = _value(c, x) - at
        if (np.abs(miss) < HEIGHT_TOLERANCE).all():
            return x
        low, high = np.where(miss < 0.0, x, low), np.where(miss > 0.0, x, high)
        slope = c[1] + x * (2.0 * c[2] + 3.0 * x * c[3])
        newton = x - np.divide(miss, slope, out=np.full_like(x, np.inf), where=slope > 0.0)
        middle = 0.5 * (low + high)
        safe = (newton >= low) & (newton <= high)
        x = np.where(np.abs(miss) < HEIGHT_TOLERANCE, x, np.where(safe, newton, middle))
    raise ArithmeticError("a height was not found on a monotone surface: please report this")


SAME_TIME = 1e-9
"""Times closer than this are equal [s]. The platen moves by 5 nm in this time."""


@dataclass(frozen=True)
class Observations:
    """The measurements inside the window."""

    force: ForceHistory
    """The transmitted force at every recorded sample, P of them."""
    bins: ForceBins
    centre_line: CentreLine
    """The outline points, Q of them, frames in order of time; Q is 0 if no outline was measured."""
    incident: ForceBins | None = None
    """The incident force at the flyer's transducer, in bins of its samples; None if it is not compared."""
    force_sigma_gain: float = 0.0
    """Standard uncertainty of the scale of the transmitted force [-]; the sigmas above do not include it."""

    @property
    def has_shape(self) -> bool:
        """True if an outline was measured."""
        return self.centre_line.time.size > 0

    @property
    def forces(self) -> tuple[ForceBins, ...]:
        """The forces that are compared: the transmitted one and, if present, the incident one."""
        return (self.bins,) if self.incident is None else (self.bins, self.incident)

    def force_parts(self) -> Iterator[tuple[ForceBins, slice]]:
        """The bins of each force, with their entries in a data vector."""
        start = 0
        for force in self.forces:
            yield force, slice(start, start + len(force.mean))
            start += len(force.mean)

    @property
    def n_force(self) -> int:
        """Bins of all forces: the entries of a data vector in front of the outline."""
        return sum(len(force.mean) for force in self.forces)

    @property
    def force_mean(self) -> FloatArray:
        """Measured means of all forces' bins [N], shape [n_force]."""
        return np.concatenate([force.mean for force in self.forces])

    @property
    def force_sigma(self) -> FloatArray:
        """Their standard deviations [N], shape [n_force]."""
        return np.concatenate([force.sigma for force in self.forces])

    @property
    def force_times(self) -> FloatArray:
        """Centres of all forces' bins [s], shape [n_force]."""
        return np.concatenate([force.centres for force in self.forces])

    def of_forces(self, of: Callable[[ForceBins, str], FloatArray]) -> FloatArray:
        """Join a function of bins and name ("transmission" or "flyer") of every force."""
        return np.concatenate(
            [of(*each) for each in zip(self.forces, ("transmission", "flyer"), strict=False)], axis=-1
        )

    @property
    def frame_times(self) -> FloatArray:
        """Times of the frames that have a point [s], shape [M]."""
        return np.unique(self.centre_line.time)


@dataclass(frozen=True)
class Prediction:
    """The measured quantities, as each simulation predicts them."""

    force: FloatArray
    """Transmitted force at the recorded times [N], shape [n_samples, P]."""
    force_bins: FloatArray
    """Means of all forces over each bin, see `Observations.forces` [N], shape [n_samples, n_force]."""
    Z: FloatArray
    """Radius at the measured heights [m], shape [n_samples, Q]; NaN where `inside` is False."""
    inside: BoolArray
    """Points that the model's free surface reaches, shape [n_samples, Q]."""

    def select(self, rows: Sequence[int] | NDArray[np.intp]) -> Prediction:
        """A subset of the simulations."""
        return Prediction(*(getattr(self, one.name)[rows] for one in fields(self)))

    @classmethod
    def joined(cls, parts: Sequence[Prediction]) -> Prediction:
        """The simulations of several predictions, one after the other."""
        return cls(*(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(cls)))


def observe(
    force: ForceHistory,
    centre_line: CentreLine | None,
    *,
    window: tuple[float, float],
    bin_width: float = CAMERA_FRAME,
    incident: ForceHistory | None = None,
) -> Observations:
    """Select the data inside the window, and bin the force.

    ``centre_line``: the outline; None if none was measured. ``window``: first and last time, both included
    [s]. ``bin_width``: of the force [s]. ``incident``: the incident force, if it is compared. Raises
    ValueError if the window holds no outline point or fewer than 2 force samples, if the bin width does not
    fit, or if a Z or a sigma inside is not positive.
    """
    bins = bin_force(force, window=window, width=bin_width)
    first, last = window
    kept = (force.time >= first) & (force.time <= last)
    inside = ForceHistory(time=force.time[kept], force=force.force[kept], sigma=force.sigma[kept])
    _positive("sigma of the force", inside.sigma)
    front = None if incident is None else bin_force(incident, window=window, width=bin_width)
    if front is not None:
        _positive("sigma of the incident force", front.sigma)
    if centre_line is None:
        return Observations(force=inside, bins=bins, centre_line=_NO_LINE, incident=front)
    point = np.flatnonzero((centre_line.time >= first) & (centre_line.time <= last))
    if point.size == 0:
        raise ValueError(
            f"no outline point lies in the window {first:.9g} to {last:.9g} s; the frames span"
            f" {centre_line.time.min():.9g} to {centre_line.time.max():.9g} s"
            if centre_line.time.size
            else "the outline has no point"
        )
    point = point[np.argsort(centre_line.time[point], kind="stable")]
    line = centre_line.select(point)
    _positive("Z", line.Z)
    _positive("sigma of Z", line.sigma)
    return Observations(force=inside, bins=bins, centre_line=line, incident=front)


def predict(response: Response, observations: Observations) -> Prediction:
    """Predict the measured quantities from every simulation of a batch.

    The force at the recorded times is interpolated linearly, as for Eq. (M.4). A bin's mean is exact: the
    difference of the impulses at its edges, divided by its width. The radius is that of `radius_at`, never
    beyond the model's range.

    Raises ValueError if a simulation did not complete, or lacks a frame, a bin edge or a recorded sample.
    """
    lost = np.flatnonzero(~response.completed)
    if lost.size:
        raise ValueError(
            f"simulation {lost[0]} of {response.n_samples} did not complete"
            f" ({response.describe(int(lost[0]))}); first select the completed ones:"
            " response.select(np.flatnonzero(response.completed))"
        )
    t, line = response.force_times, observations.centre_line
    recorded = observations.force.time
    if recorded[0] < t[0] - SAME_TIME or recorded[-1] > t[-1] + SAME_TIME:
        raise ValueError(
            f"the simulated force spans {t[0]:.9g} to {t[-1]:.9g} s, the recorded samples"
            f" {recorded[0]:.9g} to {recorded[-1]:.9g} s; request force_times over the whole window"
        )
    outline = [(np.empty(0), np.empty(0, dtype=bool))] * response.n_samples
    if observations.has_shape:
        frame = _rows(response.surface_times, line.time, "frame", "surface_times")
        outline = [
            radius_at(r, y, frame, line.y)
            for r, y in zip(response.surface_r, response.surface_y, strict=True)
        ]

    def bin_means(bins: ForceBins, force: str) -> FloatArray:
        impulse = response.impulse_transmission if force == "transmission" else response.impulse_flyer
        edge = _rows(t, bins.edges, "bin edge", "force_times")
        return np.asarray(np.diff(impulse[:, edge], axis=1) / np.diff(bins.edges))

    return Prediction(
        force=np.stack([np.interp(recorded, t, f) for f in response.force_transmission]),
        force_bins=observations.of_forces(bin_means),
        Z=np.stack([Z for Z, _ in outline]),
        inside=np.stack([inside for _, inside in outline]),
    )


_NO_LINE = CentreLine(np.empty(0), np.empty(0, dtype=np.int64), np.empty(0), np.empty(0), np.empty(0))


def _positive(name: str, value: FloatArray) -> None:
    if not (value > 0.0).all():
        raise ValueError(f"every {name} in the window must be > 0, got {value.min():.6g}")


def _rows(times: FloatArray, wanted: FloatArray, what: str, field: str) -> NDArray[np.intp]:
    """Index of each requested time among increasing `times`."""
    row = np.minimum(np.searchsorted(times, wanted - SAME_TIME), times.size - 1)
    missing = np.flatnonzero(~(np.abs(times[row] - wanted) <= SAME_TIME))
    if missing.size:
        raise ValueError(
            f"the response has no {field} entry at the {what} {wanted[missing[0]]:.9g} s ({missing.size} of"
            f" {wanted.size} missing); request every {what} in explicit.Sampling({field}=...)"
        )
    return row
