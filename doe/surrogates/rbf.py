"""Surrogates by radial basis functions over the unit box: of the whole response, and of a scalar cost.

Leave-one-out errors have a closed form. The whole response is reduced to principal components; each is
interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg
from scipy.interpolate import RBFInterpolator
from scipy.spatial.distance import pdist, squareform

from doe.arrays import FloatArray
from doe.box import Box
from doe.surrogates.pca import PrincipalComponents
from doe.surrogates.protocol import (
    DEFAULT_KERNELS,
    ComponentSurrogate,
    Kernel,
    SurrogateError,
    checked_runs,
    unit_points,
)

LARGEST_CONDITION = 1e12
"""Largest condition number of the reduced kernel matrix. Above it the leave-one-out operator has fewer than
four correct digits in float64."""

SMALLEST_DISTANCE = 1e-9
"""Smallest distance of two runs in the unit box; closer runs count as duplicates."""

LARGEST_MISFIT = 1e-8
"""Largest error at the runs over the largest |value|. At the runs the error of an interpolant is
round-off."""


@dataclass(frozen=True)
class RadialBasis:
    """An interpolant s(u) = sum_i c_i phi(|u - u_i|) + tail, one for each column of the values."""

    kernel: Kernel
    unit_points: FloatArray
    """The runs in the unit box [-], shape [n, d]."""
    loo_residuals: FloatArray
    """Value of each run minus its prediction by the interpolant of the other runs, shape [n, q]."""
    condition: float
    """Condition number of the reduced kernel matrix [-]."""
    interpolator: RBFInterpolator

    @classmethod
    def fit(cls, unit_points: FloatArray, values: FloatArray, kernel: Kernel) -> RadialBasis:
        """Interpolate values, shape [n, q], at runs in the unit box, shape [n, d].

        Raises SurrogateError if there are too few runs, if two coincide, if they do not determine the tail,
        or if the system is ill-conditioned.
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
                f"{kernel} differs from its runs by {misfit:.2e} (values up to {largest:.2e}): the system "
                "is too ill-conditioned; take a rougher kernel or a larger shape"
            )
        # e_i = c_i / B_ii with c = B f (docs: howto/doe.md).
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
    """The block B of the inverse saddle matrix that maps values to kernel coefficients, c = B f. With the
    tail's values P and an orthonormal basis Z of the null space of P^T it is B = Z (Z^T Phi Z)^-1 Z^T; the
    matrix in brackets is positive definite."""
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
    # The tail's columns have size 1: such a small singular value is an undetermined direction.
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
    # B_ii = 0 if only run i determines one term of the tail: the other runs do not determine that term.
    diagonal = np.diag(operator)
    lonely = np.flatnonzero(diagonal < 1e-12 * diagonal.max())
    if len(lonely):
        raise SurrogateError(
            f"without run {lonely[0]} the other {n - 1} do not determine the {terms} terms of the tail of "
            f"{kernel}; add a run or lower the degree"
        )
    return operator, condition


def choose_kernel(unit_points: FloatArray, values: FloatArray, kernels: Sequence[Kernel]) -> RadialBasis:
    """The interpolant with the smallest leave-one-out error."""
    best: RadialBasis | None = None
    refused: list[str] = []
    for kernel in kernels:
        try:
            basis = RadialBasis.fit(unit_points, values, kernel)
        except SurrogateError as error:
            refused.append(str(error))
            continue
        if best is None or basis.loo_rms < best.loo_rms:
            best = basis
    if best is None:
        reasons = "; ".join(refused) or "the list of kernels is empty"
        raise SurrogateError(f"no kernel can be used with {len(unit_points)} runs: {reasons}")
    return best


def _refuse_twins(unit_points: FloatArray) -> None:
    distances = squareform(pdist(unit_points))
    np.fill_diagonal(distances, np.inf)
    if distances.min() < SMALLEST_DISTANCE:
        i, j = np.unravel_index(int(np.argmin(distances)), distances.shape)
        raise SurrogateError(
            f"runs {i} and {j} are the same point (distance {distances.min():.1e} in the unit box)"
        )


