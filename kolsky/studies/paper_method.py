"""The method of Mates et al. (2012).

Factorial design over friction and stiffness, surface through Phi, simplex.

Its cost and the surface through it, the interval, and the answer as text and JSON. In the interval, the cost
cannot be distinguished from its minimum, Eqs. (M.6)-(M.8).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from doe import Box, CostSurrogate, full_factorial, nelder_mead
from explicit.contact import contact_law
from kolsky.base.arrays import FloatArray
from kolsky.base.files import jsonable
from kolsky.inverse import simulate as single
from kolsky.inverse.parameters import MOVED, design_box
from kolsky.inverse.run_table import SCALE_FORCE, Terms
from kolsky.inverse.settings import Numerics
from kolsky.shot.records import Shot
from kolsky.studies import sweep as sweeping

FRICTION = "friction"
GRID = 101
"""Number of values along each parameter at which the surface is evaluated for the interval."""


@dataclass(frozen=True)
class Surface:
    """Runs of one mesh, and radial basis functions through their cost."""

    runs: sweeping.Sweep
    fit: CostSurrogate
    """Surface through the cost of the completed runs."""
    optimum: FloatArray
    """Minimum found by the simplex, in parameter units, shape [d]."""


def cost_of(found: Terms) -> float:
    """Phi, Eq. (M.5) [-]. Its force term without an outline."""
    return found.phi if found.has_shape else found.phi_force / SCALE_FORCE


def delta_of(found: Terms) -> float:
    """delta Phi, Eq. (M.8) [-]. Its force term, Eq. (M.7), without an outline."""
    return found.sigma_phi if found.has_shape else found.sigma_phi_force / SCALE_FORCE


def profile(fit: CostSurrogate, name: str = MOVED) -> tuple[FloatArray, FloatArray]:
    """Values of a parameter, and the least cost over the other parameter at each value, shape [GRID] each."""
    box = fit.box
    axes = [np.linspace(0.0, 1.0, GRID)] * box.dimension
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    points = box.scale(grid.reshape(-1, box.dimension))
    cost = fit.predict(points)[:, 0].reshape(grid.shape[:-1])
    own = box.names.index(name)
    others = tuple(axis for axis in range(box.dimension) if axis != own)
    return np.linspace(box.lower[own], box.upper[own], GRID), cost.min(axis=others)


def friction_constrained(fit: CostSurrogate, delta: float) -> bool:
    """True if the cost at the largest friction of the design exceeds the least cost by more than delta
    Phi.
    """
    _, cost = profile(fit, FRICTION)
    return bool(cost[-1] - cost.min() > delta)


def surface_of(runs: sweeping.Sweep) -> Surface:
    """Radial basis functions through the costs of completed runs, and their minimum by a simplex.

    Raises ValueError if fewer than four runs completed.
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
    return Surface(runs, fit, found.x)


def box_around(whole: Box, x: FloatArray, shares: list[float]) -> Box:
    """A box about a point with these shares of the edges. It is moved to lie inside the whole box."""
    bounds = {}
    for i, (name, share) in enumerate(zip(whole.names, shares, strict=True)):
        edge = share * (whole.upper[i] - whole.lower[i])
        low = float(np.clip(x[i] - 0.5 * edge, whole.lower[i], whole.upper[i] - edge))
        bounds[name] = (low, low + edge)
    return Box.of(bounds)


@dataclass(frozen=True)
class CostInterval:
    """Range of a parameter in which the cost is within delta Phi of the least cost."""

    low: float
    """Lower end, in the parameter's unit."""
    high: float
    open_low: bool
    """True if the cost at the lower bound of the design is still within delta Phi."""
    open_high: bool
    """True if the cost at the upper bound is still within delta Phi."""

    def moved(self, distance: float) -> "CostInterval":
        """The same interval about another optimum, for example on another mesh."""
        return CostInterval(self.low + distance, self.high + distance, self.open_low, self.open_high)


