"""Tests that show rate dependence: histories of stretch, and oscillations. Another module treats shots.

An evidence has measured values with their uncertainty. It predicts them for any number of rate models in one
call. A fit therefore does not depend on the kind of test.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from dic.basics import check_interval
from explicit.relaxation import PronySeries, prony_stress
from explicit.relaxation.prony import checked_history
from kolsky.base.arrays import FloatArray


@dataclass(frozen=True)
class RateModel:
    """The long-term law times a factor, with viscoelastic branches in parallel."""

    factor: float
    """Factor on the long-term law [-]. It is the m of a shot."""
    series: PronySeries


@dataclass(frozen=True)
class ScaledLaw:
    """An `explicit.materials.MaterialLaw` times a factor, for a homogeneous test."""

    law: Any
    factor: float

    def stress(self, b_bar: FloatArray) -> FloatArray:
        """Isochoric Kirchhoff stress of the law [Pa]."""
        return np.asarray(self.factor * self.law.stress(b_bar))


class Evidence(Protocol):
    """Measured values, and their prediction by a model."""

    @property
    def label(self) -> str:
        """Name for tables."""

    @property
    def values(self) -> FloatArray:
        """Measured values, shape [n]."""

    @property
    def sigma(self) -> FloatArray:
        """Its standard uncertainty, same unit and shape, > 0."""

    @property
    def time_scales(self) -> tuple[float, float]:
        """The shortest and the longest relaxation time that the test can resolve [s]."""

    def predict(self, law: Any, models: Sequence[RateModel]) -> FloatArray:
        """The predicted values of each model, shape [n_models, n]."""


@dataclass(frozen=True)
class HistoryTest:
    """A homogeneous uniaxial test with any history: relaxation, creep-free ramps at several rates, cycles."""

    time: FloatArray
    """Times, not descending [s], shape [n]. The specimen is at rest before the first time."""
    stretch: FloatArray
    """Stretch [-], shape [n]."""
    stress: FloatArray
    """Nominal stress, tension-positive [Pa], shape [n]."""
    sigma: FloatArray
    """Its standard uncertainty [Pa], shape [n]. It is infinite for samples that only define the history."""
    label: str = "history"

    def __post_init__(self) -> None:
        checked_history(self.time, self.stretch)
        _checked("stress", self.stress, self.sigma, len(self.time))

    @property
    def values(self) -> FloatArray:
        """Nominal stress [Pa], shape [n]."""
        return self.stress

    @property
    def time_scales(self) -> tuple[float, float]:
        """The shortest interval between two samples and the whole duration [s]."""
        steps = np.diff(self.time)
        return float(steps[steps > 0.0].min()), float(np.ptp(self.time))

    def predict(self, law: Any, models: Sequence[RateModel]) -> FloatArray:
        """Nominal stress of each model [Pa], shape [n_models, n]."""
        return np.stack([m.factor * prony_stress(law, m.series, self.time, self.stretch) for m in models])

    @classmethod
    def relaxation(
        cls, time: ArrayLike, stress: ArrayLike, sigma: ArrayLike, *, stretch: float, rise: float = 0.0
    ) -> "HistoryTest":
        """A stretch that is reached within `rise` [s] at a constant rate and then held.

        ``time``: times after the beginning of the rise, ascending, all >= `rise` [s]. ``stress``, ``sigma``:
        nominal stress and its standard uncertainty [Pa]. Raises ValueError if a time lies within the rise.
        """
        t = np.asarray(time, dtype=float)
        if not rise >= 0.0 or not (t >= rise).all():
            raise ValueError(f"times must be >= the rise, {rise:g} s, got {t.min():g} s")
        n_rise = 2 if rise == 0.0 else 65
        before = np.linspace(0.0, rise, n_rise)
        stretches = np.concatenate([np.linspace(1.0, stretch, n_rise), np.full(len(t), stretch)])
        values = np.broadcast_to(np.asarray(stress, dtype=float), t.shape)
        spread = np.broadcast_to(np.asarray(sigma, dtype=float), t.shape)
        return cls(
            time=np.concatenate([before, t]),
            stretch=stretches,
            stress=np.concatenate([np.zeros(n_rise), values]),
            sigma=np.concatenate([np.full(n_rise, np.inf), spread]),
            label=f"relaxation at stretch {stretch:g}",
        )


@dataclass(frozen=True)
class DynamicTest:
    """Small oscillations about the undeformed state: storage and loss modulus in tension (DMA)."""

    angular_frequency: FloatArray
    """omega [rad/s], shape [n]."""
    storage: FloatArray
    """Young's storage modulus E' [Pa], shape [n]."""
    loss: FloatArray
    """Young's loss modulus E'' [Pa], shape [n]."""
    sigma_storage: FloatArray
    """Standard uncertainty of E' [Pa], shape [n]."""
    sigma_loss: FloatArray
    """Standard uncertainty of E'' [Pa], shape [n]."""
    label: str = "oscillation"

    def __post_init__(self) -> None:
        n = len(self.angular_frequency)
        if not (np.isfinite(self.angular_frequency) & (self.angular_frequency > 0.0)).all():
            raise ValueError(f"angular_frequency must be > 0 rad/s, got {np.min(self.angular_frequency)}")
        _checked("storage", self.storage, self.sigma_storage, n)
        check_interval("(0, inf) Pa", storage=self.storage)
        _checked("loss", self.loss, self.sigma_loss, n)

    @property
    def values(self) -> FloatArray:
        """E', then E'' [Pa], shape [2 n]."""
        return np.concatenate([self.storage, self.loss])

    @property
    def sigma(self) -> FloatArray:
        """Their standard uncertainties [Pa], shape [2 n]."""
        return np.concatenate([self.sigma_storage, self.sigma_loss])

    @property
    def time_scales(self) -> tuple[float, float]:
        """1 / omega of the fastest and of the slowest oscillation [s]."""
        return float(1.0 / self.angular_frequency.max()), float(1.0 / self.angular_frequency.min())

    def predict(self, law: Any, models: Sequence[RateModel]) -> FloatArray:
        """E' and E'' of each model [Pa], shape [n_models, 2 n]."""
        young, omega = 3.0 * float(law.initial_shear_modulus), self.angular_frequency
        rows = (np.concatenate([m.series.storage(omega), m.series.loss(omega)]) for m in models)
        return np.stack([m.factor * young * row for m, row in zip(models, rows, strict=True)])


def _checked(name: str, values: FloatArray, sigma: FloatArray, n: int) -> None:
    shapes = np.shape(values), np.shape(sigma)
    if shapes != ((n,), (n,)):
        raise ValueError(f"{name} and its sigma need {n} values, one per sample, got {shapes}")
    if not np.isfinite(values).all():
        raise ValueError(f"{name} must be finite, got {values[~np.isfinite(values)][0]}")
    if not (np.asarray(sigma) > 0.0).all():
        raise ValueError(f"sigma of {name} must be > 0, got {np.min(sigma)}")
    if not np.isfinite(sigma).any():
        raise ValueError(f"sigma of {name} is infinite everywhere: nothing was measured")
