"""The parts of a result computed at the optimum: estimates, routes, curves, comparison, other methods."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from doe import Box, CostSurrogate
from doe import nelder_mead as minimise
from kolsky.base.arrays import FloatArray
from kolsky.inverse.coarse_search import CoarseOptimum, Model, jacobian, on_edge, search
from kolsky.inverse.objective import Objective, Part
from kolsky.inverse.observations import Observations, Prediction
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.path_noise import rms_amplitude
from kolsky.inverse.refined_search import RefinedOptimum
from kolsky.inverse.result import (
    LEAST_SQUARES,
    Comparison,
    Estimate,
    Identification,
    Method,
    Route,
    SurrogateCurve,
    Verdict,
)
from kolsky.inverse.run_table import RunTable
from kolsky.inverse.runner import Runner
from kolsky.shot.records import Shot

ROUTES: tuple[tuple[str, Part], ...] = (("joint", "joint"), ("force only", "force"), ("shape only", "shape"))
"""The parts of the data that are searched separately, with the name of the route."""


def estimates(
    box: Box,
    optimum: FloatArray,
    *,
    noise: Mapping[str, FloatArray],
    numerical: Mapping[str, FloatArray],
    mesh_shift: FloatArray,
    mesh_correction: FloatArray | None = None,
    confirmed: bool,
    outline: bool = True,
) -> dict[str, Estimate]:
    """Every free parameter with its uncertainties and verdict.

    A value is on a plateau if the roughness of the response shifts it by more than all noise. If a parameter
    lies at a bound, the data prefer a value beyond it, and the other values hold only if the bound is right.
    Such a parameter, and one that the data do not constrain, is not corrected for the mesh.

    ``box``: the whole range of the design. ``optimum``: values on the refined mesh, shape [d]. ``noise``,
    ``numerical``: standard uncertainties by source, shape [d] each; they add in quadrature. ``mesh_shift``:
    shift of the optimum between the meshes, shape [d]. ``mesh_correction``: added to the values, shape [d]:
    optimum on an infinitely fine mesh minus that on the refined one. ``confirmed``: True if the last run on
    the refined mesh confirmed the optimum. ``outline``: False for "identified by the force alone".
    """
    good = Verdict.IDENTIFIED if outline else Verdict.FORCE_ALONE
    found = {}
    totals = np.hypot.reduce([np.zeros(len(optimum)), *noise.values()])
    lower, upper = np.array(box.lower), np.array(box.upper)
    unseen, bounds = 4.0 * totals > upper - lower, on_edge(optimum, box)
    wanted = optimum + (0.0 if mesh_correction is None else mesh_correction)
    value = np.where(unseen | bounds, optimum, np.clip(wanted, lower, upper))
    bounds |= ~unseen & ((wanted < lower) | (wanted > upper))
    for i, name in enumerate(box.names):
        parts = {source: float(sigma[i]) for source, sigma in noise.items()}
        computed = {source: float(sigma[i]) for source, sigma in numerical.items()}
        if bounds[i]:
            verdict = Verdict.AT_BOUND
        elif unseen[i]:
            verdict = Verdict.NOT_SEEN
        elif not confirmed:
            verdict = Verdict.DISAGREEING
        elif computed.get("roughness", 0.0) > totals[i]:
            verdict = Verdict.PLATEAU
        else:
            verdict = Verdict.CONDITIONAL if any(bounds) else good
        found[name] = Estimate(
            name=name,
            unit=PARAMETERS[name].unit,
            value=float(value[i]),
            sigma_noise=float(totals[i]),
            sigma_numerical=float(np.hypot.reduce(list(computed.values()))),
            mesh_shift=float(mesh_shift[i]),
            mesh_correction=float(value[i] - optimum[i]),
            searched=(float(box.lower[i]), float(box.upper[i])),
            noise_parts=parts,
            numerical_parts=computed,
            outcome=verdict,
        )
    return found


@dataclass(frozen=True)
class RouteOptimum:
    """The optimum on the refined mesh by one part of the data."""

    name: str
    part: Part
    x: FloatArray
    """The optimum, shape [d]."""
    cost: float
    """Chi-square at this optimum [-]."""
    gain: FloatArray
    """Map from data minus prediction to the shift of the optimum, shape [d, k]; zero outside the part."""
    residual: FloatArray
    """Covariance of the optimum from the residuals, shape [d, d]."""


def search_routes(local: Box, objective: Objective, model: Model) -> tuple[RouteOptimum, ...]:
    """The optima of the joint data, of the force and of the outline; without an outline that of the force.

    ``local``, ``objective``, ``model``: the last design's box, joint objective and corrected surrogate.
    """
    found = []
    for label, part in ROUTES if objective.observations.has_shape else ROUTES[1:2]:
        best = search(local, objective, model, part)
        vector, slope = model(best.x)[0], jacobian(model, local, best.x)
        found.append(
            RouteOptimum(
                name=label,
                part=part,
                x=best.x,
                cost=float(best.objective.chi2(vector, part)),
                gain=best.objective.gain(slope, part),
                residual=best.objective.residual_covariance(slope, vector, part),
            )
        )
    return tuple(found)


def paper_route(whole: Box, table: RunTable, held: Mapping[str, float] | None = None) -> Route:
    """The optimum of the paper's cost, Eq. (M.5), by a surrogate of that cost over every run.

    ``whole``: the first design's box. ``held``: values of the free parameters that the paper holds.
    """
    points, cost = table.paper_cost()
    paper = CostSurrogate.fit(whole, points, cost)
    least = minimise(paper.cost, whole, start=points[np.argmin(cost)])
    return Route("paper", {**whole.as_dict(least.x), **(held or {})}, least.value, {})


def curves(box: Box, objective: Objective, model: Model, optimum: FloatArray) -> tuple[SurrogateCurve, ...]:
    """The misfits along every parameter through the optimum."""
    found = []
    force, shape = objective.mask("force"), objective.mask("shape")
    samples = len(objective.observations.force.time) / objective.n_force
    for i, name in enumerate(box.names):
        x = np.linspace(box.lower[i], box.upper[i], 121)
        points = np.tile(optimum, (len(x), 1))
        points[:, i] = x
        vectors = model(points)
        residual = np.abs(vectors - objective.data)
        found.append(
            SurrogateCurve(
                parameter=name,
                x=x,
                chi2=objective.chi2(vectors),
                phi_shape=(
                    (residual / objective.data)[:, shape].mean(axis=1)
                    if shape.any()
                    else np.full(len(x), np.nan)
                ),
                phi_force=residual[:, force].sum(axis=1) * samples,
            )
        )
    return tuple(found)


def comparison(prediction: Prediction, observations: Observations) -> Comparison:
    """The first run of a prediction, compared with the measurements."""
    bins = observations.bins
    return Comparison(
        force_time=0.5 * (bins.edges[1:] + bins.edges[:-1]),
        force_measured=bins.mean,
        force_sigma=bins.sigma,
        force_model=prediction.force_bins[0, : len(bins.mean)],
        centre_line=replace(observations.centre_line, modes=None),
        Z_model=prediction.Z[0],
        inside=prediction.inside[0],
        recorded=observations.force,
    )


def held_values(shot: Shot, free: Sequence[str], held: Mapping[str, float]) -> dict[str, float]:
    """The parameters that are not free, in SI: the declared values, or other held values."""
    declared = {n: p.held(shot) for n, p in PARAMETERS.items() if n not in free and p.belongs_to(shot)}
    return {**declared, **held}


def surrogate_quality(
    runner: Runner,
    coarse: CoarseOptimum,
    fine: RefinedOptimum,
    *,
    valley_margin: float = np.inf,
    lost: int = 0,
) -> dict[str, float]:
    """The figures of `Identification.surrogate`; `lost`: number of failed mesh-error runs."""
    o, moved, left_out = fine.objective, fine.front.moved, coarse.surrogate.loo_residuals
    n, outline = o.n_force, runner.problem.observations.has_shape
    found = {
        "loo_force": _rms(left_out[:, :n]),
        "loo_shape": _rms(left_out[:, n:]) if outline else None,
        "front_moved": None if moved is None else rms_amplitude(moved.amplitudes),
        "valley_margin": valley_margin if np.isfinite(valley_margin) else None,
        "check_shift_sigmas": fine.moved,
        "check_force": _rms(fine.missed[:n]),
        "check_shape": _rms(fine.missed[n:]) if outline else None,
        "counted_points": float(o.counted.sum()),
        "force_discrepancy": o.force_discrepancy,
        "shape_discrepancy": o.shape_discrepancy if outline else None,
        "slow_discrepancy": o.slow_discrepancy if outline else None,
        "lost_mesh_runs": float(lost) if lost else None,
    }
    return {key: value for key, value in found.items() if value is not None}


def _rms(x: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.asarray(x) ** 2)))


ANSWER_STAGES = ("design", "refinement", "check")
"""Stages with runs that the answer uses."""


def with_own_method(result: Identification) -> Identification:
    """The result with the method of the search as the first of the compared methods."""
    routes = {route.name: {p: route.on_mesh(p) for p in route.parameters} for route in result.routes}
    own = routes.get("joint", routes.get("force only"))
    if own is None:
        return result
    last = result.surrogate["check_shift_sigmas"]
    method = Method.compared(
        LEAST_SQUARES,
        own,
        answer={p: e.on_mesh for p, e in result.estimates.items()},
        half_width={p: 2.0 * e.sigma for p, e in result.estimates.items()},
        runs=sum(stage in ANSWER_STAGES for stage in result.design.stage),
        converged=all(e.outcome.confirmed for e in result.estimates.values()),
        ended=f"the last run on the refined mesh moved the optimum by {last:.2g} sigma",
    )
    return replace(result, methods=(method, *result.methods))
