"""The result of an identification: estimates with intervals, and the records that support them (SI).

`Identification` contains estimates, routes, the check run with the data, goodness of fit, clocks, likely
causes, profiles, declared inputs, other choices of the analyst and other methods.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from math import inf, isfinite, nan
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from dic.views import ResultViews
from explicit import Response
from kolsky.base.arrays import FloatArray
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.inverse.run_table import DesignTable, Terms

LEAST_SQUARES = "surrogate and least squares"
PROFILE = "profile likelihood"
POSTERIOR = "posterior median"

AGREEMENT = 0.25
"""Methods agree if each lies within this share of the k = 2 half width of the answer."""


@dataclass(frozen=True)
class Method:
    """The free parameters by one search method, from the same data."""

    name: str
    """`LEAST_SQUARES`, `PROFILE` or `POSTERIOR`."""
    values: dict[str, float]
    """The values it finds, in parameter units."""
    distances: dict[str, float]
    """Value minus the answer over half the answer's k = 2 interval [-]; NaN without a value or a width."""
    runs: int
    """Number of simulations, including those of its surrogate."""
    shared_runs: int = 0
    """Number of these simulations that another method made, all of them with the answer's surrogate."""
    converged: bool = True
    ended: str = ""

    @classmethod
    def compared(
        cls,
        name: str,
        values: Mapping[str, float],
        *,
        answer: Mapping[str, float],
        half_width: Mapping[str, float],
        **known: Any,
    ) -> Method:
        """Compare a method's result with the answer and half its k = 2 interval, in parameter units.

        The other arguments are the fields of this name. Raises ValueError if the names differ.
        """
        if not set(values) == set(answer) == set(half_width):
            raise ValueError(
                f"{name}: values for {sorted(values)}, the answer is for {sorted(answer)} and its interval "
                f"for {sorted(half_width)}"
            )
        distances = {
            p: (value - answer[p]) / half_width[p] if half_width[p] > 0.0 else nan
            for p, value in values.items()
        }
        return cls(name, dict(values), distances, **known)


def disagreements(methods: Iterable[Method]) -> Iterator[tuple[Method, str, float]]:
    """Method, parameter and distance, for distances above `AGREEMENT` and unknown distances."""
    for method in methods:
        for parameter, distance in method.distances.items():
            if not isfinite(distance) or abs(distance) > AGREEMENT:
                yield method, parameter, distance


FORCE, OUTLINE = "force", "outline"
"""Names of the channels."""
NOISE, MESH = "noise", "mesh"
"""Keys of `FitQuality.predicted`: the measured noise of the channel, the error of mesh and step."""
FLYER, CURVE = "flyer motion", "material curve"
"""Keys of `FitQuality.predicted`: the effect of the noise of two inputs on the model's prediction."""


DECLARED = "declared inputs"
"""All declarations in [uncertainty] of the shot file as one source."""
LATE = 3.0
"""A clock is wrong if its lag exceeds this many standard uncertainties."""


