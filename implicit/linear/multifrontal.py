r"""Multifrontal factorisation of element matrices, by dense BLAS and LAPACK.

Each front is assembled from its cells or its two halves and eliminated in part,

    F = [F11 .; F21 F22],   F11 = L11 L11^T,   L21 = F21 L11^-T,   F22 <- F22 - L21 L21^T,        (F.1)

and what is left goes to the parent. A matrix that is not symmetric, or not positive definite, is eliminated
by F11 = P L U in the same fronts instead; rows are exchanged inside a front only, which suffices where no
unknown is without a stiffness of its own.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.linalg import get_blas_funcs, get_lapack_funcs

from explicit.arrays import FloatArray, IntArray
from implicit.linear.assembly import Assembled, Assembly, Blocks
from implicit.linear.base import SingularError
from implicit.linear.dissection import Front
from implicit.linear.substitution import Substitution

SMALLEST_PIVOT = {"d": 1e-13, "f": 1e-6}
"""Least pivot as a share of the diagonal's largest entry of the front, in double and single precision; below
it the matrix is singular."""
_BLAS, _LAPACK = ("trsm", "syrk", "gemm"), ("potrf", "getrf", "laswp")
ROUTINES: dict[str, dict[str, Any]] = {
    kind: dict(zip(_BLAS, get_blas_funcs(_BLAS, dtype=kind), strict=True))
    | dict(zip(_LAPACK, get_lapack_funcs(_LAPACK, dtype=kind), strict=True))
    for kind in "df"
}
"""Routines of BLAS and LAPACK in both precisions."""


class _IndefiniteError(ValueError):
    """Cholesky's factorisation does not exist."""


class Multifrontal:
    """A factorised matrix; see `implicit.linear.base.Factors`."""

    def __init__(
        self,
        fronts: list[Front],
        assembly: Assembly,
        elements: FloatArray,
        count: int,
        *,
        symmetric: bool,
    ) -> None:
        """Factorise the sum of element matrices of shape [m, k d, k d], in their precision.

        Raises
        ------
        SingularError
            If it is singular.
        """
        self.fronts, self.count, self.positive = fronts, count, symmetric
        self._order = np.concatenate([front.unknowns[: front.eliminated] for front in fronts])
        self._kind = elements.dtype
        if symmetric:
            try:
                self._blocks, assembled = _factorised(assembly, elements, _cholesky, lower=True)
                self._substitution = Substitution(assembly, assembled)
                return
            except _IndefiniteError:
                self.positive = False
        self._blocks, _ = _factorised(assembly, elements, _lu, lower=False)

    def solve(self, right: FloatArray) -> FloatArray:
        """See `implicit.linear.base.Factors`."""
        return self._solve(right, transposed=False)

    def solve_transposed(self, right: FloatArray) -> FloatArray:
        """See `implicit.linear.base.Factors`."""
        return self._solve(right, transposed=not self.positive)

    def _solve(self, right: FloatArray, *, transposed: bool) -> FloatArray:
        if self.positive and right.ndim == 1:
            return self._solve_one(right)
        x = np.asarray(right, dtype=self._kind).reshape(self.count, -1)[self._order]
        forward, backward = (_forward, _backward) if self.positive else (_lu_forward, _lu_backward)
        if transposed:
            forward, backward = _lu_forward_transposed, _lu_backward_transposed
        for front, block in zip(self.fronts, self._blocks, strict=True):
            if front.eliminated:
                forward(x, front.own, front.outside, block)
        for front, block in zip(reversed(self.fronts), reversed(self._blocks), strict=True):
            if front.eliminated:
                backward(x, front.own, front.outside, block)
        found = np.empty((self.count, x.shape[1]))
        found[self._order] = x
        return found.reshape(np.shape(right))

    def _solve_one(self, right: FloatArray) -> FloatArray:
        x = np.asarray(right, dtype=self._kind)[self._order]
        self._substitution.solve(x)
        found = np.empty(self.count)
        found[self._order] = x
        return found


Eliminate = Callable[[Blocks], tuple[FloatArray, ...]]
"""Eliminates a front in place: what is kept of it. F22 becomes what is left for the parent."""


