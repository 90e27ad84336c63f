"""The two families of laws, W(I1_bar, I2_bar) and W = sum_i w(lam_i), with their Warp functions.

With the isochoric left Cauchy-Green tensor b (det b = 1), I1 = tr b and I2 = tr b^-1, a law of the
invariants has

    tau = 2 W_1 dev b - 2 W_2 dev b^-1,                                                        (L.3)

and in principal stretches dW/dlam_i = 2 lam_i (W_1 + W_2 (I1 - lam_i^2)), with I2 = lam1^2 lam2^2 + lam2^2
lam3^2 + lam3^2 lam1^2. For the stable step its second variation along straight lines F + eps L F has, in the
axes of b, a block for the stretches and one for the shear in the plane:

    N_ij = dtau_i / dln lam_j - tau_i delta_ij,     [G b_2, G b_2 - tau_2; G b_2 - tau_2, G b_1],     (L.8)

with G = (tau_1 - tau_2) / (b_1 - b_2) = 2 (W_1 + b_3 W_2). The bound is the larger of their largest
eigenvalues (Ogden 1984, section 6.1). The eigenvalue of the plane's block is exact. The rows of N + c 1 1^T,
c >= 0, bound that of N.

For a law of the stretches (Valanis and Landel 1967) let t(b) = lam w'(lam) at b = lam^2, and b_1, b_2 the
eigenvalues in the plane. Its stress is

    (t(b_1) + t(b_2)) / 2 1 + (t(b_1) - t(b_2)) / (b_1 - b_2) (b - (b_1 + b_2) / 2 1),             (L.7)

minus the mean. It needs no eigenvectors. The quotient is smooth where both eigenvalues are equal.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from explicit.materials.law import ClosedFormLaw
from explicit.precision import Precision


@dataclass(frozen=True)
class CurvatureFunctions:
    """Warp functions for the bound of a law's tangent."""

    in_plane: Any
    """``in_plane(rr, yy, ry, tt) -> (b_1, b_2)``: eigenvalues of the isochoric tensor in the plane [-]."""
    largest: Any
    """``largest((n11, n22, n33, G), n12, n13, n23, b_1, b_2, tau_2)``: the bound of Eq. (L.8) [Pa]."""
    as_tangent: Any
    """``as_tangent(largest, rr, yy, ry, tt)``: the shear modulus that gives this bound in an element [Pa]."""


@cache
def curvature_functions(precision: Precision) -> CurvatureFunctions:
    """Generate the functions."""
    real, vec4 = precision.real, precision.vec4
    zero, half, one, two, third = real(0.0), real(0.5), real(1.0), real(2.0), real(1.0 / 3.0)
    two_thirds = real(2.0 / 3.0)
    # The derivative of the root stays finite where both eigenvalues are equal.
    tiny = real(1e-300 if precision.name == "fp64" else 1e-36)

    @wp.func
    def in_plane(rr: real, yy: real, ry: real, tt: real):
        apart = half * (rr - yy)
        larger = half * (rr + yy) + wp.sqrt(apart * apart + ry * ry + tiny)
        return larger, one / (larger * tt)  # det b = 1, without the difference of the root

    @wp.func
    def largest(diagonal: vec4, n12: real, n13: real, n23: real, b1: real, b2: real, tau2: real):
        shift = wp.max(-(n12 + n13 + n23) * third, zero)
        s12, s13, s23 = wp.abs(n12 + shift), wp.abs(n13 + shift), wp.abs(n23 + shift)
        rows = wp.max(diagonal[0] + s12 + s13, diagonal[1] + s12 + s23)
        rows = wp.max(rows, diagonal[2] + s13 + s23) + shift
        apart, cross = half * diagonal[3] * (b1 - b2), diagonal[3] * b2 - tau2
        shear = half * diagonal[3] * (b1 + b2) + wp.sqrt(apart * apart + cross * cross)
        return wp.max(wp.max(rows, shear), zero)

    @wp.func
    def as_tangent(most: real, rr: real, yy: real, ry: real, tt: real):
        # Elements take twice the tangent, or the multiple of `explicit.elements.base.shear_bound`.
        mean = (rr + yy + tt) * third
        drr, dyy, dtt = rr - mean, yy - mean, tt - mean
        squared = drr * drr + dyy * dyy + dtt * dtt + two * ry * ry
        top = wp.max(wp.max(rr, yy) + wp.abs(ry), tt)
        return most / wp.min(one + (mean + two_thirds * squared / mean) / top, two)

    return CurvatureFunctions(in_plane, largest, as_tangent)


