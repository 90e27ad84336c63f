"""Noise of the front face's path: its modes, their most likely amplitudes, and the path moved by them.

Noise of a flyer's record moves the onset of its motion, and a soft specimen rings with it. Modes are
independent changes of the path with what each does to the data (singular vectors of what the patterns of
its noise do). They are changes of the data at one point and ring at that point's frequency: where the path
is off by much, an estimate of Poisson's ratio would follow them instead of the data. So the model is run
under the path p = p_0 + sum_k c_k d_k that explains the residual, over patterns d_k of the noise of the
fitted path p_0, and the same change in terms of the modes, M' a, is taken off its predictions. For a linear
response nothing changes, the prior of the path included.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from kolsky.bars.flyer.path import FlyerPath
from kolsky.base.arrays import FloatArray
from kolsky.inverse.objective import FrontNoise, Objective
from kolsky.inverse.observations import Observations, Prediction

PATTERNS = 16
"""Patterns of the path's noise that are run [-]: 0.999 of what all 174 do to the data of `runs/open-01` and
`runs/open-05`, in squares; as many draws miss or add a fifth."""
SMALLEST_MODE = 0.3
"""A mode that moves the whole data vector by less, in units of its noise, is left out."""


@dataclass(frozen=True)
class PathModes:
    """Independent changes of the path with what each does to the data, a standard deviation a mode."""

    patterns: FloatArray
    """Changes of bins and all points, shape [q, k]."""
    shares: FloatArray
    """Shares of the jerks in each mode [-], rows of length 1 at right angles, shape [q, n]."""
    jerks: FloatArray
    """Independent changes of the path's jerk, a standard deviation each [m/s^3], shape [n, n_spans]."""

    @classmethod
    def of(cls, change: FloatArray, noise: FloatArray, jerks: FloatArray) -> PathModes:
        """From what independent changes of the path do to the data.

        ``change``: data under each change less those under the path, shape [n, k]. ``noise``: standard
        deviations of the data, shape [k]. ``jerks``: as above, shape [n, n_spans].
        """
        left, size, right = np.linalg.svd(change / noise, full_matrices=False)
        kept = size > SMALLEST_MODE
        return cls(size[kept, None] * right[kept] * noise, left[:, kept].T, jerks)

    @property
    def own_jerks(self) -> FloatArray:
        """Changes of the path's jerk by a standard deviation of each mode [m/s^3], shape [q, n_spans]."""
        return self.shares @ self.jerks

    def amplitudes(self, shares: FloatArray) -> FloatArray:
        """Amplitudes of the modes in a path that has some shares of the jerks, shape [q].

        What of it no mode reaches is left out.

        ``shares``: shape [n].
        """
        return np.asarray(self.shares @ shares)

    def moved(self, fitted: FlyerPath, amplitudes: FloatArray) -> FlyerPath:
        """The fitted path moved by modes of some amplitudes, shape [q]; its covariance stays."""
        return replace(fitted, jerk=fitted.jerk + amplitudes @ self.own_jerks)


@dataclass(frozen=True)
class MovedFront:
    """The front face's path that the model is run under: that of the record, moved by modes of its noise."""

    fitted: FlyerPath
    """As fitted to the record."""
    modes: PathModes
    """Of its noise."""
    amplitudes: FloatArray
    """Of the modes in the path [-], shape [q]."""

    @property
    def path(self) -> FlyerPath:
        """The path."""
        return self.modes.moved(self.fitted, self.amplitudes)

    @property
    def offset(self) -> FloatArray:
        """The same change in terms of the patterns, which is taken off predictions, shape [k]."""
        return np.asarray(self.amplitudes @ self.modes.patterns)


@dataclass(frozen=True)
class FrontPath:
    """The front face's path that the model is run under, and what noise of it does to the data."""

    path: FlyerPath
    """The path."""
    noise: FrontNoise = field(default_factory=FrontNoise)
    """Its patterns, and what the path's move adds along them."""
    moved: MovedFront | None = None
    """How it was moved; None if it is as fitted to the record."""

    @classmethod
    def following(cls, moved: MovedFront) -> FrontPath:
        """A moved path, its change taken off by its patterns."""
        return cls(moved.path, FrontNoise(moved.modes.patterns, moved.offset), moved)

    def with_noise(self, patterns: FloatArray, offset: FloatArray | None = None) -> FrontPath:
        """The same path with other patterns."""
        return replace(self, noise=FrontNoise(patterns, offset))


def replicate_uncertainty(moves: FloatArray) -> FloatArray:
    """Standard uncertainty from replicates: root mean square of the moves of the optimum.

    ``moves``: optimum of each replicate minus that of the reference, shape [n, d]. Returns: in the
    parameters' units, shape [d].
    """
    return np.asarray(np.sqrt((moves**2).mean(axis=0)))


def data_change(prediction: Prediction) -> FloatArray:
    """Bins and all points of every run less those of the first, shape [n, n_bins + Q].

    A point that a run does not reach adds nothing.
    """
    vectors = np.concatenate([prediction.force_bins, prediction.Z], axis=1)
    return np.nan_to_num(vectors - vectors[0])


def drawn_modes(change: FloatArray, noise: FloatArray) -> FloatArray:
    """Independent patterns of the data with the mean square of some replicates, shape [n_modes, k].

    ``change``: data of each replicate less those of the reference, shape [n, k]. ``noise``: standard
    deviations of the data, shape [k].
    """
    return PathModes.of(change / np.sqrt(len(change)), noise, change).patterns


def noise_of(observations: Observations) -> FloatArray:
    """Measured standard deviations of bins and all points, shape [n_bins + Q]."""
    return np.concatenate([observations.force_sigma, observations.centre_line.sigma])


def rms_amplitude(amplitudes: FloatArray) -> float:
    """Root mean square of amplitudes [-]; 0 of none."""
    return float(np.sqrt((amplitudes**2).mean())) if len(amplitudes) else 0.0


FOLLOWED = 2.0
"""Root mean square of the amplitudes, each standard normal beforehand, up to which the path is left: the
patterns are linear enough for what they have to explain [-]. Not so where Poisson's ratio is free: there any
path is followed, for patterns that ring at one frequency hold it there."""
CREDIBLE = 4.0
"""The same beyond which the path is left where its record puts it [-]: such a record is not noisy but wrong,
and no path may hide that."""


def likely_amplitudes(objective: Objective, residual: FloatArray) -> FloatArray:
    """Most likely amplitudes of the front face's patterns for a residual, shape [q].

    a = M C^-1 r with the patterns M, standard normal beforehand, and the covariance C of the residual
    r = data - prediction, theirs included.

    ``objective``: with the patterns, and the discrepancies of the residual. ``residual``: shape [k].
    """
    return np.asarray(objective.front_noise @ objective.whitening().precision(residual))


def credible(amplitudes: FloatArray) -> bool:
    """True if there are amplitudes, and noise of the record may have brought them."""
    return 0.0 < rms_amplitude(amplitudes) <= CREDIBLE
