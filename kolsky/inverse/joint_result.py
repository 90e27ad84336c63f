"""Several shots identified together: result, and relaxation that the data do not need.

A strength that the data do not need still has a value and an interval. The upper end of the interval is a
useful bound. Its relaxation time keeps a uniform distribution over its range.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf, nan

from dic.views import ResultViews
from kolsky.base.arrays import FloatArray
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.result import Estimate, FitQuality, Verdict
from kolsky.material.relaxation.rate_fit import Evidence


@dataclass(frozen=True)
class OwnStiffness:
    """Stiffness estimated from one shot only, relative to the shared one, by one linear step."""

    value: float
    """Value from all data of the shot, relative to the shared stiffness [-]; 0 means equal."""
    sigma: float
    """Standard uncertainty without the errors shared by the shots [-]."""
    force: float
    """Value from its force [-]; NaN if the force does not depend on it."""
    sigma_force: float
    """Its standard uncertainty [-]."""
    outline: float
    """Value from its outline [-]; NaN if none was measured."""
    sigma_outline: float
    """Its standard uncertainty [-]."""
    scale: float = nan
    """Error of its force's scale, with its stiffness free [-]: measured over predicted, minus 1."""
    sigma_scale: float = nan
    """Its standard uncertainty, without the errors shared by the shots [-]."""


FORCE_SCALE = "scale of the force"
"""Name of the test of the force's scales. Each shot's stiffness is free, so specimens do not scatter them."""


@dataclass(frozen=True)
class ShotAgreement:
    """Test whether the shots agree in stiffness, and in the scale of the force."""

    chi2: float
    """Sum of squared distances from the weighted mean, each divided by its variance [-]."""
    freedom: int
    """Degrees of freedom: number of shots minus one."""
    probability: float
    """Probability of a larger chi-square if the shots agree [-]."""
    ratio: float
    """Stiffness of the stiffest shot divided by that of the softest, or the same of the scales [-]."""
    shots: tuple[str, ...]
    """The shot that contradicts the others. Both shots if there are only two; empty if none does."""
    channel: str
    """The channel of the test. "" if it uses all data together."""
    noticeable: tuple[float, ...] = ()
    """Smallest error of each shot's sensitivity that is detected with a probability of 0.9 [-]."""

    @property
    def apart(self) -> bool:
        """True if a shot contradicts the others."""
        return bool(self.shots)

    @property
    def sentence(self) -> str:
        """The agreement as a sentence."""
        scale = self.channel == FORCE_SCALE
        size = f"the stiffest shot needs {self.ratio:.3g} times the softest's stiffness"
        if scale:
            size = f"the largest scale of a force is {self.ratio:.3g} times the smallest"
        size = f"{size} (chi2 {self.chi2:.3g} with {self.freedom} degrees of freedom)"
        if not self.apart:
            return f"{size}; {self.power}"
        who = " and ".join(self.shots)
        verb = "contradict each other" if len(self.shots) > 1 else "contradicts the other shots"
        by = f"the {self.channel}" + ("" if scale else " alone") if self.channel else "all data"
        return f"{who} {verb} by {by}: {size}"

    @property
    def power(self) -> str:
        """The error of a sensitivity that the test detects, as a clause."""
        least = max(self.noticeable, default=inf)
        if not least < 1.0:
            return "an error of one shot's sensitivity would not be detected"
        return f"an error of one shot's sensitivity above {100.0 * least:.2g} % would be detected"


CAUSE_WORDS = {
    "sensitivity": "the force of {shot}, {factor:.4g} ± {both:.2g} times what all data predict: multiply its "
    "sensitivity by this",
    "clock_offset": "the force record of {shot}, {late:.3g} ± {both_late:.2g} us late: check its clock",
    "lengths of the outline": "the lengths in the outline of {shot}, {factor:.4g} ± {both:.2g} times what "
    "all data predict: check its scale",
    "material": "the specimen or reference curve of {shot}, {factor:.4g} ± {both:.2g} times as stiff as the "
    "others: check them, its length and the rate of its camera",
}
"""Input of a shot -> its description, with k = 2."""


