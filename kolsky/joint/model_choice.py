"""What relaxes, held against the same shots without it: an information criterion and planted elastic data."""

from __future__ import annotations

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.diagnosis.branch_test import branch_test
from kolsky.joint.optimum import Optimum
from kolsky.joint.problem import JointProblem
from kolsky.joint.records import ModelChoice
from kolsky.joint.start import relaxing_points, second_levels

WEAK = 0.05
"""Strength of the branches whose directions are taken [-]: small enough to be linear."""


def weak_branch(problem: JointProblem, elastic: JointProblem, without: Optimum) -> FloatArray:
    """The elastic optimum with a weak branch beside it: where what relaxes is no worse than nothing.

    Parameters
    ----------
    problem
        With what relaxes.
    elastic, without
        The same without, and its optimum.
    """
    names, box = list(problem.unknowns.names), problem.unknowns.box
    x = np.sqrt(np.maximum(np.array(box.lower), 1e-12) * np.array(box.upper))
    for i, name in enumerate(elastic.unknowns.names):
        x[names.index(name)] = without.start[i]
    for i, name in enumerate(names):
        if name.startswith(("prony_strength", "creep_ratio")):
            x[i] = max(box.lower[i], WEAK)
    return np.clip(x, box.lower, box.upper)


UNREACHED = 1.0
"""Rise of -2 ln L above a model that is contained in another from which on the search of the larger one has
not reached its optimum: searches end within a part of a standard uncertainty, where it rises by less."""


def chosen(problem: JointProblem, found: Optimum, elastic: JointProblem, without: Optimum) -> ModelChoice:
    """Hold the optimum with what relaxes against the one without it, both on the refined mesh.

    Parameters
    ----------
    problem, found
        With what relaxes, and its optimum.
    elastic, without
        The same shots, slow tests and free parameters without, and its optimum.

    Raises
    ------
    ValueError
        If no weak branch has an effect of its own.
    """
    stack, x, vector = elastic.stack, without.x, without.vector
    residual = vector - stack.data
    whitening = stack.weighting(residual)
    # The optimum with what relaxes, judged by the same data and the same patterns.
    other = problem.vector_for(stack, found.x, problem.refined)
    more = len(problem.unknowns.names) - len(elastic.unknowns.names)
    lower = judged(elastic, other) - judged(elastic, vector)
    bounds = zip(problem.unknowns.names, problem.unknowns.box.lower, strict=True)
    # Where a strength of nothing is among what relaxes, its optimum explains no less.
    nested = all(low == 0.0 for name, low in bounds if name.startswith(("prony_strength", "creep_ratio")))
    missed = lower if nested and lower > UNREACHED else 0.0
    aic = lower + 2.0 * more
    bic = lower + more * float(np.log(stack.ends[-1] + len(stack.slow)))

    names = list(problem.unknowns.bounds)
    base = found.start.copy()
    for i, name in enumerate(elastic.unknowns.bounds):
        base[names.index(name)] = without.start[i]
    for i, name in enumerate(names):
        if name.startswith(("prony_strength", "creep_ratio")):
            base[i] = problem.unknowns.box.lower[i]
    numerics = problem.mesh
    weak = relaxing_points(problem, base, (WEAK,), follow=False)
    bare = elastic.vector_for(stack, without.start, numerics)
    directions = [(problem.vector_for(stack, p, numerics) - bare) / WEAK for p in weak]
    second = "prony_time_1" if "prony_time_1" in names else "creep_resistance"
    times = second_levels(problem, second) if second in names else np.full(len(weak), np.nan)
    test = branch_test(
        whitening.apply(-residual),
        whitening.apply(without.slopes.T).T,
        whitening.apply(np.nan_to_num(np.array(directions))),
        times,
        blocks=stack.blocks,
        seed=problem.settings.seed,
    )
    asked = aic < 0.0 and test.significant
    return ModelChoice(
        aic=aic,
        bic=bic,
        elastic=dict(zip(elastic.unknowns.names, x.tolist(), strict=True)),
        gain=test.gain,
        time=test.time,
        probability=test.probability,
        asked_for=asked,
        sentence=sentence(aic, test.probability, asked=asked, missed=missed),
    )


def judged(problem: JointProblem, vector: np.ndarray) -> float:
    """-2 ln L of a vector with that problem's data; a point that a run does not reach adds nothing."""
    data = problem.stack.data
    return problem.deviance(np.where(np.isnan(vector), data, vector))


def sentence(aic: float, probability: float, *, asked: bool, missed: float = 0.0) -> str:
    """The choice in words; `missed` is how far the larger search ended above the elastic optimum."""
    chance = f"{100.0 * probability:.2g} % of planted elastic data improve as much by a branch"
    if missed > 0.0:
        return (
            f"not decided whether the data ask for what relaxes: its search ended {missed:.3g} in -2 ln L"
            f" above the optimum without it, which is among its models ({chance}): give bounds with --free"
        )
    if asked:
        return f"the data ask for what relaxes (AIC {aic:+.1f}; {chance})"
    return f"the data do not ask for what relaxes (AIC {aic:+.1f}; {chance}): identify without it"
