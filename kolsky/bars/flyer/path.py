"""The flyer's path: a cubic spline that starts at rest. It is fitted to the noisy displacement at the frames.

`fit_flyer` returns the path with its posterior uncertainty. In spans in which no frame shows the flyer, the
uncertainty of the smoothness is added.

In other spans, the frames determine the smoothness of the motion, and the likeliest smoothness tau is used
(`fit_flyer`). In spans with missing frames, e.g. before the flyer comes into view, tau is uncertain by a
factor of two or three. The error of the path with the likeliest tau then exceeds its posterior covariance.
The log tau of these spans are therefore drawn around the likeliest values, with weights by their likelihood
(importance sampling). The covariance is that of the mixture about the path:

    sum of w_k (C_k + (j_k - j)(j_k - j)')

with the jerks j_k and covariances C_k of each draw. The path is still that of the likeliest tau.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag, cholesky, solve_triangular

from dic.basics import check_interval, check_shape
from kolsky.bars.flyer.jerks import (
    ZERO_PRIOR,
    evidences,
    hat_functions,
    maximum_likelihood,
    noise_parts,
    posterior,
)
from kolsky.bars.records import History
from kolsky.base.arrays import BoolArray, FloatArray
from kolsky.base.records import FlyerMotion

if TYPE_CHECKING:
    from scipy.interpolate import PPoly


ONSET = (0.5, 0.99)
"""Shares of the largest velocity that limit the onset of a motion."""


@dataclass(frozen=True)
class FlyerPath:
    """A motion that starts from rest, with position, velocity and acceleration of one cubic spline (C2)."""

    knots: FloatArray
    """Start, then the frames after it [s], shape [n + 1]."""
    jerk: FloatArray
    """Third derivative between the knots [m/s^3], shape [n]."""
    covariance: FloatArray
    """Posterior covariance of `jerk` [m^2/s^6], shape [n, n]."""
    zero: float
    """The recorded displacement at rest, which is subtracted [m]."""
    noise_scale: float
    """Noise used, divided by the declared noise, at least 1 [-]. It is the median if it differs between
    frames."""
    chi2_per_dof: float
    """Residual sum of squares in declared sigmas, divided by (frames - effective parameters) [-]. It is about
    1 if the declared sigma is right."""
    static_scatter: float
    """Scatter of the static frames, divided by the declared sigma [-]. This check needs no fit."""

    @property
    def start(self) -> float:
        """Last time at rest [s]."""
        return float(self.knots[0])

    @property
    def end(self) -> float:
        """Last frame [s]."""
        return float(self.knots[-1])

    @cached_property
    def _spline(self) -> "PPoly":
        from scipy.interpolate import PPoly  # loaded where it is of use

        h = np.diff(self.knots)
        state = np.zeros((3, h.size))  # x, v, a at the left knot of each span
        for i in range(h.size - 1):
            x, v, a = state[:, i]
            j = self.jerk[i]
            state[0, i + 1] = x + h[i] * (v + h[i] * (a / 2.0 + h[i] * j / 6.0))
            state[1, i + 1] = v + h[i] * (a + h[i] * j / 2.0)
            state[2, i + 1] = a + h[i] * j
        return PPoly(np.stack([self.jerk / 6.0, state[2] / 2.0, state[1], state[0]]), self.knots)

    def position(self, time: ArrayLike) -> FloatArray:
        """Displacement toward the specimen [m], shape of `time`.

        Raises ValueError if a time is outside [start, end]. The methods below raise the same error.
        """
        return np.asarray(self._spline(self._inside(time)))

    def velocity(self, time: ArrayLike) -> FloatArray:
        """Velocity toward the specimen [m/s], shape of `time`."""
        return np.asarray(self._spline(self._inside(time), 1))

    def acceleration(self, time: ArrayLike) -> FloatArray:
        """Acceleration toward the specimen [m/s^2], shape of `time`."""
        return np.asarray(self._spline(self._inside(time), 2))

    def sigma_position(self, time: ArrayLike) -> FloatArray:
        """Standard uncertainty of `position`, with that of the zero [m], shape of `time`."""
        return self._sigma(time, 0)

    def sigma_velocity(self, time: ArrayLike) -> FloatArray:
        """Standard uncertainty of `velocity` [m/s], shape of `time`."""
        return self._sigma(time, 1)

    def sigma_acceleration(self, time: ArrayLike) -> FloatArray:
        """Standard uncertainty of `acceleration` [m/s^2], shape of `time`."""
        return self._sigma(time, 2)

    def sigma_change(self, first: float, last: float) -> float:
        """Standard uncertainty of the change of `position` between two times [m]."""
        G = responses(self._inside([last]), self.knots, 0) - responses(self._inside([first]), self.knots, 0)
        return float(np.sqrt(max((G @ self.covariance @ G.T).item(), 0.0)))

    @cached_property
    def sigma_onset(self) -> float:
        """Standard uncertainty of the time at which the motion begins [s].

        An error of ``sigma_position`` in displacement equals an error of ``sigma_position / velocity`` in
        time. The result is the largest of these, between the times at which the path first reaches half and
        nearly all of its largest velocity. If no frame shows this part, the smoothness determines the path.
        """
        velocity = self.velocity(self.knots)
        first, last = (int(np.argmax(velocity >= share * velocity.max())) for share in ONSET)
        while_rising = slice(first, last + 1)
        if not velocity.max() > 0.0:
            return 0.0
        late = self.sigma_position(self.knots[while_rising]) / velocity[while_rising]
        return float(late.max())

    def replicates(self, n: int, rng: np.random.Generator) -> list["FlyerPath"]:
        """Paths drawn from the posterior, to propagate the flyer's noise through a calculation.

        ``n``: number of paths. ``rng``: random generator. The same state gives the same paths.
        """
        root = self._root
        return [replace(self, jerk=self.jerk + root @ rng.standard_normal(len(root))) for _ in range(n)]

    @property
    def _root(self) -> FloatArray:
        """R with R R' = `covariance`, by eigenvectors: it spans many decades and may be semidefinite."""
        scale = np.sqrt(np.diag(self.covariance))
        safe = np.where(scale > 0.0, scale, 1.0)
        values, vectors = np.linalg.eigh(self.covariance / np.outer(safe, safe))
        return np.asarray(safe[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))

    def noise_patterns(self, count: int) -> FloatArray:
        """Independent patterns of the path's noise, as jerks of one standard deviation each, [q, n_spans].

        Patterns with the largest effect on the velocity come first. All of them together give the covariance.

        ``count``: largest number of patterns.
        """
        root = self._root
        spans = np.diff(self.knots)[:, None]
        velocity = np.cumsum(np.cumsum(root * spans, axis=0) * spans, axis=0)
        _, _, turned = np.linalg.svd(velocity, full_matrices=False)
        return np.asarray(turned[:count] @ root.T)

    def scaled(self, factor: float) -> "FlyerPath":
        """The path with every displacement multiplied by a factor. Its covariance does not change."""
        return replace(self, jerk=factor * self.jerk)

    def faster(self, factor: float) -> "FlyerPath":
        """The same path at `factor` times the speed, from the same start, with the corresponding covariance.

        Raises ValueError if the factor is not finite and > 0.
        """
        if not 0.0 < factor < np.inf:
            raise ValueError(f"factor must be finite and > 0, got {factor}")
        return replace(
            self,
            knots=self.start + (self.knots - self.start) / factor,
            jerk=factor**3 * self.jerk,
            covariance=factor**6 * self.covariance,
        )

    def table(self, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Times [s], positions [m] and velocities [m/s] at `n` evenly spaced times, start to end."""
        if n < 2:
            raise ValueError(f"a table needs at least 2 times, got {n}")
        time = np.linspace(self.start, self.end, n)
        return time, self.position(time), self.velocity(time)

    def _inside(self, time: ArrayLike) -> FloatArray:
        t = np.asarray(time, dtype=np.float64)
        outside = t[~((t >= self.start) & (t <= self.end))]
        if outside.size:
            raise ValueError(
                f"the flyer's motion is known from {self.start:.9g} s to {self.end:.9g} s, asked for"
                f" {outside[0]:.9g} s; keep the window inside the frames"
            )
        return t

    def _sigma(self, time: ArrayLike, order: int) -> FloatArray:
        t = self._inside(time)
        G = responses(t.ravel(), self.knots, order)
        return np.sqrt(np.sum((G @ self.covariance) * G, axis=1).clip(min=0.0)).reshape(t.shape)


def responses(time: FloatArray, knots: FloatArray, order: int) -> FloatArray:
    """Position (order 0), velocity (1) or acceleration (2) at each time from a unit jerk in each span.

    ``time``: times [s], shape [n_times]. ``knots``: ends of the spans [s], shape [n_spans + 1]. ``order``: 0,
    1 or 2. Returns: in [s^3], [s^2] or [s], shape [n_times, n_spans].
    """
    since = np.maximum(time[:, None] - knots, 0.0)
    power, factor = ((3, 6.0), (2, 2.0), (1, 1.0))[order]
    return -np.diff(since**power, axis=1) / factor


def path_strain(path: FlyerPath, time: ArrayLike, *, length: float) -> tuple[History, History, History]:
    """Nominal compression [-], its rate and its second derivative for one face that moves along a path.

    The other face is at rest. ``time``: times, not after the path's end [s]. ``length``: of the specimen
    before the test [m].
    """
    if not length > 0.0:
        raise ValueError(f"length is {length:g} m, must be > 0 m")
    t = np.asarray(time, dtype=np.float64)
    moving = t >= path.start
    at = t[moving]

    def history(value: FloatArray, sigma: FloatArray, unit: str) -> History:
        whole = [np.zeros(t.shape) for _ in range(2)]
        for into, part in zip(whole, (value, sigma), strict=True):
            into[moving] = part / length
        return History(whole[0], whole[1], unit)

    return (
        history(path.position(at), path.sigma_position(at), "1"),
        history(path.velocity(at), path.sigma_velocity(at), "1/s"),
        history(path.acceleration(at), path.sigma_acceleration(at), "1/s^2"),
    )


DRAWS = 128
"""Number of draws. About 60 of them have a significant weight, which gives a standard deviation within a
tenth."""
_WIDER = 1.5
"""Width of the sampling distribution, divided by that of the likelihood. The tails of the likelihood are
heavier than normal ones."""
STEP = 0.05
"""Half the distance of central differences of the slope, in log tau."""
_LEAST_CURVATURE = 0.1
"""Smallest curvature of -ln L in log tau [-]; it limits the standard deviation to a factor of e^3."""
LEAST_WEIGHT = 1e-5
"""A draw with less weight is omitted."""


class Deviances(Protocol):
    """-2 ln L for several rows of unknowns."""

    @property
    def values(self) -> FloatArray:
        """The values, shape [n_rows]."""

    @property
    def gradients(self) -> FloatArray:
        """Their gradients, shape [n_rows, n]."""


def controls_in_gaps(hats: FloatArray, t: FloatArray, seen: BoolArray, knots: FloatArray) -> BoolArray:
    """Control points of log tau that affect a span with an end in no frame, shape [n_controls]."""
    hidden = np.isin(knots, t[~seen])
    return np.asarray((hats[hidden[:-1] | hidden[1:]] > 0.0).any(axis=0))


def importance_draws(
    theta: FloatArray, free: BoolArray, deviances: Callable[[FloatArray], Deviances]
) -> tuple[FloatArray, FloatArray]:
    """Draws around the likeliest values of some unknowns, and their weights, with the sum one.

    Draws come in pairs with opposite signs. The same call gives the same draws.
    """
    rows = np.flatnonzero(free)
    steps = STEP * np.eye(theta.size)[rows]
    ahead, behind = np.split(deviances(np.concatenate([theta + steps, theta - steps])).gradients[:, rows], 2)
    curvature = 0.5 * (ahead - behind) / (2.0 * STEP)
    values, vectors = np.linalg.eigh(0.5 * (curvature + curvature.T))
    widths = _WIDER / np.sqrt(np.maximum(values, _LEAST_CURVATURE))
    half = np.random.default_rng(0).standard_normal((DRAWS // 2, rows.size))
    normal = np.concatenate([half, -half])
    drawn = np.tile(theta, (DRAWS, 1))
    drawn[:, rows] += normal * widths @ vectors.T
    log = -0.5 * deviances(drawn).values + 0.5 * (normal**2).sum(axis=1)
    weight = np.exp(log - log.max())
    return drawn, weight / weight.sum()


def mixed_covariance(
    y: FloatArray,
    seen_by: FloatArray,
    prior: FloatArray,
    drawn: BoolArray,
    tau: FloatArray,
    weights: FloatArray,
) -> FloatArray:
    """Covariance of the unknowns about those of the path, over draws of some priors, shape [n, n].

    The unknowns with the same prior in all draws are eliminated once.

    ``y``, ``seen_by``: data, and their response to each unknown, in units of the noise, shapes [n_frames] and
    [n_frames, n]. ``prior``: prior standard deviations for the path, shape [n]. ``drawn``: unknowns with
    another prior in each draw, shape [n]. ``tau``, ``weights``: these priors and the weights of the draws,
    shapes [n_draws, n_drawn] and [n_draws].
    """
    same, count = ~drawn, int((~drawn).sum())
    columns = np.column_stack([seen_by[:, same] * prior[same], seen_by[:, drawn], y])
    R = np.asarray(np.linalg.qr(np.concatenate([columns, np.eye(count, columns.shape[1])]), mode="r"))

    def solution(prior: FloatArray) -> tuple[FloatArray, FloatArray]:
        mean, own, _ = posterior(R[count:, -1], R[count:, count:-1] * prior)
        return prior * mean, prior[:, None] * own * prior

    about, mixed = solution(prior[drawn])[0], np.zeros((tau.shape[1],) * 2)
    kept = weights > LEAST_WEIGHT * weights.max()
    for one, weight in zip(tau[kept], weights[kept] / weights[kept].sum(), strict=True):
        mean, covariance = solution(one)
        mixed += weight * (covariance + np.outer(mean - about, mean - about))
    root, by_drawn = np.zeros((prior.size, count)), np.zeros((prior.size, tau.shape[1]))
    root[same] = prior[same, None] * solve_triangular(R[:count, :count], np.eye(count))
    by_drawn[drawn], by_drawn[same] = np.eye(tau.shape[1]), -root[same] @ R[:count, count:-1]
    return np.asarray(root @ root.T + by_drawn @ mixed @ by_drawn.T)


FEWEST_STATIC = 3
_FEWEST_MOVING = 8
LONGEST_STEP = 2.5
"""Longest step between two displacements without additional knots of the path, in frames."""


def fit_flyer(
    motion: FlyerMotion, *, start: float, covariance: FloatArray | None = None, restart: float | None = None
) -> FlyerPath:
    """Fit the path of a flyer that is at rest until `start`.

    Raises ValueError if times are not increasing, if fewer than 3 frames are at or before `start`, or if
    fewer than 8 are after it. The same error is raised if the covariance has another shape, or if the restart
    is not finite.

    Returns: from `start` to the last frame.

    Parameters
    ----------
    motion : FlyerMotion
        The displacement at the frames. Its zero is arbitrary. The frames may be unevenly spaced.
    start : float
        A time in the static frames [s]. At this time the motion starts with x = v = a = 0. A start after the
        beginning of the true motion distorts the ramp. An earlier start has no effect.
    covariance
        Covariance of the displacements between the frames [m²], shape [n_frames, n_frames]. It describes a
        common part in addition to `FlyerMotion.sigma`, the independent noise of each frame. The path is the
        same. The effect of the common part is added to its covariance.
    restart
        Time just before the second impact, which changes the flyer's velocity within few frames [s]. After it
        a separate smoothness is used, with jerks at first as large as at the start. None without a second
        impact.
    """
    _check(motion, start)
    check_interval("(-inf, inf)", restart=start if restart is None else restart)
    if covariance is not None:
        check_shape(2 * motion.time.shape, covariance=covariance)
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
    parts, shared = noise_parts(weight), _shared_noise(motion, t, sigma, seen)
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
    free = np.append(np.zeros(log_scales.size, dtype=bool), controls_in_gaps(hats, t, seen, knots))
    if free.any():
        data = (y, weight, np.diff(knots) / frame, hats, parts, shared)
        likeliest = np.concatenate([log_scales, log_tau])
        draws = importance_draws(likeliest, free, lambda rows: evidences(rows, *data))
        drawn = np.append(False, (hats[:, free[log_scales.size :]] > 0.0).any(axis=1))
        tau = np.exp(draws[0][:, log_scales.size :] @ hats[drawn[1:]].T)
        mixed = mixed_covariance(whitened(y), whitened(G), prior, drawn, tau, draws[1])
        spread = (unit / frame**3) ** 2 * mixed[1:, 1:]
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
        static_scatter=float(np.sqrt(np.sum(y[static] ** 2) / ((static & seen).sum() - 1))),
    )


def _smoothness(frames: FloatArray, restart: float | None, start: float, frame: float) -> FloatArray:
    """Hat functions of log tau over the spans: a set from the start, and another from a restart."""
    if restart is None:
        return hat_functions(frames)
    since = (restart - start) / frame
    before = frames < since
    if before.all() or not before.any():
        return hat_functions(frames)
    blocks = hat_functions(frames[before]), hat_functions(frames[~before] - since)
    return np.asarray(block_diag(*blocks))


def _shared_noise(
    motion: FlyerMotion, t: FloatArray, sigma: FloatArray, seen: BoolArray
) -> tuple[FloatArray, FloatArray] | None:
    """Argument `shared` of `evidence`: size over sigma, and correlation between frames; None without it."""
    if motion.shared_sigma is None or not motion.shared_sigma.any():
        return None
    size = np.zeros(t.size)
    size[seen] = motion.shared_sigma / sigma[seen]
    return size, np.exp(-np.diff(t, prepend=t[0]) / motion.shared_memory)


def whitening(
    t: FloatArray, s: FloatArray, memory: float, shared: tuple[FloatArray, FloatArray] | None
) -> Callable[..., FloatArray]:
    """The map that makes the displacements' errors independent with variance 1.

    It is applied to columns [n_frames, ...].

    Without a shared error, the map divides by `s`. With a shared error, it is L^-1 of the covariance ``s^2 +
    q q' exp(-|dt| / memory)`` = L L'. Here q is the shared error's size over sigma. `back` selects the
    transposed map.
    """
    if shared is None:
        return lambda columns, back=False: np.asarray((columns.T / s).T)
    covariance = np.outer(shared[0], shared[0]) * np.exp(-np.abs(t[:, None] - t) / memory)
    lower = cholesky(covariance + np.diag(s**2), lower=True)
    return lambda columns, back=False: solve_triangular(
        lower, columns, lower=True, trans="T" if back else "N"
    )


def _without_gaps(time: FloatArray, frame: float) -> tuple[FloatArray, BoolArray]:
    """Times with frame times added in gaps, where one jerk could not move the path; mask of the measured."""
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
    for count, least, where in (
        (int((t <= start).sum()), FEWEST_STATIC, "at or before"),
        (int((t > start).sum()), _FEWEST_MOVING, "after"),
    ):
        if count < least:
            raise ValueError(
                f"{count} flyer frames are {where} the start {start:.9g} s, at least {least} are needed;"
                f" choose a start inside the static frames (the record spans {t[0]:.9g} to {t[-1]:.9g} s)"
            )