@dataclass(frozen=True)
class ShotCause:
    """One input of one shot, and its share in the misfit of all shots."""

    shot: str
    key: str
    """The input, a key of `CAUSE_WORDS`."""
    amount: float
    """Its error: relative, or in s for a clock."""
    sigma: float
    """Standard uncertainty of the strength."""
    gain: float
    """Decrease of -2 ln L with this input corrected [-]."""
    share: float
    """Explained share of a channel's squared residual; the larger one of force and outline [-]."""

    @property
    def words(self) -> str:
        """The error and its size, in words."""
        return CAUSE_WORDS[self.key].format(
            shot=self.shot,
            factor=1.0 + self.amount,
            both=2.0 * self.sigma,
            late=1e6 * self.amount,
            both_late=2e6 * self.sigma,
        )


@dataclass(frozen=True)
class ShotPart:
    """One shot in a joint identification."""

    name: str
    inputs: Mapping[str, str]
    """SHA-256 of every file that was read."""
    factor: float
    """Stiffness factor of this shot: the shared factor and its deviation by the scatter [-]."""
    sigma_factor: float
    """Standard uncertainty of the shot's deviation from the shared factor [-]; 0 if no scatter was found."""
    gain: float
    """Most likely error of its force scale [-]."""
    sigma_gain: float
    """Remaining uncertainty of the scale [-]; 0 if none was declared."""
    clock: float
    """Most likely delay of its force record [s]."""
    sigma_clock: float
    """Remaining uncertainty of the clock [s]; 0 if none was declared."""
    chi2_force: float
    """Mean squared residual of the force divided by its noise variance [-]."""
    chi2_outline: float
    """Mean squared residual of the outline divided by its noise variance [-]; NaN if none was measured."""
    discrepancy_force: float
    """Discrepancy tau of the force bins, the residual beyond their noise [N]."""
    discrepancy_outline: float
    """Discrepancy of the outline [m]."""
    fit: tuple[FitQuality, ...] = ()
    """Residuals of its channels, compared with those expected of a correct model."""
    own: OwnStiffness | None = None
    """Stiffness from this shot only; None if the stiffness is not a shared unknown."""


@dataclass(frozen=True)
class Scatter:
    """Relative scatter of the stiffness between shots, estimated by restricted maximum likelihood."""

    value: float
    """Standard deviation [-]."""
    interval: tuple[float, float]
    """95 % interval: the restricted deviance exceeds its minimum by at most 3.84 [-]."""


@dataclass(frozen=True)
class ModelChoice:
    """Comparison of the models with and without relaxation, for the same shots and slow tests."""

    aic: float
    """Akaike's criterion with relaxation minus that without [-]; negative favours relaxation."""
    bic: float
    """Difference of the Bayesian criterion, with the same sign [-]."""
    elastic: Mapping[str, float]
    gain: float
    """Decrease of chi-square at the elastic optimum by the best weak branch [-]."""
    time: float
    """Relaxation time of that branch [s]."""
    probability: float
    """Share of synthetic elastic data sets, with the noise of these shots, that improve as much [-]."""
    asked_for: bool
    """True if the criterion is negative and synthetic elastic data rarely improve as much."""
    sentence: str


@dataclass(frozen=True)
class CurveFound:
    """The curve identified from the impacts, with its band."""

    strain: FloatArray
    """Nominal strain of the nodes, with the sign of the curve's branch [-], shape [n]."""
    factor: FloatArray
    """Identified stress divided by the stress of the slow curve [-], shape [n]."""
    sigma_log: FloatArray
    """Standard uncertainty of the factor's logarithm [-], shape [n]."""
    prior_share: FloatArray
    """Share of a node's information that comes from the smoothness prior, 0 to 1 [-], shape [n]."""
    stretch: FloatArray
    """Stretch of the slow curve [-], shape [p]."""
    stress: FloatArray
    """Nominal stress identified from the impacts [Pa], shape [p]."""
    band: FloatArray
    """Lower and upper limit of its k = 2 band [Pa], shape [2, p]."""


