"""Global sensitivity: Sobol indices and screening of misfits and peak force over a box of parameters.

The solver runs every point of the sample. Alternatively, a surrogate of the response is fitted to runs over
the box.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.views import ResultViews
from doe import Box, ResponseSurrogate, latin_hypercube
from doe.sensitivity import (
    SILENT,
    ElementaryEffects,
    HistoryIndices,
    SaltelliSample,
    SobolIndices,
    history_indices,
    morris,
    sobol_indices,
)
from doe.surrogates import SurrogateError
from kolsky.base.arrays import FloatArray
from kolsky.inverse.observations import Observations, Prediction, predict
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.run_table import terms
from kolsky.inverse.settings import Numerics
from kolsky.shot.records import Shot
from kolsky.studies.local_sensitivity import completed_runs

OUTPUTS = ("Phi_F", "Phi_S", "Phi", "peak force")
"""Scalar outputs: Eqs. (M.4), (M.3), (M.5) and the largest transmitted force."""
WITHOUT_OUTLINE = ("Phi_F", "peak force")
"""Outputs of a shot without an outline."""
CHUNK = 256
"""Number of runs per batch."""


@dataclass(frozen=True)
class Observables:
    """Force samples, bin means and outline points as one vector, and the scalar outputs of this vector."""

    observations: Observations
    counted: NDArray[np.bool_]
    """Outline points that every run reaches, shape [n_points]."""

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the scalar outputs."""
        return OUTPUTS if self.counted.any() else WITHOUT_OUTLINE

    @property
    def histories(self) -> dict[str, slice]:
        """Slices of the bin means and the outline in the vector."""
        samples, bins = len(self.observations.force.time), self.observations.n_force
        whole = {"force": slice(samples, samples + bins)}
        if self.counted.any():
            whole["outline"] = slice(samples + bins, samples + bins + int(self.counted.sum()))
        return whole

    @property
    def noise(self) -> FloatArray:
        """Measured standard deviations of the vector's entries, shape [k]."""
        o = self.observations
        return np.concatenate([o.force.sigma, o.force_sigma, o.centre_line.sigma[self.counted]])

    def vectors(self, prediction: Prediction) -> FloatArray:
        """Vectors of runs, shape [n, k]."""
        return np.concatenate(
            [prediction.force, prediction.force_bins, prediction.Z[:, self.counted]], axis=1
        )

    def scalars(self, vectors: FloatArray) -> FloatArray:
        """The scalar outputs of vectors, shape [n, s]."""
        parts = self.histories
        force, bins = vectors[:, : parts["force"].start], vectors[:, parts["force"]]
        Z = np.full((len(vectors), self.counted.size), np.nan)
        if self.counted.any():
            Z[:, self.counted] = vectors[:, parts["outline"]]
        inside = np.broadcast_to(self.counted, Z.shape)
        prediction = Prediction(force, bins, Z, inside)
        found = [terms(prediction, self.observations, i) for i in range(len(vectors))]
        columns = {
            "Phi_F": [t.phi_force for t in found],
            "Phi_S": [t.phi_shape for t in found],
            "Phi": [t.phi for t in found],
            "peak force": force.max(axis=1),
        }
        return np.column_stack([columns[name] for name in self.outputs])


def _observed(
    shot: Shot, points: FloatArray, box: Box, numerics: Numerics | None
) -> tuple[Observables, FloatArray]:
    """The observables of a shot, and its vectors at points of a box, simulated in batches."""
    prepared, parts = prepare_shot(shot), []
    for start in range(0, len(points), CHUNK):
        some = points[start : start + CHUNK]
        values: dict[str, FloatArray | float] = {name: some[:, i] for i, name in enumerate(box.names)}
        cure = "; take a smaller box"
        response = completed_runs(prepared.forward, values, numerics or Numerics(), cure=cure)
        parts.append(predict(response, prepared.observations))
    seen = Prediction.joined(parts)
    observables = Observables(prepared.observations, np.asarray(seen.inside.all(axis=0)))
    return observables, observables.vectors(seen)


