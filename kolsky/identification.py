"""The story of `identify`, top to bottom.

1. A design over the free parameters is run on the surrogate's mesh; a surrogate of the *response* (force bins
   and outline points) gives a first optimum.
2. More runs around it make the surrogate exact where it matters: `kolsky.inverse.coarse_search`.
3. The optimum is moved to the refined mesh and confirmed by a run there: by single runs that correct the
   surrogate (one parameter, `kolsky.inverse.refined_search`), or by a quadratic through a design of runs on
   the refined mesh (several, or a sliding surface, `kolsky.inverse.quadratic_fit`).
4. Its uncertainty: the residuals' covariance (`kolsky.inverse.objective`), the inputs' noise
   (`kolsky.uncertainty.input_noise`), the numerics (`kolsky.uncertainty.numerical`), then what is declared
   uncertain, profile likelihoods and other choices (`kolsky.uncertainty.analyse`).
5. The result, what other methods find, and the warnings it deserves.
"""

from dataclasses import replace

from kolsky.diagnosis.causes import cause_warnings, find_causes
from kolsky.diagnosis.clocks import clock_lags
from kolsky.diagnosis.fit_quality import fit_quality
from kolsky.diagnosis.sources import residual_sources
from kolsky.diagnosis.verdicts import fit_warnings, judged
from kolsky.inverse.coarse_search import search_coarse
from kolsky.inverse.estimates import (
    comparison,
    curves,
    estimates,
    held_values,
    paper_route,
    search_routes,
    surrogate_quality,
)
from kolsky.inverse.front_noise import weigh_front_noise
from kolsky.inverse.misfit import terms
from kolsky.inverse.parameters import any_slides, design_box
from kolsky.inverse.prepared_shot import prepare_shot
from kolsky.inverse.provenance import provenance
from kolsky.inverse.quadratic_fit import search_by_quadratic
from kolsky.inverse.refined_search import search_by_single_runs, slides
from kolsky.inverse.result import Identification
from kolsky.inverse.settings import Settings
from kolsky.inverse.solver_search import add_method_comparison
from kolsky.inverse.staged_runs import Progress, StagedRuns
from kolsky.shot.curve import with_pull
from kolsky.shot.records import Shot
from kolsky.uncertainty.analyse import analyse
from kolsky.uncertainty.input_noise import input_changes
from kolsky.uncertainty.numerical import mesh_change, numerical_parts
from kolsky.uncertainty.profile_likelihood import LinearisedOptimum
from kolsky.uncertainty.route_budgets import Sources, budgeted, noise_parts, route_difference
from kolsky.uncertainty.warnings.collect import collect_warnings


def identify(
    shot: Shot, settings: Settings | None = None, *, progress: Progress | None = None
) -> Identification:
    """Identify the free parameters of a shot.

    Parameters
    ----------
    shot
        A loaded shot.
    settings
        What is free, what is held, numerical choices.
    progress : callable, optional
        Called as ``progress(stage, runs done, runs in the stage)``.

    Returns
    -------
    Identification
        Estimates with intervals and verdicts, the check run beside the data, every run of the design.

    Raises
    ------
    ValueError
        If a parameter is unknown, a bound or value is outside its range, or too few runs completed; the
        message says how, when and where the first one failed.
    """
    settings = settings or Settings()
    shot = with_pull(shot, settings.pull)
    prepared, box = prepare_shot(shot), design_box(settings.free)
    stages = StagedRuns(prepared, settings, box, progress or (lambda stage, done, total: None))

    coarse = search_coarse(stages)
    replicates = stages.replicate(coarse.x) if settings.replicates else None
    coarse = weigh_front_noise(stages, coarse, replicates)
    alone = box.dimension == 1 and not slides(stages)
    fine = search_by_single_runs(stages, coarse) if alone else search_by_quadratic(stages, coarse)

    sources = Sources(
        inputs=input_changes(fine.objective, replicates),
        mesh=mesh_change(stages, fine),
        roughness=fine.roughness,
    )
    gain = fine.objective.gain(fine.jacobian)
    optima = search_routes(fine.box, fine.objective, fine.model)
    by_route = [budgeted(box.names, one, sources) for one in optima]
    optimum = LinearisedOptimum.of(fine.x, fine.box, fine.objective, fine.model, fine.surrogate)
    known = analyse(stages, optimum, fine.check.prediction, bayes=settings.bayes)

    stages.progress("causes", 0, 1)
    causes = find_causes(stages, fine.x, fine.check.response.select([0]))

    observations, prediction = stages.observations, fine.check.prediction
    vector = fine.objective.vectors(prediction)[0]
    changes = residual_sources(sources, known.directions, shot.uncertainty)
    result = Identification(
        shot=shot.name,
        estimates=estimates(
            box,
            fine.x,
            noise=noise_parts(fine, sources),
            numerical=numerical_parts(sources.mesh, gain, roughness=sources.roughness),
            mesh_shift=sources.mesh.shift(gain),
            mesh_correction=sources.mesh.correction(gain),
            confirmed=fine.confirmed,
            outline=observations.has_shape,
        ),
        fixed=held_values(shot, box, settings.held),
        routes=(*by_route, *([paper_route(box, stages.table)] if observations.has_shape else [])),
        route_difference=route_difference(box.names, optima, sources),
        terms=terms(prediction, observations, 0),
        comparison=comparison(prediction, observations),
        response=fine.check.response,
        mesh=settings.numerics.mesh,
        refined_mesh=settings.refined_mesh,
        design=stages.table.build(box),
        curves=curves(fine.box, fine.objective, fine.model, fine.x),
        surrogate=surrogate_quality(stages, coarse, fine),
        seconds=stages.seconds,
        fit=fit_quality(fine.objective, vector, fine.jacobian, names=box.names, changes=changes),
        clocks=clock_lags(shot, fine.check.response, fine.objective, fine.jacobian, changes),
        causes=causes.findings,
        provenance=provenance(shot, settings, prepared, sliding=any_slides([*settings.free, *settings.held])),
    )
    result = judged(add_method_comparison(known.added_to(result), stages, fine.objective))
    warnings = collect_warnings(
        result,
        checks=prepared.checks,
        interface=shot.interface,
        lost_replicates=0 if replicates is None else replicates.lost,
    )
    return replace(
        result, warnings=(*fit_warnings(result), *cause_warnings(causes), *warnings, *known.warnings)
    )