def cost_interval(x: FloatArray, cost: FloatArray, delta: float) -> CostInterval:
    """The outermost values of a parameter with Phi <= min Phi + delta Phi. A cost may have several valleys.
    One interval then covers all valleys that cannot be distinguished from the deepest."""
    if not (np.isfinite(cost).all() and np.isfinite(delta) and delta >= 0.0):
        raise ValueError(f"the interval needs finite costs and an uncertainty >= 0, got {delta}")
    limit = float(cost.min()) + delta
    inside = np.flatnonzero(cost <= limit)
    first, last = int(inside[0]), int(inside[-1])
    low, high = float(x[first]), float(x[last])
    if first > 0:
        low = _crossing(x[first - 1 : first + 1], cost[first - 1 : first + 1], limit)
    if last < len(x) - 1:
        high = _crossing(x[last : last + 2], cost[last : last + 2], limit)
    return CostInterval(low, high, first == 0, last == len(x) - 1)


def _crossing(x: FloatArray, cost: FloatArray, limit: float) -> float:
    """Position at which the line between two points reaches the limit."""
    share = (limit - cost[0]) / (cost[1] - cost[0])
    return float(x[0] + share * (x[1] - x[0]))


BOUNDS = {FRICTION: (0.0, 2.0), MOVED: (0.75, 1.5)}
"""The paper's designs: its Fig. 9 and, for the stiffness factor, the wider range of its Fig. 10."""
LEVELS, LEVELS_ALONE = 10, 16
"""Number of levels of each of two parameters, and of the stiffness factor alone."""
REFINED_LEVELS = (3, 7)
"""Levels of friction and of the stiffness factor on the refined mesh."""
REFINED_SHARE = (0.25, 0.16)
"""Edges of the box on the refined mesh, as shares of those of the design."""
MOST_BOXES, MOST_CHECKS = 3, 6
"""Maximum number of boxes on the refined mesh, and of runs at the optimum on this mesh."""
CONFIRMED = 0.005
"""A run at the optimum confirms the stiffness factor if it shifts by no more than this. It is half of the
last digit in the paper."""
SAME = 1e-6
"""Points of the unit box with a smaller distance than this are one run."""

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class PaperAnswer:
    """The answer of the paper's method for a shot."""

    shot: str
    factor: float
    """Stiffness factor m of the last run [-]."""
    interval: CostInterval
    """Interval of m from delta Phi [-]."""
    friction: float | None
    """Friction coefficient of the last run [-]; None if nothing slips."""
    friction_told: bool
    """False if the data do not constrain the friction."""
    coarse: dict[str, float]
    """Optimum of the surface on the coarse mesh."""
    terms: Terms
    """Misfits of the last run and their uncertainties, Eqs. (M.3)-(M.8)."""
    predicted: float
    """Cost of the last run predicted by the surface on the refined mesh [-]."""
    confirmed: bool
    """True if this run confirmed m inside the bounds of the design."""
    error: float
    """Leave-one-out error (rms) of the surface on the coarse mesh [-]."""
    design: tuple[float, float]
    """Bounds of the design of m [-]."""
    meshes: tuple[tuple[int, int], tuple[int, int]]
    surfaces: tuple[Surface, ...]
    """Every design that was run, in order. The last one is that of the refined mesh."""
    checks: tuple[tuple[dict[str, float], float], ...]
    """Runs at the optimum on the refined mesh: parameters and cost."""

    @property
    def cost(self) -> float:
        """Cost of the last run [-], see `cost_of`."""
        return cost_of(self.terms)

    @property
    def delta(self) -> float:
        """Its uncertainty [-], see `delta_of`."""
        return delta_of(self.terms)


