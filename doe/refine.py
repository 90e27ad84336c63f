"""Adaptive refinement: new runs are made where a smaller misfit is expected or possible, until the optimum is
stable.

Each round runs the surrogate's optimum and points whose misfit, within the surrogate's error, may be as low.
The surrogate is rebuilt from the runs of a region that shrinks around the optimum, and searched again.
Refinement ends when new runs at the optimum do not change it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy  # statistics load on first use, see `doe.designs`
from numpy.typing import ArrayLike

from doe.arrays import FloatArray
from doe.box import Box
from doe.least_squares import BatchRun
from doe.surrogates.process import ProcessSurrogate

Misfit = Callable[[FloatArray], FloatArray]
"""Misfit of responses [n, k], shape [n], to be minimised: a deviance, i.e. minus twice a log-likelihood."""

CANDIDATES = 96
"""Points among which the new runs are chosen."""
DRAWS = 8
"""Responses drawn at each candidate, for the spread of its misfit."""
BOUND = 2.0
"""The lower bound of the misfit lies this many standard deviations below its mean."""
_MINIMUM_DISTANCE = 0.08
"""Smallest distance of two new runs over the region's edge."""


def choose(
    surrogate: ProcessSurrogate,
    region: Box,
    best: FloatArray,
    misfit: Misfit,
    size: int,
    rng: np.random.Generator,
) -> FloatArray:
    """The optimum and the candidates with the lowest bound of the misfit, chosen one by one, shape [n, d].
    After each choice the surrogate is assumed to be exact at that point, which reduces its error around the
    point (the kriging believer). Fewer than ``size`` are chosen if the region has no room for more."""
    unit = np.concatenate([region.unit(best)[None], _candidates(region, best, rng)])
    x = region.scale(unit)
    draws = scipy.stats.norm.ppf(scipy.stats.qmc.Sobol(surrogate.n_components, rng=rng).random(DRAWS))
    means = surrogate.scores(x)
    chosen = [0]
    while len(chosen) < size:
        apart = np.abs(unit[:, None] - unit[chosen]).max(axis=2).min(axis=1) > _MINIMUM_DISTANCE
        if not apart.any():
            break
        spread = surrogate.believing(x[chosen]).score_sigma(x[apart])
        bound = _lower_bound(surrogate, means[apart], spread, draws, misfit)
        chosen.append(int(np.flatnonzero(apart)[np.argmin(bound)]))
    return x[chosen]


