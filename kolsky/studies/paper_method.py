"""The method of Mates et al. (2012): factorial over friction and stiffness, surface through Phi, simplex.

1. A full factorial over friction and stiffness factor, ten levels each as in the paper's Fig. 9, radial
   basis functions through the cost Phi of Eq. (M.5), downhill simplex on them.
2. Where friction up to the upper bound of the design costs no more than delta Phi, Eq. (M.8), the data do
   not tell it. As in the paper it is then set to the limiting case without slip, and a factorial over the
   stiffness factor alone (sixteen levels, Fig. 10) takes the place of the first.
3. The same on the refined mesh, in a small box around that optimum, which follows the optimum if it leaves
   it; runs at the optimum, each joined to the surface, until one leaves the stiffness factor where it is.
4. The interval has all stiffness factors whose Phi lies within delta Phi of the least, Eqs. (M.6)-(M.8).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from doe import Box, CostSurrogate, full_factorial, nelder_mead
from explicit.contact import contact_law
from kolsky.base.arrays import FloatArray
from kolsky.inverse import simulate as single
from kolsky.inverse.forward import Numerics
from kolsky.inverse.misfit import Terms
from kolsky.inverse.parameters import MOVED, design_box
from kolsky.shot.records import Shot
from kolsky.studies import sweep as sweeping
from kolsky.studies.paper_interval import CostInterval, cost_interval
from kolsky.studies.paper_surface import (
    FRICTION,
    Surface,
    box_around,
    cost_of,
    delta_of,
    friction_told,
    profile,
    surface_of,
)

BOUNDS = {FRICTION: (0.0, 2.0), MOVED: (0.75, 1.5)}
"""The paper's designs: its Fig. 9, and for the stiffness factor the wider range of its Fig. 10."""
LEVELS, LEVELS_ALONE = 10, 16
"""Levels of each of two parameters, and of the stiffness factor alone."""
REFINED_LEVELS = (3, 7)
"""Levels of friction and of the stiffness factor on the refined mesh."""
REFINED_SHARE = (0.25, 0.16)
"""Edges of the box on the refined mesh over those of the design."""
MOST_BOXES, MOST_CHECKS = 3, 6
"""Most boxes on the refined mesh, and most runs at the optimum there."""
CONFIRMED = 0.005
"""A run at the optimum that moves the stiffness factor by no more confirms it: half of the last digit that
the paper gives."""
SAME = 1e-6
"""Points of the unit box closer than this are one run."""

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class PaperAnswer:
    """What the paper's method says of a shot."""

    shot: str
    """Name of the shot."""
    factor: float
    """Stiffness factor m of the last run [-]."""
    interval: CostInterval
    """Of m, by delta Phi [-]."""
    friction: float | None
    """Friction coefficient of the last run [-]; None if nothing slips."""
    friction_told: bool
    """False if the data do not tell the friction."""
    coarse: dict[str, float]
    """Optimum of the surface on the coarse mesh."""
    terms: Terms
    """Misfits of the last run and their uncertainties, Eqs. (M.3)-(M.8)."""
    predicted: float
    """What the surface on the refined mesh had said of the last run's cost before it was made [-]."""
    confirmed: bool
    """Whether that run left m where it is, inside the bounds of the design."""
    error: float
    """Leave-one-out error (rms) of the surface on the coarse mesh [-]."""
    design: tuple[float, float]
    """Bounds of the design of m [-]."""
    meshes: tuple[tuple[int, int], tuple[int, int]]
    """The coarse and the refined mesh."""
    surfaces: tuple[Surface, ...]
    """Every design that was run, in order; the last is the refined mesh's."""
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
    """Identify the stiffness factor as Mates et al. (2012) did, and confirm it on a refined mesh.

    Parameters
    ----------
    shot
        A loaded shot.
    bounds
        Bounds of the design for "stiffness_factor", and for "friction"; `BOUNDS` for what is missing.
    held
        Other parameters held at another value than the shot's; friction held is not varied.
    numerics
        The coarse mesh and the arithmetic.
    refined_mesh
        Elements across the radius and along the length.
    ledger
        File that keeps the runs of the designs, so that none is made twice.
    progress
        Called with stage, runs done, runs in the stage.

    Raises
    ------
    ValueError
        If a parameter or a bound is not allowed, too few runs complete, or a run at the optimum does not.
    """
    numerics, held = numerics or Numerics(), dict(held or {})
    given = {**BOUNDS, **(bounds or {})}
    if set(given) != set(BOUNDS):
        raise ValueError(f"the paper's method varies {' and '.join(BOUNDS)}, got {', '.join(given)}")
    if FRICTION in held:
        del given[FRICTION]
    search = _Search(shot, held, ledger, progress or (lambda stage, done, total: None))
    whole = design_box(given)
    surface = search.factorial(whole, [LEVELS if whole.dimension > 1 else LEVELS_ALONE], numerics, "design")
    surfaces, told = [surface], FRICTION in whole.names
    if FRICTION in whole.names:
        delta = search.delta(surface, numerics)
        told = friction_told(surface.fit, delta)
        if not told:
            if contact_law(shot.interface.faces).needs_friction:
                search.held[FRICTION] = whole.upper[whole.names.index(FRICTION)]
            whole = design_box({MOVED: given[MOVED]})
            surface = search.factorial(whole, [LEVELS_ALONE], numerics, "design")
            surfaces.append(surface)
    fine = numerics.with_mesh(refined_mesh)
    refined, checks, last, predicted, moved = search.refine(whole, surface, fine)
    x = np.array([last.parameters[name] for name in whole.names])
    factor = float(x[whole.names.index(MOVED)])
    assert last.terms is not None  # `refine` refuses a run that did not complete
    coarse = whole.as_dict(surface.optimum)
    interval = cost_interval(*profile(surface.fit), delta_of(last.terms))
    return PaperAnswer(
        shot=shot.name,
        factor=factor,
        interval=interval.moved(factor - coarse[MOVED]),
        friction=last.parameters.get(FRICTION),
        friction_told=told,
        coarse=coarse,
        terms=last.terms,
        predicted=predicted,
        confirmed=moved <= CONFIRMED and not at_bound(factor, given[MOVED]),
        error=surface.fit.loo_rms,
        design=given[MOVED],
        meshes=(numerics.mesh, refined_mesh),
        surfaces=(*surfaces, refined),
        checks=checks,
    )


