"""How well the shares of an error budget are known from so many draws: bootstrap.

Shares of sources taken one at a time know one thing by chance alone, the spread of the noise: its draws are
drawn again with replacement. Draws of all errors at once give the shares a second time, independently, by a
straight line through them,

    m_k = b_0 + sum_i b_i z_ik + e_k,    share_i = b_i^2 / (sum_j b_j^2 + s^2),                      (E.12)

with z in standard uncertainties and s^2 = sum e^2 / (n - p - 1) what no line explains: the noise, curvature,
what sources do to each other. Their intervals come from residuals drawn again with replacement, scaled by
sqrt(n / (n - p - 1)), on the same z.
"""

from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray

RESAMPLES = 2000
"""Bootstrap samples."""
SPARE = 4
"""Least draws beyond the constants of the line."""
PERCENT = (2.5, 97.5)
"""Ends of an interval."""

Interval = tuple[float, float]


@dataclass(frozen=True)
class JointShares:
    """Shares in the variance of the draws of all errors at once."""

    slopes: FloatArray
    """Change of the answer by one standard uncertainty of each source, shape [p]."""
    shares: FloatArray
    """Of each source [-], shape [p]."""
    intervals: FloatArray
    """95 % intervals of them, shape [p, 2]."""
    unexplained: float
    """Share that no line explains [-]: noise, curvature, interactions."""
    unexplained_interval: Interval
    """95 % interval of that."""


def shares_of_squares(u: FloatArray, drawn: int, values: FloatArray, *, seed: int = 1) -> FloatArray:
    """Intervals of shares u_i^2 / sum u^2 of which one u is a standard deviation of a few values.

    Parameters
    ----------
    u
        Standard uncertainties; NaN ones have no part, shape [k].
    drawn
        Which of them is the standard deviation of `values`.
    values
        The draws, shape [n].
    seed
        Of the bootstrap.

    Returns
    -------
    FloatArray
        95 % intervals, NaN where u is, shape [k, 2].
    """
    rng = np.random.default_rng(seed)
    again = values[rng.integers(len(values), size=(RESAMPLES, len(values)))].var(axis=1, ddof=1)
    squares = np.tile(u**2, (RESAMPLES, 1))
    squares[:, drawn] = again
    total = np.nansum(squares, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        shares = squares / total[:, None]
    found = np.full((len(u), 2), np.nan)
    known = np.isfinite(u)
    found[known] = np.percentile(shares[:, known], PERCENT, axis=0).T
    return found


def joint_shares(z: FloatArray, values: FloatArray, *, seed: int = 1) -> JointShares | None:
    """Shares of sources in the variance of draws of all of them at once, Eq. (E.12).

    Parameters
    ----------
    z
        Errors in standard uncertainties, shape [n, p].
    values
        The answers, shape [n].
    seed
        Of the bootstrap.

    Returns
    -------
    JointShares or None
        None for fewer than p + 1 + `SPARE` draws, or if the sources cannot be told apart.
    """
    n, p = z.shape
    left = n - p - 1
    A = np.column_stack([np.ones(n), z])
    if left < SPARE or np.linalg.matrix_rank(A) <= p:
        return None
    gain = np.linalg.pinv(A)
    fitted = A @ (gain @ values)
    residual = values - fitted
    rng = np.random.default_rng(seed)
    drawn = residual[rng.integers(n, size=(RESAMPLES, n))] * np.sqrt(n / left)
    samples = np.concatenate([values[None], fitted + drawn])
    slopes = samples @ gain.T
    rest = ((samples - slopes @ A.T) ** 2).sum(axis=1) / left
    total = (slopes[:, 1:] ** 2).sum(axis=1) + rest
    parts = np.column_stack([slopes[:, 1:] ** 2, rest])
    shares = np.divide(parts, total[:, None], out=np.zeros_like(parts), where=total[:, None] > 0.0)
    low, high = np.percentile(shares[1:], PERCENT, axis=0)
    return JointShares(
        slopes=slopes[0, 1:],
        shares=shares[0, :-1],
        intervals=np.stack([low[:-1], high[:-1]], axis=1),
        unexplained=float(shares[0, -1]),
        unexplained_interval=(float(low[-1]), float(high[-1])),
    )
