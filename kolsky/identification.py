"""The steps of `identify`, in order.

1. The free parameters are chosen: `kolsky.inverse.problem`.
2. Runs on coarse meshes give a first optimum. One parameter: a design of runs and a surrogate of the
   *response*, which is force bins and outline points (`kolsky.inverse.coarse_search`). Several parameters: a
   scan of the valleys of the misfit, then least squares (`kolsky.inverse.surrogate_mesh_search`).
3. The optimum is moved to the refined mesh and confirmed by a run there. Gauss-Newton steps do this
   (`kolsky.inverse.gauss_newton`). If a surface slides or lets go, a quadratic through a design of runs on
   the refined mesh does it (`kolsky.inverse.refined_search`). `kolsky.inverse.search` chooses.
4. The uncertainty is estimated from the residuals' covariance (`kolsky.inverse.objective`), the noise of the
   inputs (`kolsky.uncertainty.budgets`) and the numerics (`kolsky.uncertainty.mesh_error`). Declared
   uncertainties, profile likelihoods and other choices of the analyst are in `kolsky.uncertainty.analyse`.
5. The fit is checked, and likely causes of a misfit are searched: `kolsky.diagnosis`. The verdicts and all
   warnings are made in `kolsky.diagnosis.judgement`.
"""

from dataclasses import replace
from pathlib import Path

from kolsky.base.process import one_blas_thread
from kolsky.diagnosis.cause_inputs import corrected
from kolsky.diagnosis.causes import find_causes
from kolsky.diagnosis.clocks import Reruns, clock_lags
from kolsky.diagnosis.fit_quality import explains, fit_quality, near_right, residual_sources
from kolsky.diagnosis.judgement import judged
from kolsky.inverse.problem import InverseProblem
from kolsky.inverse.result import Identification
from kolsky.inverse.search import search_shot
from kolsky.inverse.settings import Settings
from kolsky.inverse.work import Progress, Work
from kolsky.shot.load import load_shot
from kolsky.shot.records import Shot
from kolsky.uncertainty.analyse import analyse
from kolsky.uncertainty.answer import budgeted_answer, error_sources


@one_blas_thread()
def identify(
    shot: Shot | str | Path, settings: Settings | None = None, *, progress: Progress | None = None
) -> Identification:
    """Identify the free parameters of a shot.

    Parameters
    ----------
    shot
        A loaded shot, or its folder.
    settings
        Free parameters, held parameters, numerical choices.
    progress : callable, optional
        Called as ``progress(stage, runs done, runs in the stage)``.

    Notes
    -----
    BLAS uses one thread during the call: `kolsky.base.process.set_blas_threads`.

    Returns
    -------
    Identification
        Estimates with intervals and verdicts, the check run with the data, every run of the design.

    Raises
    ------
    ValueError
        If a parameter is unknown, if a bound or value is outside its range, or if too few runs completed. The
        message gives outcome, time and place of the first failure.
    InputError
        If the folder contains no shot, or an invalid one.
    """
    loaded = load_shot(shot) if isinstance(shot, str | Path) else shot
    search = search_shot(InverseProblem.of(loaded, settings or Settings()), Work(progress))
    runner, optimum = search.runner, search.fine
    objective, slopes, response = optimum.objective, optimum.jacobian, optimum.check.response

    analysis = analyse(runner, optimum)
    sources = error_sources(search, analysis.directions)
    changes, vector = residual_sources(sources), objective.vectors(optimum.check.prediction)[0]
    fit = fit_quality(objective, vector, slopes, names=runner.problem.box.names, changes=changes)

    second = None if explains(fit) else search.held_run()
    causes = find_causes(runner, optimum.x, response.select([0]), other=second, explained=near_right(fit))
    reruns = Reruns.of(runner, optimum.x)
    clocks = clock_lags(runner.problem.shot, response, objective, slopes, changes, again=reruns)

    answer = replace(budgeted_answer(search, sources), fit=fit, clocks=clocks, causes=causes.findings)
    return judged(analysis.added_to(answer), search, analysis, sources, causes)


LEADING = 2
"""Number of likely causes for which `diagnose` repeats the identification."""


def diagnose(
    found: Identification, shot: Shot, settings: Settings | None = None, *, progress: Progress | None = None
) -> Identification:
    """Repeat the identification with each of the leading likely causes corrected.

    Parameters
    ----------
    found
        The identification of the shot as declared.
    shot, settings, progress
        As for `identify`.

    Returns
    -------
    Identification
        The identification `found`. Each leading cause also holds the free parameters of a complete
        identification with this cause corrected. If a cause was found together with another one, both are
        corrected. Some causes cannot be corrected by a number; they have no such values.

    Raises
    ------
    ValueError
        For the reasons of `identify`.
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
