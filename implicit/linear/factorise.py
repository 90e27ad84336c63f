"""Factorisations of the tangent stiffness."""

from typing import Protocol

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from explicit.arrays import FloatArray


class Factors(Protocol):
    """A factorised matrix."""

    def solve(self, right: FloatArray) -> FloatArray:
        """Solutions of K x = b for columns b, shape [n] or [n, n_right]."""
        ...

    def solve_transposed(self, right: FloatArray) -> FloatArray:
        """Solutions of K^T x = b."""
        ...


class SingularError(ValueError):
    """The matrix is singular."""


class SuperLU:
    """SciPy's SuperLU with the order of minimum degree of K + K^T and pivots on the diagonal."""

    def __init__(self, matrix: csr_array) -> None:
        try:
            self._factors = splu(
                matrix.tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as problem:
            raise SingularError(str(problem)) from problem

    def solve(self, right: FloatArray) -> FloatArray:
        """See `Factors`."""
        return np.asarray(self._factors.solve(right))

    def solve_transposed(self, right: FloatArray) -> FloatArray:
        """See `Factors`."""
        return np.asarray(self._factors.solve(right, trans="T"))


def factorise(matrix: csr_array) -> Factors:
    """Factorise a matrix.

    Raises
    ------
    SingularError
        If it is singular.
    """
    if not np.isfinite(matrix.data).all():
        raise SingularError("the matrix has entries that are not finite")
    return SuperLU(matrix)
