"""The interface of surrogates, and the checks on the runs that go into one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from doe.arrays import FloatArray
from doe.box import Box
from doe.surrogates.kernels import SurrogateError


class Surrogate(Protocol):
    """A stand-in for an expensive function of a box, built from n runs, that knows its own error."""

    @property
    def box(self) -> Box:
        """The box in which it holds."""

    @property
    def points(self) -> FloatArray:
        """The runs it was built from, in parameter units, shape [n, d]."""

    @property
    def loo_residuals(self) -> FloatArray:
        """Run minus what the other runs predict for it, shape [n, k]."""

    def predict(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """The response at points in parameter units, shape [m, d] -> [m, k].

        A point outside the box is refused with a ValueError unless `extrapolate` is True.
        """


@runtime_checkable
class ComponentSurrogate(Surrogate, Protocol):
    """A surrogate of the scores of principal components, in which its response is affine."""

    @property
    def n_components(self) -> int:
        """Number of components."""

    @property
    def components(self) -> Any:
        """The `doe.surrogates.PrincipalComponents`."""

    def scores(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """The scores at points in parameter units, shape [m, d] -> [m, n_components]."""


@dataclass(frozen=True)
class SurrogateKind:
    """A kind of surrogate in the registry, with one way to fit all of them."""

    surrogate: Any
    """The class; its class method ``fit(box, points, values, ...)`` builds a `Surrogate` from runs."""
    summary: str
    """What it is, in a few words."""
    scalar: bool = False
    """Whether the response is one number a run; then `fit` of the class takes values of shape [n] and no
    scale."""

    def fit(self, box: Box, points: ArrayLike, values: ArrayLike, *, scale: ArrayLike = 1.0) -> Any:
        """Build the surrogate from runs.

        Parameters
        ----------
        box
            Where the runs lie.
        points
            The runs, in parameter units, shape [n, d].
        values
            Their responses, shape [n, k]; k = 1 for a scalar kind.
        scale
            What counts as a difference in each entry of the response, shape [k] or a number.

        Raises
        ------
        ValueError
            If a point is outside the box or shapes do not match.
        SurrogateError
            If no surrogate can be built from these runs.
        """
        if not self.scalar:
            return self.surrogate.fit(box, points, values, scale=scale)
        y = np.asarray(values, dtype=np.float64)
        if y.ndim != 2 or y.shape[1] != 1:
            raise ValueError(f"values of a scalar response must have shape [n, 1], got {list(y.shape)}")
        return self.surrogate.fit(box, points, y[:, 0])


def checked_runs(box: Box, points: ArrayLike, values: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Runs and their values as arrays [n, d] and [n, k], refused if they cannot make a surrogate.

    Raises
    ------
    ValueError
        If a point is outside the box or the shapes do not match.
    SurrogateError
        If a value is not finite; the message names the run.
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
            "are not finite): leave out the runs that did not complete, and say so"
        )
    return x, y


def unit_points(box: Box, points: ArrayLike, *, extrapolate: bool) -> FloatArray:
    """Points to predict at as unit coordinates, shape [m, d].

    Raises
    ------
    ValueError
        If the shape is not [m, d], or a point is outside the box and `extrapolate` is False.
    """
    x = np.asarray(points, dtype=np.float64)
    if x.ndim != 2:
        raise ValueError(f"points must have shape [m, {box.dimension}], got {list(x.shape)}")
    return box.unit(x if extrapolate else box.require(x, what="point"))
