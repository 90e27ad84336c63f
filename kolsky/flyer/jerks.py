"""The flyer's jerks as Gaussian unknowns: their prior and the noise of largest likelihood, the posterior.

Everything is in units of sigma and frames: n_frames data y with weights sigma_typical / sigma, and one jerk
in each of the n_spans spans between the knots; tau is the jerks' prior standard deviation.
"""

import numpy as np
from scipy.linalg import lapack, qr, solve_triangular
from scipy.optimize import minimize

from kolsky.records import FloatArray

ZERO_PRIOR = 100.0
"""Prior standard deviation of the zero about the static frames' mean, in sigmas: practically free."""
MOST_STARTS, SETTLED = 5, 1e-6
"""Starts of the search for the smoothness, and the relative gain of a start that ends it."""
CHANGE_PER_OCTAVE = 2.0
"""Prior standard deviation of the change of log tau from one control point to the next."""


def hat_functions(frames: FloatArray) -> FloatArray:
    """Linear hat functions in log(1 + frames) with control points at 0, 3, 6, 12, ... frames.

    Parameters
    ----------
    frames
        Middles of the spans, in frames since the start, increasing, shape [n_spans].

    Returns
    -------
    NDArray
        One column a control point, rows adding up to 1 [-], shape [n_spans, n_controls].
    """
    control = [0.0, 3.0]
    while control[-1] < frames[-1]:
        control.append(2.0 * control[-1])
    at, x = np.log1p(control), np.log1p(frames)
    return np.column_stack([np.interp(x, at, row) for row in np.eye(at.size)])


