"""Several shots to one stiffness: random-effects mean, scatter between shots, leave-one-out."""

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from kolsky.base.arrays import FloatArray
from kolsky.studies.rates.mixed import METHODS, MixedFit, mixed_fit

FEWEST = 2


@dataclass(frozen=True)
class Pooled:
    """The mean of some shots."""

    fit: MixedFit
    """The fit with Paule and Mandel's scatter."""
    scatter: float
    """Experimental standard deviation s of the shots, n - 1."""
    others: dict[str, tuple[float, float]]
    """By method: the mean and tau that each estimator of the scatter gives."""
    leave_one_out: tuple[MixedFit | None, ...]
    """The fit without each shot in turn; None where fewer than two would be left."""

    @property
    def mean(self) -> float:
        """The random-effects mean."""
        return float(self.fit.coefficients[0])

    @property
    def sigma(self) -> float:
        """Its standard uncertainty, what the shots share included."""
        return self.fit.sigma(0)

    @property
    def sigma_common(self) -> float:
        """The part that the shots share: more shots do not lessen it."""
        return float(np.sqrt(self.fit.common[0, 0]))

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the mean, Eq. (S.6)."""
        return self.fit.interval(0)

    @property
    def probability(self) -> float:
        """Probability that shots which differ by nothing but their own uncertainties have this Q or more."""
        return float(chi2.sf(self.fit.q, self.fit.freedom))

    @property
    def prediction(self) -> tuple[float, float]:
        """The 95 % prediction interval of one more shot, Eq. (S.7): wider than that of the mean."""
        half = float(student.ppf(0.975, self.fit.freedom)) * float(np.hypot(self.fit.between, self.sigma))
        return self.mean - half, self.mean + half


def pool(values: FloatArray, sigma: FloatArray, *, common: FloatArray | None = None) -> Pooled:
    """Mean of shots with their scatter.

    Parameters
    ----------
    values
        Estimates, shape [n], n >= 2.
    sigma
        Their independent standard uncertainties, shape [n].
    common
        What they share, see `kolsky.studies.rates.mixed.mixed_fit`, shape [n_shared, n].

    Raises
    ------
    ValueError
        If there are fewer than two, or a number cannot be used.
    """
    y, s = np.asarray(values, dtype=float), np.asarray(sigma, dtype=float)
    if y.size < FEWEST:
        raise ValueError(f"a scatter between shots needs at least {FEWEST} of them, got {y.size}")
    shared = np.zeros((0, y.size)) if common is None else np.asarray(common, dtype=float)
    ones = np.ones((y.size, 1))
    fits = {name: mixed_fit(y, s, ones, common=shared, method=name) for name in METHODS}
    without: list[MixedFit | None] = []
    for i in range(y.size):
        kept = np.arange(y.size) != i
        enough = int(kept.sum()) >= FEWEST
        without.append(mixed_fit(y[kept], s[kept], ones[kept], common=shared[:, kept]) if enough else None)
    return Pooled(
        fit=fits["paule-mandel"],
        scatter=float(y.std(ddof=1)),
        others={name: (float(fit.coefficients[0]), fit.between) for name, fit in fits.items()},
        leave_one_out=tuple(without),
    )
