"""Records of how well the model explains the data: goodness of fit by channel, lags of the clocks (SI)."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, nan

FORCE, OUTLINE = "force", "outline"
"""Names of the channels."""
NOISE, MESH = "noise", "mesh"
"""Keys of `FitQuality.predicted`: the measured noise of the channel, the error of mesh and step."""
FLYER, CURVE = "flyer motion", "material curve"
"""Keys of `FitQuality.predicted`: the noise of two inputs, as it moves the model's answer."""


@dataclass(frozen=True)
class FitQuality:
    """The residual of one channel at the optimum, beside what a right model would leave."""

    channel: str
    """ "force" or "outline"."""
    unit: str
    """Unit of the channel: "N" or "m"."""
    values: int
    """Number of force bins or outline points that are counted."""
    residual: float
    """Root mean square of measurement minus model, in `unit`."""
    predicted: Mapping[str, float]
    """Root mean square of what is left by a right model, by source, in `unit`: "noise", and where they are
    known "flyer motion", "material curve" and "mesh"."""
    peak: float
    """Largest size of the signal, in `unit`: the largest force; the spread of the outline's radii."""
    slow_residual: float
    """Root mean square of the residual's means over an eighth of the window (and a third of the outline's
    points), in `unit`: noise and ringing average out, a wrong input does not."""
    slow_expected: float
    """Root mean square of what a right model leaves in the same means, of all sources, in `unit`."""
    chi2: float
    """Mean square of the residual over the noise [-]; 1 if noise alone is left."""
    discrepancy_share: float
    """Share of the weights' variance that the discrepancy tau took [-]; 0 if noise alone is left."""
    correlation: float
    """Correlation of neighbouring residuals (in time; along the outline of one frame) [-]."""
    whiteness: float
    """Probability of a correlation at least so large in white noise (Ljung-Box, one lag) [-]."""
    weight: Mapping[str, float] = field(default_factory=dict)
    """Share of the information on each free parameter that comes from this channel [-]."""
    limit: float = inf
    """Largest `excess` of a shot that the model explains [-]; see `kolsky.diagnosis.thresholds`."""
    slow_limit: float = inf
    """Largest `slow_excess` of a shot that the model explains [-]."""

    @property
    def expected(self) -> float:
        """Root mean square of what a right model leaves, of all sources, in `unit`."""
        return float(sum(part**2 for part in self.predicted.values()) ** 0.5)

    @property
    def over_noise(self) -> float:
        """Residual over the measured noise [-]."""
        noise = self.predicted.get(NOISE, nan)
        return self.residual / noise if noise > 0.0 else nan

    @property
    def over_peak(self) -> float:
        """Residual over the largest size of the signal [-]."""
        return self.residual / self.peak if self.peak > 0.0 else nan

    @property
    def excess(self) -> float:
        """Residual over what a right model leaves [-]."""
        return self.residual / self.expected if self.expected > 0.0 else nan

    @property
    def slow_excess(self) -> float:
        """Slow residual over what a right model leaves of it [-]."""
        return self.slow_residual / self.slow_expected if self.slow_expected > 0.0 else nan

    @property
    def explained(self) -> bool:
        """True if the residual is what a right model leaves. An unknown residual is not explained."""
        return self.excess <= self.limit and self.slow_excess <= self.slow_limit


@dataclass(frozen=True)
class ClockLag:
    """How late one recording is against the two others, from the model's own residual."""

    recording: str
    """What is late: "force", "outline" or "flyer"."""
    lag: float
    """By how much its declared times are too late [s]; negative if too early."""
    sigma: float
    """Standard uncertainty of `lag` [s]; NaN if the search for it did not come to rest."""
    evidence: float
    """Fall of -2 ln L with this lag alone, the free parameters refitted [-]."""
    explains: bool
    """True if the model explains force and outline once the recording is put right."""
    file: str
    """The file with its times."""
    key: str
    """The key of shot.toml that puts it right."""

    @property
    def significance(self) -> float:
        """Size of the lag over its standard uncertainty [-]; 0 if that is not known."""
        return abs(self.lag) / self.sigma if self.sigma > 0.0 else 0.0
