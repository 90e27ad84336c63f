"""Tests for relaxation in one or several shots: score test, search for a branch, model choice.

The residuals of an elastic optimum are tested for a branch by their score. It is compared with the scores of
synthetic elastic data. If the branch may be strong, it is searched. For several shots, the optima with and
without branch are compared by AIC, BIC and the same test.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from doe import Box
from doe.least_squares import least_squares
from kolsky.base.apparatus import Relaxation, prony_names
from kolsky.base.arrays import FloatArray, IntArray
from kolsky.inverse.forward import Forward
from kolsky.inverse.joint_problem import JointProblem, Stack
from kolsky.inverse.joint_result import LEAST_STRENGTH, ModelChoice, is_strength, rate_of
from kolsky.inverse.joint_search import Optimum, relaxing_points, second_levels
from kolsky.inverse.objective import BLOCKS, Objective, weighting_with_prior
from kolsky.inverse.observations import predict
from kolsky.inverse.parameters import MOVED, design_box, same_bulk
from kolsky.inverse.result import Estimate, Verdict
from kolsky.inverse.runner import Runner
from kolsky.inverse.valleys import VALLEY, from_search, search_box, to_search
from kolsky.material.relaxation.rate_fit import SIGNIFICANT
from kolsky.uncertainty.mesh_error import joint_mesh_change, mesh_patterns

DRAWS = 20000
"""Number of synthetic elastic data sets."""
MOST_TAKEN = 0.75
"""A block length is not used for a direction if one of its blocks contains a larger share than this [-]."""


@dataclass(frozen=True)
class BranchTest:
    """Improvement by a weak branch."""

    gain: float
    """Decrease of chi-square by the best branch, or by the given branch [-]."""
    time: float
    """Its relaxation time [s]."""
    strength: float
    """Its strength by a linear model [-]."""
    probability: float
    """Share of synthetic elastic data sets that improve as much [-], at least 1 / (draws + 1)."""

    @property
    def significant(self) -> bool:
        """True if chance does not explain the decrease."""
        return self.probability < SIGNIFICANT


def branch_test(
    residual: FloatArray,
    slopes: FloatArray,
    directions: FloatArray,
    times: Sequence[float] | FloatArray,
    *,
    blocks: Sequence[IntArray] = (),
    draws: int = DRAWS,
    seed: int = 1,
    realised: float = 0.0,
) -> BranchTest:
    """Test the residuals of an elastic fit for branches of given relaxation times."""
    basis, _ = np.linalg.qr(slopes)
    own = directions - (directions @ basis) @ basis.T
    left = residual - basis @ (basis.T @ residual)
    size = np.linalg.norm(own, axis=1)
    seen = size > 1e-9 * max(float(np.linalg.norm(directions, axis=1).max()), np.finfo(float).tiny)
    if not seen.any():
        raise ValueError("no branch has an effect that the free parameters cannot follow")
    unit, taus, size = own[seen] / size[seen, None], np.asarray(times, dtype=float)[seen], size[seen]
    scale = _block_deviations(unit, left, blocks)
    score = unit @ left / scale
    best = int(np.argmax(score))
    gain = max(max(0.0, float(score[best])) ** 2, realised / float(scale.max()) ** 2)
    rng = np.random.default_rng(seed)
    values, vectors = np.linalg.eigh(unit @ unit.T)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    planted = np.maximum(rng.standard_normal((draws, len(unit))) @ root.T, 0.0).max(axis=1) ** 2
    as_much = int((planted >= gain).sum())
    strength = max(0.0, float(unit[best] @ left) / float(size[best]))
    return BranchTest(gain, float(taus[best]), strength, (1 + as_much) / (draws + 1))


def _block_deviations(unit: FloatArray, left: FloatArray, blocks: Sequence[IntArray]) -> FloatArray:
    """Standard deviation of each score with residuals correlated within a block, >= 1, shape [n].

    It uses block sums of the residual after the direction is fitted. With the weights w_b of a direction in
    its blocks, n_e = 1 / sum w_b^2 blocks are effective. The fit has removed the share 1 / n_e of the sums,
    which is corrected.
    """
    bare = left - (unit @ left)[:, None] * unit
    scale = np.ones(len(unit))
    for label in blocks:
        n = int(label.max()) + 1
        for k, (row, rest) in enumerate(zip(unit, bare, strict=True)):
            taken = float((np.bincount(label, row**2, minlength=n) ** 2).sum())
            squares = float((np.bincount(label, row * rest, minlength=n) ** 2).sum())
            if taken < MOST_TAKEN:
                scale[k] = max(scale[k], float(np.sqrt(squares)) / (1.0 - taken))
    return scale


STRENGTH, TIME = prony_names(1)
SHORTEST = 2e-5
"""Shortest relaxation time in the search and in the test [s]; the longest is the window."""
STRENGTHS, SCANNED_TIMES = (0.1, 0.4), 6
"""Strengths, and number of times, of the first scan."""
STARTS, STEPS, STEP, AT_REST = 2, 8, 1e-3, 0.5
"""Four settings of the search. They are the number of starts from the scan and the trial points of each. The
others are the half step of differences in the unit box, and the length of the next step at convergence, in
standard deviations."""
HALF = 0.5
"""Smallest share of the elastic model's misfit that a branch must explain [-]. In seven synthetic shots with
a branch, it was 0.89 to 0.99 (draws 0 to 6 of seed 41907 of `populations.branch_advice`). In five elastic
shots, it was -0.23 to -0.005 (draws 0 to 4 of seed 50923 of `populations.coverage`)."""


@dataclass(frozen=True)
class BranchFit:
    """Comparison of a shot with and without a branch."""

    strength: float
    """Strength of the branch [-]."""
    time: float
    """Its relaxation time [s]."""
    aic: float
    """Akaike's criterion with the branch minus that without it [-]."""
    share: float
    """Share of the elastic model's misfit, beyond noise and clocks, that the branch explains [-]."""
    inside: bool
    """True if strength and time lie inside their ranges."""

    @property
    def asked_for(self) -> bool:
        """True if the data need it."""
        return self.inside and self.aic < 0.0 and self.share >= HALF


