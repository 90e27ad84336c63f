"""The uncertainty analysis of an optimum: inputs, profiles, other choices of the analyst, posterior.

Other choices are another end of the window and other force bins. The same data and runs are searched again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from doe import Box
from doe.uncertainty import VerdictKind
from kolsky.bars.signals.transducers import ForceBins, force_between
from kolsky.base.arrays import FloatArray
from kolsky.inverse.coarse_search import Model, at_inner_face, search
from kolsky.inverse.estimates import with_own_method
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import SAME_TIME, Observations, Prediction
from kolsky.inverse.refined_search import RefinedOptimum
from kolsky.inverse.result import (
    POSTERIOR,
    PROFILE,
    Declaration,
    Estimate,
    Identification,
    Method,
    PairMap,
    ParameterProfile,
    PosteriorSummary,
    Variation,
)
from kolsky.inverse.runner import Runner
from kolsky.uncertainty.declarations import caution, declarations
from kolsky.uncertainty.input_changes import InputDirections, input_directions
from kolsky.uncertainty.profiles import (
    TOLERANCE,
    WARN_WIDER,
    LinearisedOptimum,
    ParameterProfiles,
    posterior,
    profile_parameters,
    surrogate_of,
)

WINDOW_END, FORCE_BINS = "window_end", "force_bins"
WINDOW_SHARES = (0.9, 0.8)
"""Alternative window lengths, as shares of the full length [-]."""
LEAST_BINS = 8
"""Smallest number of force bins for a search."""
SEARCHED = "searched again on the surrogate"
AT_EDGE = "searched again on the surrogate, whose range the optimum would leave: at least so much"

Data = tuple[Objective, Model]
"""Modified data, and the model that predicts them."""


def variations(
    runner: Runner, answer: LinearisedOptimum, found: ParameterProfiles, check: Prediction
) -> tuple[Variation, ...]:
    """Shifts of the answer by other choices of window and bins, on the surrogate of its profiles.

    ``answer``: the optimum. ``found``: the surrogate. ``check``: prediction of the run on the refined mesh at
    the answer. Returns: shifts from the optimum of the same surrogate with the original choices.
    """
    first, last = runner.problem.shot.window
    width = float(np.diff(found.objective.observations.bins.edges).mean())
    data: Data = (found.objective, found.model.predict)
    before = _optimum(found, answer.x, data)
    ends = [first + share * (last - first) for share in WINDOW_SHARES]
    others: list[tuple[str, float, Callable[[], Data]]] = [
        *((WINDOW_END, end, partial(shorter_window, *data, end)) for end in ends),
        (FORCE_BINS, 2.0 * width, partial(wider_bins, *data)),
        (FORCE_BINS, 0.5 * width, partial(_narrower_bins, runner, answer, found, check)),
    ]
    told = []
    for key, value, make in others:
        try:
            after = _optimum(found, before, make())
        except ValueError as error:
            told.append(Variation(key, value, {}, f"not searched: {error}"))
            continue
        shifts = dict(zip(runner.problem.box.names, (after - before).tolist(), strict=True))
        edge = at_inner_face(after, found.box, runner.problem.box)
        told.append(Variation(key, value, shifts, AT_EDGE if edge else SEARCHED))
    return tuple(told)


def shorter_window(objective: Objective, model: Model, end: float) -> Data:
    """The data inside a window with an earlier end, and their model."""
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
    )
    front = objective.front.over(lambda rows: rows[..., left])
    rows = np.concatenate([inside, points[objective.counted]])
    shorter = replace(objective, observations=kept, counted=objective.counted[points], front=front)
    return shorter, lambda x: model(x)[:, rows]


def _first_bins(bins: ForceBins, end: float) -> ForceBins:
    """The bins that end before a time."""
    n = int((bins.edges[1:] <= end + SAME_TIME).sum())
    return ForceBins(bins.edges[: n + 1], bins.mean[:n], bins.sigma[:n], bins.n[:n])


def wider_bins(objective: Objective, model: Model) -> Data:
    """The data with pairs of transmitted-force bins merged. An odd last bin stays."""
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

    sigma = np.sqrt(np.add.reduceat((h * bins.sigma) ** 2, starts)) / together
    n = np.add.reduceat(bins.n - 1, starts) + 1
    wide = ForceBins(edges=bins.edges[np.append(starts, own)], mean=merged(bins.mean), sigma=sigma, n=n)

    def both(vectors: FloatArray) -> FloatArray:
        return np.concatenate([merged(vectors[..., :own]), vectors[..., own:]], axis=-1)

    seen = replace(objective.observations, bins=wide)
    wider = replace(objective, observations=seen, front=objective.front.over(both))
    return wider, lambda points: both(model(points))


def _narrower_bins(
    runner: Runner, answer: LinearisedOptimum, found: ParameterProfiles, check: Prediction
) -> Data:
    """The data with every transmitted-force bin split in two, and a surrogate of the same runs."""
    seen = answer.objective.observations
    edge = np.searchsorted(seen.force.time, seen.bins.edges - SAME_TIME)
    middle = (edge[1:] + edge[:-1]) // 2
    if (middle == edge[:-1]).any():
        raise ValueError("the force has no sample inside its bins")
    halves = np.sort(np.concatenate([edge, middle]))

    def halved(prediction: Prediction) -> Prediction:
        return replace(prediction, force_bins=_halves(prediction, seen.force.time, edge, halves))

    points, prediction = runner.on_surrogate_mesh()
    n, bins = len(seen.bins.mean), force_between(seen.force, halves)

    def twice(rows: FloatArray) -> FloatArray:
        """Rows of bins and points. Both halves of a bin have the value of the bin."""
        return np.concatenate([np.repeat(rows[..., :n], 2, axis=-1), rows[..., n:]], axis=-1)

    front = answer.objective.front.over(twice)
    objective = replace(answer.objective, observations=replace(seen, bins=bins), front=front)
    fine = replace(
        answer,
        objective=objective,
        # The model's bin means are divided between the halves as in the run.
        vector=np.concatenate(
            [
                np.repeat(answer.vector[:n] - check.force_bins[0, :n], 2)
                + halved(check).force_bins[0, : 2 * n],
                answer.vector[n:],
            ]
        ),
        slope=twice(answer.slope.T).T,
    )
    model, objective = surrogate_of((points, halved(prediction)), fine, found.box, runner.problem.box)
    # Both halves get the slope correction of the finer mesh for the bin.
    pairs = model.slope[: 2 * n].reshape(n, 2, -1).mean(axis=1)
    return objective, replace(
        model, slope=np.concatenate([pairs.repeat(2, axis=0), model.slope[2 * n :]])
    ).predict


def _halves(
    prediction: Prediction, time: FloatArray, edge: NDArray[np.intp], halves: NDArray[np.intp]
) -> FloatArray:
    """Means over the halves of bins by the trapezoid rule, corrected to the exact mean, [n, 2 n_bins]."""
    F = prediction.force
    steps = 0.5 * (F[:, 1:] + F[:, :-1]) * np.diff(time)
    impulse = np.concatenate([np.zeros((len(F), 1)), np.cumsum(steps, axis=1)], axis=1)
    whole, half = (np.diff(impulse[:, at], axis=1) / np.diff(time[at]) for at in (edge, halves))
    own = half + np.repeat(prediction.force_bins[:, : len(edge) - 1] - whole, 2, axis=1)
    return np.concatenate([own, prediction.force_bins[:, len(edge) - 1 :]], axis=1)


def _optimum(found: ParameterProfiles, start: FloatArray, data: Data) -> FloatArray:
    objective, model = data
    box: Box = found.box
    return search(box, objective, model, start=np.clip(start, box.lower, box.upper)).x


@dataclass(frozen=True)
class UncertaintyAnalysis:
    """Results of the uncertainty analysis of an optimum."""

    systematic: tuple[Declaration, ...]
    """Every key that shot.toml may declare uncertain."""
    profiles: tuple[ParameterProfile, ...]
    """One per free parameter; empty if they could not be computed."""
    ridge: PairMap | None
    posterior: PosteriorSummary | None
    found: ParameterProfiles | None
    """The surrogate and data used for the profiles; None if there are none."""
    warnings: tuple[str, ...]
    runs: int
    """Total number of simulations on the surrogate's mesh."""
    variations: tuple[Variation, ...] = ()
    """Other choices of the analyst; none if there is no surrogate to search."""
    directions: InputDirections | None = None

    def sigma_systematic(self, name: str) -> float:
        """Standard uncertainty of a parameter from the declared uncertainties, root sum of squares."""
        return float(np.sqrt(sum(part.shifts.get(name, 0.0) ** 2 for part in self.systematic)))

    def added_to(self, result: Identification) -> Identification:
        """The result with this analysis added; its intervals include the systematic part."""
        estimates = {
            name: replace(e, sigma_systematic=self.sigma_systematic(name))
            for name, e in result.estimates.items()
        }
        whole = replace(
            result,
            estimates=estimates,
            systematic=self.systematic,
            profiles=self.profiles,
            ridge=self.ridge,
            posterior=self.posterior,
            variations=self.variations,
            methods=(*result.methods, *self.methods(estimates)),
        )
        return with_own_method(whole)

    def methods(self, estimates: dict[str, Estimate]) -> Iterator[Method]:
        """Profile and posterior, compared with the answer."""
        if self.found is None:
            return
        answer = {name: e.on_mesh for name, e in estimates.items()}
        width = {name: 2.0 * e.sigma for name, e in estimates.items()}
        compared = partial(
            Method.compared, answer=answer, half_width=width, runs=self.runs, shared_runs=self.runs
        )
        own = all(profile.error <= TOLERANCE * profile.level for profile in self.profiles)
        ended = "confirmed by runs along the profiles" if own else "not confirmed by runs along them"
        values = dict(zip(answer, self.found.optimum.tolist(), strict=True))
        yield compared(PROFILE, values, converged=own, ended=ended)
        if self.posterior is not None:
            values = dict(zip(answer, self.posterior.median.tolist(), strict=False))  # discrepancies follow
            ended = f"{self.posterior.steps} steps of each walker"
            yield compared(POSTERIOR, values, converged=self.posterior.converged, ended=ended)


