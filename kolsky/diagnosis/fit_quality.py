"""Goodness of fit by channel, and verdicts: whether the model explains the data.

The residual of a correct model has four parts: measured noise, effect of the inputs' noise, mesh error, and
effect of declared uncertainties. Actual and expected residual are compared point by point and in means over
time blocks. A wrong input shifts the residual over a whole block. If the fit is not good enough, the verdicts
are withheld and the reasons are given.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf
from typing import Any

import numpy as np
from scipy.special import chdtrc

from kolsky.base.arrays import BoolArray, FloatArray, IntArray
from kolsky.inverse.objective import Objective
from kolsky.inverse.result import (
    DECLARED,
    FLYER,
    FORCE,
    LATE,
    MESH,
    NOISE,
    OUTLINE,
    ClockLag,
    Estimate,
    FitQuality,
    Identification,
    Verdict,
)
from kolsky.inverse.valleys import LEAST_MARGIN, VALLEY
from kolsky.uncertainty.budgets import Sources
from kolsky.uncertainty.input_changes import in_quadrature
from kolsky.uncertainty.mesh_error import ELEMENT_ORDER, MeshChange

ORDER = 2.0
"""Order of the mesh error in the data vector. Ringing converges more slowly than the parameters."""
BETWEEN = 3.0**0.5
"""Distance of the two elements' data, divided by the standard uncertainty of one of them. The truth is taken
as uniformly distributed between them. Its root mean square distance from one end is smaller by the factor
root 3."""


def residual_sources(sources: Sources) -> dict[str, FloatArray]:
    """Changes of the predicted data vector by one standard uncertainty of each source, [n, k] or [k]."""
    inputs = sources.inputs
    found = {name: change for name, change in inputs.replicates.items() if len(change)}
    found |= {**inputs.scales, MESH: mesh_changes(sources.mesh)}
    if sources.declared is not None and len(sources.declared):
        found[DECLARED] = sources.declared
    return found


def mesh_changes(mesh: MeshChange) -> FloatArray:
    """Remaining errors of the refined mesh's data vector, by mesh and element in quadrature, [n, k]."""
    coarser = mesh.coarser / (mesh.ratio**ORDER - 1.0)
    rows = [coarser if mesh.graded is None else mesh.graded.error]
    if mesh.element is not None:
        rows.append(mesh.element / (BETWEEN * mesh.ratio**ELEMENT_ORDER))
    return in_quadrature(rows)


LIMITS = {"force": 3.0, "outline": 2.0}
"""Largest residual divided by that expected of a correct model, by channel [-]."""
SLOW_LIMITS = {"force": 3.0, "outline": 3.0}
"""The same limit for the means over blocks [-]."""
ALONE = 0.1
"""A channel does not determine the value of a parameter if its share of the information is below this."""
CHECKS = 2.0
"""Such a channel still confirms the value with at most this many times the answer's uncertainty."""
CONTRADICTION = 4.0
"""Force and outline contradict each other beyond this many standard uncertainties of their difference."""
UNEXPLAINED = 2.5
"""Misfit of a channel above which large changes of inputs are tried. 1 is the residual of a correct model.
Below this value, a linear step is enough."""


BLOCKS = 8
"""Number of time blocks over which residuals are averaged. Each is about 170 us, a few ringing periods."""
BANDS = 3
"""Number of height bands in which the outline points of a block are averaged."""


