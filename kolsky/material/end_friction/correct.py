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

from dataclasses import replace

import numpy as np
from scipy.interpolate import LSQUnivariateSpline
from scipy.optimize import least_squares

from explicit.materials import marlow_from_curve
from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray
from kolsky.material.curves.band import CurveBand
from kolsky.material.curves.uniaxial import stretch_of
from kolsky.material.end_friction.problem import (
    KNOTS,
    MODEL_RADIUS,
    PLACES,
    EndFriction,
    FrictionCorrection,
    FrictionProblem,
)
from kolsky.material.end_friction.slow_test import SlowNumerics, SlowTests, slow_tests

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


ROUNDS, CLOSED = 3, 3e-3
"""Most rounds in which the corrected curve is simulated, and the distance at which they end [-]."""
ORDER, SHARE = 2.0, 0.5 * 1.25
"""Order of the mesh error and its share that counts as standard uncertainty, as in
`kolsky.identification`."""


class Optimum:
    """The optimum of a `FrictionProblem`, and what follows from it.

    Parameters
    ----------
    problem
        What was fitted.
    theta
        Logarithms of the unknowns that fit best, shape [n_unknowns].
    jacobian
        Derivatives of the residuals there, shape [n_residuals, n_unknowns].
    mesh
        The refined mesh: elements along radius and height.
    """

    def __init__(
        self, problem: FrictionProblem, theta: FloatArray, jacobian: FloatArray, mesh: tuple[int, int]
    ) -> None:
        self.problem, self.theta, self.jacobian, self.mesh = problem, theta, jacobian, mesh

    def correction(self, evaluations: int) -> FrictionCorrection:
        """The corrected curve with its new modes; `evaluations` are those that the fit took.

        Raises
        ------
        ValueError
            If a simulation does not complete.
        """
        p, band = self.problem, self.problem.band
        coarse, fine = p.tests([self.theta]), p.tests([self.theta], mesh=self.mesh)
        start = _along(p.strain, np.log(fine.stress[0]) - p.uniaxial(self.theta), band.strain)
        ratio, closure, last = self._closed(np.exp(start))
        found = band.times(1.0 / ratio)
        f, sigma = self._coefficient()
        if sigma > 0.0:
            found = found.with_mode(
                "friction", found.stress * _along(p.strain, self._by_friction(sigma), band.strain)
            )
        finer = self.mesh[0] / p.numerics.mesh[0]
        shift = np.log(fine.stress[0] / coarse.stress[0]) * SHARE / (finer**ORDER - 1.0)
        found = found.with_mode("mesh", found.stress * _along(p.strain, shift, band.strain))
        return FrictionCorrection(
            band=found,
            ratio=ratio,
            coefficient=f,
            sigma=sigma,
            misfit=_rms(np.log(coarse.stress[0] / p.stress)),
            closure=closure,
            evaluations=evaluations,
            slow=last,
        )

    def _coefficient(self) -> tuple[float | None, float]:
        p = self.problem
        if p.ends.law != "coulomb":
            return None, 0.0
        if not p.free:
            return p.ends.coefficient, p.ends.sigma
        f = float(np.exp(self.theta[KNOTS]))
        gain = np.linalg.pinv(self.jacobian)[KNOTS]
        # What the mesh does to the radius it does at all strains alike, so no number of them averages it.
        together = gain[PLACES:].sum() * MODEL_RADIUS * p.specimen.radius / p.bulge_scale
        return f, f * float(np.hypot(np.linalg.norm(gain), together))

    def _by_friction(self, sigma: float) -> FloatArray:
        """Change of ln T by one sigma of the friction, the law fitted anew, shape [PLACES]."""
        p, n = self.problem, PLACES
        knots = self.jacobian[:n, :KNOTS]
        f = p.ends.coefficient if not p.free else float(np.exp(self.theta[KNOTS]))
        assert f is not None
        step = min(sigma, f) if f > 0.0 else sigma
        pair = p.tests([self.theta, self.theta], friction=[f + step, f - step])
        direct = np.log(pair.stress[0] / pair.stress[1]) / 2.0 * sigma / step
        again = -np.linalg.lstsq(knots, direct / p.stress_scale, rcond=None)[0]
        moved = self.theta.copy()
        moved[:KNOTS] += again
        change = p.uniaxial(moved) - p.uniaxial(self.theta)
        left = direct + knots @ again * p.stress_scale
        return np.asarray(change - left)

    def _closed(self, ratio: FloatArray) -> tuple[FloatArray, float, SlowTests]:
        """The ratio with which the corrected curve itself, continued on its tangent, gives the test.

        Much of a barrelled specimen is strained past the end of the curve, and the knots' continuation is not
        the curve's. The closest of `ROUNDS` is taken, with its distance (rms) and its simulated test.
        """
        p, rounds = self.problem, []
        for _ in range(ROUNDS):
            stress = p.band.stress / ratio
            law = marlow_from_curve(stretch_of(p.band.strain, compression=True), -stress)
            tests = slow_tests(
                [law],
                p.specimen,
                p.strain,
                faces=p.ends.law,
                friction=self._coefficient()[0] or 0.0,
                numerics=replace(p.numerics, mesh=self.mesh),
            )
            away = np.log(tests.stress[0] / p.stress)
            rounds.append((ratio, _rms(away), tests))
            if rounds[-1][1] < CLOSED:
                break
            ratio = ratio * np.exp(_along(p.strain, away, p.band.strain))
        return min(rounds, key=lambda one: one[1])


def _along(places: FloatArray, value: FloatArray, strain: FloatArray) -> FloatArray:
    """A smooth course through simulated values, constant below the first of them.

    A mesh's nodes land on the platen one by one, and the force steps a little at each; three inner knots
    leave the steps out.
    """
    inner = np.quantile(places, [0.25, 0.5, 0.75])
    course = LSQUnivariateSpline(places, value, inner, k=3)
    return np.asarray(course(np.clip(strain, places[0], places[-1])))


def _rms(x: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(x))))
