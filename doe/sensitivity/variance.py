"""Sobol' indices: which share of an output's variance over the box each parameter causes.

The parameters are independent and uniform in the unit box, so that a logarithmic one is uniform in its
logarithm. With A and B two independent samples and AB_i the sample A whose i-th column is that of B,

    S_i  = mean(f_B (f_ABi - f_A)) / V        first order, Saltelli et al. (2010)
    ST_i = mean((f_A - f_ABi)^2) / 2 V        total, Jansen (1999)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from operator import index

import numpy as np
from scipy.stats import qmc

from doe.arrays import FloatArray
from doe.box import Box
from doe.designs.design import Rng, seed_of

Function = Callable[[FloatArray], FloatArray]
"""Outputs, shape [n, s], at points in parameter units, shape [n, d]."""

CHUNK = 1024
"""Points at which a function is asked at once."""


@dataclass(frozen=True)
class SobolIndices:
    """First-order and total indices with their intervals.

    They are estimates: a small index can come out a little below zero, and is left so.
    """

    names: tuple[str, ...]
    """Parameters, length d."""
    outputs: tuple[str, ...]
    """What varies, length s."""
    first: FloatArray
    """Share of the variance that each parameter causes by itself [-], shape [s, d]."""
    total: FloatArray
    """Share that it causes by itself or together with others [-], shape [s, d]."""
    first_interval: FloatArray
    """Ends of the interval of `first` from a bootstrap over the sample [-], shape [s, d, 2]."""
    total_interval: FloatArray
    """Likewise of `total`."""
    mean: FloatArray
    """Mean of each output over the box, in its unit, shape [s]."""
    variance: FloatArray
    """Variance of each output over the box, in its unit squared, shape [s]."""
    evaluations: int
    """How often the function was asked."""


@dataclass(frozen=True)
class SaltelliSample:
    """The points of the estimators above, in the unit box."""

    A: FloatArray
    """Shape [n, d]."""
    B: FloatArray
    """Shape [n, d]."""

    @classmethod
    def draw(cls, d: int, n: int, rng: Rng) -> SaltelliSample:
        """Halves of a scrambled Sobol' sequence in 2 d dimensions.

        Raises
        ------
        ValueError
            If n is not a power of two, at least 4: the sequence is balanced for no other.
        """
        count = index(n)
        if count < 4 or count & (count - 1):
            raise ValueError(f"n must be a power of two, at least 4, got {count}")
        points = qmc.Sobol(2 * d, rng=seed_of(rng)).random(count)
        return cls(points[:, :d], points[:, d:])

    def mixed(self, i: int) -> FloatArray:
        """A with the i-th column of B, shape [n, d]."""
        points = self.A.copy()
        points[:, i] = self.B[:, i]
        return points

    def ask(self, function: Function, box: Box) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The function at A, B and all AB_i: shapes [n, s], [n, s] and [d, n, s]."""
        d = box.dimension
        sets = [self.A, self.B, *(self.mixed(i) for i in range(d))]
        values = evaluate(function, box, np.concatenate(sets))
        parts = values.reshape(d + 2, len(self.A), -1)
        return parts[0], parts[1], parts[2:]


def evaluate(function: Function, box: Box, unit_points: FloatArray) -> FloatArray:
    """The function at points of the unit box, some at a time, shape [n, s].

    Raises
    ------
    ValueError
        If an answer has a wrong shape or is not finite; the message names the point.
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
    box: Box,
    function: Function,
    *,
    outputs: tuple[str, ...],
    n: int = 1024,
    rng: Rng,
    confidence: float = 0.95,
    resamples: int = 500,
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
    confidence
        Share of the bootstrap inside an interval, in (0, 1). The points of a Sobol' sequence cover the box
        more evenly than the bootstrap knows, so the intervals are wide rather than narrow.
    resamples
        Draws of the bootstrap, at least 100.

    Raises
    ------
    ValueError
        If an argument is outside its range, the function's answer is unusable, or an output does not vary
        over the box, so that there is no variance to share out.
    """
    seed = seed_of(rng)
    at_A, at_B, at_AB = SaltelliSample.draw(box.dimension, n, seed).ask(function, box)
    if at_A.shape[1] != len(outputs):
        raise ValueError(f"the function returns {at_A.shape[1]} outputs, {len(outputs)} are named")
    mean, variance = _moments(at_A, at_B)
    _refuse_constant(outputs, mean, variance)
    # About their mean: the estimator of the first order then scatters least.
    first = (at_B - mean) * (at_AB - at_A)
    total = 0.5 * (at_A - at_AB) ** 2
    square = 0.5 * ((at_A - mean) ** 2 + (at_B - mean) ** 2)
    draws = resampled([first, total, square[None]], resamples, seed)
    ends = interval_ends(confidence)
    return SobolIndices(
        names=box.names,
        outputs=outputs,
        first=(first.mean(axis=1) / variance).T,
        total=(total.mean(axis=1) / variance).T,
        first_interval=np.moveaxis(np.quantile(draws[0] / draws[2], ends, axis=0), 0, -1).swapaxes(0, 1),
        total_interval=np.moveaxis(np.quantile(draws[1] / draws[2], ends, axis=0), 0, -1).swapaxes(0, 1),
        mean=mean,
        variance=variance,
        evaluations=n * (box.dimension + 2),
    )


def resampled(terms: list[FloatArray], resamples: int, seed: int) -> list[FloatArray]:
    """Means over the rows of a sample drawn again, the same rows for all terms.

    Parameters
    ----------
    terms
        Each of shape [..., n, s].
    resamples
        Number of draws, at least 100.
    seed
        Of the draws.

    Returns
    -------
    means
        For each term, shape [resamples, ..., s].

    Raises
    ------
    ValueError
        If there are fewer than 100 draws: the ends of an interval would be two or three of them.
    """
    if resamples < 100:
        raise ValueError(f"resamples must be at least 100, got {resamples}")
    n = terms[0].shape[-2]
    counts = np.random.default_rng(seed).multinomial(n, np.full(n, 1.0 / n), size=resamples) / n
    return [np.tensordot(counts, term, axes=(1, term.ndim - 2)) for term in terms]


def interval_ends(confidence: float) -> tuple[float, float]:
    """Quantiles at the ends of an interval.

    Raises
    ------
    ValueError
        If the confidence is not in (0, 1).
    """
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must be in (0, 1), got {confidence}")
    return 0.5 * (1.0 - confidence), 0.5 * (1.0 + confidence)


def _moments(at_A: FloatArray, at_B: FloatArray) -> tuple[FloatArray, FloatArray]:
    both = np.concatenate([at_A, at_B])
    return both.mean(axis=0), both.var(axis=0)


def _refuse_constant(outputs: tuple[str, ...], mean: FloatArray, variance: FloatArray) -> None:
    # Below this the differences are round-off of the values.
    still = np.flatnonzero(variance <= (1e-13 * np.abs(mean)) ** 2)
    if len(still):
        raise ValueError(
            f"{outputs[still[0]]!r} is {mean[still[0]]:.6g} all over the box: nothing to explain"
        )
