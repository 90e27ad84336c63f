"""The answer of a search with its budget: sources of error, estimates, routes, comparison with the data."""

from __future__ import annotations

from kolsky.inverse.estimates import (
    comparison,
    curves,
    estimates,
    held_values,
    search_routes,
    surrogate_quality,
)
from kolsky.inverse.parameters import any_slides
from kolsky.inverse.problem import provenance
from kolsky.inverse.result import Identification
from kolsky.inverse.run_table import terms
from kolsky.inverse.search import Search
from kolsky.uncertainty.budgets import Sources, budgeted, input_changes, noise_parts, route_difference
from kolsky.uncertainty.input_changes import InputDirections, declared_changes
from kolsky.uncertainty.mesh_error import mesh_change, numerical_parts


def error_sources(found: Search, directions: InputDirections | None) -> Sources:
    """All sources of error of the optimum, as changes of the data vector, with runs for the mesh error.

    ``directions``: effect of each input on the data vector; None omits the declared uncertainties. Raises
    ValueError for the reasons of `kolsky.uncertainty.mesh_error.mesh_change`.
    """
    runner, fine = found.runner, found.fine
    declared = runner.problem.shot.uncertainty
    return Sources(
        inputs=input_changes(fine.objective, found.replicates),
        mesh=mesh_change(runner, fine),
        deviations=fine.deviations,
        declared=None if directions is None else declared_changes(directions, declared),
    )


def budgeted_answer(found: Search, sources: Sources) -> Identification:
    """The identification from the search and its budget, before verdicts and diagnosis."""
    runner, problem, fine = found.runner, found.problem, found.fine
    shot, box, observations, settings = problem.shot, problem.box, problem.observations, problem.settings
    prediction, gain = fine.check.prediction, fine.objective.gain(fine.jacobian)
    optima = search_routes(fine.box, fine.objective, fine.model)
    routes = [budgeted(box.names, one, sources) for one in optima]
    paper = found.paper_route() if observations.has_shape else None
    routes += [] if paper is None else [paper]
    answers = estimates(
        box,
        fine.x,
        noise=noise_parts(fine, sources),
        numerical=numerical_parts(sources.mesh, gain, roughness=fine.roughness),
        mesh_shift=sources.mesh.shift(gain),
        mesh_correction=sources.mesh.correction(gain),
        confirmed=fine.confirmed,
        outline=observations.has_shape,
    )
    return Identification(
        shot=shot.name,
        estimates=answers,
        fixed=held_values(shot, box.names, settings.held),
        routes=tuple(routes),
        route_difference=route_difference(box.names, optima, sources),
        terms=terms(prediction, observations, 0),
        comparison=comparison(prediction, observations),
        response=fine.check.response,
        mesh=settings.numerics.mesh,
        refined_mesh=settings.refined_mesh,
        design=runner.table.build(box),
        curves=curves(fine.box, fine.objective, fine.model, fine.x),
        surrogate=surrogate_quality(
            runner, found.coarse, fine, valley_margin=found.valley_margin, lost=len(sources.mesh.lost)
        ),
        seconds=dict(runner.work.seconds),
        provenance={
            **provenance(shot, settings, problem.prepared, sliding=any_slides([*box.names, *settings.held])),
            "refined_grading": problem.refined.grading,
        },
    )
