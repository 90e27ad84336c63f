"""Radial basis functions over the unit box with leave-one-out errors in closed form."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg
from scipy.interpolate import RBFInterpolator
from scipy.spatial.distance import pdist, squareform

from doe.arrays import FloatArray
from doe.surrogates.kernels import Kernel, SurrogateError

LARGEST_CONDITION = 1e12
"""Largest condition number of the reduced kernel matrix: beyond it fewer than four digits of the
leave-one-out operator are left in float64."""

SMALLEST_DISTANCE = 1e-9
"""Smallest distance of two runs in the unit box; closer ones are one run, twice."""

LARGEST_MISFIT = 1e-8
"""Largest error at the runs themselves over the largest |value|: an interpolant has round-off there."""


@dataclass(frozen=True)
class Candidate:
    """One kernel that was tried."""

    kernel: Kernel
    """The kernel."""
    loo_rms: float
    """Leave-one-out error: root of the mean over the runs of the squared length of the error vector
    [units of the values]; NaN if the kernel was refused."""
    condition: float
    """Condition number of the reduced kernel matrix [-]; NaN if it was not formed."""
    refused: str
    """Why the kernel could not be used; empty if it could."""


@dataclass(frozen=True)
class RadialBasis:
    """An interpolant s(u) = sum_i c_i phi(|u - u_i|) + tail, one for each column of the values."""

    kernel: Kernel
    """Its kernel."""
    unit_points: FloatArray
    """The runs in the unit box [-], shape [n, d]."""
    loo_residuals: FloatArray
    """Value minus what the interpolant of the other runs predicts there, shape [n, q]."""
    condition: float
    """Condition number of the reduced kernel matrix [-]."""
    interpolator: RBFInterpolator
    """SciPy's interpolant."""

    @classmethod
    def fit(cls, unit_points: FloatArray, values: FloatArray, kernel: Kernel) -> RadialBasis:
        """Interpolate the values at the runs.

        Parameters
        ----------
        unit_points
            The runs in the unit box [-], shape [n, d].
        values
            Shape [n, q].
        kernel
            The kernel.

        Raises
        ------
        SurrogateError
            If there are too few runs, two coincide, they do not determine the tail, or the system is
            ill-conditioned.
        """
        operator, condition = loo_operator(unit_points, kernel)
        try:
            interpolator = RBFInterpolator(
                unit_points,
                values,
                kernel=kernel.name,
                degree=kernel.degree,
                epsilon=1.0 if kernel.shape is None else kernel.shape,
            )
        except np.linalg.LinAlgError as error:
            raise SurrogateError(f"the system of {kernel} is singular: {error}") from error
        misfit = float(np.max(np.abs(interpolator(unit_points) - values)))
        largest = float(np.max(np.abs(values)))
        if misfit > LARGEST_MISFIT * largest:
            raise SurrogateError(
                f"{kernel} misses its own runs by {misfit:.2e} (values up to {largest:.2e}): "
                "the system is too ill-conditioned; take a rougher kernel or a larger shape"
            )
        # e_i = c_i / B_ii with c = B f (docs: doe.md).
        residuals = (operator @ values) / np.diag(operator)[:, None]
        return cls(kernel, unit_points, residuals, condition, interpolator)

    def predict(self, unit_points: FloatArray) -> FloatArray:
        """The interpolant at points of the unit box, shape [m, d] -> [m, q]."""
        return np.asarray(self.interpolator(unit_points), dtype=np.float64)

    @property
    def loo_rms(self) -> float:
        """Root of the mean over the runs of the squared length of the leave-one-out error vector."""
        return float(np.sqrt(np.mean(np.sum(self.loo_residuals**2, axis=1))))


