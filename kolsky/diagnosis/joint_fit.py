"""Tests whether the shared values explain every shot, channel and slow test, and whether the shots agree.

Each residual is compared with that expected of a correct model, as for a single shot
(`kolsky.diagnosis.fit_quality`). The expected residual contains noise, inputs, mesh and declared
uncertainties, after the shared unknowns are refitted. A shot's deviation by the scatter is removed.

The agreement of the shots is tested with the stiffness estimated from each shot separately. This test is
linear about the joint optimum. Let r be the residual, prediction minus data, of one shot. Let u be the change
of its data by a relative change of its stiffness. Then

    a = -u C^-1 r / (u C^-1 u),    Q = sum_k (a_k - mean)^2 / v_k,

where C contains the noise, the patterns and mesh error of the shot, and the discrepancy of the residual after
the fit of a. If the shots agree, Q has a chi-square distribution with n - 1 degrees of freedom. The bulk
modulus is fixed: two specimens of one material differ in stiffness, but not in compressibility.

The scale of each shot's force is estimated in the same way, with the stiffness of the shot free. If one of n
scales is in error by e, Q has a noncentral chi-square distribution with the parameter

    lambda = e^2 / (v_k + 1 / sum_(j != k) 1 / v_j).

The likelihood shows which input of which shot explains a misfit. One change p of one shot's data has a free
amplitude c in addition to the shared unknowns. Discrepancies are estimated again:

    Delta = min_x (-2 ln L) - min_x,c (-2 ln L with r + c p).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf

import numpy as np
from scipy.special import chdtrc, chdtri, chndtrinc, ndtri

from doe.least_squares import Whitening
from kolsky.base.arrays import FloatArray
from kolsky.diagnosis.causes import ALIKE
from kolsky.diagnosis.fit_quality import (
    BLOCKS,
    DECLARED,
    WITHHELD,
    channel_fits,
    information_shares,
    left_over,
    mesh_changes,
    residual_quality,
    unexplained,
)
from kolsky.inverse.joint_problem import SCATTER, JointProblem, ShotData, Stack, covariance
from kolsky.inverse.joint_result import FORCE_SCALE, OwnStiffness, ShotAgreement, ShotCause
from kolsky.inverse.joint_search import Optimum
from kolsky.inverse.objective import Objective
from kolsky.inverse.parameters import MOVED
from kolsky.inverse.result import CURVE, FLYER, FORCE, MESH, OUTLINE, Estimate, FitQuality, Verdict
from kolsky.uncertainty.budgets import as_drawn
from kolsky.uncertainty.mesh_error import MeshChange

SLOW_TEST_LIMIT = 3.0
"""Largest residual of a slow test over that of a correct model [-], as for the force's bins."""
UNLIKELY = 2.7e-3
"""The shots disagree if the probability of their differences is below this. It is that of three standard
deviations, divided among the `TESTS`."""
TESTS = 4
"""Number of agreement tests: stiffness by all data, by the force, by the outline, and scale of the force."""
LEAST_RATIO = 1.05
"""Without a scatter in the interval, two shots can disagree only if their stiffness ratio exceeds this [-].
On coarse meshes, correct shots of different speeds differ by up to 3 %. The same limit holds for scales."""
POWER = 0.9
"""Probability with which a noticeable error of a sensitivity is detected."""
LARGEST_RATIO = 1.5
"""With a larger stiffness ratio than this, two shots are not scattering specimens of one material [-]. Cast
specimens of one batch differ by a few percent, soft biological ones by some 20 %. A wrong sensitivity, unit
or material changes a shot by a factor of two or more."""
ROUGH_LIMIT = 10.0
"""Largest residual, divided by that expected of a correct model, if the noise of front face and curve was not
drawn [-]. In correct shots, that noise is at most about seven times that of the instruments. A wrong curve or
unit gives a factor of about a hundred."""
LEAST_GAIN = 16.0
"""Smallest decrease of -2 ln L by one input of one shot to report it as a cause [-]. It is four standard
deviations for the likeliest of four inputs in a dozen shots."""
LEAST_SHARE = 0.5
"""An input is one of several causes if it explains a smaller share of a channel's squared residual [-]."""