@dataclass(frozen=True)
class JointResult(ResultViews):
    """Several shots identified together."""

    estimates: Mapping[str, Estimate]
    """Shared parameters, without the free nodes of the curve."""
    fixed: Mapping[str, float]
    correlation: FloatArray
    """Correlation of the shared parameters in their order, by the data without prior, shape [d, d]."""
    expanded: Mapping[str, float]
    """Half width of each parameter's 95 % interval, in its unit, by Student's t if few shots scatter."""
    shots: tuple[ShotPart, ...]
    scatter: Scatter | None
    slow: Mapping[str, float]
    """Label of each slow test -> mean squared residual divided by its noise variance [-]."""
    choice: ModelChoice | None
    """Comparison with and without relaxation; None without relaxation, or if not requested."""
    curve: CurveFound | None
    """The identified curve; None if its nodes are not free."""
    mesh: tuple[int, int]
    refined_mesh: tuple[int, int]
    runs: int
    """Number of simulations, not counting those found in the ledger."""
    warnings: tuple[str, ...] = ()
    slow_fit: tuple[FitQuality, ...] = ()
    """The slow tests' residuals and those expected of a correct model, in units of their sigma."""
    agreement: ShotAgreement | None = None
    """Test whether the shots agree in stiffness; None for one shot."""
    causes: tuple[ShotCause, ...] = ()
    """If the answer is withheld: the share explained by each input of each shot, in descending order."""

    @property
    def explained(self) -> bool:
        """True if the shared values explain every shot, channel and slow test, and the shots agree."""
        fits = (*(fit for shot in self.shots for fit in shot.fit), *self.slow_fit)
        return all(fit.explained for fit in fits) and not (
            self.agreement is not None and self.agreement.apart
        )

    @property
    def verdict(self) -> str:
        """The verdict on the whole: "explained" or "withheld"."""
        return "explained" if self.explained else "withheld"


Slow = tuple[Evidence, ...]
"""Slow tests: relaxation, ramps, oscillation."""


STRENGTHS = ("prony_strength", "creep_ratio")
"""Prefixes of the names of strengths."""
LEAST_STRENGTH = 2.0
"""A strength is significant above this many standard uncertainties [-]. They include the mesh error."""
RANGE = "range of the search"
"""Uncertainty source of a parameter that the data do not constrain."""


def is_strength(name: str) -> bool:
    """True if a parameter is a strength of the relaxation."""
    return name.startswith(STRENGTHS)


def as_not_seen(e: Estimate) -> Estimate:
    """The estimate of a relaxation constant that the data do not need. Other parameters are unchanged."""
    if not PARAMETERS[e.name].relaxes:
        return e
    if is_strength(e.name):
        return replace(e, outcome=Verdict.NOT_SEEN)
    low, high = e.searched
    width = (high - low) / 12.0**0.5  # standard deviation of a uniform distribution
    nothing = dict.fromkeys(e.noise_parts, 0.0)
    return replace(
        e,
        value=e.on_mesh,
        sigma_noise=width,
        sigma_numerical=0.0,
        sigma_systematic=0.0,
        mesh_shift=0.0,
        mesh_correction=0.0,
        noise_parts={**nothing, RANGE: width},
        numerical_parts=dict.fromkeys(e.numerical_parts, 0.0),
        outcome=Verdict.NOT_SEEN,
    )


def interval(e: Estimate, half: float) -> tuple[float, float]:
    """Interval with a half width, limited to the searched range; without one, the whole range."""
    return e.searched if RANGE in e.noise_parts else e.within(half)


def needed_strength(estimates: Mapping[str, Estimate]) -> list[str]:
    """The strength that the data would detect, one sentence for each branch that was not detected.

    A branch with its time at a bound is left out, because its strength is not the reason.
    """
    said = []
    for name, e in estimates.items():
        weak = e.value <= LEAST_STRENGTH * e.sigma
        if not is_strength(name) or e.outcome is not Verdict.NOT_SEEN or not weak:
            continue
        other = rate_of(name)
        rest = f", and without one {other} has no value" if other in estimates else ""
        said.append(
            f"{name} and what depends on it are not seen: a strength above {LEAST_STRENGTH * e.sigma:.2g} "
            f"is needed, {LEAST_STRENGTH:g} standard uncertainties with the mesh's{rest}; more shots, "
            "finer meshes or a slow test as fast as the branch would detect a weaker one"
        )
    return said


def rate_of(strength: str) -> str:
    """The parameter that sets the rate of the branch or network with this strength."""
    return "creep_resistance" if strength == "creep_ratio" else strength.replace("strength", "time")
