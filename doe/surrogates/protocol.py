"""The interface of surrogates, the checks of their runs, and radial kernels with their tails."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import comb
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from doe.arrays import FloatArray
from doe.box import Box
from doe.surrogates.pca import PrincipalComponents

LEAST_DEGREE = {"thin_plate_spline": 1, "cubic": 1, "quintic": 2, "multiquadric": 0, "gaussian": 0}
"""Kernel names (scipy's), each with the lowest degree of the polynomial tail that makes the system solvable.
The Gaussian needs no tail, but also has degree 0: without a tail it does not reproduce a constant."""

SCALE_FREE = ("thin_plate_spline", "cubic", "quintic")
"""Kernels that need no shape parameter: a scale of r only scales them (except for the tail)."""


class SurrogateError(ValueError):
    """A surrogate cannot be built from these runs; the message names the reason."""


@dataclass(frozen=True)
class Kernel:
    """A radial function of the distance in the unit box, and the degree of its polynomial tail.

    Raises ValueError if the name is unknown or its degree is too low. Also if `shape` is missing, not
    positive, or given for a kernel without a shape parameter.
    """

    name: str
    """ "thin_plate_spline", "cubic", "quintic", "multiquadric" or "gaussian"."""
    degree: int
    shape: float | None = None
    """Shape parameter: the kernel depends on shape * r, r in edges of the unit box [-]."""

    def __post_init__(self) -> None:
        if self.name not in LEAST_DEGREE:
            raise ValueError(f"unknown kernel {self.name!r}; one of {sorted(LEAST_DEGREE)}")
        if self.degree < LEAST_DEGREE[self.name]:
            raise ValueError(
                f"the tail of kernel {self.name!r} needs degree >= {LEAST_DEGREE[self.name]}, "
                f"got {self.degree}"
            )
        if self.name in SCALE_FREE and self.shape is not None:
            raise ValueError(f"kernel {self.name!r} has no shape parameter, got {self.shape}")
        if self.name not in SCALE_FREE and not (self.shape is not None and 0.0 < self.shape < np.inf):
            raise ValueError(f"kernel {self.name!r} needs a shape parameter > 0, got {self.shape}")

    def __str__(self) -> str:
        shape = "" if self.shape is None else f", shape {self.shape:g}"
        return f"{self.name} (tail of degree {self.degree}{shape})"

    def n_terms(self, dimension: int) -> int:
        """Number of monomials in the tail for `dimension` parameters."""
        return comb(dimension + self.degree, dimension)

    def n_needed(self, dimension: int) -> int:
        """Smallest number of runs: one more than the tail's terms, because one run is left out."""
        return self.n_terms(dimension) + 1

    def matrix(self, unit_points: FloatArray) -> FloatArray:
        """Kernel values between all points, Phi_ij = phi(|u_i - u_j|), shape [n, n]. With these signs Phi is
        positive definite on vectors orthogonal to the tail."""
        r = cdist(unit_points, unit_points) * (1.0 if self.shape is None else self.shape)
        if self.name == "thin_plate_spline":
            # r^2 log r has the limit 0 at 0; the logarithm of 0 must not be computed.
            return r**2 * np.log(r, out=np.zeros_like(r), where=r > 0.0)
        if self.name == "cubic":
            return r**3
        if self.name == "quintic":
            return -(r**5)
        if self.name == "multiquadric":
            return -np.sqrt(1.0 + r**2)
        return np.exp(-(r**2))

    def tail(self, unit_points: FloatArray) -> FloatArray:
        """Monomials of the tail at the points, centred and scaled to their range, shape [n, n_terms]. The
        space that they span does not depend on this scale, and the numbers are near 1."""
        low, high = unit_points.min(axis=0), unit_points.max(axis=0)
        half = np.where(high > low, 0.5 * (high - low), 1.0)
        z = (unit_points - 0.5 * (low + high)) / half
        columns = [np.ones(len(z))]
        for degree in range(1, self.degree + 1):
            for chosen in combinations_with_replacement(range(z.shape[1]), degree):
                columns.append(np.prod(z[:, chosen], axis=1))
        return np.stack(columns, axis=1)


DEFAULT_KERNELS = (
    Kernel("thin_plate_spline", 1),
    Kernel("cubic", 1),
    Kernel("cubic", 2),
    Kernel("quintic", 2),
    Kernel("quintic", 3),
    Kernel("quintic", 4),
    Kernel("multiquadric", 1, 2.0),
    Kernel("gaussian", 1, 1.0),
    Kernel("gaussian", 1, 2.0),
    Kernel("gaussian", 1, 4.0),
)
"""The candidates, from rough to very smooth. The leave-one-out error selects one."""


class Surrogate(Protocol):
    """An approximation of an expensive function in a box, built from n runs, with an estimate of its
    error."""

    @property
    def box(self) -> Box:
        """The box in which it is valid."""

    @property
    def points(self) -> FloatArray:
        """The runs it was built from, in parameter units, shape [n, d]."""

    @property
    def loo_residuals(self) -> FloatArray:
        """Response of each run minus its prediction from the other runs, shape [n, k]."""

    def predict(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """The response at points in parameter units, shape [m, d] -> [m, k]. A point outside the box raises
        ValueError unless `extrapolate` is True."""


class ComponentSurrogate(ABC):
    """A surrogate of the scores of principal components. Its response is affine in the scores."""

    components: PrincipalComponents

    @abstractmethod
    def scores(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """Scores of the components at points in parameter units [-], shape [m, d] -> [m, q]; errors as in
        `predict`."""

    @property
    @abstractmethod
    def loo_residuals(self) -> FloatArray:
        """Response of each run minus its prediction from the other runs, in response units, shape [n, k]. It
        includes the run's truncation error. Components and other choices are those of all runs."""

    def predict(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """The response at points in parameter units, shape [m, d] -> [m, k].

        Raises ValueError if the shape is wrong, or a point is outside the box and `extrapolate` is False.
        """
        return self.components.expand(self.scores(points, extrapolate=extrapolate))

    @property
    def n_components(self) -> int:
        """Number of components kept."""
        return self.components.n_components

    @property
    def truncation_error(self) -> FloatArray:
        """Largest |response - reduction| over the runs, in response units, shape [k]."""
        return self.components.truncation_error

    @property
    def loo_rms(self) -> float:
        """Root mean square of `loo_residuals` / scale over runs and entries [-]."""
        return float(np.sqrt(np.mean((self.loo_residuals / self.components.scale) ** 2)))


def checked_runs(box: Box, points: ArrayLike, values: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Runs and their values as arrays [n, d] and [n, k]. It checks that a surrogate can use them.

    Raises ValueError if a point is outside the box or the shapes do not match. Raises SurrogateError if a
    value is not finite; the message names the run.
    """
    x = box.require(np.asarray(points, dtype=np.float64), what="run")
    y = np.asarray(values, dtype=np.float64)
    if y.ndim != 2 or len(y) != len(x) or y.shape[1] == 0:
        raise ValueError(f"values must have shape [{len(x)}, k] with k >= 1, got {list(y.shape)}")
    bad = np.argwhere(~np.isfinite(y))
    if len(bad):
        run, entry = bad[0]
        raise SurrogateError(
            f"run {run} has {y[run, entry]} in entry {entry} ({len(np.unique(bad[:, 0]))} of {len(y)} runs "
            "are not finite): omit the runs that did not complete, and state it"
        )
    return x, y


def unit_points(box: Box, points: ArrayLike, *, extrapolate: bool) -> FloatArray:
    """Points of a prediction in unit coordinates, shape [m, d].

    Raises ValueError if the shape is not [m, d], or a point is outside the box and `extrapolate` is False.
    """
    x = np.asarray(points, dtype=np.float64)
    if x.ndim != 2:
        raise ValueError(f"points must have shape [m, {box.dimension}], got {list(x.shape)}")
    return box.unit(x if extrapolate else box.require(x, what="point"))
