r"""Laws W = sum_i w(lam_i) of the principal stretches (Valanis and Landel 1967), such as Ogden's.

The axes of an axisymmetric tensor (rr, yy, ry, tt) are the hoop and two in the plane. With t(b) = lam w'(lam)
at b = lam^2 and the eigenvalues b_1, b_2 in the plane, the stress there is

    (t(b_1) + t(b_2)) / 2 1 + (t(b_1) - t(b_2)) / (b_1 - b_2) (b - (b_1 + b_2) / 2 1),             (L.7)

less the mean, and needs no eigenvectors. The quotient is smooth where both eigenvalues meet.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from explicit.materials.invariants import deviator
from explicit.materials.law import ClosedFormLaw
from explicit.precision import Precision


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
        """See `explicit.materials.base.MaterialLaw`."""
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
        """See `explicit.materials.law.Stretches`."""
        lam1, lam2, lam3 = _arrays(lam1, lam2, lam3)
        return self.w(lam1) + self.w(lam2) + self.w(lam3)

    def principal(
        self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """See `explicit.materials.law.Stretches`."""
        lam1, lam2, lam3 = _arrays(lam1, lam2, lam3)
        return self.dw(lam1), self.dw(lam2), self.dw(lam3)

    def hessian(self, lam1: ArrayLike, lam2: ArrayLike, lam3: ArrayLike) -> FloatArray:
        """See `explicit.materials.law.Stretches`."""
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