def at_bound(value: float, bounds: tuple[float, float]) -> bool:
    """True if a value lies at a bound of its design, to `CONFIRMED`."""
    return value - bounds[0] <= CONFIRMED or bounds[1] - value <= CONFIRMED


class _Search:
    """Designs, surfaces and runs of one shot."""

    def __init__(self, shot: Shot, held: dict[str, float], ledger: Path | None, progress: Progress) -> None:
        self.shot, self.held, self.ledger, self.progress = shot, held, ledger, progress

    def factorial(self, box: Box, levels: list[int], numerics: Numerics, stage: str) -> Surface:
        """Run a full factorial and find the least of the surface through its costs."""
        design = full_factorial(box, levels * box.dimension if len(levels) == 1 else levels)
        self.progress(stage, 0, len(design))
        runs = sweeping.sweep(
            self.shot,
            design,
            held=self.held,
            numerics=numerics,
            ledger=self.ledger,
            progress=lambda pace: self.progress(stage, pace.done, pace.total),
        )
        return surface_of(runs)

    def run(self, box: Box, point: FloatArray, numerics: Numerics) -> single.Simulation:
        """Run one point; it must complete."""
        values = {**self.held, **box.as_dict(point)}
        made = single.simulate(self.shot, values, numerics=numerics)
        if made.terms is None:
            raise ValueError(f"the run at the optimum ended {made.response.describe(0)}")
        return made

    def delta(self, surface: Surface, numerics: Numerics) -> float:
        """delta Phi, Eq. (M.8), at the optimum of a surface."""
        found = self.run(surface.fit.box, surface.optimum, numerics).terms
        assert found is not None
        return delta_of(found)

    def refine(
        self, whole: Box, coarse: Surface, fine: Numerics
    ) -> tuple[Surface, tuple[tuple[dict[str, float], float], ...], single.Simulation, float, float]:
        """Surface, runs at its optimum, the last of them, its predicted cost, and by how much it moved m."""
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
            assert last.terms is not None
            checks.append((box.as_dict(x), cost_of(last.terms)))
            if np.abs(box.unit(fit.points) - box.unit(x)).max(axis=1).min() > SAME:
                costs = np.append(costs, checks[-1][1])
                fit = CostSurrogate.fit(box, np.vstack([fit.points, x]), costs)
            best = nelder_mead(fit.cost, box, start=fit.points[np.argmin(costs)]).x
            moved = float(abs(best[own] - x[own]))
            if moved <= CONFIRMED:
                break
            x = best
        return surface, tuple(checks), last, predicted, moved