@dataclass(frozen=True)
class ResponseSurrogate(ComponentSurrogate):
    """Predicts the response vector. A cost is computed from the prediction. A cost with absolute values has a
    kink where the response is smooth in the parameters. One surrogate is sufficient for every cost."""

    box: Box
    """Range of validity."""
    points: FloatArray
    """The runs it was built from, in parameter units, shape [n, d]."""
    components: PrincipalComponents
    basis: RadialBasis
    """The interpolant of the components' scores."""

    @classmethod
    def fit(
        cls,
        box: Box,
        points: ArrayLike,
        responses: ArrayLike,
        *,
        scale: ArrayLike = 1.0,
        variance: float = 1.0 - 1e-8,
        kernels: Sequence[Kernel] = DEFAULT_KERNELS,
    ) -> ResponseSurrogate:
        """Build it from runs, shapes [n, d] and [n, k], with the kernel of the smallest leave-one-out error.

        ``scale``, ``variance``: as in `PrincipalComponents.fit`. ``kernels``: candidates. A single candidate
        is used without comparison. Raises ValueError if a point is outside the box, shapes do not match, or
        an option is outside its range. Raises SurrogateError if a response is not finite, or no kernel can be
        used. Causes are too few runs (the message gives the required number), coinciding runs, or an
        ill-conditioned system.
        """
        x, y = checked_runs(box, points, responses)
        components = PrincipalComponents.fit(y, scale=scale, variance=variance)
        return cls(box, x, components, choose_kernel(box.unit(x), components.scores(y), kernels))

    def scores(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """Coordinates of the predicted response in the components [-], shape [m, d] -> [m, q]; errors as in
        `predict`."""
        return self.basis.predict(unit_points(self.box, points, extrapolate=extrapolate))

    @property
    def loo_residuals(self) -> FloatArray:
        """See `ComponentSurrogate`; in response units, shape [n, k]."""
        return self.components.deviation(self.basis.loo_residuals) + self.components.truncation


@dataclass(frozen=True)
class CostSurrogate:
    """Interpolates the cost itself, k = 1: the classic response surface, for comparison. A cost with absolute
    values has a kink at its optimum. A smooth interpolant does not follow the kink; its leave-one-out error
    shows this."""

    box: Box
    """Range of validity."""
    points: FloatArray
    """The runs it was built from, in parameter units, shape [n, d]."""
    basis: RadialBasis

    @classmethod
    def fit(
        cls, box: Box, points: ArrayLike, costs: ArrayLike, *, kernels: Sequence[Kernel] = DEFAULT_KERNELS
    ) -> CostSurrogate:
        """Build it from runs, shape [n, d], and their costs, shape [n], as `ResponseSurrogate.fit`."""
        column = np.asarray(costs, dtype=np.float64)
        if column.ndim != 1:
            raise ValueError(f"costs must have shape [n], got {list(column.shape)}")
        x, y = checked_runs(box, points, column[:, None])
        return cls(box, x, choose_kernel(box.unit(x), y, kernels))

    def predict(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """The cost at points in parameter units, shape [m, d] -> [m, 1], as `ResponseSurrogate.predict`."""
        return self.basis.predict(unit_points(self.box, points, extrapolate=extrapolate))

    def cost(self, point: ArrayLike) -> float:
        """The cost at one point of the box in parameter units, shape [d]; the function for a search."""
        return float(self.predict(np.asarray(point, dtype=np.float64)[None, :])[0, 0])

    @property
    def loo_residuals(self) -> FloatArray:
        """Value of each run minus its prediction from the other runs, in cost units, shape [n, 1]."""
        return self.basis.loo_residuals

    @property
    def loo_rms(self) -> float:
        """Root mean square of `loo_residuals` over the runs, in cost units."""
        return self.basis.loo_rms