def fit_quality(
    objective: Objective,
    vector: FloatArray,
    jacobian: FloatArray,
    *,
    changes: Mapping[str, FloatArray],
    names: tuple[str, ...] = (),
) -> tuple[FitQuality, ...]:
    """Judge the residual of each measured channel: force, then outline if it was measured.

    ``objective``: with the discrepancies of the optimum. ``vector``, ``jacobian``: predicted data vector at
    the optimum, [k], and its slopes by the free parameters, [k, d]. ``changes``: by source, changes of that
    vector by one standard uncertainty: draws of a noise, [n, k], or one change, [k]; not finite at a point
    that a run does not reach. Without the flyer's noise, no limit is set, because too much is missing.
    ``names``: the free parameters, for their shares of information; a shorter tuple omits the last ones.
    """
    gain = objective.gain(jacobian)
    left = {source: left_over(change, jacobian, gain) for source, change in changes.items()}
    spread = objective.spread(gain)
    weights = information_shares(gain, spread, {c: _mask(objective, c) for c in (FORCE, OUTLINE)})
    return channel_fits(objective, vector, left=left, weights=weights, names=names, judged=FLYER in changes)


def channel_fits(
    objective: Objective,
    vector: FloatArray,
    *,
    left: Mapping[str, FloatArray],
    weights: Mapping[str, FloatArray],
    names: tuple[str, ...],
    judged: bool,
) -> tuple[FitQuality, ...]:
    """Judge the residual of each measured channel against the part expected from each source.

    ``objective``, ``vector``, ``names``: as for `fit_quality`. ``left``: by source, the part of its changes
    that the free parameters do not absorb, shape [n, k] or [k]. ``weights``: by channel, its share of the
    information on each parameter. ``judged``: True to set limits.
    """
    residual = objective.data - vector
    found = []
    for channel, unit in ((FORCE, "N"), (OUTLINE, "m")):
        use = _mask(objective, channel)
        if use.any():
            one = residual_quality(
                residual[use],
                objective.noise[use],
                {source: change[..., use] for source, change in left.items()},
                channel=channel,
                unit=unit,
                block=blocks(objective, channel),
                pairs=neighbours(objective, channel),
                tau=objective.force_discrepancy if channel == FORCE else objective.shape_discrepancy,
                peak=peak(objective.data[use], channel),
                weight=dict(zip(names, weights[channel].tolist(), strict=False)),
                limit=LIMITS[channel] if judged else inf,
                slow_limit=SLOW_LIMITS[channel] if judged else inf,
            )
            found.append(one)
    return tuple(found)


def residual_quality(
    residual: FloatArray,
    noise: FloatArray,
    left: Mapping[str, FloatArray],
    *,
    block: IntArray,
    pairs: tuple[IntArray, IntArray],
    tau: float = 0.0,
    **known: Any,
) -> FitQuality:
    """Judge one residual, shape [n], against its noise and the part expected from each source.

    ``left``: as for `channel_fits`. ``block``: block of each value, shape [n]. ``pairs``: rows of neighbours.
    ``tau``: discrepancy. ``known``: the other fields of the result.
    """
    slow = [root_mean_square(block_means(change, block)) for change in left.values()]
    correlation, whiteness = correlated(residual / noise, *pairs)
    return FitQuality(
        values=len(residual),
        residual=root_mean_square(residual),
        predicted={
            NOISE: root_mean_square(noise),
            **{source: root_mean_square(change) for source, change in left.items()},
        },
        slow_residual=root_mean_square(block_means(residual, block)),
        slow_expected=float(np.hypot.reduce([block_noise(noise, block), *slow])),
        chi2=float(((residual / noise) ** 2).mean()),
        discrepancy_share=float(tau**2 / (tau**2 + (noise**2).mean())),
        correlation=correlation,
        whiteness=whiteness,
        **known,
    )


def left_over(change: FloatArray, jacobian: FloatArray, gain: FloatArray) -> FloatArray:
    """A change minus the part that the parameters absorb, ``c - J G c``; entries not finite count as 0."""
    change = np.nan_to_num(np.asarray(change, dtype=np.float64), nan=0.0, posinf=0.0, neginf=0.0)
    return np.asarray(change - (change @ gain.T) @ jacobian.T)


