"""The steps of a joint identification, in order.

1. The shared free parameters are those that are free in every single shot (`kolsky.inverse.problem`).
2. The stiffness, the relaxation and the valleys of Poisson's ratio are scanned on the search mesh. Then all
   shots and slow tests are fitted together by least squares (`kolsky.inverse.joint_problem`).
3. The noise of the front faces, the clocks and the scales are computed at that point and added to the
   weights. The least-squares fit is repeated.
4. The optimum is moved to the refined mesh (`kolsky.inverse.joint_search`). A model with relaxation is
   compared with the fit of the same shots without relaxation (`kolsky.diagnosis.relaxation`). The noise
   patterns are computed again at the optimum. The scatter between the shots is estimated and added to the
   weights.
5. The result holds the shared values, the values of each shot and, if it is free, the curve. The intervals
   include the weights, the time correlation of the residuals, the noise of the curve, the mesh error and the
   declared inputs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.process import one_blas_thread
from kolsky.diagnosis.fit_quality import mesh_changes
from kolsky.diagnosis.joint_fit import (
    joint_fit_warnings,
    joint_fits,
    joint_verdict,
    own_stiffnesses,
    residual_changes,
    shot_agreement,
    shot_causes,
    without_scatter,
)
from kolsky.diagnosis.relaxation import (
    choice_with_mesh_error,
    choose_model,
    optimum_without_branch,
    weak_branch,
)
from kolsky.inverse.estimates import estimates, held_values
from kolsky.inverse.joint_problem import CLOCK, GAIN, SCATTER, JointProblem, Stack, covariance, information
from kolsky.inverse.joint_result import (
    CurveFound,
    JointResult,
    ModelChoice,
    OwnStiffness,
    ShotPart,
    Slow,
    as_not_seen,
    needed_strength,
)
from kolsky.inverse.joint_runs import JointRuns, Unknowns, node_strains, with_factors
from kolsky.inverse.joint_search import (
    Optimum,
    between_variance,
    expanded_scatter,
    refined_optimum,
    starts,
    with_patterns_and_scatter,
)
from kolsky.inverse.objective import Objective
from kolsky.inverse.parameters import MOVED, PARAMETERS, reference_words, require_declared
from kolsky.inverse.problem import Freed, PreparedShot, choose, prepare_shot
from kolsky.inverse.result import Estimate
from kolsky.inverse.settings import JointSettings
from kolsky.inverse.work import Progress
from kolsky.shot.records import Shot
from kolsky.uncertainty.budgets import declared_changes, declared_parts
from kolsky.uncertainty.mesh_error import joint_mesh_change, numerical_parts
from kolsky.uncertainty.warnings import lost_mesh_runs

FEW_SHOTS = 5
"""Fewer shots give a poor estimate of the scatter between them."""


def shot_variances(problem: JointProblem, found: Optimum) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Covariance of the unknowns, shape [d, d]; variances without and by the scatter between shots, [d] each.

    Their sum is not smaller than with weights without scatter.
    """
    stack, residual, widths = problem.stack, found.vector - problem.stack.data, problem.unknowns.widths
    cov = covariance(found.slopes, residual, stack.weighting(residual), stack, widths)
    whole = np.diag(cov)
    if not any(SCATTER in one.own for one in stack.shots):
        return cov, whole, np.zeros(len(whole))
    plain = _without("", stack, problem, found)
    without = _without(SCATTER, replace(stack, slow_scatter=None), problem, found)
    bare = without_scatter(stack)
    alone = covariance(found.slopes, residual, bare.weighting(residual), bare, widths)
    within = whole - np.maximum(plain - without, 0.0)
    return cov, within, between_variance(whole, plain, without, np.diag(alone))


