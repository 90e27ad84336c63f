"""Interval of the paper's method: where the cost is not told from its minimum, Eqs. (M.6)-(M.8)."""

from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray


@dataclass(frozen=True)
class CostInterval:
    """Range of a parameter whose cost lies within delta Phi of the least."""

    low: float
    """Lower end, in the parameter's unit."""
    high: float
    """Upper end."""
    open_low: bool
    """True if the cost is still within delta Phi at the lower bound of the design."""
    open_high: bool
    """True if it is at the upper bound."""

    def moved(self, distance: float) -> "CostInterval":
        """The same interval about an optimum that lies elsewhere, on another mesh for one."""
        return CostInterval(self.low + distance, self.high + distance, self.open_low, self.open_high)


def cost_interval(x: FloatArray, cost: FloatArray, delta: float) -> CostInterval:
    """The outermost values of a parameter with Phi <= min Phi + delta Phi.

    A cost with several valleys has one interval over all of them that are as deep: none is told from the
    deepest.

    Parameters
    ----------
    x
        Values of the parameter, ascending, shape [n].
    cost
        Phi, Eq. (M.5), least over all other parameters, shape [n]; linear between the values.
    delta
        Uncertainty of Phi, Eq. (M.8), >= 0.

    Raises
    ------
    ValueError
        If a value is not finite, or `delta` is negative or not known.
    """
    if not (np.isfinite(cost).all() and np.isfinite(delta) and delta >= 0.0):
        raise ValueError(f"the interval needs finite costs and an uncertainty >= 0, got {delta}")
    limit = float(cost.min()) + delta
    inside = np.flatnonzero(cost <= limit)
    first, last = int(inside[0]), int(inside[-1])
    low, high = float(x[first]), float(x[last])
    if first > 0:
        low = _crossing(x[first - 1 : first + 1], cost[first - 1 : first + 1], limit)
    if last < len(x) - 1:
        high = _crossing(x[last : last + 2], cost[last : last + 2], limit)
    return CostInterval(low, high, first == 0, last == len(x) - 1)


def _crossing(x: FloatArray, cost: FloatArray, limit: float) -> float:
    """Where the line between two points has the limit."""
    share = (limit - cost[0]) / (cost[1] - cost[0])
    return float(x[0] + share * (x[1] - x[0]))
