"""Errors that are correlated in time and along a line, as a few patterns of one standard deviation each."""

import numpy as np

from kolsky.base.arrays import FloatArray

KEPT = 0.95
"""Share of the variance that the patterns hold; the rest is given back as independent [-]."""
MOST = 60
"""Patterns at most."""
NODES = 4.0
"""Nodes of the patterns along the line, a length."""


def patterns(
    time: FloatArray, place: FloatArray, *, sigma: float, memory: float, length: float
) -> tuple[FloatArray, float]:
    """Patterns of an error with covariance ``sigma^2 exp(-|dt| / memory) exp(-(dy / length)^2)``.

    Parameters
    ----------
    time, place
        When and where along the line each datum was taken [s], [m], shape [n].
    sigma
        Standard deviation of the error, in the data's unit.
    memory
        Time after which 1/e of it is left [s].
    length
        Distance at which the correlation is 1/e [m].

    Returns
    -------
    NDArray
        Patterns that add up to the covariance, in the data's unit, shape [n_patterns, n].
    float
        Standard deviation of what they leave out, mean over the data.

    Raises
    ------
    ValueError
        If there is no datum, or `memory` or `length` is not positive.
    """
    if not (time.size and memory > 0.0 and length > 0.0):
        raise ValueError(
            f"{time.size} data, memory {memory} s, length {length} m: there must be data, both must be > 0"
        )
    moments, row = np.unique(time, return_inverse=True)
    in_time, by_time = np.linalg.eigh(np.exp(-np.abs(moments[:, None] - moments) / memory))
    n_nodes = int(np.ceil(NODES * np.ptp(place) / length)) + 1
    nodes = np.linspace(place.min(), place.max(), n_nodes)
    along, by_place = np.linalg.eigh(np.exp(-(((nodes[:, None] - nodes) / length) ** 2)))
    size = np.maximum(np.outer(in_time, along), 0.0)
    order = np.argsort(-size, axis=None)
    share = np.cumsum(size.ravel()[order]) / size.sum()
    order = order[: min(int(np.searchsorted(share, KEPT)) + 1, MOST)]
    i, j = np.unravel_index(order, size.shape)
    lines = np.array([np.interp(place, nodes, column) for column in by_place.T[np.unique(j)]])
    lines = lines[np.searchsorted(np.unique(j), j)]
    found = sigma * np.sqrt(size[i, j])[:, None] * by_time.T[i][:, row] * lines
    left = sigma**2 - float((found**2).sum(axis=0).mean())
    return found, float(np.sqrt(max(left, 0.0)))
