"""Profile likelihoods and posterior of a shot's parameters.

They use a surrogate, which runs along the profiles confirm.

The data vector is reduced to the components that can change. `sample_posterior` needs emcee (extra [bayes]).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from doe import Box, from_points
from doe.surrogates import ComponentSurrogate
from doe.uncertainty import Channel, Likelihood, Profiles, profile_likelihoods, sample_posterior, verdicts
from doe.uncertainty.profile import Profile
from kolsky.base.arrays import FloatArray
from kolsky.inverse.coarse_search import CorrectedSurrogate, jacobian, surrogate_kind
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Prediction
from kolsky.inverse.refined_search import RefinedOptimum
from kolsky.inverse.result import Interval, PairMap, ParameterProfile, PosteriorSummary
from kolsky.inverse.runner import Runner


def reduced_likelihood(model: CorrectedSurrogate, objective: Objective, box: Box) -> Likelihood:
    """The likelihood with the objective's weights. Its noise and discrepancies are fixed.

    The weighted residuals are reduced to a triangle T of shape [p, q + 1] and q coordinates of the points.
    """
    surrogate, prior = model.surrogate, objective.prior
    if not isinstance(surrogate, ComponentSurrogate):
        raise TypeError(f"a surrogate by principal components is needed, got {type(surrogate).__name__}")
    q = surrogate.n_components
    slope = np.zeros((len(objective.data), 0)) if np.isscalar(model.slope) else np.asarray(model.slope)
    anchor = 0.0 if model.anchor is None else model.anchor
    zero = surrogate.components.expand(np.zeros((1, q)))[0] + model.shift - objective.data
    columns = np.column_stack([surrogate.components.deviation(np.eye(q)).T, slope, zero])
    _, triangle = np.linalg.qr(objective.whitened(columns.T).T)

    def residuals(points: FloatArray) -> FloatArray:
        scores = surrogate.scores(points, extrapolate=True)
        s = np.hstack([scores, points - anchor]) if slope.size else scores
        found: FloatArray = s @ triangle[:, :-1].T + triangle[:, -1]
        return found if prior is None else np.hstack([found, prior.residuals(points)])

    p = len(triangle) + (0 if prior is None else len(prior.rows()))
    return Likelihood(box, residuals, np.zeros(p), [Channel("force, shape and prior", np.ones(p))])


def full_likelihood(model: CorrectedSurrogate, objective: Objective, box: Box) -> Likelihood:
    """The likelihood of the whole data vector, with one channel for the force and one for the outline."""
    n, force, shape = objective.n_force, objective.force_discrepancy, objective.shape_discrepancy
    channels = [Channel("force", objective.noise[:n], discrepancy=force)]
    if len(objective.data) > n:
        channels.append(Channel("outline", objective.noise[n:], discrepancy=shape))
    prior = objective.prior
    if prior is None:
        return Likelihood(box, model.predict, objective.data, channels)
    known = np.zeros(len(prior.rows()))

    def predict(points: FloatArray) -> FloatArray:
        return np.hstack([model.predict(points), prior.residuals(points)])

    channels.append(Channel("prior", np.ones(len(known))))
    return Likelihood(box, predict, np.concatenate([objective.data, known]), channels)


TOLERANCE = 0.1
"""The surrogate is accepted if runs along a profile differ by less in their rise, as a share of the level."""
WARN_WIDER = 4.0 / 3.0
"""A profile is reported if its error would widen the answer's interval by more than this factor."""
ROUNDS = 3
"""Maximum number of times that runs along the profiles are added to a surrogate."""
ALONG = 6
"""Number of runs along each profile to test the surrogate."""
REACH = 1.5
"""Rise up to which a profile is tested, divided by the level."""
MAP_REACH = 3.0
"""Rise up to which a map is drawn, divided by the level."""
NEAR = 8.0
"""Half edge of the first box for profiles of several parameters, in units of sigma."""
APART = 1e-2
"""Smallest distance of two runs of a surrogate, in the unit box. Rounding of single precision would give
closer runs a slope, and a parameter that the data do not contain a bound."""
MAP = 81
"""Number of values along an edge of a map."""


@dataclass(frozen=True)
class LinearisedOptimum:
    """The optimum on the refined mesh, and the response linearised about it."""

    x: FloatArray
    """The optimum in SI, shape [d]."""
    local: Box
    objective: Objective
    vector: FloatArray
    """Predicted data vector at the optimum on the refined mesh, shape [k]."""
    slope: FloatArray
    """Jacobian of `vector`, shape [k, d]."""
    smooth: bool = False
    """True if the response is smooth about the optimum. For one parameter it always is."""

    @classmethod
    def of(cls, fine: RefinedOptimum) -> LinearisedOptimum:
        """The optimum by the model corrected to the last run on the refined mesh."""
        x, local = fine.x, fine.box
        slope = jacobian(fine.model, local, x)
        return cls(x, local, fine.objective, fine.model(x)[0], slope, fine.roughness is None)

    @property
    def correlation(self) -> FloatArray:
        """Factor on each parameter's variance by the time correlation of the residuals, >= 1."""
        information = self.objective.information(self.slope)
        alone = np.linalg.inv(information + self.objective.prior_precision(len(self.x)))
        together = self.objective.covariance(self.slope, self.vector)
        return np.asarray(np.maximum(np.diag(together) / np.diag(alone), 1.0))


