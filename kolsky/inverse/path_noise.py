"""Noise of the front face's path: its modes, their most likely amplitudes, and the corrected path.

Noise of a flyer's record shifts the onset of its motion. The ringing of a soft specimen depends on the onset.
Modes are independent changes of the path with their effect on the data (singular vectors of the effects of
its noise patterns). They are computed at one point and ring at that point's frequency. If the path error is
large, an estimate of Poisson's ratio would follow the modes instead of the data. The model is therefore run
with the path p = p_0 + sum_k c_k d_k that explains the residual. Here d_k are the noise patterns of the
fitted path p_0. The same change in terms of the modes, M' a, is subtracted from its predictions. For a linear
response nothing changes, not even the prior of the path.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from kolsky.bars.flyer.path import FlyerPath
from kolsky.base.arrays import FloatArray
from kolsky.inverse.objective import FrontNoise, Objective
from kolsky.inverse.observations import Observations, Prediction

PATTERNS = 16
"""Number of noise patterns of the path that are run [-]. They give 0.999 of the variance that all 174
patterns cause in the data of `runs/open-01` and `runs/open-05`. The same number of random draws gives the
variance with an error of a fifth."""
SMALLEST_MODE = 0.3
"""A mode is left out if it changes the whole data vector by less than this, in units of its noise."""


@dataclass(frozen=True)
class PathModes:
    """Independent changes of the path and their effect on the data, one standard deviation per mode."""

    patterns: FloatArray
    """Changes of bins and all points, shape [q, k]."""
    shares: FloatArray
    """Shares of the jerks in each mode [-], orthonormal rows, shape [q, n]."""
    jerks: FloatArray
    """Independent changes of the path's jerk, one standard deviation each [m/s^3], shape [n, n_spans]."""

    @classmethod
    def of(cls, change: FloatArray, noise: FloatArray, jerks: FloatArray) -> PathModes:
        """The modes from the effect of independent changes of the path on the data.

        ``change``: data with each change minus those with the path, [n, k]. ``noise``: standard deviations of
        the data, [k].
        """
        left, size, right = np.linalg.svd(change / noise, full_matrices=False)
        kept = size > SMALLEST_MODE
        return cls(size[kept, None] * right[kept] * noise, left[:, kept].T, jerks)

    @property
    def own_jerks(self) -> FloatArray:
        """Changes of the path's jerk by a standard deviation of each mode [m/s^3], shape [q, n_spans]."""
        return self.shares @ self.jerks

    def amplitudes(self, shares: FloatArray) -> FloatArray:
        """Amplitudes of the modes in a path with given shares of the jerks, [n] -> [q], without the rest."""
        return np.asarray(self.shares @ shares)


@dataclass(frozen=True)
class MovedFront:
    """The front face's path in the runs: the fitted path, corrected by modes of its noise."""

    fitted: FlyerPath
    modes: PathModes
    amplitudes: FloatArray
    """Amplitudes of the modes in the path [-], shape [q]."""

    @property
    def path(self) -> FlyerPath:
        """The fitted path plus the modes; its covariance is unchanged."""
        return replace(self.fitted, jerk=self.fitted.jerk + self.amplitudes @ self.modes.own_jerks)

    @property
    def offset(self) -> FloatArray:
        """The same change in terms of the patterns, shape [k]. It is subtracted from predictions."""
        return np.asarray(self.amplitudes @ self.modes.patterns)


@dataclass(frozen=True)
class FrontPath:
    """The front face's path in the runs, and the effect of its noise on the data."""

    path: FlyerPath
    noise: FrontNoise = field(default_factory=FrontNoise)
    """Its patterns, and the change by the path correction along them."""
    moved: MovedFront | None = None
    """The path correction; None if the path is not corrected."""

    @classmethod
    def following(cls, moved: MovedFront) -> FrontPath:
        """A corrected path. Its change is subtracted by means of its patterns."""
        return cls(moved.path, FrontNoise(moved.modes.patterns, moved.offset), moved)

    def with_noise(self, patterns: FloatArray, offset: FloatArray | None = None) -> FrontPath:
        """The same path with other patterns."""
        return replace(self, noise=FrontNoise(patterns, offset))


def replicate_uncertainty(moves: FloatArray) -> FloatArray:
    """Standard uncertainty from replicates, [d]: root mean square of the shifts of the optimum, [n, d]."""
    return np.asarray(np.sqrt((moves**2).mean(axis=0)))


def data_change(prediction: Prediction) -> FloatArray:
    """Bins and all points of every run minus those of the first, [n, n_bins + Q]; zero where not reached."""
    vectors = np.concatenate([prediction.force_bins, prediction.Z], axis=1)
    return np.nan_to_num(vectors - vectors[0])


def drawn_modes(change: FloatArray, noise: FloatArray) -> FloatArray:
    """Independent patterns with the same mean square as replicates' changes [n, k], [n_modes, k]."""
    return PathModes.of(change / np.sqrt(len(change)), noise, change).patterns


def noise_of(observations: Observations) -> FloatArray:
    """Measured standard deviations of bins and all points, shape [n_bins + Q]."""
    return np.concatenate([observations.force_sigma, observations.centre_line.sigma])


def rms_amplitude(amplitudes: FloatArray) -> float:
    """Root mean square of amplitudes [-]; 0 if there are none."""
    return float(np.sqrt((amplitudes**2).mean())) if len(amplitudes) else 0.0


CREDIBLE = 4.0
"""Root mean square of the amplitudes beyond which a record is wrong, not noisy, and not corrected [-]."""


def likely_amplitudes(objective: Objective, residual: FloatArray) -> FloatArray:
    """Most likely amplitudes of the front face's patterns for a residual of shape [k], shape [q].

    a = M C^-1 r with the patterns M and the covariance C of the residual r = data - prediction. C includes
    the patterns; the prior of their amplitudes is standard normal.
    """
    return np.asarray(objective.front_noise @ objective.whitening().precision(residual))


def credible(amplitudes: FloatArray) -> bool:
    """True if there are amplitudes and their size is plausible for noise of the record."""
    return 0.0 < rms_amplitude(amplitudes) <= CREDIBLE