def _factorised(
    assembly: Assembly, elements: FloatArray, eliminate: Eliminate, *, lower: bool
) -> tuple[list[tuple[FloatArray, ...]], Assembled]:
    """Factors of every front, and where they stand; `lower`: only lower triangles are filled in."""
    assembled = assembly.start(elements, lower=lower)
    return [eliminate(assembled.front(number)) for number in range(len(assembly.shapes))], assembled


def _cholesky(blocks: Blocks) -> tuple[FloatArray, ...]:
    F11, low, _, F22 = blocks
    if F11.size == 0:
        return F11, low
    largest = F11.diagonal().max()
    use = ROUTINES[F11.dtype.char]
    L, info = use["potrf"](F11, lower=1, clean=0, overwrite_a=1)
    if info != 0 or L.diagonal().min() ** 2 < SMALLEST_PIVOT[F11.dtype.char] * largest:
        raise _IndefiniteError
    if F22.size:
        low = use["trsm"](1.0, L, low, side=1, lower=1, trans_a=1, overwrite_b=1)
        use["syrk"](-1.0, low, beta=1.0, c=F22, lower=1, overwrite_c=1)
    return L, low


def _lu(blocks: Blocks) -> tuple[FloatArray, ...]:
    F11, low, right, F22 = blocks
    if F11.size == 0:
        return F11, np.zeros(0), low, right
    largest = max(np.abs(F11.diagonal()).max(), np.abs(F22.diagonal()).max(initial=0.0))
    use = ROUTINES[F11.dtype.char]
    LU, pivots, info = use["getrf"](F11, overwrite_a=1)
    least = np.abs(LU.diagonal()).min()
    if info != 0 or not least > SMALLEST_PIVOT[F11.dtype.char] * largest:
        raise SingularError(f"a pivot is {least:.3g} N/m: the stiffness is singular")
    if F22.size:
        right = use["laswp"](right, pivots, overwrite_a=1)
        right = use["trsm"](1.0, LU, right, lower=1, diag=1, overwrite_b=1)
        low = use["trsm"](1.0, LU, low, side=1, lower=0, overwrite_b=1)
        use["gemm"](-1.0, low, right, beta=1.0, c=F22, overwrite_c=1)
    rows = use["laswp"](np.arange(len(LU), dtype=LU.dtype)[:, None], pivots)[:, 0].astype(np.int64)
    return LU, rows, low, right


def _forward(x: FloatArray, own: slice, outside: IntArray, block: tuple[FloatArray, ...]) -> None:
    L, low = block
    x[own] = _solved(L, x[own], lower=1)
    x[outside] -= low @ x[own]


def _backward(x: FloatArray, own: slice, outside: IntArray, block: tuple[FloatArray, ...]) -> None:
    L, low = block
    x[own] = _solved(L, x[own] - low.T @ x[outside], lower=1, trans_a=1)


def _lu_forward(x: FloatArray, own: slice, outside: IntArray, block: tuple[FloatArray, ...]) -> None:
    LU, rows, low, _right = block
    x[own] = _solved(LU, x[own][rows], lower=1, diag=1)
    x[outside] -= low @ x[own]


def _lu_backward(x: FloatArray, own: slice, outside: IntArray, block: tuple[FloatArray, ...]) -> None:
    LU, _rows, _low, right = block
    x[own] = _solved(LU, x[own] - right @ x[outside], lower=0)


def _lu_forward_transposed(
    x: FloatArray, own: slice, outside: IntArray, block: tuple[FloatArray, ...]
) -> None:
    LU, _rows, _low, right = block
    x[own] = _solved(LU, x[own], lower=0, trans_a=1)
    x[outside] -= right.T @ x[own]


def _lu_backward_transposed(
    x: FloatArray, own: slice, outside: IntArray, block: tuple[FloatArray, ...]
) -> None:
    LU, rows, low, _right = block
    solved = _solved(LU, x[own] - low.T @ x[outside], lower=1, diag=1, trans_a=1)
    x[own][rows] = solved


def _solved(L: FloatArray, right: FloatArray, **options: int) -> FloatArray:
    """Solution of a triangular system."""
    return np.asarray(ROUTINES[L.dtype.char]["trsm"](1.0, L, right, **options))