@dataclass(frozen=True)
class FitQuality:
    """The residual of one channel at the optimum, and the residual expected of a correct model."""

    channel: str
    """ "force" or "outline"."""
    unit: str
    """Unit of the channel: "N" or "m"."""
    values: int
    """Number of force bins or outline points used."""
    residual: float
    """Root mean square of measurement minus model, in `unit`."""
    predicted: Mapping[str, float]
    """Root mean square of the residual expected of a correct model, by source, in `unit`: "noise" and, if
    known, "flyer motion", "material curve" and "mesh"."""
    peak: float
    """Largest size of the signal, in `unit`: the largest force; the spread of the outline's radii."""
    slow_residual: float
    """Root mean square of the residual's means over an eighth of the window (and a third of the outline's
    points), in `unit`. In these means noise and ringing average out, but not the effect of a wrong input."""
    slow_expected: float
    """Root mean square of the same means expected of a correct model, from all sources, in `unit`."""
    chi2: float
    """Mean square of the residual divided by that of the noise [-]; 1 if only noise remains."""
    discrepancy_share: float
    """Share of the discrepancy tau in the variance of the weights [-]; 0 if only noise remains."""
    correlation: float
    """Correlation of neighbouring residuals (force: in time; outline: along one frame) [-]."""
    whiteness: float
    """Probability that white noise has at least this correlation (Ljung-Box, one lag) [-]."""
    weight: Mapping[str, float] = field(default_factory=dict)
    """Share of the information on each free parameter that comes from this channel [-]."""
    limit: float = inf
    """Largest `excess` at which the model explains the shot [-]; see `kolsky.diagnosis.fit_quality`."""
    slow_limit: float = inf
    """Largest `slow_excess` at which the model explains the shot [-]."""

    @property
    def expected(self) -> float:
        """Root mean square of the residual of a correct model, of all sources, in `unit`."""
        return float(sum(part**2 for part in self.predicted.values()) ** 0.5)

    def spread(self, noise: FloatArray) -> FloatArray:
        """Standard deviation of the residual of a correct model at each value, in `unit`, shape of ``noise``.

        ``noise``: of each value. The other sources have one root mean square at all values. That of the
        spread is `expected`.
        """
        others = sum(part**2 for source, part in self.predicted.items() if source != NOISE)
        return np.sqrt(noise**2 + others)

    @property
    def over_noise(self) -> float:
        """Residual divided by the measured noise [-]."""
        noise = self.predicted.get(NOISE, nan)
        return self.residual / noise if noise > 0.0 else nan

    @property
    def over_peak(self) -> float:
        """Residual divided by the largest size of the signal [-]."""
        return self.residual / self.peak if self.peak > 0.0 else nan

    @property
    def excess(self) -> float:
        """Residual divided by the residual expected of a correct model [-]."""
        return self.residual / self.expected if self.expected > 0.0 else nan

    @property
    def slow_excess(self) -> float:
        """Slow residual divided by the slow residual expected of a correct model [-]."""
        return self.slow_residual / self.slow_expected if self.slow_expected > 0.0 else nan

    @property
    def explained(self) -> bool:
        """True if a correct model could have this residual. False if the residual is unknown."""
        return self.excess <= self.limit and self.slow_excess <= self.slow_limit

    @property
    def noticed(self) -> float:
        """Root mean square residual beyond which the check fails, in `unit`."""
        return self.limit * self.expected

    @property
    def noticed_without_declared(self) -> float:
        """`noticed` without declared uncertainties, in `unit`."""
        declared = self.predicted.get(DECLARED, 0.0)
        return self.limit * max(self.expected**2 - declared**2, 0.0) ** 0.5

    @property
    def testable(self) -> bool:
        """False if the check passes only because of declared uncertainties.

        The expected residual and the residual then both exceed the limit without them. A misfit that noise,
        flyer and mesh exclude would pass, because every input may be wrong by its declared uncertainty.
        """
        bare = self.noticed_without_declared
        return self.expected <= bare or self.residual <= bare


@dataclass(frozen=True)
class ClockLag:
    """Delay of one recording relative to the other two, estimated from the residual of the model."""

    recording: str
    """The delayed recording: "force", "outline" or "flyer"."""
    lag: float
    """Delay of its declared times [s]; negative if they are too early."""
    sigma: float
    """Standard uncertainty of `lag` [s]; NaN if its search did not converge."""
    evidence: float
    """Decrease of -2 ln L by this lag alone, with the free parameters refitted [-]."""
    explains: bool
    """True if the model explains force and outline after the correction of this lag."""
    file: str
    key: str
    """The key of shot.toml that corrects it."""

    @property
    def significance(self) -> float:
        """Size of the lag divided by its standard uncertainty [-]; 0 if the uncertainty is unknown."""
        return abs(self.lag) / self.sigma if self.sigma > 0.0 else 0.0

    @property
    def noticed(self) -> float:
        """Size of the lag beyond which the clock is late [s]; NaN if its uncertainty is not known."""
        return LATE * self.sigma


COVERAGE = 2.0
"""An input is not wrong if its change is within this many of its declared standard uncertainties."""


