"""Several shots identified together: settings, result, relaxation that the data do not ask for.

A strength that the data do not ask for has a value and an interval, whose upper end is a finding. Its
relaxation time keeps its range, each value of which is equally likely.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from dic.views import ResultViews
from kolsky.base.arrays import FloatArray
from kolsky.inverse.parameters import PARAMETERS
from kolsky.inverse.result import Estimate, FitQuality, Verdict
from kolsky.inverse.settings import Numerics, Settings
from kolsky.material.relaxation.evidence import Evidence

MOST_NODES = 24


@dataclass(frozen=True)
class JointSettings:
    """Free and held parameters, shot-wise unknowns and numerical choices of a joint identification."""

    free: Mapping[str, tuple[float, float] | None] | None = None
    """Shared free parameters and their bounds, None for the default ones; left out, those that every shot
    frees by itself."""
    held: Mapping[str, float] = field(default_factory=dict)
    """Parameters held at another value than the shots'."""
    hold: tuple[str, ...] = ()
    """Parameters held at the shots' values that would be free by default."""
    numerics: Numerics = field(default_factory=lambda: Numerics(mesh=(16, 22)))
    """The mesh of the search, and the arithmetic."""
    refined_mesh: tuple[int, int] = (32, 43)
    """The mesh the answer is given on."""
    replicates: int = 24
    """Draws of each flyer's motion and of each curve; 0 leaves their noise out of weights and intervals."""
    curve_nodes: int = 0
    """Nodes of the curve that are free in place of the stiffness factor, 0 or 4 to `MOST_NODES`."""
    curve_roughness: float = 0.1
    """Standard deviation of the second difference of the logarithm of the nodes' factors [-]."""
    scatter: bool = True
    """Whether the shots may differ in stiffness beyond their own noise; its size is estimated."""
    gain_each: float = 0.0
    """Standard uncertainty of each shot's own force scale, beside a calibration that shots share [-]."""
    choose: bool = True
    """Whether the relaxation is held against the same shots without it."""
    seed: int = 1
    """Seed of every random draw."""

    def __post_init__(self) -> None:
        if self.curve_nodes and not 4 <= self.curve_nodes <= MOST_NODES:
            raise ValueError(f"curve_nodes must be 0 or 4 to {MOST_NODES}, got {self.curve_nodes}")
        if not 0.0 < self.curve_roughness < 10.0:
            raise ValueError(f"curve_roughness must be in (0, 10), got {self.curve_roughness}")
        if not 0.0 <= self.gain_each < 1.0:
            raise ValueError(f"gain_each must be in [0, 1), got {self.gain_each}")
        if self.numerics.compressible is not None:
            raise ValueError("a joint identification runs Poisson's ratio directly: leave the correction out")
        if not self.refined_mesh[0] > self.numerics.mesh[0]:
            raise ValueError(
                f"the refined mesh {self.refined_mesh} must be finer than that of the search "
                f"{self.numerics.mesh}: the mesh error is extrapolated from both"
            )

    def of_one(self) -> Settings:
        """The same for one shot by itself: what is free and held."""
        return Settings(free=self.free, held=self.held, hold=self.hold, numerics=self.numerics)


@dataclass(frozen=True)
class OwnStiffness:
    """The stiffness that one shot asks for by itself, relative to the shared one, by one linear step."""

    value: float
    """By all its data [-]: 0 where it is the shared one."""
    sigma: float
    """Standard uncertainty of its own, what shots share left out [-]."""
    force: float
    """By its force [-]; NaN where that does not see it."""
    sigma_force: float
    """Its standard uncertainty [-]."""
    outline: float
    """By its outline [-]; NaN where none was measured."""
    sigma_outline: float
    """Its standard uncertainty [-]."""


FORCE_OVER_OUTLINE = "force over the outline"
"""Name of the test by the force's stiffness over the outline's."""


