"""Order of convergence, fitted over a refinement series and not only over one pair of meshes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class FittedOrder(NamedTuple):
    """Slope of log(error) against log(h)."""

    order: float  # Least-squares slope p of error = C h^p [-]
    standard_error: float
    """Standard error of the slope from the scatter about the line [-]; 0 for an exact power law."""
    local: NDArray[np.float64]  # slope between neighbours, in the order of decreasing h [-], shape [n - 1]


def fitted_order(h: ArrayLike, error: ArrayLike) -> FittedOrder:
    """Fit error = C h^p by least squares in log-log.

    ``h``: step or element sizes, any unit, all different, shape [n], n >= 3. ``error``: error at each size,
    any unit, positive, shape [n]. An error of exactly 0 has no order: the tested property is exact to
    round-off.
    """
    sizes, errors = np.asarray(h, dtype=float), np.asarray(error, dtype=float)
    assert (errors > 0.0).all(), errors
    coarse_first = np.argsort(-sizes)
    x, y = np.log(sizes[coarse_first]), np.log(errors[coarse_first])
    dx = x - x.mean()
    order = float(dx @ y / (dx @ dx))
    residual = y - y.mean() - order * dx
    standard_error = float(np.sqrt(residual @ residual / (x.size - 2) / (dx @ dx)))
    return FittedOrder(order, standard_error, np.diff(y) / np.diff(x))


def assert_order(
    h: ArrayLike, error: ArrayLike, expected: float, tolerance: float, *, at_least: bool = False
) -> FittedOrder:
    """Assert that the errors decrease as h^expected, within `tolerance` on the exponent.

    Both the slope and the straight line are tested. If the standard error of the slope is larger than
    `tolerance`, the series is not one power law, independent of its mean slope. Causes are a noise floor, a
    coarse mesh outside the asymptotic range, or another kind of error.

    ``h``, ``error``: as for `fitted_order`. ``expected``: the order that theory gives [-]. ``tolerance``:
    allowed distance of the fitted order, and largest allowed standard error [-]. ``at_least``: accept any
    order above ``expected - tolerance`` ("first order or better"). Returns: the fit, for a page or a message.
    Raises AssertionError with the table of sizes, errors and local orders.
    """
    fit = fitted_order(h, error)
    too_low = fit.order < expected - tolerance
    too_high = fit.order > expected + tolerance and not at_least
    scattered = fit.standard_error > tolerance
    if too_low or too_high or scattered:
        wanted = f"{'>=' if at_least else '='} {expected:g} within {tolerance:g}"
        cause = "the series is not one power law" if scattered else "the slope is wrong"
        rows = sorted(zip(np.ravel(h), np.ravel(error), strict=True), reverse=True)
        local = ["", *(f"{p:.3f}" for p in fit.local)]
        table = "\n".join(f"  {a:12.5g} {b:12.5g} {p:>8}" for (a, b), p in zip(rows, local, strict=True))
        raise AssertionError(
            f"order {fit.order:.3f} +- {fit.standard_error:.3f}, wanted {wanted}: {cause}\n"
            f"  {'h':>12} {'error':>12} {'local':>8}\n{table}"
        )
    return fit