@dataclass(frozen=True)
class CauseFinding:
    """One input with its best-fitting change, and the free parameters identified again."""

    key: str
    """Key of the input in shot.toml, or a name of another cause; unique."""
    words: str
    unit: str
    """Unit of `exact` and `value`; "1" for a factor or a plain number."""
    exact: float
    """Declared value: 1 for a factor, 0 for an offset; NaN for an input without a number."""
    value: float
    """Value that fits the data best; NaN if it could not be tried."""
    sigma: float
    """Standard uncertainty of `value`; NaN if it has none."""
    explained: float
    """Share of the misfit beyond that of a correct model that the change removes [-]."""
    evidence: float
    """Twice the log likelihood ratio, with one residual per time and channel [-]; 0 if explained without."""
    probability: float
    """Probability of such a change by chance [-], corrected for the inputs tried (Holm 1979)."""
    parameters: Mapping[str, float]
    """The free parameters with this change, on the surrogate's mesh, corrected to the refined mesh."""
    sigmas: Mapping[str, float]
    """Their standard uncertainties from residuals and flyer motion; empty if not known."""
    named: bool
    """True if it is listed as a likely cause."""
    alike: tuple[str, ...] = ()
    """Keys of other inputs with an effect that the data cannot distinguish from this one."""
    beside: str = ""
    """Key of the likelier cause that was free at the same time; empty if only this one was free."""
    status: str = ""
    """Reason why the input could not be tried; empty if it was tried."""
    declared_sigma: float | None = None
    """Its declared standard uncertainty, in its unit; None if none is declared."""
    solved: Mapping[str, float] = field(default_factory=dict)
    """The free parameters by a complete identification with the input changed; empty if none was made."""
    solved_sigmas: Mapping[str, float] = field(default_factory=dict)
    """Their standard uncertainties."""

    @property
    def change(self) -> float:
        """Value minus what is declared, in its unit."""
        return self.value - self.exact if self.exact == self.exact else nan

    @property
    def within(self) -> bool:
        """True if the change is within k = 2 of the declared uncertainty. The input is then not in error."""
        return self.declared_sigma is not None and abs(self.change) <= COVERAGE * self.declared_sigma


Interval = tuple[float, float]
"""Lower and upper end in the parameter's unit; NaN at an open end."""


@dataclass(frozen=True)
class ParameterProfile:
    """The profile likelihood of one parameter, from the noise of force and outline only."""

    name: str
    values: FloatArray
    """The fixed values of the parameter, ascending, in its unit, shape [n]."""
    rise: FloatArray
    """Rise of -2 ln L above its smallest value, with the other parameters re-optimised [-], shape [n]."""
    points: FloatArray
    """The most likely points at these values, in SI, shape [n, d], in the order of the free parameters."""
    level: float
    """Rise at the ends of the 95 % interval [-]: 3.84 times `correlation`."""
    correlation: float
    """Factor on this parameter's variance by the time correlation of the residuals, >= 1 [-]."""
    interval: Interval
    alone: Interval
    """Another profile, with the other parameters held at their optimum."""
    verdict: str
    """Value of a `doe.uncertainty.VerdictKind`."""
    text: str
    """The verdict in a sentence, with the direction of a ridge."""
    error: float
    """Largest difference of the rise from that of runs on the surrogate's mesh along the profile [-]."""


@dataclass(frozen=True)
class PairMap:
    """The rise of -2 ln L over the plane of the two free parameters."""

    names: tuple[str, str]
    x: FloatArray
    """Values of the first, in SI, shape [nx]."""
    y: FloatArray
    """Values of the second, in SI, shape [ny]."""
    rise: FloatArray
    """Rise of -2 ln L above its smallest value [-], shape [ny, nx]."""


@dataclass(frozen=True)
class Declaration:
    """An input that shot.toml may declare uncertain, and its effect on the answer."""

    key: str
    """Its key in [uncertainty]."""
    sigma: float
    """Declared standard uncertainty, in SI or relative; NaN if none is declared."""
    unit: str
    """Unit of `sigma`; "1" for a share of the quantity or a plain number."""
    shifts: Mapping[str, float]
    """Shift of each free parameter if the input increases by `sigma`, in SI; empty if it was not varied."""
    status: str
    """"varied", "not declared, counted as exact", or the reason why the input does not apply."""
    amount: float = float("nan")
    """A reference change: 1 % of a scale, 1 us of a clock, 10 um of a position, in `unit`; else NaN."""
    moves: Mapping[str, float] = field(default_factory=dict)
    """Shift of each free parameter if the input increases by `amount`, in SI; empty if `amount` is NaN."""
    visible: float = float("nan")
    """Share of the change of "prediction minus data" that remains in the residual after the parameters are
    refitted [-], 0 to 1. If it is near zero, the data cannot reveal an error of the input. NaN if `amount` is
    NaN."""
    alike: tuple[str, ...] = ()
    """Keys of inputs with the same effect on the residual. The data cannot distinguish them."""


