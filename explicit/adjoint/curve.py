"""From the constants that the kernels read of Marlow's law to its table, and to the curve it was built from.

The kernels read the cubic of every interval, which follows from the quotient 2 U' and its slope at both
ends: two unknowns at every knot. The slopes follow from a curve's points by the monotone cubic, so the
derivative by a point sums what it does to quotients and slopes around it.
"""

import numpy as np

from explicit.adjoint.gradients import Gradient
from explicit.arrays import FloatArray
from explicit.materials import MarlowLaw, marlow_from_curve

RELATIVE_STEP = 1e-7
"""Step of the differences that carry a table back to its curve: measured error 1e-9 of a derivative."""


def by_table(gradient: Gradient, law: MarlowLaw) -> tuple[FloatArray, FloatArray]:
    """Derivatives of the objective by the nodes of the law's table, quotients and slopes as independent.

    Parameters
    ----------
    gradient : Gradient
        Of a model whose sample has this law.
    law : MarlowLaw
        The law.

    Returns
    -------
    by_quotient : array, shape [n_knots]
        Derivative by 2 U' at each knot [1/Pa]. The first one is also the initial shear modulus, on which the
        bulk modulus, the damping and the hourglass control depend; that is included.
    by_slope : array, shape [n_knots]
        Derivative by the slope of 2 U' in s at each knot [1/Pa].

    Raises
    ------
    ValueError
        If the gradient has another number of constants than the law.
    """
    n = len(law.parameters())
    if len(gradient.law) != n:
        raise ValueError(f"the gradient has {len(gradient.law)} constants of a law, this law has {n}")
    count = len(law.quotient)
    by_value, by_rise, by_square, by_cube = gradient.law[n - 5 * count : n - count].reshape(-1, 4).T.copy()
    # An interval's square and cube follow from both its ends (`MarlowLaw.cubics`); past the data are none.
    square, cube = by_square[:-1], by_cube[:-1]
    by_value[:-1] -= 3.0 * square - 2.0 * cube
    by_value[1:] += 3.0 * square - 2.0 * cube
    by_rise[:-1] -= 2.0 * square - cube
    by_rise[1:] -= square - cube
    by_value[0] += gradient.shear_modulus
    return by_value, by_rise * law.step  # the row holds slopes times the step


def by_curve_stress(
    gradient: Gradient, stretch: FloatArray, stress: FloatArray, *, n_knots: int = 129
) -> FloatArray:
    """Derivative of the objective by the stress of each point of the uniaxial curve.

    The table is linear in the curve's stresses but for the slopes of the monotone cubic; it is carried back
    by central differences of `marlow_from_curve` itself, which costs no simulation.

    Parameters
    ----------
    gradient : Gradient
        Of a model whose sample has the law ``marlow_from_curve(stretch, stress, n_knots=n_knots)``.
    stretch, stress, n_knots
        The curve, as there; shape [n].

    Returns
    -------
    array, shape [n]
        Derivatives [1/Pa], 0 for a point at rest.

    Raises
    ------
    ValueError
        As `marlow_from_curve`, or if the gradient is of another law.
    """
    law = marlow_from_curve(stretch, stress, n_knots=n_knots)
    by_quotient, by_slope = by_table(gradient, law)
    found = np.zeros(len(stress))
    for i in np.flatnonzero(np.asarray(stress) != 0.0):
        h = RELATIVE_STEP * abs(stress[i])
        ends = []
        for side in (h, -h):
            moved = np.array(stress, dtype=float)
            moved[i] += side
            ends.append(marlow_from_curve(stretch, moved, n_knots=n_knots))
        quotient = (ends[0].quotient - ends[1].quotient) / (2.0 * h)
        slope = (ends[0].slope - ends[1].slope) / (2.0 * h)
        found[i] = by_quotient @ quotient + by_slope @ slope
    return found