@dataclass(frozen=True)
class ParameterProfiles:
    """The profiles, and the surrogate and data used for them."""

    profiles: tuple[ParameterProfile, ...]
    map: PairMap | None
    """The rise over the plane of two free parameters. None for one parameter, or for more than two."""
    model: CorrectedSurrogate
    """The surrogate, corrected to the refined mesh at the optimum."""
    objective: Objective
    """The objective over the outline points that all runs of the surrogate reach."""
    box: Box
    optimum: FloatArray
    """The most likely point on this surrogate, in SI, shape [d]."""


def profile_parameters(runner: Runner, answer: LinearisedOptimum) -> ParameterProfiles:
    """Profile every free parameter.

    The first surrogate covers a box near the answer. If the data do not close an interval there, it covers
    the whole box. Runs along the profiles test the surrogate and are added to it until the rise agrees to a
    tenth of the level. Raises ValueError or RuntimeError with the reason if no surrogate or profile can be
    made.
    """
    local, whole = _near(runner, answer), runner.problem.box
    found = _in_box(runner, answer, local)
    inside = np.greater([local.lower, whole.upper], [whole.lower, local.upper])
    open_ends = np.isnan([profile.interval for profile in found.profiles]).T
    return _in_box(runner, answer, whole) if (open_ends & inside).any() else found


def _near(runner: Runner, answer: LinearisedOptimum) -> Box:
    """First box of the profiles: the last design's, or for several parameters `NEAR` sigma, with new runs."""
    whole = runner.problem.box
    if whole.dimension == 1:
        return answer.local
    reach = NEAR * np.sqrt(np.diag(answer.objective.covariance(answer.slope, answer.vector)))
    lower, upper = np.maximum(answer.x - reach, whole.lower), np.minimum(answer.x + reach, whole.upper)
    box = replace(whole, lower=tuple(lower.tolist()), upper=tuple(upper.tolist()))
    d = box.dimension
    enough = (d + 1) * (d + 2) // 2 + d  # number of coefficients of a quadratic
    if box != whole and box.contains(runner.on_surrogate_mesh()[0]).sum() < enough:
        runner.simulate("profile", runner.design(box), runner.problem.numerics)
    return box


def _in_box(runner: Runner, answer: LinearisedOptimum, box: Box) -> ParameterProfiles:
    worst = np.inf
    for turn in range(ROUNDS):
        model, objective = surrogate_of(runner.on_surrogate_mesh(), answer, box, runner.problem.box)
        likelihood = reduced_likelihood(model, objective, box)
        start = np.clip(answer.x, box.lower, box.upper)
        found = profile_likelihoods(likelihood, start, correlation=answer.correlation)
        errors = _test_along(runner, found, model, objective)
        before, worst = worst, float(np.max(errors / [profile.level for profile in found.profiles]))
        # If further runs do not halve the error, the response is rough. More runs then do not help.
        if turn == ROUNDS - 1 or worst <= TOLERANCE or worst > 0.5 * before:
            break
    told = verdicts(likelihood, found)
    return ParameterProfiles(
        profiles=tuple(
            ParameterProfile(
                name=profile.name,
                values=profile.values,
                rise=profile.rise,
                points=profile.points,
                level=profile.level,
                correlation=float(share),
                interval=_ends(profile.interval),
                alone=_ends(profile.conditional),
                verdict=verdict.kind.value,
                text=verdict.text,
                error=float(error),
            )
            for profile, verdict, share, error in zip(
                found.profiles, told, answer.correlation, errors, strict=True
            )
        ),
        map=_pair_map(likelihood, found) if box.dimension == 2 else None,
        model=model,
        objective=objective,
        box=box,
        optimum=found.optimum.point,
    )


