"""Propagation of distributions by Monte Carlo (JCGM 101:2008), to check or replace an error budget."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from kolsky.bars.budget import Budget, correlation_matrix
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


DISTRIBUTIONS: Mapping[str, Callable[[np.random.Generator, int], FloatArray]] = {
    "normal": lambda rng, n: rng.standard_normal(n),
    "rectangular": lambda rng, n: rng.uniform(-np.sqrt(3.0), np.sqrt(3.0), n),
    "triangular": lambda rng, n: rng.triangular(-np.sqrt(6.0), 0.0, np.sqrt(6.0), n),
    "arcsine": lambda rng, n: np.sqrt(2.0) * np.sin(rng.uniform(-np.pi, np.pi, n)),
}
"""Draws with mean 0 and standard deviation 1 (JCGM 101, table 1)."""


@dataclass(frozen=True)
class Spread:
    """Mean, spread and coverage interval of one output's draws, sample by sample."""

    mean: FloatArray  # Mean, shape [...]
    sigma: FloatArray  # standard deviation, shape [...]
    low: FloatArray  # lower end of the coverage interval, shape [...]
    high: FloatArray  # its upper end, shape [...]
    trials: int  # Draws
    probability: float  # coverage probability of the interval [-]. Both tails have the same probability.


def monte_carlo(
    model: NoisyModel,
    quantities: Sequence[Quantity],
    *,
    trials: int,
    rng: np.random.Generator,
    distributions: Mapping[str, str] | None = None,
    correlations: Mapping[tuple[str, str], float] | None = None,
    probability: float = 0.95,
) -> dict[str, Spread]:
    """Draw the quantities, run the model, and describe the outputs.

    ``model``: from values by name, and the generator for its noise, to outputs of fixed shapes. ``trials``:
    number of draws, at least 100. The relative uncertainty of a standard deviation is then 1 / sqrt(2
    trials). ``distributions``: by name of the quantity, a key of `DISTRIBUTIONS` or "t". Without an entry
    "normal", or with finite degrees of freedom "t", scaled by sigma (JCGM 101, 6.4.9). ``correlations``:
    coefficients of pairs of quantities, which must be normal then. ``probability``: of the coverage intervals
    [-]. Raises ValueError if an option or quantity is impossible, or an output is not finite or changes its
    shape. Also if a t distribution has fewer than 3 degrees of freedom: it has no standard deviation then.
    """
    if trials < 100:
        raise ValueError(f"a Monte Carlo run needs at least 100 trials, got {trials}")
    if not 0.0 < probability < 1.0:
        raise ValueError(f"a coverage probability must be inside (0, 1), got {probability}")
    drawn = _draws(quantities, trials, rng, distributions or {}, correlations or {})
    gathered: dict[str, list[FloatArray]] = {}
    for k in range(trials):
        outputs = model({name: float(values[k]) for name, values in drawn.items()}, rng)
        for name, value in outputs.items():
            gathered.setdefault(name, []).append(np.asarray(value, dtype=float))
    tail = 0.5 * (1.0 - probability)
    found = {}
    for name, rows in gathered.items():
        if len(rows) != trials or any(row.shape != rows[0].shape for row in rows):
            raise ValueError(
                f"output {name} is missing or changes its shape in some trials; fix grid and windows"
            )
        table = np.stack(rows)
        if not np.isfinite(table).all():
            raise ValueError(f"output {name} is not finite in some trials; leave such samples out")
        low, high = np.quantile(table, [tail, 1.0 - tail], axis=0)
        found[name] = Spread(table.mean(axis=0), table.std(axis=0, ddof=1), low, high, trials, probability)
    return found


def difference(budget: Budget, output: str, spread: Spread) -> float:
    """Distance between the intervals of a budget and of a Monte Carlo run (JCGM 101, 8.1).

    Returns: largest distance of corresponding ends over the combined standard uncertainty at the same sample
    [-]. By JCGM 101 the budget is validated if it is below half a unit of the last reported digit: 0.05 with
    one digit before and one after the point, as u = 1.0.
    """
    u = budget.sigma(output)
    U = budget.coverage_factor(output, spread.probability) * u
    off = np.maximum(
        np.abs(budget.value[output] - U - spread.low), np.abs(budget.value[output] + U - spread.high)
    )
    return float(np.max(off / u))


def _draws(
    quantities: Sequence[Quantity],
    trials: int,
    rng: np.random.Generator,
    distributions: Mapping[str, str],
    correlations: Mapping[tuple[str, str], float],
) -> dict[str, FloatArray]:
    """Values of every quantity, shape [trials] each."""
    names = [q.name for q in quantities]
    for name, kind in distributions.items():
        if name not in names:
            raise ValueError(f"distribution of {name!r}: no quantity has this name")
        if kind != "t" and kind not in DISTRIBUTIONS:
            raise ValueError(
                f"{name}: distribution must be 't' or one of {', '.join(DISTRIBUTIONS)}, got {kind!r}"
            )
    R = correlation_matrix(quantities, correlations)
    # A square root by eigenvectors, because correlations of 1 make the matrix singular.
    eigenvalue, vector = np.linalg.eigh(R)
    together = rng.standard_normal((trials, len(names))) @ (vector * np.sqrt(np.maximum(eigenvalue, 0.0))).T
    found = {}
    for i, q in enumerate(quantities):
        kind = distributions.get(q.name, "normal" if np.isinf(q.freedom) else "t")
        if (R[i] != 0.0).sum() > 1:
            if q.name in distributions and kind != "normal":
                raise ValueError(f"{q.name} is correlated and must be normal, got {kind!r}")
            unit = together[:, i]
        elif kind == "t":
            if not q.freedom >= 3.0:
                raise ValueError(
                    f"{q.name}: a t distribution with {q.freedom:g} degrees of freedom has no standard"
                    " deviation, at least 3 are needed; state its distribution"
                )
            unit = (
                rng.standard_t(q.freedom, trials) if np.isfinite(q.freedom) else rng.standard_normal(trials)
            )
        else:
            unit = DISTRIBUTIONS[kind](rng, trials)
        found[q.name] = q.value + q.sigma * unit
    return found