def _relaxing(runner: Runner, branch: dict[str, float]) -> Forward | None:
    """The elastic shot with a branch; None if it declares its relaxation or a correction for nu."""
    forward = runner.forward
    if forward.shot.relaxation is not None or runner.problem.numerics.compressible is not None:
        return None
    return replace(forward, shot=replace(forward.shot, relaxation=Relaxation("prony", branch)))


def branch_fit(runner: Runner, x: FloatArray, objective: Objective) -> BranchFit | None:
    """Search for a branch from an elastic optimum, with all free parameters refitted.

    Some 200 runs are added on the surrogate's mesh. ``x``, ``objective``: the optimum, [d], and its
    objective. None if the shot declares a relaxation, or if too few runs complete.
    """
    whole, numerics = runner.problem.box, runner.problem.numerics
    first, last = runner.problem.shot.window
    relaxing = _relaxing(runner, {STRENGTH: 0.0, TIME: last - first})
    if relaxing is None:
        return None
    bounds = dict(zip(whole.names, zip(whole.lower, whole.upper, strict=True), strict=True))
    box = design_box({**bounds, STRENGTH: None, TIME: (SHORTEST, last - first)})
    prior, d, k = runner.problem.prior, len(x), len(objective.data)
    known = 0 if prior is None else len(prior.rows())

    def run(points: FloatArray) -> FloatArray:
        runner.work.progress("relaxation", 0, len(points))
        columns = dict(zip(box.names, points.T, strict=True))
        response = relaxing.run({**runner.problem.settings.held, **columns}, numerics)
        found = np.full((len(points), k + known), np.nan)
        rows = np.flatnonzero(response.completed)
        if rows.size:
            seen = objective.vectors(predict(response.select(rows), objective.observations))
            # An outline point that a run does not reach contributes nothing.
            found[rows, :k] = np.where(np.isnan(seen), objective.data, seen)
            if prior is not None:
                found[rows, k:] = prior.residuals(points[rows, :d])
        runner.work.progress("relaxation", len(points), len(points))
        return found

    weighting = weighting_with_prior(objective, known)
    data = np.concatenate([objective.data, np.zeros(known)])

    def deviance(vector: FloatArray) -> float:
        if np.isnan(vector).any():
            return np.inf
        return weighting(vector - data).deviance(vector - data)

    at = runner.solver_values(x[None], numerics.mesh)[0]
    scan = np.clip(scan_points(box, at), box.lower, box.upper)
    vectors = run(np.concatenate([np.append(at, [0.0, last - first])[None], scan]))
    costs = np.array([deviance(vector) for vector in vectors])
    likely = np.argsort(costs[1:])[:STARTS]
    if not np.isfinite(costs[[0, *(1 + likely)]]).all():
        return None
    best = least_squares(
        lambda points: run(from_search(box, points)),
        search_box(box),
        to_search(box, scan[likely]),
        data=data,
        weighting=weighting,
        step=STEP,
        max_steps=STEPS,
        at_rest=AT_REST,
    )[0]
    point = from_search(box, best.x)
    found = run(point[None])[0]
    aic = deviance(found) - float(costs[0]) + 4.0
    share = explained_share(objective, vectors[0, :k], found[:k])
    inside = not {STRENGTH, TIME} & set(best.at_bound)
    return BranchFit(strength=float(point[-2]), time=float(point[-1]), aic=aic, share=share, inside=inside)


