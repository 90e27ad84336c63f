r"""End friction taken out of a compression test, by the package's own solver run slowly.

Faces that do not slide freely make a cylinder barrel, and its apparent nominal stress :math:`S` is above the
material's :math:`T`: by 31 to 33 % at small strain for a bonded cylinder of 9.5 x 6.5 mm. The inverse is

.. math:: T(\epsilon) = S_{measured}(\epsilon)\, \frac{T_\theta(\epsilon)}{S_{\theta, f}(\epsilon)}

with a first-invariant law :math:`\theta` (2U' at a few knots of s, in logarithms) whose simulated compression
:math:`S_{\theta, f}` is fitted to the measured one by Levenberg and Marquardt's method. Only the *ratio*,
which hardly depends on the law, is taken from the fit, so no detail of the curve is lost in the knots.

A force alone does not tell friction from the curve's shape: with enough knots every coefficient fits. It can
be free where the radius at mid-height was measured too; else it is declared, with its uncertainty.
"""

import numpy as np
from scipy.optimize import least_squares

from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray
from kolsky.material.curves.band import CurveBand
from kolsky.material.end_friction.optimum import Optimum
from kolsky.material.end_friction.problem import FrictionProblem
from kolsky.material.end_friction.records import EndFriction, FrictionCorrection
from kolsky.material.end_friction.slow_test import SlowNumerics

TOLERANCE = 1e-3
"""Relative change of unknowns or of the sum of squares at which the fit ends; nodes that land one by one on a
platen make the simulated force uneven by more."""
LARGEST_CLOSURE = 0.03
"""Largest closure of a correction that can be used [-]."""


def correct_friction(
    band: CurveBand,
    specimen: Specimen,
    ends: EndFriction,
    *,
    bulge: FloatArray | None = None,
    bulge_sigma: float = 0.0,
    numerics: SlowNumerics | None = None,
    refined_mesh: tuple[int, int] = (24, 32),
) -> FrictionCorrection:
    """Find the uniaxial curve behind a compression test with friction at its ends.

    Parameters
    ----------
    band
        The apparent nominal stress over nominal compressive strain.
    specimen
        Its undeformed size.
    ends
        What holds it at its ends.
    bulge, bulge_sigma
        Radius at mid-height at the strains of `band` [m], shape [n], and its standard deviation [m].
    numerics
        The fit's mesh, duration and Poisson's ratio.
    refined_mesh
        The mesh the ratio is taken from.

    Raises
    ------
    ValueError
        If friction is free without a measured radius, the stress is not positive, the fit does not converge,
        or a simulation does not complete.
    """
    numerics = numerics or SlowNumerics(passages=160.0)
    free = ends.law == "coulomb" and ends.coefficient is None
    if free and (bulge is None or not bulge_sigma > 0.0):
        raise ValueError(
            "friction cannot be free with the force alone, which fits any coefficient: give the radius at "
            "mid-height with its sigma, or declare the friction"
        )
    if (band.stress <= 0.0).any():
        bad = int(np.argmax(band.stress <= 0.0))
        raise ValueError(
            f"the stress is {band.stress[bad]:.6g} Pa at strain {band.strain[bad]:.4g}, not > 0: is there a"
            " toe?"
        )
    problem = FrictionProblem(band, specimen, ends, bulge if free else None, bulge_sigma, numerics)
    try:
        fit = least_squares(
            problem.residual,
            problem.start(),
            jac=problem.jacobian,
            method="lm",
            xtol=TOLERANCE,
            ftol=TOLERANCE,
        )
    except ValueError as error:
        raise ValueError(f"the friction correction failed: {error}") from error
    if not fit.success:
        raise ValueError(f"the friction correction did not converge: {fit.message}")
    found = Optimum(problem, fit.x, fit.jac, refined_mesh).correction(fit.nfev)
    if not found.closure < LARGEST_CLOSURE:
        raise ValueError(
            f"a test simulated with the corrected curve misses the measured one by {found.closure:.2g} (rms),"
            f" at most {LARGEST_CLOSURE:g} is allowed: with little friction an edge may curl off the platen"
            " at large compression; end the curve earlier"
        )
    return found
