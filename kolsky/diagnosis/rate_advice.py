"""Advice to try a material that relaxes, where an elastic one leaves what a branch would explain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.relaxation import Relaxation, prony_names
from kolsky.diagnosis.branch_search import BranchFit
from kolsky.diagnosis.branch_test import BranchTest, branch_test
from kolsky.inverse.block_covariance import BLOCKS
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import predict
from kolsky.inverse.relaxing import same_bulk
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.inverse.valleys import VALLEY

WEAK = 1e-3
"""Strength of the branches whose directions are taken [-]: so small that the ringing stays in step also where
Poisson's ratio is held, and the bulk modulus grows by as much."""
SHORTEST, TIMES = 2e-5, 7
"""Shortest relaxation time that is tried [s], and how many up to the duration of the window."""


def shot_branch_test(
    stages: StagedRuns, x: FloatArray, objective: Objective, slopes: FloatArray, vector: FloatArray
) -> BranchTest | None:
    """Hold what an elastic identification leaves against branches of some relaxation times.

    Parameters
    ----------
    stages
        The identification's simulations; a run a time is added on the surrogate's mesh.
    x
        The optimum, shape [d].
    objective
        With the discrepancies of the optimum.
    slopes
        Jacobian there, shape [k, d].
    vector
        Data as the refined mesh predicts them there, shape [k].

    Returns
    -------
    BranchTest or None
        None if the shot declares what relaxes, or a run does not complete.
    """
    forward, numerics = stages.prepared.forward, stages.settings.numerics
    if forward.shot.relaxation is not None or numerics.compressible is not None:
        return None
    first, last = forward.shot.window
    times = np.geomspace(SHORTEST, last - first, TIMES)
    series = Relaxation("prony", dict(zip(prony_names(1), (WEAK, float(times[0])), strict=True)))
    relaxing = replace(forward, shot=replace(forward.shot, relaxation=series))
    at = stages.solver_values(x[None], numerics.mesh)[0]
    point = {**stages.settings.held, **dict(zip(stages.box.names, at.tolist(), strict=True))}
    columns = {name: np.full(TIMES + 1, value) for name, value in point.items()}
    # The first run has no branch: the same kernel, so that nothing but the branch differs.
    columns["prony_strength_1"] = np.append(0.0, np.full(TIMES, WEAK))
    columns["prony_time_1"] = np.append(times[0], times)
    if VALLEY in stages.box.names:
        columns[VALLEY] = same_bulk(columns[VALLEY], 1.0 + columns["prony_strength_1"])
    stages.progress("what relaxes", 0, TIMES + 1)
    response = relaxing.run(columns, numerics)
    stages.progress("what relaxes", TIMES + 1, TIMES + 1)
    if not response.completed.all():
        return None
    vectors = objective.vectors(predict(response, objective.observations))
    directions = np.nan_to_num(vectors[1:] - vectors[0]) / WEAK
    residual = np.nan_to_num(objective.data - vector)
    times_of, width = objective.times, float(np.diff(objective.observations.bins.edges).mean())
    block = ((times_of - times_of.min()) / width).astype(int)
    whitened = objective.whitened
    try:
        return branch_test(
            whitened(residual),
            whitened(slopes.T).T,
            whitened(directions),
            times,
            blocks=[block // length for length in BLOCKS],
            seed=stages.settings.seed,
        )
    except ValueError:  # no branch has an effect that the free parameters cannot follow
        return None


TRY = (
    "if no input is wrong, identify again with --relaxation prony, best several shots of different speeds "
    "together with slow tests; m is then that of the long-term curve"
)


def rate_advice(test: BranchTest | None, fit: BranchFit | None = None) -> tuple[str, ...]:
    """Say that a branch would explain what an elastic material leaves; nothing where chance does.

    Parameters
    ----------
    test
        Of a weak branch at the elastic optimum.
    fit
        Of a branch of any strength, where that is not significant.
    """
    if test is not None and test.significant:
        chance = f"{100.0 * test.probability:.2g} % of planted elastic data gain as much"
        return (
            f"a branch that relaxes in about {1e6 * test.time:.2g} us would explain part of what this "
            f"elastic material leaves ({chance}): {TRY}",
        )
    if fit is not None and fit.asked_for:
        return (
            f"with a branch of the strength {fit.strength:.2g} that relaxes in about {1e6 * fit.time:.2g} us "
            f"the model explains {100.0 * fit.share:.0f} % of what this elastic material leaves (AIC "
            f"{fit.aic:+.0f}): {TRY}",
        )
    return ()


def branch_figures(test: BranchTest | None, fit: BranchFit | None) -> dict[str, float]:
    """What the advice is given by, as figures of the search.

    Parameters
    ----------
    test, fit
        As of `rate_advice`.
    """
    found = {} if test is None else {"branch_probability": test.probability}
    if fit is not None:
        found |= {
            "branch_strength": fit.strength,
            "branch_time": fit.time,
            "branch_share": fit.share,
            "branch_aic": fit.aic,
        }
    return found
