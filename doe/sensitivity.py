"""Sensitivity of outputs to the parameters of a box: Sobol' indices and Morris' elementary effects.

The parameters are independent and uniform in the unit box; a logarithmic one is uniform in its logarithm. A
and B are two independent samples. AB_i is the sample A with the i-th column of B. Then

    S_i  = mean(f_B (f_ABi - f_A)) / V        first order, Saltelli et al. (2010)
    ST_i = mean((f_A - f_ABi)^2) / 2 V        total, Jansen (1999)

Morris' trajectory has d + 1 points. From one point to the next, one parameter moves by p / 2 (p - 1) of its
edge; p is the number of levels. An effect is the change of the output over this move (Morris 1991). Its mean
size measures the parameter's influence. Its scatter shows whether the effect depends on the position in the
box (Campolongo et al. 2007).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from operator import index

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from doe.arrays import FloatArray
from doe.box import Box
from doe.designs.design import Design, Rng, seed_of

Function = Callable[[FloatArray], FloatArray]
"""Outputs, shape [n, s], at points in parameter units, shape [n, d]."""

CHUNK = 1024
"""Number of points in one call of a function."""
RESAMPLES = 500
"""Draws of the bootstrap."""
ENDS = 0.5 * (1.0 - 0.95), 0.5 * (1.0 + 0.95)
"""Quantiles at the ends of an interval. The intervals tend to be too wide, because a Sobol' sequence covers
the box more evenly than the bootstrap assumes."""


@dataclass(frozen=True)
class SobolIndices:
    """First-order and total indices with their intervals. They are estimates: a small index can be slightly
    below zero and is not corrected."""

    names: tuple[str, ...]
    outputs: tuple[str, ...]
    first: FloatArray
    """Share of the variance caused by each parameter without interactions [-], shape [s, d]."""
    total: FloatArray
    """Share caused by each parameter, including interactions [-], shape [s, d]."""
    first_interval: FloatArray
    """Ends of the interval of `first` from a bootstrap over the sample [-], shape [s, d, 2]."""
    total_interval: FloatArray
    """Likewise of `total`."""
    mean: FloatArray
    """Mean of each output over the box, in its unit, shape [s]."""
    variance: FloatArray
    """Variance of each output over the box, in its unit squared, shape [s]."""


def at_saltelli_points(
    function: Function, box: Box, n: int, rng: Rng
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The function at A, B and all AB_i: shapes [n, s], [n, s] and [d, n, s].

    A and B are halves of a scrambled Sobol' sequence in 2 d dimensions. Raises ValueError if n is not a power
    of two or below 4: only then the sequence is balanced.
    """
    d, count = box.dimension, index(n)
    if count < 4 or count & (count - 1):
        raise ValueError(f"n must be a power of two, at least 4, got {count}")
    A, B = np.hsplit(qmc.Sobol(2 * d, rng=seed_of(rng)).random(count), 2)
    mixed = [np.where(np.arange(d) == i, B, A) for i in range(d)]
    values = evaluate(function, box, np.concatenate([A, B, *mixed])).reshape(d + 2, count, -1)
    return values[0], values[1], values[2:]


def evaluate(function: Function, box: Box, unit_points: FloatArray) -> FloatArray:
    """Values of the function at points of the unit box, evaluated in blocks, shape [n, s].

    Raises ValueError if a value has a wrong shape or is not finite; the message names the point.
    """
    parts = []
    for start in range(0, len(unit_points), CHUNK):
        x = box.scale(unit_points[start : start + CHUNK])
        y = np.asarray(function(x), dtype=np.float64)
        if y.ndim != 2 or len(y) != len(x):
            raise ValueError(f"the function must return shape [{len(x)}, s], got {list(y.shape)}")
        bad = np.flatnonzero(~np.isfinite(y).all(axis=1))
        if len(bad):
            raise ValueError(f"the function is not finite at {box.as_dict(x[bad[0]])}")
        parts.append(y)
    return np.concatenate(parts)


def sobol_indices(
    box: Box, function: Function, *, outputs: tuple[str, ...], n: int = 1024, rng: Rng
) -> SobolIndices:
    """Variance-based sensitivity of some scalar outputs, e.g. of a verified surrogate.

    Parameters
    ----------
    box
        Where the parameters vary, uniformly and independently.
    function
        The outputs at points.
    outputs
        Their names, length s.
    n
        Points of each of the d + 2 samples, a power of two.
    rng
        Integer seed or generator, of the sample and of the bootstrap.

    Raises
    ------
    ValueError
        If an argument is outside its range, the function's values are invalid, or an output does not vary
        over the box.
    """
    seed = seed_of(rng)
    at_A, at_B, at_AB = at_saltelli_points(function, box, n, seed)
    if at_A.shape[1] != len(outputs):
        raise ValueError(f"the function returns {at_A.shape[1]} outputs, {len(outputs)} are named")
    both = np.concatenate([at_A, at_B])
    mean, variance = both.mean(axis=0), both.var(axis=0)
    # Smaller differences are round-off of the values.
    still = np.flatnonzero(variance <= (1e-13 * np.abs(mean)) ** 2)
    if len(still):
        raise ValueError(
            f"{outputs[still[0]]!r} is {mean[still[0]]:.6g} all over the box: nothing to explain"
        )
    # Values relative to their mean: the first-order estimator then has the smallest scatter.
    first = (at_B - mean) * (at_AB - at_A)
    total = 0.5 * (at_A - at_AB) ** 2
    square = 0.5 * ((at_A - mean) ** 2 + (at_B - mean) ** 2)
    draws = _resampled([first, total, square[None]], seed)
    return SobolIndices(
        names=box.names,
        outputs=outputs,
        first=(first.mean(axis=1) / variance).T,
        total=(total.mean(axis=1) / variance).T,
        first_interval=np.moveaxis(np.quantile(draws[0] / draws[2], ENDS, axis=0), 0, -1).swapaxes(0, 1),
        total_interval=np.moveaxis(np.quantile(draws[1] / draws[2], ENDS, axis=0), 0, -1).swapaxes(0, 1),
        mean=mean,
        variance=variance,
    )


