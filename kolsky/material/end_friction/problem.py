"""End friction of a compression test, and the law whose simulated test is fitted to it."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.interpolate import PchipInterpolator

from explicit.materials import MarlowLaw
from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray
from kolsky.material.curves.band import CurveBand
from kolsky.material.curves.uniaxial import gaussian_strain
from kolsky.material.end_friction.slow_test import OUTSET, SlowNumerics, SlowTests, slow_tests

LARGEST_FRICTION = 5.0
"""Above, nothing slips any more: choose "bonded" or "rough"."""


@dataclass(frozen=True)
class EndFriction:
    """Contact between specimen and platens in the quasi-static test."""

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


KNOTS = 5
"""Knots of the law that is fitted."""
PLACES = 30
"""Strains at which it is fitted."""
TABLE = 65
"""Entries of its table."""
MODEL_STRESS, MODEL_RADIUS = 5e-3, 1e-3
"""Error of the fit's coarse mesh, relative to stress and radius [-]; weights of the two."""


class FrictionProblem:
    """Residuals of stress, and of the radius if friction is free, over logarithms of the unknowns.

    The unknowns are the law's 2U' [Pa] at `KNOTS` values of s and, if it is free, Coulomb's coefficient.

    Parameters
    ----------
    band
        The apparent nominal stress over nominal compressive strain.
    specimen
        Its undeformed size.
    ends
        What holds it at its ends.
    bulge
        Radius at mid-height at the strains of `band` [m], shape [n], which makes the friction free; None: it
        is declared.
    bulge_sigma
        Standard deviation of that radius [m].
    numerics
        Mesh, duration and Poisson's ratio of the simulated tests.
    """

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
        """True if friction is one of the unknowns, the last of them."""
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