def posterior(y: FloatArray, G: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean and covariance of z for y = G z + e with e, z ~ N(0, 1); the residual.

    By QR of the stacked least-squares problem, which the squared condition of G'G would not survive.

    Parameters
    ----------
    y
        Data in units of the noise [-], shape [n_frames].
    G
        Response of each datum to each unknown [-], shape [n_frames, n_unknowns].

    Returns
    -------
    tuple of NDArray
        Mean [n_unknowns], covariance [n_unknowns, n_unknowns] and residual [n_frames].
    """
    p = G.shape[1]
    stacked = np.block([[G, y[:, None]], [np.eye(p), np.zeros((p, 1))]])
    R = qr(stacked, mode="r", check_finite=False)[0][:p]
    z = solve_triangular(R[:, :p], R[:, p], check_finite=False)
    upper, _ = lapack.dpotri(R[:, :p])  # inverse of R'R; R's diagonal has no zero
    V = np.triu(upper) + np.triu(upper, 1).T
    return z, V, y - G @ z


def most_likely(
    y: FloatArray, weight: FloatArray, spans: FloatArray, hats: FloatArray
) -> tuple[float, FloatArray]:
    """Log noise scale (>= 0) and log tau at the control points, of largest marginal likelihood.

    Parameters
    ----------
    y, weight, spans, hats
        As for `evidence`.

    Returns
    -------
    tuple of float and NDArray
        Log of noise over declared sigma; log tau at the control points, shape [n_controls].

    Raises
    ------
    ValueError
        If the search for the maximum fails.
    """
    # Highest tau: the whole travel within a frame; lowest: no effect on the last frame.
    highest, lowest = np.log(max(np.ptp(y), 10.0)), np.log(0.06 / hats.shape[0] ** 3)
    n = hats.shape[1]
    x, value = np.concatenate([[0.0], np.linspace(0.0, 0.5 * lowest, n)]), np.inf
    for _ in range(MOST_STARTS):
        best = minimize(
            evidence,
            x,
            args=(y, weight, spans, hats),
            jac=True,
            method="L-BFGS-B",
            bounds=[(0.0, None)] + [(lowest, highest)] * n,
            options={"ftol": 1e-8},
        )
        # A line search that round-off ends has arrived if a new start from there gains nothing.
        settled = bool(best.success) or abs(value - best.fun) < SETTLED * max(abs(best.fun), 1.0)
        x, value = best.x, float(best.fun)
        if settled:
            break
    else:
        raise ValueError(f"the smoothness of the flyer's motion could not be found: {best.message}")
    return float(best.x[0]), best.x[1:]


def evidence(
    theta: FloatArray, y: FloatArray, weight: FloatArray, spans: FloatArray, hats: FloatArray
) -> tuple[float, FloatArray]:
    """-2 log of the marginal likelihood of log scale and log tau, with its gradient.

    A Kalman filter over the state (zero, x, v, a) and the disturbance smoother back (Durbin and Koopman,
    Time Series Analysis by State Space Methods, 2012, sections 4.3, 4.5 and 7.3). It stays accurate
    where tau goes to zero, and works on 4 x 4 matrices: the dense equations (as in `posterior`) gave the
    threads of BLAS work too small to share, at up to 40 times the cost on two busy cores.

    Parameters
    ----------
    theta
        Log noise scale, then log tau at the control points, shape [1 + n_controls].
    y
        Displacement over sigma, about the static frames' mean [-], shape [n_frames].
    weight
        Typical sigma over sigma [-], shape [n_frames].
    spans
        Lengths of the spans in frames [-], shape [n_spans]; the frames before the last n_spans are static.
    hats
        Values of `hat_functions` at the spans [-], shape [n_spans, n_controls].

    Returns
    -------
    tuple of float and NDArray
        The value, with the prior of the changes of log tau, and its gradient, shape [1 + n_controls].
    """
    noise, variance = np.exp(2.0 * theta[0]), np.exp(2.0 * (hats @ theta[1:]))
    static, kicks = y.size - spans.size, np.zeros((spans.size, 4))
    steps = np.tile(np.eye(4), (spans.size, 1, 1))
    steps[:, 1, 2] = steps[:, 2, 3] = kicks[:, 3] = spans
    steps[:, 1, 3] = kicks[:, 2] = spans**2 / 2.0
    kicks[:, 1] = spans**3 / 6.0
    growth = variance[:, None, None] * kicks[:, :, None] * kicks[:, None, :]
    state, P = np.zeros(4), np.diag([ZERO_PRIOR**2, 0.0, 0.0, 0.0])
    value, path = 0.0, []
    for k in range(y.size):
        i = k - static
        if i >= 0:
            state = steps[i] @ state
            P = steps[i] @ P @ steps[i].T + growth[i]
        column = weight[k] * (P[:, 0] + P[:, 1])  # P z with z = weight (1, 1, 0, 0)
        S = weight[k] * (column[0] + column[1]) + noise
        miss = y[k] - weight[k] * (state[0] + state[1])
        K = column / S
        state, P = state + K * miss, P - K[:, None] * column
        value += np.log(S) + miss**2 / S
        path.append((S, miss, K))
    by_noise, by_variance = 0.0, np.zeros(spans.size)
    r, N, one, z = np.zeros(4), np.zeros((4, 4)), np.eye(4), np.array([1.0, 1.0, 0.0, 0.0])
    zz = z[:, None] * z
    for k in reversed(range(y.size)):
        i, (S, miss, K) = k - static, path[k]
        by_noise += 1.0 / S + K @ N @ K - (miss / S - K @ r) ** 2
        L = one - K[:, None] * (weight[k] * z)
        r = weight[k] * z * miss / S + L.T @ r
        N = weight[k] ** 2 / S * zz + L.T @ N @ L
        if i >= 0:
            by_variance[i] = kicks[i] @ N @ kicks[i] - (kicks[i] @ r) ** 2
            r, N = steps[i].T @ r, steps[i].T @ N @ steps[i]
    change = np.diff(theta[1:]) / CHANGE_PER_OCTAVE
    by_change = -2.0 / CHANGE_PER_OCTAVE * np.diff(change, prepend=0.0, append=0.0)
    by_tau = (2.0 * variance * by_variance) @ hats + by_change
    return value + float(change @ change), np.concatenate([[2.0 * noise * by_noise], by_tau])