def loo_operator(unit_points: FloatArray, kernel: Kernel) -> tuple[FloatArray, float]:
    """The block B of the inverse saddle matrix that maps values to kernel coefficients, c = B f.

    With the tail's values P and an orthonormal basis Z of the null space of P^T it is
    B = Z (Z^T Phi Z)^-1 Z^T; the matrix in brackets is positive definite.

    Parameters
    ----------
    unit_points
        The runs in the unit box [-], shape [n, d].
    kernel
        The kernel.

    Returns
    -------
    operator
        B, symmetric, shape [n, n].
    condition
        Condition number of Z^T Phi Z [-].

    Raises
    ------
    SurrogateError
        If there are too few runs, two coincide, they do not determine the tail (with one run left out),
        or the condition number is above 1e12.
    """
    n, d = unit_points.shape
    if n < kernel.n_needed(d):
        raise SurrogateError(
            f"{kernel} needs at least {kernel.n_needed(d)} runs for {d} parameter(s) "
            f"({kernel.n_terms(d)} terms in its tail and one to leave out), got {n}"
        )
    _refuse_twins(unit_points)
    tail = kernel.tail(unit_points)
    terms = tail.shape[1]
    left, singular, _ = np.linalg.svd(tail, full_matrices=True)
    # The tail's columns are of size 1, so that a singular value this small is a lost direction.
    if singular[-1] < 1e-10 * singular[0]:
        raise SurrogateError(
            f"the {n} runs do not determine the {terms} terms of the tail of {kernel}: they lie on a "
            "curve or plane, or have too few levels in one parameter; spread them or lower the degree"
        )
    null = left[:, terms:]
    reduced = null.T @ kernel.matrix(unit_points) @ null
    eigenvalues, vectors = linalg.eigh(0.5 * (reduced + reduced.T))
    smallest, largest = float(eigenvalues[0]), float(eigenvalues[-1])
    condition = largest / smallest if smallest > 0.0 else np.inf
    if condition > LARGEST_CONDITION:
        raise SurrogateError(
            f"the system of {kernel} is ill-conditioned: condition number {condition:.1e}, at most "
            f"{LARGEST_CONDITION:.0e} allowed; take a rougher kernel, a larger shape, or spread the runs"
        )
    half = (null @ vectors) / np.sqrt(eigenvalues)
    operator = half @ half.T
    # B_ii = 0 when run i alone carries one term of the tail: the others leave that term undetermined.
    diagonal = np.diag(operator)
    lonely = np.flatnonzero(diagonal < 1e-12 * diagonal.max())
    if len(lonely):
        raise SurrogateError(
            f"without run {lonely[0]} the other {n - 1} do not determine the {terms} terms of the tail of "
            f"{kernel}; add a run or lower the degree"
        )
    return operator, condition


def choose_kernel(
    unit_points: FloatArray, values: FloatArray, kernels: Sequence[Kernel]
) -> tuple[RadialBasis, tuple[Candidate, ...]]:
    """The interpolant with the smallest leave-one-out error, and what every candidate did.

    Parameters
    ----------
    unit_points
        The runs in the unit box [-], shape [n, d].
    values
        Shape [n, q].
    kernels
        The candidates.

    Raises
    ------
    SurrogateError
        If no candidate can be used; the message lists each with its reason.
    """
    best: RadialBasis | None = None
    candidates: list[Candidate] = []
    for kernel in kernels:
        try:
            basis = RadialBasis.fit(unit_points, values, kernel)
        except SurrogateError as error:
            candidates.append(Candidate(kernel, np.nan, np.nan, str(error)))
            continue
        candidates.append(Candidate(kernel, basis.loo_rms, basis.condition, ""))
        if best is None or basis.loo_rms < best.loo_rms:
            best = basis
    if best is None:
        reasons = "; ".join(candidate.refused for candidate in candidates) or "the list of kernels is empty"
        raise SurrogateError(f"no kernel can be used with {len(unit_points)} runs: {reasons}")
    return best, tuple(candidates)


def _refuse_twins(unit_points: FloatArray) -> None:
    distances = squareform(pdist(unit_points))
    np.fill_diagonal(distances, np.inf)
    if distances.min() < SMALLEST_DISTANCE:
        i, j = np.unravel_index(int(np.argmin(distances)), distances.shape)
        raise SurrogateError(
            f"runs {i} and {j} are the same point (distance {distances.min():.1e} in the unit box)"
        )
