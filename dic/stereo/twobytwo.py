"""Many 2 x 2 matrices at once, in closed form: LAPACK takes its time for each of them."""

import numpy as np

from dic.arrays import FloatArray


def inverse(M: FloatArray) -> FloatArray:
    """Inverses, shape [..., 2, 2]; not finite where a determinant is zero."""
    a, b, c, d = M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1]
    result = np.empty(M.shape)
    result[..., 0, 0], result[..., 0, 1], result[..., 1, 0], result[..., 1, 1] = d, -b, -c, a
    result /= (a * d - b * c)[..., None, None]
    return result


def largest_eigenvalue(M: FloatArray) -> FloatArray:
    """The larger eigenvalues of matrices that have real ones, shape [...]."""
    a, b, c, d = M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1]
    half = 0.5 * (a - d)
    # rounding must not make a double eigenvalue complex
    return np.asarray(0.5 * (a + d) + np.sqrt(np.maximum(half * half + b * c, 0.0)))
