"""A surrogate of the response that states its own error: principal components, a Gaussian process each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from doe.arrays import FloatArray
from doe.box import Box
from doe.surrogates.gaussian_process import LONGEST, SHORTEST, GaussianProcess, Hyperparameters
from doe.surrogates.pca import PrincipalComponents
from doe.surrogates.protocol import checked_runs, unit_points

OWN = 4
"""Leading components with hyperparameters of their own; the others, many and small, share theirs."""


@dataclass(frozen=True)
class ProcessSurrogate:
    """Predicts the response vector and its standard deviation, entry by entry.

    The standard deviation is that of the interpolation between the runs under the hyperparameters that
    the runs make most likely; what truncation lost is not in it.
    """

    box: Box
    """Where it holds."""
    points: FloatArray
    """The runs it was built from, in parameter units, shape [n, d]."""
    components: PrincipalComponents
    """The reduction of the response."""
    processes: tuple[GaussianProcess, ...]
    """Of the scores: one for each of the first components, one for all others together."""

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
        like: ProcessSurrogate | None = None,
    ) -> ProcessSurrogate:
        """Build it from runs, with the hyperparameters that make them most likely.

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
        like
            A surrogate of fewer runs, from whose hyperparameters the search for these starts.

        Raises
        ------
        ValueError
            If a point is outside the box, shapes do not match, or an option is outside its range.
        SurrogateError
            If a response is not finite, there are too few runs, or they do not determine a linear trend.
        """
        x, y = checked_runs(box, points, responses)
        components = PrincipalComponents.fit(y, scale=scale, variance=variance, truncation=truncation)
        u, groups = box.unit(x), _groups(components.scores(y))
        known = like is not None and len(like.processes) == len(groups)
        starts = _rescaled(like, box) if like is not None and known else [None] * len(groups)
        processes = [GaussianProcess.fit(u, f, start=h) for f, h in zip(groups, starts, strict=True)]
        return cls(box, x, components, tuple(processes))

    def predict(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """The response at points in parameter units, shape [m, d] -> [m, k].

        Raises
        ------
        ValueError
            If the shape is wrong, or a point is outside the box and `extrapolate` is False.
        """
        return self.components.expand(self.scores(points, extrapolate=extrapolate))

    def sigma(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """Standard deviation of the response at points, in its units, shape [m, d] -> [m, k].

        The components' errors are taken to be independent.

        Raises
        ------
        ValueError
            As `predict`.
        """
        spread = self.score_sigma(points, extrapolate=extrapolate)
        return np.asarray(np.sqrt(spread**2 @ self.components.basis**2) * self.components.scale)

    def scores(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """Means of the components' scores at points [-], shape [m, d] -> [m, q]."""
        u = unit_points(self.box, points, extrapolate=extrapolate)
        return np.concatenate([process.predict(u) for process in self.processes], axis=1)

    def score_sigma(self, points: ArrayLike, *, extrapolate: bool = False) -> FloatArray:
        """Standard deviations of the components' scores at points [-], shape [m, d] -> [m, q]."""
        u = unit_points(self.box, points, extrapolate=extrapolate)
        return np.concatenate([process.sigma(u) for process in self.processes], axis=1)

    def believing(self, points: ArrayLike) -> ProcessSurrogate:
        """The surrogate as if runs at these points had given what it predicts, shape [m, d].

        Its mean stays (up to the nugget); its standard deviation falls about the points.

        Raises
        ------
        ValueError
            If a point is outside the box.
        """
        x = self.box.require(points, what="point")
        u, groups = self.box.unit(np.concatenate([self.points, x])), []
        for process in self.processes:
            known = process.predict(np.concatenate([process.unit_points, self.box.unit(x)]))
            # The runs' own values, which a nugget lets the mean miss.
            known[: len(process.unit_points)] = process.values
            groups.append(GaussianProcess.given(u, known, process.hyperparameters, variance=process.variance))
        return ProcessSurrogate(self.box, np.concatenate([self.points, x]), self.components, tuple(groups))

    @property
    def condition(self) -> float:
        """Largest condition number of the processes' correlation matrices [-]."""
        return max(process.condition for process in self.processes)

    @property
    def n_components(self) -> int:
        """Number of components kept."""
        return self.components.n_components

    @property
    def truncation_error(self) -> FloatArray:
        """Largest |response - reduction| over the runs, in response units, shape [k]."""
        return self.components.truncation_error

    @property
    def nugget_error(self) -> FloatArray:
        """Largest |mean - run| of each score over the runs, expanded, in response units, shape [k]."""
        missed = np.concatenate([p.values - p.predict(p.unit_points) for p in self.processes], axis=1)
        return np.asarray(np.abs(self.components.deviation(missed)).max(axis=0))

    @property
    def loo_residuals(self) -> FloatArray:
        """Run minus what the other runs predict for it, in response units, shape [n, k].

        The components and hyperparameters stay those of all runs; what the components leave out of the
        run is part of its residual.
        """
        scores = np.concatenate([process.loo_residuals for process in self.processes], axis=1)
        return self.components.deviation(scores) + self.components.truncation

    @property
    def loo_standardised(self) -> FloatArray:
        """Leave-one-out residuals of the scores over their stated standard deviations [-], shape [n, q].

        Their root mean square is near 1 where the surrogate knows its own error.
        """
        return np.concatenate([p.loo_residuals / p.loo_sigma for p in self.processes], axis=1)

    @property
    def loo_rms(self) -> float:
        """Root mean square of `loo_residuals` / scale over runs and entries [-]."""
        return float(np.sqrt(np.mean((self.loo_residuals / self.components.scale) ** 2)))


def _rescaled(surrogate: ProcessSurrogate, box: Box) -> list[Hyperparameters | None]:
    """Its hyperparameters with the lengths in edges of another box."""
    edges = np.diff(surrogate.box.unit(np.array([box.lower, box.upper])), axis=0)[0]
    old = [process.hyperparameters for process in surrogate.processes]
    return [replace(h, lengths=np.clip(h.lengths / edges, SHORTEST, LONGEST)) for h in old]


def _groups(scores: FloatArray) -> list[FloatArray]:
    own = min(OWN, scores.shape[1])
    groups = [scores[:, p : p + 1] for p in range(own)]
    return groups if own == scores.shape[1] else [*groups, scores[:, own:]]
