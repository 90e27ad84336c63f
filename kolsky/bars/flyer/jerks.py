"""The flyer's jerks as Gaussian unknowns: prior, noise and posterior by the marginal likelihood.

`evidences` evaluates the marginal likelihood of many smoothnesses at once.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from kolsky.base.arrays import FloatArray

ZERO_PRIOR = 100.0
"""Prior standard deviation of the zero about the static frames' mean, in sigmas. The zero is practically
free."""
MOST_STARTS, SETTLED = 5, 1e-6
"""Two numbers: largest number of starts of the search for the smoothness, and the relative gain below which
the search stops."""
EQUAL_SIGMAS = 0.05
"""Relative difference below which sigmas are equal [-]."""
ADDED, LEAST_ADDED = 0.3, 1e-3
"""Noise common to all frames at the start of the search, and its lower limit, divided by the typical
sigma."""
VANISHED, BACK = 0.1, 1.0
"""Added noise below which the search is restarted, and the added noise of the restart, divided by the typical
sigma."""
CHANGE_PER_OCTAVE = 2.0
"""Prior standard deviation of the change of log tau from one control point to the next."""


def hat_functions(frames: FloatArray) -> FloatArray:
    """Linear hat functions in log(1 + frames) with control points at 0, 3, 6, 12, ... frames.

    ``frames``: middles of the spans, in frames since the start, increasing, shape [n_spans]. Returns: one
    column per control point; the sum of each row is 1 [-], shape [n_spans, n_controls].
    """
    control = [0.0, 3.0]
    while control[-1] < frames[-1]:
        control.append(2.0 * control[-1])
    at, x = np.log1p(control), np.log1p(frames)
    return np.column_stack([np.interp(x, at, row) for row in np.eye(at.size)])


def posterior(y: FloatArray, G: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean and covariance of z for y = G z + e with e, z ~ N(0, 1), and the residual.

    The method is QR of the stacked least-squares problem. G'G would square the condition number.

    ``y``: data in units of the noise [-], shape [n_frames]. ``G``: response of each datum to each unknown
    [-], shape [n_frames, n_unknowns]. Returns: mean [n_unknowns], covariance [n_unknowns, n_unknowns] and
    residual [n_frames].
    """
    n, p = G.shape
    stacked = np.zeros((n + p, p + 1), order="F")
    stacked[:n, :p], stacked[:n, p] = G, y
    np.fill_diagonal(stacked[n:], 1.0)
    # LAPACK is called directly. For such small matrices, SciPy's copies and checks take as long as the
    # factorisation.
    work = int(lapack.dgeqrf_lwork(n + p, p + 1)[0])
    factors = lapack.dgeqrf(stacked, lwork=work, overwrite_a=True)[0]
    R = factors[:p, :p]
    z, _ = lapack.dtrtrs(np.ascontiguousarray(R).T, factors[:p, p], lower=1, trans=1)
    inverse, _ = lapack.dpotri(R)  # of R'R, above the diagonal; R's own has no zero
    return z, np.where(_above(p), inverse, inverse.T), y - G @ z


@cache
def _above(n: int) -> NDArray[np.bool_]:
    """Entries on or above the diagonal, shape [n, n]."""
    return np.triu(np.ones((n, n), dtype=bool))


def noise_parts(weight: FloatArray) -> FloatArray:
    """Parts of each frame's variance, divided by its declared variance.

    They are a multiple of the declared variance, and a part that is equal in all frames.

    ``weight``: typical sigma divided by sigma [-], shape [n_frames]; 0 for a frame without displacement.
    Returns: shape [n_frames, 2]. If the sigmas are equal, the two parts cannot be distinguished and the shape
    is [n_frames, 1].
    """
    known = weight[weight > 0.0]
    if np.ptp(known) <= EQUAL_SIGMAS * known.max():
        return np.ones((weight.size, 1))
    return np.column_stack([np.ones(weight.size), weight**2])