def residual_changes(
    problem: JointProblem, mesh: MeshChange, declared: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """Changes of the whole vector by one standard uncertainty of each source, shape [n, k] each."""
    stack = problem.stack
    front = [stack.placed(k, one.front[:, one.kept]) for k, one in enumerate(stack.shots)]
    own_rows = [
        stack.placed(k, row[None, one.kept])
        for k, one in enumerate(without_scatter(stack).shots)
        for row in one.own.values()
    ]
    changes = {MESH: mesh_changes(mesh)}
    if any(len(rows) for rows in front):
        changes[FLYER] = as_drawn(np.concatenate(front))
    for source, patterns in ((CURVE, stack.curve), ("force scale", stack.common)):
        if patterns is not None and len(patterns):
            changes[source] = as_drawn(stack.padded(patterns))
    rows = [*own_rows, *declared.values()]
    if rows:
        changes[DECLARED] = as_drawn(np.concatenate(rows))
    return changes


def joint_fits(
    problem: JointProblem,
    optimum: Optimum,
    *,
    gain: FloatArray,
    whitening: Whitening,
    objectives: Sequence[Objective],
    changes: Mapping[str, FloatArray],
    scatters: Sequence[float],
) -> tuple[tuple[tuple[FitQuality, ...], ...], tuple[FitQuality, ...]]:
    """The residuals of each shot's channels, and of the slow tests, compared with those of a correct model.

    ``gain``: linear map from a change of the data to the shift of the optimum, [d, k]. ``whitening``,
    ``objectives``: weights of the whole vector and of the shots. ``changes``: `residual_changes`.
    ``scatters``: each shot's deviation by the scatter, in standard deviations.
    """
    stack, names = problem.stack, problem.unknowns.names
    left = {source: left_over(change, optimum.slopes, gain) for source, change in changes.items()}
    spread = gain * whitening.sigma**2
    if whitening.patterns is not None:
        spread = spread + (gain @ whitening.patterns.T) @ whitening.patterns
    everything = np.arange(len(stack.data))
    judged, shots = FLYER in changes, []
    for k, (one, objective, vector) in enumerate(
        zip(stack.shots, objectives, stack.parts(optimum.vector), strict=True)
    ):
        part = stack.place(k)
        middle = part.start + objective.n_force
        masks = {
            FORCE: (everything >= part.start) & (everything < middle),
            OUTLINE: (everything >= middle) & (everything < part.stop),
        }
        row = one.own.get(SCATTER)
        followed = vector if row is None else vector + scatters[k] * row[one.kept]
        fits = channel_fits(
            objective,
            followed,
            left={source: change[..., part] for source, change in left.items()},
            weights=information_shares(gain, spread, masks),
            names=names,
            judged=judged,
        )
        shots.append(fits if judged else tuple(roughly_judged(fit) for fit in fits))
    slow = []
    for label, part in problem.slow_parts():
        sigma = stack.slow_sigma[part.start - stack.ends[-1] : part.stop - stack.ends[-1]]
        fit = slow_fit(
            label,
            (stack.data - optimum.vector)[part] / sigma,
            {source: change[..., part] / sigma for source, change in left.items()},
            peak=float(np.abs(stack.data[part] / sigma).max()),
            judged=judged,
        )
        slow.append(fit)
    return tuple(shots), tuple(slow)


def roughly_judged(fit: FitQuality) -> FitQuality:
    """A channel's fit, with the limit for unknown noise of front face and curve."""
    return replace(fit, limit=ROUGH_LIMIT, slow_limit=ROUGH_LIMIT)


def slow_fit(
    label: str, residual: FloatArray, left: Mapping[str, FloatArray], *, peak: float, judged: bool
) -> FitQuality:
    """Judge a slow test by its residual and the parts expected from each source, in units of its sigma.

    ``label``: its label. ``residual``: measurement minus model, [n]. ``left``: by source, one standard
    uncertainty of the residual of a correct model, [m, n] or [n]. ``peak``: largest value [-]. ``judged``:
    False for the limit `ROUGH_LIMIT`, if `left` lacks the noise of front face and curve.
    """
    n = len(residual)
    block = np.minimum(BLOCKS * np.arange(n) // max(n, 1), BLOCKS - 1)
    limit = SLOW_TEST_LIMIT if judged else ROUGH_LIMIT
    return residual_quality(
        residual,
        np.ones(n),
        left,
        channel=label,
        unit="1",
        block=np.unique(block, return_inverse=True)[1],
        pairs=(np.arange(n - 1), np.arange(1, n)),
        peak=peak,
        limit=limit,
        slow_limit=limit,
    )


def own_stiffnesses(
    problem: JointProblem, optimum: Optimum, mesh: MeshChange, declared: Mapping[str, FloatArray]
) -> tuple[OwnStiffness, ...]:
    """Stiffness from each shot separately, by all its data and by each channel, and its force's scale."""
    stack = problem.stack
    change = problem.unknowns.relative_stiffness(optimum.slopes, optimum.x)
    own_errors = [rows for rows in declared.values() if len(rows) == len(stack.shots)]
    more = np.concatenate([mesh_changes(mesh), *own_errors])
    bare = without_scatter(stack).shots
    shots = []
    for k, (one, vector, u) in enumerate(
        zip(bare, stack.parts(optimum.vector), stack.parts(change), strict=True)
    ):
        place = stack.place(k)
        residual, rows = vector - stack.data[place], more[:, place]
        found = [own_amount(one, residual, u[None], rows, channel) for channel in ("joint", FORCE, OUTLINE)]
        scales = np.stack([u, np.where(one.objective.mask("force"), vector, 0.0)])
        found.append(own_amount(one, residual, scales, rows, "joint"))
        shots.append(OwnStiffness(*(number for pair in found for number in pair)))
    return tuple(shots)


ROUNDS = 4
"""Iterations of discrepancy and stiffness. The third does not change a printed digit."""
BLANK = 1e6
"""Factor on the standard deviation of excluded data."""


def own_amount(
    one: ShotData, residual: FloatArray, changes: FloatArray, patterns: FloatArray, channel: str
) -> tuple[float, float]:
    """Amount of the last of some changes of a shot's data, and its standard uncertainty; NaN if not measured.

    With the change by a relative change of its stiffness, it is the relative stiffness minus the shared one.
    ``residual``: prediction minus data, [k]. ``changes``: of its data by a unit each, [m, k]. ``patterns``:
    further errors, one standard deviation per row, [n, k]. ``channel``: "joint", "force" or "outline".
    """
    objective, variance = one.objective, float("nan")
    amounts: FloatArray = np.zeros(len(changes))
    use = {FORCE: objective.mask("force"), OUTLINE: objective.mask("shape")}.get(
        channel, objective.mask("joint")
    )
    if not (changes[:, use] != 0.0).any(axis=1).all():
        return float("nan"), float("nan")
    alone = Stack((one,), np.zeros(0), np.zeros(0), known=0)
    for _ in range(ROUNDS):
        weighed = objective.with_discrepancy(objective.data + residual + amounts @ changes)
        sigma = np.where(use, weighed.own_sigma, BLANK * weighed.own_sigma)
        whitening = Whitening(sigma, np.concatenate([weighed.common, patterns]) * use)
        found = -np.linalg.lstsq(whitening.apply(changes).T, whitening.apply(residual))[0]
        amounts = np.asarray(found, dtype=np.float64)
        left = residual + amounts @ changes
        widths = np.full(len(changes), inf)
        variance = covariance(changes.T, left * use, whitening, alone, widths)[-1, -1]
    return float(amounts[-1]), float(np.sqrt(variance))


def shot_agreement(
    names: Sequence[str], stiffnesses: Sequence[OwnStiffness], *, scatter: bool
) -> ShotAgreement | None:
    """Test whether the shots agree in stiffness and scale, and which shot does not; None for one shot.

    All data, the force and the outline are tested separately, because the weights of a fit reduce the
    influence of a channel that disagrees in one shot. A stiffer specimen changes force and outline, and the
    period of the force; the scale of the force does not scatter between specimens. The least likely channel
    is given. ``scatter``: True if the interval includes a scatter; only larger differences contradict it.
    """
    force, outline, scale = (
        np.array([(getattr(one, name), getattr(one, f"sigma_{name}")) for one in stiffnesses]).T
        for name in (FORCE, OUTLINE, "scale")
    )
    whole = np.array([(one.value, one.sigma) for one in stiffnesses]).T
    tested = []
    for channel, (a, s), scatters in (
        ("", whole, scatter),
        (FORCE, force, scatter),
        (OUTLINE, outline, scatter),
        (FORCE_SCALE, scale, False),
    ):
        use = np.flatnonzero(np.isfinite(a) & np.isfinite(s) & (s > 0.0))
        if len(use) >= 2:
            used_names = [names[k] for k in use.tolist()]
            tested.append(_agreement(used_names, a[use], s[use], channel, scatter=scatters))
    contradicting = [one for one in tested if one.apart]
    likeliest = min(contradicting or tested, key=lambda one: one.probability, default=None)
    return likeliest and replace(likeliest, noticeable=noticeable_scales(scale[1]))


def noticeable_scales(sigma: FloatArray) -> tuple[float, ...]:
    """Smallest error of each shot's force scale that the test of the scales detects with `POWER` [-].

    The chi-square must exceed its limit, and the ratio of the scales `LEAST_RATIO`. ``sigma``: of the scales,
    [n]. Infinite for a shot whose scale, or all others of which, is unknown.
    """
    known = np.where(np.isfinite(sigma) & (sigma > 0.0), sigma, inf)
    weight, freedom = known**-2.0, int(np.isfinite(known).sum()) - 1
    if freedom < 1:
        return (inf,) * len(sigma)
    with np.errstate(divide="ignore"):
        apart = np.sqrt(known**2 + 1.0 / (weight.sum() - weight))
    distance = np.sqrt(chndtrinc(chdtri(freedom, UNLIKELY / TESTS), freedom, 1.0 - POWER))
    return tuple(np.maximum(distance * apart, LEAST_RATIO - 1.0 + ndtri(POWER) * apart).tolist())


def _agreement(
    names: Sequence[str], a: FloatArray, s: FloatArray, channel: str, *, scatter: bool
) -> ShotAgreement:
    """The test of one channel: chi-square of n estimates about their weighted mean."""
    chi2, freedom = _chi_square(a, s), len(a) - 1
    probability = float(chdtrc(freedom, chi2))
    low, high = 1.0 + float(a.min()), 1.0 + float(a.max())
    ratio = high / low if low > 0.0 else inf  # of the stiffest shot over the softest
    culprits: tuple[str, ...] = ()
    if probability < UNLIKELY / TESTS and ratio > (LARGEST_RATIO if scatter else LEAST_RATIO):
        # the shot without which the others agree best; both of two
        others = [np.arange(len(a)) != i for i in range(len(a))]
        farthest = int(np.argmin([_chi_square(a[use], s[use]) for use in others]))
        culprits = tuple(names) if len(a) == 2 else (names[farthest],)
    return ShotAgreement(chi2, freedom, probability, ratio, culprits, channel)


def _chi_square(a: FloatArray, s: FloatArray) -> float:
    """Sum of squared distances from the weighted mean, each divided by its variance."""
    weight = s**-2.0
    mean = float(weight @ a) / float(weight.sum())
    return float(weight @ (a - mean) ** 2)


def without_scatter(stack: Stack) -> Stack:
    """The stack without scatter of the stiffness of shots and slow tests."""
    shots = tuple(
        replace(one, own={name: row for name, row in one.own.items() if name != SCATTER})
        for one in stack.shots
    )
    return replace(stack, shots=shots, slow_scatter=None)


def shot_causes(problem: JointProblem, optimum: Optimum, errors: FloatArray) -> tuple[ShotCause, ...]:
    """The part of the misfit that each single input of each shot explains, the likeliest first.

    ``errors``: changes of the whole vector by the mesh error, [n, k], as separate errors of each shot.
    Without them in the weights, an input of any shot would explain them.
    """
    stack = problem.stack
    bare, meshed = without_scatter(stack), stack.of_each(*errors)
    residual = optimum.vector - stack.data
    stiffer = None
    if MOVED in problem.unknowns.names or problem.unknowns.nodes:
        stiffer = problem.unknowns.relative_stiffness(optimum.slopes, optimum.x)
    before = explained_by(bare, residual, optimum.slopes.T, meshed)[2]
    found = []
    for k, shot in enumerate(problem.shots):
        lag = likely_lag(bare, k, optimum.vector)
        late = shifted_force(bare, k, optimum.vector, lag)
        for key, change in input_changes(bare, k, optimum.vector, late, stiffer).items():
            start = lag if key == "clock_offset" else 0.0
            first = residual + late - optimum.vector if key == "clock_offset" else residual
            amount, sigma, after, left = explained_by(
                bare, first, np.concatenate([optimum.slopes.T, change[None]]), meshed
            )
            share = explained_share(stack.parts(residual)[k], stack.parts(left)[k], bare.shots[k])
            found.append(ShotCause(shot.name, key, start + amount, sigma, before - after, share))
    return tuple(sorted(found, key=lambda cause: -cause.gain))


def explained_share(before: FloatArray, after: FloatArray, one: ShotData) -> float:
    """Explained share of a channel's squared residual; the larger one of force and outline [-].

    Another stiffness rings at another frequency; a linear change explains it in the outline only.
    """
    n = one.objective.n_force
    channels = [slice(0, n), slice(n, None)][: 1 + (len(before) > n)]
    return max(1.0 - float((after[c] ** 2).sum() / (before[c] ** 2).sum()) for c in channels)


LARGEST_LAG = 0.2
"""Largest clock error of a force record in the search, as a share of the record's duration [-]."""


def shifted_force(stack: Stack, k: int, vector: FloatArray, lag: float) -> FloatArray:
    """All data with the force of one shot delayed by a lag [s], shape [k]."""
    found, place = vector.copy(), stack.place(k)
    for bins, part in stack.shots[k].observations.force_parts():
        found[place][part] = np.interp(bins.centres - lag, bins.centres, vector[place][part])
    return found


def likely_lag(stack: Stack, k: int, vector: FloatArray) -> float:
    """The lag at which the predicted force of a shot is nearest to the measured one [s], by half bins."""
    one, start = stack.shots[k], stack.place(k).start
    force = slice(start, start + one.objective.n_force)
    times = one.observations.bins.edges
    width, reach = float(np.diff(times).mean()), LARGEST_LAG * float(times[-1] - times[0])
    lags = 0.5 * width * np.arange(-int(2.0 * reach / width), int(2.0 * reach / width) + 1)
    apart = [((shifted_force(stack, k, vector, lag) - stack.data)[force] ** 2).sum() for lag in lags]
    return float(lags[int(np.argmin(apart))])


def input_changes(
    stack: Stack, k: int, vector: FloatArray, late: FloatArray, stiffer: FloatArray | None
) -> dict[str, FloatArray]:
    """Changes of all data by a unit of each input of a shot that needs no run, shape [k] each.

    ``late``: the data with the force at its likely lag, about which the clock effect is linear. ``stiffer``:
    change of all data by a relative change of the stiffness; None if it is not shared.
    """
    one, place = stack.shots[k], stack.place(k)
    n, clock = one.objective.n_force, np.zeros_like(vector)
    force, lengths = stack.of_shot(k, vector), stack.of_shot(k, vector)
    force[place][n:] = 0.0
    lengths[place][:n] = 0.0
    for bins, part in one.observations.force_parts():
        clock[place][part] = -np.gradient(late[place][part], bins.centres)
    found = {"sensitivity": force, "clock_offset": clock}
    found |= {} if len(one.objective.data) == n else {"lengths of the outline": lengths}
    return found if stiffer is None else {**found, "material": stack.of_shot(k, stiffer)}


def explained_by(
    stack: Stack, residual: FloatArray, patterns: FloatArray, errors: FloatArray
) -> tuple[float, float, float, FloatArray]:
    """Fit patterns of free amplitude to a residual, with weights from the remaining residual.

    The discrepancies are what the errors do not explain of it. ``residual``: prediction minus data, [k].
    ``patterns``, ``errors``: changes of the prediction, and further errors of one standard deviation, one per
    row. Returns: amplitude and sigma of the last one, -2 ln L, and the remaining residual, [k].
    """

    def weighting(left: FloatArray) -> Whitening:
        return stack.whitening(stack.weighed_beside(left, errors), errors)

    left, amounts, sigma = residual, np.zeros(len(patterns)), 0.0
    for _ in range(ROUNDS):
        whitening = weighting(left)
        rows, r = whitening.apply(patterns), whitening.apply(residual)
        size = np.maximum(np.linalg.norm(rows, axis=1), np.finfo(float).tiny)
        scaled = (rows / size[:, None]).T
        amounts = -np.linalg.lstsq(scaled, r, rcond=None)[0] / size
        sigma = float(np.sqrt(np.linalg.pinv(scaled.T @ scaled)[-1, -1]) / size[-1])
        left = residual + amounts @ patterns
    return float(amounts[-1]), sigma, weighting(left).deviance(left), left


def joint_verdict(e: Estimate, fits: Sequence[FitQuality], agreement: ShotAgreement | None) -> Estimate:
    """A shared value with its verdict by fit and agreement, most serious first."""
    if e.outcome not in WITHHELD:
        return e
    if not all(fit.explained for fit in fits):
        return replace(e, outcome=Verdict.UNEXPLAINED)
    if agreement is not None and agreement.apart:
        return replace(e, outcome=Verdict.SHOTS_CONTRADICT)
    return e


def joint_fit_warnings(
    names: Sequence[str],
    shots: Sequence[tuple[FitQuality, ...]],
    slow: Sequence[FitQuality],
    agreement: ShotAgreement | None,
    causes: Sequence[ShotCause] = (),
) -> list[str]:
    """Reasons for withholding the answer, one sentence each."""
    said = [
        f"{name}: {unexplained(fit)}"
        for name, fits in zip(names, shots, strict=True)
        for fit in fits
        if not fit.explained
    ]
    said += [
        f"slow test {unexplained(fit)}: check its unit, its sigma and that it is of this material"
        for fit in slow
        if not fit.explained
    ]
    if agreement is not None and agreement.apart:
        said.append(agreement.sentence)
    if causes:
        said.append(cause_sentence(causes))
    return said


def cause_sentence(causes: Sequence[ShotCause]) -> str:
    """The best cause of the misfit, those that the data cannot distinguish from it, and the next one.

    Causes are those of `shot_causes`. Of two shots, a stiffer one is the same as the other one softer.
    """
    named = [one for one in causes if one.gain >= LEAST_GAIN]
    named.sort(key=lambda one: one.share < LEAST_SHARE)  # those that explain a channel come first
    if not named:
        return "no single input of one shot explains the misfit: identify the shots one by one"
    first = named[0]
    alike = [one for one in named if abs(one.gain - first.gain) <= ALIKE]
    rest = [one for one in named if one not in alike]
    numbers = f"explains {100.0 * first.share:.0f} % of a squared residual; -2 ln L falls by {first.gain:.3g}"
    following = f"; next: {rest[0].words} ({rest[0].gain:.3g})" if rest else ""
    partly = ""
    if first.share < LEAST_SHARE:
        partly = f"; most of the misfit remains: identify {first.shot} alone, which tries every input"
    words = "; or ".join(one.words for one in alike)
    return f"the likeliest cause is {words} ({numbers}){following}{partly}"
