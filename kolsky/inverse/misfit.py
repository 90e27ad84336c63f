"""The model against the measurements: Phi_S, Phi_F and Phi of Eqs. (M.3)-(M.8), and chi-square.

(M.n) is equation n of Mates et al. (2012). The paper's cost adds absolute residuals; chi-square weighs each
by its measured noise: the force in bins, the outline point by point. A point's height y is measured too; its
noise enters Z through the slope, sigma_Z,eff^2 = sigma_Z^2 + (dr/dy)^2 sigma_y^2. That term is NOT used:
`CentreLine` carries no sigma_y, and the slope is small except near the platens.
"""

from dataclasses import dataclass

import numpy as np

from kolsky.base.arrays import FloatArray, IntArray
from kolsky.inverse.observations import Observations, Prediction

SCALE_FORCE = 1000.0
"""SF_F of Eq. (M.5) [N]."""
SCALE_SHAPE = 0.001
"""SF_S of Eq. (M.5) [-]."""


@dataclass(frozen=True)
class Terms:
    """The misfit terms of one simulation: Eqs. (M.3)-(M.8) and chi-square.

    Where no outline was measured those that need one are NaN: they are not known.
    """

    phi_shape: float
    """Phi_S, Eq. (M.3) [-]."""
    phi_force: float
    """Phi_F, Eq. (M.4) [N]."""
    phi: float
    """Phi, Eq. (M.5) [-]."""
    sigma_phi_shape: float
    """delta Phi_S, Eq. (M.6) [-]."""
    sigma_phi_force: float
    """delta Phi_F, Eq. (M.7) [N]."""
    sigma_phi: float
    """delta Phi, Eq. (M.8) [-]."""
    chi2_force: float
    """Noise-weighted sum of squares of the force residual [-]."""
    chi2_shape: float
    """Noise-weighted sum of squares of the outline residual [-]."""
    n_force: int
    """Number of force values counted."""
    n_shape: int
    """Number of outline points counted."""
    n_outside: int
    """Number of outline points outside the model's range, not counted."""

    @property
    def chi2(self) -> float:
        """Joint chi-square [-]; the force's where no outline was measured."""
        return self.chi2_force + (self.chi2_shape if self.has_shape else 0.0)

    @property
    def has_shape(self) -> bool:
        """True if an outline was measured."""
        return self.n_shape + self.n_outside > 0


def terms(prediction: Prediction, observations: Observations, i: int) -> Terms:
    """Misfit terms of simulation `i`.

    Phi_S is the mean over frames of the mean over a frame's counted points, Eq. (M.3); a frame without
    a counted point is left out of the mean. Its uncertainty, Eq. (M.6), is Z_FEA sigma_Z / Z_DIC^2 of
    each counted point, averaged in the same way, which like the paper's treats the points' errors as
    common to all: it does not fall with their number. Phi_F is a sum over samples, Eq. (M.4), and
    its uncertainty the sum of their sigmas, P delta F in Eq. (M.7). Chi-square takes the force from the
    bins, with the bins' sigma, and the outline point by point, with sigma_Z.

    Where no outline was measured every term that needs one is NaN, Phi of Eq. (M.5) too: none of them is
    known, and none of them is zero.

    Parameters
    ----------
    prediction, observations
        What the model says and what was measured.
    i : int
        Which simulation of the prediction.

    Raises
    ------
    ValueError
        If no outline point is inside the model's range.
    """
    line, counted = observations.centre_line, prediction.inside[i]
    if observations.has_shape and not counted.any():
        raise ValueError(
            f"none of the {counted.size} outline points lies on the surface of simulation {i}; check y_offset"
            " and the unit of y"
        )
    phi_shape = sigma_shape = chi2_shape = np.nan
    r_force, r_shape, _, _ = residuals(prediction, observations, i)
    if observations.has_shape:
        Z, Z_model, sigma = line.Z[counted], prediction.Z[i, counted], line.sigma[counted]
        frame = line.frame[counted]
        phi_shape = _frame_mean(np.abs(Z_model - Z) / Z, frame)  # Eq. (M.3)
        sigma_shape = _frame_mean(Z_model * sigma / Z**2, frame)  # Eq. (M.6)
        chi2_shape = float(r_shape @ r_shape)
    phi_force = float(np.abs(prediction.force[i] - observations.force.force).sum())  # Eq. (M.4)
    sigma_force = float(observations.force.sigma.sum())  # Eq. (M.7)
    return Terms(
        phi_shape=phi_shape,
        phi_force=phi_force,
        phi=phi_force / SCALE_FORCE + phi_shape / SCALE_SHAPE,  # Eq. (M.5)
        sigma_phi_shape=sigma_shape,
        sigma_phi_force=sigma_force,
        sigma_phi=float(np.hypot(sigma_force / SCALE_FORCE, sigma_shape / SCALE_SHAPE)),  # Eq. (M.8)
        chi2_force=float(r_force @ r_force),
        chi2_shape=chi2_shape,
        n_force=r_force.size,
        n_shape=r_shape.size,
        n_outside=int((~counted).sum()),
    )


def residuals(
    prediction: Prediction, observations: Observations, i: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Model minus measurement over sigma, of simulation `i`.

    Returns
    -------
    force : ndarray
        Residual of each force bin [-], shape [n_bins].
    shape : ndarray
        Residual of each outline point inside the model's range [-], shape [n_counted].
    force_time : ndarray
        Bin centres [s], shape [n_bins].
    shape_time : ndarray
        Frame times of the counted points [s], shape [n_counted].
    """
    line, counted = observations.centre_line, prediction.inside[i]
    force = (prediction.force_bins[i] - observations.force_mean) / observations.force_sigma
    shape = (prediction.Z[i, counted] - line.Z[counted]) / line.sigma[counted]
    return force, shape, observations.force_times, line.time[counted]


def _frame_mean(value: FloatArray, frame: IntArray) -> float:
    """Mean over frames of the mean over each frame's points."""
    _, row, count = np.unique(frame, return_inverse=True, return_counts=True)
    return float(np.mean(np.bincount(row, weights=value) / count))
