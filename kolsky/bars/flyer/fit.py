"""The flyer's path: a smooth motion from its noisy displacement at the frames.

The path is a cubic spline with a knot at every frame, so its jerk is constant between frames, and it
starts with x = v = a = 0. The jerks have a prior N(0, tau(t)^2): tau is large where the flyer is set in
motion and falls by orders of magnitude afterwards, so it is a free function of time (log tau linear in the
logarithm of the frames since the start, one control point an octave). tau and the noise are those of largest
marginal likelihood, the noise not below the declared sigma. Where declared sigmas differ from frame to frame,
the noise has two parts: the declared one, scaled, and one that is the same in all frames. Warm air before a
camera is such a part: a scale alone would take what it adds to the well seen frames for a fault of all, and
make the frames that show little of the flyer worse by as much. The path is the posterior mean, and its
covariance the posterior one; where frames are missing, with what their unknown smoothness adds
(`kolsky.bars.flyer.unseen`). The displacement's zero, which the static frames hold, is one more unknown.

Why this way. On the known motion of two flyer shots (2.6 and 2.3 m/s within 50 and 60 us, noise 1 um,
8 noise draws each) the errors of the candidates were, root mean square:

=========================================  =============  =============  =============
method                                     position [um]  velocity       velocity later
                                           first 70 us    first 70 us    [m/s]
=========================================  =============  =============  =============
cubic, knots inserted greedily, BIC        1.00           0.11           0.04
cubic, knots inserted greedily, AIC        0.75           0.08           0.14
quintic, knots inserted greedily, BIC      1.03           0.13           0.007
cubic, `scipy.interpolate.generate_knots`  3.28           0.22           0.02
jerk prior (this module)                   0.44           0.03           0.002
=========================================  =============  =============  =============

Least-squares splines pay for every knot in full: few knots lag in the ramp, many ring. The prior lets the
ramp follow the data frame by frame and the slow part average over a hundred frames. What moves the flyer by
less than the noise within a few frames (bar ringing of 0.1 m/s at 25 kHz is 0.6 um) cannot be seen and is
not in the path's uncertainty either; `chi2_per_dof` above 1 at a trusted sigma is its only trace.
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import block_diag, cholesky, solve_triangular

from kolsky.bars.flyer.evidences import Evidences
from kolsky.bars.flyer.jerks import (
    ZERO_PRIOR,
    hat_functions,
    maximum_likelihood,
    noise_parts,
    posterior,
)
from kolsky.bars.flyer.path import FlyerPath, responses
from kolsky.bars.flyer.unseen import mixed_covariance, unseen_controls, weighted_draws
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.base.records import FlyerMotion

FEWEST_STATIC = 3
FEWEST_MOVING = 8
LONGEST_STEP = 2.5
"""Longest step from one displacement to the next without knots of the path between them, in frames."""


def fit_flyer(
    motion: FlyerMotion,
    *,
    start: float,
    covariance: FloatArray | None = None,
    restart: float | None = None,
) -> FlyerPath:
    """Fit the path of a flyer that is at rest until `start`.

    Parameters
    ----------
    motion : FlyerMotion
        The displacement at the frames; its zero is arbitrary. The frames may be unevenly spaced.
    start : float
        A time in the static frames [s]: there the motion starts with x = v = a = 0. Later than the
        beginning of the true motion it would distort the ramp; earlier does no harm.
    covariance
        Of the displacements between the frames [m²], shape [n_frames, n_frames], if they have a common part
        beside `FlyerMotion.sigma`, the noise that is each frame's own. The path is the same; what the fit
        makes of the common part is added to its covariance.
    restart
        Just before a blow that changes the flyer's velocity within few frames, the second impact [s]: from
        here on the smoothness is one of its own, with as large jerks at first as at the start. None if there
        is none.

    Returns
    -------
    FlyerPath
        From `start` to the last frame.

    Raises
    ------
    ValueError
        If times are not increasing, a value is not finite, a sigma is not positive, fewer than 3 frames
        are at or before `start`, or fewer than 8 after it, or the covariance is of another shape.
    """
    _check(motion, start)
    if covariance is not None and covariance.shape != 2 * motion.time.shape:
        raise ValueError(f"covariance has shape {covariance.shape}, must be {2 * motion.time.shape}")
    frame = float(np.median(np.diff(motion.time)))
    t, seen = _without_gaps(motion.time, frame)
    sigma, displacement = np.full(t.size, np.inf), np.zeros(t.size)
    sigma[seen], displacement[seen] = motion.sigma, motion.displacement
    unit = float(np.median(motion.sigma))
    static = t <= start
    knots = np.concatenate([[start], t[~static]])
    about = np.average(displacement[static], weights=sigma[static] ** -2)
    y = (displacement - about) / sigma
    # Unknowns in units of sigma: the zero, then the jerks per frame^3.
    weight = unit / sigma
    G = np.column_stack([np.ones(t.size), responses(t, knots, 0) / frame**3]) * weight[:, None]
    hats = _smoothness((0.5 * (knots[1:] + knots[:-1]) - start) / frame, restart, start, frame)
    parts, shared = noise_parts(weight), shared_noise(motion, t, sigma, seen)
    log_scales, log_tau = maximum_likelihood(y, weight, np.diff(knots) / frame, hats, parts, shared)
    s = np.sqrt(parts @ np.exp(2.0 * log_scales))  # noise over declared sigma, frame by frame
    prior = np.concatenate([[ZERO_PRIOR], np.exp(hats @ log_tau)])
    whitened = whitening(t, s, motion.shared_memory, shared)
    seen_by = whitened(G * prior)
    z, V, rest = posterior(whitened(y), seen_by)
    effective = prior.size - float(np.trace(V))
    dof = motion.time.size - effective
    u = prior[1:] * unit / frame**3
    spread = u[:, None] * V[1:, 1:] * u
    free = np.append(np.zeros(log_scales.size, dtype=bool), unseen_controls(hats, t, seen, knots))
    if free.any():

        def solution(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
            tau = np.exp(hats @ theta[log_scales.size :])
            mean, own, _ = posterior(whitened(y), whitened(G * np.append(ZERO_PRIOR, tau)))
            size = tau * unit / frame**3
            return size * mean[1:], size[:, None] * own[1:, 1:] * size

        data = (y, weight, np.diff(knots) / frame, hats, parts, shared)
        likeliest = np.concatenate([log_scales, log_tau])
        draws = weighted_draws(likeliest, free, lambda rows: Evidences(rows, *data))
        spread = mixed_covariance(*draws, u * z[1:], solution)
    if covariance is not None:
        # Of the jerks by the displacements.
        gain = u[:, None] * whitened((V @ seen_by.T)[1:].T, back=True).T / sigma
        gain = gain[:, seen]
        spread = spread + gain @ (covariance - np.diag(motion.sigma**2)) @ gain.T
    return FlyerPath(
        knots=knots,
        jerk=u * z[1:],
        covariance=spread,
        zero=float(about + ZERO_PRIOR * unit * z[0]),
        noise_scale=float(np.median(s[seen])),
        chi2_per_dof=float(np.sum(rest**2) * np.median(s[seen]) ** 2 / dof)
        if shared is not None
        else float(np.sum((s * rest) ** 2) / dof),
        dof=dof,
        static_scatter=float(np.sqrt(np.sum(y[static] ** 2) / ((static & seen).sum() - 1))),
    )


def _smoothness(frames: FloatArray, restart: float | None, start: float, frame: float) -> FloatArray:
    """Hat functions of log tau over the spans, from the start and anew from a restart."""
    if restart is None:
        return hat_functions(frames)
    since = (restart - start) / frame
    before = frames < since
    if before.all() or not before.any():
        return hat_functions(frames)
    blocks = hat_functions(frames[before]), hat_functions(frames[~before] - since)
    return np.asarray(block_diag(*blocks))


def shared_noise(
    motion: FlyerMotion, t: FloatArray, sigma: FloatArray, seen: BoolArray
) -> tuple[FloatArray, FloatArray] | None:
    """`evidence`'s `shared`: size over sigma and what is left from frame to frame; None if there is none.

    Parameters
    ----------
    motion
        The displacements.
    t, sigma, seen
        Times [s], standard deviations [m], and which are data, with frames put in gaps, shape [n].
    """
    if motion.shared_sigma is None or not motion.shared_sigma.any():
        return None
    size = np.zeros(t.size)
    size[seen] = motion.shared_sigma / sigma[seen]
    return size, np.exp(-np.diff(t, prepend=t[0]) / motion.shared_memory)


def whitening(
    t: FloatArray, s: FloatArray, memory: float, shared: tuple[FloatArray, FloatArray] | None
) -> Callable[..., FloatArray]:
    """The map that makes the displacements' errors independent, of variance 1; for columns [n_frames, ...].

    Without a shared error it divides by `s`. With one it is L^-1 of the covariance ``s^2 + q q' exp(-|dt| /
    memory)`` = L L', q the shared error's size over sigma; `back` asks for the transposed map.
    """
    if shared is None:
        return lambda columns, back=False: np.asarray((columns.T / s).T)
    covariance = np.outer(shared[0], shared[0]) * np.exp(-np.abs(t[:, None] - t) / memory)
    lower = cholesky(covariance + np.diag(s**2), lower=True)
    return lambda columns, back=False: solve_triangular(
        lower, columns, lower=True, trans="T" if back else "N"
    )


def _without_gaps(time: FloatArray, frame: float) -> tuple[FloatArray, BoolArray]:
    """Times with those of frames put in where more than one is missing, and which of them are data.

    Without knots there, one constant jerk would have to carry a flyer from rest to its speed.
    """
    steps = np.diff(time)
    added = [
        before + np.arange(1, count) * (step / count)
        for before, step, count in zip(time[:-1], steps, np.round(steps / frame).astype(int), strict=True)
        if step > LONGEST_STEP * frame
    ]
    times = np.sort(np.concatenate([time, *added]))
    return times, np.isin(times, time)


def _check(motion: FlyerMotion, start: float) -> None:
    t = motion.time
    if not (np.diff(t) > 0.0).all():
        row = int(np.flatnonzero(~(np.diff(t) > 0.0))[0]) + 1
        raise ValueError(f"frame times must increase; row {row} has {t[row]:.9g} s after {t[row - 1]:.9g} s")
    if not (np.isfinite(motion.displacement).all() and np.isfinite(t).all()):
        raise ValueError("every time and displacement of the flyer must be finite; drop the failed frames")
    if not (motion.sigma > 0.0).all():
        raise ValueError(f"the flyer's sigma must be > 0 m everywhere, got {motion.sigma.min():.3g} m")
    for count, least, where in (
        (int((t <= start).sum()), FEWEST_STATIC, "at or before"),
        (int((t > start).sum()), FEWEST_MOVING, "after"),
    ):
        if count < least:
            raise ValueError(
                f"{count} flyer frames are {where} the start {start:.9g} s, at least {least} are needed;"
                f" choose a start inside the static frames (the record spans {t[0]:.9g} to {t[-1]:.9g} s)"
            )