@dataclass(frozen=True)
class ShotAgreement:
    """Whether the shots ask for one stiffness."""

    chi2: float
    """Sum of squared distances from their weighted mean, each over its variance [-]."""
    freedom: int
    """Degrees of freedom, shots less one."""
    probability: float
    """Probability of one at least so large where the shots agree [-]."""
    ratio: float
    """Stiffness that the stiffest shot asks for over that of the softest [-]."""
    shots: tuple[str, ...]
    """The shot that contradicts the others, both of two; empty where none does."""
    channel: str
    """The channel that shows it by itself; "" where it is all data together, or none contradicts."""

    @property
    def apart(self) -> bool:
        """Whether a shot contradicts the others."""
        return bool(self.shots)

    @property
    def sentence(self) -> str:
        """In words."""
        numbers = f"chi2 {self.chi2:.3g} with {self.freedom} degrees of freedom"
        if not self.apart:
            return f"the stiffest shot asks for {self.ratio:.3g} times the softest's stiffness ({numbers})"
        who = " and ".join(self.shots)
        verb = "contradict each other" if len(self.shots) > 1 else "contradicts the other shots"
        by = "all data"
        if self.channel:
            by = f"the {self.channel}" + ("" if self.channel == FORCE_OVER_OUTLINE else " by itself")
        return (
            f"{who} {verb} by {by}: the stiffest shot asks for {self.ratio:.3g} "
            f"times the softest's stiffness ({numbers})"
        )


CAUSE_WORDS = {
    "sensitivity": "the force of {shot}, {factor:.4g} ± {both:.2g} times what all data predict: multiply its "
    "sensitivity by this",
    "clock_offset": "the force record of {shot}, {late:.3g} ± {both_late:.2g} us late: check its clock",
    "lengths of the outline": "the lengths in the outline of {shot}, {factor:.4g} ± {both:.2g} times what "
    "all data predict: check its scale",
    "material": "the specimen or reference curve of {shot}, {factor:.4g} ± {both:.2g} times as stiff as the "
    "others",
}
"""Input of a shot -> its words, with k = 2."""


@dataclass(frozen=True)
class ShotCause:
    """One input of one shot, and what it explains of the misfit of all."""

    shot: str
    """The shot."""
    key: str
    """The input, a key of `CAUSE_WORDS`."""
    amount: float
    """Its error: relative, of the clock in s."""
    sigma: float
    """Standard uncertainty of it."""
    gain: float
    """Fall of -2 ln L by it [-]."""
    share: float
    """Share of a channel's squared residual that it explains, of the channel where it is larger [-]."""

    @property
    def words(self) -> str:
        """What is wrong, with its size."""
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
    """Its name."""
    inputs: Mapping[str, str]
    """SHA-256 of every file that was read."""
    factor: float
    """Its own stiffness factor, the shared one times its part of the scatter [-]."""
    sigma_factor: float
    """Standard uncertainty of that part beside the shared factor [-]; 0 where no scatter was found."""
    gain: float
    """Its own most likely error of the force's scale [-]."""
    sigma_gain: float
    """What is left of the scale's uncertainty [-]; 0 where none was declared."""
    clock: float
    """Most likely lateness of its force record [s]."""
    sigma_clock: float
    """What is left of the clock's uncertainty [s]; 0 where none was declared."""
    chi2_force: float
    """Mean squared residual of the force over its noise [-]."""
    chi2_outline: float
    """The same of the outline [-]; NaN if none was measured."""
    discrepancy_force: float
    """What the model leaves of the force's bins beyond their noise [N]."""
    discrepancy_outline: float
    """The same of the outline [m]."""
    fit: tuple[FitQuality, ...] = ()
    """Its channels' residuals beside the residual of a correct model."""
    own: OwnStiffness | None = None
    """What it asks for by itself; None where nothing shared is the stiffness."""


@dataclass(frozen=True)
class Scatter:
    """Relative scatter of the stiffness between shots, by restricted maximum likelihood."""

    value: float
    """Standard deviation [-]."""
    interval: tuple[float, float]
    """Where the restricted deviance is at most 3.84 above its least: 95 % of one parameter [-]."""


@dataclass(frozen=True)
class ModelChoice:
    """What relaxes, held against the same shots and slow tests without it."""

    aic: float
    """Akaike's criterion with it less that without it [-]: below 0 speaks for it."""
    bic: float
    """The same of the Bayesian criterion [-]."""
    elastic: Mapping[str, float]
    """The optimum without it."""
    gain: float
    """Largest improvement of chi-square at the elastic optimum by a weak branch of any time [-]."""
    time: float
    """Relaxation time of that branch [s]."""
    probability: float
    """Share of planted elastic data, with these shots' noise, that improve as much [-]."""
    asked_for: bool
    """Whether both speak for it: criterion below 0, and planted elastic data that seldom improve so."""
    sentence: str
    """In words."""


