"""Slopes of force and outline by each parameter: dF/dp(t) over time, dZ/dp(y, t) over height and time.

Slopes are those of straight lines through runs at `LEVELS` values within a *reach* of the point, all in one
batch. They are the mean slopes in the range of a search. The derivative at the point can be very different.
Near incompressibility the specimen rings, and one per cent of stiffness changes the phase noticeably. As the
reach decreases, dF/dp then increases without limit; no mesh predicts the phase so accurately. The residuals
of the force's lines are kept too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

import explicit
from explicit.model import scale_of
from kolsky.base.arrays import FloatArray
from kolsky.inverse.forward import Forward
from kolsky.inverse.observations import radius_at
from kolsky.inverse.parameters import PARAMETERS, checked_value, has_effect, parameter
from kolsky.inverse.settings import Numerics

LEVELS = 10
"""Number of runs per parameter, without that at the point. They are enough to average the ringing in a
slope."""
REACH = 0.1
"""Default reach of each parameter, divided by its scale (`explicit.model.scale_of`)."""


@dataclass(frozen=True)
class ObservationGrid:
    """Times and heights at which force and outline are evaluated."""

    edges: FloatArray
    """Edges of the bins over which the force is averaged [s], shape [n_bins + 1]."""
    frames: FloatArray
    """Times of the outline [s], shape [n_frames]."""
    heights: FloatArray
    """Heights above the transmission platen's initial plane [m], shape [n_heights]."""

    @property
    def times(self) -> FloatArray:
        """Centres of the bins [s], shape [n_bins]."""
        return 0.5 * (self.edges[1:] + self.edges[:-1])


@dataclass(frozen=True)
class LocalSensitivity:
    """Slopes of force and outline by d parameters about one point."""

    names: tuple[str, ...]
    point: FloatArray
    """Their values, in their units, shape [d]."""
    scale: FloatArray
    """Scale of each parameter (a large change) in its unit, shape [d]."""
    reach: float
    """Largest change in the runs, divided by the scale [-]."""
    grid: ObservationGrid
    force: FloatArray
    """Mean force over each bin at the point [N], shape [n_bins]."""
    radius: FloatArray
    """Radius of the free side surface at the point [m], shape [n_frames, n_heights]. NaN at heights that it
    does not reach."""
    force_slope: FloatArray
    """dF/dp [N per unit], shape [d, n_bins]."""
    radius_slope: FloatArray
    """dZ/dp [m per unit], shape [d, n_frames, n_heights]. NaN at heights that the surface does not reach in
    every run."""
    force_left: FloatArray
    """Root mean square residual of the line [N], shape [d, n_bins]."""


def local_sensitivity(
    forward: Forward,
    grid: ObservationGrid,
    names: Sequence[str],
    *,
    held: Mapping[str, float] | None = None,
    reach: float = REACH,
    numerics: Numerics | None = None,
) -> LocalSensitivity:
    """Slopes of force and outline about a point, from one batch of runs.

    ``forward``: the shot; ``grid`` replaces its sampling. ``names``: parameters of
    `kolsky.inverse.parameters.PARAMETERS`. ``held``: values of parameters (also those in `names`) that differ
    from the shot's. ``reach``: largest change divided by the parameter's scale, in (0, 0.5]. Raises
    ValueError if a parameter is unknown, named twice or has no scale at its value. The same error is raised
    if the reach is outside its range, or if a run does not complete.
    """
    if not 0.0 < reach <= 0.5:
        raise ValueError(f"reach must be in (0, 0.5], got {reach}")
    values = _point(forward, names, held or {})
    point = np.array([values[name] for name in names])
    scale = np.array([_scale(name, x) for name, x in zip(names, point, strict=True)])
    n = 1 + LEVELS * len(names)
    columns = {name: np.full(n, value) for name, value in values.items()}
    changes = []
    for i, name in enumerate(names):
        levels = _levels(name, point[i], reach * scale[i])
        columns[name][1 + i * LEVELS : 1 + (i + 1) * LEVELS] = levels
        changes.append(levels - point[i])
    force, radius = observed(forward, grid, columns, numerics or Numerics())
    slopes = []
    for i, change in enumerate(changes):
        rows = [0, *range(1 + i * LEVELS, 1 + (i + 1) * LEVELS)]
        x = np.concatenate([[0.0], change])
        slopes.append((*_line(x, force[rows]), _line(x, radius[rows])[0]))
    force_slope, force_left, radius_slope = (np.array(part) for part in zip(*slopes, strict=True))
    return LocalSensitivity(
        names=tuple(names), point=point, scale=scale, reach=reach, grid=grid, force=force[0],
        radius=radius[0], force_slope=force_slope, radius_slope=radius_slope, force_left=force_left,
    )  # fmt: skip