def paper_method(
    shot: Shot,
    *,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    held: Mapping[str, float] | None = None,
    numerics: Numerics | None = None,
    refined_mesh: tuple[int, int] = (64, 86),
    ledger: Path | None = None,
    progress: Progress | None = None,
) -> PaperAnswer:
    """Identify the stiffness factor by the method of Mates et al. (2012), and confirm it on a refined mesh.

    Parameters
    ----------
    shot
        A loaded shot.
    bounds
        Bounds of the design for "stiffness_factor" and for "friction". `BOUNDS` gives missing ones.
    held
        Other parameters held at values that differ from the shot's. A held friction is not varied.
    numerics
        The coarse mesh and the arithmetic.
    refined_mesh
        Elements across the radius and along the length.
    ledger
        File that stores the runs of the designs. No run is repeated.
    progress
        Called with stage, runs done, runs in the stage.

    Raises
    ------
    ValueError
        If a parameter or a bound is not allowed, if too few runs complete, or if a run at the optimum does
        not.
    """
    numerics, held = numerics or Numerics(), dict(held or {})
    given = {**BOUNDS, **(bounds or {})}
    if set(given) != set(BOUNDS):
        raise ValueError(f"the paper's method varies {' and '.join(BOUNDS)}, got {', '.join(given)}")
    if FRICTION in held:
        del given[FRICTION]
    search = _Search(shot, held, ledger, progress or (lambda stage, done, total: None))
    whole = design_box(given)
    surface = search.factorial(whole, LEVELS if whole.dimension > 1 else LEVELS_ALONE, numerics, "design")
    surfaces, told = [surface], FRICTION in whole.names
    if FRICTION in whole.names:
        delta = delta_of(search.run(surface.fit.box, surface.optimum, numerics)[1])  # Eq. (M.8)
        told = friction_constrained(surface.fit, delta)
        if not told:
            if contact_law(shot.interface.faces).needs_friction:
                search.held[FRICTION] = whole.upper[whole.names.index(FRICTION)]
            whole = design_box({MOVED: given[MOVED]})
            surface = search.factorial(whole, LEVELS_ALONE, numerics, "design")
            surfaces.append(surface)
    fine = numerics.with_mesh(refined_mesh)
    refined, checks, (parameters, terms), predicted, moved = search.refine(whole, surface, fine)
    factor = float(parameters[MOVED])
    coarse = whole.as_dict(surface.optimum)
    interval = cost_interval(*profile(surface.fit), delta_of(terms))
    return PaperAnswer(
        shot=shot.name, factor=factor, interval=interval.moved(factor - coarse[MOVED]),
        friction=parameters.get(FRICTION), friction_told=told, coarse=coarse, terms=terms,
        predicted=predicted, confirmed=moved <= CONFIRMED and not at_bound(factor, given[MOVED]),
        error=surface.fit.loo_rms, design=given[MOVED], meshes=(numerics.mesh, refined_mesh),
        surfaces=(*surfaces, refined), checks=checks,
    )  # fmt: skip


def at_bound(value: float, bounds: tuple[float, float]) -> bool:
    """True if a value lies within `CONFIRMED` of a bound of its design."""
    return value - bounds[0] <= CONFIRMED or bounds[1] - value <= CONFIRMED


class _Search:
    """Designs, surfaces and runs of one shot."""

    def __init__(self, shot: Shot, held: dict[str, float], ledger: Path | None, progress: Progress) -> None:
        self.shot, self.held, self.ledger, self.progress = shot, held, ledger, progress

    def factorial(self, box: Box, levels: int | list[int], numerics: Numerics, stage: str) -> Surface:
        """Run a full factorial and find the minimum of the surface through its costs."""
        design = full_factorial(box, levels)
        self.progress(stage, 0, len(design))
        runs = sweeping.sweep(
            self.shot,
            design,
            held=self.held,
            numerics=numerics,
            ledger=self.ledger,
            progress=lambda pace: self.progress(stage, pace.finished, pace.total),
        )
        return surface_of(runs)

    def run(self, box: Box, point: FloatArray, numerics: Numerics) -> tuple[dict[str, float], Terms]:
        """Parameters and misfits of a run at one point; it must complete."""
        values = {**self.held, **box.as_dict(point)}
        made = single.simulate(self.shot, values, numerics=numerics)
        if made.terms is None:
            raise ValueError(f"the run at the optimum ended {made.response.describe(0)}")
        return made.parameters, made.terms

    def refine(
        self, whole: Box, coarse: Surface, fine: Numerics
    ) -> tuple[
        Surface, tuple[tuple[dict[str, float], float], ...], tuple[dict[str, float], Terms], float, float
    ]:
        """Surface, runs at its optimum, the last of them, its predicted cost, and its shift of m."""
        shares = dict(zip(BOUNDS, REFINED_SHARE, strict=True))
        levels = [REFINED_LEVELS[list(BOUNDS).index(name)] for name in whole.names]
        own, x = whole.names.index(MOVED), coarse.optimum
        for _ in range(MOST_BOXES):
            box = box_around(whole, x, [shares[name] for name in whole.names])
            surface = self.factorial(box, levels, fine, "refinement")
            x = surface.optimum
            inner = at_bound(x[own], (box.lower[own], box.upper[own]))
            if not inner or at_bound(x[own], (whole.lower[own], whole.upper[own])):
                break
        fit, checks = surface.fit, []
        costs = sweeping.costs(surface.runs.table)
        costs = costs[np.isfinite(costs)]
        for number in range(MOST_CHECKS):
            self.progress("check", number, MOST_CHECKS)
            predicted = fit.cost(x)
            last = self.run(box, x, fine)
            checks.append((box.as_dict(x), cost_of(last[1])))
            if np.abs(box.unit(fit.points) - box.unit(x)).max(axis=1).min() > SAME:
                costs = np.append(costs, checks[-1][1])
                fit = CostSurrogate.fit(box, np.vstack([fit.points, x]), costs)
            best = nelder_mead(fit.cost, box, start=fit.points[np.argmin(costs)]).x
            moved = float(abs(best[own] - x[own]))
            if moved <= CONFIRMED:
                break
            x = best
        return surface, tuple(checks), last, predicted, moved


