r"""Multifrontal factorisation of element matrices, by dense BLAS and LAPACK.

Each front is assembled from its cells or its two halves and eliminated in part,

    F = [F11 .; F21 F22],   F11 = L11 L11^T,   L21 = F21 L11^-T,   F22 <- F22 - L21 L21^T,        (F.1)

and what is left goes to the parent. A matrix that is not symmetric, or not positive definite, is eliminated
by F11 = P L U in the same fronts instead; rows are exchanged inside a front only, which suffices where no
unknown is without a stiffness of its own.
"""

from collections.abc import Callable

import numpy as np
from scipy.linalg import lapack
from scipy.linalg.blas import dgemm, dsyrk, dtrsm

from explicit.arrays import FloatArray, IntArray
from implicit.linear.base import SingularError
from implicit.linear.dissection import Front

SMALLEST_PIVOT = 1e-13
"""Least pivot as a share of the diagonal's largest entry of the front; below it the matrix is singular."""


SMALL_ELEMENT = 30
"""Most components of elements that are added all at once."""


class _IndefiniteError(ValueError):
    """Cholesky's factorisation does not exist."""


class Multifrontal:
    """A factorised matrix; see `implicit.linear.base.Factors`."""

    def __init__(self, fronts: list[Front], elements: FloatArray, count: int, *, symmetric: bool) -> None:
        """Factorise the sum of element matrices of shape [m, k d, k d].

        Raises
        ------
        SingularError
            If it is singular.
        """
        self.fronts, self.count, self.positive = fronts, count, symmetric
        if symmetric:
            try:
                self._blocks = _factorised(fronts, elements, _cholesky, lower=True)
                return
            except _IndefiniteError:
                self.positive = False
        self._blocks = _factorised(fronts, elements, _lu, lower=False)

    def solve(self, right: FloatArray) -> FloatArray:
        """See `implicit.linear.base.Factors`."""
        return self._solve(right, transposed=False)

    def solve_transposed(self, right: FloatArray) -> FloatArray:
        """See `implicit.linear.base.Factors`."""
        return self._solve(right, transposed=not self.positive)

    def _solve(self, right: FloatArray, *, transposed: bool) -> FloatArray:
        x = np.array(right, dtype=float).reshape(self.count, -1)
        forward, backward = (_forward, _backward) if self.positive else (_lu_forward, _lu_backward)
        if transposed:
            forward, backward = _lu_forward_transposed, _lu_backward_transposed
        for front, block in zip(self.fronts, self._blocks, strict=True):
            own, outside = front.unknowns[: front.eliminated], front.unknowns[front.eliminated :]
            if len(own):
                forward(x, own, outside, block)
        for front, block in zip(reversed(self.fronts), reversed(self._blocks), strict=True):
            own, outside = front.unknowns[: front.eliminated], front.unknowns[front.eliminated :]
            if len(own):
                backward(x, own, outside, block)
        return x.reshape(np.shape(right))


Eliminate = Callable[[FloatArray, int], tuple[tuple[FloatArray, ...], FloatArray]]
"""Eliminates the first unknowns of a front: what is kept of them, and the matrix of the others."""


def _factorised(
    fronts: list[Front], elements: FloatArray, eliminate: Eliminate, *, lower: bool
) -> list[tuple[FloatArray, ...]]:
    """Factors of every front; `lower`: only lower triangles are filled in beyond the leaves."""
    blocks: list[tuple[FloatArray, ...]] = []
    updates: dict[int, FloatArray] = {}
    for number, front in enumerate(fronts):
        F = _assembled(front, elements[front.cells])
        for child, runs in zip(front.children, front.runs, strict=True):
            _add(F, updates.pop(child), runs, lower=lower)
        block, updates[number] = eliminate(F, front.eliminated)
        blocks.append(block)
    return blocks


def _assembled(front: Front, elements: FloatArray) -> FloatArray:
    """Sum of a front's element matrices, shape [n, n]; a last row for held components is dropped."""
    n = len(front.unknowns)
    if len(elements) == 0:
        return np.zeros((n, n), order="F")
    F = np.zeros((n + 1, n + 1), order="F")
    if elements.shape[1] <= SMALL_ELEMENT:
        places = front.local[:, :, None] + (n + 1) * front.local[:, None, :]
        np.add.at(F.reshape(-1, order="F"), places.ravel(), elements.ravel())
        return F[:n, :n]
    for element, local, coupled in zip(elements, front.local, front.coupled, strict=True):
        if coupled:
            np.add.at(F, np.ix_(local, local), element)
        else:
            F[np.ix_(local, local)] += element
    return F[:n, :n]