def _point(forward: Forward, names: Sequence[str], held: Mapping[str, float]) -> dict[str, float]:
    """Values of the named parameters and of parameters held at other values than the shot's."""
    if not names:
        raise ValueError("name at least one parameter")
    for name in names:
        parameter(name)
        if list(names).count(name) > 1:
            raise ValueError(f"{name} is named {list(names).count(name)} times")
    interface = forward.shot.interface
    for p in map(parameter, names):
        if p.slides and p.name not in held and not has_effect(p, (interface.faces, interface.side)):
            raise ValueError(
                f"the interface that the shot declares has no {p.name} coefficient to start from; hold one, "
                f"e.g. {p.name} = 0.3"
            )
    own = {name: PARAMETERS[name].held(forward.shot) for name in names}
    return {name: checked_value(name, value) for name, value in {**own, **held}.items()}


def _scale(name: str, value: float) -> float:
    own = parameter(name).scale
    scale = scale_of(name, value) if own is None else own(value)
    if not 0.0 < scale < np.inf:
        raise ValueError(f"{name} = {value:.6g} has no scale; hold it at a finite value > 0")
    return scale


def _levels(name: str, value: float, reach: float) -> FloatArray:
    """Values about a point. They are shifted inward at the end of the allowed range."""
    low, high = parameter(name).allowed
    levels = value + reach * np.setdiff1d(np.linspace(-1.0, 1.0, LEVELS + 1), [0.0])
    levels = levels + max(0.0, low - levels[0])
    return np.asarray(levels - max(0.0, levels[-1] - high))


def observed(
    forward: Forward, grid: ObservationGrid, columns: Mapping[str, FloatArray], numerics: Numerics
) -> tuple[FloatArray, FloatArray]:
    """Force of every bin, and radius at every frame and height, of runs that must all complete.

    ``columns``: values of each parameter, shape [n]. Returns: force [N], shape [n, n_bins]; radius [m], shape
    [n, n_frames, n_heights]. Raises ValueError if a run does not complete.
    """
    sampling = explicit.Sampling(force_times=grid.edges, surface_times=grid.frames)
    response = completed_runs(replace(forward, sampling=sampling), columns, numerics)
    force = np.diff(response.impulse_transmission, axis=1) / np.diff(grid.edges)
    frame = np.repeat(np.arange(len(grid.frames)), len(grid.heights))
    y = np.tile(grid.heights, len(grid.frames))
    surfaces = zip(response.surface_r, response.surface_y, strict=True)
    radius = np.stack([radius_at(r, h, frame, y)[0] for r, h in surfaces])
    return force, radius.reshape(len(force), len(grid.frames), len(grid.heights))


def completed_runs(
    forward: Forward, columns: Mapping[str, FloatArray | float], numerics: Numerics
) -> explicit.Response:
    """Runs that must all complete.

    ``columns``: values of each parameter, or one value for all runs. Raises ValueError with the place and the
    ending of the first failed run.
    """
    response = forward.run(columns, numerics)
    lost = np.flatnonzero(~response.completed)
    if lost.size:
        first = int(lost[0])
        place = {name: np.broadcast_to(column, response.n_samples)[first] for name, column in columns.items()}
        at = ", ".join(f"{name} = {value:.6g}" for name, value in place.items())
        raise ValueError(
            f"{lost.size} of {response.n_samples} runs did not complete; the one at {at} ended "
            f"{response.describe(first)}"
        )
    return response


def _line(x: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Slope and root mean square residual of the least-squares line, for each entry."""
    away = x - x.mean()
    slope = np.tensordot(away, values, axes=1) / (away @ away)
    rest = values - values.mean(axis=0) - away.reshape(-1, *[1] * slope.ndim) * slope
    return slope, np.sqrt((rest**2).mean(axis=0))
