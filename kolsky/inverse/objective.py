"""The joint least-squares objective and what its curvature says about uncertainty.

The data of a shot are one vector: the force's bin means, then the counted outline points. Its covariance is

    C = diag(sigma^2 + tau^2 + PATTERN_ERROR^2 M^2) + M' M,

with the measured noise sigma, a discrepancy tau of each channel, estimated from the residual at the optimum,
and the patterns M in which the noise of the front face's motion moves all predictions together. Without tau a
channel whose residual is dominated by what the model leaves out would be trusted as if only its noise were
wrong. Without M tau would take the ringing that a noisy onset causes for a fault of the model, and weigh down
the whole channel; with the patterns' variances alone, as if each entry had a draw of its own, the force would
be weighed down as much where it rings with the front face as where it does not. The patterns themselves come
from runs on a coarse mesh, whose ringing is that much off in height and phase; without a part of their own
for that the answer would rest on the phase of every oscillation.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from doe.whitening import Whitening
from kolsky.base.arrays import FloatArray
from kolsky.inverse.observations import Observations, Prediction
from kolsky.inverse.prior import Prior

Part = Literal["joint", "force", "shape"]

PATTERN_ERROR = 0.2
"""Standard uncertainty of the front face's patterns over their size [-], independent from entry to entry."""
BLOCKS = (2, 4, 8, 16)
"""Block lengths, in force bins, over which residuals may be correlated in time."""
ROUNDS = 6
"""Rounds in which the discrepancies and the front face's share of the residual are told apart; each leaves
about a tenth of the error."""


