"""Propagation of distributions by Monte Carlo (JCGM 101:2008), to check an error budget."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kolsky.bars.budget import Budget
from kolsky.bars.records import Quantity
from kolsky.base.arrays import FloatArray

NoisyModel = Callable[[Mapping[str, float], np.random.Generator], Mapping[str, ArrayLike]]
"""A model as `kolsky.bars.budget.Model`. It may draw the noise of its signals (`red_noise`)."""


def red_noise(sigma: float, rho: FloatArray, n: int, rng: np.random.Generator) -> FloatArray:
    """One realisation of Gaussian noise with the autocorrelation rho at lags 0, 1, ..., shape [n].

    White noise is multiplied by the spectrum of the circularly embedded correlation, longer than n and rho.
    """
    size = max(n, rho.size) + rho.size
    circle = np.zeros(size)
    circle[: rho.size], circle[size - rho.size + 1 :] = rho, rho[:0:-1]
    colour = np.sqrt(np.maximum(np.fft.rfft(circle).real, 0.0))
    return sigma * np.fft.irfft(colour * np.fft.rfft(rng.standard_normal(size)), size)[:n]


@dataclass(frozen=True)
class Spread:
    """Mean, standard deviation and 95 % coverage interval of one output's draws, each of shape [...]."""

    mean: FloatArray
    sigma: FloatArray
    low: FloatArray
    high: FloatArray


def monte_carlo(
    model: NoisyModel,
    quantities: Sequence[Quantity],
    *,
    trials: int,
    rng: np.random.Generator,
    rectangular: Collection[str] = (),
) -> dict[str, Spread]:
    """Draw the quantities, run the model, and describe the outputs, which have fixed shapes.

    ``rectangular``: names of the quantities with a rectangular distribution; the others are normal.
    """
    drawn = {}
    for q in quantities:
        flat = q.name in rectangular
        unit = rng.uniform(-np.sqrt(3.0), np.sqrt(3.0), trials) if flat else rng.standard_normal(trials)
        drawn[q.name] = q.value + q.sigma * unit
    rows = [model({name: float(values[k]) for name, values in drawn.items()}, rng) for k in range(trials)]
    found = {}
    for name in rows[0]:
        table = np.stack([np.asarray(row[name], dtype=float) for row in rows])
        low, high = np.quantile(table, [0.025, 0.975], axis=0)
        found[name] = Spread(table.mean(axis=0), table.std(axis=0, ddof=1), low, high)
    return found


def difference(budget: Budget, output: str, spread: Spread) -> float:
    """Distance between the intervals of a budget and of a Monte Carlo run (JCGM 101, 8.1).

    It is the largest one of corresponding ends over the combined standard uncertainty at the same sample [-].
    """
    u = budget.sigma(output)
    U = budget.coverage_factor(output, 0.95) * u
    off = np.maximum(
        np.abs(budget.value[output] - U - spread.low), np.abs(budget.value[output] + U - spread.high)
    )
    return float(np.max(off / u))
