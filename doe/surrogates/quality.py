"""Errors of a surrogate, compared with the allowed error, and the number of runs needed to reach it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import ceil, isfinite

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.distance import cdist

from doe.arrays import FloatArray
from doe.box import Box
from doe.surrogates.protocol import Surrogate, SurrogateError, checked_runs

Fit = Callable[[FloatArray, FloatArray], Surrogate]
"""A surrogate of runs [n, d] and their responses [n, k]."""

SHARES = (0.35, 0.6, 1.0)
"""Sizes of the nested designs over the size of the whole design."""
LEAST_ORDER = 0.2
"""Smallest exponent p of error ~ n^-p that counts as convergence."""
MOST_RUNS = 100.0
"""Largest ratio of needed over existing runs that is reported."""


@dataclass(frozen=True)
class Fitness:
    """A surrogate's error compared with the allowed one, and the number of runs needed to reach it."""

    error: float
    """The compared error, e.g. that of the optimum over its half width [-]."""
    allowed: float
    runs: tuple[int, ...]
    """Sizes of the nested designs, ascending; the last is the whole."""
    errors: tuple[float, ...]
    order: float
    """Fitted exponent p of error ~ n^-p [-]; NaN if there were no nested designs to fit."""

    @property
    def good(self) -> bool:
        """True if the error is allowed."""
        return self.error <= self.allowed

    @property
    def runs_needed(self) -> int | None:
        """Number of runs at which the observed convergence reaches the allowed error. None without
        convergence.
        """
        if self.good:
            return self.runs[-1]
        if not (isfinite(self.order) and self.order >= LEAST_ORDER):
            return None
        ratio = float((self.error / self.allowed) ** (1.0 / self.order))
        return ceil(self.runs[-1] * ratio) if ratio <= MOST_RUNS else None

    def __str__(self) -> str:
        sentence = f"the error with {self.runs[-1]} runs is {self.error:.2g}, {self.allowed:.2g} is allowed"
        if self.good:
            return sentence
        steps = ", ".join(f"{e:.2g} with {n}" for n, e in zip(self.runs, self.errors, strict=True))
        if self.runs_needed is not None:
            return (
                f"{sentence}; at the observed convergence ({steps}) about {self.runs_needed} runs would "
                "be enough"
            )
        return (
            f"{sentence}; it hardly falls with the number of runs ({steps}): the response is rough, or "
            "varies over less than the runs are apart; shrink the box"
        )

    def require(self) -> None:
        """Raise an error if the surrogate is not good enough.

        Raises SurrogateError; the message gives the number of needed runs.
        """
        if not self.good:
            raise SurrogateError(f"the surrogate is not good enough: {self}")


def fitness(
    fit: Fit,
    box: Box,
    points: ArrayLike,
    responses: ArrayLike,
    *,
    sigma: ArrayLike,
    allowed: float,
    gain: ArrayLike | None = None,
) -> Fitness:
    """Evaluate a surrogate by its leave-one-out error and by the decrease of this error over nested subsets
    of the design.

    ``points``, ``responses``: the runs in the box, shapes [n, d] and [n, k]. ``sigma``: noise of each entry,
    in response units, a number or shape [k]. ``allowed``: largest allowed error, > 0. ``gain``: linear map
    from a change of the response to the quantity of interest, in units of its allowed error, shape [m, k]. An
    example is the optimum's move over its half width. The error is then the root mean square of its largest
    component. Without `gain` it is that of residual / sigma over all entries.
    """
    if not 0.0 < allowed < np.inf:
        raise ValueError(f"allowed must be finite and > 0, got {allowed}")
    x, y = checked_runs(box, points, responses)
    noise = _noise(sigma, y.shape[1])
    order = nested(box.unit(x))
    runs, errors = [], []
    for share in SHARES:
        n = round(share * len(x))
        try:
            surrogate = fit(x[order[:n]], y[order[:n]])
        except SurrogateError:
            if share == 1.0:
                raise
            continue  # too few runs for a surrogate: not a point of the fit
        runs.append(n)
        errors.append(_error(surrogate.loo_residuals, noise, gain))
    exponent = float("nan")
    if len(runs) > 1 and min(errors) > 0.0:
        exponent = -float(np.polyfit(np.log(runs), np.log(errors), 1)[0])
    return Fitness(errors[-1], allowed, tuple(runs), tuple(errors), exponent)


def nested(unit_points: FloatArray) -> NDArray[np.intp]:
    """An order of runs, shape [n]: for every n the first n runs are spread over the box. The first run is the
    one nearest to the middle; each next run is the one farthest from all before."""
    distance = cdist(unit_points, unit_points)
    order = [int(np.argmin(((unit_points - 0.5) ** 2).sum(axis=1)))]
    nearest = distance[order[0]].copy()
    while len(order) < len(unit_points):
        nearest[order] = -1.0
        order.append(int(np.argmax(nearest)))
        nearest = np.minimum(nearest, distance[order[-1]])
    return np.array(order, dtype=np.intp)


def _error(residuals: FloatArray, sigma: FloatArray, gain: ArrayLike | None) -> float:
    if gain is None:
        return float(np.sqrt(np.mean((residuals / sigma) ** 2)))
    moves = residuals @ np.asarray(gain, dtype=np.float64).T
    return float(np.sqrt(np.mean(moves**2, axis=0)).max())


def _noise(sigma: ArrayLike, k: int) -> FloatArray:
    noise = np.array(np.broadcast_to(np.asarray(sigma, dtype=np.float64), (k,)))
    if not np.all(np.isfinite(noise) & (noise > 0.0)):
        j = int(np.argmin(np.isfinite(noise) & (noise > 0.0)))
        raise ValueError(f"sigma must be finite and > 0, got {noise[j]} for entry {j}")
    return noise