@dataclass(frozen=True)
class Variation:
    """Another choice of the analyst with the same data and runs, searched again on the surrogate."""

    key: str
    """The choice: "window_end" or "force_bins"."""
    value: float
    """The other choice: end of the window, or width of the force's bins [s]."""
    shifts: Mapping[str, float]
    """Shift of each parameter on the refined mesh, in SI, not corrected for the mesh; empty if it failed."""
    status: str


@dataclass(frozen=True)
class PosteriorSummary:
    """The posterior by Markov chains, from the noise of force and outline only."""

    names: tuple[str, ...]
    """Free parameters, then the sampled discrepancies, length n."""
    samples: FloatArray
    """A subset of the samples, for figures, in SI, shape [m, n]."""
    median: FloatArray
    """Median of all samples, in SI, shape [n]."""
    lower: FloatArray
    """2.5 % quantile of all samples, shape [n]."""
    upper: FloatArray
    """97.5 % quantile of all samples, shape [n]."""
    converged: bool
    """True if the chains are much longer than their autocorrelation time, and this time is steady."""
    autocorrelation: float
    """Longest integrated autocorrelation time [steps]."""
    steps: int
    acceptance: float
    """Share of accepted moves [-]."""
    power: float
    """Power of the likelihood, 1 divided by the mean `ParameterProfile.correlation` [-]."""
    prior: str


class Verdict(StrEnum):
    """The outcome of the search for one parameter."""

    IDENTIFIED = "identified"
    FORCE_ALONE = "identified by the force alone"
    OUTLINE_ALONE = "identified by the outline alone"
    UNEXPLAINED = "not explained by the model"
    CONTRADICTED = "force and outline contradict each other"
    SHOTS_CONTRADICT = "the shots contradict each other"
    AT_BOUND = "at a bound of the design"
    BOUND_REACHED = "not distinguished from a bound of the design"
    OTHER_VALLEY = "not distinguished from another valley of the misfit"
    CONDITIONAL = "only if the parameter at its bound is right"
    NOT_SEEN = "not seen by the data"
    PLATEAU = "on a plateau of a rough misfit"
    DISAGREEING = "the check run disagrees with the surrogate"
    FAILED = "no simulation of the design completed"

    @classmethod
    def _missing_(cls, value: object) -> Self | None:
        """The words of result files from versions before 0.1.0."""
        words = str(value).replace("not told from", "not distinguished from")
        return next((one for one in cls if one.value == words), None)

    @property
    def confirmed(self) -> bool:
        """True if a run on the refined mesh confirmed the optimum."""
        return self not in (Verdict.DISAGREEING, Verdict.FAILED)

    @property
    def identified(self) -> bool:
        """True if the value is valid: inside the design, confirmed, and the model explains the data."""
        return self in (Verdict.IDENTIFIED, Verdict.FORCE_ALONE, Verdict.OUTLINE_ALONE)