def joint_result(
    problem: JointProblem, found: Optimum, choice: ModelChoice | None, said: tuple[str, ...]
) -> JointResult:
    """Values, intervals and verdicts at an optimum.

    Raises ValueError if the run at the optimum on the search mesh does not complete.
    """
    stack, unknowns = problem.stack, problem.unknowns
    residual = found.vector - stack.data
    objectives = stack.weighed(residual)
    whitening = stack.whitening(objectives)
    known = information(whitening.apply(found.slopes.T), unknowns.widths)
    gain = np.linalg.solve(known, whitening.precision(found.slopes.T)).astype(np.float64)
    cov, within, between = shot_variances(problem, found)
    plain = np.diag(np.linalg.inv(known))
    curves = np.zeros(len(found.x))
    if stack.curve is not None:
        curves = np.maximum(plain - _without("", replace(stack, curve=None), problem, found), 0.0)
    declared = declared_changes(problem, found)
    noise = {
        "force and shape": np.sqrt(np.maximum(within - curves, 0.0)),
        "scatter between shots": np.sqrt(between),
        "material curve": np.sqrt(curves),
        **declared_parts(problem, found, declared),
    }
    mesh = joint_mesh_change(problem, found)
    numerical = numerical_parts(mesh, gain)
    n = len(unknowns.bounds)
    shared: dict[str, Estimate] = {}
    if unknowns.parameters is not None:
        shared = estimates(
            unknowns.parameters,
            found.x[:n],
            noise={source: part[:n] for source, part in noise.items()},
            numerical={source: part[:n] for source, part in numerical.items()},
            mesh_shift=mesh.shift(gain)[:n],
            mesh_correction=mesh.correction(gain)[:n],
            confirmed=found.confirmed,
            outline=any(one.observations.has_shape for one in stack.shots),
        )
    choice = None if choice is None else choice_with_mesh_error(choice, shared)
    if choice is not None and not choice.asked_for:
        shared = {name: as_not_seen(e) for name, e in shared.items()}
    parts = _shot_parts(problem, found, whitening.precision(residual), objectives)
    size, m = found.scatter_size, float(problem.values(found.x).get(MOVED, 1.0))
    fits, slow_fits = joint_fits(
        problem,
        found,
        gain=gain,
        whitening=whitening,
        objectives=objectives,
        changes=residual_changes(problem, mesh, declared),
        # deviation of each shot from the shared stiffness, in standard deviations of the scatter
        scatters=[(part.factor / m - 1.0) / size if size > 0.0 else 0.0 for part in parts],
    )
    own: tuple[OwnStiffness | None, ...] = (None,) * len(parts)
    agreement, names = None, [part.name for part in parts]
    if MOVED in unknowns.names or unknowns.nodes:
        own = asked = own_stiffnesses(problem, found, mesh, declared)
        agreement = shot_agreement(names, asked, scatter=size > 0.0)
    parts = tuple(replace(p, fit=f, own=o) for p, f, o in zip(parts, fits, own, strict=True))
    everything = (*(fit for one in fits for fit in one), *slow_fits)
    shared = {name: joint_verdict(e, everything, agreement) for name, e in shared.items()}
    withheld = not all(fit.explained for fit in everything) or (agreement is not None and agreement.apart)
    causes = shot_causes(problem, found, mesh_changes(mesh)) if withheld else ()
    bodies = len(stack.shots) + (0 if stack.slow_scatter is None else len(stack.slow_scatter))
    half = {
        name: expanded_scatter(e.sigma, e.noise_parts["scatter between shots"], bodies)
        for name, e in shared.items()
    }
    sizes = np.sqrt(np.diag(cov))
    return JointResult(
        estimates=shared,
        fixed=held_values(problem.first, tuple(unknowns.bounds), problem.runs.held),
        correlation=(cov / np.outer(sizes, sizes))[:n, :n],
        expanded=half,
        shots=parts,
        scatter=found.scatter,
        slow=_slow_misfits(problem, found.vector),
        choice=choice,
        curve=_free_curve(problem, found, noise, numerical, mesh.correction(gain))
        if unknowns.nodes
        else None,
        mesh=problem.mesh.mesh,
        refined_mesh=problem.settings.refined_mesh,
        runs=problem.runs.made,
        warnings=(
            *joint_fit_warnings(names, fits, slow_fits, agreement, causes),
            *said,
            *lost_mesh_runs(mesh.lost, problem.mesh.mesh),
            *_joint_warnings(problem, found, choice, shared),
        ),
        slow_fit=slow_fits,
        agreement=agreement,
        causes=causes,
    )


