"""Records of what may be wrong with a shot: inputs that, changed, explain the misfit (SI)."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import nan

COVERAGE = 2.0
"""An input within so many of its declared standard uncertainties is not wrong."""


@dataclass(frozen=True)
class CauseFinding:
    """One input, changed until the model explains the data best, the free parameters found anew."""

    key: str
    """Key of shot.toml to be checked, or what else is wrong; unique."""
    words: str
    """What is changed, in words."""
    unit: str
    """Unit of `exact` and `value`; "1" for a factor or a plain number."""
    exact: float
    """What the shot declares: 1 for a factor, 0 for an offset; NaN where it has no number."""
    value: float
    """What the data prefer; NaN if it could not be tried."""
    sigma: float
    """Standard uncertainty of `value`; NaN where it has none."""
    explained: float
    """Share of the misfit beyond what a right model leaves that goes [-]."""
    evidence: float
    """Logarithm of the likelihood ratio, one residual a time and channel, times 2 [-]; 0 where the data are
    explained as they are."""
    probability: float
    """Probability of such a change by chance, for all inputs tried together (Holm 1979) [-]."""
    parameters: Mapping[str, float]
    """The free parameters with the input changed so, on the surrogate's mesh corrected to the refined one."""
    sigmas: Mapping[str, float]
    """Their standard uncertainties from residuals and flyer motion; empty where they are not known."""
    named: bool
    """True if it is listed as a likely cause."""
    alike: tuple[str, ...] = ()
    """Keys of other inputs that the data cannot tell from this one."""
    beside: str = ""
    """Key of the likelier cause beside which it was found, that one free too; empty if it was tried alone."""
    status: str = ""
    """Why it could not be tried; empty if it was."""
    declared_sigma: float | None = None
    """Standard uncertainty that the shot declares of it, in its unit; None if it declares none."""
    solved: Mapping[str, float] = field(default_factory=dict)
    """The free parameters as a whole identification gives them with the input changed; empty if none was
    made."""
    solved_sigmas: Mapping[str, float] = field(default_factory=dict)
    """Their standard uncertainties."""

    @property
    def change(self) -> float:
        """Value minus what is declared, in its unit."""
        return self.value - self.exact if self.exact == self.exact else nan

    @property
    def within(self) -> bool:
        """True if what the data prefer is within k = 2 of the declared uncertainty: no error of the input."""
        return self.declared_sigma is not None and abs(self.change) <= COVERAGE * self.declared_sigma