LARGEST_ERROR = 0.1
"""Largest accepted error of the surrogate at test runs, as a share of an output's variance."""


@dataclass(frozen=True)
class GlobalSensitivity(ResultViews):
    """Shares of the parameters in the variance of misfits and histories over a box."""

    shot: str
    box: Box
    """Ranges of the parameters, which vary uniformly and independently."""
    runs: int
    by_surrogate: bool
    """True if a surrogate was used, False if the solver ran all points."""
    errors: dict[str, float]
    """Error of the surrogate at test runs, as a share of an output's variance [-], for the scalars, "force"
    and "outline". Empty without a surrogate."""
    refused: dict[str, str]
    """Outputs without indices, and why."""
    scalars: SobolIndices | None
    """Indices of misfits and peak force; None if all are rejected."""
    force_times: FloatArray
    """Bin centres [s], shape [n_bins]."""
    force: HistoryIndices | None
    """Indices of the force's bin means; None if rejected."""
    outline_times: FloatArray
    """Frame times of the outline points that every run reaches [s], shape [Q]. Empty without an outline."""
    outline: HistoryIndices | None
    """Indices of the radius at these points. None if rejected, or without an outline."""

    def outline_by_frame(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Generalised indices of the outline of every frame.

        They are the indices of its points, weighted by their variances.

        Returns: frames [s], shape [M]. Returns: indices [-], shape [d, M]; NaN if the outline hardly varies.
        Raises ValueError if there are no indices of the outline.
        """
        if self.outline is None:
            raise ValueError("there are no indices of the outline")
        times, frame = np.unique(self.outline_times, return_inverse=True)
        weight = self.outline.variance
        size = np.bincount(frame, weights=weight)
        quiet = size <= SILENT * size.max()

        def mean(index: FloatArray) -> FloatArray:
            sums = [np.bincount(frame, weights=np.nan_to_num(row) * weight) for row in index]
            return np.where(quiet, np.nan, np.array(sums) / np.where(quiet, 1.0, size))

        return times, mean(self.outline.first), mean(self.outline.total)


SEED = 1
"""Seed of every draw."""


def solver_sensitivity(
    shot: Shot, box: Box, *, n: int = 256, numerics: Numerics | None = None
) -> GlobalSensitivity:
    """Sobol' indices by the solver itself, n (d + 2) runs.

    Parameters
    ----------
    shot
        A loaded shot.
    box
        A box over parameters of `kolsky.inverse.parameters.PARAMETERS`.
    n
        Points of each of the d + 2 samples, a power of two.
    numerics
        Mesh, precision, device.

    Raises
    ------
    ValueError
        If a run does not complete, or if a parameter is unknown or outside its range.
    """
    sample = SaltelliSample.draw(box.dimension, n, SEED)
    sets = [sample.A, sample.B, *(sample.mixed(i) for i in range(box.dimension))]
    points = box.scale(np.concatenate(sets))
    observables, vectors = _observed(shot, points, box, numerics)
    row = {point.tobytes(): i for i, point in enumerate(points)}

    def made(x: FloatArray) -> FloatArray:
        """The stored runs. The same seed gives the same points."""
        return vectors[[row[point.tobytes()] for point in x]]

    return _indices(shot, box, observables, made, n=n, runs=len(points), errors={}, by_surrogate=False)


def global_sensitivity(
    shot: Shot,
    box: Box,
    *,
    runs: int = 128,
    unseen: int = 32,
    n: int = 1024,
    numerics: Numerics | None = None,
) -> GlobalSensitivity:
    """Sobol' indices by a tested surrogate of the response.

    Parameters
    ----------
    shot, box, n, numerics
        As in `solver_sensitivity`.
    runs, unseen
        Runs of the surrogate's design, and further runs to test it.

    Raises
    ------
    ValueError
        If a run does not complete, or if a parameter is unknown or outside its range.
    doe.surrogates.protocol.SurrogateError
        If the surrogate cannot be built, or if no part of it is accurate enough. The message gives the
        remedy.
    """
    design = latin_hypercube(box, runs, rng=SEED, optimise=True)
    others = latin_hypercube(box, unseen, rng=SEED + 1)
    points = np.concatenate([design.points, others.points])
    observables, vectors = _observed(shot, points, box, numerics)
    surrogate = ResponseSurrogate.fit(box, design.points, vectors[:runs], scale=observables.noise)
    errors = _errors(observables, vectors, surrogate.predict(others.points))
    if min(errors.values()) > LARGEST_ERROR:
        raise SurrogateError("; ".join(f"{name}: {_refusal(error)}" for name, error in errors.items()))
    return _indices(
        shot, box, observables, surrogate.predict, n=n, runs=runs + unseen, errors=errors, by_surrogate=True
    )


def _errors(observables: Observables, vectors: FloatArray, told: FloatArray) -> dict[str, float]:
    """Mean square errors at the last runs, divided by the variances of all runs."""
    real, spread = vectors[-len(told) :], vectors.var(axis=0)
    scalars = [observables.scalars(rows) for rows in (real, told, vectors)]
    miss = ((scalars[1] - scalars[0]) ** 2).mean(axis=0) / scalars[2].var(axis=0)
    errors = dict(zip(observables.outputs, miss.tolist(), strict=True))
    for name, part in observables.histories.items():
        scale = observables.noise[part]
        wrong = (((told - real)[:, part] / scale) ** 2).mean()
        errors[name] = float(wrong / (spread[part] / scale**2).mean())
    return errors


def _refusal(error: float) -> str:
    return (
        f"the surrogate gets {100 * error:.0f} % of the variance wrong, at most {100 * LARGEST_ERROR:.0f} % "
        "are allowed; make more runs, take a smaller box, or ask the solver"
    )


def _indices(
    shot: Shot,
    box: Box,
    observables: Observables,
    function: Callable[[FloatArray], FloatArray],
    *,
    n: int,
    runs: int,
    errors: dict[str, float],
    by_surrogate: bool,
) -> GlobalSensitivity:
    refused = {name: _refusal(error) for name, error in errors.items() if error > LARGEST_ERROR}
    good = [i for i, name in enumerate(observables.outputs) if name not in refused]
    line = observables.observations.centre_line

    def history(name: str) -> HistoryIndices | None:
        part = observables.histories.get(name)
        if part is None or name in refused:
            return None
        return history_indices(
            box, lambda x: function(x)[:, part], scale=observables.noise[part], n=n, rng=SEED
        )

    scalars = None
    if good:
        outputs = tuple(observables.outputs[i] for i in good)
        scalars = sobol_indices(
            box, lambda x: observables.scalars(function(x))[:, good], outputs=outputs, n=n, rng=SEED
        )
    return GlobalSensitivity(
        shot=shot.name, box=box, runs=runs, by_surrogate=by_surrogate, errors=errors, refused=refused,
        scalars=scalars, force_times=observables.observations.force_times, force=history("force"),
        outline_times=line.time[observables.counted], outline=history("outline"),
    )  # fmt: skip


def screening(
    shot: Shot, box: Box, *, trajectories: int = 10, numerics: Numerics | None = None
) -> tuple[tuple[str, ...], ElementaryEffects]:
    """Morris' elementary effects on the misfits and the peak force, by the solver itself.

    Parameters
    ----------
    shot, box, numerics
        As in `solver_sensitivity`.
    trajectories
        Number of trajectories. Each needs one more run than there are parameters.

    Returns
    -------
    outputs
        Names of the outputs, length s.
    effects
        Effects of each parameter on each output.

    Raises
    ------
    ValueError
        If a run does not complete, or if a parameter is unknown or outside its range.
    """
    walks = morris(box, trajectories, rng=SEED)
    observables, vectors = _observed(shot, walks.design.points, box, numerics)
    return observables.outputs, walks.effects(observables.scalars(vectors))