def maximum_likelihood(
    y: FloatArray,
    weight: FloatArray,
    spans: FloatArray,
    hats: FloatArray,
    parts: FloatArray | None = None,
    shared: tuple[FloatArray, FloatArray] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Log noise scales [n_parts], >= 0, and log tau [n_controls] of largest marginal likelihood."""
    # Highest tau: the whole travel within a frame. Lowest: no effect on the last frame.
    highest, lowest = np.log(max(np.ptp(y), 10.0)), np.log(0.06 / hats.shape[0] ** 3)
    n, n_parts = hats.shape[1], 1 if parts is None else parts.shape[1]
    # Noise larger than the whole travel is excluded, because a line search there overflows.
    bounds = [(0.0, highest)] + [(np.log(LEAST_ADDED), highest)] * (n_parts - 1) + [(lowest, highest)] * n
    data = (y, weight, spans, hats, parts, shared)
    begin = [0.0] + [np.log(ADDED)] * (n_parts - 1)
    x, value, problem = _searched(np.concatenate([begin, np.linspace(0.0, 0.5 * lowest, n)]), data, bounds)
    if problem:
        raise ValueError(f"the smoothness of the flyer's motion could not be found: {problem}")
    added = np.zeros(x.size, dtype=bool)
    added[1:n_parts] = x[1:n_parts] < np.log(VANISHED)
    if added.any() and (evidence(x, *data)[1][added] < 0.0).any():
        # For a vanished part, the likelihood is flat in its logarithm, even if more of that part would
        # improve it. The sign of the slope shows whether it would.
        other, likelier, problem = _searched(np.where(added, np.log(BACK), x), data, bounds)
        x = other if likelier < value and not problem else x
    return x[:n_parts], x[n_parts:]


def _searched(
    x: FloatArray, data: tuple[object, ...], bounds: list[tuple[float, float]]
) -> tuple[FloatArray, float, str]:
    """Search for the least `evidence` from x: its point, its value, and the reason of a failure or ""."""
    from scipy.optimize import minimize  # loaded where it is of use

    value = np.inf
    for _ in range(MOST_STARTS):
        best = minimize(
            evidence, x, args=data, jac=True, method="L-BFGS-B", bounds=bounds, options={"ftol": 1e-8}
        )
        # If round-off ends a line search, it has converged if a new start from there brings no improvement.
        settled = bool(best.success) or abs(value - best.fun) < SETTLED * max(abs(best.fun), 1.0)
        x, value = best.x, float(best.fun)
        if settled:
            return x, value, ""
    return x, value, str(best.message)


def _state_space(
    weight: FloatArray, spans: FloatArray, shared: tuple[FloatArray, FloatArray] | None
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Matrices of the Kalman filter between frames: what is seen of the state (zero, x, v, a, correlated
    error), steps, effects of the jerks, and variance of the correlated error's change."""
    n, moving = weight.size, slice(weight.size - spans.size, weight.size)
    kicks, steps = np.zeros((n, 5)), np.tile(np.eye(5), (n, 1, 1))
    steps[moving, 1, 2] = steps[moving, 2, 3] = kicks[moving, 3] = spans
    steps[moving, 1, 3] = kicks[moving, 2] = spans**2 / 2.0
    kicks[moving, 1] = spans**3 / 6.0
    seen = weight[:, None] * np.array([1.0, 1.0, 0.0, 0.0, 0.0])
    if shared is not None:
        seen[:, 4], steps[:, 4, 4] = shared
    return seen, steps, kicks, 1.0 - steps[:, 4, 4] ** 2


class Evidences(NamedTuple):
    """-2 log of the marginal likelihood for several log scales and log tau."""

    values: FloatArray
    """The values, with the prior of the changes of log tau, shape [n]."""
    gradients: FloatArray
    """Their gradients, shape [n, n_parts + n_controls]."""


def evidences(
    thetas: FloatArray,
    y: FloatArray,
    weight: FloatArray,
    spans: FloatArray,
    hats: FloatArray,
    parts: FloatArray | None = None,
    shared: tuple[FloatArray, FloatArray] | None = None,
) -> Evidences:
    """-2 log of the marginal likelihood of log scales and log tau, with its gradients.

    The method is a Kalman filter over the state (zero, x, v, a) followed by the disturbance smoother (Durbin
    and Koopman, Time Series Analysis by State Space Methods, 2012, sections 4.3, 4.5 and 7.3). It remains
    accurate as tau approaches zero.

    ``thetas``: log noise scales, then log tau at the control points, shape [n, n_parts + n_controls]. ``y``:
    displacement over sigma, about the static frames' mean [-], shape [n_frames]. ``weight``: typical sigma
    over sigma [-], shape [n_frames]. A frame without displacement has weight 0 and y = 0. ``spans``: lengths
    of the spans in frames [-], shape [n_spans]; the frames before the last n_spans are static. ``hats``:
    values of `hat_functions` at the spans [-], shape [n_spans, n_controls]. ``parts``: parts of each frame's
    variance (`noise_parts`), shape [n_frames, n_parts]. The scales multiply them. None: the declared variance
    alone. ``shared``: an error that is correlated between frames, as an additional state. It is a first-order
    autoregression of variance 1. There are two arrays, shape [n_frames] each. The first is its size over
    sigma in each frame [-], 0 for a frame without displacement. The second is its correlation with the
    previous frame [-]. None: no such error.
    """
    parts = np.ones((y.size, 1)) if parts is None else parts
    scales, tau = np.split(thetas, [parts.shape[1]], axis=1)
    noise, variance = parts * np.exp(2.0 * scales[:, None]), np.exp(2.0 * tau @ hats.T)
    seen, steps, kicks, fresh = _state_space(weight, spans, shared)
    moving, data = slice(y.size - spans.size, y.size), weight > 0.0
    own = np.where(data, noise.sum(axis=2), 1.0)  # no displacement: no information on the noise
    growth, gains = np.zeros(own.shape), np.empty((*own.shape, 5))
    growth[:, moving] = variance
    S, miss, by_frame, by_kick = np.empty((4, *own.shape))
    rest = np.array([ZERO_PRIOR**2, 0.0, 0.0, 0.0, 1.0])
    from kolsky.bars.flyer.kernels import smooth  # loads Warp

    smooth(len(thetas), seen, steps, kicks, fresh, y, own, growth, rest, gains, S, miss, by_frame, by_kick)
    change = np.diff(tau, axis=1) / CHANGE_PER_OCTAVE
    values = np.sum(np.log(S) + S * miss**2, axis=1) + np.sum(change**2, axis=1)
    by_change = -2.0 / CHANGE_PER_OCTAVE * np.diff(change, prepend=0.0, append=0.0)
    by_noise = 2.0 * np.einsum("nk,nkp->np", by_frame[:, data], noise[:, data])
    by_tau = 2.0 * (variance * by_kick[:, moving]) @ hats + by_change
    return Evidences(values, np.concatenate([by_noise, by_tau], axis=1))


def evidence(theta: FloatArray, *data: Any) -> tuple[float, FloatArray]:
    """Value and gradient of `evidences` at one point, shape [n_parts + n_controls]."""
    found = evidences(theta[None], *data)
    return float(found.values[0]), found.gradients[0]