def _candidates(region: Box, best: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Points of the unit region: half evenly spread, half near the optimum."""
    d, half = region.dimension, CANDIDATES // 2
    even = scipy.stats.qmc.Sobol(d, rng=rng).random(2 ** int(np.ceil(np.log2(half))))
    about = region.unit(best) + 0.2 * rng.standard_normal((half, d))
    return np.concatenate([even, about[np.all((about >= 0.0) & (about <= 1.0), axis=1)]])


def _lower_bound(
    surrogate: ProcessSurrogate, means: FloatArray, spread: FloatArray, draws: FloatArray, misfit: Misfit
) -> FloatArray:
    """Mean minus `BOUND` standard deviations of the misfit over drawn responses, shape [n]."""
    scores = means + spread * draws[:, None, :]
    values = np.stack([misfit(surrogate.components.expand(one)) for one in scores])
    return np.asarray(values.mean(axis=0) - BOUND * values.std(axis=0))


Locate = Callable[[ProcessSurrogate, Box, FloatArray], tuple[FloatArray, FloatArray]]
"""Finds the optimum of a surrogate in a box from a starting point, and its standard deviation. Both are in
parameter units, shape [d]."""

CONVERGED_MOVE = 0.2
"""The optimum is stable if it moves by at most this [standard deviations]: a tenth of the k = 2 half
width."""
SHRINK = 0.35
"""Edge of the next region over this one's, while the optimum lies inside."""
SMALLEST = 0.02
"""Smallest edge of a region in the unit box."""
WIDTHS = 6.0
"""The edge of a region is at least this many standard deviations of the optimum. In a smaller region the
roughness of the function would dominate."""
GAIN = 0.7
"""A smaller region is used if the surrogate's leave-one-out error falls below this share of its earlier
value. Otherwise the function is rough: runs of a wide region average the roughness, but runs of a small
region follow it."""
PATIENCE = 2
"""The error must fall within this number of smaller regions: at first a region has few runs."""
REACH = 1.25
"""The surrogate is built from runs within this many half edges of the region's middle."""

FACE = 1e-4
"""A coordinate is on a face if its distance from the face is at most this share of the edge."""


@dataclass(frozen=True)
class Refinement:
    """The optimum, the surrogate around it, and all runs."""

    x: FloatArray
    """The optimum of the last surrogate, in parameter units, shape [d]."""
    sigma: FloatArray
    """Its standard deviation, shape [d]."""
    region: Box
    surrogate: ProcessSurrogate
    """Surrogate built from the runs in and near the last region."""
    points: FloatArray
    """All completed runs, the first design and then each round, in parameter units, shape [n, d]."""
    responses: FloatArray
    """Responses of these runs, shape [n, k]."""
    converged: bool
    """True if the last runs did not move the optimum."""


def refine(
    run: BatchRun,
    box: Box,
    points: ArrayLike,
    responses: ArrayLike,
    *,
    misfit: Misfit,
    locate: Locate,
    scale: ArrayLike,
    max_rounds: int = 10,
    rng: int = 0,
) -> Refinement:
    """Add runs to a first design until the optimum is stable; `SurrogateError` if no surrogate can be built.

    ``run``: the expensive function; rows of failed runs are NaN and are omitted. ``points``, ``responses``:
    the first design's completed runs, shape [n, d], and their responses, shape [n, k]. ``misfit``: the
    function to minimise. ``locate``: finds the optimum of a surrogate. ``scale``: unit of comparison of each
    entry, in response units, a number or shape [k]. ``rng``: seed of candidates and draws.
    """
    if max_rounds < 1:
        raise ValueError(f"max_rounds must be at least 1, got {max_rounds}")
    size = 2 * box.dimension + 2
    x, y = np.asarray(points, dtype=np.float64), np.asarray(responses, dtype=np.float64)
    values, zoom, region = misfit(y), _Zoom(), box
    start = x[int(np.argmin(values))]
    surrogate = _about(box, region, x, y, scale)
    best, sigma = locate(surrogate, region, start)
    converged = False
    for number in range(max_rounds):
        new = choose(surrogate, region, best, misfit, size, np.random.default_rng([rng, number]))
        new_responses = np.asarray(run(new), dtype=np.float64)
        finite = np.asarray(np.isfinite(new_responses).all(axis=1), dtype=np.bool_)
        x, y = np.concatenate([x, new[finite]]), np.concatenate([y, new_responses[finite]])
        values = np.append(values, misfit(new_responses[finite]))
        inside = not _on_inner_face(best, region, box)
        # A real run with a lower misfit is preferred to the surrogate's prediction.
        centre = x[int(np.argmin(values))]
        widths = WIDTHS * _unit_widths(box, best, sigma)
        surrogate = _about(box, _around(box, centre, np.clip(widths, zoom.edge, 1.0)), x, y, scale, surrogate)
        if inside:
            zoom.judge(surrogate.loo_rms)
        region = _around(box, centre, np.clip(widths, zoom.edge, 1.0))
        surrogate = _about(box, region, x, y, scale, surrogate)
        before = best
        best, sigma = locate(surrogate, region, centre)
        shift = float(np.max(np.abs(best - before) / np.maximum(sigma, np.finfo(float).tiny)))
        if inside and finite[0] and shift <= CONVERGED_MOVE:
            converged = True
            break
    return Refinement(best, sigma, region, surrogate, x, y, converged)


class _Zoom:
    """Edge of the region. It decreases in each round as long as this improves the surrogate."""

    def __init__(self) -> None:
        self.edge = 1.0
        self.errors: dict[float, float] = {}
        self.rough = False

    def judge(self, error: float) -> None:
        """Choose the next edge from the leave-one-out error in this region, including its new runs."""
        self.errors[self.edge] = error
        if self.rough:
            return
        wider = sorted(edge for edge in self.errors if edge > self.edge)
        if len(wider) >= PATIENCE and error > GAIN * self.errors[wider[PATIENCE - 1]]:
            self.rough, self.edge = True, wider[PATIENCE - 1]
        else:
            self.edge = max(SHRINK * self.edge, SMALLEST)


def _unit_widths(box: Box, x: FloatArray, sigma: FloatArray) -> FloatArray:
    """Standard deviations in the unit box, shape [d]; at most its edge."""
    wide = np.minimum(sigma, np.array(box.upper) - np.array(box.lower))
    ends = np.clip([x - 0.5 * wide, x + 0.5 * wide], box.lower, box.upper)
    return np.asarray(np.minimum(np.diff(box.unit(ends), axis=0)[0], 1.0))


def _around(box: Box, centre: FloatArray, edges: FloatArray) -> Box:
    """A box about a point, with these edges in the unit box, cut off at the faces."""
    u = box.unit(centre)
    lower, upper = box.scale(np.maximum(u - 0.5 * edges, 0.0)), box.scale(np.minimum(u + 0.5 * edges, 1.0))
    return Box(box.names, tuple(lower.tolist()), tuple(upper.tolist()), box.logarithmic)


def _about(
    box: Box,
    region: Box,
    x: FloatArray,
    y: FloatArray,
    scale: ArrayLike,
    template: ProcessSurrogate | None = None,
) -> ProcessSurrogate:
    """The surrogate from the runs in and near a region, or from the nearest if they are too few."""
    distance = np.abs(region.unit(x) - 0.5).max(axis=1)
    fewest = min(len(x), 3 * box.dimension + 5)
    near = distance <= max(0.5 * REACH, float(np.sort(distance)[fewest - 1]))
    lower, upper = (
        np.minimum(region.lower, x[near].min(axis=0)),
        np.maximum(region.upper, x[near].max(axis=0)),
    )
    holding = Box(box.names, tuple(lower.tolist()), tuple(upper.tolist()), box.logarithmic)
    return ProcessSurrogate.fit(holding, x[near], y[near], scale=scale, like=template)


def _on_inner_face(x: FloatArray, region: Box, box: Box) -> bool:
    """True if a point lies on a face of the region that is not a face of the box."""
    u, whole = region.unit(x), box.unit(x)
    return bool(np.any((np.minimum(u, 1.0 - u) < FACE) & (np.minimum(whole, 1.0 - whole) > FACE)))
