"""End friction of a compression test: declared ends, measured specimen, curve models, the correction."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from explicit.materials import LAWS, AnyLaw, bulk_modulus
from kolsky.base.apparatus import Specimen
from kolsky.base.arrays import FloatArray
from kolsky.material.end_friction.compression import Compression, compress
from kolsky.material.end_friction.cylinder import half_cylinder
from kolsky.material.fits.homogeneous import Mode, incompressible_stress
from kolsky.material.fits.search import Residuals, bounds_of
from kolsky.material.uniaxial import CurveBand, gaussian_strain

Continuation = Literal["tangent", "quadratic", "exponential", "level"]
"""Continuations of 2U' beyond the last node: linear in s, linear in I1 (two terms of Yeoh's law), exponential
in I1 (Fung's), or constant (neo-Hookean)."""
CONTINUATIONS: tuple[Continuation, ...] = get_args(Continuation)


def measure(strain: ArrayLike) -> FloatArray:
    """s = sqrt(I1 - 3) of homogeneous uniaxial compression by a nominal strain [-], shape [...]."""
    e = np.asarray(strain, dtype=float)
    lam = 1.0 - e
    return np.asarray(e * np.sqrt((lam + 2.0) / lam))


@dataclass(frozen=True)
class NodesLaw:
    """W(I1) with ln 2U' as a cubic spline over s = sqrt(I1 - 3), with zero slope at s = 0."""

    nodes: FloatArray
    """Values of s at the nodes, from 0 to the end of the data [-], shape [n]."""
    logs: FloatArray
    """ln(2U' / Pa) at the nodes, shape [n]."""
    continuation: Continuation = "tangent"

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.nodes, self.logs, bc_type=((1, 0.0), "not-a-knot"))

    @property
    def initial_shear_modulus(self) -> float:
        """2U' at rest [Pa]."""
        return float(np.exp(self.logs[0]))

    def two_u_prime(self, s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """2U' and its derivative by s [Pa], shape [...] each."""
        s = np.asarray(s, dtype=float)
        last = self.nodes[-1]
        inside = np.minimum(s, last)
        q = np.exp(self._spline(inside))
        slope = q * self._spline(inside, 1)
        past = s > last
        if self.continuation == "tangent":
            return np.where(past, q + slope * (s - inside), q), slope
        if self.continuation == "quadratic":
            bend = slope / (2.0 * last)
            return np.where(past, q + bend * (s**2 - inside**2), q), np.where(past, 2.0 * bend * s, slope)
        if self.continuation == "level":
            return q, np.where(past, 0.0, slope)
        rate = slope / q / (2.0 * last)
        grown = q * np.exp(rate * (s**2 - inside**2))
        return np.where(past, grown, q), np.where(past, 2.0 * rate * s * grown, slope)

    def strain_energy(self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike) -> FloatArray:
        """W = integral of 2U' s ds [Pa], by Gauss points from rest, shape [...]."""
        s = _measure(lam1, lam2, lam3)
        x, w = np.polynomial.legendre.leggauss(40)
        at = 0.5 * (x + 1.0) * s[..., None]
        return np.asarray(((self.two_u_prime(at)[0] * at) @ (0.5 * w)) * s)

    def principal(
        self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `explicit.materials.law.Stretches`."""
        q, _ = self.two_u_prime(_measure(lam1, lam2, lam3))
        first, second, third = (q * np.asarray(x, dtype=np.float64) for x in (lam1, lam2, lam3))
        return first, second, third

    def hessian(self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike) -> FloatArray:
        """See `explicit.materials.law.Stretches`."""
        lam = np.stack(np.broadcast_arrays(*(np.asarray(x, float) for x in (lam1, lam2, lam3))), axis=-1)
        s = _measure(lam1, lam2, lam3)
        q, slope = self.two_u_prime(s)
        over = np.divide(slope, s, out=np.zeros_like(s), where=s > 1e-9)
        return np.asarray(
            q[..., None, None] * np.eye(3) + over[..., None, None] * lam[..., :, None] * lam[..., None, :]
        )


SMOOTH = 0.3
"""Likely size of the second difference of ln 2U' from node to node, divided by the square of their distance
in s [-]. It is the standard deviation of the smoothness prior. Rubber-like curves have 0 to 1."""


@dataclass(frozen=True)
class NodesModel:
    """2U' at nodes, with a smoothness prior on their second differences."""

    nodes: FloatArray
    """Values of s at the nodes [-], shape [n]."""
    continuation: Continuation = "tangent"
    """Continuation beyond the last node."""

    @property
    def name(self) -> str:
        """ "nodes, tangent"."""
        return f"nodes, {self.continuation}"

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds of the unknowns, shape [n] each: none."""
        return np.full(self.nodes.size, -np.inf), np.full(self.nodes.size, np.inf)

    def law(self, theta: FloatArray) -> NodesLaw:
        """The law of the unknowns ln(2U' / Pa)."""
        return NodesLaw(self.nodes, theta, self.continuation)

    def stress(self, theta: FloatArray, strain: FloatArray) -> FloatArray:
        """Nominal stress of frictionless compression [Pa], compression positive, shape of `strain`."""
        return self.law(theta).two_u_prime(measure(strain))[0] * gaussian_strain(strain, compression=True)

    def prior(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals of the prior, second differences by `SMOOTH` and the distance; their derivatives."""
        h = self.nodes[1] - self.nodes[0]
        second = np.diff(np.eye(theta.size), 2, axis=0) / (SMOOTH * h**0.5)
        return second @ theta, second


@dataclass(frozen=True)
class LibraryModel:
    """A law of the library; the members are those of `NodesModel`."""

    name: str
    residuals: Residuals
    """The law with its fixed constants. The moduli are in units of the largest stress."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free constants."""
        return tuple(spec.name for spec in self.residuals.free)

    @property
    def units(self) -> FloatArray:
        """SI per unit of the unknowns, shape [n]."""
        return self.residuals.units

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Bounds of the unknowns. A modulus may be negative if the law is then still valid."""
        return bounds_of(self.residuals, bounded=False)

    def law(self, theta: FloatArray) -> AnyLaw:
        """The law of the unknowns. Raises ValueError if they give no valid law."""
        return self.residuals.build(theta)

    def stress(self, theta: FloatArray, strain: FloatArray) -> FloatArray:
        """See `NodesModel`."""
        return -incompressible_stress(self.law(theta), Mode.UNIAXIAL, 1.0 - np.asarray(strain))

    def prior(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """No prior."""
        return np.zeros(0), np.zeros((0, theta.size))


CurveModel = NodesModel | LibraryModel
"""A law with unknowns scaled to the order of 1."""


def _measure(lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike) -> FloatArray:
    l1, l2, l3 = (np.asarray(x, dtype=float) for x in (lam1, lam2, lam3))
    return np.sqrt(np.maximum(l1**2 + l2**2 + l3**2 - 3.0, 0.0))


_LARGEST_FRICTION = 5.0
"""Above this coefficient nothing slips. Choose "bonded" or "rough" instead."""
MODEL_STRESS, MODEL_RADIUS = 2e-3, 1e-3
"""Error of the coarse mesh, relative to stress and radius [-]. It is the least standard deviation of a
residual. The side rolls onto the platen point by point, which makes the force uneven by about this amount.
The difference from DOLFINx is 0.27 and 0.31 % (rms) for `ogden2` and `yeoh` with f = 0.3, and 0.10 % for the
bonded `mooney_rivlin`."""
REFINED_STRESS = 1e-3
"""The same error on the refined mesh [-]. The same cylinders differ from DOLFINx by 0.09, 0.11 and 0.07 %
(rms)."""
COMMON_STRESS = 6e-4
"""The part of this error that is common to all strains [-]. Averaging does not reduce it. The mean
differences from DOLFINx's force are -0.05, -0.08 and -0.03 %, 0.06 % in the root mean square."""
DIFFERENCE = 1e-4
"""Change of an unknown for the derivatives of a law's stress. Moduli enter a stress linearly."""


@dataclass(frozen=True)
class EndFriction:
    """Contact between specimen and platens in the quasi-static test."""

    law: Literal["bonded", "rough", "coulomb"]
    """Contact law of faces and side. "bonded" also carries tension, "rough" does not."""
    coefficient: float | None = 0.0
    """Coulomb's coefficient [-]. None: it is fitted to the radius at mid-height. Only for "coulomb"."""
    sigma: float = 0.0
    """Its standard uncertainty, if declared [-]."""

    def __post_init__(self) -> None:
        f = self.coefficient
        if self.law not in ("bonded", "rough", "coulomb"):
            raise ValueError(f"the ends are 'bonded', 'rough' or 'coulomb', got {self.law!r}")
        if f is not None and not 0.0 <= f <= _LARGEST_FRICTION:
            raise ValueError(
                f"friction must be in [0, {_LARGEST_FRICTION:g}], got {f}; above, choose 'rough'"
            )
        if not 0.0 <= self.sigma < float("inf") or (f is not None and self.sigma > f):
            raise ValueError(f"the friction's sigma must be in [0, friction], got {self.sigma} with {f}")


ASSUMED_POISSON_SIGMA = 5e-4
"""Standard uncertainty of Poisson's ratio if none is declared [-]. With the default of 0.499, k = 2 covers
the usual range of rubbers, 0.498 to 0.49999."""


@dataclass(frozen=True)
class CorrectionNumerics:
    """Numerical choices of a correction."""

    mesh: tuple[int, int] = (8, 7)
    """Elements in the fits across the radius and along the half length, biquadratic."""
    refined_mesh: tuple[int, int] = (12, 10)
    poisson: float = 0.499
    """Poisson's ratio at rest [-]; that of the shot for which the curve is used."""
    poisson_sigma: float = 0.0
    """Its standard uncertainty [-], included by `fit_specimen`."""
    places: int = 25
    """Largest number of strains at which the test is compared."""

    def __post_init__(self) -> None:
        if not (self.refined_mesh[0] > self.mesh[0] and self.refined_mesh[1] > self.mesh[1]):
            raise ValueError(f"the refined mesh {self.refined_mesh} must be finer than {self.mesh}")
        if not 0.0 <= self.poisson < 0.5:
            raise ValueError(f"Poisson's ratio must be in [0, 0.5), got {self.poisson}")
        if not 0.0 <= self.poisson_sigma < 0.5 - self.poisson:
            raise ValueError(
                f"poisson_sigma must be in [0, 0.5 - {self.poisson:g}), got {self.poisson_sigma:g}"
            )


LARGEST_NUMBER = 1e5
"""Dimensionless constant above which its term in the law is negligible [-]. With Gent's Jm, the law stiffens
by (I1 - 3)/Jm. At 70 % strain this is a thousandth of a permille, which no test can detect."""
_NUMBERS = {spec.name for law in LAWS.values() for spec in law.PARAMETERS if spec.unit == "1"}


@dataclass(frozen=True)
class ModelFit:
    """A law fitted by its simulated test to the measured one."""

    name: str
    """The law, or the nodes with their continuation."""
    constants: dict[str, float]
    """Constants of the law by name, in SI units. For nodes, 2U' [Pa] by their values of s."""
    sigma: dict[str, float]
    """Their standard uncertainties from the noise, in the same form."""
    correlation: FloatArray
    """Correlation of the constants, shape [n, n]."""
    stress: FloatArray
    """Nominal stress in frictionless compression at the strains of the band [Pa], shape [n]."""
    misfit: float
    """Root mean square of (simulated over measured stress) minus 1 [-]."""
    bic: float
    weight: float
    """Weight in the average of the laws [-]."""
    reason: str = ""
    """Reason why it has no weight; None if it has a weight."""
    remark: str = ""

    @property
    def not_determined(self) -> tuple[str, ...]:
        """Constants with a k = 2 interval that includes zero, or with a negligible term."""
        return tuple(
            name
            for name, value in self.constants.items()
            if abs(value) <= 2.0 * self.sigma[name]
            or (name in _NUMBERS and not -LARGEST_NUMBER < value < LARGEST_NUMBER)
        )

    @classmethod
    def without(cls, name: str, reason: str) -> "ModelFit":
        """A law that could not be fitted."""
        none = np.zeros(0)
        return cls(name, {}, {}, np.zeros((0, 0)), none, np.inf, np.inf, 0.0, reason)


@dataclass(frozen=True)
class FrictionCorrection:
    """The material's curve, with the details of the correction."""

    band: CurveBand
    """Corrected curve with its modes: those of the tests, "noise", "friction", "mesh", "elements", "law"."""
    ratio: FloatArray
    """Apparent nominal stress divided by the true one [-], shape [n]."""
    coefficient: float | None
    """Coulomb's coefficient, declared or fitted [-]; None for "bonded" and "rough"."""
    sigma: float
    """Its standard uncertainty [-]."""
    misfit: float
    """Misfit of the law with the greatest weight [-]."""
    models: tuple[ModelFit, ...]
    """All fitted laws, the greatest weight first."""
    past_data: float
    """Share of the specimen that was strained past the end of the curve [-]."""
    snaps: int = 0
    """Jumps to another equilibrium in the simulated test."""
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class MeasuredSpecimen:
    """A measured test of one specimen, and its simulation with any law."""

    strain: FloatArray
    """Strains of the comparison [-], shape [n]."""
    stress: FloatArray
    """Nominal stress at these strains [Pa], shape [n]."""
    noise: FloatArray
    """Relative standard deviation of the stress with the mesh error [-], shape [n]."""
    specimen: Specimen
    ends: EndFriction
    numerics: CorrectionNumerics
    bulge: FloatArray | None = None
    """Radius at mid-height [m], shape [n]; None if it was not measured."""
    bulge_scale: float = 1.0
    """Standard deviation of the radius with the mesh error [m]."""

    @property
    def free(self) -> bool:
        """True if the friction is one of the unknowns. It is the last one, as its logarithm."""
        return self.ends.law == "coulomb" and self.ends.coefficient is None

    def friction(self, theta: FloatArray) -> float:
        """Coulomb's coefficient [-]; infinity if nothing slips."""
        if self.ends.law != "coulomb":
            return float("inf")
        return float(np.exp(theta[-1])) if self.ends.coefficient is None else self.ends.coefficient

    def own(self, theta: FloatArray) -> FloatArray:
        """The unknowns of the law without the friction."""
        return theta[:-1] if self.free else theta

    def simulate(
        self, model: CurveModel, theta: FloatArray, *, refined: bool = False, derivatives: bool = True
    ) -> Compression:
        """The test with a law, and its derivatives by the unknowns and, under Coulomb's law, the coefficient.

        Raises ValueError if the unknowns give no valid law, or if there is no equilibrium.
        """
        x, n = self.own(theta), self.numerics
        law = model.law(x)
        steps = np.full(x.size if derivatives else 0, DIFFERENCE)
        moved = [model.law(x + DIFFERENCE * row) for row in np.eye(x.size)[: steps.size]]
        shear = float(law.initial_shear_modulus)
        mesh = n.refined_mesh if refined else n.mesh
        return compress(
            [law, *moved],
            half_cylinder(self.specimen.radius, 0.5 * self.specimen.length, *mesh),
            self.strain,
            bulk=float(bulk_modulus(shear, n.poisson)),
            modulus=shear,
            steps=steps,
            bonded=self.ends.law == "bonded",
            friction=self.friction(theta),
            by_friction=derivatives and self.ends.law == "coulomb",
        )

    def refined(self, left: FloatArray) -> "MeasuredSpecimen":
        """The test with the refined mesh's error in its noise: `REFINED_STRESS`, and `left` [-]."""
        own = self.noise**2 - MODEL_STRESS**2
        return replace(self, noise=np.sqrt(own + REFINED_STRESS**2 + left**2))

    def residual(self, made: Compression) -> FloatArray:
        """Residuals of stress and, if measured, of radius [-], shape [n or 2 n]."""
        rows = [np.log(made.stress / self.stress) / self.noise]
        if self.bulge is not None:
            rows.append((made.bulge - self.bulge) / self.bulge_scale)
        return np.concatenate(rows)

    def moved(self, gain: FloatArray, made: Compression, other: Compression) -> FloatArray:
        """Change of the unknowns if the simulated test becomes another one [-], shape [n_unknowns].

        ``gain``: change of the unknowns by a change of the residuals' data, `ModelOptimum.gain`.
        """
        rows = self.residual(other) - self.residual(made)
        return np.asarray(-gain[:, : rows.size] @ rows)

    def jacobian(self, made: Compression, theta: FloatArray) -> FloatArray:
        """Their derivatives by all unknowns, shape [n or 2 n, n_unknowns]."""
        rows = [made.stress_by / made.stress[:, None] / self.noise[:, None]]
        if self.bulge is not None:
            rows.append(made.bulge_by / self.bulge_scale)
        found = np.vstack(rows)[:, : theta.size]
        if self.free:
            found[:, -1] *= self.friction(theta)  # by its logarithm
        return found
