"""Weighted least squares of force and outline: covariance of residuals, prior, uncertainty.

The data of a shot are one vector: force bin means, then counted outline points. Its covariance is

    C = diag(sigma^2 + tau^2 + PATTERN_ERROR^2 M^2) + M' M + O' O + s^2 S' S,

with these terms. The measured noise is sigma. Each channel has a discrepancy tau, estimated from the residual
at the optimum. The patterns M are the correlated changes of all predictions by noise of the front face's
motion. O are the common errors of outline points (`CentreLine.modes`). On the refined mesh, there are slow
patterns S with the amplitude s.

- Without tau, the weight of a channel with a large model error would be too high.
- Without M, tau would explain the ringing of a noisy onset and reduce the weight of the whole channel.
- The patterns come from a coarse mesh and have the relative error PATTERN_ERROR. Without this term, the phase
  of every oscillation would dominate the fit.

The slow error is a polynomial of height and time with independent coefficients: e(y, t) = s sum_ij a_ij
P_i(y) P_j(t), a_ij ~ N(0, 1), i, j < DEGREES. The P are Legendre polynomials. They are scaled, and s is the
error's root mean square over the points. The covariance of an optimum allows residuals that are correlated
over blocks of time (block "sandwich").
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from doe.least_squares import Whitening
from kolsky.base.arrays import FloatArray, IntArray
from kolsky.inverse.observations import Observations, Prediction

DEGREES = 4
"""Number of polynomials in height and in time, constant to cubic. They describe offset, scale, tilt and
curvature of a measured surface, and their change as the specimen shortens."""
LARGEST_AMPLITUDE = 1e6
"""Largest amplitude searched, divided by its uncertainty from the independent errors [-]."""
TRIAL_AMPLITUDES = np.linspace(-5.0, float(np.log(LARGEST_AMPLITUDE)), 40)
"""Logarithms of the first trial amplitudes, with the same normalisation."""


def slow_patterns(height: FloatArray, time: FloatArray) -> FloatArray:
    """Patterns of an error with a root mean square of one over the points, shape [DEGREES^2, n].

    There are fewer if too few heights or times distinguish them, and none without points. ``height``,
    ``time``: of the points, in any unit, shape [n].
    """
    found = [a * b for a in _polynomials(height) for b in _polynomials(time)]
    if not found or not len(height):
        return np.zeros((0, len(height)))
    patterns = np.array(found)
    return np.asarray(patterns / np.sqrt((patterns**2).sum(axis=0).mean()))


def _polynomials(x: FloatArray) -> list[FloatArray]:
    """Legendre polynomials over the range of the values, at most as many as there are different values."""
    many = min(DEGREES, len(np.unique(x)))
    if many < 2:
        return [np.ones(len(x))][:many]
    low, high = float(np.min(x)), float(np.max(x))
    scaled = (2.0 * x - low - high) / (high - low)
    return list(legendre.legvander(scaled, many - 1).T)


def most_likely_amplitude(residual: FloatArray, patterns: FloatArray, other: Whitening) -> float:
    """Most likely standard deviation of the patterns' amplitudes, in the residual's unit.

    ``other``: the weights by the covariance C of all other errors. With the whitened patterns B = V S U' and
    the coordinates h = U' r of the whitened residual, -2 ln L is ``sum ln(1 + s^2 S^2) + h^2 / (1 + s^2
    S^2)``.
    """
    if not len(patterns):
        return 0.0
    white = other.apply(np.vstack([patterns, residual[None]]))
    values, vectors = np.linalg.eigh(white[:-1] @ white[:-1].T)
    kept = values > 1e-9 * values[-1]
    size = values[kept]
    seen = (vectors[:, kept].T @ (white[:-1] @ white[-1])) ** 2 / size

    def deviance(log_share: FloatArray | float) -> FloatArray:
        total = 1.0 + np.exp(2.0 * log_share) * size / size[-1]
        return np.asarray((np.log(total) + seen / total).sum(axis=-1))

    first = int(np.argmin(deviance(TRIAL_AMPLITUDES[:, None])))
    if deviance(TRIAL_AMPLITUDES[first]) >= seen.sum():
        return 0.0
    near = (
        float(TRIAL_AMPLITUDES[max(first - 1, 0)]),
        float(TRIAL_AMPLITUDES[min(first + 1, len(TRIAL_AMPLITUDES) - 1)]),
    )
    best = float(minimize_scalar(lambda x: float(deviance(x)), bounds=near, method="bounded").x)
    return float(np.exp(best) / np.sqrt(size[-1]))


def residual_without_common(
    residual: FloatArray, common: FloatArray, own_sigma: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """A residual minus its most likely part due to common errors, and that part's variance, [k] each.

    It is D (D + M' M)^-1 r with the variances D of the independent errors and the common rows M. Woodbury's
    identity reduces the inverse to the number of rows of M.
    """
    weight: FloatArray = own_sigma**-2
    inner = np.eye(len(common)) + (common * weight) @ common.T
    spread: FloatArray = np.linalg.inv(inner) @ common
    return residual - (common @ (weight * residual)) @ spread, np.einsum("ik,ik->k", spread, common)


ROUNDS = 6
"""Iterations that separate discrepancies and front-face noise; each leaves about a tenth of the error."""


def most_likely_discrepancies(
    residual: FloatArray,
    n_force: int,
    *,
    known: FloatArray,
    common: FloatArray,
    slow: FloatArray,
    counts: FloatArray | float = 1.0,
) -> tuple[float, float, float]:
    """Discrepancy of the force [N] and the outline [m], and root mean square of the slow error [m].

    ``known``: standard deviations of the independent noise, shape [k]. ``common``, ``slow``: rows of common
    errors, [n, k]. ``counts``: number of independent values that each entry represents [-], as in
    `Whitening`; equal within a channel. The result minimises ``Whitening.deviance``.
    """
    square, weight = residual**2, np.ones(len(residual))
    force = shape = amplitude = 0.0
    own = known
    for turn in range(ROUNDS if len(common) + len(slow) else 1):
        if turn:
            every = np.concatenate([common, amplitude * slow])
            left, variance = residual_without_common(residual, every, own / np.sqrt(counts))
            square, weight = left**2 + variance, own**-4
        excess = square - known**2
        force = _root_of_mean(excess[:n_force], weight[:n_force])
        shape = _root_of_mean(excess[n_force:], weight[n_force:])
        tau = np.where(np.arange(len(residual)) < n_force, force, shape)
        own = np.sqrt(known**2 + tau**2)
        amplitude = most_likely_amplitude(residual, slow, Whitening(own / np.sqrt(counts), common))
    return force, shape, amplitude


def _root_of_mean(excess: FloatArray, weight: FloatArray) -> float:
    """Square root of a weighted mean; zero if the mean is negative or there are no values."""
    return float(np.sqrt(max(weight @ excess / weight.sum(), 0.0))) if excess.size else 0.0


BLOCKS = (2, 4, 8, 16)
"""Block lengths in force bins. Residuals within a block may be correlated in time."""


def correlated_in_blocks(
    score: FloatArray, block: IntArray, independent: FloatArray, known: FloatArray
) -> FloatArray:
    """Covariance of the optimum with or without correlated residuals within blocks of time, shape [d, d].

    The largest variances count, of all `BLOCKS` with more than four blocks per parameter and without blocks.
    """
    best, d = independent, len(score)
    for length in BLOCKS:
        label = block // length
        n_blocks = label.max() + 1
        if n_blocks <= 4 * d:
            continue
        sums = np.array([np.bincount(label, row, minlength=n_blocks) for row in score])
        sandwich = sums @ sums.T * n_blocks / (n_blocks - d) + known
        if np.trace(sandwich / np.diag(best)) > np.trace(best / np.diag(best)):
            best = sandwich
    return best


@dataclass(frozen=True)
class Prior:
    """Independent Gaussian priors of the free parameters, in their order and units.

    Raises ValueError if the shapes differ, if a mean is not finite, or if a standard deviation is not > 0.
    """

    mean: FloatArray
    """Most likely values before the test, shape [d]; not used where sigma is infinite."""
    sigma: FloatArray
    """Standard deviations, shape [d]; infinite without prior knowledge."""

    def __post_init__(self) -> None:
        if self.mean.shape != self.sigma.shape or self.mean.ndim != 1:
            raise ValueError(
                f"mean and sigma must be of one shape [d], got {self.mean.shape}, {self.sigma.shape}"
            )
        if not (np.isfinite(self.mean).all() and (self.sigma > 0.0).all()):
            raise ValueError(f"a prior needs finite means and sigmas > 0, got {self.mean} and {self.sigma}")

    @classmethod
    def of(cls, names: Sequence[str], declared: Mapping[str, tuple[float, float]]) -> Prior | None:
        """The priors of declared values with standard uncertainties; None if no free parameter has one.

        ``names``: free parameters, in their order. ``declared``: value and standard uncertainty by name.
        """
        known = [declared.get(name, (0.0, np.inf)) for name in names]
        if not any(np.isfinite(sigma) for _, sigma in known):
            return None
        mean, sigma = np.array(known, dtype=np.float64).T
        return cls(mean, sigma)

    @property
    def precision(self) -> FloatArray:
        """Inverse covariance, shape [d, d]."""
        return np.diag(self.sigma**-2.0)

    def residuals(self, points: FloatArray) -> FloatArray:
        """(x - mean) / sigma of the parameters that have a prior, shape [..., d] -> [..., p]."""
        known = np.isfinite(self.sigma)
        residuals: FloatArray = ((points - self.mean) / self.sigma)[..., known]
        return residuals

    def rows(self) -> FloatArray:
        """Derivatives of `residuals` by the parameters, shape [p, d]."""
        return np.diag(1.0 / self.sigma)[np.isfinite(self.sigma)]

    def chi2(self, points: FloatArray) -> FloatArray:
        """Sum of squared residuals, -2 ln of the density up to a constant, shape [..., d] -> [...]."""
        return np.asarray((self.residuals(points) ** 2).sum(axis=-1))


Part = Literal["joint", "force", "shape"]


def weighting_with_prior(objective: Objective, known: int) -> Callable[[FloatArray], Whitening]:
    """Weights of the data and of ``known`` residuals of a prior, for a residual, shape [k + known]."""

    def weighting(residual: FloatArray) -> Whitening:
        weighed = objective.with_discrepancy(objective.data + residual[: len(objective.data)])
        patterns, ones = np.pad(weighed.common, ((0, 0), (0, known))), np.ones(known)
        sigma, counts = (np.concatenate([each, ones]) for each in (weighed.own_sigma, weighed.counts))
        return Whitening(sigma, patterns, counts)

    return weighting


PATTERN_ERROR = 0.2
"""Standard uncertainty of the front face's patterns over their size [-], independent from entry to entry."""


WITH_DISCREPANCIES = ("common", "own_sigma", "sigma", "_whitenings")
"""Cached properties that depend on the discrepancies; the next objective reuses all others."""


@dataclass(frozen=True)
class FrontNoise:
    """Effect of the noise of the front face's motion on predictions, over bins [N] and all points [m]."""

    patterns: FloatArray | None = None
    """Changes by one standard deviation of each mode, shape [n_modes, n_bins + Q]; None if unknown."""
    offset: FloatArray | None = None
    """Change along them by the corrected path, shape [n_bins + Q]; None if it was not corrected."""

    def over(self, entries: Callable[[FloatArray], FloatArray]) -> FrontNoise:
        """The same over other bins and points; ``entries`` selects them in rows, [..., n_bins + Q]."""
        return FrontNoise(*(None if rows is None else entries(rows) for rows in (self.patterns, self.offset)))


@dataclass(frozen=True)
class Objective:
    """Chi-square of a predicted data vector."""

    observations: Observations
    counted: NDArray[np.bool_]
    """Mask of the outline points inside the model's range in every run, shape [n_points]."""
    front: FrontNoise = field(default_factory=FrontNoise)
    force_discrepancy: float = 0.0
    """tau of the force's bin means [N]."""
    shape_discrepancy: float = 0.0
    """tau of the outline points [m]."""
    prior: Prior | None = None
    """Prior of the free parameters; not used if only a part of the data is fitted."""
    slowly: bool = False
    """True if outline points have a slowly varying common error."""
    slow_discrepancy: float = 0.0
    """Root mean square of that error [m]."""
    balanced: bool = False
    """True if the points of a frame count as one value, see `balanced_deviance`."""

    @property
    def n_force(self) -> int:
        """Number of force bins at the start of the data vector."""
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
        """Changes of the data by the front face's noise, one standard deviation per mode, [n_modes, k]."""
        modes = self.front.patterns
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
        """Common errors of outline points, one standard deviation per mode, [n_modes, k]."""
        modes = self.observations.centre_line.modes
        if modes is None:
            return np.zeros((0, len(self.data)))
        return np.pad(modes[:, self.counted], ((0, 0), (self.n_force, 0)))

    @cached_property
    def known_common(self) -> FloatArray:
        """Known common errors of the data: `front_noise`, then `outline_errors`, [n_modes, k]."""
        return np.concatenate([self.front_noise, self.outline_errors])

    @cached_property
    def common(self) -> FloatArray:
        """All common errors of the data: the known ones, then the slow error, shape [n_modes, k]."""
        return np.concatenate([self.known_common, self.slow_discrepancy * self.slow_patterns])

    @cached_property
    def points_per_frame(self) -> float:
        """Mean number of counted outline points of a frame [-]; 1 if there are none."""
        frames = self.observations.centre_line.frame[self.counted]
        return len(frames) / len(np.unique(frames)) if len(frames) else 1.0

    @cached_property
    def own_sigma(self) -> FloatArray:
        """Independent errors: noise, discrepancy and pattern error in quadrature, shape [k]."""
        tau = np.full(len(self.data), self.shape_discrepancy)
        tau[: self.n_force] = self.force_discrepancy
        return np.sqrt((self.noise**2 + tau**2 + self.pattern_variance) / self.counts)

    @cached_property
    def counts(self) -> FloatArray:
        """Number of independent values that each entry represents [-], shape [k]; 1 unless `balanced`."""
        return np.where(self._of_force | (not self.balanced), 1.0, 1.0 / self.points_per_frame)

    @cached_property
    def pattern_variance(self) -> FloatArray:
        """Variance of each entry due to errors of the front face's patterns, shape [k]."""
        return np.asarray(PATTERN_ERROR**2 * (self.front_noise**2).sum(axis=0))

    @cached_property
    def sigma(self) -> FloatArray:
        """Standard deviation of each entry: noise, discrepancies, front face, shape [k]."""
        return np.sqrt(self.own_sigma**2 + (self.common**2).sum(axis=0))

    @cached_property
    def _whitenings(self) -> dict[Part, Whitening]:
        return {}

    def whitening(self, part: Part = "joint") -> Whitening:
        """The weights of a part of the data; they apply to rows of its entries, see `mask`."""
        if part not in self._whitenings:
            use = self.mask(part)
            self._whitenings[part] = Whitening(self.own_sigma[use], self.common[:, use], self.counts[use])
        return self._whitenings[part]

    def whitened(self, rows: FloatArray, part: Part = "joint") -> FloatArray:
        """Rows of shape [..., k], weighted for least squares with the part's data, shape [..., p]."""
        return self.whitening(part).apply(rows[..., self.mask(part)])

    @cached_property
    def times(self) -> FloatArray:
        """Time of each entry [s], shape [k]."""
        seen = self.observations
        return np.concatenate([seen.force_times, seen.centre_line.time[self.counted]])

    @property
    def block(self) -> IntArray:
        """Number of the force bin's width in which each entry lies, from the first one, shape [k]."""
        width = float(np.diff(self.observations.bins.edges).mean())
        return np.asarray(((self.times - self.times.min()) / width).astype(np.int64))

    def vectors(self, prediction: Prediction) -> FloatArray:
        """Predicted data vectors, shape [n_samples, k], for the path as fitted to its record."""
        return self.under_fitted_path(
            np.concatenate([prediction.force_bins, prediction.Z[:, self.counted]], axis=1)
        )

    def reached(self, prediction: Prediction) -> FloatArray:
        """Predicted data vectors, with the measured value at outline points that a run does not reach."""
        vectors = self.vectors(prediction)
        return np.where(np.isnan(vectors), self.data, vectors)

    def under_fitted_path(self, vectors: FloatArray) -> FloatArray:
        """Vectors of shape [..., k] minus the change by the correction of the front face's path."""
        offset = self.front.offset
        return vectors if offset is None else vectors - offset[self.kept]

    @cached_property
    def kept(self) -> NDArray[np.bool_]:
        """Mask of the bins and points that are in the data vector, shape [n_bins + Q]."""
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

    def with_discrepancy(self, vector: FloatArray) -> Objective:
        """The objective with discrepancies from the residual of this vector beyond noise and front face."""
        known = np.sqrt(self.noise**2 + self.pattern_variance)
        force, shape, slow = most_likely_discrepancies(
            vector - self.data,
            self.n_force,
            known=known,
            common=self.known_common,
            slow=self.slow_patterns,
            counts=self.counts,
        )
        found = replace(self, force_discrepancy=force, shape_discrepancy=shape, slow_discrepancy=slow)
        for name, value in vars(self).items():
            if name not in WITH_DISCREPANCIES and isinstance(getattr(Objective, name, None), cached_property):
                vars(found)[name] = value
        return found

    def unexplained(self, residual: FloatArray) -> FloatArray:
        """A residual minus its most likely part by common errors (`residual_without_common`), [k]."""
        return residual_without_common(residual, self.common, self.own_sigma)[0]

    def deviance(self, vectors: FloatArray, part: Part = "joint") -> FloatArray:
        """-2 ln L of vectors [n, k] up to a constant, with discrepancies estimated for each, shape [n].

        Unlike `chi2` it can be compared between points with different discrepancies.
        """
        found = []
        for vector in vectors:
            weighed = self.with_discrepancy(vector)
            chi2 = float(weighed.chi2(vector, part))
            found.append(chi2 + weighed.whitening(part).log_determinant)
        return np.array(found)

    def balanced_deviance(self, vectors: FloatArray) -> FloatArray:
        """`deviance`, with the outline of each frame counted as one entry, shape [n].

        On a coarse mesh the residuals are smooth fields, and the points of a frame are not independent. If
        each point counted, the outline would outweigh the force.
        """
        if not self.observations.has_shape:
            return self.deviance(vectors)
        return self.deviance(vectors, "force") + self.deviance(vectors, "shape") / self.points_per_frame

    def prior_chi2(self, x: FloatArray, part: Part = "joint") -> float:
        """Contribution of the prior to `chi2` at a point, shape [d]; zero for a single part of the data."""
        return 0.0 if self.prior is None or part != "joint" else float(self.prior.chi2(x))

    def prior_precision(self, dimension: int, part: Part = "joint") -> FloatArray:
        """Contribution of the prior to J^T C^-1 J, shape [d, d]; zero for further unknowns."""
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

        The residuals may not show a wrong scale, which is not noise.
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
        """Covariance of the optimum from residuals and prior, with or without time correlation, [d, d].

        It excludes the part of the residuals due to the front face's noise, and includes the slow error of
        the outline. It is the larger of Gauss-Newton's with independent residuals and the block "sandwich"
        (`kolsky.inverse.objective`). Its variance is not below that of uncorrelated weights: common patterns
        may improve the estimate but do not shrink its interval.
        """
        gain = self.gain(jacobian, part)
        score = gain * self.unexplained(self.data - vector)
        slow = self.slow_discrepancy * (gain @ self.slow_patterns.T)
        known = self.spread_of_prior(jacobian, part) + slow @ slow.T
        best = (gain * self.own_sigma**2) @ gain.T + known
        best = correlated_in_blocks(score, self.block, best, known)
        together = ((gain @ self.known_common.T) ** 2).sum(axis=1)
        # variances of the optimum with uncorrelated weights, the total variance of each entry
        rows = (jacobian / self.sigma[:, None])[self.mask(part)]
        plain = np.diag(np.linalg.inv(rows.T @ rows + self.prior_precision(jacobian.shape[1], part)))
        scale = np.sqrt(np.maximum((plain - together) / np.diag(best), 1.0))
        return np.asarray(scale[:, None] * best * scale)
