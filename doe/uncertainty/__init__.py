"""Uncertainty of a model's parameters: noise, intervals, ridges, posterior, verdicts; no physics."""

from doe.uncertainty.covariance import block_bootstrap, gauss_newton, sandwich
from doe.uncertainty.likelihood import AutoRegression, Channel, Likelihood, Noise, fit_noise
from doe.uncertainty.posterior import Posterior, sample_posterior
from doe.uncertainty.profile import Profiles, Verdict, VerdictKind, profile_likelihoods, verdicts

__all__ = [
    "AutoRegression",
    "Channel",
    "Likelihood",
    "Noise",
    "Posterior",
    "Profiles",
    "Verdict",
    "VerdictKind",
    "block_bootstrap",
    "fit_noise",
    "gauss_newton",
    "profile_likelihoods",
    "sample_posterior",
    "sandwich",
    "verdicts",
]
