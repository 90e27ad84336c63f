r"""Scatter of the stiffness between shots, by restricted maximum likelihood (Patterson and Thompson 1971).

Shot k has the stiffness m (1 + s z_k) with z_k standard normal. Linear about the optimum the residual is
r = -J d + s \sum_k u_k z_k + e with u_k the change of shot k's data by a relative change of its stiffness,

    -2 ln L(s) = ln det C + ln det (J^T C^-1 J) + r^T (C^-1 - C^-1 J (J^T C^-1 J)^-1 J^T C^-1) r,

C(s) = C_0 + s^2 \sum_k u_k u_k^T. The second term counts the freedom that the shared unknowns take: without
it the scatter of few shots comes out too small.
"""

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import norm
from scipy.stats import t as student

from doe.whitening import Whitening
from kolsky.base.arrays import FloatArray
from kolsky.joint.records import Scatter

LARGEST = 0.5
"""Largest relative scatter that is looked for [-]."""
SMALLEST = 1e-5
"""Scatter below which there is none [-]."""
RISE = 3.84
"""Rise of the deviance at the ends of a 95 % interval of one parameter [-]."""
COVERAGE = 2.0
"""Coverage factor k of intervals [-]."""


def restricted_deviance(residual: FloatArray, slopes: FloatArray, whitening: Whitening) -> float:
    """-2 ln of the restricted likelihood up to a constant [-].

    Parameters
    ----------
    residual
        Prediction less data, shape [k].
    slopes
        By the shared unknowns, shape [k, d].
    whitening
        The weights.
    """
    r, rows = whitening.apply(residual), whitening.apply(slopes.T)
    normal = rows @ rows.T
    followed = rows @ r
    taken = float(followed @ np.linalg.solve(normal, followed))
    return whitening.log_determinant + float(np.linalg.slogdet(normal)[1]) + float(r @ r) - taken


def estimated(
    residual: FloatArray, slopes: FloatArray, patterns: FloatArray, weights: Callable[[FloatArray], Whitening]
) -> Scatter:
    """The scatter and its 95 % interval.

    Parameters
    ----------
    residual, slopes
        As of `restricted_deviance`.
    patterns
        Change of the data by a relative change of each shot's own stiffness, shape [n_shots, k].
    weights
        Whitening that knows further patterns beside those it has, of shape [n, k].
    """

    def deviance(s: float) -> float:
        return restricted_deviance(residual, slopes, weights(s * patterns))

    def at(log: float) -> float:
        return deviance(float(np.exp(log)))

    ends = np.log(SMALLEST), np.log(LARGEST)
    grid = np.linspace(*ends, 25)
    values = np.array([at(g) for g in grid])
    best = int(np.argmin(values))
    inner = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    found = minimize_scalar(at, bounds=inner, method="bounded", options={"xatol": 1e-4})
    none = deviance(0.0)
    value, least = (float(np.exp(found.x)), float(found.fun))
    if none <= least or value <= 2.0 * SMALLEST:
        value, least = 0.0, min(none, least)

    def above(log: float) -> float:
        return at(log) - least - RISE

    low = 0.0
    if none - least > RISE and above(ends[0]) > 0.0:
        low = float(np.exp(brentq(above, ends[0], np.log(value))))
    start = np.log(value) if value > 0.0 else ends[0]
    high = float(np.exp(brentq(above, start, ends[1]))) if above(ends[1]) > 0.0 else LARGEST
    return Scatter(value=value, interval=(low, high))


def expanded(sigma: float, between: float, shots: int) -> float:
    """Half width of a 95 % interval (k = 2) where part of the variance is a scatter between few shots.

    Student's t by the degrees of freedom of Welch and Satterthwaite: n - 1 for the scatter's part, infinitely
    many for the rest; as k = 2 stands for 95.45 %, so does t.

    Parameters
    ----------
    sigma
        Whole standard uncertainty.
    between
        Its part by the scatter, in the same unit.
    shots
        Their number n, >= 2 where `between` > 0.
    """
    if between <= 0.0 or sigma <= 0.0:
        return COVERAGE * sigma
    freedom = (shots - 1) * (sigma / min(between, sigma)) ** 4
    level = float(norm.cdf(COVERAGE))
    return float(student.ppf(level, freedom)) * sigma
