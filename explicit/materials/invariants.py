r"""Laws W(I1_bar, I2_bar): everything that follows from the energy and its derivatives by the invariants.

With the isochoric left Cauchy-Green tensor b (det b = 1), I1 = tr b and I2 = tr b^-1,

    tau = 2 W_1 dev b - 2 W_2 dev b^-1,                                                        (L.3)

and in principal stretches dW/dlam_i = 2 lam_i (W_1 + W_2 (I1 - lam_i^2)), which holds for any stretches,
I2 being lam1^2 lam2^2 + lam2^2 lam3^2 + lam3^2 lam1^2 there.
"""

from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from explicit.materials.kernels.invariants import invariant_kernel_functions
from explicit.materials.law import ClosedFormLaw
from explicit.precision import Precision


class InvariantLaw(ClosedFormLaw):
    """A law given by W(I1_bar, I2_bar) and its first and second derivatives."""

    SECOND_INVARIANT: ClassVar[bool] = False
    """Whether W depends on I2_bar; if not, the kernels leave it out."""

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
    def kernel_functions(cls, precision: Precision) -> tuple[Any, Any, Any]:
        """See `explicit.materials.base.MaterialLaw`."""
        law: Any = cls  # a class is hashable, whatever its metaclass is taken for
        return invariant_kernel_functions(law, precision)

    @property
    def shear_modulus(self) -> float:
        """mu_0 = 2 (W_1 + W_2) at rest [Pa]."""
        first, second = self.dW_dI(3.0, 3.0)
        return float(2.0 * (first + second))

    # ---- principal stretches -------------------------------------------------------------------------

    def strain_energy(self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike) -> FloatArray:
        """See `explicit.materials.law.Stretches`."""
        _, I1, I2 = _invariants(lam1, lam2, lam3)
        return self.W(I1, I2)

    def principal(
        self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `explicit.materials.law.Stretches`."""
        lam, I1, I2 = _invariants(lam1, lam2, lam3)
        W1, W2 = self.dW_dI(I1, I2)
        slope = 2.0 * lam * (W1[..., None] + W2[..., None] * (I1[..., None] - lam**2))
        return slope[..., 0], slope[..., 1], slope[..., 2]

    def hessian(self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike) -> FloatArray:
        """See `explicit.materials.law.Stretches`."""
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
        inverse = inverse_of(b_bar)
        I1, I2 = trace_of(b_bar), trace_of(inverse)
        W1, W2 = self.dW_dI(I1, I2)
        return 2.0 * (W1[..., None] * deviator(b_bar) - W2[..., None] * deviator(inverse))

    def energy(self, b_bar: FloatArray) -> FloatArray:
        """W [Pa] of b_bar (rr, yy, ry, tt), shape [...]."""
        return self.W(trace_of(b_bar), trace_of(inverse_of(b_bar)))


def _invariants(
    lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    lam = np.stack(np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in (lam1, lam2, lam3))), axis=-1)
    square = lam**2
    I1 = square.sum(axis=-1)
    I2 = square[..., 0] * square[..., 1] + square[..., 1] * square[..., 2] + square[..., 2] * square[..., 0]
    return lam, I1, I2


def trace_of(tensor: FloatArray) -> FloatArray:
    """Trace of (rr, yy, ry, tt), shape [...]."""
    return np.asarray(tensor[..., 0] + tensor[..., 1] + tensor[..., 3])


def deviator(tensor: FloatArray) -> FloatArray:
    """Deviator of (rr, yy, ry, tt), shape [..., 4]."""
    return np.asarray(tensor - trace_of(tensor)[..., None] / 3.0 * np.array([1.0, 1.0, 0.0, 1.0]))


def inverse_of(b_bar: FloatArray) -> FloatArray:
    """Inverse of (rr, yy, ry, tt) with determinant 1, by its cofactors, shape [..., 4]."""
    rr, yy, ry, tt = np.moveaxis(np.asarray(b_bar, dtype=float), -1, 0)
    return np.stack([yy * tt, rr * tt, -ry * tt, rr * yy - ry * ry], axis=-1)
