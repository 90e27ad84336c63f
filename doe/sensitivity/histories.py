"""Sobol' indices of a whole history: of every entry, and of all together.

A history is reduced to the scores of its principal components; from the covariances of the scores follow
the indices of every entry, and their sum weighted by the variances, the generalised index

    GS_i = tr C_i / tr C,      C_i = Cov(E[R | x_i]),

of Lamboni, Monod and Makowski (2011) and Gamboa et al. (2014). It does not depend on how the components are
turned, only on the scale that the entries are measured by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from doe.arrays import FloatArray
from doe.box import Box
from doe.designs.design import Rng, seed_of
from doe.sensitivity.variance import Function, SaltelliSample, evaluate, interval_ends, resampled
from doe.surrogates.pca import PrincipalComponents

PILOT = 256
"""Points from which the components are taken."""
SILENT = 1e-6
"""An entry whose variance is a smaller share of the largest one has no indices: those of a point that the
disturbance has not reached would be shares of round-off."""


@dataclass(frozen=True)
class HistoryIndices:
    """Indices of a history with k entries."""

    names: tuple[str, ...]
    """Parameters, length d."""
    first: FloatArray
    """First-order index of each entry [-], shape [d, k]; NaN where the entry hardly varies."""
    total: FloatArray
    """Total index of each entry [-], shape [d, k]; NaN likewise."""
    variance: FloatArray
    """Variance of each entry over the box, in its unit squared, shape [k]."""
    aggregated_first: FloatArray
    """Generalised first-order index [-], shape [d]."""
    aggregated_total: FloatArray
    """Generalised total index [-], shape [d]."""
    aggregated_first_interval: FloatArray
    """Ends of its bootstrap interval [-], shape [d, 2]."""
    aggregated_total_interval: FloatArray
    """Likewise of the total index."""
    components: int
    """Number of components kept."""
    kept_variance: float
    """Share of the scaled variance in them [-]."""


def history_indices(
    box: Box,
    function: Function,
    *,
    scale: ArrayLike = 1.0,
    n: int = 1024,
    rng: Rng,
    variance: float = 1.0 - 1e-6,
    confidence: float = 0.95,
    resamples: int = 500,
) -> HistoryIndices:
    """Variance-based sensitivity of a history, e.g. `Surrogate.predict`.

    Parameters
    ----------
    box
        Where the parameters vary, uniformly and independently.
    function
        The histories at points, shape [n, d] -> [n, k].
    scale
        What entries are measured by when they are put together, > 0, in their units: a number or shape [k].
    n
        Points of each of the d + 2 samples, a power of two.
    rng
        Integer seed or generator.
    variance
        Share of the scaled variance that the components keep, in (0, 1].
    confidence, resamples
        As in `doe.sensitivity.sobol_indices`.

    Raises
    ------
    ValueError
        If an argument is outside its range, an answer is unusable, or the history does not vary at all.
    """
    seed = seed_of(rng)
    sample = SaltelliSample.draw(box.dimension, n, seed)
    pilot = evaluate(function, box, sample.A[:PILOT])
    reduction = PrincipalComponents.fit(pilot, scale=scale, variance=variance)
    if not reduction.singular_values[0] > 1e-12 * np.abs(pilot / reduction.scale).max():
        raise ValueError("the history is the same all over the box: nothing to explain")
    at_A, at_B, at_AB = sample.ask(lambda x: reduction.scores(function(x)), box)
    both = np.concatenate([at_A, at_B])
    centre = both.mean(axis=0)
    at_A, at_B, at_AB = at_A - centre, at_B - centre, at_AB - centre
    change = at_AB - at_A
    whole = (both - centre).T @ (both - centre) / len(both)
    of_first = np.einsum("np,dnq->dpq", at_B, change) / n
    of_total = 0.5 * np.einsum("dnp,dnq->dpq", change, change) / n
    basis = reduction.basis

    def diagonal(covariance: FloatArray) -> FloatArray:
        return np.einsum("...pq,pk,qk->...k", covariance, basis, basis, optimize=True)

    spread = diagonal(whole) * reduction.scale**2
    alive = spread > SILENT * spread.max()
    share = np.divide(reduction.scale**2, spread, out=np.full_like(spread, np.nan), where=alive)
    traces = resampled(
        [
            (at_B * change).sum(axis=-1, keepdims=True),
            0.5 * (change**2).sum(axis=-1, keepdims=True),
            0.5 * (at_A**2 + at_B**2).sum(axis=-1, keepdims=True)[None],
        ],
        resamples,
        seed,
    )
    ends = interval_ends(confidence)
    size = float(np.trace(whole))
    return HistoryIndices(
        names=box.names,
        first=diagonal(of_first) * share,
        total=diagonal(of_total) * share,
        variance=spread,
        aggregated_first=np.trace(of_first, axis1=1, axis2=2) / size,
        aggregated_total=np.trace(of_total, axis1=1, axis2=2) / size,
        aggregated_first_interval=np.quantile((traces[0] / traces[2])[..., 0], ends, axis=0).T,
        aggregated_total_interval=np.quantile((traces[1] / traces[2])[..., 0], ends, axis=0).T,
        components=reduction.n_components,
        kept_variance=reduction.kept_variance,
    )
