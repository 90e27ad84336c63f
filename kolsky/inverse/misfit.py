"""The model against the measurements: Phi_S, Phi_F and Phi of Eqs. (M.3)-(M.8), and chi-square.

(M.n) is equation n of Mates et al. (2012). The paper's cost adds absolute residuals; chi-square weighs each
by its measured noise: the force in bins, the outline point by point. A point's height y is measured too; its
noise enters Z through the slope, sigma_Z,eff^2 = sigma_Z^2 + (dr/dy)^2 sigma_y^2. That term is NOT used:
`CentreLine` carries no sigma_y, and the slope is small except near the platens.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from explicit import Response
from kolsky.bars.signals.transducers import CAMERA_FRAME, ForceBins, bin_force
from kolsky.base.arrays import BoolArray, FloatArray, IntArray
from kolsky.base.records import CentreLine, ForceHistory
from kolsky.inverse.result import Terms
from kolsky.inverse.side_surface import radius_at

SCALE_FORCE = 1000.0
"""SF_F of Eq. (M.5) [N]."""
SCALE_SHAPE = 0.001
"""SF_S of Eq. (M.5) [-]."""
SAME_TIME = 1e-9
"""Times closer than this are one [s]: the platen moves by 5 nm meanwhile."""


@dataclass(frozen=True)
class Observations:
    """What the instruments saw inside the window."""

    force: ForceHistory
    """The transmitted force at every recorded sample, P of them."""
    bins: ForceBins
    """The same force in bins."""
    centre_line: CentreLine
    """The outline points, Q of them, frames in order of time; Q is 0 if nobody looked."""
    force_sigma_gain: float = 0.0
    """Standard uncertainty of the force's scale, common to all samples [-]; in no sigma above."""

    @property
    def has_shape(self) -> bool:
        """Whether an outline was measured."""
        return self.centre_line.time.size > 0

    @property
    def frame_times(self) -> FloatArray:
        """Times of the frames that have a point [s], shape [M]."""
        return np.unique(self.centre_line.time)


@dataclass(frozen=True)
class Prediction:
    """What the instruments would have seen of each simulation."""

    force: FloatArray
    """Transmitted force at the recorded times [N], shape [n_samples, P]."""
    force_bins: FloatArray
    """Its mean over each bin [N], shape [n_samples, n_bins]."""
    Z: FloatArray
    """Radius at the measured heights [m], shape [n_samples, Q]; NaN where `inside` is False."""
    inside: BoolArray
    """Points that the model's free surface reaches, shape [n_samples, Q]."""


def observe(
    force: ForceHistory,
    centre_line: CentreLine | None,
    *,
    window: tuple[float, float],
    bin_width: float = CAMERA_FRAME,
) -> Observations:
    """Keep what lies inside the window, and bin the force.

    Parameters
    ----------
    force : ForceHistory
        The transmitted force.
    centre_line : CentreLine or None
        The outline; None if nobody looked.
    window : tuple of float
        First and last time, both included [s].
    bin_width : float
        Width of the force bins [s]; the camera's frame interval by default.

    Raises
    ------
    ValueError
        If the window holds no outline point or fewer than 2 force samples, the bin width does not fit,
        or a Z or a sigma inside is not positive.
    """
    bins = bin_force(force, window=window, width=bin_width)
    first, last = window
    kept = (force.time >= first) & (force.time <= last)
    inside = ForceHistory(time=force.time[kept], force=force.force[kept], sigma=force.sigma[kept])
    _positive("sigma of the force", inside.sigma)
    if centre_line is None:
        return Observations(force=inside, bins=bins, centre_line=_NO_LINE)
    point = np.flatnonzero((centre_line.time >= first) & (centre_line.time <= last))
    if point.size == 0:
        raise ValueError(
            f"no outline point lies in the window {first:.9g} to {last:.9g} s; the frames span"
            f" {centre_line.time.min():.9g} to {centre_line.time.max():.9g} s"
            if centre_line.time.size
            else "the centre line has no point"
        )
    point = point[np.argsort(centre_line.time[point], kind="stable")]
    line = CentreLine(
        time=centre_line.time[point],
        frame=centre_line.frame[point],
        y=centre_line.y[point],
        Z=centre_line.Z[point],
        sigma=centre_line.sigma[point],
    )
    _positive("Z", line.Z)
    _positive("sigma of Z", line.sigma)
    return Observations(force=inside, bins=bins, centre_line=line)


