"""Posterior by Markov chains (emcee, the extra [bayes]), with explicit priors and a convergence check."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from doe.arrays import FloatArray
from doe.uncertainty.likelihood import Likelihood

Indices = NDArray[np.intp]

WALKERS = 32
"""Walkers of the ensemble: at least twice as many as coordinates."""
LENGTHS = 50.0
"""Smallest number of steps for a reliable autocorrelation time, in multiples of the longest one (Sokal;
emcee)."""
STEADY = 0.05
"""The chains have converged if the autocorrelation times change by at most this share between two checks."""
CHECK = 250
"""Steps between two checks of convergence."""


@dataclass(frozen=True)
class Posterior:
    """Samples of the posterior, with their priors and the result of the convergence check."""

    names: tuple[str, ...]
    """Parameter names, length d."""
    samples: FloatArray
    """After burn-in, thinned by half an autocorrelation time, in parameter units, shape [n, d]."""
    discrepancies: FloatArray
    """tau of the channels that have a prior, shape [n, number of priors]; empty without."""
    discrepancy_names: tuple[str, ...]
    """Names of the channels with a sampled discrepancy."""
    converged: bool
    """True if the chains are long compared with the autocorrelation time, and this time is steady."""
    autocorrelation: FloatArray
    """Integrated autocorrelation time of each coordinate [steps], parameters first."""
    steps: int
    acceptance: float
    """Share of accepted moves [-]."""
    prior: str


def sample_posterior(
    likelihood: Likelihood,
    start: ArrayLike,
    *,
    rng: int,
    power: float = 1.0,
    discrepancy_priors: Sequence[float] | None = None,
    max_steps: int = 20_000,
) -> Posterior:
    """Sample the posterior with Goodman and Weare's ensemble of walkers.

    The prior is uniform in the unit box: between the bounds of a parameter, or of its logarithm if it is
    logarithmic. A channel's discrepancy may be sampled too, with a half-normal prior.

    Parameters
    ----------
    likelihood
        Likelihood of the data.
    start
        Centre of the walkers' starting points, in parameter units, shape [d].
    rng
        Seed.
    power
        Power of the likelihood, > 0. It is below 1 if residuals have correlations that the likelihood does
        not model (Pauli, Racugno and Ventura 2011).
    discrepancy_priors
        Scale of the half-normal prior of each channel's tau, in the channel's units; 0 keeps the channel's
        fixed discrepancy. If left out, every channel keeps its fixed discrepancy.
    max_steps
        Largest number of steps of each walker. `converged` of the result is False if they were too few.

    Raises
    ------
    ValueError
        If the start is outside the box, a prior is negative, the power is not > 0, or there are
        too many coordinates.
    ImportError
        If emcee is not installed: `pip install 'kolsky[bayes]'`.
    """
    try:
        import emcee
    except ImportError as error:
        raise ImportError("the posterior needs emcee: pip install 'kolsky[bayes]'") from error
    if not 0.0 < power < np.inf:
        raise ValueError(f"power must be > 0, got {power}")
    scales = _scales(likelihood, discrepancy_priors)
    sampled = np.flatnonzero(scales > 0.0)
    d, n = likelihood.box.dimension, likelihood.box.dimension + len(sampled)
    if 2 * n > WALKERS:
        raise ValueError(f"{WALKERS} walkers are too few for {n} coordinates")
    x = likelihood.box.require(np.atleast_2d(np.asarray(start, dtype=np.float64)), what="start")[0]
    best = likelihood.maximise(likelihood.box.unit(x))

    def log_probability(places: FloatArray) -> FloatArray:
        inside = np.all((places[:, :d] >= 0.0) & (places[:, :d] <= 1.0), axis=1)
        inside &= np.all(places[:, d:] >= 0.0, axis=1)
        value = np.full(len(places), -np.inf)
        if inside.any():
            residuals = likelihood.residuals(places[inside, :d])
            for row, residual in zip(np.flatnonzero(inside), residuals, strict=True):
                tau = _taus(likelihood, scales, sampled, places[row, d:])
                ratio = places[row, d:]  # tau over the prior's scale
                value[row] = -0.5 * (power * likelihood.deviance(residual, tau) + float(ratio @ ratio))
        return value

    sampler = emcee.EnsembleSampler(WALKERS, n, log_probability, vectorize=True)
    sampler.random_state = np.random.RandomState(rng).get_state()
    first = _first(likelihood, best.unit_point, scales[sampled], sampled, rng)
    converged, times = _run(sampler, first, max_steps)
    longest = float(np.nanmax(times)) if np.isfinite(times).any() else sampler.iteration / LENGTHS
    burn = min(int(5.0 * longest), sampler.iteration // 2)
    chain = sampler.get_chain(discard=burn, thin=max(int(0.5 * longest), 1), flat=True)
    return Posterior(
        names=likelihood.box.names,
        samples=likelihood.box.scale(chain[:, :d]),
        discrepancies=chain[:, d:] * scales[sampled],
        discrepancy_names=tuple(likelihood.channels[int(c)].name for c in sampled),
        converged=converged,
        autocorrelation=times,
        steps=int(sampler.iteration),
        acceptance=float(np.mean(sampler.acceptance_fraction)),
        prior=_prior(likelihood, scales),
    )


def _scales(likelihood: Likelihood, priors: Sequence[float] | None) -> FloatArray:
    channels = likelihood.channels
    scales = np.zeros(len(channels)) if priors is None else np.asarray(priors, dtype=np.float64)
    if scales.shape != (len(channels),) or not np.all(np.isfinite(scales) & (scales >= 0.0)):
        raise ValueError(
            f"discrepancy_priors must be {len(channels)} numbers >= 0, one a channel, got {priors}"
        )
    return scales


def _taus(likelihood: Likelihood, scales: FloatArray, sampled: Indices, ratio: FloatArray) -> FloatArray:
    tau = likelihood.discrepancies
    tau[sampled] = scales[sampled] * ratio
    return tau


def _first(
    likelihood: Likelihood, unit_point: FloatArray, scales: FloatArray, sampled: Indices, rng: int
) -> FloatArray:
    """Starting points around the optimum. The spread of each coordinate is its conditional standard
    deviation.
    """
    generator = np.random.default_rng(rng)
    jacobian = likelihood.jacobian(unit_point)
    information = (jacobian**2).sum(axis=0)
    width = np.minimum(1.0 / np.sqrt(np.maximum(information, 1.0)), 0.1)
    places = unit_point + width * generator.standard_normal((WALKERS, len(unit_point)))
    # Reflected at the faces: a walker outside would never be accepted.
    places = np.abs(places)
    places = np.where(places > 1.0, 2.0 - places, places)
    ratio = likelihood.discrepancies[sampled] / scales + 0.05 * generator.standard_normal(
        (WALKERS, len(scales))
    )
    return np.concatenate([places, np.abs(ratio)], axis=1)


def _run(sampler: Any, first: FloatArray, max_steps: int) -> tuple[bool, FloatArray]:
    before = np.full(first.shape[1], np.inf)
    place: Any = first
    while sampler.iteration < max_steps:
        steps = min(CHECK, max_steps - sampler.iteration)
        place = sampler.run_mcmc(place, steps)
        times = np.asarray(sampler.get_autocorr_time(tol=0))
        long_enough = sampler.iteration >= LENGTHS * np.max(times)
        if long_enough and np.max(np.abs(before - times) / times) < STEADY:
            return True, times
        before = times
    return False, before


def _prior(likelihood: Likelihood, scales: FloatArray) -> str:
    box = likelihood.box
    lines = [
        f"{name}: uniform in {'its logarithm in ' if logarithmic else ''}[{a:.6g}, {b:.6g}]"
        for name, a, b, logarithmic in zip(box.names, box.lower, box.upper, box.logarithmic, strict=True)
    ]
    lines += [
        f"discrepancy of {channel.name}: half-normal, scale {scale:.6g}"
        for channel, scale in zip(likelihood.channels, scales, strict=True)
        if scale > 0.0
    ]
    return "; ".join(lines)