@cache
def invariant_kernel_functions(law: type, precision: Precision) -> tuple[Any, Any, Any]:
    """Generate ``(stress, tangent, energy)`` of a class with ``invariant_functions``; see
    `explicit.materials.law.MaterialLaw.kernel_functions`."""
    slopes, curvatures, stored = law.invariant_functions(precision)  # type: ignore[attr-defined]
    real, vec4 = precision.real, precision.vec4
    zero, one, two, three, four = real(0.0), real(1.0), real(2.0), real(3.0), real(4.0)
    third, ninth, ten_ninths, fifteen = real(1.0 / 3.0), real(1.0 / 9.0), real(10.0 / 9.0), real(15.0)
    shared = curvature_functions(precision)
    in_plane, as_tangent, largest_of = shared.in_plane, shared.as_tangent, shared.largest

    @wp.func
    def first_stress(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        mean = (rr + yy + tt) * third
        W1, _W2 = slopes(three * (mean - one), zero, row)
        q = two * W1
        return vec4(q * (rr - mean), q * (yy - mean), q * ry, q * (tt - mean))

    @wp.func
    def both_stress(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        mean = (rr + yy + tt) * third
        # The inverse of a tensor of determinant 1 is that of its cofactors.
        irr, iyy, iry, itt = yy * tt, rr * tt, -ry * tt, rr * yy - ry * ry
        inverse_mean = (irr + iyy + itt) * third
        W1, W2 = slopes(three * (mean - one), three * (inverse_mean - one), row)
        p, q = two * W1, two * W2
        return vec4(
            p * (rr - mean) - q * (irr - inverse_mean),
            p * (yy - mean) - q * (iyy - inverse_mean),
            p * ry - q * iry,
            p * (tt - mean) - q * (itt - inverse_mean),
        )

    @wp.func
    def tangent(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        b1, b2 = in_plane(rr, yy, ry, tt)
        b3 = tt
        i1, i2, i3 = b2 * b3, b1 * b3, b1 * b2
        first, second = b1 + b2 + b3, i1 + i2 + i3
        W1, W2 = slopes(first - three, second - three, row)
        W11, W12, W22 = curvatures(first - three, second - three, row)
        p1, p2, p3 = b1 - first * third, b2 - first * third, b3 - first * third
        q1, q2, q3 = i1 - second * third, i2 - second * third, i3 - second * third
        # d tau / d ln lam of Eq. (L.3) less tau on the diagonal.
        n11 = W1 * (ten_ninths * first - two * third * b1) + W2 * (two * ninth) * (fifteen * i1 - second)
        n22 = W1 * (ten_ninths * first - two * third * b2) + W2 * (two * ninth) * (fifteen * i2 - second)
        n33 = W1 * (ten_ninths * first - two * third * b3) + W2 * (two * ninth) * (fifteen * i3 - second)
        n11 += four * (W11 * p1 * p1 - two * W12 * p1 * q1 + W22 * q1 * q1)
        n22 += four * (W11 * p2 * p2 - two * W12 * p2 * q2 + W22 * q2 * q2)
        n33 += four * (W11 * p3 * p3 - two * W12 * p3 * q3 + W22 * q3 * q3)
        f1, f2 = two * ninth * first, two * ninth * second
        n12 = four * (W1 * (b3 * third - f1) + W2 * (i3 * third - f2))
        n13 = four * (W1 * (b2 * third - f1) + W2 * (i2 * third - f2))
        n23 = four * (W1 * (b1 * third - f1) + W2 * (i1 * third - f2))
        n12 += four * (W11 * p1 * p2 - W12 * (p1 * q2 + q1 * p2) + W22 * q1 * q2)
        n13 += four * (W11 * p1 * p3 - W12 * (p1 * q3 + q1 * p3) + W22 * q1 * q3)
        n23 += four * (W11 * p2 * p3 - W12 * (p2 * q3 + q2 * p3) + W22 * q2 * q3)
        shear = two * (W1 + b3 * W2)
        tau2 = two * (W1 * p2 - W2 * q2)
        most = largest_of(vec4(n11, n22, n33, shear), n12, n13, n23, b1, b2, tau2)
        return as_tangent(most, rr, yy, ry, tt)

    @wp.func
    def energy(rr: real, yy: real, ry: real, tt: real, row: wp.array(dtype=real)):
        second = (rr + yy) * tt + (rr * yy - ry * ry)
        return stored(rr + yy + tt - three, second - three, row)

    return (both_stress if law.uses_second_invariant() else first_stress), tangent, energy  # type: ignore[attr-defined]


class InvariantLaw(ClosedFormLaw):
    """A law given by W(I1_bar, I2_bar) and its first and second derivatives."""

    def W(self, I1: ArrayLike, I2: ArrayLike) -> FloatArray:
        """Strain energy per reference volume [Pa], shape [...]."""
        raise NotImplementedError

    def dW_dI(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """(W_1, W_2): derivatives by the invariants [Pa], each of shape [...]."""
        raise NotImplementedError

    def d2W_dI2(self, I1: ArrayLike, I2: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(W_11, W_12, W_22): second derivatives [Pa], each of shape [...]."""
        raise NotImplementedError

    @staticmethod
    def invariant_functions(precision: Precision) -> tuple[Any, Any, Any]:
        """The Warp functions ``(slopes, curvatures, energy)``: `dW_dI`, `d2W_dI2` and `W`, each of
        ``(I1_bar - 3, I2_bar - 3, row)``."""
        raise NotImplementedError

    @classmethod
    def uses_second_invariant(cls) -> bool:
        """True if W depends on I2_bar; if not, the kernels omit it.

        W is compared at two values of I2_bar, and dW/dI2 with 0. Constants that are 0 in the law's example
        are 1 here, because they may be factors of I2_bar.
        """
        law = cls.of([spec.example or min(1.0, spec.upper) for spec in cls.PARAMETERS])
        constant = law.W(3.1, 3.05) == law.W(3.1, 3.15)
        return not (constant and all(law.dW_dI(3.1, I2)[1] == 0.0 for I2 in (3.05, 3.15)))

    @classmethod
    def kernel_functions(cls, precision: Precision) -> tuple[Any, Any, Any]:
        law: Any = cls  # a class is hashable, although the type checker may not accept its metaclass
        return invariant_kernel_functions(law, precision)

    @property
    def shear_modulus(self) -> float:
        """mu_0 = 2 (W_1 + W_2) at rest [Pa]."""
        first, second = self.dW_dI(3.0, 3.0)
        return float(2.0 * (first + second))

    # ---- principal stretches -------------------------------------------------------------------------

    def strain_energy(self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike) -> FloatArray:
        _, I1, I2 = _invariants(lam1, lam2, lam3)
        return self.W(I1, I2)

    def principal(
        self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        lam, I1, I2 = _invariants(lam1, lam2, lam3)
        W1, W2 = self.dW_dI(I1, I2)
        slope = 2.0 * lam * (W1[..., None] + W2[..., None] * (I1[..., None] - lam**2))
        return slope[..., 0], slope[..., 1], slope[..., 2]

    def hessian(self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike) -> FloatArray:
        lam, I1, I2 = _invariants(lam1, lam2, lam3)
        W1, W2 = (x[..., None, None] for x in self.dW_dI(I1, I2))
        W11, W12, W22 = (x[..., None, None] for x in self.d2W_dI2(I1, I2))
        first = 2.0 * lam  # dI1/dlam
        second = 2.0 * lam * (I1[..., None] - lam**2)  # dI2/dlam
        aa, ab = first[..., :, None] * first[..., None, :], first[..., :, None] * second[..., None, :]
        bb = second[..., :, None] * second[..., None, :]
        product = 4.0 * lam[..., :, None] * lam[..., None, :]
        diagonal = np.eye(3) * (2.0 * (W1 + W2 * (I1[..., None] - lam**2)[..., None]))
        off = product * (1.0 - np.eye(3)) * W2
        return diagonal + off + W11 * aa + W12 * (ab + np.swapaxes(ab, -1, -2)) + W22 * bb

    # ---- tensors (rr, yy, ry, tt) --------------------------------------------------------------------

    def stress(self, b_bar: FloatArray) -> FloatArray:
        """Isochoric Kirchhoff stress (rr, yy, ry, tt) of b_bar, Eq. (L.3) [Pa], shape [..., 4]."""
        inverse = _inverse(b_bar)
        I1, I2 = _trace(b_bar), _trace(inverse)
        W1, W2 = self.dW_dI(I1, I2)
        return 2.0 * (W1[..., None] * deviator(b_bar) - W2[..., None] * deviator(inverse))

    def energy(self, b_bar: FloatArray) -> FloatArray:
        """W [Pa] of b_bar (rr, yy, ry, tt), shape [...]."""
        return self.W(_trace(b_bar), _trace(_inverse(b_bar)))


def _invariants(
    lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    lam = np.stack(np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in (lam1, lam2, lam3))), axis=-1)
    square = lam**2
    I1 = square.sum(axis=-1)
    I2 = square[..., 0] * square[..., 1] + square[..., 1] * square[..., 2] + square[..., 2] * square[..., 0]
    return lam, I1, I2


def _trace(tensor: FloatArray) -> FloatArray:
    """Trace of (rr, yy, ry, tt), shape [...]."""
    return np.asarray(tensor[..., 0] + tensor[..., 1] + tensor[..., 3])


def deviator(tensor: FloatArray) -> FloatArray:
    """Deviator of (rr, yy, ry, tt), shape [..., 4]."""
    return np.asarray(tensor - _trace(tensor)[..., None] / 3.0 * np.array([1.0, 1.0, 0.0, 1.0]))


def _inverse(b_bar: FloatArray) -> FloatArray:
    """Inverse of (rr, yy, ry, tt) with determinant 1, by its cofactors, shape [..., 4]."""
    rr, yy, ry, tt = np.moveaxis(np.asarray(b_bar, dtype=float), -1, 0)
    return np.stack([yy * tt, rr * tt, -ry * tt, rr * yy - ry * ry], axis=-1)


class StretchLaw(ClosedFormLaw):
    """A law given by w(lam) and its derivatives."""

    def w(self, lam: FloatArray) -> FloatArray:
        """Energy of one stretch, 0 at 1 [Pa], shape [...]."""
        raise NotImplementedError

    def dw(self, lam: FloatArray) -> FloatArray:
        """Its derivative [Pa], shape [...]."""
        raise NotImplementedError

    def d2w(self, lam: FloatArray) -> FloatArray:
        """Its second derivative [Pa], shape [...]."""
        raise NotImplementedError

    def quotient(self, b1: FloatArray, b2: FloatArray) -> FloatArray:
        """(t(b_1) - t(b_2)) / (b_1 - b_2) with t = lam w'(lam), lam^2 = b [Pa], shape [...]."""
        raise NotImplementedError

    @classmethod
    def kernel_functions(cls, precision: Precision) -> tuple[Any, Any, Any]:
        raise NotImplementedError

    @classmethod
    def stretch_functions(cls, precision: Precision) -> tuple[Any, Any]:
        """The Warp functions ``(slopes, energy)`` of ``(ln b, row)`` with b = lam^2: the pair t = lam w'(lam)
        and dt/dln lam, and w."""
        raise NotImplementedError

    @property
    def shear_modulus(self) -> float:
        """mu_0 = (w''(1) + w'(1)) / 2 [Pa]."""
        one = np.ones(1)
        return float((self.d2w(one) + self.dw(one))[0] / 2.0)

    # ---- principal stretches -------------------------------------------------------------------------

    def strain_energy(self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike) -> FloatArray:
        lam1, lam2, lam3 = _arrays(lam1, lam2, lam3)
        return self.w(lam1) + self.w(lam2) + self.w(lam3)

    def principal(
        self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        lam1, lam2, lam3 = _arrays(lam1, lam2, lam3)
        return self.dw(lam1), self.dw(lam2), self.dw(lam3)

    def hessian(self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike) -> FloatArray:
        lam = np.stack(_arrays(lam1, lam2, lam3), axis=-1)
        return np.asarray(np.eye(3) * self.d2w(lam)[..., None])

    # ---- tensors (rr, yy, ry, tt) --------------------------------------------------------------------

    def stress(self, b_bar: FloatArray) -> FloatArray:
        """Isochoric Kirchhoff stress (rr, yy, ry, tt) of b_bar, Eq. (L.7) [Pa], shape [..., 4]."""
        rr, yy, ry, tt = np.moveaxis(np.asarray(b_bar, dtype=float), -1, 0)
        b1, b2 = _in_plane(rr, yy, ry, tt)
        half = 0.5 * (self._t(b1) + self._t(b2))
        G, middle = self.quotient(b1, b2), 0.5 * (rr + yy)
        whole = np.stack([half + G * (rr - middle), half + G * (yy - middle), G * ry, self._t(tt)], axis=-1)
        return deviator(whole)

    def energy(self, b_bar: FloatArray) -> FloatArray:
        """W [Pa] of b_bar (rr, yy, ry, tt), shape [...]."""
        rr, yy, ry, tt = np.moveaxis(np.asarray(b_bar, dtype=float), -1, 0)
        b1, b2 = _in_plane(rr, yy, ry, tt)
        return np.asarray(self.w(np.sqrt(b1)) + self.w(np.sqrt(b2)) + self.w(np.sqrt(tt)))

    def _t(self, b: FloatArray) -> FloatArray:
        lam = np.sqrt(b)
        return np.asarray(lam * self.dw(lam))


def _in_plane(
    rr: FloatArray, yy: FloatArray, ry: FloatArray, tt: FloatArray
) -> tuple[FloatArray, FloatArray]:
    larger = 0.5 * (rr + yy) + np.hypot(0.5 * (rr - yy), ry)
    return larger, 1.0 / (larger * tt)  # det b = 1


def _arrays(*values: ArrayLike) -> tuple[FloatArray, ...]:
    return tuple(np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in values)))
