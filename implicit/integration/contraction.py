"""Element arrays from point values: the sums over Gauss points, as products of matrices (BLAS)."""

import numpy as np

from explicit.arrays import FloatArray

CHUNK = 60_000
"""Numbers of an intermediate array held at once, so that it stays in a core's cache."""


def element_forces(T: FloatArray, weighted: FloatArray) -> FloatArray:
    """Sum over the points of E and P dV: forces of each element [N], shape [m, k, d].

    Parameters
    ----------
    T
        Gradients [1/m] as `implicit.integration.geometry.Geometry.T`, shape [m, g, D, k].
    weighted
        P times the point's volume [N m], shape [m, g, d D].
    """
    m, g, columns, k = T.shape
    values = np.swapaxes(weighted.reshape(m, g, -1, columns), 2, 3)  # [m, g, D, d]
    of_points = np.ascontiguousarray(values).reshape(m, g * columns, -1)
    return np.matmul(np.swapaxes(T.reshape(m, g * columns, k), 1, 2), of_points)


def element_stiffness(T: FloatArray, weighted: FloatArray) -> FloatArray:
    """Sum over the points of E A dV E: stiffness of each element [N/m], shape [m, k d, k d].

    A is symmetric, so blocks (i, j) with i > j are transposes. `weighted` is A times the point's volume,
    shape [m, g, d D, d D]; the result has the precision of T, shape [m, g, D, k].
    """
    m, g, columns, k = T.shape
    d = weighted.shape[-1] // columns
    K = np.empty((m, k, d, k, d), dtype=T.dtype)
    size = max(1, CHUNK // (g * k * columns))
    for start in range(0, m, size):
        part = slice(start, start + size)
        of_points = T[part]
        n = len(of_points)
        left = np.swapaxes(of_points.reshape(n, g * columns, k), 1, 2)
        A = weighted[part].astype(T.dtype, copy=False).reshape(n, g, d * columns, d, columns)
        for j in range(d):
            right = np.matmul(A[:, :, : (j + 1) * columns, j], of_points)  # [., g, (i, J), k]
            for i in range(j + 1):
                of_pair = np.ascontiguousarray(right[:, :, i * columns : (i + 1) * columns])
                block = np.matmul(left, of_pair.reshape(n, g * columns, k))
                K[part, :, i, :, j] = block
                if i != j:
                    K[part, :, j, :, i] = np.swapaxes(block, 1, 2)
    return K.reshape(m, k * d, k * d)