def _without(name: str, stack: Stack, problem: JointProblem, found: Optimum) -> FloatArray:
    """Variances with the same discrepancies, but without the unknown of this name in each shot, shape [d]."""
    bare = []
    for one, o in zip(stack.shots, stack.weighed(found.vector - stack.data), strict=True):
        rest = replace(one, own={key: row for key, row in one.own.items() if key != name})
        bare.append(replace(o, front=rest.objective.front))
    rows = stack.whitening(bare).apply(found.slopes.T)
    return np.diag(np.linalg.inv(information(rows, problem.unknowns.widths)))


def _shot_parts(
    problem: JointProblem, found: Optimum, weighed: FloatArray, objectives: Sequence[Objective]
) -> tuple[ShotPart, ...]:
    """Each shot: the most likely values of its unknowns, and its goodness of fit."""
    stack, parts = problem.stack, []
    m = float(problem.values(found.x).get(MOVED, 1.0))
    residuals = stack.parts(found.vector - stack.data)
    pulls = stack.parts(weighed)
    for k, (one, o, r) in enumerate(zip(stack.shots, objectives, residuals, strict=True)):
        shot = problem.shots[k]
        size = {SCATTER: m * found.scatter_size, GAIN: problem.settings.gain_each}
        size[CLOCK] = shot.uncertainty.get("clock_offset", 0.0)
        own = dict.fromkeys(size, (0.0, 0.0))
        for name, row in one.own.items():
            amount, sigma = _shot_unknown(row[one.kept], pulls[k], o)
            own[name] = size[name] * amount, size[name] * sigma
        n, squares = o.n_force, (r / o.noise) ** 2
        parts.append(
            ShotPart(
                name=shot.name,
                inputs=dict(shot.inputs),
                factor=m + own[SCATTER][0],
                sigma_factor=own[SCATTER][1],
                gain=own[GAIN][0],
                sigma_gain=own[GAIN][1],
                clock=own[CLOCK][0],
                sigma_clock=own[CLOCK][1],
                chi2_force=float(squares[:n].mean()),
                chi2_outline=float(squares[n:].mean()) if len(squares) > n else float("nan"),
                discrepancy_force=o.force_discrepancy,
                discrepancy_outline=o.shape_discrepancy,
            )
        )
    return tuple(parts)


def _shot_unknown(row: FloatArray, pull: FloatArray, objective: Objective) -> tuple[float, float]:
    """Most likely amplitude of a pattern and its remaining uncertainty, in standard deviations.

    The residual is r = prediction minus data; its covariance C includes the pattern u. The amplitude is -u
    C^-1 r; its uncertainty is the square root of 1 - u C^-1 u.
    """
    left = 1.0 - float(row @ objective.whitening().precision(row[None])[0])
    return -float(row @ pull), float(np.sqrt(max(left, 0.0)))


def _slow_misfits(problem: JointProblem, vector: FloatArray) -> Mapping[str, float]:
    stack, sigma = problem.stack, np.ones(len(vector))
    sigma[stack.ends[-1] :][: len(stack.slow)] = stack.slow_sigma
    squares = ((vector - stack.data) / sigma) ** 2
    return {label: float(squares[part].mean()) for label, part in problem.slow_parts()}


def _free_curve(
    problem: JointProblem,
    found: Optimum,
    noise: Mapping[str, FloatArray],
    numerical: Mapping[str, FloatArray],
    correction: FloatArray,
) -> CurveFound:
    """The curve with its k = 2 band; the logarithm of the factors is interpolated between the nodes."""
    n = len(problem.unknowns.bounds)
    logs = (found.x + correction)[n:]
    sigma = np.sqrt(sum(part[n:] ** 2 for part in (*noise.values(), *numerical.values())))
    whitening = problem.stack.weighting(found.vector - problem.stack.data)
    rows = whitening.apply(found.slopes.T)
    normal, known = rows @ rows.T, found.slopes[-problem.stack.known :]
    prior = np.diag(known.T @ known)[n:]
    curve = problem.first.curve
    return CurveFound(
        strain=node_strains(curve, len(logs)),
        factor=np.exp(logs),
        sigma_log=np.asarray(sigma),
        prior_share=prior / np.diag(normal)[n:],
        stretch=curve.stretch,
        stress=with_factors(curve, logs),
        band=np.stack([with_factors(curve, logs + sign * 2.0 * sigma) for sign in (-1.0, 1.0)]),
    )


