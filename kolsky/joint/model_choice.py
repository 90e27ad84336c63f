"""What relaxes, held against the same shots without it: an information criterion and planted elastic data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.diagnosis.branch_test import branch_test
from kolsky.inverse.relaxing import same_bulk
from kolsky.inverse.result import Estimate, Verdict
from kolsky.inverse.valleys import VALLEY
from kolsky.joint.mesh_errors import mesh_change, mesh_patterns
from kolsky.joint.optimum import Optimum
from kolsky.joint.problem import JointProblem
from kolsky.joint.records import ModelChoice
from kolsky.joint.start import relaxing_points, second_levels
from kolsky.joint.unseen import SEEN, is_strength, rate_of
from kolsky.joint.weights import Stack

WEAK = 0.05
"""Strength of the branch beside the elastic optimum from which a search begins [-]."""
LINEAR = 1e-3
"""Strength of the branches whose directions are taken [-]: so small that the ringing stays in step also where
Poisson's ratio is held, and the bulk modulus grows by as much."""


def with_nothing(problem: JointProblem, elastic: JointProblem, without: Optimum) -> Optimum | None:
    """The elastic optimum as one with a strength of nothing; None if bounds of the strengths leave that out.

    Parameters
    ----------
    problem
        With what relaxes.
    elastic, without
        The same without, and its optimum.
    """
    box = problem.unknowns.box
    bounds = zip(problem.unknowns.names, box.lower, strict=True)
    if any(low > 0.0 for name, low in bounds if is_strength(name)):
        return None
    if not any(is_strength(name) for name in problem.unknowns.names):
        return None
    x = weak_branch(problem, elastic, without.x, strength=0.0)
    seen = problem.vector_for(problem.stack, x, problem.refined)
    vector = np.concatenate([seen[: len(seen) - problem.stack.known], problem.known(x)])
    start = weak_branch(problem, elastic, without.start, strength=0.0)
    return Optimum(x, start, vector, without.slopes, None, without.confirmed)


def weak_branch(
    problem: JointProblem, elastic: JointProblem, at: FloatArray, *, strength: float = WEAK
) -> FloatArray:
    """A point without what relaxes, with a weak branch beside it: where that is no worse than nothing.

    Parameters
    ----------
    problem
        With what relaxes.
    elastic
        The same without.
    at
        A point of it, shape [d].
    strength
        Of the branch [-].
    """
    names, box = list(problem.unknowns.names), problem.unknowns.box
    x = np.sqrt(np.maximum(np.array(box.lower), 1e-12) * np.array(box.upper))
    for i, name in enumerate(elastic.unknowns.names):
        x[names.index(name)] = at[i]
    strengths = [i for i, name in enumerate(names) if is_strength(name)]
    x[strengths] = strength
    x = in_step(names, x[None], strength * len(strengths))[0]
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
    # The optimum with what relaxes, judged by the same data, patterns and prior.
    both = [i for i, name in enumerate(problem.unknowns.names) if name in elastic.unknowns.names]
    seen = problem.vector_for(stack, found.x, problem.refined)
    other = np.concatenate([seen[: len(seen) - stack.known], elastic.known(found.x[both])])
    patterns = mesh_patterns(stack, mesh_change(elastic, without))
    more = len(problem.unknowns.names) - len(elastic.unknowns.names)
    lower = judged(stack, other, patterns) - judged(stack, vector, patterns)
    missed = 0.0
    nothing = with_nothing(problem, elastic, without)
    if nothing is not None:
        # A strength of nothing is among what relaxes: its optimum explains no less.
        lower = min(lower, 0.0)
        above = problem.deviance(found.vector) - problem.deviance(nothing.vector)
        missed = above if above > UNREACHED else 0.0
    aic = lower + 2.0 * more
    bic = lower + more * float(np.log(stack.ends[-1] + len(stack.slow)))
    residual = vector - stack.data
    whitening = stack.whitening(stack.weighed_beside(residual, patterns), patterns)

    names = list(problem.unknowns.bounds)
    base = found.start.copy()
    for i, name in enumerate(elastic.unknowns.bounds):
        base[names.index(name)] = without.start[i]
    for i, name in enumerate(names):
        if is_strength(name):
            base[i] = problem.unknowns.box.lower[i]
    numerics = problem.mesh
    weak = in_step(names, relaxing_points(problem, base, (LINEAR,), follow=False), LINEAR)
    bare = elastic.vector_for(stack, without.start, numerics)
    directions = [(problem.vector_for(stack, p, numerics) - bare) / LINEAR for p in weak]
    second = "prony_time_1" if "prony_time_1" in names else "creep_resistance"
    times = second_levels(problem, second) if second in names else np.full(len(weak), np.nan)
    test = branch_test(
        whitening.apply(-residual),
        whitening.apply(np.concatenate([without.slopes.T, patterns])).T,
        whitening.apply(np.nan_to_num(np.array(directions))),
        times,
        blocks=stack.blocks,
        seed=problem.settings.seed,
        realised=-lower,
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


def _inside(e: Estimate | None) -> bool:
    """Whether a parameter is held, or ends inside its range."""
    return e is None or e.outcome is not Verdict.AT_BOUND


def in_step(names: Sequence[str], points: FloatArray, strength: float) -> FloatArray:
    """Points with a branch of a strength, the bulk modulus what it was without if it can be, shape [n, d].

    Parameters
    ----------
    names
        Of the unknowns.
    points
        The points with the branch, shape [n, d].
    strength
        Of the branch [-].
    """
    found = points.copy()
    if VALLEY in names:
        i = names.index(VALLEY)
        found[:, i] = same_bulk(points[:, i], 1.0 + strength)
    return found


def held_against(choice: ModelChoice, shared: Mapping[str, Estimate]) -> ModelChoice:
    """The choice with the strengths' own uncertainties: what the mesh alone may feign is not asked for.

    Nor is a branch whose time ends at a bound of its range: a short one is damping by another name, a long
    one a stiffer curve.

    Parameters
    ----------
    choice
        By criterion and planted data, which know the noise of these shots.
    shared
        The shared parameters, corrected for the mesh.
    """
    sizes = [e for name, e in shared.items() if is_strength(name)]
    if not choice.asked_for or not sizes:
        return choice
    strong = [e for e in sizes if e.value > SEEN * e.sigma]
    if any(_inside(shared.get(rate_of(e.name))) for e in strong):
        return choice
    if strong:
        return replace(
            choice,
            asked_for=False,
            sentence=f"the data do not ask for what relaxes: {rate_of(strong[0].name)} ends at a bound of "
            "its range, where a branch is damping or a stiffer curve by another name: identify without it, "
            f"or give another range with --free {rate_of(strong[0].name)}",
        )
    most = max(sizes, key=lambda e: e.value / e.sigma)
    return replace(
        choice,
        asked_for=False,
        sentence=f"the data do not ask for what relaxes: its strength, {most.value:.2g} with a standard "
        f"uncertainty of {most.sigma:.2g}, mesh included, may be nothing: identify without it, or refine",
    )


def judged(stack: Stack, vector: FloatArray, patterns: FloatArray) -> float:
    """-2 ln L of a vector up to a constant; a point that a run does not reach adds nothing.

    Parameters
    ----------
    stack
        Data and weights.
    vector
        Prediction, shape [k].
    patterns
        Errors of the mesh that the weights know beside their own, shape [n, k].
    """
    residual = np.where(np.isnan(vector), 0.0, vector - stack.data)
    weights = stack.whitening(stack.weighed_beside(residual, patterns), patterns)
    return float((weights.apply(residual) ** 2).sum()) + weights.log_determinant


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
