"""The marginal likelihood of many smoothnesses of one flyer at once.

`kolsky.bars.flyer.jerks.evidence` works on matrices of four rows, so small that Python takes most of its
time. Here each step of the filter is done for all smoothnesses together; the numbers are the same.
"""

import numpy as np

from kolsky.bars.flyer.jerks import CHANGE_PER_OCTAVE, state_space
from kolsky.base.arrays import FloatArray


def evidences(
    thetas: FloatArray,
    y: FloatArray,
    weight: FloatArray,
    spans: FloatArray,
    hats: FloatArray,
    parts: FloatArray | None = None,
    shared: tuple[FloatArray, FloatArray] | None = None,
) -> FloatArray:
    """-2 log of the marginal likelihood of several log scales and log tau, without its gradients.

    Parameters
    ----------
    thetas
        Log noise scales, then log tau at the control points, shape [n, n_parts + n_controls].
    y, weight, spans, hats, parts, shared
        As for `kolsky.bars.flyer.jerks.evidence`.

    Returns
    -------
    NDArray
        The values, with the prior of the changes of log tau, shape [n].
    """
    parts = np.ones((y.size, 1)) if parts is None else parts
    scales, tau = np.split(thetas, [parts.shape[1]], axis=1)
    noise = np.sum(parts * np.exp(2.0 * scales)[:, None], axis=2)
    variance = np.exp(2.0 * np.array([hats @ one for one in tau]))
    own = np.where(weight > 0.0, noise, 1.0)  # a frame without a displacement says nothing of the noise
    seen, steps, kicks, P = state_space(weight, spans, shared)
    n, m = seen.shape
    growth, eye, still = np.zeros((len(thetas), m, m)), np.eye(m), n - spans.size
    state = np.zeros((len(thetas), m, 1))
    S, expected = np.empty((len(thetas), n)), np.empty((len(thetas), n, m))
    for k, (z, step) in enumerate(zip(seen, steps, strict=True)):
        if k >= still:
            growth = variance[:, k - still, None, None] * kicks[k, :, None] * kicks[k]
        if shared is not None:
            growth[:, 4, 4] = 1.0 - shared[1][k] ** 2
        P = step @ P @ step.T + growth
        column, noise_k = P @ z, own[:, k, None]
        S[:, k] = total = (column[:, None] @ z)[:, 0] + own[:, k]
        gain = column / total[:, None]
        upright = gain[:, :, None]
        rest = eye - upright * z
        P = rest @ P @ np.swapaxes(rest, 1, 2) + (noise_k * gain)[:, :, None] * gain[:, None]
        now = step @ state
        expected[:, k] = now[:, :, 0]
        state = rest @ now + upright * y[k]
    miss = (y - np.sum(seen * expected, axis=2)) / S
    change = np.diff(tau, axis=1) / CHANGE_PER_OCTAVE
    return np.sum(np.log(S) + S * miss**2, axis=1) + np.array([one @ one for one in change])
