"""Strain measures of a surface from its deformation gradient, each with its sigma."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dic.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class Strain:
    """A symmetric tensor in the tangent plane at rest: around the axis (1), along it (2), shear (12)."""

    value: FloatArray
    """Components 11, 22, 12 [-], shape [n_frames, n_points, 3]."""
    sigma: FloatArray
    """Their standard uncertainties [-], same shape."""


@dataclass(frozen=True)
class StrainHistory:
    """The surface's deformation gradient at points and frames, and what follows from it.

    NaN where the outcome is not VALID.
    """

    t: FloatArray
    """Frame times on the shot's clock [s], shape [n_frames]."""
    F: FloatArray
    """Images of the tangent vectors at rest: columns around and along [-], in the test frame's
    components, shape [n_frames, n_points, 3, 2]."""
    basis: FloatArray
    """Unit tangent vectors at rest, columns around (with x) and along (with y), same shape."""
    covariance: FloatArray
    """Of the components 11, 22, 12 of C = FᵀF [-], shape [n_frames, n_points, 3, 3]."""
    outcome: IntArray
    """`dic.surfaces.StrainOutcome`, shape [n_frames, n_points]."""
    share: FloatArray
    """Points used over points of the full window [-], shape [n_frames, n_points]."""
    centre: FloatArray
    """Mean place of the points used beside the point itself, in the material picture [steps], shape
    [n_frames, n_points, 2]; (0, 0) is a centred gauge."""
    gauge: float
    """Side of the virtual strain gauge in the material picture [px]."""

    @property
    def green_lagrange(self) -> Strain:
        """E = (FᵀF - 1)/2."""
        C = self._C()
        value = 0.5 * np.stack([C[..., 0, 0] - 1.0, C[..., 1, 1] - 1.0, C[..., 0, 1]], axis=-1)
        return Strain(value, 0.5 * np.sqrt(np.einsum("...kk->...k", self.covariance)))

    @property
    def hencky(self) -> Strain:
        """H = ½ ln(FᵀF), the logarithmic strain."""
        return self._isotropic(lambda c: 0.5 * np.log(c), lambda c: 0.5 / c)

    @property
    def nominal(self) -> Strain:
        """U - 1 = (FᵀF)^½ - 1, the engineering strain of fibres along the principal directions."""
        return self._isotropic(lambda c: np.sqrt(c) - 1.0, lambda c: 0.5 / np.sqrt(c))

    @property
    def principal_stretch(self) -> tuple[FloatArray, FloatArray]:
        """Stretches [-], the larger first, and their standard uncertainties, [n_frames, n_points, 2]."""
        c, Q = self._principal()
        V = self._turned(Q)
        variance = np.stack([V[..., 0, 0, 0, 0], V[..., 1, 1, 1, 1]], axis=-1)
        return np.sqrt(c), np.sqrt(variance) / (2.0 * np.sqrt(c))

    @property
    def principal_angle(self) -> tuple[FloatArray, FloatArray]:
        """Angle of the larger stretch from around toward along, in (-π/2, π/2] [rad], and its sigma.

        The sigma is first order: where the two stretches are equal within their noise it exceeds a right
        angle, and there is no direction. Shapes [n_frames, n_points].
        """
        c, Q = self._principal()
        angle = np.arctan2(Q[..., 1, 0], Q[..., 0, 0])
        angle = angle - np.pi * np.round(angle / np.pi)
        variance = self._turned(Q)[..., 0, 1, 0, 1]
        with np.errstate(divide="ignore"):
            return angle, np.sqrt(variance) / (c[..., 0] - c[..., 1])

    @property
    def area_ratio(self) -> FloatArray:
        """Area of the surface over its area at rest [-], shape [n_frames, n_points]."""
        return np.sqrt(np.linalg.det(self._C()))

    def _C(self) -> FloatArray:
        return np.asarray(np.swapaxes(self.F, -1, -2) @ self.F)

    def _principal(self) -> tuple[FloatArray, FloatArray]:
        """Eigenvalues of C, the larger first, and eigenvectors as columns; NaN where there is no strain."""
        C = self._C()
        known = np.asarray(np.isfinite(C).all(axis=(-1, -2)))
        c, Q = np.linalg.eigh(np.where(known[..., None, None], C, np.eye(2)))
        c, Q = c[..., ::-1], Q[..., ::-1]
        return np.where(known[..., None], c, np.nan), np.where(known[..., None, None], Q, np.nan)

    def _turned(self, Q: FloatArray) -> FloatArray:
        """Covariance of C in principal axes, shape [..., 2, 2, 2, 2]."""
        pair = np.array([[0, 2], [2, 1]])
        V = self.covariance[..., pair[:, :, None, None], pair[None, None]]
        return np.einsum("...ia,...jb,...kc,...ld,...ijkl->...abcd", Q, Q, Q, Q, V, optimize=True)

    def _isotropic(
        self, f: Callable[[FloatArray], FloatArray], slope: Callable[[FloatArray], FloatArray]
    ) -> Strain:
        """f(C) and its sigma: in principal axes dC_ab goes over with the divided difference f[c_a, c_b]."""
        c, Q = self._principal()
        a, b = c[..., :, None], c[..., None, :]
        near = np.abs(a - b) < 1e-6 * (a + b)
        with np.errstate(divide="ignore", invalid="ignore"):
            divided = np.where(near, slope(0.5 * (a + b)), (f(a) - f(b)) / (a - b))
        value = np.einsum("...ia,...a,...ja->...ij", Q, f(c), Q)
        # The map from C's components to f(C)'s, back in the tangent vectors' axes.
        L = np.einsum("...ia,...jb,...ab,...ka,...lb->...ijkl", Q, Q, divided, Q, Q, optimize=True)
        pair = np.array([[0, 2], [2, 1]])
        V = self.covariance[..., pair[:, :, None, None], pair[None, None]]
        W = np.einsum("...ijkl,...klmn,...ijmn->...ij", L, V, L, optimize=True)
        pick = lambda T: np.stack([T[..., 0, 0], T[..., 1, 1], T[..., 0, 1]], axis=-1)  # noqa: E731
        return Strain(pick(value), np.sqrt(pick(W)))