@dataclass(frozen=True)
class Estimate:
    """One free parameter."""

    name: str
    unit: str
    """Unit, "1" if none."""
    value: float
    """Optimum of the joint chi-square, corrected for the mesh: `on_mesh` plus `mesh_correction`."""
    sigma_noise: float
    """Standard uncertainty from the measured noise (force, shape, flyer motion, material curve)."""
    sigma_numerical: float
    """Standard uncertainty from the numerics, root sum of squares of `numerical_parts`."""
    mesh_shift: float
    """Value on the refined mesh minus value on the surrogate's mesh."""
    noise_parts: dict[str, float]
    """Parts of `sigma_noise` by source: "force and shape", "force scale", "motion scale", "flyer motion" (the
    noise of the measured front-face motion), "material curve"."""
    outcome: Verdict
    sigma_systematic: float = 0.0
    """Standard uncertainty from the inputs declared in [uncertainty] of shot.toml, 0 if none is declared."""
    numerical_parts: dict[str, float] = field(default_factory=dict)
    """Parts of `sigma_numerical` by source. "mesh" is the error of mesh, step and element that remains after
    the correction. "roughness" is that of the response, if surfaces slide or several parameters are free."""
    mesh_correction: float = 0.0
    """Extrapolation from the refined mesh to an infinitely fine one. `value` includes it. Its standard
    uncertainty is the part "mesh" of `numerical_parts`. 0 in results without this correction."""
    searched: tuple[float, float] = (-np.inf, np.inf)
    """Range of the search; infinite in result files without it."""

    @property
    def on_mesh(self) -> float:
        """Optimum on the refined mesh, used by the check run, the profiles and the comparison of methods."""
        return self.value - self.mesh_correction

    @property
    def sigma(self) -> float:
        """Combined standard uncertainty, root sum of squares."""
        return float(np.sqrt(self.sigma_noise**2 + self.sigma_numerical**2 + self.sigma_systematic**2))

    @property
    def interval(self) -> tuple[float, float]:
        """The k = 2 interval, see `within`."""
        return self.within(2.0 * self.sigma)

    def within(self, half: float) -> tuple[float, float]:
        """The interval of this half width about the value, limited to the range of the search."""
        low, high = self.searched
        return max(self.value - half, low), min(self.value + half, high)


@dataclass(frozen=True)
class Contribution:
    """Contribution of one source to the standard uncertainties."""

    source: str
    """ "force and shape", "flyer motion", "material curve", "force scale", "motion scale", "mesh",
    "roughness", "declared inputs"."""
    sigma: dict[str, float]
    """Standard uncertainty of each parameter due to this source, in parameter units."""


@dataclass(frozen=True)
class Route:
    """The optimum for one part of the data."""

    name: str
    """ "joint", "force only", "shape only", "paper" (the cost Phi of Eq. (M.5))."""
    parameters: dict[str, float]
    """Optimum in parameter units, corrected for the error of the refined mesh by `correction`."""
    cost: float
    sigma: dict[str, float]
    """Combined standard uncertainty of this route by its budget; empty for the paper's cost."""
    correction: dict[str, float] = field(default_factory=dict)
    """Correction by extrapolation to an infinitely fine mesh, included in `parameters`; empty if none."""
    budget: tuple[Contribution, ...] = ()
    """`sigma` by source; empty for the paper's cost."""

    def on_mesh(self, name: str) -> float:
        """Optimum of a parameter on the refined mesh."""
        return self.parameters[name] - self.correction.get(name, 0.0)


@dataclass(frozen=True)
class RouteDifference:
    """Parameters from the force only minus parameters from the outline only."""

    values: dict[str, float]
    """Difference in parameter units. Both optima are corrected for the error of the refined mesh."""
    sigma: dict[str, float]
    """Its combined standard uncertainty. A source that shifts both optima equally does not contribute."""
    budget: tuple[Contribution, ...]


@dataclass(frozen=True)
class Comparison:
    """The check run and the data, ready for plotting."""

    force_time: FloatArray
    """Bin centres [s], shape [n_bins]."""
    force_measured: FloatArray
    """Bin means of the measured transmitted force [N], shape [n_bins]."""
    force_sigma: FloatArray
    """Their standard deviation [N], shape [n_bins]."""
    force_model: FloatArray
    """Bin means of the simulated force [N], shape [n_bins]."""
    centre_line: CentreLine
    """The measured points inside the window; none without an outline."""
    Z_model: FloatArray
    """Simulated Z at the measured points [m], shape [n_points]; NaN where `inside` is False."""
    inside: NDArray[np.bool_]
    """Points inside the model's range, shape [n_points]."""
    recorded: ForceHistory
    """The transmitted force at every recorded sample."""


@dataclass(frozen=True)
class SurrogateCurve:
    """The surrogate along one parameter, with the others at their optimum."""

    parameter: str
    x: FloatArray
    """Its values, shape [n]."""
    chi2: FloatArray
    """Joint chi-square (with the discrepancy weights of the final search) [-], shape [n]."""
    phi_shape: FloatArray
    """Phi_S [-], shape [n]; NaN without an outline."""
    phi_force: FloatArray
    """Phi_F [N], shape [n]."""


