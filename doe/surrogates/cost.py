"""A surrogate of a scalar cost: the same radial basis functions on one number a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from doe.arrays import FloatArray
from doe.box import Box
from doe.surrogates.kernels import DEFAULT_KERNELS, Kernel
from doe.surrogates.protocol import checked_runs, unit_points
from doe.surrogates.rbf import Candidate, RadialBasis, choose_kernel


@dataclass(frozen=True)
class CostSurrogate:
    """Interpolates the cost itself, k = 1: the classic response surface, for comparison.

    A cost made of absolute values has a kink at its optimum, which no smooth interpolant follows; its
    leave-one-out error shows it.
    """

    box: Box
    """Where it holds."""
    points: FloatArray
    """The runs it was built from, in parameter units, shape [n, d]."""
    basis: RadialBasis
    """The interpolant."""
    candidates: tuple[Candidate, ...]
    """Every kernel that was tried, with its leave-one-out error in cost units or why it could not be used."""

    @classmethod
    def fit(
        cls, box: Box, points: ArrayLike, costs: ArrayLike, *, kernels: Sequence[Kernel] = DEFAULT_KERNELS
    ) -> CostSurrogate:
        """Build it from runs; the kernel with the smallest leave-one-out error wins.

        Parameters
        ----------
        box
            Where the runs lie.
        points
            The runs, in parameter units, shape [n, d].
        costs
            Their costs, shape [n].
        kernels
            Candidates; one only fixes the choice.

        Raises
        ------
        ValueError
            If a point is outside the box or shapes do not match.
        SurrogateError
            If a cost is not finite, or no kernel can be used (see `ResponseSurrogate.fit`).
        """
        column = np.asarray(costs, dtype=np.float64)
        if column.ndim != 1:
            raise ValueError(f"costs must have shape [n], got {list(column.shape)}")
        x, y = checked_runs(box, points, column[:, None])
        basis, candidates = choose_kernel(box.unit(x), y, kernels)
        return cls(box, x, basis, candidates)

    def predict(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """The cost at points in parameter units, shape [m, d] -> [m, 1].

        Raises
        ------
        ValueError
            If the shape is wrong, or a point is outside the box and `extrapolate` is False.
        """
        return self.basis.predict(unit_points(self.box, points, extrapolate=extrapolate))

    def cost(self, point: ArrayLike) -> float:
        """The cost at one point of the box in parameter units, shape [d]: what a search calls.

        Raises
        ------
        ValueError
            If the point is outside the box.
        """
        return float(self.predict(np.asarray(point, dtype=np.float64)[None, :])[0, 0])

    @property
    def kernel(self) -> Kernel:
        """The kernel that was chosen."""
        return self.basis.kernel

    @property
    def loo_residuals(self) -> FloatArray:
        """Run minus what the other runs predict for it, in cost units, shape [n, 1]."""
        return self.basis.loo_residuals

    @property
    def loo_rms(self) -> float:
        """Root mean square of `loo_residuals` over the runs, in cost units."""
        return self.basis.loo_rms