def analyse(runner: Runner, fine: RefinedOptimum) -> UncertaintyAnalysis:
    """Declared uncertainties, profiles, other choices of the analyst and, if requested, the posterior.

    ``fine``: the end of the search, with its run on the refined mesh.

    Raises ValueError if a run with another value of an input that is declared uncertain does not complete,
    and ImportError if the posterior is requested and emcee is not installed.
    """
    answer = LinearisedOptimum.of(fine)
    with runner.work.stage("inputs"):
        directions = input_directions(runner, answer.x, answer.objective, answer.vector)
        systematic = declarations(runner.problem.shot, directions)
    found: ParameterProfiles | None = None
    said = []
    try:
        with runner.work.stage("profile"):
            found = profile_parameters(runner, answer)
    except (ValueError, RuntimeError) as error:
        said.append(f"there are no profile likelihoods: {error}")
    varied: tuple[Variation, ...] = ()
    if found is not None:
        with runner.work.stage("choices"):
            varied = variations(runner, answer, found, fine.check.prediction)
    sampled = None
    if runner.problem.settings.bayes and found is not None:
        with runner.work.stage("posterior"):
            sampled = posterior(found, seed=runner.problem.settings.seed)
    profiles = () if found is None else found.profiles
    cautions = caution(systematic, dict(zip(directions.names, answer.x.tolist(), strict=True)))
    return UncertaintyAnalysis(
        systematic=systematic,
        profiles=profiles,
        ridge=None if found is None else found.map,
        posterior=sampled,
        found=found,
        warnings=(*said, *cautions, *analysis_warnings(profiles, sampled, noise_shares(answer, systematic))),
        runs=len(runner.on_surrogate_mesh()[0]),
        variations=varied,
        directions=directions,
    )