@dataclass(frozen=True, repr=False)
class Identification(ResultViews):
    """The result of an identification."""

    shot: str
    estimates: dict[str, Estimate]
    fixed: dict[str, float]
    """The parameters held fixed, in SI."""
    routes: tuple[Route, ...]
    """Optima of the joint data, the force, the outline and the paper's cost; without outline, the force's."""
    terms: Terms
    """Misfit terms of the check run at the optimum."""
    comparison: Comparison
    response: Response
    """The check run: a batch of one on the refined mesh, with all nodes."""
    mesh: tuple[int, int]
    """Elements of the surrogate's mesh across the radius and along the length."""
    refined_mesh: tuple[int, int]
    """Elements of the refined mesh, which gives the check runs and the answer."""
    design: DesignTable
    curves: tuple[SurrogateCurve, ...]
    """The surrogate along each free parameter."""
    surrogate: dict[str, float]
    """Surrogate quality: "loo_force" [N], "loo_shape" [m] (root-mean-square leave-one-out),
    "check_force" [N], "check_shape" [m] (surrogate against the check run, rms)."""
    seconds: dict[str, float]
    """Wall time by stage [s]."""
    warnings: tuple[str, ...] = ()
    """Warnings to read before using the answer, one sentence each; see `kolsky.uncertainty`."""
    methods: tuple[Method, ...] = ()
    """Results of other methods from the same data; the first is the method of the answer."""
    systematic: tuple[Declaration, ...] = ()
    """Effect of the declared input uncertainties on the answer, and the inputs that were not declared."""
    profiles: tuple[ParameterProfile, ...] = ()
    ridge: PairMap | None = None
    """The likelihood over the plane of two free parameters. None for one parameter, or for more than two."""
    posterior: PosteriorSummary | None = None
    variations: tuple[Variation, ...] = ()
    fit: tuple[FitQuality, ...] = ()
    """Goodness of fit of force and outline; empty if not recorded (files before version 3)."""
    clocks: tuple[ClockLag, ...] = ()
    """Clock lags of the recordings, from the residual of the model; empty if not recorded."""
    causes: tuple[CauseFinding, ...] = ()
    """Inputs that reduce the misfit when they are changed, likely causes first. Empty if none was tried."""
    image_correlation: dict[str, float] = field(default_factory=dict)
    """Results of the image processing of the shot's surfaces, see `kolsky.pictures.summary.numbers`."""
    route_difference: RouteDifference | None = None
    """Force-only minus outline-only result; None without an outline, or if it was not recorded."""
    provenance: dict[str, Any] = field(default_factory=dict)
    """Input hashes, settings, versions, seed, machine class, precision."""

    def spread(self, channel: str) -> FloatArray:
        """Standard deviation of a correct model's residual at each value [N, m]; the noise without a fit."""
        c = self.comparison
        noise = c.force_sigma if channel == FORCE else c.centre_line.sigma
        fit = next((one for one in self.fit if one.channel == channel), None)
        return noise if fit is None else fit.spread(noise)

    def lag_that_matters(self, recording: str) -> float:
        """Smallest lag of a recording that changes the answer noticeably [s]; infinite if none is known.

        For the force, it shifts a free parameter by its k = 2 uncertainty, if known. Otherwise it is one
        frame, the smallest possible error of a frame number.
        """
        found = [
            abs(part.amount) * 2.0 * self.estimates[name].sigma / abs(move)
            for part in self.systematic
            if part.key == "clock_offset" and recording == FORCE
            for name, move in part.moves.items()
            if move != 0.0
        ]
        times = np.unique(self.comparison.centre_line.time)
        frame = float(np.median(np.diff(times))) if times.size > 1 else inf
        return min(found, default=frame)

    def __repr__(self) -> str:
        said = "; ".join(
            f"{name} = {e.value:.6g} ± {2.0 * e.sigma:.2g} (k = 2), {e.outcome}"
            for name, e in self.estimates.items()
        )
        return f"Identification({self.shot!r}: {said})"


def worst_imbalance(response: Response) -> float:
    """Largest |energy residual| of the first simulation over its external work [-]; NaN without a ledger."""
    if not np.isfinite(response.energy.external[0]).any():
        return float("nan")
    return float(response.energy.imbalance()[0])
