r"""Whether a bond peels: a force that falls behind as if the bonded length became shorter.

A rigid bond that peels by a length a leaves more of the specimen free and takes f(a) off its force: the
difference of two simulations, one with a bond shorter by a known amount. If it opens at sample j, what is
missing afterwards is the template t_j = (f_short - f) for samples i >= j, 0 before. The fit hides the part of
it that the constants can imitate, so both sides are projected, P = I - Q Q^T with J = Q R, and the peeled
length in units of the known amount is a ratio of products with its standard deviation:

    a_j = t_j^T P y / t_j^T P t_j,   sigma(a_j) = s / sqrt(t_j^T P t_j),   z_j = a_j / sigma(a_j),

y the residual data less model, whitened. The j of the largest |z| is taken, and its z compared with a limit:
a
force that rises is no peeling, though a later opening could imitate it.
"""

from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray

LIMIT = 5.0
"""Least z, over all samples, that is called a peeling bond."""
LEAST_SHARE = 1e-6
"""Least share of a template that the constants cannot imitate; below it the test says nothing."""
FIRST, LAST = 0.15, 0.85
"""Range of the series in which an opening is looked for, as shares of its length."""


@dataclass(frozen=True)
class Debonding:
    """The strongest sign of a peeling bond."""

    sample: int
    """First sample after the opening."""
    length: float
    """Peeled length of each bond [m]; negative if the specimen seems better bonded."""
    sigma: float
    """Its standard deviation [m]."""
    z: float
    """Their ratio [-]."""
    searched: int
    """Samples at which an opening was tried."""

    @property
    def suspected(self) -> bool:
        """Whether a bond seems to peel."""
        return self.z > LIMIT


def debonding(
    residual: FloatArray,
    jacobian: FloatArray,
    shortened: FloatArray,
    *,
    amount: float,
    scale: float,
) -> Debonding | None:
    """Search a series of residuals for the opening of a bond.

    Parameters
    ----------
    residual
        Measured less simulated force of one end, over sigma [-], shape [n].
    jacobian
        Its slopes by the fitted constants over sigma, shape [n, p].
    shortened
        Force with a bond shorter by `amount`, less the force as it is, over sigma, shape [n].
    amount
        Peeled length of each bond that `shortened` stands for [m].
    scale
        Variance of the residuals over that of the declared noise, >= 1.

    Returns
    -------
    Debonding or None
        None if the constants imitate every opening, so that this test cannot say.
    """
    n = len(residual)
    basis, _ = np.linalg.qr(jacobian)
    left = residual - basis @ (basis.T @ residual)
    best, searched = None, 0
    for j in range(max(1, round(FIRST * n)), max(2, round(LAST * n))):
        template = np.where(np.arange(n) >= j, shortened, 0.0)
        seen = template - basis @ (basis.T @ template)
        information = float(seen @ seen)
        if information <= LEAST_SHARE * float(template @ template) or information == 0.0:
            continue
        searched += 1
        length = float(seen @ left) / information
        sigma = float(np.sqrt(scale / information))
        found = Debonding(j, amount * length, amount * sigma, length / sigma, 0)
        if best is None or abs(found.z) > abs(best.z):
            best = found
    return None if best is None else Debonding(best.sample, best.length, best.sigma, best.z, searched)
