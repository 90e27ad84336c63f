"""The joint least-squares objective and what its curvature says about uncertainty.

The data of a shot are one vector: the force's bin means, then the counted outline points. Its covariance is

    C = diag(sigma^2 + tau^2 + PATTERN_ERROR^2 M^2) + M' M + O' O + s^2 S' S,

with the measured noise sigma, a discrepancy tau of each channel, estimated from the residual at the optimum,
the patterns M in which the noise of the front face's motion moves all predictions together, the errors O that
outline points are known to have in common (`CentreLine.modes`), and on the refined mesh slow patterns S of an
error s that they turn out to have in common (`kolsky.inverse.common_errors`). Without tau a
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
from kolsky.inverse.block_covariance import correlated_in_blocks
from kolsky.inverse.common_errors import slow_patterns, without_common
from kolsky.inverse.discrepancies import most_likely_discrepancies
from kolsky.inverse.observations import Observations, Prediction
from kolsky.inverse.prior import Prior

Part = Literal["joint", "force", "shape"]

PATTERN_ERROR = 0.2
"""Standard uncertainty of the front face's patterns over their size [-], independent from entry to entry."""


WITHOUT_DISCREPANCIES = frozenset(
    {
        "_of_force",
        "data",
        "front_noise",
        "kept",
        "known_common",
        "noise",
        "outline_errors",
        "pattern_variance",
        "points_per_frame",
        "slow_patterns",
        "times",
    }
)
"""What an objective keeps once it is made and no discrepancy changes: the next one has it too."""


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
    slowly: bool = False
    """Whether outline points may have a slowly varying error in common."""
    slow_discrepancy: float = 0.0
    """Root mean square of that error [m]."""

    @property
    def n_force(self) -> int:
        """Number of force bins at the head of the data vector."""
        return self.observations.n_force

    @cached_property
    def data(self) -> FloatArray:
        """Measured data vector, shape [k]: force [N], then Z [m]."""
        return np.concatenate([self.observations.force_mean, self.observations.centre_line.Z[self.counted]])

    @cached_property
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
        return np.asarray(modes[:, self.kept])

    @cached_property
    def slow_patterns(self) -> FloatArray:
        """Patterns of a slow error of the outline with a root mean square of 1 m, shape [n_slow, k]."""
        if not self.slowly:
            return np.zeros((0, len(self.data)))
        line = self.observations.centre_line
        found = slow_patterns(line.y[self.counted], line.time[self.counted])
        return np.pad(found, ((0, 0), (self.n_force, 0)))

    @cached_property
    def outline_errors(self) -> FloatArray:
        """Errors that outline points have in common, one standard deviation a mode, [n_modes, k]."""
        modes = self.observations.centre_line.modes
        if modes is None:
            return np.zeros((0, len(self.data)))
        return np.pad(modes[:, self.counted], ((0, 0), (self.n_force, 0)))

    @cached_property
    def known_common(self) -> FloatArray:
        """What is known that data have in common: `front_noise`, then `outline_errors`, [n_modes, k]."""
        return np.concatenate([self.front_noise, self.outline_errors])

    @cached_property
    def common(self) -> FloatArray:
        """All that data have in common: what is known, then the slow error, shape [n_modes, k]."""
        return np.concatenate([self.known_common, self.slow_discrepancy * self.slow_patterns])

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
        """Standard deviation of each entry by itself: noise, discrepancies, front face, shape [k]."""
        return np.sqrt(self.own_sigma**2 + (self.common**2).sum(axis=0))

    @cached_property
    def _whitenings(self) -> dict[Part, Whitening]:
        return {}

    def whitening(self, part: Part = "joint") -> Whitening:
        """The weights of a part of the data, for rows of its entries, see `mask`."""
        if part not in self._whitenings:
            use = self.mask(part)
            self._whitenings[part] = Whitening(self.own_sigma[use], self.common[:, use])
        return self._whitenings[part]

    def whitened(self, rows: FloatArray, part: Part = "joint") -> FloatArray:
        """Rows of shape [..., k] such that least squares of them weigh the part's data, shape [..., p]."""
        return self.whitening(part).apply(rows[..., self.mask(part)])

    @cached_property
    def times(self) -> FloatArray:
        """Time of each entry [s], shape [k]."""
        seen = self.observations
        return np.concatenate([seen.force_times, seen.centre_line.time[self.counted]])

    def vectors(self, prediction: Prediction) -> FloatArray:
        """Predicted data vectors, shape [n_samples, k], under the path as its record alone gives it."""
        return self.under_fitted_path(
            np.concatenate([prediction.force_bins, prediction.Z[:, self.counted]], axis=1)
        )

    def under_fitted_path(self, vectors: FloatArray) -> FloatArray:
        """Vectors of shape [..., k] without what moving the front face's path has added to them."""
        offset = self.observations.front_offset
        return vectors if offset is None else vectors - offset[self.kept]

    @cached_property
    def kept(self) -> NDArray[np.bool_]:
        """Which of bins and all points are in the data vector, shape [n_bins + Q]."""
        return np.concatenate([np.ones(self.n_force, dtype=bool), self.counted])

    def mask(self, part: Part) -> NDArray[np.bool_]:
        """Entries of a part of the data, shape [k]."""
        force = self._of_force
        return np.ones_like(force) if part == "joint" else (force if part == "force" else ~force)

    @cached_property
    def _of_force(self) -> NDArray[np.bool_]:
        return np.arange(len(self.data)) < self.n_force

    def chi2(self, vectors: FloatArray, part: Part = "joint") -> FloatArray:
        """Sum of squared weighted residuals of each vector, shape [...]."""
        return np.asarray((self.whitened(vectors - self.data, part) ** 2).sum(axis=-1))

    def with_discrepancy(self, vector: FloatArray) -> "Objective":
        """The objective whose discrepancies explain this vector's residual beyond noise and front face.

        See `kolsky.inverse.discrepancies`.
        """
        force, shape, slow = most_likely_discrepancies(
            vector - self.data,
            self.n_force,
            known=np.sqrt(self.noise**2 + self.pattern_variance),
            common=self.known_common,
            slow=self.slow_patterns,
        )
        found = replace(self, force_discrepancy=force, shape_discrepancy=shape, slow_discrepancy=slow)
        found.__dict__.update(
            {name: self.__dict__[name] for name in WITHOUT_DISCREPANCIES & {*self.__dict__}}
        )
        return found

    def unexplained(self, residual: FloatArray) -> FloatArray:
        """A residual without its most likely part by what the data have in common, shape [k].

        D (D + M' M)^-1 r with the variances D of noise and discrepancy and the common rows M, by Woodbury's
        identity: the matrix that is inverted has the size of those.
        """
        return without_common(residual, self.common, self.own_sigma)[0]

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
        return np.asarray(gain * self.own_sigma**2 + (gain @ self.common.T) @ self.common)

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
        moves = self.gain(jacobian, part) @ self.known_common.T
        return np.asarray(self.residual_covariance(jacobian, vector, part) + moves @ moves.T)

    def residual_covariance(
        self, jacobian: FloatArray, vector: FloatArray, part: Part = "joint"
    ) -> FloatArray:
        """Covariance of the optimum from the residuals and the prior, correlated in time or not, [d, d].

        What the front face's noise explains of the residuals is not in it; the slow error of the outline is.
        It is the Gauss-Newton covariance for independent residuals, or the block "sandwich" in which the
        residuals of a block of time may be correlated in any way, whichever is larger
        (`kolsky.inverse.block_covariance`). Nor is one preferred below that of weights by each entry's whole
        variance, as if the front face's noise had nothing in common: the patterns serve the answer, its
        interval does not rest on them.
        """
        gain = self.gain(jacobian, part)
        score = gain * self.unexplained(self.data - vector)
        slow = self.slow_discrepancy * (gain @ self.slow_patterns.T)
        known = self.spread_of_prior(jacobian, part) + slow @ slow.T
        best = (gain * self.own_sigma**2) @ gain.T + known
        width = float(np.diff(self.observations.bins.edges).mean())
        block = ((self.times - self.times.min()) / width).astype(np.int64)
        best = correlated_in_blocks(score, block, best, known)
        together = ((gain @ self.known_common.T) ** 2).sum(axis=1)
        short = (self._variance_without_patterns(jacobian, part) - together) / np.diag(best)
        scale = np.sqrt(np.maximum(short, 1.0))
        return np.asarray(scale[:, None] * best * scale)

    def _variance_without_patterns(self, jacobian: FloatArray, part: Part) -> FloatArray:
        """Variances of the optimum if each entry's whole variance were its own, shape [d]."""
        rows = (jacobian / self.sigma[:, None])[self.mask(part)]
        return np.diag(np.linalg.inv(rows.T @ rows + self.prior_precision(jacobian.shape[1], part)))
