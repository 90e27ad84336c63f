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

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LSQUnivariateSpline, PchipInterpolator
from scipy.optimize import least_squares

from explicit.materials import MarlowLaw, marlow_from_curve
from kolsky.apparatus import Specimen
from kolsky.quasistatic.band import CurveBand
from kolsky.quasistatic.slowtest import OUTSET, SlowNumerics, SlowTests, slow_tests
from kolsky.quasistatic.uniaxial import gaussian_strain, stretch_of

FloatArray = NDArray[np.float64]

KNOTS = 5
"""Knots of the law that is fitted."""
PLACES = 30
"""Strains at which it is fitted."""
TABLE = 65
"""Entries of its table."""
LARGEST_FRICTION = 5.0
"""Above, nothing slips any more: choose "bonded" or "rough"."""
MODEL_STRESS, MODEL_RADIUS = 5e-3, 1e-3
"""What the fit's coarse mesh leaves open, relative to stress and radius [-]; it weighs the two."""
TOLERANCE = 1e-3
"""Relative change of unknowns or of the sum of squares at which the fit ends; nodes that land one by one on a
platen make the simulated force uneven by more."""
ROUNDS, CLOSED = 3, 3e-3
"""Most rounds in which the corrected curve is simulated, and the distance at which they end [-]."""
LARGEST_CLOSURE = 0.03
"""Largest closure of a correction that can be used [-]."""
ORDER, SHARE = 2.0, 0.5 * 1.25
"""Order of the mesh error and its share that counts as standard uncertainty, as in `kolsky.identify`."""


@dataclass(frozen=True)
class EndFriction:
    """How the specimen held to the platens in the quasi-static test."""

    law: Literal["bonded", "rough", "coulomb"]
    """Contact law of faces and side: bonded also carries tension, rough does not."""
    coefficient: float | None = 0.0
    """Coulomb's coefficient [-]; None finds it from the radius at mid-height. Only for "coulomb"."""
    sigma: float = 0.0
    """Its standard uncertainty, where it is declared [-]."""

    def __post_init__(self) -> None:
        f = self.coefficient
        if self.law not in ("bonded", "rough", "coulomb"):
            raise ValueError(f"the ends are 'bonded', 'rough' or 'coulomb', got {self.law!r}")
        if f is not None and not 0.0 <= f <= LARGEST_FRICTION:
            raise ValueError(f"friction must be in [0, {LARGEST_FRICTION:g}], got {f}; above, choose 'rough'")
        if not 0.0 <= self.sigma < float("inf") or (f is not None and self.sigma > f):
            raise ValueError(f"the friction's sigma must be in [0, friction], got {self.sigma} with {f}")


@dataclass(frozen=True)
class FrictionCorrection:
    """The material's curve, and how it was found."""

    band: CurveBand
    """Corrected curve, with the modes "friction" and "mesh" added where they are known."""
    ratio: FloatArray
    """Apparent over true nominal stress [-], shape [n]."""
    coefficient: float | None
    """Coulomb's coefficient that was used or found [-]; None for "bonded" and "rough"."""
    sigma: float
    """Its standard uncertainty [-]."""
    misfit: float
    """Root mean square of the fitted law's simulated over the measured stress, less 1 [-]."""
    closure: float
    """The same for a test simulated on the refined mesh with the corrected curve itself [-]."""
    evaluations: int
    """Batches of simulations that the fit took."""
    slow: SlowTests
    """That test: kinetic energy, face forces, share past the data."""


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
    problem = _Problem(band, specimen, ends, bulge if free else None, bulge_sigma, numerics)
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
    found = _Found(problem, fit.x, fit.jac, refined_mesh).correction(fit.nfev)
    if not found.closure < LARGEST_CLOSURE:
        raise ValueError(
            f"a test simulated with the corrected curve misses the measured one by {found.closure:.2g} (rms),"
            f" at most {LARGEST_CLOSURE:g} is allowed: with little friction an edge may curl off the platen"
            " at large compression; end the curve earlier"
        )
    return found


