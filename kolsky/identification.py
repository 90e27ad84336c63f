"""The story of `identify`, top to bottom.

1. What is free: `kolsky.inverse.problem`.
2. Runs on coarse meshes give a first optimum: a design and a surrogate of the *response* (force bins and
   outline points) of one parameter (`kolsky.inverse.coarse_search`), a scan of the valleys and least squares
   for several (`kolsky.inverse.surrogate_mesh_search`).
3. The optimum is moved to the refined mesh and confirmed by a run there: by Gauss-Newton steps
   (`kolsky.inverse.gauss_newton`), or by a quadratic through a design of runs on the refined mesh (a surface
   that slides or lets go, `kolsky.inverse.refined_search`). `kolsky.inverse.search` chooses.
4. Its uncertainty: the residuals' covariance (`kolsky.inverse.objective`), the inputs' noise
   (`kolsky.uncertainty.budgets`), the numerics (`kolsky.uncertainty.mesh_error`), what is declared
   uncertain, profile likelihoods and other choices (`kolsky.uncertainty.analyse`), likely causes of a misfit.
5. Does the model explain the data, and if not, why? `kolsky.diagnosis`; the last word is
   `kolsky.diagnosis.judgement`: verdicts, and all warnings.
"""

from dataclasses import replace
from pathlib import Path

from kolsky.base.process import one_blas_thread
from kolsky.diagnosis.cause_inputs import corrected
from kolsky.diagnosis.causes import OtherStart, find_causes
from kolsky.diagnosis.clocks import Reruns, clock_lags
from kolsky.diagnosis.fit_quality import explains, fit_quality, near_right, residual_sources
from kolsky.diagnosis.judgement import judged
from kolsky.inverse.estimates import with_own_method
from kolsky.inverse.problem import InverseProblem
from kolsky.inverse.result import Identification
from kolsky.inverse.search import search_shot
from kolsky.inverse.settings import Settings
from kolsky.inverse.work import Progress, Work
from kolsky.shot.load import load_shot
from kolsky.shot.records import Shot
from kolsky.uncertainty.analyse import analyse
from kolsky.uncertainty.answer import budgeted_answer, error_sources
from kolsky.uncertainty.profiles import LinearisedOptimum


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
        What is free, what is held, numerical choices.
    progress : callable, optional
        Called as ``progress(stage, runs done, runs in the stage)``.

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
    InputError
        If the folder holds no shot, or a wrong one.
    """
    loaded = load_shot(shot) if isinstance(shot, str | Path) else shot
    search = search_shot(InverseProblem.of(loaded, settings or Settings()), Work(progress))
    runner, optimum = search.runner, search.fine
    objective, slopes, response = optimum.objective, optimum.jacobian, optimum.check.response

    analysis = analyse(runner, LinearisedOptimum.of(optimum), optimum.check.prediction)
    sources = error_sources(search, analysis.directions)
    changes, vector = residual_sources(sources), objective.vectors(optimum.check.prediction)[0]
    fit = fit_quality(objective, vector, slopes, names=runner.problem.box.names, changes=changes)

    extra = None if explains(fit) else search.held_run()
    second = None if extra is None else OtherStart(*extra)
    causes = find_causes(runner, optimum.x, response.select([0]), other=second, explained=near_right(fit))
    reruns = Reruns.of(runner, optimum.x)
    clocks = clock_lags(runner.problem.shot, response, objective, slopes, changes, again=reruns)

    answer = replace(budgeted_answer(search, sources), fit=fit, clocks=clocks, causes=causes.findings)
    return judged(with_own_method(analysis.added_to(answer)), search, analysis, sources, causes)


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
