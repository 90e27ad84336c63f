"""What every surrogate offers, and the checks on what goes into one."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from doe.arrays import FloatArray
from doe.box import Box
from doe.surrogates.kernels import SurrogateError


class Surrogate(Protocol):
    """A stand-in for an expensive function of a box, built from n runs, that knows its own error."""

    @property
    def box(self) -> Box:
        """Where it holds."""

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