def _add(F: FloatArray, update: FloatArray, runs: list[tuple[int, int, int]], *, lower: bool) -> None:
    """Add a child's matrix, run by run of neighbours in both."""
    for i, (row, at_row, rows) in enumerate(runs):
        for column, at_column, columns in runs[: i + 1] if lower else runs:
            part = update[row : row + rows, column : column + columns]
            F[at_row : at_row + rows, at_column : at_column + columns] += part


def _cholesky(F: FloatArray, p: int) -> tuple[tuple[FloatArray, ...], FloatArray]:
    L, info = lapack.dpotrf(F[:p, :p], lower=1, clean=0)
    if info != 0 or (p and np.diag(L).min() ** 2 < SMALLEST_PIVOT * np.abs(np.diag(F)[:p]).max()):
        raise _IndefiniteError
    if p == len(F):
        return (L, np.zeros((0, p))), np.zeros((0, 0))
    if p == 0:
        return (L, np.zeros((len(F), 0))), F
    low = dtrsm(1.0, L, F[p:, :p], side=1, lower=1, trans_a=1)
    left = dsyrk(-1.0, low, beta=1.0, c=F[p:, p:], lower=1)
    return (L, low), left


def _lu(F: FloatArray, p: int) -> tuple[tuple[FloatArray, ...], FloatArray]:
    if p == 0:
        return (np.zeros((0, 0)), np.zeros(0), np.zeros((len(F), 0)), np.zeros((0, len(F)))), F
    LU, pivots, info = lapack.dgetrf(F[:p, :p])
    if p == len(F):
        low, right, left = np.zeros((0, p)), np.zeros((p, 0)), np.zeros((0, 0))
    least = np.abs(np.diag(LU)).min()
    if info != 0 or not least > SMALLEST_PIVOT * np.abs(np.diag(F)).max():
        raise SingularError(f"a pivot is {least:.3g} N/m: the stiffness is singular")
    if p == len(F):
        return (LU, pivots, low, right), left
    right = F[:p, p:].copy(order="F")
    for i, j in enumerate(pivots):
        if i != j:
            right[[i, j]] = right[[j, i]]
    right = dtrsm(1.0, LU, right, lower=1, diag=1)
    low = dtrsm(1.0, LU, F[p:, :p], side=1, lower=0)
    return (LU, pivots, low, right), dgemm(-1.0, low, right, beta=1.0, c=F[p:, p:])


def _forward(x: FloatArray, own: IntArray, outside: IntArray, block: tuple[FloatArray, ...]) -> None:
    L, low = block
    solved = dtrsm(1.0, L, x[own], lower=1)
    x[own] = solved
    x[outside] -= low @ solved


def _backward(x: FloatArray, own: IntArray, outside: IntArray, block: tuple[FloatArray, ...]) -> None:
    L, low = block
    x[own] = dtrsm(1.0, L, x[own] - low.T @ x[outside], lower=1, trans_a=1)


def _exchanged(rows: FloatArray, pivots: FloatArray, *, back: bool) -> FloatArray:
    order = range(len(pivots) - 1, -1, -1) if back else range(len(pivots))
    for i in order:
        j = int(pivots[i])
        if i != j:
            rows[[i, j]] = rows[[j, i]]
    return rows


def _lu_forward(x: FloatArray, own: IntArray, outside: IntArray, block: tuple[FloatArray, ...]) -> None:
    LU, pivots, low, _right = block
    solved = dtrsm(1.0, LU, _exchanged(x[own], pivots, back=False), lower=1, diag=1)
    x[own] = solved
    x[outside] -= low @ solved


def _lu_backward(x: FloatArray, own: IntArray, outside: IntArray, block: tuple[FloatArray, ...]) -> None:
    LU, _pivots, _low, right = block
    x[own] = dtrsm(1.0, LU, x[own] - right @ x[outside], lower=0)


def _lu_forward_transposed(
    x: FloatArray, own: IntArray, outside: IntArray, block: tuple[FloatArray, ...]
) -> None:
    LU, _pivots, _low, right = block
    solved = dtrsm(1.0, LU, x[own], lower=0, trans_a=1)
    x[own] = solved
    x[outside] -= right.T @ solved


def _lu_backward_transposed(
    x: FloatArray, own: IntArray, outside: IntArray, block: tuple[FloatArray, ...]
) -> None:
    LU, pivots, low, _right = block
    solved = dtrsm(1.0, LU, x[own] - low.T @ x[outside], lower=1, diag=1, trans_a=1)
    x[own] = _exchanged(solved, pivots, back=True)
