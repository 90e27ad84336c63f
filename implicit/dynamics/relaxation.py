r"""Relaxation of the whole stress by a Prony series beside the equilibrium one.

With the second Piola-Kirchhoff stress S of the law, whose constants are those of slow loading,

    S_total = S + sum_i h_i,   h_i <- e^(-dt/tau_i) h_i + beta_i e^(-dt/(2 tau_i)) (S - S_before)    (D.3)

(Simo and Hughes 1998, Section 10.3, with beta_i relative to the law's stress). The stress at once is 1 + sum
beta_i times the slow one; volume and shape relax alike.
"""

from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray
from implicit.integration.body import Body, BodyState
from implicit.integration.contraction import element_forces


@dataclass(frozen=True)
class Prony:
    """A Prony series."""

    shares: tuple[float, ...]
    """beta_i, stress at once over the slow one less 1 [-], > 0."""
    times: tuple[float, ...]
    """tau_i [s], > 0."""

    def __post_init__(self) -> None:
        if len(self.shares) != len(self.times) or not self.shares:
            raise ValueError("a Prony series has as many shares as times, at least one")
        if min(self.shares) <= 0.0 or min(self.times) <= 0.0:
            raise ValueError("shares and times of a Prony series must be > 0")


class Relaxing:
    """Forces and stiffness that the series adds to those of a body, step by step."""

    def __init__(self, body: Body, series: Prony, dt: float) -> None:
        model = body.model
        if model.kinematics != "3d" or body.points.mixed:
            raise ValueError('relaxation needs a three-dimensional model with volumetric = "displacement"')
        self.body, self.dt = body, dt
        tau, beta = np.array(series.times), np.array(series.shares)
        self.decay = np.exp(-dt / tau)
        self.gain = beta * np.exp(-0.5 * dt / tau)
        m, g = body.points.shape
        self.stress: FloatArray = np.zeros((m, g, 3, 3))
        self.parts = np.zeros((len(tau), m, g, 3, 3))

    def _deformation(self, u: FloatArray) -> FloatArray:
        model = self.body.model
        at = u.reshape(-1, 3)[model.mesh.cells]
        return np.eye(3) + np.einsum("mki,mgkj->mgij", at, self.body.points.geometry.E, optimize=True)

    def _known(self) -> FloatArray:
        """What of (D.3) the last step left [Pa], shape [m, g, 3, 3]."""
        return np.tensordot(self.decay, self.parts, axes=1) - self.gain.sum() * self.stress

    def forces(self, state: BodyState) -> FloatArray:
        """Forces of each element beside those of the law [N], shape [m, k d]."""
        geometry = self.body.points.geometry
        added = np.matmul(self._deformation(state.u), self._known())
        m, g = geometry.volumes.shape
        weighted = added.reshape(m, g, 9) * geometry.volumes[..., None]
        known = element_forces(geometry.T, weighted).reshape(m, -1)
        return np.asarray(self.gain.sum() * state.points.forces + known)

    def stiffness(self, elastic: FloatArray) -> FloatArray:
        """Their derivative [N/m] from the stiffness of the law alone, shape [m, k d, k d]."""
        E, volumes = self.body.points.geometry.E, self.body.points.geometry.volumes
        weighted = self._known() * volumes[..., None, None]
        scalar = np.einsum("mgai,mgij,mgbj->mab", E, weighted, E, optimize=True)
        m, k = scalar.shape[:2]
        geometric = np.einsum("mab,ij->maibj", scalar, np.eye(3)).reshape(m, 3 * k, 3 * k)
        return np.asarray(self.gain.sum() * elastic + geometric)

    def accept(self, state: BodyState) -> None:
        """Take a state as the end of a step."""
        m, g = self.body.points.shape
        P = state.points.P.reshape(m, g, 3, 3)
        stress = np.asarray(np.linalg.solve(self._deformation(state.u), P), dtype=np.float64)
        change = stress - self.stress
        for i, (decay, gain) in enumerate(zip(self.decay, self.gain, strict=True)):
            self.parts[i] = decay * self.parts[i] + gain * change
        self.stress = stress