@dataclass(frozen=True)
class Objective:
    """Chi-square of a predicted data vector."""

    observations: Observations
    """What was measured."""
    counted: NDArray[np.bool_]
    """Outline points that lie inside the model's range in every run, shape [n_points]."""
    force_discrepancy: float = 0.0
    """tau of the force's bin means [N]."""
    shape_discrepancy: float = 0.0
    """tau of the outline points [m]."""
    prior: Prior | None = None
    """What is known of the free parameters beside the data; it is not used for a part of them alone."""

    @property
    def n_force(self) -> int:
        """Number of force bins at the head of the data vector."""
        return self.observations.n_force

    @property
    def data(self) -> FloatArray:
        """Measured data vector, shape [k]: force [N], then Z [m]."""
        return np.concatenate([self.observations.force_mean, self.observations.centre_line.Z[self.counted]])

    @property
    def noise(self) -> FloatArray:
        """Measured standard deviations of the data vector, shape [k]."""
        line = self.observations.centre_line
        return np.concatenate([self.observations.force_sigma, line.sigma[self.counted]])

    @cached_property
    def front_noise(self) -> FloatArray:
        """Changes of the data by the front face's noise, one standard deviation a mode, [n_modes, k]."""
        modes = self.observations.front_noise
        if modes is None:
            return np.zeros((0, len(self.data)))
        return np.asarray(modes[:, np.concatenate([np.ones(self.n_force, dtype=bool), self.counted])])

    @cached_property
    def points_per_frame(self) -> float:
        """Mean number of counted outline points of a frame [-]; 1 if there are none."""
        frames = self.observations.centre_line.frame[self.counted]
        return len(frames) / len(np.unique(frames)) if len(frames) else 1.0

    @cached_property
    def own_sigma(self) -> FloatArray:
        """Noise, discrepancy and error of the patterns in quadrature: what is independent, shape [k]."""
        tau = np.full(len(self.data), self.shape_discrepancy)
        tau[: self.n_force] = self.force_discrepancy
        return np.sqrt(self.noise**2 + tau**2 + self.pattern_variance)

    @cached_property
    def pattern_variance(self) -> FloatArray:
        """Variance of each entry by what the front face's patterns are off, shape [k]."""
        return np.asarray(PATTERN_ERROR**2 * (self.front_noise**2).sum(axis=0))

    @cached_property
    def sigma(self) -> FloatArray:
        """Standard deviation of each entry by itself: noise, discrepancy, front face, shape [k]."""
        return np.sqrt(self.own_sigma**2 + (self.front_noise**2).sum(axis=0))

    @cached_property
    def _whitenings(self) -> dict[Part, Whitening]:
        return {}

    def whitening(self, part: Part = "joint") -> Whitening:
        """The weights of a part of the data, for rows of its entries, see `mask`."""
        if part not in self._whitenings:
            use = self.mask(part)
            self._whitenings[part] = Whitening(self.own_sigma[use], self.front_noise[:, use])
        return self._whitenings[part]

    def whitened(self, rows: FloatArray, part: Part = "joint") -> FloatArray:
        """Rows of shape [..., k] such that least squares of them weigh the part's data, shape [..., p]."""
        return self.whitening(part).apply(rows[..., self.mask(part)])

    @property
    def times(self) -> FloatArray:
        """Time of each entry [s], shape [k]."""
        seen = self.observations
        return np.concatenate([seen.force_times, seen.centre_line.time[self.counted]])

    def vectors(self, prediction: Prediction) -> FloatArray:
        """Predicted data vectors, shape [n_samples, k]."""
        return np.concatenate([prediction.force_bins, prediction.Z[:, self.counted]], axis=1)

    def mask(self, part: Part) -> NDArray[np.bool_]:
        """Entries of a part of the data, shape [k]."""
        force = np.arange(len(self.data)) < self.n_force
        return np.ones_like(force) if part == "joint" else (force if part == "force" else ~force)

    def chi2(self, vectors: FloatArray, part: Part = "joint") -> FloatArray:
        """Sum of squared weighted residuals of each vector, shape [...]."""
        return np.asarray((self.whitened(vectors - self.data, part) ** 2).sum(axis=-1))

    def with_discrepancy(self, vector: FloatArray) -> "Objective":
        """The objective whose discrepancies explain this vector's residual beyond noise and front face.

        Of a residual r = e + M' a, with a of the front face's modes M standard normal, e is estimated with
        its uncertainty, on which the discrepancy depends in turn (expectation maximisation). Its mean square
        beyond the noise and the patterns' own error is the discrepancy: a mean with weights D^-2, D the
        variance of e, which is the most likely one where variances differ (Fisher scoring). Without modes e
        is r, and the mean is plain.
        """
        residual, n = vector - self.data, self.n_force
        found = replace(self, force_discrepancy=0.0, shape_discrepancy=0.0)
        known = len(self.front_noise) > 0
        square, weight = residual**2, np.ones(len(residual))
        for turn in range(ROUNDS if known else 1):
            if turn:
                left, variance = found._without_front(residual)
                square, weight = left**2 + variance, found.own_sigma**-4
            excess = square - self.noise**2 - self.pattern_variance
            found = replace(
                self,
                force_discrepancy=_root_of_mean(excess[:n], weight[:n]),
                shape_discrepancy=_root_of_mean(excess[n:], weight[n:]),
            )
        return found

    def unexplained(self, residual: FloatArray) -> FloatArray:
        """A residual without its most likely part by the front face's noise, shape [k].

        D (D + M' M)^-1 r with the variances D of noise and discrepancy and the modes M, by Woodbury's
        identity: the matrix that is inverted has the size of the modes.
        """
        return self._without_front(residual)[0]

    def _without_front(self, residual: FloatArray) -> tuple[FloatArray, FloatArray]:
        """`unexplained`, and the variance of the part that it takes off, shape [k] both."""
        modes, weight = self.front_noise, self.own_sigma**-2
        # Sums without BLAS: its threads cost more than these few rows.
        inner = np.eye(len(modes)) + np.einsum("ik,jk,k->ij", modes, modes, weight)
        spread = np.einsum("ij,jk->ik", np.linalg.inv(inner), modes)
        share = np.einsum("ik,k->i", modes, weight * residual)
        return residual - np.einsum("ik,i->k", spread, share), np.einsum("ik,ik->k", spread, modes)

    def deviance(self, vectors: FloatArray, part: Part = "joint") -> FloatArray:
        """Minus twice the log-likelihood of vectors [n, k], each with its own discrepancies, shape [n].

        Up to a constant; unlike `chi2` it can be compared between points whose discrepancies differ.
        """
        found = []
        for vector in vectors:
            weighed = self.with_discrepancy(vector)
            chi2 = float(weighed.chi2(vector, part))
            found.append(chi2 + weighed.whitening(part).log_determinant)
        return np.array(found)

    def balanced_deviance(self, vectors: FloatArray) -> FloatArray:
        """`deviance` in which a frame's outline counts as one entry, shape [n].

        For vectors from a mesh that is too coarse for the outline's noise: their residuals are smooth fields,
        of which a frame's points are no independent witnesses, and by number alone the outline's points would
        outvote the force.
        """
        if not self.observations.has_shape:
            return self.deviance(vectors)
        return self.deviance(vectors, "force") + self.deviance(vectors, "shape") / self.points_per_frame

    def prior_chi2(self, x: FloatArray, part: Part = "joint") -> float:
        """What the prior adds to `chi2` at a point, shape [d]; nothing for a part of the data alone."""
        return 0.0 if self.prior is None or part != "joint" else float(self.prior.chi2(x))

    def prior_precision(self, dimension: int, part: Part = "joint") -> FloatArray:
        """What the prior adds to the normal matrix J^T C^-1 J, shape [d, d]; of what comes behind the free
        parameters (a clock's lag, fitted beside them) it says nothing."""
        precision = np.zeros((dimension, dimension))
        if self.prior is not None and part == "joint":
            free = len(self.prior.precision)
            precision[:free, :free] = self.prior.precision
        return precision

    def gain(self, jacobian: FloatArray, part: Part = "joint") -> FloatArray:
        """Linear map from a change of the data vector to the change of the optimum, shape [d, k]."""
        use = self.mask(part)
        found = np.zeros(jacobian.T.shape)
        normal = self.information(jacobian, part) + self.prior_precision(jacobian.shape[1], part)
        found[:, use] = np.linalg.solve(normal, self.whitening(part).precision(jacobian[use].T))
        return found

    def information(self, jacobian: FloatArray, part: Part = "joint") -> FloatArray:
        """The data's part of the normal matrix, J^T C^-1 J, shape [d, d]."""
        slopes = self.whitened(jacobian.T, part)
        return np.asarray(slopes @ slopes.T)

    def spread(self, gain: FloatArray) -> FloatArray:
        """A linear map of the data times their covariance C, shape [d, k]."""
        return np.asarray(gain * self.own_sigma**2 + (gain @ self.front_noise.T) @ self.front_noise)

    def spread_of_prior(self, jacobian: FloatArray, part: Part = "joint") -> FloatArray:
        """The prior's part of the covariance, N^-1 P N^-1 with N = J^T C^-1 J + P, shape [d, d]."""
        precision = self.prior_precision(jacobian.shape[1], part)
        if not precision.any():
            return precision
        inverse = np.linalg.inv(self.information(jacobian, part) + precision)
        return np.asarray(inverse @ precision @ inverse)

    @property
    def scale_error(self) -> FloatArray:
        """Change of the data vector by one standard uncertainty of the transmitted force's scale, shape [k].

        A wrong scale is no noise: it bends every force alike, and the residuals need not show it.
        """
        transmitted = np.arange(len(self.data)) < len(self.observations.bins.mean)
        return np.where(transmitted, self.observations.force_sigma_gain * self.data, 0.0)

    def covariance(self, jacobian: FloatArray, vector: FloatArray, part: Part = "joint") -> FloatArray:
        """Covariance of the optimum from the residuals and the front face's noise, shape [d, d]."""
        moves = self.gain(jacobian, part) @ self.front_noise.T
        return np.asarray(self.residual_covariance(jacobian, vector, part) + moves @ moves.T)

    def residual_covariance(
        self, jacobian: FloatArray, vector: FloatArray, part: Part = "joint"
    ) -> FloatArray:
        """Covariance of the optimum from the residuals and the prior, correlated in time or not, [d, d].

        What the front face's noise explains of the residuals is not in it. It is the Gauss-Newton covariance
        for independent residuals, or the block "sandwich" in which the residuals of a block of time may be
        correlated in any way; of the block lengths in `BLOCKS` the one with the largest variances counts. A
        smaller estimate is never preferred. Nor is one below that of weights by each entry's whole variance,
        as if the front face's noise had nothing in common: the patterns serve the answer, its interval does
        not rest on them.
        """
        use = self.mask(part)
        gain = self.gain(jacobian, part)
        score = gain * self.unexplained(self.data - vector)
        known = self.spread_of_prior(jacobian, part)
        best = (gain * self.own_sigma**2) @ gain.T + known
        width = float(np.diff(self.observations.bins.edges).mean())
        block = ((self.times - self.times.min()) / width).astype(int)
        d = jacobian.shape[1]
        for length in BLOCKS:
            label = block // length
            n_blocks = label.max() + 1
            if n_blocks <= 4 * d:
                continue
            sums = np.array([np.bincount(label[use], row[use], minlength=n_blocks) for row in score])
            sandwich = sums @ sums.T * n_blocks / (n_blocks - d) + known
            if np.trace(sandwich / np.diag(best)) > np.trace(best / np.diag(best)):
                best = sandwich
        together = ((gain @ self.front_noise.T) ** 2).sum(axis=1)
        short = (self._variance_without_patterns(jacobian, part) - together) / np.diag(best)
        scale = np.sqrt(np.maximum(short, 1.0))
        return np.asarray(scale[:, None] * best * scale)

    def _variance_without_patterns(self, jacobian: FloatArray, part: Part) -> FloatArray:
        """Variances of the optimum if each entry's whole variance were its own, shape [d]."""
        rows = (jacobian / self.sigma[:, None])[self.mask(part)]
        return np.diag(np.linalg.inv(rows.T @ rows + self.prior_precision(jacobian.shape[1], part)))


def _root_of_mean(excess: FloatArray, weight: FloatArray) -> float:
    """Root of a weighted mean; zero where that is negative, or of nothing."""
    return float(np.sqrt(max(np.average(excess, weights=weight), 0.0))) if excess.size else 0.0
