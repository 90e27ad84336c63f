"""Curves to be found behind a compression test: a first-invariant law by nodes, or a law of the library.

A barrelled specimen is strained past the homogeneous strain of its last measured point. What a curve of nodes
does there is not measured, so it is continued in several ways; a law of the library continues by its formula.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from explicit.materials.law import Stretches
from kolsky.base.arrays import FloatArray
from kolsky.material.curves.uniaxial import gaussian_strain
from kolsky.material.fits.compare import Candidate
from kolsky.material.fits.homogeneous import incompressible_stress
from kolsky.material.fits.modes import Mode

Continuation = Literal["tangent", "quadratic", "exponential", "level"]
"""Courses of 2U' past the last node: straight in s, straight in I1 (two terms of Yeoh's law), exponential in
I1 (Fung's), constant (neo-Hookean)."""
CONTINUATIONS: tuple[Continuation, ...] = get_args(Continuation)


def measure(strain: ArrayLike) -> FloatArray:
    """s = sqrt(I1 - 3) of homogeneous uniaxial compression by a nominal strain [-], shape [...]."""
    e = np.asarray(strain, dtype=float)
    lam = 1.0 - e
    return np.asarray(e * np.sqrt((lam + 2.0) / lam))


@dataclass(frozen=True)
class NodesLaw:
    """W(I1) with ln 2U' a cubic spline over s = sqrt(I1 - 3), level at s = 0."""

    nodes: FloatArray
    """Places of the nodes in s, from 0 to the end of the data [-], shape [n]."""
    logs: FloatArray
    """ln(2U' / Pa) there, shape [n]."""
    continuation: Continuation = "tangent"
    """Course past the last node."""

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


class CurveModel(Protocol):
    """A law with unknowns that are all of the size of 1."""

    @property
    def name(self) -> str:
        """Name for tables."""
        ...

    @property
    def lower(self) -> FloatArray:
        """Lower bounds of the unknowns, shape [n]."""
        ...

    @property
    def upper(self) -> FloatArray:
        """Upper bounds, shape [n]."""
        ...

    def law(self, theta: FloatArray) -> Stretches:
        """The law of the unknowns; ValueError if they make none."""
        ...

    def stress(self, theta: FloatArray, strain: FloatArray) -> FloatArray:
        """Nominal stress of frictionless compression [Pa], compression positive, shape of `strain`."""
        ...

    def prior(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals of what is held likely before the test, and their derivatives by the unknowns."""
        ...


SMOOTH = 0.3
"""Likely size of the second difference of ln 2U' from node to node over the square of their distance in s
(standard deviation of the smoothness prior) [-]; rubber-like curves have 0 to 1."""


@dataclass(frozen=True)
class NodesModel:
    """2U' at nodes, with a smoothness prior on their second differences."""

    nodes: FloatArray
    """Places of the nodes in s [-], shape [n]."""
    continuation: Continuation = "tangent"
    """Course past the last."""

    @property
    def name(self) -> str:
        """ "nodes, tangent"."""
        return f"nodes, {self.continuation}"

    @property
    def lower(self) -> FloatArray:
        """None."""
        return np.full(self.nodes.size, -np.inf)

    @property
    def upper(self) -> FloatArray:
        """None."""
        return np.full(self.nodes.size, np.inf)

    def law(self, theta: FloatArray) -> NodesLaw:
        """See `CurveModel`; the unknowns are ln(2U' / Pa)."""
        return NodesLaw(self.nodes, theta, self.continuation)

    def stress(self, theta: FloatArray, strain: FloatArray) -> FloatArray:
        """See `CurveModel`."""
        return self.law(theta).two_u_prime(measure(strain))[0] * gaussian_strain(strain, compression=True)

    def prior(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Second differences over `SMOOTH` times the square of the distance."""
        h = self.nodes[1] - self.nodes[0]
        second = np.diff(np.eye(theta.size), 2, axis=0) / (SMOOTH * h**0.5)
        return second @ theta, second


@dataclass(frozen=True)
class LibraryModel:
    """A law of the library; moduli in units of a stress."""

    candidate: Candidate
    """The law, and what is held of it."""
    unit: float
    """That stress [Pa]."""

    @property
    def name(self) -> str:
        """The law's name."""
        return self.candidate.name

    @cached_property
    def _free(self) -> list[int]:
        held = self.candidate.held
        return [k for k, spec in enumerate(self.candidate.law.PARAMETERS) if spec.name not in held]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the free constants."""
        return tuple(self.candidate.law.PARAMETERS[k].name for k in self._free)

    @cached_property
    def units(self) -> FloatArray:
        """SI per unit of the unknowns, shape [n]."""
        specs = self.candidate.law.PARAMETERS
        return np.array([self.unit if specs[k].unit == "Pa" else 1.0 for k in self._free])

    @property
    def lower(self) -> FloatArray:
        """Bounds in which the law exists; a modulus may be negative where that is a law."""
        specs = self.candidate.law.PARAMETERS
        return np.array([specs[k].lower if specs[k].strict else -np.inf for k in self._free]) / self.units

    @property
    def upper(self) -> FloatArray:
        """Likewise."""
        specs = self.candidate.law.PARAMETERS
        return np.array([specs[k].upper if specs[k].strict else np.inf for k in self._free]) / self.units

    def law(self, theta: FloatArray) -> Stretches:
        """See `CurveModel`."""
        specs = self.candidate.law.PARAMETERS
        values = [self.candidate.held.get(spec.name, 0.0) for spec in specs]
        for k, value in zip(self._free, theta * self.units, strict=True):
            values[k] = float(value)
        return self.candidate.law.of(values)

    def unknowns(self, values: dict[str, float]) -> FloatArray:
        """Constants by name [SI] as unknowns."""
        return np.array([values[name] for name in self.names]) / self.units

    def stress(self, theta: FloatArray, strain: FloatArray) -> FloatArray:
        """See `CurveModel`."""
        return -incompressible_stress(self.law(theta), Mode.UNIAXIAL, 1.0 - np.asarray(strain))

    def prior(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """None."""
        return np.zeros(0), np.zeros((0, theta.size))


def _measure(lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike) -> FloatArray:
    l1, l2, l3 = (np.asarray(x, dtype=float) for x in (lam1, lam2, lam3))
    return np.sqrt(np.maximum(l1**2 + l2**2 + l3**2 - 3.0, 0.0))
