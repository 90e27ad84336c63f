"""Another end of the window, other bins of the force: the same data and runs searched again.

A data vector is linear in its bins and points, so that the surrogate at hand also predicts what a shorter
window or wider bins leave of it. Narrower bins need a surrogate of their own, of the same runs: the forces
at their recorded samples tell how a bin's mean is shared by its halves.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from doe import Box
from kolsky.bars.signals.transducers import ForceBins, force_between
from kolsky.base.arrays import FloatArray
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import SAME_TIME, Observations, Prediction
from kolsky.inverse.optimum import Model, at_inner_face, search
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.inverse.uncertainty_results import Variation
from kolsky.uncertainty.profile_likelihood import LinearisedOptimum, ParameterProfiles, surrogate_of

WINDOW_END, FORCE_BINS = "window_end", "force_bins"
SHARES = (0.9, 0.8)
"""Ends of the window over its whole length."""
LEAST_BINS = 8
"""Fewest bins of the force that are searched."""
TOLERANCE = 1e-5
"""Of the searches, in the unit box."""
SEARCHED = "searched again on the surrogate"
AT_EDGE = "searched again on the surrogate, whose range the optimum would leave: at least so much"

Data = tuple[Objective, Model]
"""Other data, and what predicts them."""


def variations(
    stages: StagedRuns, answer: LinearisedOptimum, found: ParameterProfiles, check: Prediction
) -> tuple[Variation, ...]:
    """Shifts of the answer by other choices of window and bins.

    Parameters
    ----------
    stages
        The identification's simulations.
    answer
        Where it ended.
    found
        The surrogate that its profiles rest on.
    check
        What the run on the refined mesh at the answer predicts, in its first row.

    Returns
    -------
    tuple of Variation
        Shifts from the optimum of the same surrogate with the choices as they were made.
    """
    first, last = stages.prepared.forward.shot.window
    width = float(np.diff(found.objective.observations.bins.edges).mean())
    data: Data = (found.objective, found.model.predict)
    before = _optimum(found, answer.x, data)
    ends = [first + share * (last - first) for share in SHARES]
    others: list[tuple[str, float, Callable[[], Data]]] = [
        *((WINDOW_END, end, partial(shorter, *data, end)) for end in ends),
        (FORCE_BINS, 2.0 * width, partial(wider, *data)),
        (FORCE_BINS, 0.5 * width, partial(narrower, stages, answer, found, check)),
    ]
    told = []
    for key, value, make in others:
        try:
            after = _optimum(found, before, make())
        except ValueError as error:
            told.append(Variation(key, value, {}, f"not searched: {error}"))
            continue
        shifts = dict(zip(stages.box.names, (after - before).tolist(), strict=True))
        edge = at_inner_face(after, found.box, stages.box)
        told.append(Variation(key, value, shifts, AT_EDGE if edge else SEARCHED))
    return tuple(told)


def shorter(objective: Objective, model: Model, end: float) -> Data:
    """The data inside a window that ends earlier, and their model.

    Raises
    ------
    ValueError
        If it leaves too little.
    """
    seen = objective.observations
    line = seen.centre_line
    inside = seen.of_forces(lambda bins, _: bins.edges[1:]) <= end + SAME_TIME
    n = int(inside[: len(seen.bins.mean)].sum())
    points = line.time <= end + SAME_TIME
    if n < LEAST_BINS:
        raise ValueError(f"{n} bins of the force are left, {LEAST_BINS} are needed")
    if seen.has_shape and not (points & objective.counted).any():
        raise ValueError("no point of the outline is left")
    left = np.concatenate([inside, points])
    kept = Observations(
        force=seen.force,
        bins=_first_bins(seen.bins, end),
        incident=None if seen.incident is None else _first_bins(seen.incident, end),
        centre_line=line.select(points),
        force_sigma_gain=seen.force_sigma_gain,
        front_noise=None if seen.front_noise is None else seen.front_noise[:, left],
        front_offset=None if seen.front_offset is None else seen.front_offset[left],
    )
    rows = np.concatenate([inside, points[objective.counted]])
    return replace(objective, observations=kept, counted=objective.counted[points]), lambda x: model(x)[
        :, rows
    ]


def _first_bins(bins: ForceBins, end: float) -> ForceBins:
    """The bins that end before a time."""
    n = int((bins.edges[1:] <= end + SAME_TIME).sum())
    return ForceBins(bins.edges[: n + 1], bins.mean[:n], bins.sigma[:n], bins.n[:n])


def wider(objective: Objective, model: Model) -> Data:
    """The data with every two bins of the transmitted force as one; an odd last one stays.

    Raises
    ------
    ValueError
        If too few bins would be left.
    """
    bins = objective.observations.bins
    own = len(bins.mean)
    starts = np.arange(0, own, 2)
    if len(starts) < LEAST_BINS:
        raise ValueError(f"{len(starts)} bins of the force are left, {LEAST_BINS} are needed")
    h = np.diff(bins.edges)
    together = np.add.reduceat(h, starts)

    def merged(values: FloatArray) -> FloatArray:
        means: FloatArray = np.add.reduceat(h * values, starts, axis=-1) / together
        return means

    wide = ForceBins(
        edges=bins.edges[np.append(starts, own)],
        mean=merged(bins.mean),
        sigma=np.sqrt(np.add.reduceat((h * bins.sigma) ** 2, starts)) / together,
        n=np.add.reduceat(bins.n - 1, starts) + 1,
    )

    def both(vectors: FloatArray) -> FloatArray:
        return np.concatenate([merged(vectors[:, :own]), vectors[:, own:]], axis=1)

    modes, offset = objective.observations.front_noise, objective.observations.front_offset
    seen = replace(
        objective.observations,
        bins=wide,
        front_noise=None if modes is None else both(modes),
        front_offset=None if offset is None else both(offset[None])[0],
    )
    return replace(objective, observations=seen), lambda points: both(model(points))


def narrower(
    stages: StagedRuns, answer: LinearisedOptimum, found: ParameterProfiles, check: Prediction
) -> Data:
    """The data with every bin of the transmitted force as two, and a surrogate of the same runs for them.

    Raises
    ------
    ValueError
        If a bin holds no sample between its edges.
    """
    seen = answer.objective.observations
    edge = np.searchsorted(seen.force.time, seen.bins.edges - SAME_TIME)
    middle = (edge[1:] + edge[:-1]) // 2
    if (middle == edge[:-1]).any():
        raise ValueError("the force has no sample inside its bins")
    halves = np.sort(np.concatenate([edge, middle]))

    def halved(prediction: Prediction) -> Prediction:
        return replace(prediction, force_bins=_halves(prediction, seen.force.time, edge, halves))

    points, prediction = stages.on_surrogate_mesh()
    n, bins = len(seen.bins.mean), force_between(seen.force, halves)

    def twice(rows: FloatArray | None) -> FloatArray | None:
        """Rows of bins and points in which both halves of a bin have its own value."""
        if rows is None:
            return None
        return np.concatenate([np.repeat(rows[..., :n], 2, axis=-1), rows[..., n:]], axis=-1)

    halved_seen = replace(
        seen, bins=bins, front_noise=twice(seen.front_noise), front_offset=twice(seen.front_offset)
    )
    objective = replace(answer.objective, observations=halved_seen)
    fine = replace(
        answer,
        objective=objective,
        # The model's own means, shared by the halves as the run shares its own.
        vector=np.concatenate(
            [
                np.repeat(answer.vector[:n] - check.force_bins[0, :n], 2)
                + halved(check).force_bins[0, : 2 * n],
                answer.vector[n:],
            ]
        ),
        # What the finer mesh adds to a bin's slope, both halves get.
        steeper=np.concatenate([np.repeat(answer.steeper[:n], 2, axis=0), answer.steeper[n:]]),
    )
    model, objective = surrogate_of((points, halved(prediction)), fine, found.box, stages.box)
    return objective, model.predict


def _halves(
    prediction: Prediction, time: FloatArray, edge: NDArray[np.intp], halves: NDArray[np.intp]
) -> FloatArray:
    """Means over the halves of bins by the trapezoid rule, those of a bin with its exact mean, [n, 2 n_bins].

    The rule misses what a force does between its samples, and both halves are given the same of it.
    """
    F = prediction.force
    steps = 0.5 * (F[:, 1:] + F[:, :-1]) * np.diff(time)
    impulse = np.concatenate([np.zeros((len(F), 1)), np.cumsum(steps, axis=1)], axis=1)
    whole, half = (np.diff(impulse[:, at], axis=1) / np.diff(time[at]) for at in (edge, halves))
    own = half + np.repeat(prediction.force_bins[:, : len(edge) - 1] - whole, 2, axis=1)
    return np.concatenate([own, prediction.force_bins[:, len(edge) - 1 :]], axis=1)


def _optimum(found: ParameterProfiles, start: FloatArray, data: Data) -> FloatArray:
    objective, model = data
    box: Box = found.box
    inside = np.clip(start, box.lower, box.upper)
    return search(box, objective, model, start=inside if len(inside) > 1 else None, tolerance=TOLERANCE).x
