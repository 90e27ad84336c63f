"""The story of a joint identification, top to bottom.

1. What is shared and free: what every shot frees by itself.
2. Scans of the stiffness, of what relaxes and of Poisson's valleys on the mesh of the search, then least
   squares over all shots and slow tests together (`kolsky.joint.problem`).
3. The weights learn the front faces' noise, clocks and scales at that point; least squares again.
4. The optimum is moved to the refined mesh (`kolsky.joint.refined_steps`). What relaxes is held against the
   same shots without it (`kolsky.joint.model_choice`). The weights learn the noise once more at the optimum
   (`kolsky.joint.refined_patterns`), and there the scatter between the shots is estimated
   (`kolsky.joint.scatter`); the weights know it from then on.
5. Its uncertainty: weights, residuals correlated in time, the curve's noise, the mesh
   (`kolsky.joint.answer`); the curve, if it is free.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.process import one_blas_thread
from kolsky.inverse.free_parameters import Freed, choose
from kolsky.inverse.parameters import MOVED, PARAMETERS, checked_value, require_declared
from kolsky.inverse.prepared_shot import PreparedShot, prepare_shot
from kolsky.inverse.staged_runs import Progress
from kolsky.joint.answer import answered
from kolsky.joint.finish import finished
from kolsky.joint.model_choice import chosen, weak_branch, with_nothing
from kolsky.joint.optimum import Optimum
from kolsky.joint.problem import JointProblem
from kolsky.joint.records import JointResult, JointSettings, Slow
from kolsky.joint.refined_steps import refined_optimum
from kolsky.joint.runs import JointRuns
from kolsky.joint.start import starts
from kolsky.joint.unknowns import Unknowns
from kolsky.joint.weights import information
from kolsky.shot.records import Shot

FIRST, AGAIN = 10, 6
"""Trial points of the first search, and of those with better weights."""
SAME = 10.0
"""Distance of two ends of searches, in standard deviations, up to which they lie in one valley: a search that
its steps have cut short ends within some of them, the next valley of Poisson's ratio is tens away."""


@one_blas_thread()
def identify_shots(
    shots: Sequence[Shot],
    settings: JointSettings | None = None,
    *,
    slow: Slow = (),
    ledger: Path | None = None,
    progress: Progress | None = None,
) -> JointResult:
    """Identify what several shots of one material share.

    Parameters
    ----------
    shots
        The shots, two or more; they may differ in specimen, speed, interface and instruments.
    settings
        What is free, what is held, numerical choices.
    slow
        Slow tests of the same material.
    ledger
        File that keeps every run; one that is there goes on where it ended.
    progress
        Called as ``progress(stage, runs done, runs in the stage)``.

    Raises
    ------
    ValueError
        If the shots cannot be joined, nothing is free, or too few runs complete.
    """
    settings = settings or JointSettings()
    _joinable(shots, settings, slow)
    prepared = [prepare_shot(shot) for shot in shots]
    freed = [choose(settings.of_one(), shot) for shot in shots]
    said: list[str] = []
    problem = _problem(prepared, freed, settings, slow, ledger, progress, said)
    relaxing = [name for name in problem.unknowns.bounds if PARAMETERS[name].relaxes]
    kept = {n: b for n, b in problem.unknowns.bounds.items() if n not in relaxing}
    if not relaxing or not (kept or settings.curve_nodes) or not settings.choose:
        found = finished(problem, search(problem), said)
        return answered(problem, found, None, tuple(said))
    bare = [
        replace(p, forward=replace(p.forward, shot=replace(p.forward.shot, relaxation=None)))
        for p in prepared
    ]
    elastic = _joined(bare, kept, freed[0], settings, slow, ledger, progress)
    without = search(elastic)
    found = search(problem, beside=weak_branch(problem, elastic, without.start))
    found = _not_above(problem, found, elastic, without)
    choice = chosen(problem, found, elastic, without)
    found = finished(problem, found, said)
    return answered(problem, found, choice, tuple(said))


def search(problem: JointProblem, *, beside: FloatArray | None = None) -> Optimum:
    """The optimum on the refined mesh, shots without a scatter between them.

    Parameters
    ----------
    problem
        The problem.
    beside
        One more point to search from, shape [d]. Its end is taken to the refined mesh too: which of two
        valleys is the deeper one is not for the search's mesh to say, whose ringing has another period.

    Raises
    ------
    ValueError
        If no search can start, or a run beside the optimum does not complete.
    """
    numerics = problem.mesh
    x, _ = problem.search(starts(problem, numerics), numerics, FIRST)
    problem.learn_noise(x, numerics)
    found = _from(problem, x)
    if beside is None:
        return found
    end = _searched(problem, problem.search(beside[None], numerics, FIRST)[0])
    if _apart(problem, found, end.x) <= SAME:
        return found
    other = refined_optimum(problem, end.x, end.slopes)
    if not problem.deviance(other.vector) < problem.deviance(found.vector):
        return found
    problem.learn_noise(other.start, numerics)  # the patterns are those of a point
    return _from(problem, other.start)


