r"""Isochoric stress and tangent of any law in the principal axes, in NumPy.

With the isochoric stretches lam_bar_i = J^(-1/3) lam_i and w_i = lam_bar_i dW/dlam_bar_i,

    tau_i = w_i - (w_1 + w_2 + w_3) / 3,                                                       (L.1)
    dtau_i / dln lam_j = P_ik H_kl P_lj,   H_kl = lam_k lam_l W_kl + w_k delta_kl,   P = 1 - 1 1^T / 3,  (L.2)

from which everything that asks for a stiffness follows: the tangent in simple shear, Drucker's criterion,
the stable step (Ogden 1984; Simo and Taylor 1991).
"""

import numpy as np
from numpy.typing import ArrayLike

from explicit.arrays import FloatArray
from explicit.materials.law import Stretches


def isochoric(stretch: ArrayLike) -> FloatArray:
    """Stretches divided by J^(1/3), shape [..., 3]."""
    lam = np.asarray(stretch, dtype=float)
    return np.asarray(lam / np.cbrt(lam.prod(axis=-1))[..., None])


def kirchhoff(law: Stretches, stretch: ArrayLike) -> FloatArray:
    """Isochoric Kirchhoff stress, Eq. (L.1).

    Parameters
    ----------
    law
        A closed-form law.
    stretch : array
        Principal stretches [-], of any volume, shape [..., 3].

    Returns
    -------
    array
        Principal stresses tau_i [Pa], of sum 0, shape [..., 3].
    """
    w = _logarithmic_slope(law, isochoric(stretch))
    return np.asarray(w - w.mean(axis=-1, keepdims=True))


def tangent(law: Stretches, stretch: ArrayLike) -> FloatArray:
    """Derivative of the isochoric Kirchhoff stress by the logarithms of the stretches, Eq. (L.2) [Pa],
    shape [..., 3, 3]; the stretches have shape [..., 3]."""
    lam = isochoric(stretch)
    H = law.hessian(lam[..., 0], lam[..., 1], lam[..., 2]) * lam[..., :, None] * lam[..., None, :]
    H = H + np.eye(3) * _logarithmic_slope(law, lam)[..., None]
    P = np.eye(3) - 1.0 / 3.0
    return np.asarray(P @ H @ P)


def largest_curvature(law: Stretches, stretch: ArrayLike) -> FloatArray:
    """The most that the second variation of W can be of |L|^2 along F + eps L F [Pa], shape [...].

    Exact: the larger of the greatest eigenvalues of its blocks, one of the stretches and three of shear. The
    kernels' tangent bounds it for the stable step. The stretches, of shape [..., 3], must differ.
    """
    lam = isochoric(stretch)
    square, tau = lam**2, kirchhoff(law, lam)
    block = tangent(law, lam) - np.eye(3) * tau[..., None]
    most = [np.linalg.eigvalsh(block)[..., -1]]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        G = (tau[..., i] - tau[..., j]) / (square[..., i] - square[..., j])
        mean, apart = 0.5 * G * (square[..., i] + square[..., j]), 0.5 * G * (square[..., i] - square[..., j])
        most.append(mean + np.hypot(apart, G * square[..., j] - tau[..., j]))
    return np.asarray(np.max(most, axis=0))


def _logarithmic_slope(law: Stretches, lam: FloatArray) -> FloatArray:
    return np.stack(law.principal(lam[..., 0], lam[..., 1], lam[..., 2]), axis=-1) * lam
