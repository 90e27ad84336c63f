"""What a right model leaves of the data, and weights by it.

A right model leaves noise and the error of the mesh, independent with standard deviation sigma, and what a
few patterns V bring whose amplitudes are standard normal (the noise of the flyer's motion, the mesh's error
as a whole): C = diag(sigma^2 + tau^2) + V V^T. tau, of each channel, is what is left beyond that. C is never
formed: the patterns' own matrix does (Woodbury). It costs far more than what is weighted with it, and is made
once for each tau.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from kolsky.base.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class ExpectedResidual:
    """What a right model leaves of the data vector."""

    sigma: FloatArray
    """Standard deviation of what is independent, shape [k]."""
    patterns: FloatArray
    """Changes of the data vector by one standard deviation of each common cause, shape [k, q]."""
    channel: IntArray
    """Channel of each entry, 0 for force and 1 for outline, shape [k]."""
    block: IntArray
    """Number of the time of each entry, the same for both channels, shape [k]."""
    tau: FloatArray
    """What is left beyond, of each channel, in its unit, shape [2]."""

    @cached_property
    def variance(self) -> FloatArray:
        """Of what is independent, with tau, shape [k]."""
        return np.asarray(self.sigma**2 + self.tau[self.channel] ** 2)

    @cached_property
    def _weights(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """1 / (sigma^2 + tau^2) [k], the patterns times that [k, q], and the patterns' own matrix [q, q]."""
        inverse = 1.0 / self.variance
        VN = self.patterns * inverse[:, None]
        core = np.eye(self.patterns.shape[1]) + self.patterns.T @ VN
        return inverse, VN, core

    def weighted(self, x: FloatArray) -> FloatArray:
        """C^-1 x, shape of x [k] or [k, n]."""
        inverse, VN, core = self._weights
        plain = inverse[:, None] * x.reshape(len(x), -1)
        return np.asarray(plain - VN @ np.linalg.solve(core, self.patterns.T @ plain)).reshape(x.shape)

    def independent(self, residual: FloatArray) -> FloatArray:
        """The residual without what the patterns most probably brought, shape [k]."""
        return np.asarray(self.variance * self.weighted(residual))

    def of(self, channel: int) -> "ExpectedResidual":
        """One channel alone."""
        return self.among(self.channel == channel)

    def among(self, use: BoolArray) -> "ExpectedResidual":
        """Some of the entries alone, shape of `use` [k]."""
        return replace(
            self,
            sigma=self.sigma[use],
            patterns=self.patterns[use],
            channel=self.channel[use],
            block=self.block[use],
        )

    @cached_property
    def _channels(self) -> tuple["ExpectedResidual", ...]:
        """Each channel alone, without tau."""
        return tuple(replace(self.of(channel), tau=np.zeros(2)) for channel in range(2))

    def misfits(self, residual: FloatArray) -> FloatArray:
        """Mean of r^T C^-1 r over the entries of each channel, on its own and without tau, shape [2].

        1 is what a right model leaves; of a channel without entries it is 1.
        """
        found = np.ones(2)
        for channel, alone in enumerate(self._channels):
            part = residual[self.channel == channel]
            if part.size:
                found[channel] = part @ alone.weighted(part) / part.size
        return found

    def with_tau(self, residual: FloatArray) -> "ExpectedResidual":
        """With the tau that explains a residual, of each channel."""
        left = self.independent(residual)
        excess = [
            (left[use] ** 2 - self.sigma[use] ** 2).mean() if (use := self.channel == c).any() else 0.0
            for c in range(2)
        ]
        tau = np.sqrt(np.maximum(excess, 0.0))
        return self if (tau == self.tau).all() else replace(self, tau=tau)

    @cached_property
    def times(self) -> IntArray:
        """Number of distinct times of each channel, shape [2]."""
        return np.array([len(np.unique(self.block[self.channel == c])) for c in range(2)])