def _not_above(problem: JointProblem, found: Optimum, elastic: JointProblem, without: Optimum) -> Optimum:
    """An optimum that explains no less than that of a model which is contained in its own.

    Parameters
    ----------
    problem, found
        The larger problem, and where its search ended.
    elastic, without
        The smaller one, and its optimum.
    """
    nothing = with_nothing(problem, elastic, without)
    if nothing is None or problem.deviance(found.vector) <= problem.deviance(nothing.vector):
        return found
    rows = elastic.whitening(without.vector - elastic.stack.data).apply(without.slopes.T)
    sigma = 0.1 * problem.unknowns.widths
    shared = [problem.unknowns.names.index(name) for name in elastic.unknowns.names]
    sigma[shared] = np.sqrt(np.diag(np.linalg.inv(information(rows, elastic.unknowns.widths))))
    slopes = problem.slopes(nothing.start, sigma, problem.mesh)[1]
    return replace(refined_optimum(problem, nothing.x, slopes), start=nothing.start)


@dataclass(frozen=True)
class _End:
    """Where a search on its own mesh ended, and the slopes there."""

    x: FloatArray
    slopes: FloatArray


def _searched(problem: JointProblem, x: FloatArray) -> _End:
    """The search once more, with the weights of now, from a point near the optimum on its mesh."""
    x, sigma = problem.search(x[None], problem.mesh, AGAIN)
    return _End(x, problem.slopes(x, sigma, problem.mesh)[1])


def _from(problem: JointProblem, x: FloatArray) -> Optimum:
    """The optimum on the refined mesh from a point near that on the search's mesh."""
    end = _searched(problem, x)
    return refined_optimum(problem, end.x, end.slopes)


def _apart(problem: JointProblem, found: Optimum, x: FloatArray) -> float:
    """How far a point on the search's mesh is from where an optimum was searched, in standard deviations."""
    rows = problem.whitening(found.vector - problem.stack.data).apply(found.slopes.T)
    away = x - found.start
    return float(np.sqrt(away @ information(rows, problem.unknowns.widths) @ away))


def _problem(
    prepared: Sequence[PreparedShot],
    freed: Sequence[Freed],
    settings: JointSettings,
    slow: Slow,
    ledger: Path | None,
    progress: Progress | None,
    said: list[str],
) -> JointProblem:
    """The problem of all shots; what some shot holds is held, and said."""
    bounds = dict(freed[0].free)
    for one in freed:
        for name in [n for n in bounds if n not in one.free]:
            del bounds[name]
            said.append(f"{name} is held at each shot's value: {one.reasons.get(name, 'one shot holds it')}")
    for ready in prepared:
        require_declared(bounds, ready.forward.shot)
    if settings.curve_nodes:
        bounds.pop(MOVED, None)
    for name, value in settings.held.items():
        checked_value(name, value)
    if not bounds and not settings.curve_nodes:
        raise ValueError("nothing is free in all of the shots")
    return _joined(prepared, bounds, freed[0], settings, slow, ledger, progress)


def _joined(
    prepared: Sequence[PreparedShot],
    bounds: Mapping[str, tuple[float, float] | None],
    freed: Freed,
    settings: JointSettings,
    slow: Slow,
    ledger: Path | None,
    progress: Progress | None,
) -> JointProblem:
    unknowns = Unknowns(bounds, settings.curve_nodes)
    runs = JointRuns(
        prepared,
        unknowns,
        held=settings.held,
        ledger=ledger,
        replicates=settings.replicates,
        seed=settings.seed,
        **({} if progress is None else {"progress": progress}),
    )
    kept = replace(freed, settings=replace(freed.settings, free=dict(bounds)))
    prior = kept.prior(prepared[0].forward.shot) if bounds else None
    return JointProblem(runs, settings, slow, prior)


def _joinable(shots: Sequence[Shot], settings: JointSettings, slow: Slow) -> None:
    """Refuse shots that do not share what they are to share."""
    if len(shots) < 2 and not slow and not settings.curve_nodes:
        raise ValueError("one shot by itself is identified alone: give more shots, slow tests or curve nodes")
    names = [shot.name for shot in shots]
    double = sorted({name for name in names if names.count(name) > 1})
    if double:
        raise ValueError(f"two shots are called {double[0]}: a shot counts once; give each its own name")
    kinds = {None if s.relaxation is None else (s.relaxation.kind, s.relaxation.branches) for s in shots}
    if len(kinds) > 1:
        raise ValueError(
            "the shots' [relaxation] differ in kind or number of branches: they share one; declare the same, "
            "or give --relaxation"
        )
    if settings.curve_nodes:
        if slow:
            raise ValueError("slow tests tell the slow curve: with free nodes of the curve leave them out")
        ends = {float(np.sign(shot.curve.stretch[-1] - 1.0)) for shot in shots}
        if len(ends) > 1:
            raise ValueError("the shots' curves are of different branches: one curve cannot be free in all")