def predict(response: Response, observations: Observations) -> Prediction:
    """See every simulation of a batch through the instruments.

    The force at the recorded times is interpolated linearly, as for Eq. (M.4). A bin's mean is the
    difference of the impulse at its edges over its width: exact, whatever the force does in between. The
    radius is interpolated by `kolsky.inverse.side_surface.radius_at`, never beyond the model's range.

    Parameters
    ----------
    response : explicit.Response
        Completed simulations; its `surface_times` contain every frame and its `force_times` every bin
        edge, and they span the recorded samples.
    observations : Observations
        What to predict.

    Raises
    ------
    ValueError
        If a simulation did not complete, or a frame, a bin edge or a recorded sample is not covered.
    """
    lost = np.flatnonzero(~response.completed)
    if lost.size:
        raise ValueError(
            f"simulation {lost[0]} of {response.n_samples} did not complete"
            f" ({response.describe(int(lost[0]))}); first select the completed ones:"
            " response.select(np.flatnonzero(response.completed))"
        )
    t, line = response.force_times, observations.centre_line
    recorded = observations.force.time
    if recorded[0] < t[0] - SAME_TIME or recorded[-1] > t[-1] + SAME_TIME:
        raise ValueError(
            f"the simulated force spans {t[0]:.9g} to {t[-1]:.9g} s, the recorded samples"
            f" {recorded[0]:.9g} to {recorded[-1]:.9g} s; request force_times over the whole window"
        )
    edge = _rows(t, observations.bins.edges, "bin edge", "force_times")
    outline = _no_outline(response)
    if observations.has_shape:
        frame = _rows(response.surface_times, line.time, "frame", "surface_times")
        outline = [
            radius_at(r, y, frame, line.y)
            for r, y in zip(response.surface_r, response.surface_y, strict=True)
        ]
    impulse = response.impulse_transmission[:, edge]
    return Prediction(
        force=np.stack([np.interp(recorded, t, f) for f in response.force_transmission]),
        force_bins=np.diff(impulse, axis=1) / np.diff(observations.bins.edges),
        Z=np.stack([Z for Z, _ in outline]),
        inside=np.stack([inside for _, inside in outline]),
    )


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
    bins, line, counted = observations.bins, observations.centre_line, prediction.inside[i]
    force = (prediction.force_bins[i] - bins.mean) / bins.sigma
    shape = (prediction.Z[i, counted] - line.Z[counted]) / line.sigma[counted]
    return force, shape, bins.centres, line.time[counted]


_NO_LINE = CentreLine(np.empty(0), np.empty(0, dtype=np.int64), np.empty(0), np.empty(0), np.empty(0))


def _no_outline(response: Response) -> list[tuple[FloatArray, BoolArray]]:
    return [(np.empty(0), np.empty(0, dtype=bool))] * response.n_samples


def _positive(name: str, value: FloatArray) -> None:
    if not (value > 0.0).all():
        raise ValueError(f"every {name} in the window must be > 0, got {value.min():.6g}")


def _frame_mean(value: FloatArray, frame: IntArray) -> float:
    """Mean over frames of the mean over each frame's points."""
    _, row, count = np.unique(frame, return_inverse=True, return_counts=True)
    return float(np.mean(np.bincount(row, weights=value) / count))


def _rows(times: FloatArray, wanted: FloatArray, what: str, field: str) -> NDArray[np.intp]:
    """Index of each wanted time among increasing `times`."""
    row = np.minimum(np.searchsorted(times, wanted - SAME_TIME), times.size - 1)
    missing = np.flatnonzero(~(np.abs(times[row] - wanted) <= SAME_TIME))
    if missing.size:
        raise ValueError(
            f"the response has no {field} entry at the {what} {wanted[missing[0]]:.9g} s ({missing.size} of"
            f" {wanted.size} missing); request every {what} in explicit.Sampling({field}=...)"
        )
    return row
