"""The transmitted force of a shot whose bar is its force gauge."""

from dataclasses import dataclass

from kolsky.base.arrays import FloatArray
from kolsky.base.records import ForceHistory


@dataclass(frozen=True)
class BarForce:
    """The transmitted force from the waves in the transmission bar."""

    measured: ForceHistory
    """The force on the specimen's clock; sigma is the noise of the samples, independent of each other."""
    sigma_gain: float
    """Standard uncertainty of its scale, common to all samples [-]."""

    @property
    def time(self) -> FloatArray:
        """Sample times [s], shape [n_samples]."""
        return self.measured.time

    def raw_force(self) -> FloatArray:
        """Force at every sample, compression-positive [N], shape [n_samples]."""
        return self.measured.force

    def history(self) -> ForceHistory:
        """The force with its noise."""
        return self.measured

    def noise_checks(self) -> dict[str, float]:
        """What the reduction does not tell of its noise: nothing to check here."""
        return {}
