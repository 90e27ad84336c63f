"""Information of planned data: Fisher's information of a linear model, and the placement of measurements.

Data R with standard deviations s respond with J = dR/dp. Their information is H = J^T diag(s^-2) J, and the
change of the estimate by a change of the data is

    dp = G dR,      G = H^-1 J^T diag(s^-2),

so that Cov p = G diag(s^2) G^T = H^-1. A datum's share of the variance of p is G_pi^2 s_i^2 / (H^-1)_pp. This
is also its share in the information about p, because the part of the other parameters is removed.

The information of independent data adds up. D-optimal data have the largest det H and thus the smallest
volume of the joint interval (Pukelsheim, *Optimal Design of Experiments*, 1993).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import comb
from operator import index

import numpy as np
from numpy.typing import NDArray

from doe.arrays import FloatArray

SMALLEST_SHARE = 1e-12
"""Limit of the smallest over the largest eigenvalue of the information in unit-box parameters. If the
derivatives have an error of 1e-8, a smaller ratio cannot be distinguished from zero."""


class SingularInformationError(ValueError):
    """The data do not depend on a direction of the parameters, so there is no covariance."""


def inverse_information(jacobian: FloatArray) -> FloatArray:
    """(J^T J)^-1 of a whitened Jacobian, shape [k, d] -> [d, d].

    Raises SingularInformationError if the data do not depend on a direction of the parameters; the message
    names it.
    """
    _, singular, right = np.linalg.svd(jacobian, full_matrices=False)
    values = singular**2
    if values[-1] <= SMALLEST_SHARE * values[0]:
        raise SingularInformationError(
            f"the data do not move along {np.round(right[-1], 3).tolist()} (unit-box coordinates): hold one "
            "of these parameters, or read the profile likelihood, which needs no inverse"
        )
    return np.asarray((right.T / values) @ right)


@dataclass(frozen=True)
class LinearData:
    """Data with their derivatives with respect to some parameters."""

    names: tuple[str, ...]
    jacobian: FloatArray
    """Derivatives of the data by the parameters, in their units, shape [k, d]."""
    sigma: FloatArray
    """Standard deviations of the data, in their units, shape [k]."""
    scale: FloatArray
    """Reference change of each parameter, in its unit, shape [d]. It gives eigenvectors and sums of variances
    a common unit."""

    def __post_init__(self) -> None:
        k, d = len(self.sigma), len(self.names)
        if self.jacobian.shape != (k, d) or self.sigma.shape != (k,) or self.scale.shape != (d,):
            raise ValueError(
                f"shapes [k, d], [k] and [d] = [{d}] are needed, got {self.jacobian.shape}, "
                f"{self.sigma.shape} and {self.scale.shape}"
            )
        if not np.isfinite(self.jacobian).all():
            i, j = np.argwhere(~np.isfinite(self.jacobian))[0]
            raise ValueError(f"the derivative of datum {i} by {self.names[j]} is {self.jacobian[i, j]}")
        for name, values in (("sigma", self.sigma), ("scale", self.scale)):
            bad = np.flatnonzero(~(np.isfinite(values) & (values > 0.0)))
            if len(bad):
                raise ValueError(f"{name} must be finite and > 0, got {values[bad[0]]} at {bad[0]}")

    @property
    def rows(self) -> FloatArray:
        """Derivatives over sigma by parameters in units of their scale [-], shape [k, d]."""
        return self.jacobian / self.sigma[:, None] * self.scale

    @property
    def information(self) -> FloatArray:
        """H in parameters over their scale [-], shape [d, d]."""
        return self.rows.T @ self.rows

    @property
    def covariance(self) -> FloatArray:
        """H^-1, in parameter units, shape [d, d].

        Raises SingularInformationError if the data do not depend on a direction of the parameters.
        """
        return inverse_information(self.rows) * np.outer(self.scale, self.scale)

    @property
    def deviations(self) -> FloatArray:
        """Standard deviations of the parameters estimated together, in their units, shape [d]."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def conditional_deviations(self) -> FloatArray:
        """Standard deviation of each parameter for known other parameters, shape [d]. Infinite if the data do
        not depend on it.
        """
        size = np.sqrt(np.diag(self.information))
        return np.divide(self.scale, size, out=np.full_like(size, np.inf), where=size > 0.0)

    @property
    def correlation(self) -> FloatArray:
        """Correlation of the estimates [-], shape [d, d]."""
        s = self.deviations
        return np.asarray(self.covariance / np.outer(s, s))

    @property
    def gain(self) -> FloatArray:
        """G, change of the estimates by a change of each datum, shape [d, k]."""
        unscaled = inverse_information(self.rows) @ self.rows.T
        return np.asarray(self.scale[:, None] * unscaled / self.sigma)

    @property
    def shares(self) -> FloatArray:
        """Share of each datum in the information about a parameter, all parameters estimated together [-],
        shape [k, d]. Columns add up to one."""
        moves = self.gain * self.sigma
        return (moves**2 / (moves**2).sum(axis=1, keepdims=True)).T

    @property
    def conditional_shares(self) -> FloatArray:
        """The same share for known other parameters, shape [k, d]. 0 for a parameter on which no datum
        depends.
        """
        squares = self.rows**2
        total = squares.sum(axis=0)
        return np.divide(squares, total, out=np.zeros_like(squares), where=total > 0.0)

    def select(self, rows: NDArray[np.bool_]) -> LinearData:
        """A subset of the data, by the mask `rows` of shape [k]."""
        return LinearData(self.names, self.jacobian[rows], self.sigma[rows], self.scale)