def scan_points(box: Box, at: FloatArray) -> FloatArray:
    """Points with a branch, with the mean stiffness of an elastic point, shape [n, d + 2].

    A branch of strength c increases the stiffness by a factor of 1 to 1 + c: m is divided by the root of 1 +
    c. The bulk modulus, proportional to m (1 + c) / (1 - 2 nu), determines the ringing frequency. It is kept
    if Poisson's ratio is free.
    """
    times = np.geomspace(box.lower[-1], box.upper[-1], SCANNED_TIMES + 2)[1:-1]
    found = []
    for strength in STRENGTHS:
        point, root = at.copy(), np.sqrt(1.0 + strength)
        if MOVED in box.names:
            point[box.names.index(MOVED)] /= root
        if VALLEY in box.names:
            i = box.names.index(VALLEY)
            stiffer = root if MOVED in box.names else root**2
            point[i] = same_bulk(point[i], stiffer)
        found += [np.append(point, [strength, time]) for time in times]
    return np.array(found)


def explained_share(objective: Objective, before: FloatArray, after: FloatArray) -> float:
    """Share of a vector's misfit, beyond noise and patterns, that another one removes [-], [k] each."""

    def left(vector: FloatArray) -> float:
        o = objective.with_discrepancy(vector)
        size = np.full(len(o.data), o.shape_discrepancy)
        size[: o.n_force] = o.force_discrepancy
        return float(((size / o.noise) ** 2).sum())

    most = left(before)
    return 1.0 - left(after) / most if most > 0.0 else 0.0


WEAK_STRENGTH = 1e-3
"""Strength of the branches used for the directions [-]. It is small enough to keep the ringing in phase. This
holds even if Poisson's ratio is held and the bulk modulus increases by this share."""
TESTED_TIMES = 7
"""Number of times tried, up to the duration of the window."""