def _joint_warnings(
    problem: JointProblem, found: Optimum, choice: ModelChoice | None, shared: Mapping[str, Estimate]
) -> list[str]:
    said = []
    if not found.confirmed:
        said.append(
            "the last run on the refined mesh still gives another optimum: widen the bounds with --free, "
            "or refine --mesh, from which the steps take their slopes"
        )
    if choice is not None and not choice.asked_for:
        said += [choice.sentence, *needed_strength(shared)]
    reference = reference_words(shared)
    if reference:
        said.append(f"m refers to {reference}")
    m, size = shared.get(MOVED), found.scatter_size
    if m is not None and 0.0 < size * m.value <= m.sigma_numerical:
        said.append(
            f"the scatter between the shots, {100.0 * size:.2g} %, is within the mesh error, which "
            "changes with the speed: refine both meshes before you interpret it as scatter"
        )
    if found.scatter is not None and size > 0.0 and len(problem.stack.shots) < FEW_SHOTS:
        low, high = (100.0 * end for end in found.scatter.interval)
        said.append(
            f"the scatter between the shots is from {len(problem.stack.shots)} of them and hardly known: its "
            f"95 % interval is {low:.2g} to {high:.2g} %"
        )
    return said


FIRST_STEPS, LATER_STEPS = 10, 6
"""Trial points of the first search, and of the later searches with improved weights."""
SAME_VALLEY = 10.0
"""Largest distance between two results in one valley, in standard deviations.

A search that stops at its step limit ends within a few standard deviations of the optimum. The next valley of
Poisson's ratio is tens of standard deviations away."""


@one_blas_thread()
def identify_shots(
    shots: Sequence[Shot],
    settings: JointSettings | None = None,
    *,
    slow: Slow = (),
    ledger: Path | None = None,
    progress: Progress | None = None,
) -> JointResult:
    """Identify the shared parameters of several shots of one material.

    Parameters
    ----------
    shots
        The shots, two or more; they may differ in specimen, speed, interface and instruments.
    settings
        Free parameters, held parameters, numerical choices.
    slow
        Slow tests of the same material.
    ledger
        File that stores every run. An existing file is continued.
    progress
        Called as ``progress(stage, runs done, runs in the stage)``.

    Raises
    ------
    ValueError
        If the shots cannot be joined, nothing is free, or too few runs complete.
    """
    settings = settings or JointSettings()
    _check_joinable(shots, settings, slow)
    prepared = [prepare_shot(shot) for shot in shots]
    freed = [choose(settings.of_one(), shot) for shot in shots]
    said: list[str] = []
    bounds = _shared_bounds(prepared, freed, settings, said)

    def problem_of(
        shots: Sequence[PreparedShot], free: Mapping[str, tuple[float, float] | None]
    ) -> JointProblem:
        runs = JointRuns(
            shots,
            Unknowns(free, settings.curve_nodes),
            held=settings.held,
            ledger=ledger,
            replicates=settings.replicates,
            seed=settings.seed,
            **({} if progress is None else {"progress": progress}),
        )
        own = replace(freed[0], settings=replace(freed[0].settings, free=dict(free)))
        return JointProblem(runs, settings, slow, own.prior(shots[0].shot) if free else None)

    problem = problem_of(prepared, bounds)
    relaxing = [name for name in problem.unknowns.bounds if PARAMETERS[name].relaxes]
    kept = {n: b for n, b in problem.unknowns.bounds.items() if n not in relaxing}
    if not relaxing or not (kept or settings.curve_nodes):
        found = with_patterns_and_scatter(problem, _search_joint(problem), said)
        return joint_result(problem, found, None, tuple(said))
    elastic = problem_of([p.with_shot(replace(p.shot, relaxation=None)) for p in prepared], kept)
    without = _search_joint(elastic)
    found = _search_joint(problem, beside=weak_branch(problem, elastic, without.start))
    found = _not_above(problem, found, elastic, without)
    choice = choose_model(problem, found, elastic, without)
    found = with_patterns_and_scatter(problem, found, said)
    return joint_result(problem, found, choice, tuple(said))


