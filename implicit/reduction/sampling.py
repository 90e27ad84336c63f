r"""Few weighted elements that do the work of all (energy-conserving sampling and weighting).

With the elements' shares g_e = V_e^T f_e in the reduced forces of training states, stacked as columns of G,
and their sum b = G 1, weights w >= 0 are sought of which few are not zero and

    |G w - b| <= tau |b|                                                                       (R.2)

(Farhat, Avery, Chapman and Cortial 2014), by Lawson and Hanson's active set, stopped as soon as (R.2) holds.
Positive weights keep the reduced stiffness of a stable body definite.
"""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Sample:
    """Chosen elements."""

    cells: IntArray
    """Their numbers, rising, shape [s]."""
    weights: FloatArray
    """Weight of each [-], > 0, shape [s]."""
    residual: float
    """|G w - b| / |b| [-]."""
    reached: bool
    """Whether the tolerance was reached."""


def choose(G: FloatArray, *, tolerance: float, most: int | None = None) -> Sample:
    """Choose elements and weights, Eq. (R.2).

    Parameters
    ----------
    G : array, shape [n, m]
        Shares of the m elements.
    tolerance : float
        tau, in (0, 1).
    most : int, optional
        Most elements.
    """
    if not 0.0 < tolerance < 1.0:
        raise ValueError(f"tolerance must be in (0, 1), got {tolerance}")
    b = G.sum(axis=1)
    size = float(np.linalg.norm(b))
    limit = min(G.shape) if most is None else min(most, *G.shape)
    sizes = np.linalg.norm(G, axis=0)
    w = np.zeros(G.shape[1])
    active: list[int] = []
    residual = b.copy()
    barred = sizes == 0.0
    while np.linalg.norm(residual) > tolerance * size and len(active) < limit:
        gain = (residual @ G) / np.where(barred, np.inf, sizes)
        gain[active] = -np.inf
        best = int(np.argmax(gain))
        if not gain[best] > 0.0:
            break
        active.append(best)
        while True:
            found = np.linalg.lstsq(G[:, active], b, rcond=None)[0]
            if (found > 0.0).all():
                w[:] = 0.0
                w[active] = found
                break
            # the way to the unconstrained optimum is left where the first weight becomes zero
            old = w[active]
            falling = found <= 0.0
            share = float((old[falling] / (old[falling] - found[falling])).min())
            w[active] = old + share * (found - old)
            active = [e for e in active if w[e] > 1e-14 * w.max()]
            w[[e for e in range(len(w)) if e not in active]] = 0.0
            if not active:
                break
        before = residual
        residual = b - G @ w
        if np.linalg.norm(residual) >= (1.0 - 1e-12) * np.linalg.norm(before):
            barred[best] = True  # it does not help: not again
    cells = np.flatnonzero(w > 0.0)
    left = float(np.linalg.norm(residual)) / size
    return Sample(cells, w[cells], left, left <= tolerance)
