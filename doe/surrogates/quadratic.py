"""A smoothing surrogate: a least-squares quadratic through many runs, with the roughness of its residuals.

Contact can make a response jump slightly from point to point. An interpolant reproduces every jump, and the
jumps dominate its slope. A least-squares quadratic through more runs than terms has the slope of the
response. Its residuals measure the roughness (Box and Draper, Response Surfaces).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import ArrayLike

from doe.arrays import FloatArray
from doe.box import Box
from doe.surrogates.protocol import SurrogateError, checked_runs, unit_points

RUNS_PER_TERM = 2.5
"""Number of runs that a design should have for each term of the quadratic."""
LARGEST_CONDITION = 1e6
"""Largest condition number of the terms at the runs. Above it the runs do not determine the quadratic."""


def terms(dimension: int) -> int:
    """Number of terms of a quadratic of `dimension` variables: (d + 1)(d + 2) / 2."""
    return (dimension + 1) * (dimension + 2) // 2


def runs_wanted(dimension: int) -> int:
    """Runs of a design for a quadratic: `RUNS_PER_TERM` for each of its terms."""
    return ceil(RUNS_PER_TERM * terms(dimension))


@dataclass(frozen=True)
class QuadraticSurrogate:
    """Predicts the response vector. Each entry is a quadratic of the unit coordinates."""

    box: Box
    """Range of validity."""
    points: FloatArray
    """The runs it was built from, in parameter units, shape [n, d]."""
    coefficients: FloatArray
    """Coefficients of the terms, in response units, shape [`terms`, k]."""
    residuals: FloatArray
    """Run minus quadratic, in response units, shape [n, k]."""
    leverage: FloatArray
    """Leverage: share of each run in its own prediction [-], shape [n]."""

    @classmethod
    def fit(
        cls, box: Box, points: ArrayLike, responses: ArrayLike, *, scale: ArrayLike = 1.0
    ) -> QuadraticSurrogate:
        """Build it from runs, shapes [n, d] and [n, k], by least squares for each entry. Scales of the
        entries have no effect.

        Raises ValueError if a point is outside the box, or shapes do not match. Raises SurrogateError if a
        response is not finite, if there are not more runs than terms, or if the runs do not determine the
        quadratic.
        """
        del scale
        x, y = checked_runs(box, points, responses)
        n, p = len(x), terms(box.dimension)
        if n <= p:
            raise SurrogateError(
                f"a quadratic of {box.dimension} variables has {p} terms and takes at least {p + 1} runs, "
                f"better {runs_wanted(box.dimension)}; there are {n}"
            )
        left, values, right = np.linalg.svd(_terms(box.unit(x)), full_matrices=False)
        if values[0] > LARGEST_CONDITION * values[-1]:
            raise SurrogateError(
                f"the {n} runs do not determine a quadratic of {box.dimension} variables (condition number "
                f"{values[0] / values[-1]:.2g}): spread them over the box"
            )
        fitted = left.T @ y
        coefficients = right.T @ (fitted / values[:, None])
        return cls(box, x, coefficients, y - left @ fitted, (left**2).sum(axis=1))

    def predict(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """The response at points in parameter units, shape [m, d] -> [m, k].

        Raises ValueError if the shape is wrong, or a point is outside the box and `extrapolate` is False.
        """
        return np.asarray(_terms(unit_points(self.box, points, extrapolate=extrapolate)) @ self.coefficients)

    @property
    def degrees_of_freedom(self) -> int:
        """Number of runs minus number of terms."""
        return len(self.points) - len(self.coefficients)

    def roughness(self, gain: ArrayLike) -> FloatArray:
        """Covariance of a linear map of one run's deviation from the quadratic, shape [m, m].

        ``gain``: the map, e.g. from a change of the response to the move of an optimum, shape [m, k]. The
        covariance has n - `terms` degrees of freedom. It includes the quadratic's lack of fit.
        """
        moves = self.residuals @ np.asarray(gain, dtype=np.float64).T
        return np.asarray(moves.T @ moves / self.degrees_of_freedom)

    @property
    def nugget_error(self) -> FloatArray:
        """Largest |run - quadratic| over the runs, in response units, shape [k]."""
        return np.asarray(np.abs(self.residuals).max(axis=0))

    @property
    def loo_residuals(self) -> FloatArray:
        """Response of each run minus its prediction from the other runs, in response units, shape [n, k].
        Infinite where the other runs do not determine the quadratic."""
        freedom = 1.0 - self.leverage
        interpolated = freedom <= 1e-12  # round-off of the leverage
        return np.where(
            interpolated[:, None], np.inf, self.residuals / np.where(interpolated, 1.0, freedom)[:, None]
        )


def _terms(unit: FloatArray) -> FloatArray:
    """Values of the terms at unit coordinates, shape [n, d] -> [n, terms]. They are centred for a better
    condition number."""
    z = 2.0 * unit - 1.0
    first, second = np.triu_indices(z.shape[1])
    return np.concatenate([np.ones((len(z), 1)), z, z[:, first] * z[:, second]], axis=1)