def surrogate_of(
    runs: tuple[FloatArray, Prediction], answer: LinearisedOptimum, box: Box, whole: Box
) -> tuple[CorrectedSurrogate, Objective]:
    """The surrogate of all runs in a box, corrected to the refined mesh at the optimum, and its objective.

    Near the answer, it agrees with value and slope there; in the whole box in value only, because the box is
    too wide for a slope from two neighbouring runs. ``runs``: points and predictions on the surrogate's mesh.
    ``box``, ``whole``: range of the surrogate and of the design. The objective covers the points that all
    runs reach.
    """
    points, prediction = runs
    use = box.contains(points)
    smooth = answer.smooth and box != whole
    least = APART if smooth or box.dimension == 1 else 1e-3 * APART  # a process has a nugget against twins
    use[use] = _apart_in_box(box.unit(points[use]), least)
    counted = answer.objective.counted & prediction.inside[use].all(axis=0)
    objective = replace(answer.objective, counted=counted)
    kept = np.concatenate([np.ones(objective.n_force, dtype=bool), counted[answer.objective.counted]])
    surrogate = surrogate_kind(box, smooth=smooth).fit(
        box, points[use], objective.vectors(prediction)[use], scale=objective.noise
    )
    plain = CorrectedSurrogate(surrogate).through(answer.x, answer.vector[kept])
    if box == whole:
        return plain, objective
    steeper = answer.slope[kept] - jacobian(plain.predict, box, answer.x)
    return replace(plain, slope=steeper), objective


def _apart_in_box(unit: FloatArray, least: float) -> NDArray[np.bool_]:
    """Mask of the points not too close to an earlier one; close pairs make a surrogate ill-conditioned."""
    kept: list[int] = []
    for row in range(len(unit)):
        if all(np.linalg.norm(unit[row] - unit[other]) >= least for other in kept):
            kept.append(row)
    return np.isin(np.arange(len(unit)), kept)


def _test_along(
    runner: Runner, found: Profiles, model: CorrectedSurrogate, objective: Objective
) -> FloatArray:
    """Largest error of the rise at runs along each profile, shape [d]; infinite for a failed run."""
    rows = [_along(profile) for profile in found.profiles]
    points = np.concatenate([profile.points[row] for profile, row in zip(found.profiles, rows, strict=True)])
    runs = runner.simulate("profile", from_points(runner.problem.box, points), runner.problem.numerics)
    error = np.full(len(points), np.inf)
    said, plain = model.predict(runs.points), model.surrogate.predict(runs.points, extrapolate=True)
    ran = objective.vectors(runs.prediction) + (said - plain)
    for point, pair in zip(runs.points, zip(ran, said, strict=True), strict=True):
        here = (points == point).all(axis=1)
        chi2 = objective.chi2(np.stack(pair))
        error[here] = np.abs(np.diff(chi2))[0] if np.isfinite(chi2).all() else np.inf
    ends = np.cumsum([len(row) for row in rows])
    return np.array([part.max() for part in np.split(error, ends[:-1])])


def _along(profile: Profile) -> NDArray[np.intp]:
    """Rows of a profile to run. They are evenly spread over the range of small rise, both ends included."""
    low = np.flatnonzero(profile.rise <= REACH * profile.level)
    return np.unique(low[np.linspace(0, len(low) - 1, ALONG).round().astype(int)])


def _ends(interval: tuple[float | None, float | None]) -> Interval:
    low, high = (np.nan if end is None else float(end) for end in interval)
    return low, high


def _pair_map(likelihood: Likelihood, found: Profiles) -> PairMap:
    """The rise over the plane of two free parameters."""
    box = likelihood.box
    # the range of each profile with a rise small enough for the map
    low_rise = [one.values[one.rise <= MAP_REACH * one.level] for one in found.profiles]
    spans = np.array([values[[0, -1]] for values in low_rise])
    margin = 0.05 * np.diff(spans, axis=1)[:, 0]
    low = np.maximum(spans[:, 0] - margin, box.lower)
    high = np.minimum(spans[:, 1] + margin, box.upper)
    x, y = (np.linspace(a, b, MAP) for a, b in zip(low, high, strict=True))
    points = np.stack([axis.ravel() for axis in np.meshgrid(x, y)], axis=1)
    deviance = (likelihood.residuals(box.unit(points)) ** 2).sum(axis=1)
    rise = np.maximum(deviance - found.optimum.deviance, 0.0)
    return PairMap((box.names[0], box.names[1]), x, y, rise.reshape(MAP, MAP))


TAU_SCALE = 10.0
"""Scale of the half-normal prior of a discrepancy, divided by the median noise of its channel."""
MOST_SAMPLES = 4000
"""Maximum number of stored samples."""
NAMES = {"force": "force_discrepancy", "outline": "shape_discrepancy"}
"""Names of the channels' discrepancies in a result."""


def posterior(found: ParameterProfiles, *, seed: int) -> PosteriorSummary:
    """Sample parameters and discrepancies.

    The prior of a parameter is uniform in the box of the profiles, times a Gaussian by its declared
    uncertainty. The time correlation of the residuals enters as a power of the likelihood: one divided by the
    mean factor of the profiles. Raises ImportError if emcee is not installed: `pip install 'kolsky[bayes]'`.
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
    every = max(1, -(-len(samples) // MOST_SAMPLES))
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
