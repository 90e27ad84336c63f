"""The match in NumPy and float64, one subset at a time: the reference for the fp32 kernels.

Pictures are read by `scipy.ndimage.map_coordinates` (order 5). Gradients are differences of these values.
Offset and contrast are columns of a least-squares problem; the kernels project them out.
"""

import numpy as np
from scipy import ndimage

from dic.correlation import subsets as warps

STEP = 1e-4  # of central differences [px]: truncation 1e-8, round-off 1e-11 of a grey level


class Picture:
    """A picture read between its pixels."""

    def __init__(self, grey):
        self.coefficients = ndimage.spline_filter(
            np.asarray(grey, dtype=np.float64), order=5, output=np.float64, mode="mirror"
        )

    def __call__(self, places):
        where = [places[..., 1], places[..., 0]]
        return ndimage.map_coordinates(self.coefficients, where, order=5, prefilter=False, mode="mirror")


def monomials(xi, parameters):
    """Columns of a displacement component, shape [n, parameters / 2]."""
    x, y = xi.T
    return np.stack([np.ones_like(x), x, y, x * x / 2, x * y, y * y / 2][: parameters // 2], axis=1)


def composed(warp, step):
    """Composition of the warp with the inverse of a small warp, by numerical derivatives at the centre."""
    origin = np.zeros(2)

    def whole(eta):
        xi = eta.copy()
        for _ in range(20):  # the offset that `step` maps to eta
            xi = xi - (warps.apply(origin, step, xi) - eta)
        return warps.apply(origin, warp, xi)

    h = 1e-2
    at = {(i, j): whole(h * np.array([i, j])) for i in (-1, 0, 1) for j in (-1, 0, 1)}
    first = [(at[1, 0] - at[-1, 0]) / (2 * h), (at[0, 1] - at[0, -1]) / (2 * h)]
    second = [
        (at[1, 0] - 2 * at[0, 0] + at[-1, 0]) / h**2,
        (at[1, 1] - at[1, -1] - at[-1, 1] + at[-1, -1]) / (4 * h**2),
        (at[0, 1] - 2 * at[0, 0] + at[0, -1]) / h**2,
    ]
    u, v = at[0, 0]
    slopes = [first[0][0] - 1, first[1][0], first[0][1], first[1][1] - 1]
    return np.array([u, v, *slopes, *(s[0] for s in second), *(s[1] for s in second)])


def match(f, g, point, guess, *, subset, parameters, reference=None, iterations=60):
    """The warp without a remaining steepest descent in the picture g; f and g are `Picture`."""
    half = subset // 2
    offsets = np.arange(-half, half + 1, dtype=np.float64)
    xi = np.stack(np.meshgrid(offsets, offsets), axis=-1).reshape(-1, 2)
    point = np.broadcast_to(point, xi.shape)
    reference = np.zeros(12) if reference is None else reference
    template = f(warps.apply(point, reference, xi))
    slope = [
        f(warps.apply(point, reference, xi + d)) - f(warps.apply(point, reference, xi - d))
        for d in (np.array([STEP, 0.0]), np.array([0.0, STEP]))
    ]
    shapes = monomials(xi, parameters)
    descents = np.hstack([shapes * (s / (2 * STEP))[:, None] for s in slope])
    columns = np.hstack([np.ones((len(xi), 1)), template[:, None], descents])
    size = np.abs(columns).max(axis=0)
    warp = guess.copy()
    for _ in range(iterations):
        seen = g(warps.apply(point, warp, xi))
        found = np.linalg.lstsq(columns / size, seen, rcond=None)[0] / size
        d = found[2:] / (seen.std() / template.std())
        step = np.zeros(12)
        order = parameters // 2
        step[0], step[1] = d[0], d[order]
        if order > 1:
            step[2:4], step[4:6] = d[1:3], d[order + 1 : order + 3]
        if order > 3:
            step[6:9], step[9:12] = d[3:6], d[order + 3 :]
        warp = composed(warp, step)
        if np.abs(step[:6]).max() < 1e-11:
            break
    zncc = np.corrcoef(template, g(warps.apply(point, warp, xi)))[0, 1]
    return warp, zncc
