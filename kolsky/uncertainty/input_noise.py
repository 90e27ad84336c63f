"""The inputs' part of an interval: noise of flyer motion and material curve, scales of force and motion."""

from collections.abc import Sequence

import numpy as np

from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.inverse.refined_search import RefinedOptimum
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


def scale_uncertainty(change: FloatArray, gains: Sequence[FloatArray]) -> FloatArray:
    """Standard uncertainty from a common scale: the largest move that any of the slopes gives.

    A scale is one number, which nothing averages; of several slopes that may be right the one with the
    largest move counts.

    Parameters
    ----------
    change
        Change of the data vector by one standard uncertainty of the scale, shape [k].
    gains
        Linear maps from a change of the data vector to the move of the optimum, shape [d, k] each.

    Returns
    -------
    ndarray
        In the parameters' units, shape [d].
    """
    return np.asarray(np.max([np.abs(gain @ change) for gain in gains], axis=0))


def replicate_parts(
    vectors: FloatArray,
    *,
    flyer: BoolArray,
    curve: BoolArray,
    scale: BoolArray,
    gain: FloatArray,
    gains: Sequence[FloatArray],
) -> dict[str, FloatArray]:
    """Standard uncertainties from replicates by source, shape [d] each.

    Parameters
    ----------
    vectors
        Data vectors, the reference's in row 0, shape [n, k]; NaN at a point that a replicate leaves, which
        then adds nothing.
    flyer, curve, scale
        Rows with another motion of the flyer, another curve, a motion larger by one standard uncertainty of
        its scale (one at most), shape [n].
    gain
        Linear map from a change of the data vector to the move of the optimum, shape [d, k].
    gains
        As of `scale_uncertainty`.
    """
    change = np.nan_to_num(vectors - vectors[0])
    moves = change @ gain.T
    found = {"motion scale": scale_uncertainty(change[scale][0], gains)} if scale.any() else {}
    return {
        **found,
        "flyer motion": replicate_uncertainty(moves[flyer]),
        "material curve": replicate_uncertainty(moves[curve]),
    }


def input_noise(stages: StagedRuns, fine: RefinedOptimum) -> tuple[dict[str, FloatArray], int]:
    """Standard uncertainties from the inputs' noise by source, and how many replicates were lost.

    Parameters
    ----------
    stages
        The identification's simulations; runs `Settings.replicates` of each kind.
    fine
        The optimum on the refined mesh.

    Raises
    ------
    ValueError
        If the reference among the replicates does not complete.
    """
    parts: dict[str, FloatArray] = {}
    gains = [fine.objective.gain(slope) for slope in fine.slopes]
    if stages.observations.force_sigma_gain > 0.0:
        parts["force scale"] = scale_uncertainty(fine.objective.scale_error, gains)
    if stages.settings.replicates == 0:
        return parts, 0
    replicates = stages.replicate(fine.x)
    parts |= replicate_parts(
        fine.objective.vectors(replicates.prediction),
        flyer=replicates.flyer,
        curve=replicates.curve,
        scale=replicates.scale,
        gain=fine.objective.gain(fine.jacobian),
        gains=gains,
    )
    return parts, replicates.lost