def _search_joint(problem: JointProblem, *, beside: FloatArray | None = None) -> Optimum:
    """The optimum on the refined mesh, without scatter between the shots."""
    numerics = problem.mesh
    x, _ = problem.search(starts(problem, numerics), numerics, FIRST_STEPS)
    problem.learn_noise(x, numerics)
    found = refined_optimum(problem, *_search_again(problem, x))
    if beside is None:
        return found
    end, slopes = _search_again(problem, problem.search(beside[None], numerics, FIRST_STEPS)[0])
    if _distance(problem, found, end) <= SAME_VALLEY:
        return found
    other = refined_optimum(problem, end, slopes)
    if not problem.deviance(other.vector) < problem.deviance(found.vector):
        return found
    problem.learn_noise(other.start, numerics)  # the noise patterns depend on the point
    return refined_optimum(problem, *_search_again(problem, other.start))


def _not_above(problem: JointProblem, found: Optimum, elastic: JointProblem, without: Optimum) -> Optimum:
    """An optimum that fits at least as well as the optimum of a simpler model nested in it."""
    nothing = optimum_without_branch(problem, elastic, without)
    if nothing is None or problem.deviance(found.vector) <= problem.deviance(nothing.vector):
        return found
    rows = elastic.stack.weighting(without.vector - elastic.stack.data).apply(without.slopes.T)
    sigma = 0.1 * problem.unknowns.widths
    shared = [problem.unknowns.names.index(name) for name in elastic.unknowns.names]
    sigma[shared] = np.sqrt(np.diag(np.linalg.inv(information(rows, elastic.unknowns.widths))))
    slopes = problem.slopes(nothing.start, sigma, problem.mesh)[1]
    return replace(refined_optimum(problem, nothing.x, slopes), start=nothing.start)


def _search_again(problem: JointProblem, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The optimum and slopes on the search mesh, with the current weights, from a nearby start."""
    x, sigma = problem.search(x[None], problem.mesh, LATER_STEPS)
    return x, problem.slopes(x, sigma, problem.mesh)[1]


def _distance(problem: JointProblem, found: Optimum, x: FloatArray) -> float:
    """Distance of a point on the search mesh from the start of an optimum, in standard deviations."""
    rows = problem.stack.weighting(found.vector - problem.stack.data).apply(found.slopes.T)
    away = x - found.start
    return float(np.sqrt(away @ information(rows, problem.unknowns.widths) @ away))


def _shared_bounds(
    prepared: Sequence[PreparedShot], freed: Sequence[Freed], settings: JointSettings, said: list[str]
) -> dict[str, tuple[float, float] | None]:
    """Free parameters and their bounds. One that is held in one shot is held in all, with a note."""
    bounds = dict(freed[0].free)
    for one in freed:
        for name in [n for n in bounds if n not in one.free]:
            del bounds[name]
            said.append(f"{name} is held at each shot's value: {one.reasons.get(name, 'one shot holds it')}")
    for ready in prepared:
        require_declared(bounds, ready.shot)
    if settings.curve_nodes:
        bounds.pop(MOVED, None)
    if not bounds and not settings.curve_nodes:
        raise ValueError("nothing is free in all of the shots")
    return bounds


def _check_joinable(shots: Sequence[Shot], settings: JointSettings, slow: Slow) -> None:
    """Raise ValueError for shots that cannot be identified together."""
    if len(shots) < 2 and not slow and not settings.curve_nodes:
        raise ValueError("one shot is not a joint identification: give more shots, slow tests or curve nodes")
    names = [shot.name for shot in shots]
    double = sorted({name for name in names if names.count(name) > 1})
    if double:
        raise ValueError(f"two shots are called {double[0]}: give each shot once, with a different name")
    kinds = {None if s.relaxation is None else (s.relaxation.kind, s.relaxation.branches) for s in shots}
    if len(kinds) > 1:
        raise ValueError(
            "the shots' [relaxation] differ in kind or number of branches: they share one; declare the same, "
            "or give --relaxation"
        )
    if settings.curve_nodes:
        if slow:
            raise ValueError(
                "slow tests determine the slow curve: omit them where nodes of the curve are free"
            )
        ends = {float(np.sign(shot.curve.stretch[-1] - 1.0)) for shot in shots}
        if len(ends) > 1:
            raise ValueError("the shots' curves are of different branches: one curve cannot be free in all")