def information_shares(
    gain: FloatArray, spread: FloatArray, masks: Mapping[str, BoolArray]
) -> dict[str, FloatArray]:
    """Share of each channel in the information on each parameter, with the other parameters fitted too.

    The variance of parameter i is the sum over the data of ``g_ik (C g_i)_k`` with the gain g and the data's
    covariance C; for independent data, the term is ``(g_ik sigma_k)^2``. The shares sum to one. Data that
    only remove a common error from others have a negative share. NaN: without effect.
    """
    parts = gain * spread
    total = parts.sum(axis=1)
    total[total == 0.0] = np.nan
    return {channel: parts[:, use].sum(axis=1) / total for channel, use in masks.items()}


def correlated(residual: FloatArray, first: IntArray, second: IntArray) -> tuple[float, float]:
    """Correlation of neighbours, and the probability that white noise has at least this correlation.

    Ljung and Box (1978) with one lag: ``Q = n (n + 2) / (n - 1) r^2`` with n - 1 pairs has the chi-square
    distribution with one degree of freedom. ``residual``: in units of its noise, [k]; its mean is zero for a
    correct model and not subtracted. ``first``, ``second``: rows of the neighbours of each pair, [n_pairs].
    """
    if first.size < 2:
        return float("nan"), float("nan")
    pairs = np.union1d(first, second)
    square = float((residual[pairs] ** 2).mean())
    if not square > 0.0:
        return float("nan"), float("nan")
    n = first.size + 1
    r = float((residual[first] * residual[second]).sum()) / (n * square)
    return r, float(chdtrc(1.0, n * (n + 2.0) / (n - 1.0) * r**2))


def blocks(objective: Objective, channel: str) -> IntArray:
    """Number of the block of each entry of a channel, counted from 0 without gaps, shape [n].

    Blocks have equal time spans. The lowest, middle and highest third of a frame's points are apart.
    """
    times = objective.times[_mask(objective, channel)]
    span = max(float(np.ptp(times)), np.finfo(float).tiny)
    block = np.minimum((BLOCKS * (times - times.min()) / span).astype(np.int64), BLOCKS - 1)
    if channel == OUTLINE:
        line, rows = objective.observations.centre_line, np.flatnonzero(objective.counted)
        order = np.lexsort((line.y[rows], line.frame[rows]))
        _, first, size = np.unique(line.frame[rows][order], return_index=True, return_counts=True)
        rank = np.empty(len(rows), dtype=np.int64)
        rank[order] = (BANDS * (np.arange(len(rows)) - np.repeat(first, size))) // np.repeat(size, size)
        block = BANDS * block + rank
    return np.asarray(np.unique(block, return_inverse=True)[1])


def block_means(values: FloatArray, block: IntArray) -> FloatArray:
    """Means over the blocks, shape [..., n_blocks], of values of shape [..., n]."""
    rows = np.atleast_2d(values)
    means = np.array([np.bincount(block, weights=row) for row in rows]) / np.bincount(block)
    return means if np.ndim(values) > 1 else means[0]


def block_noise(sigma: FloatArray, block: IntArray) -> float:
    """Standard deviation of a block's mean of independent noise, root mean square over the blocks."""
    return float(np.sqrt(np.mean(np.bincount(block, weights=sigma**2) / np.bincount(block) ** 2)))


def neighbours(objective: Objective, channel: str) -> tuple[IntArray, IntArray]:
    """Rows of neighbours in a channel: force bins in time, or points along one frame's outline."""
    if channel == FORCE:
        rows = np.arange(objective.n_force)
        return rows[:-1], rows[1:]
    line, rows = objective.observations.centre_line, np.flatnonzero(objective.counted)
    order = np.lexsort((line.y[rows], line.frame[rows]))
    same = np.diff(line.frame[rows][order]) == 0
    return order[:-1][same], order[1:][same]


def peak(data: FloatArray, channel: str) -> float:
    """Largest size of a signal: the largest force, or the spread of the outline's radii."""
    return float(np.abs(data).max()) if channel == FORCE else float(np.ptp(data))