def _resampled(terms: list[FloatArray], seed: int) -> list[FloatArray]:
    """Means over the rows of a bootstrap sample, the same rows for all terms."""
    n = terms[0].shape[-2]
    counts = np.random.default_rng(seed).multinomial(n, np.full(n, 1.0 / n), size=RESAMPLES) / n
    return [np.tensordot(counts, term, axes=(1, term.ndim - 2)) for term in terms]


@dataclass(frozen=True)
class ElementaryEffects:
    """Effects of each parameter on each output, per edge of the box."""

    names: tuple[str, ...]
    effects: FloatArray
    """Every effect, in the outputs' units, shape [r, d, s]."""

    @property
    def mean(self) -> FloatArray:
        """Mean effect mu, in the outputs' units, shape [s, d]."""
        return self.effects.mean(axis=0).T

    @property
    def size(self) -> FloatArray:
        """Mean size mu* of the effect, in the outputs' units, shape [s, d]."""
        return np.abs(self.effects).mean(axis=0).T

    @property
    def scatter(self) -> FloatArray:
        """Standard deviation sigma of the effect: curvature or interaction, shape [s, d]."""
        return self.effects.std(axis=0, ddof=1).T


@dataclass(frozen=True)
class Trajectories:
    """The runs of a screening, in any order."""

    design: Design
    """The points, trajectory after trajectory, shape [r (d + 1), d]."""
    moved: NDArray[np.int64]
    """Index of the parameter that changes in each step, shape [r, d]."""

    def effects(self, outputs: FloatArray) -> ElementaryEffects:
        """The effects of the runs' outputs.

        ``outputs``: one row for each point of `design`, shape [r (d + 1), s]. Raises ValueError if the shape
        is wrong or an output is not finite. Such a trajectory is not omitted, because this would hide effects
        at the limits of the model.
        """
        r, d = self.moved.shape
        y = np.asarray(outputs, dtype=np.float64)
        if y.ndim != 2 or len(y) != r * (d + 1):
            raise ValueError(f"outputs must have shape [{r * (d + 1)}, s], got {list(y.shape)}")
        bad = np.flatnonzero(~np.isfinite(y).all(axis=1))
        if len(bad):
            at = self.design.box.as_dict(self.design.points[bad[0]])
            raise ValueError(
                f"{len(bad)} of {len(y)} runs have no finite output, the first at {at}: take a smaller box"
            )
        step = np.diff(self.design.unit_points.reshape(r, d + 1, d), axis=1)
        change = np.diff(y.reshape(r, d + 1, -1), axis=1)
        row, place = np.arange(r)[:, None], np.arange(d)[None, :]
        slope = change / step[row, place, self.moved][..., None]
        effects = np.empty_like(slope)
        effects[row, self.moved] = slope
        return ElementaryEffects(self.design.box.names, effects)


def morris(box: Box, trajectories: int, *, levels: int = 4, rng: Rng) -> Trajectories:
    """Random trajectories through the grid of a box.

    Parameters
    ----------
    box
        Where.
    trajectories
        Number of trajectories, r, at least 2; they require r (d + 1) runs.
    levels
        Number of levels of each parameter, p, even, at least 2. With an even number all levels are used
        equally often.
    rng
        Integer seed or generator.

    Raises
    ------
    ValueError
        If a number is outside its range.
    """
    r, p, d, seed = index(trajectories), index(levels), box.dimension, seed_of(rng)
    if r < 2:
        raise ValueError(f"trajectories must be at least 2, got {r}: one has no scatter")
    if p < 2 or p % 2:
        raise ValueError(f"levels must be even and at least 2, got {p}")
    draw = np.random.default_rng(seed)
    delta = p / (2.0 * (p - 1.0))
    low = draw.integers(0, p // 2, size=(r, d)) / (p - 1.0)
    down = draw.random((r, d)) < 0.5
    order = np.argsort(draw.random((r, d)), axis=1)
    turn = np.argsort(order, axis=1)  # the step in which each parameter moves
    after = np.arange(d + 1)[None, :, None] > turn[:, None, :]
    unit_points = (low[:, None, :] + delta * (after ^ down[:, None, :])).reshape(-1, d)
    settings = {"trajectories": r, "levels": p, "rng": seed}
    return Trajectories(Design(box.scale(unit_points), box, "morris", settings), order)
