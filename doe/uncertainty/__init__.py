"""Uncertainty of a model's parameters: intervals, ridges, posterior and verdicts; no physics."""

from doe.uncertainty.likelihood import Channel, Likelihood
from doe.uncertainty.posterior import Posterior, sample_posterior
from doe.uncertainty.profile import Profiles, Verdict, VerdictKind, profile_likelihoods, verdicts

__all__ = [
    "Channel",
    "Likelihood",
    "Posterior",
    "Profiles",
    "Verdict",
    "VerdictKind",
    "profile_likelihoods",
    "sample_posterior",
    "verdicts",
]
