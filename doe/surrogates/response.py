"""A surrogate of the whole response: principal components, each interpolated over the unit box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from doe.arrays import FloatArray
from doe.box import Box
from doe.surrogates.kernels import DEFAULT_KERNELS, Kernel
from doe.surrogates.pca import PrincipalComponents
from doe.surrogates.protocol import checked_runs, unit_points
from doe.surrogates.rbf import Candidate, RadialBasis, choose_kernel


@dataclass(frozen=True)
class ResponseSurrogate:
    """Predicts the response vector; a cost is then formed from the prediction, not interpolated.

    The response is smooth in the parameters where a cost made of absolute values has a kink, and one
    surrogate serves every cost.
    """

    box: Box
    """Where it holds."""
    points: FloatArray
    """The runs it was built from, in parameter units, shape [n, d]."""
    components: PrincipalComponents
    """The reduction of the response."""
    basis: RadialBasis
    """The interpolant of the components' scores."""
    candidates: tuple[Candidate, ...]
    """Every kernel that was tried, with its leave-one-out error over the scaled response or the reason
    why it could not be used."""

    @classmethod
    def fit(
        cls,
        box: Box,
        points: ArrayLike,
        responses: ArrayLike,
        *,
        scale: ArrayLike = 1.0,
        variance: float = 1.0 - 1e-8,
        truncation: float | None = None,
        kernels: Sequence[Kernel] = DEFAULT_KERNELS,
    ) -> ResponseSurrogate:
        """Build it from runs; the kernel with the smallest leave-one-out error wins.

        Parameters
        ----------
        box
            Where the runs lie.
        points
            The runs, in parameter units, shape [n, d].
        responses
            Their responses, shape [n, k].
        scale
            What an entry's deviations are measured by, in response units: a number or shape [k].
        variance
            Share of the scaled variance the components keep, in (0, 1].
        truncation
            If given, rules instead of `variance`: largest allowed |response - reduction| / scale.
        kernels
            Candidates; one only fixes the choice.

        Raises
        ------
        ValueError
            If a point is outside the box, shapes do not match, or an option is outside its range.
        SurrogateError
            If a response is not finite, or no kernel can be used: too few runs (the message says how
            many it takes), coinciding runs, an ill-conditioned system.
        """
        x, y = checked_runs(box, points, responses)
        components = PrincipalComponents.fit(y, scale=scale, variance=variance, truncation=truncation)
        basis, candidates = choose_kernel(box.unit(x), components.scores(y), kernels)
        return cls(box, x, components, basis, candidates)

    def predict(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """The response at points.

        Parameters
        ----------
        points
            In parameter units, shape [m, d].
        extrapolate
            Allow points outside the box.

        Returns
        -------
        responses
            In response units, shape [m, k].

        Raises
        ------
        ValueError
            If the shape is wrong, or a point is outside the box and `extrapolate` is False.
        """
        return self.components.expand(self.scores(points, extrapolate=extrapolate))

    def scores(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """Coordinates of the response in the components, as `predict`, shape [m, d] -> [m, q]."""
        return self.basis.predict(unit_points(self.box, points, extrapolate=extrapolate))

    @property
    def kernel(self) -> Kernel:
        """The kernel that was chosen."""
        return self.basis.kernel

    @property
    def n_components(self) -> int:
        """Number of components kept."""
        return self.components.n_components

    @property
    def truncation_error(self) -> FloatArray:
        """Largest |response - reduction| over the runs, in response units, shape [k]."""
        return self.components.truncation_error

    @property
    def loo_residuals(self) -> FloatArray:
        """Run minus what the other runs predict for it, in response units, shape [n, k].

        The components stay those of all runs; what they leave out of the run is part of its residual.
        """
        return self.components.deviation(self.basis.loo_residuals) + self.components.truncation

    @property
    def loo_rms_entries(self) -> FloatArray:
        """Root mean square of `loo_residuals` over the runs, in response units, shape [k]."""
        return np.asarray(np.sqrt(np.mean(self.loo_residuals**2, axis=0)))

    @property
    def loo_rms(self) -> float:
        """Root mean square of `loo_residuals` / scale over runs and entries [-]."""
        return float(np.sqrt(np.mean((self.loo_residuals / self.components.scale) ** 2)))
