"""The front face's path moved to where force and outline put it, as a nuisance of the fit.

The noise of a flyer's record moves the onset of its motion, and a soft specimen rings with it. The patterns
of that noise (`kolsky.inverse.front_noise`) are changes of the data at one point: they ring at that point's
frequency. Where the path is off by much, what they explain is large, and an estimate of Poisson's ratio,
which sets the frequency, would follow the patterns instead of the data. So the model is run under the path
with which they explain the residual, p = p_0 + sum_k c_k (p_k - p_0) over replicates p_k of the fitted path
p_0, and the same change in terms of the patterns, M' a, is taken off its predictions. For a linear response
nothing is different, the prior of the path included; but what rings is the model, at the frequency of its own
parameters, and the patterns have the small rest to explain.
"""

from __future__ import annotations

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.inverse.objective import Objective
from kolsky.inverse.path_modes import size

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

    Parameters
    ----------
    objective
        With the patterns, and the discrepancies of the residual.
    residual
        Shape [k].
    """
    return np.asarray(objective.front_noise @ objective.whitening().precision(residual))


def credible(amplitudes: FloatArray) -> bool:
    """True if there are amplitudes, and noise of the record may have brought them."""
    return 0.0 < size(amplitudes) <= CREDIBLE
