"""The assessment of a finished identification: verdicts, test for relaxation, and all warnings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import isfinite

from kolsky.base.records import FlyerMotion
from kolsky.diagnosis.causes import (
    LEAST_SHARE,
    CauseAnalysis,
    cause_warnings,
    stiffness_at_bound,
    with_likely,
)
from kolsky.diagnosis.fit_quality import explains, fit_warnings, with_verdicts
from kolsky.diagnosis.relaxation import (
    BranchFit,
    BranchTest,
    branch_figures,
    branch_fit,
    rate_advice,
    shot_branch_test,
)
from kolsky.inverse.incompressible import limit_warning, poisson_limit
from kolsky.inverse.parameters import MOVED
from kolsky.inverse.result import Identification
from kolsky.inverse.search import Search
from kolsky.uncertainty.analyse import UncertaintyAnalysis
from kolsky.uncertainty.budgets import Sources
from kolsky.uncertainty.warnings import collect_warnings

WHOLE = 0.9
"""If a likely input explains a larger share of the misfit than this, no branch is searched. In seven
synthetic shots with a branch, the branch explained 0.89 to 0.99 (`kolsky.diagnosis.relaxation.HALF`)."""


def judged(
    result: Identification, found: Search, known: UncertaintyAnalysis, sources: Sources, causes: CauseAnalysis
) -> Identification:
    """The result with its verdicts, the test for a relaxing branch, and its warnings."""
    runner, problem, fine = found.runner, found.problem, found.fine
    shot = problem.shot
    result = with_verdicts(result)
    if not causes.named and MOVED in result.estimates:
        at_bound = stiffness_at_bound(problem.box, fine.x)
        listed = with_likely(causes, result.estimates[MOVED], at_bound=at_bound)
        causes = replace(causes, findings=listed)
        result = replace(result, causes=listed)
    explained = explains(result.fit)
    of_fit = [*fit_warnings(result), *cause_warnings(causes, explained=explained)]
    leading = max((cause.explained for cause in causes.named), default=0.0)
    if not explained and leading < WHOLE:
        vector = fine.objective.vectors(fine.check.prediction)[0]
        asked = shot_branch_test(runner, fine.x, fine.objective, fine.jacobian, vector)
        advice, strong = branch_advice(asked, leading, lambda: branch_fit(runner, fine.x, fine.objective))
        of_fit += advice
        result = replace(result, surrogate={**result.surrogate, **branch_figures(asked, strong)})
    replicates = found.replicates
    warnings = collect_warnings(
        result,
        checks=problem.prepared.checks,
        interface=shot.interface,
        lost_replicates=0 if replicates is None else replicates.lost,
        mesh=problem.prepared.forward.mesh(problem.refined),
        lost_meshes=sources.mesh.lost,
    )
    noted = (*(shot.flyer.notes if isinstance(shot.flyer, FlyerMotion) else ()), *shot.notes)
    limit = poisson_limit(runner, fine, found.valley)
    if limit is not None:
        warnings = (*warnings, limit.sentence)
        result = replace(result, surrogate={**result.surrogate, "least_poisson": limit.least})
    elif (undistinguished := limit_warning(found.limit_rise)) is not None:
        warnings = (*warnings, undistinguished)
    if isfinite(found.limit_rise):
        result = replace(result, surrogate={**result.surrogate, "limit_rise": found.limit_rise})
    return replace(result, warnings=(*of_fit, *noted, *warnings, *known.warnings, *problem.freed.said(shot)))


def branch_advice(
    asked: BranchTest | None, leading: float, fit: Callable[[], BranchFit | None]
) -> tuple[tuple[str, ...], BranchFit | None]:
    """The advice to try a branch by the linear test, otherwise by a fit of a strong one, and this fit.

    A strong branch is beyond the linear test and must be searched. It must explain more than a likely input
    does. The test of a weak branch cannot show this, so it counts only if inputs explain little. ``leading``:
    the largest share of the misfit that a likely input explains [-].
    """
    weak = rate_advice(asked) if leading < LEAST_SHARE else ()
    strong = None if weak else fit()
    return weak or rate_advice(None, strong, least=leading), strong
