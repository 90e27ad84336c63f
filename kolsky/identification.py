"""The story of `identify`, top to bottom.

1. What is free: `kolsky.inverse.problem`.
2. Runs on coarse meshes give a first optimum: a design and a surrogate of the *response* (force bins and
   outline points) of one parameter (`kolsky.inverse.coarse_search`), a scan of the valleys and least squares
   for several (`kolsky.inverse.surrogate_mesh_search`).
3. The optimum is moved to the refined mesh and confirmed by a run there: by Gauss-Newton steps
   (`kolsky.inverse.gauss_newton`), by single runs that correct the surrogate (one parameter where a surface
   lets go, `kolsky.inverse.refined_search`), or by a quadratic through a design of runs on the refined mesh
   (a sliding surface, `kolsky.inverse.refined_search`). `kolsky.inverse.search` chooses.
4. Its uncertainty: the residuals' covariance (`kolsky.inverse.objective`), the inputs' noise
   (`kolsky.uncertainty.budgets`), the numerics (`kolsky.uncertainty.mesh_error`), what is declared
   uncertain, profile likelihoods and other choices (`kolsky.uncertainty.analyse`), likely causes of a misfit.
5. The result, what other methods find, and the warnings it deserves.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

from kolsky.base.arrays import FloatArray
from kolsky.base.process import one_blas_thread
from kolsky.base.records import FlyerMotion
from kolsky.diagnosis.cause_inputs import corrected
from kolsky.diagnosis.causes import OtherStart, cause_warnings, find_causes
from kolsky.diagnosis.clocks import Reruns, clock_lags, first_lags
from kolsky.diagnosis.fit_quality import (
    explained,
    explains,
    fit_quality,
    fit_warnings,
    near_right,
    residual_sources,
    with_verdicts,
)
from kolsky.diagnosis.relaxation import branch_figures, branch_fit, rate_advice, shot_branch_test
from kolsky.inverse.estimates import (
    add_method_comparison,
    comparison,
    curves,
    estimates,
    held_values,
    search_routes,
    surrogate_quality,
)
from kolsky.inverse.parameters import MOVED, any_slides
from kolsky.inverse.problem import Settings, prepare_shot, provenance
from kolsky.inverse.result import CheckRun, FitQuality, Identification
from kolsky.inverse.run_table import terms
from kolsky.inverse.search import held_answer, search_shot
from kolsky.inverse.staged_runs import Progress
from kolsky.inverse.work import in_thread, leaves_a_core
from kolsky.shot.curve import with_pull
from kolsky.shot.records import Shot
from kolsky.uncertainty.analyse import analyse
from kolsky.uncertainty.budgets import Sources, budgeted, input_changes, noise_parts, route_difference
from kolsky.uncertainty.input_changes import declared_changes
from kolsky.uncertainty.mesh_error import mesh_change_beside, numerical_parts
from kolsky.uncertainty.profiles import LinearisedOptimum
from kolsky.uncertainty.warnings import collect_warnings


@one_blas_thread()
def identify(
    shot: Shot,
    settings: Settings | None = None,
    *,
    progress: Progress | None = None,
    meanwhile: Sequence[Callable[[], object]] = (),
    checked: Callable[[CheckRun], object] | None = None,
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
    meanwhile
        What to load in a thread while a lone run leaves a core idle, e.g.
        `kolsky.report.page_process.load_identify_page`; not called where no run is alone. An error of it
        ends the identification.
    checked : callable, optional
        Told of the check run at the answer as soon as it is known, e.g. to draw it meanwhile.

    Notes
    -----
    BLAS works on one thread meanwhile, see `kolsky.base.process.set_blas_threads`.

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
    prepared = prepare_shot(shot)
    told = progress or (lambda stage, done, total: None)
    found = search_shot(prepared, settings, told, meanwhile=meanwhile)
    settings, stages, coarse, fine = found.freed.settings, found.stages, found.coarse, found.fine
    box, observations, prediction = stages.box, stages.observations, fine.check.prediction
    fixed, sliding = held_values(shot, box, settings.held), any_slides([*box.names, *settings.held])
    paper_route = [found.paper_route()] if observations.has_shape else []
    origin = provenance(shot, settings, prepared, sliding=sliding)
    beside_data = comparison(prediction, observations)
    if checked is not None:
        checked(CheckRun(beside_data, fine.check.response, settings.refined_mesh, origin))

    optimum = LinearisedOptimum.of(
        fine.x, fine.box, fine.objective, fine.model, fine.surrogate, smooth=fine.roughness is None
    )
    vector = fine.objective.vectors(prediction)[0]
    with mesh_change_beside(stages, fine) as mesh:
        optima = search_routes(fine.box, fine.objective, fine.model)
        known = analyse(stages, optimum, prediction, bayes=settings.bayes)
        inputs = input_changes(fine.objective, stages.replicates)
        declared = None
        if known.directions is not None:
            declared = declared_changes(known.directions, shot.uncertainty)

        @cache
        def judged_fit() -> tuple[Sources, dict[str, FloatArray], tuple[FitQuality, ...]]:
            sources = Sources(inputs=inputs, mesh=mesh(), deviations=fine.deviations, declared=declared)
            changes = residual_sources(sources)
            fit = fit_quality(fine.objective, vector, fine.jacobian, names=box.names, changes=changes)
            return sources, changes, fit

        def elsewhere() -> OtherStart | None:
            held = None if found.held is None else found.held.refined
            return None if held is None or explains(judged_fit()[2]) else OtherStart(held.x, held.response)

        stages.progress("causes", 0, 1)
        seen, idle = fine.check.response, leaves_a_core(settings.numerics.device, settings.numerics.threads)
        with in_thread(lambda: first_lags(seen, fine.objective, fine.jacobian), idle=idle) as first:
            causes = find_causes(
                stages,
                fine.x,
                seen.select([0]),
                other=elsewhere,
                explained=lambda: near_right(judged_fit()[2]),
            )
        sources, changes, fit = judged_fit()

    gain = fine.objective.gain(fine.jacobian)
    by_route = [budgeted(box.names, one, sources) for one in optima]
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
    held = None if found.held is None else held_answer(found, answers[MOVED])

    again = Reruns.of(stages, fine.x)
    clocks = clock_lags(shot, seen, fine.objective, fine.jacobian, changes, first=first(), again=again)

    result = Identification(
        shot=shot.name,
        estimates=answers,
        fixed=fixed,
        routes=(*by_route, *paper_route),
        route_difference=route_difference(box.names, optima, sources),
        terms=terms(prediction, observations, 0),
        comparison=beside_data,
        response=fine.check.response,
        mesh=settings.numerics.mesh,
        refined_mesh=settings.refined_mesh,
        design=stages.table.build(box),
        curves=curves(fine.box, fine.objective, fine.model, fine.x),
        surrogate=surrogate_quality(stages, coarse, fine, lost=len(sources.mesh.lost)),
        seconds=stages.seconds,
        fit=fit,
        clocks=clocks,
        causes=causes.findings,
        held_answer=held,
        provenance=origin,
    )
    result = with_verdicts(add_method_comparison(known.added_to(result), stages, fine.objective))
    of_fit = (*fit_warnings(result), *cause_warnings(causes, explained=explained(result)))
    if not explained(result):
        asked = shot_branch_test(stages, fine.x, fine.objective, fine.jacobian, vector)
        # A strong branch is out of reach of the linear test: it is searched for.
        strong = None if rate_advice(asked) else branch_fit(stages, fine.x, fine.objective)
        of_fit = (*of_fit, *rate_advice(asked, strong))
        result = replace(result, surrogate={**result.surrogate, **branch_figures(asked, strong)})
    replicates = stages.replicates
    warnings = collect_warnings(
        result,
        checks=prepared.checks,
        interface=shot.interface,
        lost_replicates=0 if replicates is None else replicates.lost,
        mesh=prepared.forward.mesh(settings.numerics.with_mesh(settings.refined_mesh)),
        lost_meshes=sources.mesh.lost,
    )
    noted = (*(shot.flyer.notes if isinstance(shot.flyer, FlyerMotion) else ()), *shot.notes)
    return replace(result, warnings=(*of_fit, *noted, *warnings, *known.warnings, *found.freed.said(shot)))


LEADING = 2
"""Likely causes with which `diagnose` identifies anew."""


def diagnose(
    found: Identification, shot: Shot, settings: Settings | None = None, *, progress: Progress | None = None
) -> Identification:
    """Identify anew with each of the leading likely causes put right.

    Parameters
    ----------
    found
        The identification of the shot as it is declared.
    shot, settings, progress
        As of `identify`.

    Returns
    -------
    Identification
        The same, its leading causes with the free parameters that a whole identification gives, a cause found
        beside another with both put right. One that no number puts right has none.

    Raises
    ------
    ValueError
        As `identify`.
    """
    settings = settings or Settings()
    likely = {cause.key: cause for cause in found.causes if cause.named}
    solved = {}
    for cause in list(likely.values())[:LEADING]:
        right: tuple[Shot, Settings] | None = (shot, settings)
        for one in (likely.get(cause.beside), cause):
            if one is not None and right is not None:
                right = corrected(*right, one)
        if right is not None:
            again = identify(*right, progress=progress)
            solved[cause.key] = replace(
                cause,
                solved={name: e.value for name, e in again.estimates.items()},
                solved_sigmas={name: e.sigma for name, e in again.estimates.items()},
            )
    return replace(found, causes=tuple(solved.get(cause.key, cause) for cause in found.causes))
