"""Element arrays from point values: the sums over Gauss points, as products of matrices (BLAS)."""

import numpy as np

from explicit.arrays import FloatArray

CHUNK = 2_000_000
"""Numbers of an intermediate array held at once."""


def element_forces(E: FloatArray, weighted: FloatArray) -> FloatArray:
    """Sum over the points of E and P dV: forces of each element [N], shape [m, k, d].

    Parameters
    ----------
    E : array, shape [m, g, k, D]
        Gradients [1/m].
    weighted : array, shape [m, g, d D]
        P times the point's volume [N m].
    """
    m, g, k, columns = E.shape
    d = weighted.shape[-1] // columns
    flat = np.moveaxis(E, 2, 1).reshape(m, k, g * columns)
    values = np.moveaxis(weighted.reshape(m, g, d, columns), 2, 3).reshape(m, g * columns, d)
    return np.matmul(flat, values)


def element_stiffness(E: FloatArray, weighted: FloatArray) -> FloatArray:
    """Sum over the points of E A dV E: stiffness of each element [N/m], shape [m, k d, k d].

    A is symmetric, so blocks (i, k) with i > k are transposes. `weighted` is A times the point's volume,
    shape [m, g, d D, d D].
    """
    m, g, k, columns = E.shape
    d = weighted.shape[-1] // columns
    K = np.empty((m, k, d, k, d))
    A = weighted.reshape(m, g, d, columns, d, columns)
    size = max(1, CHUNK // (g * k * columns))
    for start in range(0, m, size):
        part = slice(start, start + size)
        of_points = np.ascontiguousarray(np.swapaxes(E[part], 2, 3))  # [., g, D, k]
        n = len(of_points)
        left = np.swapaxes(of_points.reshape(n, g * columns, k), 1, 2)
        for i in range(d):
            for j in range(i, d):
                right = np.matmul(A[part, :, i, :, j, :], of_points).reshape(n, g * columns, k)
                block = np.matmul(left, right)
                K[part, :, i, :, j] = block
                if i != j:
                    K[part, :, j, :, i] = np.swapaxes(block, 1, 2)
    return K.reshape(m, k * d, k * d)
