r"""Marlow's law: a first-invariant energy that reproduces one uniaxial curve exactly.

W = U(I1_bar). At equal I1_bar the uniaxial stretch lam of the curve's own branch solves
I1_bar = lam^2 + 2 / lam, and 2 U'(I1_bar) = T(lam) / (lam - lam^-2) with the nominal stress T
(Marlow 2003). In s = sqrt(I1_bar - 3), which is proportional to strain at the origin, the quotient is smooth.
Its limit at s = 0 is E_0 / 3. The neighbouring data give this limit, because the quotient itself is 0 / 0.

Between the data the quotient is interpolated by the monotone (shape-preserving) cubic of Fritsch and
Carlson in s. Beyond the last datum it continues on its last tangent, so stress and stiffness are continuous.
The solver reports the share of the specimen that was strained beyond the data.
"""

from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np
import warp as wp
from scipy.interpolate import PchipInterpolator

from explicit.arrays import FloatArray
from explicit.layout.structs import four_function
from explicit.precision import Precision

ORIGIN_RANGE = 0.3
"""Data with s below this value (about 16 % strain) determine the limit at the origin."""

_HEADER = 4


@dataclass(frozen=True)
class MarlowLaw:
    """Marlow's law tabulated at equal steps of s = sqrt(I1_bar - 3)."""

    last: float
    """Largest s of the data [-]."""
    quotient: FloatArray
    """2 U' at equal steps of s from 0 to `last` [Pa], shape [n_knots]."""
    slope: FloatArray
    """Its derivative with respect to s [Pa], shape [n_knots]."""

    @property
    def initial_shear_modulus(self) -> float:
        """mu_0 = 2 U'(3) = E_0 / 3 [Pa]."""
        return float(self.quotient[0])

    @property
    def data_limit(self) -> float:
        """Largest s of the curve [-]."""
        return self.last

    @property
    def step(self) -> float:
        """Distance of the knots in s [-]."""
        return self.last / (len(self.quotient) - 1)

    @cached_property
    def knot_energy(self) -> FloatArray:
        """U at the knots [Pa], shape [n_knots]: the exact integral of 2 U' s ds = U' dI1."""
        points, weights = np.polynomial.legendre.leggauss(3)  # exact: the integrand is of degree 4
        x = 0.5 * (points + 1.0)
        q = _hermite(
            x,
            self.quotient[:-1, None],
            self.quotient[1:, None],
            self.slope[:-1, None] * self.step,
            self.slope[1:, None] * self.step,
        )
        s = (np.arange(len(self.quotient) - 1)[:, None] + x) * self.step
        return np.concatenate([[0.0], np.cumsum((q * s * 0.5 * weights).sum(axis=1) * self.step)])

    @cached_property
    def cubics(self) -> FloatArray:
        """Coefficients of 2 U' as a cubic of the relative position in an interval, constant first [Pa], shape
        [n_knots, 4]. The last row is the straight line beyond the data."""
        q, d = self.quotient, self.slope * self.step
        rise, following = np.append(np.diff(q), d[-1]), np.append(d[1:], d[-1])
        return np.column_stack([q, d, 3.0 * rise - 2.0 * d - following, d + following - 2.0 * rise])

    def parameters(self) -> FloatArray:
        """Kernel row: last, n_intervals, step, 1 / step; `cubics`; U at the knots."""
        header = [self.last, len(self.quotient) - 1.0, self.step, 1.0 / self.step]
        return np.concatenate([header, self.cubics.ravel(), self.knot_energy])

    def two_u_prime(self, s: FloatArray) -> FloatArray:
        """2 U' at s [Pa]: cubic between the knots, on the last tangent beyond the data."""
        s = np.asarray(s, dtype=float)
        inside = np.minimum(s, self.last)
        k = np.minimum((inside / self.step).astype(int), len(self.quotient) - 2)
        x = inside / self.step - k
        q = _hermite(
            x,
            self.quotient[k],
            self.quotient[k + 1],
            self.slope[k] * self.step,
            self.slope[k + 1] * self.step,
        )
        return q + self.slope[-1] * np.maximum(s - self.last, 0.0)

    def stress(self, b_bar: FloatArray) -> FloatArray:
        """Isochoric Kirchhoff stress 2 U' dev b_bar (rr, yy, ry, tt) [Pa], shape [..., 4]."""
        trace = b_bar[..., 0] + b_bar[..., 1] + b_bar[..., 3]
        q = self.two_u_prime(np.sqrt(np.maximum(trace - 3.0, 0.0)))
        deviator = b_bar - trace[..., None] / 3.0 * np.array([1.0, 1.0, 0.0, 1.0])
        return q[..., None] * deviator

    def energy(self, b_bar: FloatArray) -> FloatArray:
        """U(I1_bar) [Pa], shape [...]."""
        trace = b_bar[..., 0] + b_bar[..., 1] + b_bar[..., 3]
        s = np.sqrt(np.maximum(trace - 3.0, 0.0))
        points, weights = np.polynomial.legendre.leggauss(3)
        inside = np.minimum(s, self.last)
        k = np.minimum((inside / self.step).astype(int), len(self.quotient) - 2)
        start = k * self.step
        x = start[..., None] + 0.5 * (points + 1.0) * (inside - start)[..., None]
        partial = (self.two_u_prime(x) * x * 0.5 * weights).sum(axis=-1) * (inside - start)
        past = np.maximum(s - self.last, 0.0)
        tail = self.quotient[-1] * (self.last * past + past**2 / 2) + self.slope[-1] * (
            self.last * past**2 / 2 + past**3 / 3
        )
        return self.knot_energy[k] + partial + tail

    @staticmethod
    def kernel_functions(precision: Precision) -> tuple[Any, Any, Any]:
        """Warp twins of `stress` and `energy`; see `explicit.materials.law.MaterialLaw`."""
        return _kernel_functions(precision)


