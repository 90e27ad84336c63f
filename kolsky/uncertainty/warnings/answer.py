"""Warnings from the answer: unconfirmed, force and outline disagree, interval leaves the design."""

from collections.abc import Iterator
from math import isfinite, sqrt

import numpy as np

from kolsky.inverse.method_comparison import disagreements
from kolsky.inverse.result import Estimate, Identification, Verdict, worst_imbalance
from kolsky.uncertainty.warnings.runs import lost_runs

DISAGREE = 2.5
"""Force and outline disagree beyond so many standard uncertainties of their difference: at two, one right
shot in twenty with one parameter would be called so, and one in seven with three."""
HALF = 0.5
"""A mesh without which the interval would be shorter than this share of it is said."""
IMBALANCE = 0.01
"""Share of the external work that may be unaccounted for before it is said."""


def _unit(e: Estimate) -> str:
    """The unit behind a number; text and files are in SI."""
    return "" if e.unit == "1" else f" {e.unit}"


def disagreement(result: Identification) -> Iterator[str]:
    """Say that the check run does not confirm the surrogate, and how many more runs would."""
    if any(e.outcome is Verdict.DISAGREEING for e in result.estimates.values()):
        shift = result.surrogate.get("check_shift_sigmas")
        by = "" if shift is None else f": the last one still moved the optimum by {shift:.2g} sigma"
        needed, cure = result.surrogate.get("runs_needed"), ""
        if len(result.estimates) > 1:  # no surrogate led there, but steps on the refined mesh
            cure = (
                "; its steps start from the optimum on --mesh: give a finer one, such as 32x43, or hold what "
                "the data hardly tell (--hold)"
            )
        elif needed is not None:
            cure = (
                f"; about {needed:.0f} runs around the optimum would do"
                if isfinite(needed)
                else "; more runs would hardly help, because the response is rough: shrink the bounds"
            )
        yield (
            f"the check run on the refined mesh does not confirm the surrogate{by}; do not use the "
            f"value{cure}"
        )


def force_alone(result: Identification) -> Iterator[str]:
    """Without an outline nothing contradicts a wrong model."""
    if np.isfinite(result.terms.chi2_force) and not result.terms.has_shape:
        yield (
            "no outline was measured: the value rests on the force alone, and nothing shows whether the "
            "specimen deformed as the model says, slid on the platens or was of another length"
        )


def routes(result: Identification) -> Iterator[str]:
    """Force and outline are two measurements of one specimen: their optima must agree.

    Compared is their difference with its own standard uncertainty, see
    `kolsky.uncertainty.route_budgets.route_difference`. Of several parameters each is looked at alone.
    """
    difference, routes = result.route_difference, {route.name: route for route in result.routes}
    if difference is None or not {"force only", "shape only"} <= set(routes):
        return
    force, shape = routes["force only"], routes["shape only"]
    boxes = {curve.parameter: (curve.x[0], curve.x[-1]) for curve in result.curves}
    for name, e in result.estimates.items():
        both = DISAGREE * difference.sigma[name]
        if abs(difference.values[name]) > both:
            low, high = boxes.get(name, (-np.inf, np.inf))
            near = 1e-4 * (high - low) if np.isfinite(high - low) else 0.0
            edge = any(min(x - low, high - x) <= near for x in (force.on_mesh(name), shape.on_mesh(name)))
            yield (
                f"force and outline disagree about {name}: {force.parameters[name]:.5g} by the force alone, "
                f"{shape.parameters[name]:.5g} by the outline alone, further apart than the k = {DISAGREE:g} "
                f"uncertainty of their difference, {both:.2g}"
                f"{_unit(e)}{' (and one of them at the edge of the box that was searched)' if edge else ''}; "
                "the joint value is a compromise between them"
            )


def methods(result: Identification) -> Iterator[str]:
    """Searches of one misfit must end at one point, or it has more than one valley, or is rough."""
    for method, name, distance in disagreements(result.methods):
        if isfinite(distance):
            yield (
                f"methods disagree about {name}: {method.name} ends at {method.values[name]:.5g}"
                f"{_unit(result.estimates[name])}, {abs(distance):.2g} of the k = 2 half width from the "
                f"answer ({method.ended})"
            )
        else:
            yield f"{method.name} has no value of {name} to compare ({method.ended})"


def bounds(result: Identification) -> Iterator[str]:
    """An interval that leaves the design rests on no run there."""
    design = result.design
    for i, name in enumerate(design.names):
        e, low, high = result.estimates[name], design.lower[i], design.upper[i]
        judged = e.outcome.identified or e.outcome is Verdict.BOUND_REACHED
        if judged and not low <= e.value - 2.0 * e.sigma <= e.value + 2.0 * e.sigma <= high:
            yield (
                f"the k = 2 interval of {name} reaches past the bounds of its design ({low:g} to {high:g}); "
                f"widen them with --free {name}=LOW:HIGH, if a value beyond is possible"
            )


def energy(result: Identification) -> Iterator[str]:
    """Say that energy is missing from the simulation's ledger."""
    imbalance = worst_imbalance(result.response)
    if imbalance > IMBALANCE:
        yield f"{100.0 * imbalance:.2g} % of the simulation's external work is not accounted for"


def lost(result: Identification, lost_replicates: int) -> Iterator[str]:
    """Say which runs of the design and how many replicates of the noise did not complete."""
    yield from lost_runs(result.design, "; the surrogate rests on the others")
    if lost_replicates:
        yield (
            f"{lost_replicates} replicates of the input noise did not complete; the interval rests on the "
            "others"
        )


def outside(result: Identification) -> Iterator[str]:
    """Say that outline points were not counted, at the optimum or in the search."""
    t = result.terms
    if t.n_outside:
        yield (
            f"{t.n_outside} of {t.n_outside + t.n_shape} outline points lie outside the simulated outline "
            "at the optimum and are not counted"
        )
    searched = result.surrogate.get("counted_points", float(t.n_shape))
    if searched < t.n_shape:
        yield (
            f"{t.n_shape - searched:.0f} of {t.n_shape} outline points were not counted in the search, "
            "because some run of the design does not reach them"
        )


def numerical(result: Identification) -> Iterator[str]:
    """Say that without the mesh's part the interval would be half as long, or that the misfit is rough."""
    for name, e in result.estimates.items():
        rough = e.numerical_parts.get("roughness", 0.0)
        mesh = e.numerical_parts.get("mesh", e.sigma_numerical)
        without = sqrt(max(e.sigma**2 - mesh**2, 0.0))
        if without < HALF * e.sigma:
            yield (
                f"the mesh makes most of the uncertainty of {name}: U (k = 2) is {2.0 * e.sigma:.2g}"
                f"{_unit(e)} and would be {2.0 * without:.2g}{_unit(e)} without it; where that matters, "
                "refine both meshes (--mesh, --refined-mesh)"
            )
        if rough > e.sigma_noise:
            low, high = e.value - 2.0 * rough, e.value + 2.0 * rough
            yield (
                f"the simulated response is so rough that it contributes more to the uncertainty of {name} "
                f"({rough:.2g}) than the measured noise ({e.sigma_noise:.2g}): between "
                f"{low:.5g} and {high:.5g}{_unit(e)} the misfit is flat to within its jumps; refine both "
                "meshes, or hold another parameter"
            )


def left_out(result: Identification) -> Iterator[str]:
    """Say that the interval leaves out the noise of an input."""
    for source in ("flyer motion", "material curve"):
        if not any(source in e.noise_parts for e in result.estimates.values()) and result.estimates:
            yield f"the interval leaves out the noise of the {source}"
