"""A branch that relaxes, searched for beside an elastic optimum that does not explain a shot.

A strong branch is out of reach of the linear test (`kolsky.diagnosis.branch_test`): the elastic optimum has
moved to make up for it, and what is left has become part of the weights. So the elastic parameters, a
strength and a time are searched for together on the surrogate's mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from doe import Box
from doe.least_squares import least_squares
from doe.whitening import Whitening
from kolsky.base.arrays import FloatArray
from kolsky.base.relaxation import Relaxation, prony_names
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import predict
from kolsky.inverse.parameters import MOVED, design_box
from kolsky.inverse.relaxing import same_bulk
from kolsky.inverse.search_coordinates import from_search, search_box, to_search
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.inverse.valleys import VALLEY

STRENGTH, TIME = prony_names(1)
SHORTEST = 2e-5
"""Shortest relaxation time that is searched [s]; the longest is the window."""
STRENGTHS, TIMES = (0.1, 0.4), 6
"""Strengths and times of the first scan."""
STARTS, STEPS, STEP, AT_REST = 2, 8, 1e-3, 0.5
"""Points of the scan that are searched from, trial points of each, half the distance of differences in the
unit box, and the next step at which a search is at rest, in standard deviations."""
HALF = 0.5
"""Share of what an elastic model leaves from which on a branch explains more than it leaves [-].

In seven shots of a planted branch (draws 0 to 6 of seed 41907 of `benchmarks.branch_advice`) it was 0.89 to
0.99; in five elastic ones that were searched all the same (0 to 4 of seed 50923 of `benchmarks.coverage`)
-0.23 to -0.005."""


@dataclass(frozen=True)
class BranchFit:
    """A shot with a branch beside the same without."""

    strength: float
    """Of the branch [-]."""
    time: float
    """Its relaxation time [s]."""
    aic: float
    """Akaike's criterion with it less that without [-]."""
    share: float
    """Share of what the elastic model leaves beyond noise and clocks that it explains [-]."""
    inside: bool
    """Whether strength and time lie inside their ranges."""

    @property
    def asked_for(self) -> bool:
        """Whether the data ask for it."""
        return self.inside and self.aic < 0.0 and self.share >= HALF


def branch_fit(stages: StagedRuns, x: FloatArray, objective: Objective) -> BranchFit | None:
    """Search for a branch beside an elastic optimum, all free parameters moving with it.

    Parameters
    ----------
    stages
        The identification's simulations; some 200 runs are added on the surrogate's mesh.
    x
        The optimum, shape [d].
    objective
        Of the optimum.

    Returns
    -------
    BranchFit or None
        None if the shot declares what relaxes, or too few runs complete.
    """
    forward, numerics = stages.prepared.forward, stages.settings.numerics
    if forward.shot.relaxation is not None or numerics.compressible is not None:
        return None
    first, last = forward.shot.window
    ranges = zip(stages.box.names, stages.box.lower, stages.box.upper, strict=True)
    box = design_box(
        {**{n: (low, high) for n, low, high in ranges}, STRENGTH: None, TIME: (SHORTEST, last - first)}
    )
    series = Relaxation("prony", {STRENGTH: 0.0, TIME: last - first})
    relaxing = replace(forward, shot=replace(forward.shot, relaxation=series))
    prior, d, k = stages.prior, len(x), len(objective.data)
    known = 0 if prior is None else len(prior.rows())

    def run(points: FloatArray) -> FloatArray:
        stages.progress("what relaxes", 0, len(points))
        columns = dict(zip(box.names, points.T, strict=True))
        response = relaxing.run({**stages.settings.held, **columns}, numerics)
        found = np.full((len(points), k + known), np.nan)
        rows = np.flatnonzero(response.completed)
        if rows.size:
            seen = objective.vectors(predict(response.select(rows), objective.observations))
            # An outline point that a run does not reach adds nothing.
            found[rows, :k] = np.where(np.isnan(seen), objective.data, seen)
            if prior is not None:
                found[rows, k:] = prior.residuals(points[rows, :d])
        stages.progress("what relaxes", len(points), len(points))
        return found

    def weighting(residual: FloatArray) -> Whitening:
        weighed = objective.with_discrepancy(objective.data + residual[:k])
        patterns = np.pad(weighed.common, ((0, 0), (0, known)))
        return Whitening(np.concatenate([weighed.own_sigma, np.ones(known)]), patterns)

    data = np.concatenate([objective.data, np.zeros(known)])

    def deviance(vector: FloatArray) -> float:
        if np.isnan(vector).any():
            return np.inf
        weights = weighting(vector - data)
        return float((weights.apply(vector - data) ** 2).sum()) + weights.log_determinant

    at = stages.solver_values(x[None], numerics.mesh)[0]
    scan = np.clip(scanned(box, at), box.lower, box.upper)
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
    return BranchFit(
        strength=float(point[-2]),
        time=float(point[-1]),
        aic=deviance(found) - float(costs[0]) + 4.0,
        share=explained(objective, vectors[0, :k], found[:k]),
        inside=not {STRENGTH, TIME} & set(best.at_bound),
    )


def scanned(box: Box, at: FloatArray) -> FloatArray:
    """Points with a branch beside an elastic one that are as stiff in the mean, shape [n, d + 2].

    A branch of strength c stiffens by 1 to 1 + c: m gives way by the root of 1 + c. The bulk modulus, which
    goes with m (1 + c) / (1 - 2 nu) and sets the pace of the ringing, stays where Poisson's ratio is free.

    Parameters
    ----------
    box
        Of all parameters, strength and time last.
    at
        The elastic point, shape [d].
    """
    times = np.geomspace(box.lower[-1], box.upper[-1], TIMES + 2)[1:-1]
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


def explained(objective: Objective, before: FloatArray, after: FloatArray) -> float:
    """Share of what one vector leaves beyond noise and patterns that another does not leave [-].

    Parameters
    ----------
    objective
        Data and noise.
    before, after
        Predictions, shape [k].
    """

    def left(vector: FloatArray) -> float:
        o = objective.with_discrepancy(vector)
        size = np.full(len(o.data), o.shape_discrepancy)
        size[: o.n_force] = o.force_discrepancy
        return float(((size / o.noise) ** 2).sum())

    most = left(before)
    return 1.0 - left(after) / most if most > 0.0 else 0.0