def marlow_from_curve(stretch: FloatArray, stress: FloatArray, *, n_knots: int = 129) -> MarlowLaw:
    """Build Marlow's law from a uniaxial curve.

    ``stretch``: stretch along the load [-], from one branch: all <= 1 (compression) or all >= 1 (tension).
    ``stress``: nominal stress, tension-positive [Pa]. A point at rest is ignored and replaced by the limit.
    ``n_knots``: knots of the table. Raises ValueError if the curve mixes branches, has fewer than 5 points,
    repeats a stretch, or if stress and strain disagree in sign.
    """
    stretch = np.asarray(stretch, dtype=float)
    stress = np.asarray(stress, dtype=float)
    away = np.abs(stretch - 1.0) > 1e-9
    lam, t = stretch[away], stress[away]
    if len(lam) < 5:
        raise ValueError(f"a Marlow curve needs at least 5 points away from rest, got {len(lam)}")
    if (lam <= 0.0).any():
        raise ValueError(f"stretch must be > 0, got {lam.min()}")
    if (lam > 1.0).any() and (lam < 1.0).any():
        raise ValueError("a Marlow curve is one branch, tension or compression; this one has both")
    if (t * (lam - 1.0) <= 0.0).any():
        bad = int(np.argmax(t * (lam - 1.0) <= 0.0))
        raise ValueError(f"stress {t[bad]:.6g} Pa at stretch {lam[bad]:.6g} has the sign of the other branch")
    # I1 - 3 = (lam - 1)^2 (lam + 2) / lam, without the cancellation of lam^2 + 2 / lam - 3.
    s = np.abs(lam - 1.0) * np.sqrt((lam + 2.0) / lam)
    quotient = t / (lam - lam**-2)
    order = np.argsort(s)
    s, quotient = s[order], quotient[order]
    if (np.diff(s) <= 0.0).any():
        raise ValueError("a stretch is repeated in the curve; average repeats before building the law")
    near = max(5, int((s <= ORIGIN_RANGE).sum()))
    # 2 U' is smooth in I1 - 3 = s^2. Noise in T is relative, so all quotients have the same weight.
    origin = np.polynomial.Polynomial.fit(s[:near] ** 2, quotient[:near], 1)(0.0)
    curve = PchipInterpolator(np.concatenate([[0.0], s]), np.concatenate([[origin], quotient]))
    knots = np.linspace(0.0, s[-1], n_knots)
    return MarlowLaw(last=float(s[-1]), quotient=curve(knots), slope=curve(knots, 1))


