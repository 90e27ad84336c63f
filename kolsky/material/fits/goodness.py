"""Goodness of fit, from residuals.

With n residuals r_i, k free constants and S = sum r_i^2,

    RMSE = sqrt(S / n),  R^2 = 1 - S / sum (T_i - mean T)^2,                                   (Q.6)
    AIC = n ln(S / n) + 2 k,  BIC = n ln(S / n) + k ln n,                                      (Q.7)

where the noise is unknown and the constant of the likelihood is left out (Burnham and Anderson 2002): only
differences between laws fitted to the same points count. With known noise n ln(S / n) is replaced by chi^2.
"""

from math import log

import numpy as np

from kolsky.base.arrays import FloatArray


def rmse(residual: FloatArray) -> float:
    """Root mean square of residuals, in their unit; Eq. (Q.6)."""
    return float(np.sqrt(np.mean(residual**2)))


def r_squared(residual: FloatArray, measured: FloatArray) -> float:
    """Coefficient of determination, Eq. (Q.6); negative where the mean of the data does better."""
    return float(1.0 - (residual @ residual) / np.sum((measured - measured.mean()) ** 2))


def aic(chi2: float, n: int, k: int, *, known_noise: bool = False) -> float:
    """Akaike's criterion of n residuals with sum of squares `chi2` and k free constants, Eq. (Q.7)."""
    return _deviance(chi2, n, known_noise) + 2.0 * k


def bic(chi2: float, n: int, k: int, *, known_noise: bool = False) -> float:
    """Schwarz's criterion, Eq. (Q.7)."""
    return _deviance(chi2, n, known_noise) + k * log(n)


def durbin_watson(residual: FloatArray) -> float:
    """sum (r_i+1 - r_i)^2 / sum r_i^2: 2 for independent residuals, 0 where each is like the one before."""
    return float(np.sum(np.diff(residual) ** 2) / np.sum(residual**2))


def _deviance(chi2: float, n: int, known_noise: bool) -> float:
    if known_noise:
        return chi2
    # A fit without residuals has an infinitely good one, which no other number could say.
    return n * log(chi2 / n) if chi2 > 0.0 else float("-inf")
