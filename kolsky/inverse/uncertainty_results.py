"""Records of a result's uncertainty: profiles, declared inputs, other choices, posterior (SI)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from kolsky.base.arrays import FloatArray

Interval = tuple[float, float]
"""Lower and upper end in the parameter's unit; NaN where it is open."""


@dataclass(frozen=True)
class ParameterProfile:
    """The profile likelihood of one parameter, from the noise of force and outline alone."""

    name: str
    """The parameter."""
    values: FloatArray
    """Where it was held, ascending, in its unit, shape [n]."""
    rise: FloatArray
    """Rise of -2 ln L over its smallest value, the other parameters re-optimised [-], shape [n]."""
    points: FloatArray
    """The most likely points there, in SI, shape [n, d], in the order of the free parameters."""
    level: float
    """Rise at the ends of the 95 % interval [-]: 3.84 times `correlation`."""
    correlation: float
    """What correlation of the residuals in time adds to this parameter's variance, a factor >= 1 [-]."""
    interval: Interval
    """95 % interval from the profile."""
    alone: Interval
    """The same with the other parameters held at their optimum."""
    verdict: str
    """In one word: the value of a `doe.uncertainty.VerdictKind`."""
    text: str
    """The verdict in a sentence, with the direction of a ridge."""
    error: float
    """Largest error of the rise against runs on the surrogate's mesh along the profile [-]."""


@dataclass(frozen=True)
class PairMap:
    """The rise of -2 ln L over the plane of the two free parameters."""

    names: tuple[str, str]
    """The parameters along x and y."""
    x: FloatArray
    """Values of the first, in SI, shape [nx]."""
    y: FloatArray
    """Values of the second, in SI, shape [ny]."""
    rise: FloatArray
    """Rise of -2 ln L over its smallest value [-], shape [ny, nx]."""


@dataclass(frozen=True)
class Declaration:
    """An input that shot.toml may declare uncertain, and what that does to the answer."""

    key: str
    """Its key in [uncertainty]."""
    sigma: float
    """Declared standard uncertainty, in SI or relative; NaN if none is declared."""
    unit: str
    """Unit of `sigma`; "1" for a share of the quantity or a plain number."""
    shifts: Mapping[str, float]
    """By how much each free parameter moves if the input is larger by `sigma`, in SI; empty if it was
    not varied."""
    status: str
    """What was done: "varied", "not declared, counted as exact", or why it has no part here."""
    amount: float = float("nan")
    """A plain amount of it: 1 % of a scale, 1 us of a clock, 10 um of a place, as `unit`; NaN if it has no
    part, or of a file that does not hold it."""
    moves: Mapping[str, float] = field(default_factory=dict)
    """By how much each free parameter moves if the input is larger by `amount`, in SI; empty likewise."""
    visible: float = float("nan")
    """Share of the change of "prediction minus data" that stays in the residual after the parameters have
    followed, 0 to 1 [-]; near zero the data cannot show the input to be wrong. NaN likewise."""
    alike: tuple[str, ...] = ()
    """Keys of the inputs whose change leaves the same in the residual: the data do not tell them apart."""


@dataclass(frozen=True)
class Variation:
    """A choice of the analyst, made otherwise: the same data and runs, searched again on the surrogate."""

    key: str
    """What was chosen: "window_end" or "force_bins"."""
    value: float
    """The other choice: end of the window, or width of the force's bins [s]."""
    shifts: Mapping[str, float]
    """By how much each free parameter moves on the refined mesh, the error of which is not corrected here, in
    SI; empty if it could not be searched."""
    status: str
    """What was done, in words."""


@dataclass(frozen=True)
class PosteriorSummary:
    """The posterior by Markov chains, from the noise of force and outline alone."""

    names: tuple[str, ...]
    """Free parameters, then the sampled discrepancies, length n."""
    samples: FloatArray
    """Some of the samples, for pictures, in SI, shape [m, n]."""
    median: FloatArray
    """Of all samples, in SI, shape [n]."""
    lower: FloatArray
    """2.5 % quantile of all samples, shape [n]."""
    upper: FloatArray
    """97.5 % quantile of all samples, shape [n]."""
    converged: bool
    """Whether the chains are long enough against their autocorrelation time, and that time is steady."""
    autocorrelation: float
    """Longest integrated autocorrelation time [steps]."""
    steps: int
    """Steps of each walker."""
    acceptance: float
    """Share of accepted moves [-]."""
    power: float
    """Power of the likelihood, 1 over the mean `ParameterProfile.correlation` [-]."""
    prior: str
    """The priors, in words."""


@dataclass(frozen=True)
class HeldAnswer:
    """What one parameter would be with other free ones held at the values that the shot declares."""

    name: str
    """The parameter."""
    held: Mapping[str, float]
    """Value of each parameter that was held, in SI."""
    value: float
    """Its optimum, in SI."""
    sigma: float
    """Its standard uncertainty, in SI: residuals, noise of flyer and curve, mesh, and what the shot declares
    of the held ones."""
    chi2_force: float
    """Mean square of the force's residual over its noise there [-]."""
    chi2_shape: float
    """The same of the outline [-]; NaN if none was measured."""
    free_chi2_force: float
    """The force's where all of them are free [-]."""
    free_chi2_shape: float
    """The outline's where all of them are free [-]; NaN if none was measured."""