def shot_branch_test(
    runner: Runner, x: FloatArray, objective: Objective, slopes: FloatArray, vector: FloatArray
) -> BranchTest | None:
    """Test the residual of an elastic identification for branches of several relaxation times.

    One run per time is added on the surrogate's mesh. ``x``: the optimum, [d]. ``objective``: with its
    discrepancies. ``slopes``, ``vector``: Jacobian, [k, d], and data on the refined mesh there, [k]. None if
    the shot declares the relaxation, or if a run does not complete.
    """
    numerics, (first, last) = runner.problem.numerics, runner.problem.shot.window
    times = np.geomspace(SHORTEST, last - first, TESTED_TIMES)
    relaxing = _relaxing(runner, {STRENGTH: WEAK_STRENGTH, TIME: float(times[0])})
    if relaxing is None:
        return None
    point = runner.at(x, numerics.mesh)
    columns = {name: np.full(TESTED_TIMES + 1, value) for name, value in point.items()}
    # The first run has no branch but uses the same kernel. The runs therefore differ only in the branch.
    columns[STRENGTH] = np.append(0.0, np.full(TESTED_TIMES, WEAK_STRENGTH))
    columns[TIME] = np.append(times[0], times)
    if VALLEY in runner.problem.box.names:
        columns[VALLEY] = same_bulk(columns[VALLEY], 1.0 + columns[STRENGTH])
    runner.work.progress("relaxation", 0, TESTED_TIMES + 1)
    response = relaxing.run(columns, numerics)
    runner.work.progress("relaxation", TESTED_TIMES + 1, TESTED_TIMES + 1)
    if not response.completed.all():
        return None
    vectors = objective.vectors(predict(response, objective.observations))
    directions = np.nan_to_num(vectors[1:] - vectors[0]) / WEAK_STRENGTH
    residual = np.nan_to_num(objective.data - vector)
    block, whitened = objective.block, objective.whitened
    try:
        blocks = [block // length for length in BLOCKS]
        seed = runner.problem.settings.seed
        return branch_test(
            whitened(residual), whitened(slopes.T).T, whitened(directions), times, blocks=blocks, seed=seed
        )
    except ValueError:  # the free parameters absorb the effect of every branch
        return None


TRY = (
    "if no input is wrong, identify again with --relaxation prony, best several shots of different "
    "speeds together with slow tests; m is then that of the long-term curve. A second shot at a third of "
    "the speed distinguishes the two: m of an elastic model falls with the speed if the material "
    "relaxes, and stays if an input of the rig is wrong"
)


def rate_advice(
    test: BranchTest | None, fit: BranchFit | None = None, *, least: float = 0.0
) -> tuple[str, ...]:
    """Advice if a branch would explain the misfit of an elastic material; empty if chance explains it.

    ``test``: of a weak branch at the elastic optimum. ``fit``: of a branch of any strength, if that test is
    not significant. ``least``: the share of a likely input, to be exceeded.
    """
    if test is not None and test.significant:
        chance = f"{100.0 * test.probability:.2g} % of planted elastic data gain as much"
        return (
            f"a branch that relaxes in about {1e6 * test.time:.2g} us would explain part of the "
            f"misfit of this elastic material ({chance}): {TRY}",
        )
    if fit is not None and fit.asked_for and fit.share > least:
        return (
            f"with a branch of the strength {fit.strength:.2g} that relaxes in about {1e6 * fit.time:.2g} us "
            f"the model explains {100.0 * fit.share:.0f} % of the misfit of this elastic material (AIC "
            f"{fit.aic:+.0f}): {TRY}",
        )
    return ()


def branch_figures(test: BranchTest | None, fit: BranchFit | None) -> dict[str, float]:
    """The numbers on which the advice is based. ``test``, ``fit``: as for `rate_advice`."""
    found = {} if test is None else {"branch_probability": test.probability}
    keys = () if fit is None else ("strength", "time", "share", "aic")
    return found | {f"branch_{key}": getattr(fit, key) for key in keys}


WEAK_START = 0.05
"""Strength of the branch at the start of a search from the elastic optimum [-]."""


def optimum_without_branch(problem: JointProblem, elastic: JointProblem, without: Optimum) -> Optimum | None:
    """The elastic optimum as a point with zero strength; None if the bounds of the strengths exclude zero."""
    bounds = zip(problem.unknowns.names, problem.unknowns.box.lower, strict=True)
    lowest = [low for name, low in bounds if is_strength(name)]
    if not lowest or max(lowest) > 0.0:
        return None
    x = weak_branch(problem, elastic, without.x, strength=0.0)
    vector = problem.vector_for(problem.stack, x, problem.refined, problem.known(x))
    start = weak_branch(problem, elastic, without.start, strength=0.0)
    return Optimum(x, start, vector, without.slopes, None, without.confirmed)


def weak_branch(
    problem: JointProblem, elastic: JointProblem, at: FloatArray, *, strength: float = WEAK_START
) -> FloatArray:
    """A point ``at`` of the problem without relaxation, shape [d], with a weak branch added."""
    names, box = list(problem.unknowns.names), problem.unknowns.box
    x = np.sqrt(np.maximum(np.array(box.lower), 1e-12) * np.array(box.upper))
    for i, name in enumerate(elastic.unknowns.names):
        x[names.index(name)] = at[i]
    strengths = [i for i, name in enumerate(names) if is_strength(name)]
    x[strengths] = strength
    x = points_in_step(names, x[None], strength * len(strengths))[0]
    return np.clip(x, box.lower, box.upper)


def choose_model(
    problem: JointProblem, found: Optimum, elastic: JointProblem, without: Optimum
) -> ModelChoice:
    """Compare the optima with and without relaxation, both on the refined mesh.

    ``elastic``, ``without``: the problem without relaxation and its optimum, with the same shots, slow tests
    and free parameters. Raises ValueError if the other parameters absorb the effect of every weak branch.
    """
    stack, x, vector = elastic.stack, without.x, without.vector
    # The optimum with relaxation, evaluated with the same data, patterns and prior.
    both = [i for i, name in enumerate(problem.unknowns.names) if name in elastic.unknowns.names]
    other = problem.vector_for(stack, found.x, problem.refined, elastic.known(found.x[both]))
    patterns = mesh_patterns(stack, joint_mesh_change(elastic, without))
    more = len(problem.unknowns.names) - len(elastic.unknowns.names)
    lower = deviance_with_mesh_patterns(stack, other, patterns) - deviance_with_mesh_patterns(
        stack, vector, patterns
    )
    if optimum_without_branch(problem, elastic, without) is not None:
        # Zero strength is part of the model with relaxation. Its optimum therefore fits at least as well.
        lower = min(lower, 0.0)
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
    points = relaxing_points(problem, base, (WEAK_STRENGTH,), follow=False)
    weak = points_in_step(names, points, WEAK_STRENGTH)
    bare = elastic.vector_for(stack, without.start, numerics)
    directions = [(problem.vector_for(stack, p, numerics) - bare) / WEAK_STRENGTH for p in weak]
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
        sentence=choice_in_words(aic, test.probability, asked=asked),
    )


