"""The inputs' part of an interval: noise of flyer motion and material curve, scales of force and motion.

Each source is a change of the data vector. Any linear map carries it to the parameters: that of the joint
answer, of the force or the outline alone, or of the difference of those two.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.inverse.front_noise import replicate_uncertainty
from kolsky.inverse.objective import Objective
from kolsky.inverse.staged_runs import Replicates

OUTLINE = "common errors of the outline"
"""Name of the part by errors that outline points have in common."""


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


@dataclass(frozen=True)
class InputChanges:
    """Changes of the data vector by the noise of the inputs."""

    replicates: Mapping[str, FloatArray]
    """Source -> data of each replicate minus the reference's, shape [n, k]: "flyer motion", "material
    curve"; of what is known as patterns of one standard deviation each, these times root n (`as_drawn`):
    `OUTLINE`, and "flyer motion" where the path is a nuisance of the fit."""
    scales: Mapping[str, FloatArray]
    """Source -> change by one standard uncertainty of a common scale, shape [k]: "force scale", "motion
    scale"."""

    def parts(self, gain: FloatArray, gains: Sequence[FloatArray] | None = None) -> dict[str, FloatArray]:
        """Standard uncertainties by source, shape [d] each.

        Parameters
        ----------
        gain
            Linear map from a change of the data vector to the move of the optimum, shape [d, k].
        gains
            As of `scale_uncertainty`; `gain` alone if left out.
        """
        found = {key: scale_uncertainty(change, gains or [gain]) for key, change in self.scales.items()}
        for key, changes in self.replicates.items():
            found[key] = replicate_uncertainty(changes @ gain.T)
        return found


def as_drawn(patterns: FloatArray) -> FloatArray:
    """Patterns of one standard deviation each as replicates with the same mean square, shape [n, k]."""
    return np.asarray(np.sqrt(len(patterns)) * patterns)


def input_changes(objective: Objective, replicates: Replicates | None) -> InputChanges:
    """Changes of the data vector by every source that is known.

    Parameters
    ----------
    objective
        Whose data vector, and the force's scale.
    replicates
        Runs under other motions and curves, the reference first; None leaves their noise out. A point that a
        replicate leaves adds nothing. Where the front face's path is moved, the patterns of its noise in the
        weights stand for the other motions: the replicates' ring out of step with the answer, on a mesh that
        rings otherwise, and the weights would take nothing of that away.
    """
    scales = {}
    if objective.observations.force_sigma_gain > 0.0:
        scales["force scale"] = objective.scale_error
    outline = objective.outline_errors
    known = {OUTLINE: as_drawn(outline)} if len(outline) else {}
    if replicates is None:
        return InputChanges(known, scales)
    vectors = objective.vectors(replicates.prediction)
    change = np.nan_to_num(vectors - vectors[0])
    if replicates.scale.any():
        scales["motion scale"] = change[replicates.scale][0]
    moved = objective.observations.front_offset is not None
    motions = as_drawn(objective.front_noise) if moved else change[replicates.flyer]
    drawn = {"flyer motion": motions, "material curve": change[replicates.curve]}
    return InputChanges({**drawn, **known}, scales)
