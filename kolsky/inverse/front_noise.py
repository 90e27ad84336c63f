"""The noise of the front face's motion as modes of the data, and the coarse optimum weighted by them.

The noise of a flyer's record moves the onset of its motion, and a soft specimen rings with it: force and
outline of the simulation are off by a pattern that is one and the same in all bins and points. Replicates of
the fitted path say which patterns are likely and how large they are.
"""

from dataclasses import replace

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.inverse.coarse_search import CoarseOptimum
from kolsky.inverse.completed_runs import Replicates
from kolsky.inverse.observations import Observations, Prediction
from kolsky.inverse.optimum import CorrectedSurrogate, search
from kolsky.inverse.path_modes import SMALLEST_MODE
from kolsky.inverse.staged_runs import StagedRuns


def replicate_uncertainty(moves: FloatArray) -> FloatArray:
    """Standard uncertainty from replicates: root mean square of the moves of the optimum.

    Parameters
    ----------
    moves
        Optimum of each replicate minus that of the reference, shape [n, d].

    Returns
    -------
    ndarray
        In the parameters' units, shape [d].
    """
    return np.asarray(np.sqrt((moves**2).mean(axis=0)))


def data_change(prediction: Prediction) -> FloatArray:
    """Bins and all points of every run less those of the first, shape [n, n_bins + Q].

    A point that a run does not reach adds nothing.
    """
    vectors = np.concatenate([prediction.force_bins, prediction.Z], axis=1)
    return np.nan_to_num(vectors - vectors[0])


def front_modes(change: FloatArray, noise: FloatArray) -> FloatArray:
    """Independent patterns of the data with the mean square of some replicates, shape [n_modes, k].

    Parameters
    ----------
    change
        Data of each replicate less those of the reference, shape [n, k].
    noise
        Standard deviations of the data, shape [k].
    """
    _, size, patterns = np.linalg.svd(change / (noise * np.sqrt(len(change))), full_matrices=False)
    kept = size > SMALLEST_MODE
    return np.asarray(size[kept, None] * patterns[kept] * noise)


def noise_of(observations: Observations) -> FloatArray:
    """Measured standard deviations of bins and all points, shape [n_bins + Q]."""
    return np.concatenate([observations.force_sigma, observations.centre_line.sigma])


def learn_front_noise(stages: StagedRuns, replicates: Replicates | None) -> bool:
    """Give the observations of `stages` the modes of some replicates; False if there are none."""
    if replicates is None or not replicates.lesson.any():
        return False
    change = data_change(replicates.prediction)[replicates.lesson]
    stages.know_front_noise(front_modes(change, noise_of(stages.observations)))
    return True


def weigh_front_noise(
    stages: StagedRuns, coarse: CoarseOptimum, replicates: Replicates | None
) -> CoarseOptimum:
    """The optimum on the surrogate's mesh with weights that know the front face's noise.

    From here on the observations of `stages` hold its modes.

    Parameters
    ----------
    stages, coarse
        The simulations, and the optimum by noise and discrepancy alone.
    replicates
        Runs near that optimum under other motions; None leaves it as it is.
    """
    if not learn_front_noise(stages, replicates):
        return coarse
    objective = replace(coarse.objective, observations=stages.observations)
    model = CorrectedSurrogate(coarse.surrogate).predict
    best = search(coarse.box, objective, model, start=coarse.x)
    return replace(coarse, objective=best.objective, x=best.x)