def noise_shares(answer: LinearisedOptimum, systematic: tuple[Declaration, ...]) -> FloatArray:
    """Share of noise in each parameter's variance by noise and declared inputs, shape [d]."""
    noise = np.diag(answer.objective.covariance(answer.slope, answer.vector))
    names = answer.local.names
    declared = [sum(part.shifts.get(name, 0.0) ** 2 for part in systematic) for name in names]
    return np.asarray(noise / (noise + declared))


def wider_interval(profile: ParameterProfile, noise_share: float) -> float:
    """Factor on the answer's interval if its noise part had the same relative error as the profile [-].

    The rise is proportional to the square of the distance. A rise that exceeds its level by the share e ends
    the interval at sqrt(1 - e) of the correct distance: the noise variance is larger by 1 / (1 - e).
    """
    e = profile.error / profile.level
    return float(np.sqrt(1.0 + noise_share * e / (1.0 - e))) if e < 1.0 else np.inf


def analysis_warnings(
    profiles: tuple[ParameterProfile, ...], sampled: PosteriorSummary | None, shares: FloatArray
) -> Iterator[str]:
    """Warnings on unconfirmed profiles, open profiles, and chains that are too short."""
    for profile, share in zip(profiles, shares, strict=False):
        if wider_interval(profile, float(share)) > WARN_WIDER:
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