def points_in_step(names: Sequence[str], points: FloatArray, strength: float) -> FloatArray:
    """Points with a branch of given strength, shape [n, d]. The bulk modulus is kept if possible."""
    found = points.copy()
    if VALLEY in names:
        found[:, names.index(VALLEY)] = same_bulk(points[:, names.index(VALLEY)], 1.0 + strength)
    return found


def choice_with_mesh_error(choice: ModelChoice, shared: Mapping[str, Estimate]) -> ModelChoice:
    """The choice with the strengths' uncertainties; an effect that the mesh error can cause is rejected.

    So is a branch whose time ends at a bound of its range: a short one is equivalent to damping, a long one
    to a stiffer curve. ``shared``: the shared parameters, corrected for the mesh.
    """
    sizes = [e for name, e in shared.items() if is_strength(name)]
    if not choice.asked_for or not sizes:
        return choice
    strong = [e for e in sizes if e.value > LEAST_STRENGTH * e.sigma]
    rates = [shared.get(rate_of(e.name)) for e in strong]
    if any(e is None or e.outcome is not Verdict.AT_BOUND for e in rates):
        return choice  # a rate is held, or ends inside its range
    if strong:
        rate = rate_of(strong[0].name)
        why = (
            f"{rate} ends at a bound of its range, where a branch is equivalent to damping or to a stiffer "
            f"curve: identify without it, or give another range with --free {rate}"
        )
    else:
        most = max(sizes, key=lambda e: e.value / e.sigma)
        why = (
            f"its strength, {most.value:.2g} with a standard uncertainty of {most.sigma:.2g}, mesh "
            "included, may be zero: identify without it, or refine"
        )
    return replace(choice, asked_for=False, sentence=f"the data do not need relaxation: {why}")


def deviance_with_mesh_patterns(stack: Stack, vector: FloatArray, patterns: FloatArray) -> float:
    """-2 ln L of a vector up to a constant. A point that a run does not reach has zero residual."""
    residual = np.where(np.isnan(vector), 0.0, vector - stack.data)
    return stack.whitening(stack.weighed_beside(residual, patterns), patterns).deviance(residual)


def choice_in_words(aic: float, probability: float, *, asked: bool) -> str:
    """The choice in words."""
    chance = f"{100.0 * probability:.2g} % of planted elastic data improve as much by a branch"
    if asked:
        return f"the data need relaxation (AIC {aic:+.1f}; {chance})"
    return f"the data do not need relaxation (AIC {aic:+.1f}; {chance}): identify without it"
