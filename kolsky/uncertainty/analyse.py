"""The uncertainty analysis of an optimum: declared inputs, profiles, other choices, posterior."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from doe.uncertainty import VerdictKind
from kolsky.inverse.method_comparison import POSTERIOR, PROFILE, Method
from kolsky.inverse.observations import Prediction
from kolsky.inverse.result import Estimate, Identification
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.inverse.uncertainty_results import (
    Declaration,
    PairMap,
    ParameterProfile,
    PosteriorSummary,
    Variation,
)
from kolsky.uncertainty.input_directions import InputDirections, input_directions
from kolsky.uncertainty.profile_likelihood import (
    SAID,
    TOLERANCE,
    LinearisedOptimum,
    ParameterProfiles,
    profile_parameters,
)
from kolsky.uncertainty.sensitivities import caution
from kolsky.uncertainty.systematic import declarations
from kolsky.uncertainty.variations import variations


@dataclass(frozen=True)
class UncertaintyAnalysis:
    """Results of the uncertainty analysis of an optimum."""

    systematic: tuple[Declaration, ...]
    """Every key that shot.toml may declare uncertain."""
    profiles: tuple[ParameterProfile, ...]
    """One a free parameter; none if they could not be made."""
    ridge: PairMap | None
    """The plane of two free parameters."""
    posterior: PosteriorSummary | None
    """If it was asked for."""
    found: ParameterProfiles | None
    """What the profiles rest on."""
    warnings: tuple[str, ...]
    """What a user should know of them."""
    runs: int
    """Simulations on the surrogate's mesh when all was done."""
    variations: tuple[Variation, ...] = ()
    """Other choices of the analyst; none if there is no surrogate to search."""
    directions: InputDirections | None = None
    """What each input does to the data vector, and to the answer."""

    def sigma_systematic(self, name: str) -> float:
        """Standard uncertainty of a parameter from the declared ones, root sum of squares."""
        return float(np.sqrt(sum(part.shifts.get(name, 0.0) ** 2 for part in self.systematic)))

    def added_to(self, result: Identification) -> Identification:
        """The result with all of it, its intervals with the systematic part."""
        estimates = {
            name: replace(e, sigma_systematic=self.sigma_systematic(name))
            for name, e in result.estimates.items()
        }
        return replace(
            result,
            estimates=estimates,
            systematic=self.systematic,
            profiles=self.profiles,
            ridge=self.ridge,
            posterior=self.posterior,
            variations=self.variations,
            methods=(*result.methods, *self.methods(estimates)),
        )

    def methods(self, estimates: dict[str, Estimate]) -> Iterator[Method]:
        """Profile and posterior beside the answer."""
        if self.found is None:
            return
        answer = {name: e.on_mesh for name, e in estimates.items()}
        width = {name: 2.0 * e.sigma for name, e in estimates.items()}
        own = all(profile.error <= TOLERANCE * profile.level for profile in self.profiles)
        yield Method.compared(
            PROFILE,
            dict(zip(answer, self.found.optimum.tolist(), strict=True)),
            answer=answer,
            half_width=width,
            runs=self.runs,
            shared_runs=self.runs,
            converged=own,
            ended="confirmed by runs along the profiles" if own else "not confirmed by runs along them",
        )
        if self.posterior is not None:
            yield Method.compared(
                POSTERIOR,
                dict(zip(answer, self.posterior.median.tolist(), strict=False)),  # discrepancies follow
                answer=answer,
                half_width=width,
                runs=self.runs,
                shared_runs=self.runs,
                converged=self.posterior.converged,
                ended=f"{self.posterior.steps} steps of each walker",
            )


def analyse(
    stages: StagedRuns, answer: LinearisedOptimum, check: Prediction, *, bayes: bool = False
) -> UncertaintyAnalysis:
    """Declared uncertainties, profiles, other choices and, if asked for, the posterior.

    Parameters
    ----------
    stages
        The identification's simulations.
    answer
        Where it ended.
    check
        What the run on the refined mesh there predicts.
    bayes
        Sample the posterior too.

    Raises
    ------
    ValueError
        If a run with a changed input does not complete.
    ImportError
        If the posterior is asked for and emcee is not installed.
    """
    started = time.perf_counter()
    directions = input_directions(stages, answer.x, answer.objective)
    systematic = declarations(stages, directions)
    stages.seconds["inputs"] = time.perf_counter() - started
    started = time.perf_counter()
    found: ParameterProfiles | None = None
    said = []
    try:
        found = profile_parameters(stages, answer)
    except (ValueError, RuntimeError) as error:
        said.append(f"there are no profile likelihoods: {error}")
    stages.seconds["profile"] = time.perf_counter() - started
    varied: tuple[Variation, ...] = ()
    if found is not None:
        started = time.perf_counter()
        varied = variations(stages, answer, found, check)
        stages.seconds["choices"] = time.perf_counter() - started
    sampled = None
    if bayes and found is not None:
        started = time.perf_counter()
        sampled = posterior_of(found, stages.settings.seed)
        stages.seconds["posterior"] = time.perf_counter() - started
    profiles = () if found is None else found.profiles
    cautions = caution(systematic, dict(zip(directions.names, answer.x.tolist(), strict=True)))
    return UncertaintyAnalysis(
        systematic=systematic,
        profiles=profiles,
        ridge=None if found is None else found.map,
        posterior=sampled,
        found=found,
        warnings=(*said, *cautions, *analysis_warnings(profiles, sampled)),
        runs=len(stages.on_surrogate_mesh()[0]),
        variations=varied,
        directions=directions,
    )


def posterior_of(found: ParameterProfiles, seed: int) -> PosteriorSummary:
    """The posterior; imported when it is asked for."""
    from kolsky.uncertainty.posterior import posterior

    return posterior(found, seed=seed)


def analysis_warnings(
    profiles: tuple[ParameterProfile, ...], sampled: PosteriorSummary | None
) -> Iterator[str]:
    """Say which profiles are not confirmed or not closed, and that chains are too short."""
    for profile in profiles:
        if profile.error > SAID * profile.level:
            yield (
                f"the profile likelihood of {profile.name} is not confirmed: runs along it differ by "
                f"{profile.error:.2g} where the interval ends at a rise of {profile.level:.3g}; widen or "
                "shrink the design with --free NAME=LOW:HIGH, or hold a parameter"
            )
        if profile.verdict != VerdictKind.IDENTIFIED.value:
            yield f"profile likelihood: {profile.text}"
    if sampled is not None and not sampled.converged:
        yield (
            f"the chains of the posterior are too short after {sampled.steps} steps (autocorrelation time "
            f"{sampled.autocorrelation:.3g}): its intervals are rough"
        )