def neo_hookean(shear_modulus: float, *, last: float = 4.0) -> MarlowLaw:
    """The neo-Hookean law mu/2 (I1_bar - 3) as the Marlow law of its uniaxial curve."""
    if not shear_modulus > 0.0:
        raise ValueError(f"shear_modulus must be > 0 Pa, got {shear_modulus}")
    return MarlowLaw(last=last, quotient=np.full(3, shear_modulus), slope=np.zeros(3))


def _hermite(x: FloatArray, f0: FloatArray, f1: FloatArray, d0: FloatArray, d1: FloatArray) -> FloatArray:
    return f0 + x * (d0 + x * (3.0 * (f1 - f0) - 2.0 * d0 - d1 + x * (2.0 * (f0 - f1) + d0 + d1)))


def _kernel_functions(precision: Precision) -> tuple[Any, Any, Any]:
    real, vec4 = precision.real, precision.vec4
    zero, half, one, two, three = real(0.0), real(0.5), real(1.0), real(2.0), real(3.0)
    third, tiny = real(1.0 / 3.0), real(1e-3)
    # Three Gauss points on [0, 1] integrate the energy inside one interval exactly.
    g1, g3 = real(0.5 - sqrt(0.15)), real(0.5 + sqrt(0.15))
    w1, w2 = real(5.0 / 18.0), real(8.0 / 18.0)
    header, four = int(_HEADER), four_function(precision)

    @wp.func
    def interval(s: real, row: wp.array(dtype=real)):
        return int(wp.min(s * row[3], row[1]))  # s of a diverging simulation may exceed every integer

    @wp.func
    def cubic(x: real, c: vec4):
        return c[0] + x * (c[1] + x * (c[2] + x * c[3]))

    @wp.func
    def stress(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        mean = (rr + yy + tt) * third
        s = wp.sqrt(wp.max(three * (mean - one), zero))
        k = interval(s, row)
        q = cubic(s * row[3] - real(k), four(row, header + 4 * k))
        return vec4(q * (rr - mean), q * (yy - mean), q * ry, q * (tt - mean))

    @wp.func
    def tangent(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        # 2 U' b_max + 4 U'' |dev b|^2 bounds the tangent along any rank-one motion; 4 U'' = q' / s.
        mean = (rr + yy + tt) * third
        s = wp.sqrt(wp.max(three * (mean - one), zero))
        k = interval(s, row)
        c, x = four(row, header + 4 * k), s * row[3] - real(k)
        slope = (c[1] + x * (two * c[2] + three * x * c[3])) * row[3]
        largest = wp.max(wp.max(rr, yy) + wp.abs(ry), tt)
        drr, dyy, dtt = rr - mean, yy - mean, tt - mean
        squared = drr * drr + dyy * dyy + dtt * dtt + two * ry * ry
        return cubic(x, c) * largest + wp.max(slope, zero) / wp.max(s, tiny) * squared

    @wp.func
    def energy(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        s = wp.sqrt(wp.max(rr + yy + tt - three, zero))
        k = interval(s, row)
        c, x = four(row, header + 4 * k), s * row[3] - real(k)
        # The integral of 2 U' s ds / 2 from the knot to s.
        f1 = w1 * cubic(g1 * x, c) * (real(k) + g1 * x)
        f2 = w2 * cubic(half * x, c) * (real(k) + half * x)
        f3 = w1 * cubic(g3 * x, c) * (real(k) + g3 * x)
        start = row[header + 4 * (int(row[1]) + 1) + k]
        return start + (f1 + f2 + f3) * x * row[2] * row[2]

    return stress, tangent, energy
