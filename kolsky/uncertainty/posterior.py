"""The posterior of a shot's parameters on the surrogate of their profiles."""

from __future__ import annotations

import numpy as np

from doe.uncertainty import sample_posterior
from kolsky.inverse.uncertainty_results import PosteriorSummary
from kolsky.uncertainty.profile_likelihood import ParameterProfiles
from kolsky.uncertainty.reduced_likelihood import full_likelihood

TAU_SCALE = 10.0
"""Scale of the half-normal prior of a discrepancy, over the median noise of its channel."""
SHOWN = 4000
"""Most samples that are kept."""
NAMES = {"force": "force_discrepancy", "outline": "shape_discrepancy"}
"""How the discrepancy of a channel is called in a result."""


def posterior(found: ParameterProfiles, *, seed: int) -> PosteriorSummary:
    """Sample parameters and discrepancies.

    The prior of a parameter is uniform in the box of the profiles, times the Gaussian of its declared
    uncertainty where it has one. Correlation of the residuals in time is
    taken in by a power of the likelihood, one over the mean factor of the profiles.

    Parameters
    ----------
    found
        The profiles and what they rest on.
    seed
        Of the chains.

    Raises
    ------
    ImportError
        If emcee is not installed: `pip install 'kolsky[bayes]'`.
    """
    likelihood = full_likelihood(found.model, found.objective, found.box)
    power = 1.0 / float(np.mean([profile.correlation for profile in found.profiles]))
    chains = sample_posterior(
        likelihood,
        np.clip(found.optimum, found.box.lower, found.box.upper),
        rng=seed,
        power=power,
        discrepancy_priors=[
            TAU_SCALE * float(np.median(channel.sigma)) if channel.name in NAMES else 0.0
            for channel in likelihood.channels
        ],
    )
    samples = np.column_stack([chains.samples, chains.discrepancies])
    lower, median, upper = np.percentile(samples, [2.5, 50.0, 97.5], axis=0)
    every = max(1, -(-len(samples) // SHOWN))
    return PosteriorSummary(
        names=(*chains.names, *(NAMES[name] for name in chains.discrepancy_names)),
        samples=samples[::every],
        median=median,
        lower=lower,
        upper=upper,
        converged=chains.converged,
        autocorrelation=float(np.max(chains.autocorrelation)),
        steps=chains.steps,
        acceptance=chains.acceptance,
        power=power,
        prior=chains.prior,
    )