def root_mean_square(values: FloatArray) -> float:
    """Root mean square over all entries."""
    return float(np.sqrt(np.mean(np.square(values))))


def _mask(objective: Objective, channel: str) -> BoolArray:
    return objective.mask("force" if channel == FORCE else "shape")


ALONE_BY = {FORCE: Verdict.FORCE_ALONE, OUTLINE: Verdict.OUTLINE_ALONE}
"""The verdict on a value that one channel determines."""
OTHER_CHANNEL = {FORCE: OUTLINE, OUTLINE: FORCE}
"""The channel that may confirm it."""
ROUTES = {FORCE: "force only", OUTLINE: "shape only"}
"""The route of each single channel."""
WITHHELD = (Verdict.IDENTIFIED, Verdict.FORCE_ALONE, Verdict.OUTLINE_ALONE, Verdict.CONDITIONAL)
"""Verdicts that a poor fit may replace. The other verdicts are already negative."""
EDGE = 1e-4
"""A value lies at the end of the searched range if its distance is below this share of the range."""
UNITS = {"N": (1.0, "N"), "m": (1e6, "um"), "1": (1.0, "sigma")}
"""Factor and unit in which a residual is printed."""


def with_verdicts(result: Identification) -> Identification:
    """The result with other verdicts if the fit is not good enough."""
    estimates = {name: replace(e, outcome=verdict(result, e)) for name, e in result.estimates.items()}
    return replace(result, estimates=estimates)


def verdict(result: Identification, e: Estimate) -> Verdict:
    """The verdict on one parameter, most serious first: not explained, contradicted, not distinguished from a
    bound of its design or from another valley, identified by one channel only.
    """
    if e.outcome not in WITHHELD:
        return e.outcome
    if not all(channel.explained for channel in result.fit):
        return Verdict.UNEXPLAINED
    if routes_apart(result, e.name) > CONTRADICTION and not route_at_edge(result, e.name):
        return Verdict.CONTRADICTED
    if reaches_bound(result, e):
        return Verdict.BOUND_REACHED
    if e.name == VALLEY and result.surrogate.get("valley_margin", inf) < LEAST_MARGIN:
        return Verdict.OTHER_VALLEY
    if e.outcome is Verdict.IDENTIFIED:
        for channel in result.fit:
            if 1.0 - channel.weight.get(e.name, 0.5) < ALONE and not checked(result, e.name, channel.channel):
                return ALONE_BY[channel.channel]
    return e.outcome


def checked(result: Identification, name: str, channel: str) -> bool:
    """True if the other channel separately determines a parameter well enough to contradict this one.

    The weights include common errors. A channel may therefore have almost no weight in the answer, although
    it separately determines the value nearly as well: its standard uncertainty is at most `CHECKS` times the
    answer's, and its optimum lies inside the searched range.
    """
    routes = {route.name: route.sigma.get(name, inf) for route in result.routes}
    joint, other = routes.get("joint", 0.0), routes.get(ROUTES[OTHER_CHANNEL[channel]], inf)
    return 0.0 < other <= CHECKS * joint and not route_at_edge(result, name)


def reaches_bound(result: Identification, e: Estimate) -> bool:
    """True if the k = 2 interval extends beyond a bound of the parameter's design, without runs."""
    i = result.design.names.index(e.name)
    # The printed interval is limited to the searched range.
    low, high = e.value - 2.0 * e.sigma, e.value + 2.0 * e.sigma
    return low < result.design.lower[i] or high > result.design.upper[i]


def explains(fit: Sequence[FitQuality]) -> bool:
    """True if every channel is explained within limits that were set."""
    return bool(fit) and all(f.explained and f.limit < inf for f in fit)


def near_right(fit: Sequence[FitQuality]) -> bool:
    """True if limits were set, and the squared excess of every channel is at most `UNEXPLAINED`."""
    return explains(fit) and all(max(f.excess, f.slow_excess) ** 2 <= UNEXPLAINED for f in fit)


