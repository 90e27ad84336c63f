"""Warp kernel of the likelihood of the flyer's jerks: a Kalman filter and the disturbance smoother."""

import warp as wp

from dic.correlation.kernels.launch import load_kernel
from explicit.device import GENERATING, select_device
from kolsky.base.arrays import FloatArray

f64 = wp.float64
vector, matrix = wp.types.vector(5, f64), wp.types.matrix((5, 5), f64)


@wp.kernel(module="unique", enable_backward=False)
def smoother(
    seen: wp.array(dtype=vector),
    steps: wp.array(dtype=matrix),
    kicks: wp.array(dtype=vector),
    fresh: wp.array(dtype=f64),
    y: wp.array(dtype=f64),
    noise: wp.array2d(dtype=f64),
    growth: wp.array2d(dtype=f64),
    prior: wp.array(dtype=f64),
    gains: wp.array2d(dtype=vector),
    S: wp.array2d(dtype=f64),
    misses: wp.array2d(dtype=f64),
    by_noise: wp.array2d(dtype=f64),
    by_growth: wp.array2d(dtype=f64),
):
    """Filter the frames forward, then smooth them backward, for the i-th smoothness."""
    i = wp.tid()
    n, one = y.shape[0], wp.identity(n=5, dtype=f64)
    P, state = matrix(), vector()
    for j in range(5):
        P[j, j] = prior[j]
    for k in range(n):
        P = steps[k] * P * wp.transpose(steps[k]) + growth[i, k] * wp.outer(kicks[k], kicks[k])
        P[4, 4] = P[4, 4] + fresh[k]
        column = P * seen[k]
        S[i, k] = wp.dot(seen[k], column) + noise[i, k]
        gain = column / S[i, k]
        rest = one - wp.outer(gain, seen[k])
        # this form keeps round-off below the noise
        P = rest * P * wp.transpose(rest) + noise[i, k] * wp.outer(gain, gain)
        state = steps[k] * state
        misses[i, k] = (y[k] - wp.dot(seen[k], state)) / S[i, k]
        state = rest * state + y[k] * gain
        gains[i, k] = gain
    # r and N: the information of all later frames, after each frame
    r, N = vector(), matrix()
    for back in range(n):
        k = n - 1 - back
        K, miss = gains[i, k], misses[i, k]
        rest = one - wp.outer(K, seen[k])
        off = miss - wp.dot(K, r)
        by_noise[i, k] = f64(1.0) / S[i, k] + wp.dot(K, N * K) - off * off
        pushed, kicked = wp.dot(seen[k], kicks[k]), rest * kicks[k]
        off = pushed * miss + wp.dot(kicked, r)
        by_growth[i, k] = pushed * pushed / S[i, k] + wp.dot(kicked, N * kicked) - off * off
        ahead, turned = wp.transpose(steps[k]) * seen[k], wp.transpose(rest * steps[k])
        r = miss * ahead + turned * r
        N = wp.outer(ahead, ahead) / S[i, k] + turned * N * wp.transpose(turned)


def smooth(count: int, *arrays: FloatArray) -> None:
    """Run the kernel for `count` smoothnesses on the CPU. ``arrays``: its arguments, see
    `kolsky.bars.flyer.jerks.evidences`; the last five are filled in."""
    with GENERATING:  # the paths of a flight are fitted in threads where forks are not safe
        load_kernel(smoother, select_device("cpu").alias, 1)
    wp.launch(smoother, dim=count, inputs=arrays, device="cpu", block_dim=1)