STEM = "paper_method"
"""Name of JSON file and ledger, without their endings."""


def rows(answer: PaperAnswer) -> dict[str, str]:
    """Names and values for a table, for comparison with the answer of `identify`."""
    span, (coarse, refined) = answer.interval, answer.meshes
    range_ = f"{span.low:.4g} to {span.high:.4g}"
    ends_open = [side for side, open_ in (("below", span.open_low), ("above", span.open_high)) if open_]
    if ends_open:
        range_ += f", open {' and '.join(ends_open)}: the design ends there"
    confirmed = "confirmed" if answer.confirmed else "NOT CONFIRMED"
    friction = "no slip" if answer.friction is None else f"{answer.friction:.3g}"
    if FRICTION in answer.surfaces[0].fit.box.names and not answer.friction_told:
        friction += ", as the data do not constrain it"
    force_alone = "" if answer.terms.has_shape else ", of the force alone"
    return {
        "m, paper's method": f"{answer.factor:.4g}, {confirmed} on {refined[0]}x{refined[1]}",
        "m, paper's, interval (M.6-M.8)": range_,
        "m, paper's, before refinement": f"{answer.coarse[MOVED]:.4g} on {coarse[0]}x{coarse[1]}",
        "f, paper's": friction,
        "Phi, paper's": f"{answer.cost:.4g} +- {answer.delta:.2g}{force_alone}",
    }


def paper_warnings(answer: PaperAnswer) -> list[str]:
    """Warnings on the paper's answer."""
    said = []
    low, high = answer.design
    if at_bound(answer.factor, answer.design):
        said.append(
            f"the paper's method ends at a bound of its design, m = {answer.factor:.4g} in {low:g} to "
            f"{high:g}: give another range with --free {MOVED}=LOW:HIGH"
        )
    elif not answer.confirmed:
        said.append(
            f"the paper's method is not confirmed: the last of {len(answer.checks)} runs on the refined mesh "
            f"still moves m = {answer.factor:.4g} by more than {CONFIRMED:g}"
        )
    if answer.error > answer.delta:
        said.append(
            f"the surface through Phi of the paper's method is wrong by {answer.error:.2g} between its runs "
            f"(leave-one-out), more than the uncertainty of Phi, {answer.delta:.2g}: the valley of Phi is "
            "narrower than the distance of the runs"
        )
    return said


def to_json(answer: PaperAnswer) -> dict[str, Any]:
    """The answer as one JSON object, SI. Numbers that are not finite become null."""
    said = {
        "shot": answer.shot,
        "stiffness_factor": answer.factor,
        "interval": [answer.interval.low, answer.interval.high],
        "interval_open": [answer.interval.open_low, answer.interval.open_high],
        "confirmed": answer.confirmed,
        "friction": answer.friction,
        "friction_told": answer.friction_told,
        "before_refinement": answer.coarse,
        "phi": answer.cost,
        "sigma_phi": answer.delta,
        "phi_predicted": answer.predicted,
        "terms": vars(answer.terms),
        "surface_error": answer.error,
        "mesh": list(answer.meshes[0]),
        "refined_mesh": list(answer.meshes[1]),
        "checks": [{**at, "phi": cost} for at, cost in answer.checks],
        "warnings": paper_warnings(answer),
    }
    return dict(jsonable(said, STEM))