class _Problem:
    """Residuals of stress, and of the radius if friction is free, over logarithms of the unknowns."""

    def __init__(
        self,
        band: CurveBand,
        specimen: Specimen,
        ends: EndFriction,
        bulge: FloatArray | None,
        bulge_sigma: float,
        numerics: SlowNumerics,
    ) -> None:
        self.band, self.specimen, self.ends, self.numerics = band, specimen, ends, numerics
        first = max(OUTSET, float(band.strain[0]))
        self.strain = np.linspace(first, float(band.strain[-1]), PLACES)
        self.last = float(_measure(self.strain[-1:])[0])
        self.stress = _smooth_between(band.strain, band.stress, self.strain)
        relative = np.interp(self.strain, band.strain, band.sigma / band.stress)
        self.stress_scale = np.hypot(relative, MODEL_STRESS)
        self.bulge = None if bulge is None else _barrelled(band.strain, bulge, self.strain)
        self.bulge_scale = float(np.hypot(bulge_sigma, MODEL_RADIUS * specimen.radius))
        self._last: tuple[FloatArray, SlowTests] | None = None

    @property
    def free(self) -> bool:
        """Whether friction is one of the unknowns, the last of them."""
        return self.bulge is not None

    def start(self) -> FloatArray:
        """The apparent curve as the material's, friction 0.3 if it is free."""
        s = _measure(self.band.strain)
        quotient = self.band.stress / gaussian_strain(self.band.strain, compression=True)
        knots = np.linspace(0.0, self.last, KNOTS)
        return np.append(np.log(np.interp(knots, s, quotient)), [np.log(0.3)] if self.free else [])

    def law(self, theta: FloatArray) -> MarlowLaw:
        """The law of the unknowns."""
        curve = PchipInterpolator(np.linspace(0.0, self.last, KNOTS), theta[:KNOTS])
        s = np.linspace(0.0, self.last, TABLE)
        quotient = np.exp(curve(s))
        return MarlowLaw(last=self.last, quotient=quotient, slope=quotient * curve(s, 1))

    def uniaxial(self, theta: FloatArray) -> FloatArray:
        """ln T of the law at the fitted strains, shape [PLACES]."""
        return np.asarray(np.log(_uniaxial(self.law(theta), self.strain)))

    def tests(
        self,
        thetas: list[FloatArray],
        *,
        friction: list[float] | None = None,
        mesh: tuple[int, int] | None = None,
    ) -> SlowTests:
        """Simulated tests of several sets of unknowns."""
        declared = self.ends.coefficient or 0.0
        own = [float(np.exp(theta[KNOTS])) if self.free else declared for theta in thetas]
        return slow_tests(
            [self.law(theta) for theta in thetas],
            self.specimen,
            self.strain,
            faces=self.ends.law,
            friction=np.minimum(own if friction is None else friction, 1e3),
            numerics=self.numerics if mesh is None else replace(self.numerics, mesh=mesh),
        )

    def rows(self, tests: SlowTests) -> FloatArray:
        """Residuals of each test, shape [n_tests, n_residuals]."""
        stress = np.log(tests.stress / self.stress) / self.stress_scale
        if self.bulge is None:
            return np.asarray(stress)
        return np.hstack([stress, (tests.bulge - self.bulge) / self.bulge_scale])

    def residual(self, theta: FloatArray) -> FloatArray:
        """Residuals at one point."""
        tests = self.tests([theta])
        self._last = (theta.copy(), tests)
        return np.asarray(self.rows(tests)[0])

    def jacobian(self, theta: FloatArray, step: float = 0.02) -> FloatArray:
        """Forward differences, all of them in one batch, shape [n_residuals, n_unknowns]."""
        known = self._last is not None and np.array_equal(self._last[0], theta)
        base = self._last[1] if known and self._last else self.tests([theta])
        moved = [theta + step * row for row in np.eye(theta.size)]
        return np.asarray((self.rows(self.tests(moved)) - self.rows(base)).T / step)


class _Found:
    """The optimum, and what follows from it."""

    def __init__(
        self, problem: _Problem, theta: FloatArray, jacobian: FloatArray, mesh: tuple[int, int]
    ) -> None:
        self.problem, self.theta, self.jacobian, self.mesh = problem, theta, jacobian, mesh

    def correction(self, evaluations: int) -> FrictionCorrection:
        """The corrected curve with its new modes."""
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


def _measure(strain: FloatArray) -> FloatArray:
    """s = sqrt(I1 - 3) of uniaxial compression [-]."""
    lam = 1.0 - strain
    return np.asarray(strain * np.sqrt((lam + 2.0) / lam))


def _uniaxial(law: MarlowLaw, strain: FloatArray) -> FloatArray:
    """Nominal stress of the incompressible law in frictionless compression [Pa]."""
    return np.asarray(law.two_u_prime(_measure(strain)) * gaussian_strain(strain, compression=True))


def _smooth_between(strain: FloatArray, stress: FloatArray, places: FloatArray) -> FloatArray:
    """The stress at other strains, by its quotient with the Gaussian strain, which is nearly constant."""
    quotient = stress / gaussian_strain(strain, compression=True)
    between = PchipInterpolator(strain, quotient)(places)
    return np.asarray(between * gaussian_strain(places, compression=True))


def _barrelled(strain: FloatArray, bulge: FloatArray, places: FloatArray) -> FloatArray:
    """The radius at other strains, by its quotient with that of a homogeneous deformation."""
    between = PchipInterpolator(strain, bulge * np.sqrt(1.0 - strain))(places)
    return np.asarray(between / np.sqrt(1.0 - places))


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