def routes_apart(result: Identification, name: str) -> float:
    """Force-only minus outline-only value, divided by the uncertainty of the difference [-]; 0 if unknown."""
    found = result.route_difference
    if found is None or not found.sigma.get(name, 0.0) > 0.0:
        return 0.0
    return abs(found.values[name]) / found.sigma[name]


def route_at_edge(result: Identification, name: str) -> bool:
    """True if the optimum by force or by outline lies at an edge of the searched box."""
    routes = {route.name: route for route in result.routes}
    ends = [routes[key].on_mesh(name) for key in ROUTES.values() if key in routes]
    boxes = [(curve.x[0], curve.x[-1]) for curve in result.curves if curve.parameter == name]
    return any(min(x - low, high - x) <= EDGE * (high - low) for low, high in boxes for x in ends)


def fit_warnings(result: Identification) -> Iterator[str]:
    """Warnings on withheld verdicts, wrong clocks, and values determined by one channel only."""
    for channel in result.fit:
        if not channel.explained:
            yield unexplained(channel)
    yield from late_clocks(result)
    for name, e in result.estimates.items():
        if e.outcome is Verdict.CONTRADICTED:
            yield (
                f"force and outline give values of {name} that are further apart than {CONTRADICTION:g} "
                "standard uncertainties of their difference: at least one input, or the model, is wrong"
            )
    for channel in result.fit:
        other = OTHER_CHANNEL[channel.channel]
        names = [
            name
            for name, e in result.estimates.items()
            if len(result.fit) > 1
            and channel.weight.get(name, 0.5) < ALONE
            and e.outcome not in ALONE_BY.values()
            and not checked(result, name, other)
        ]
        if names:
            shares = ", ".join(f"{100.0 * channel.weight[name]:.2g} %" for name in names)
            yield (
                f"the {channel.channel} carries {shares} of the information on {', '.join(names)}: the "
                f"answer comes from the {other} alone"
            )


def unexplained(channel: FitQuality) -> str:
    """The reason for rejecting a fit, in numbers. For a slow test they are in units of its sigma."""
    factor, unit = UNITS[channel.unit]
    reasons = []
    if not channel.excess <= channel.limit:
        reasons.append(
            f"its residual, {factor * channel.residual:.3g} {unit} rms, is {channel.excess:.3g} times the "
            f"residual expected of a correct model from noise, inputs and mesh (at most {channel.limit:g})"
        )
    if not channel.slow_excess <= channel.slow_limit:
        reasons.append(
            f"averaged over an eighth of the window its residual, {factor * channel.slow_residual:.3g} "
            f"{unit} rms, is {channel.slow_excess:.3g} times that (at most {channel.slow_limit:g})"
        )
    return f"the model does not explain the {channel.channel}: {'; '.join(reasons)}; do not use the value"


def late_clocks(result: Identification) -> Iterator[str]:
    """Warning on a late recording, if the lag is significant and its correction explains the data.

    Otherwise another input is wrong, and the best-fitting lag is not reported.
    """
    lag = leading_lag(result.clocks)
    if lag is not None and lag.significance > LATE and lag.explains:
        others = {"force": "the motion", "outline": "the flyer", "flyer": "force and outline"}
        late = "late" if lag.lag > 0.0 else "early"
        yield (
            f"the {lag.recording} was recorded {1e6 * abs(lag.lag):.3g} +- {2e6 * lag.sigma:.2g} us (k = 2) "
            f"too {late} against {others[lag.recording]}: check the times of {lag.file} and {lag.key}"
        )


def leading_lag(clocks: tuple[ClockLag, ...]) -> ClockLag | None:
    """The lag that explains most of the misfit; None if none was recorded."""
    return max(clocks, key=lambda lag: lag.evidence, default=None)