ALL = 20_000
"""Up to this number of subsets, all are compared. Above it, points are exchanged until no exchange improves
the result."""


class UndecidedError(ValueError):
    """No choice of this number of groups determines all parameters."""


@dataclass(frozen=True)
class Placement:
    """The chosen groups, their cost and their information."""

    chosen: tuple[int, ...]
    """Indices of the groups, ascending."""
    cost: float
    """-ln det H, including the base."""
    information: FloatArray
    """H of base and chosen groups together [-], shape [d, d]."""


def costs(information: FloatArray) -> FloatArray:
    """-ln det H of information matrices, shape [..., d, d] -> [...]; infinite where H is singular."""
    values = np.linalg.eigvalsh(information)
    regular = values[..., 0] > 1e-12 * np.maximum(values[..., -1], np.finfo(float).tiny)
    cost = -np.log(np.where(regular[..., None], values, 1.0)).sum(axis=-1)
    return np.asarray(np.where(regular, cost, np.inf))


def best_groups(groups: FloatArray, count: int, *, base: FloatArray | None = None) -> Placement:
    """The `count` groups of data that, together with the base, are D-optimal.

    ``groups``: information of each group, e.g. of all data measured at one height [-], shape [n, d, d].
    ``count``: how many to choose, 1 to n. ``base``: information that is available in any case [-], shape [d,
    d]; none if left out.
    """
    n, d, _ = groups.shape
    count = index(count)
    if not 1 <= count <= n:
        raise ValueError(f"count must be in [1, {n}], got {count}")
    start = np.zeros((d, d)) if base is None else base
    if comb(n, count) <= ALL:
        subsets = np.array(list(combinations(range(n), count)))
        cost = costs(start + groups[subsets].sum(axis=1))
        chosen = [int(i) for i in subsets[int(np.argmin(cost))]]
    else:
        chosen = _exchanged(groups, count, start)
    return _placed(groups, chosen, start)


def best_window(groups: FloatArray, length: int, *, base: FloatArray | None = None) -> Placement:
    """The `length` neighbouring groups, e.g. frames, that together with the base are D-optimal.
    Parameters and errors as in `best_groups`."""
    n, d, _ = groups.shape
    length = index(length)
    if not 1 <= length <= n:
        raise ValueError(f"length must be in [1, {n}], got {length}")
    start = np.zeros((d, d)) if base is None else base
    total = np.concatenate([np.zeros((1, d, d)), np.cumsum(groups, axis=0)])
    cost = costs(start + total[length:] - total[:-length])
    first = int(np.argmin(cost))
    return _placed(groups, list(range(first, first + length)), start)


def _exchanged(groups: FloatArray, count: int, start: FloatArray) -> list[int]:
    # A few groups give a singular matrix. A small multiple of the total makes the first choices comparable.
    ridge = 1e-6 * np.trace(groups.sum(axis=0)) / len(start) * np.eye(len(start))
    chosen: list[int] = []
    information = start + ridge
    for _ in range(count):
        cost = costs(information + groups)
        cost[chosen] = np.inf
        chosen.append(int(np.argmin(cost)))
        information = information + groups[chosen[-1]]
    best = float(costs(start + groups[chosen].sum(axis=0)))
    gained = True
    while gained:
        gained = False
        for place in range(count):
            chosen_rows = [g for k, g in enumerate(chosen) if k != place]
            cost = costs(start + groups[chosen_rows].sum(axis=0) + groups)
            cost[chosen_rows] = np.inf
            candidate = int(np.argmin(cost))
            if cost[candidate] < best - 1e-12 * abs(best):
                chosen[place], best, gained = candidate, float(cost[candidate]), True
    return chosen


def _placed(groups: FloatArray, chosen: list[int], start: FloatArray) -> Placement:
    information = start + groups[chosen].sum(axis=0)
    cost = float(costs(information))
    if not np.isfinite(cost):
        raise UndecidedError("no choice determines all parameters: choose more groups, or hold a parameter")
    return Placement(tuple(sorted(chosen)), cost, information)