@dataclass(frozen=True)
class CurveFound:
    """The curve that the impacts ask for, with its band."""

    strain: FloatArray
    """Nodes, nominal strain as of the curve's branch [-], shape [n]."""
    factor: FloatArray
    """Stress over that of the slow curve [-], shape [n]."""
    sigma_log: FloatArray
    """Standard uncertainty of the factor's logarithm [-], shape [n]."""
    prior_share: FloatArray
    """Share of a node's information that smoothness gives and not the data, 0 to 1 [-], shape [n]."""
    stretch: FloatArray
    """Stretch of the slow curve [-], shape [p]."""
    stress: FloatArray
    """Nominal stress that the impacts ask for [Pa], shape [p]."""
    band: FloatArray
    """Lower and upper end of its k = 2 band [Pa], shape [2, p]."""


@dataclass(frozen=True)
class JointResult(ResultViews):
    """Several shots identified together."""

    estimates: Mapping[str, Estimate]
    """Shared parameters; with free nodes of the curve, those beside them."""
    fixed: Mapping[str, float]
    """What is held."""
    correlation: FloatArray
    """Of the shared parameters in their order, from the data alone, shape [d, d]."""
    expanded: Mapping[str, float]
    """Half width of each parameter's 95 % interval, in its unit: by Student's t where the scatter between few
    shots decides."""
    shots: tuple[ShotPart, ...]
    """Shot by shot."""
    scatter: Scatter | None
    """None where it was not asked for."""
    slow: Mapping[str, float]
    """Label of each slow test -> mean squared residual over its noise [-]."""
    choice: ModelChoice | None
    """None where nothing relaxes, or it was not asked for."""
    curve: CurveFound | None
    """None where the curve keeps its shape."""
    mesh: tuple[int, int]
    """Mesh of the search."""
    refined_mesh: tuple[int, int]
    """Mesh of the answer."""
    runs: int
    """Simulations made, those found in the ledger not among them."""
    warnings: tuple[str, ...] = ()
    """What a reader must know."""
    slow_fit: tuple[FitQuality, ...] = ()
    """The slow tests' residuals beside the residual of a correct model, in units of their sigma."""
    agreement: ShotAgreement | None = None
    """Whether the shots ask for one stiffness; None for one shot."""
    causes: tuple[ShotCause, ...] = ()
    """Where the answer is withheld: what each input of each shot explains, the likeliest first."""

    @property
    def explained(self) -> bool:
        """Whether the shared values explain every shot, channel and slow test, and the shots agree."""
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
"""How the names of strengths begin."""
LEAST_STRENGTH = 2.0
"""Strength over its standard uncertainty, that of the mesh included, above which it is one [-]."""
RANGE = "range of the search"
"""Source of the uncertainty of what is not seen."""


def is_strength(name: str) -> bool:
    """Whether a parameter says how strong the relaxation is."""
    return name.startswith(STRENGTHS)


def as_not_seen(e: Estimate) -> Estimate:
    """An estimate of what the data do not ask for; other parameters stay as they are."""
    if not PARAMETERS[e.name].relaxes:
        return e
    if is_strength(e.name):
        return replace(e, outcome=Verdict.NOT_SEEN)
    low, high = e.searched
    width = (high - low) / 12.0**0.5  # standard deviation of values that are evenly likely
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
    """Interval of a half width, within the range that was searched; all of it where that alone is known."""
    return e.searched if RANGE in e.noise_parts else e.within(half)


def needed_strength(estimates: Mapping[str, Estimate]) -> list[str]:
    """What it would take to see constants that were not seen, a sentence a branch.

    Of a branch whose strength is none of the reasons (its time ends at a bound) nothing is reported here.
    """
    said = []
    for name, e in estimates.items():
        weak = e.value <= LEAST_STRENGTH * e.sigma
        if not is_strength(name) or e.outcome is not Verdict.NOT_SEEN or not weak:
            continue
        other = rate_of(name)
        rest = f", and without one {other} has no value" if other in estimates else ""
        said.append(
            f"{name} and what depends on it are not seen: it takes a strength above "
            f"{LEAST_STRENGTH * e.sigma:.2g}, "
            f"{LEAST_STRENGTH:g} standard uncertainties with the mesh's{rest}; more shots, finer meshes "
            f"or a slow test "
            "as fast as the branch would see a weaker one"
        )
    return said


def rate_of(strength: str) -> str:
    """The parameter that says how fast what has a strength relaxes."""
    return "creep_resistance" if strength == "creep_ratio" else strength.replace("strength", "time")
