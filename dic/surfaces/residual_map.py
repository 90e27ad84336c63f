"""Residual map: patches of a surface that do not look like what was followed.

A match whose only error is noise leaves a residual as large as the noise says. A highlight, lost paint or a
shadow leaves one many times as large, over all subsets that it touches; and a reference that is taken there
hands its error on when the residual is small again. The largest residual along a point's references
(`dic.tracking.Track.excess`) is therefore compared with that of the same frame's better points, whose
residual holds what all have in common: coarse sampling, haze, blur.
"""

import numpy as np
from scipy import ndimage

from dic.arrays import BoolArray, FloatArray, IntArray

SEED = 10.0
"""Residual, in those of the frame's better points, that no right match leaves [-]."""
TOUCHED = 1.5
"""And that of points which belong to the same patch as such a one [-]."""
BETTER = 25.0
"""Percentile of the frame's residuals that stands for them [%]."""
REACH = 2
"""Points of a patch lie within so many cells of each other."""


def unlike_points(excess: FloatArray, valid: BoolArray, cell: IntArray) -> BoolArray:
    """Valid points of patches whose residual noise does not explain.

    A patch holds a point with `SEED` times the residual of the frame's better points, and all around it with
    `TOUCHED` times that. Seeds and limits were chosen on one drawn population and judged on another
    (verification page of the tracking).

    Parameters
    ----------
    excess
        Variance of the residuals beyond that of the noise, over the latter [-], shape [n_frames, n_points];
        NaN where not known: such a point is judged by nothing.
    valid
        Which are to be judged, shape [n_frames, n_points].
    cell
        Column and row of each point in the grid, shape [n_points, 2].

    Returns
    -------
    array of bool
        Shape [n_frames, n_points].
    """
    low = cell.min(axis=0)
    shape = tuple((cell.max(axis=0) - low + 1).tolist())
    at = tuple((cell - low).T)
    around = np.ones((2 * REACH + 1, 2 * REACH + 1), dtype=bool)
    found = np.zeros(valid.shape, dtype=bool)
    for frame in range(len(valid)):
        judged = valid[frame] & np.isfinite(excess[frame])
        if not judged.any():
            continue
        residual = np.where(judged, 1.0 + excess[frame], 0.0)
        level = residual / np.percentile(residual[judged], BETTER)
        if not (level > SEED).any():
            continue
        seeds, touched = np.zeros((2, *shape), dtype=bool)
        seeds[at], touched[at] = level > SEED, level > TOUCHED
        patch = ndimage.binary_propagation(seeds, structure=around, mask=touched)
        found[frame] = patch[at] & judged
    return found
