r"""Finite-strain Prony series: quasi-linear viscoelasticity of the isochoric response.

With the isochoric second Piola-Kirchhoff stress S = DEV(2 dW/dC_bar) of the long-term law W, the Kirchhoff
stress is (Simo 1987; Simo and Hughes 1998, Section 10.3)

    tau = J U'(J) 1 + tau_W + sum_i dev(F_bar H_i F_bar^T),    dH_i/dt + H_i / tau_i = c_i dS/dt,      (V.1)

so that H_i(t) = c_i int_0^t exp(-(t - s) / tau_i) dS(s). The volumetric response does not relax. Strengths
c_i are relative to the *long-term* law, which is the one a slow test measures:

    G(t) = G_inf [1 + sum_i c_i exp(-t / tau_i)].                                                      (V.2)
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from explicit.relaxation.kernels.prony import PronyKind


@dataclass(frozen=True)
class PronySeries:
    """Branches that relax beside the long-term law."""

    strengths: tuple[float, ...]
    """Modulus of each branch over that of the long-term law, c_i [-]."""
    times: tuple[float, ...]
    """Relaxation time of each branch, tau_i [s]."""

    def __post_init__(self) -> None:
        if len(self.strengths) != len(self.times):
            raise ValueError(
                f"a Prony series needs one time for each strength, got {len(self.strengths)} strengths and "
                f"{len(self.times)} times"
            )
        for k, (strength, time) in enumerate(zip(self.strengths, self.times, strict=True)):
            if not 0.0 <= strength < np.inf:
                raise ValueError(f"strength {k} must be >= 0 and finite, got {strength}")
            if not 0.0 < time < np.inf:
                raise ValueError(f"relaxation time {k} must be > 0 s and finite, got {time}")

    def __len__(self) -> int:
        return len(self.times)

    @classmethod
    def of_instantaneous(cls, shares: ArrayLike, times: ArrayLike) -> "PronySeries":
        """The series whose shares g_i are of the instantaneous modulus: G(t) = G_0 [1 - sum g_i (1 - e^..)].

        Raises
        ------
        ValueError
            If the shares sum to 1 or more: nothing would be left at long times.
        """
        g = np.asarray(shares, dtype=float).ravel()
        left = 1.0 - g.sum()
        if not left > 0.0:
            raise ValueError(f"the shares of the instantaneous modulus must sum to < 1, got {g.sum():g}")
        return cls(tuple((g / left).tolist()), tuple(np.asarray(times, dtype=float).ravel().tolist()))

    @property
    def instantaneous(self) -> float:
        """G_0 / G_inf = 1 + sum c_i [-]."""
        return 1.0 + float(sum(self.strengths))

    @property
    def instantaneous_shares(self) -> FloatArray:
        """g_i = c_i G_inf / G_0, as several finite element programs ask for [-], shape [n_branches]."""
        return np.asarray(self.strengths) / self.instantaneous

    def row(self, n_branches: int) -> FloatArray:
        """Kernel row: g_i, tau_i, 1 - sum g_i; branches that are missing have g = 0."""
        g, times = np.zeros(n_branches), np.ones(n_branches)
        g[: len(self)], times[: len(self)] = self.instantaneous_shares, self.times
        return np.concatenate([g, times, [1.0 / self.instantaneous]])

    @staticmethod
    def kind(n_branches: int) -> PronyKind:
        """See `explicit.relaxation.base.RateDependence`."""
        return PronyKind(n_branches)

    def relaxation(self, time: ArrayLike) -> FloatArray:
        """G(t) / G_inf after a step of strain, Eq. (V.2) [-], shape of `time` [s]."""
        t = np.asarray(time, dtype=float)[..., None]
        decay = np.exp(-t / np.asarray(self.times))
        return np.asarray(1.0 + (np.asarray(self.strengths) * decay).sum(axis=-1))

    def storage(self, angular_frequency: ArrayLike) -> FloatArray:
        """G'(omega) / G_inf = 1 + sum c_i x^2 / (1 + x^2), x = omega tau_i [-], shape of omega [rad/s]."""
        x = np.asarray(angular_frequency, dtype=float)[..., None] * np.asarray(self.times)
        return np.asarray(1.0 + (np.asarray(self.strengths) * x**2 / (1.0 + x**2)).sum(axis=-1))

    def loss(self, angular_frequency: ArrayLike) -> FloatArray:
        """G''(omega) / G_inf = sum c_i x / (1 + x^2), x = omega tau_i [-], shape of omega [rad/s]."""
        x = np.asarray(angular_frequency, dtype=float)[..., None] * np.asarray(self.times)
        return np.asarray((np.asarray(self.strengths) * x / (1.0 + x**2)).sum(axis=-1))
