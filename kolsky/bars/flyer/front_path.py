"""The path of the incident bar's face from its waves. It replaces the camera's measurement of a flyer.

The face moves with ``c0 (eps_i - eps_r)``. Its path is the cubic spline of `kolsky.bars.flyer.path`, from
rest. The jerks have a prior N(0, tau^2). Tau and the noise maximise the marginal likelihood, with at least
the declared noise. There are two differences from a flyer's path (`kolsky.bars.flyer`). The observations are
velocities at many samples instead of positions at few frames. Tau is constant, because a bar's waves last for
the whole record. An error of the velocity's scale is common to all samples.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dic.basics import check_interval, check_shape
from kolsky.bars.flyer.jerks import posterior
from kolsky.bars.flyer.path import FlyerPath, responses
from kolsky.bars.records import FaceWaves, History, Reduction
from kolsky.base.arrays import FloatArray
from kolsky.base.records import ForceHistory, FrontVelocity

MOST_KNOTS = 300
"""Largest number of knots of a path, and largest number of sample means used for its fit."""
LEAD = 4
"""Number of knots before the first sample. An arrival is detected slightly after the wave begins."""
FEWEST_SAMPLES = 20


def front_velocity(reduction: Reduction, waves: FaceWaves) -> FrontVelocity:
    """The face's velocity on the shot's clock. Its uncertainty is split into noise and scale.

    ``reduction``: its `front_velocity` has one sigma for noise and systematic parts. ``waves``: the waves of
    this velocity; they give the noise of the samples.
    """
    speed, v = waves.incident_bar.wave_speed, reduction.front_velocity
    own, slow = (speed * float(np.hypot(s["incident"], s["reflected"])) for s in _sigmas(waves))
    time = waves.origin + reduction.time
    return FrontVelocity(time, v.value, slow, _scale(v, own))


def back_force(reduction: Reduction, waves: FaceWaves) -> tuple[ForceHistory, float]:
    """The force on the transmission bar on the shot's clock with its noise; sigma of its scale [-].

    The noise is the level at low frequencies, because this level determines the noise of means and integrals.
    """
    bar, F = waves.transmission_bar, reduction.back_force
    own, slow = (bar.impedance * bar.wave_speed * s["transmitted"] for s in _sigmas(waves))
    time = waves.origin + reduction.time
    return ForceHistory(time, F.value, np.full(F.value.shape, slow)), _scale(F, own)


def front_path(motion: FrontVelocity) -> FlyerPath:
    """Fit the path of a face with known velocity.

    ``motion``: the velocity from the wave's arrival on, at uniform times. The path starts a few samples
    before it. Raises ValueError if there are fewer than 20 samples, if times are not uniform, if a value is
    outside its range, or if the fit fails. Returns: the path with the covariance of noise and scale. There
    are no static frames; `static_scatter` is therefore 1.
    """
    if motion.time.size < FEWEST_SAMPLES:
        raise ValueError(
            f"the face's velocity needs {FEWEST_SAMPLES} samples or more, got {motion.time.size}: lengthen"
            " the windows"
        )
    check_shape(motion.time.shape, time=motion.time, velocity=motion.velocity)
    check_interval("(0, inf) m/s", noise=motion.noise)
    check_interval("[0, inf)", sigma_gain=motion.sigma_gain)
    steps = np.diff(motion.time)
    if not steps.min() > 0.0 or np.ptp(steps) > 1e-3 * steps.mean():
        raise ValueError(
            f"the times of the face's velocity must be uniform, got steps from {steps.min():.6g} to"
            f" {steps.max():.6g} s; resample the reduction"
        )
    per_mean = -(-motion.time.size // MOST_KNOTS)
    n = motion.time.size // per_mean
    t = motion.time[: n * per_mean]
    step = per_mean * float(motion.time[1] - motion.time[0])
    knots = motion.time[0] + step * np.arange(-LEAD, n + 1)
    knots = np.append(knots[knots < motion.time[-1]], motion.time[-1])
    noise = motion.noise / np.sqrt(per_mean)
    y = motion.velocity[: t.size].reshape(n, per_mean).mean(axis=1) / noise
    # Unknowns in units of noise: jerk times step^2.
    G = responses(t, knots, 1).reshape(n, per_mean, -1).mean(axis=1) / step**2
    log_scale, log_tau = _most_likely(y, G)
    s, tau = float(np.exp(log_scale)), float(np.exp(log_tau))
    z, V, rest = posterior(y / s, G * (tau / s))
    effective = z.size - float(np.trace(V))
    unit = tau * noise / step**2
    jerk = unit * z
    covariance = unit**2 * V + motion.sigma_gain**2 * np.outer(jerk, jerk)
    return FlyerPath(
        knots=knots,
        jerk=jerk,
        covariance=covariance,
        zero=0.0,
        noise_scale=s,
        chi2_per_dof=float(s**2 * (rest @ rest) / (n - effective)),
        static_scatter=1.0,
    )


def _most_likely(y: FloatArray, G: FloatArray) -> tuple[float, float]:
    """Log noise scale (>= 0) and log tau of largest marginal likelihood of ``y = G u + e``."""
    from scipy.optimize import minimize  # loaded where it is of use

    U, S, _ = np.linalg.svd(G, full_matrices=False)
    along = (U.T @ y) ** 2
    across = max(float(y @ y - along.sum()), 0.0)
    beyond = y.size - S.size

    def cost(theta: FloatArray) -> float:
        noise = np.exp(2.0 * theta[0])
        variance = np.exp(2.0 * theta[1]) * S**2 + noise
        inside = float(np.sum(np.log(variance) + along / variance))
        return inside + beyond * float(np.log(noise)) + across / noise

    # The highest tau reaches the largest velocity within a step. The lowest has no effect over the record.
    high = float(np.log(10.0 * max(np.abs(y).max(), 10.0)))
    low = high - np.log(max(np.abs(y).max(), 10.0)) - 2.0 * np.log(float(y.size)) - 5.0
    starts = np.linspace(low, high, 5)[1:]
    best = min(
        (
            minimize(cost, [0.1, start], method="L-BFGS-B", bounds=[(0.0, None), (low, high)])
            for start in starts
        ),
        key=lambda found: float(found.fun),
    )
    if not np.isfinite(best.fun):
        raise ValueError(
            "the smoothness of the face's motion could not be found: is its noise far too small?"
        )
    return float(best.x[0]), float(best.x[1])


def _sigmas(waves: FaceWaves) -> tuple[Mapping[str, float], Mapping[str, float]]:
    """Noise of a sample, and white noise with the same level at low frequencies."""
    return waves.sigma, waves.sigma if waves.white is None else waves.white


def _scale(history: History, noise: float) -> float:
    """Relative part of a history's sigma that is not noise and is common to all samples [-]."""
    size = float(np.sum(history.value**2))
    left = float(np.sum(history.sigma**2 - noise**2))
    # If sigma contains only noise, the difference is round-off with either sign.
    return float(np.sqrt(left / size)) if size > 0.0 and left > 0.0 else 0.0


@dataclass(frozen=True)
class BarForce:
    """The transmitted force from the waves in the transmission bar."""

    measured: ForceHistory
    """The force on the specimen's clock; sigma is the noise of the samples, independent of each other."""
    sigma_gain: float
    """Standard uncertainty of its scale, common to all samples [-]."""

    @property
    def time(self) -> FloatArray:
        """Sample times [s], shape [n_samples]."""
        return self.measured.time

    def raw_force(self) -> FloatArray:
        """Force at every sample, compression-positive [N], shape [n_samples]."""
        return self.measured.force

    def history(self) -> ForceHistory:
        """The force with its noise."""
        return self.measured

    def noise_checks(self) -> dict[str, float]:
        """Checks of the noise. There are none, because the reduction has estimated the noise."""
        return {}
