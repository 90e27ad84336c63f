"""The cost of Mates et al. (2012) and the surface through it: its least, and what it says of friction."""

from dataclasses import dataclass

import numpy as np

from doe import Box, CostSurrogate, nelder_mead
from kolsky.base.arrays import FloatArray
from kolsky.inverse.misfit import SCALE_FORCE, Terms
from kolsky.inverse.parameters import MOVED
from kolsky.studies import sweep as sweeping

FRICTION = "friction"
GRID = 101
"""Places along each parameter at which the surface is looked at for the interval."""


@dataclass(frozen=True)
class Surface:
    """Runs of one mesh and radial basis functions through their cost."""

    runs: sweeping.Sweep
    """The runs."""
    fit: CostSurrogate
    """Through the cost of those that completed."""
    optimum: FloatArray
    """Where the simplex found its least, in parameter units, shape [d]."""
    least: float
    """The cost there by the surface [-]."""


def cost_of(found: Terms) -> float:
    """Phi, Eq. (M.5) [-]; its force term where no outline was measured."""
    return found.phi if found.has_shape else found.phi_force / SCALE_FORCE


def delta_of(found: Terms) -> float:
    """delta Phi, Eq. (M.8) [-]; its force term, Eq. (M.7), where no outline was measured."""
    return found.sigma_phi if found.has_shape else found.sigma_phi_force / SCALE_FORCE


def profile(fit: CostSurrogate, name: str = MOVED) -> tuple[FloatArray, FloatArray]:
    """Values of a parameter and the least cost over the other at each, shape [GRID] each."""
    box = fit.box
    axes = [np.linspace(0.0, 1.0, GRID)] * box.dimension
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    points = box.scale(grid.reshape(-1, box.dimension))
    cost = fit.predict(points)[:, 0].reshape(grid.shape[:-1])
    own = box.names.index(name)
    others = tuple(axis for axis in range(box.dimension) if axis != own)
    low, high = box.lower[own], box.upper[own]
    return np.linspace(low, high, GRID), cost.min(axis=others)


def friction_told(fit: CostSurrogate, delta: float) -> bool:
    """True if the largest friction of the design costs more than delta Phi over the least."""
    _, cost = profile(fit, FRICTION)
    return bool(cost[-1] - cost.min() > delta)


def surface_of(runs: sweeping.Sweep) -> Surface:
    """Radial basis functions through the costs of completed runs, and where a simplex finds their least.

    Raises
    ------
    ValueError
        If fewer than four runs completed.
    """
    table = runs.table
    box = Box.of({n: (a, b) for n, a, b in zip(table.names, table.lower, table.upper, strict=True)})
    cost = sweeping.costs(table)
    done = np.flatnonzero(np.isfinite(cost))
    if len(done) < 4:
        first = f"; the first ended {table.ending(table.lost[0]).sentence}" if table.lost else ""
        raise ValueError(f"{len(done)} of {len(cost)} runs of the design completed, 4 are needed{first}")
    fit = CostSurrogate.fit(box, table.points[done], cost[done])
    found = nelder_mead(fit.cost, box, start=table.points[done[np.argmin(cost[done])]])
    return Surface(runs, fit, found.x, found.value)


def box_around(whole: Box, x: FloatArray, shares: list[float]) -> Box:
    """A box about a point with these shares of the edges, moved to lie inside the whole one."""
    bounds = {}
    for i, (name, share) in enumerate(zip(whole.names, shares, strict=True)):
        edge = share * (whole.upper[i] - whole.lower[i])
        low = float(np.clip(x[i] - 0.5 * edge, whole.lower[i], whole.upper[i] - edge))
        bounds[name] = (low, low + edge)
    return Box.of(bounds)
