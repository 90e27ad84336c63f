"""The observables of a sensitivity study: runs over a box as vectors, and the misfits made of them."""

from collections.abc import Mapping
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.inverse.forward import Numerics
from kolsky.inverse.misfit import terms
from kolsky.inverse.observations import Observations, Prediction, predict
from kolsky.inverse.prepared_shot import PreparedShot

OUTPUTS = ("Phi_F", "Phi_S", "Phi", "peak force")
"""Scalar outputs: Eqs. (M.4), (M.3), (M.5) and the largest transmitted force."""
WITHOUT_OUTLINE = ("Phi_F", "peak force")
"""Those of a shot without an outline."""
CHUNK = 256
"""Runs made at once."""


@dataclass(frozen=True)
class Observables:
    """Force samples, bin means and outline points as one vector, and the numbers made of it."""

    observations: Observations
    """What was measured."""
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
        """Standard deviations of the vector's entries as measured, shape [k]."""
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


def runs_at(
    prepared: PreparedShot, points: FloatArray, box: Box, held: Mapping[str, float], numerics: Numerics
) -> Prediction:
    """Simulate points of a box, some at a time.

    Parameters
    ----------
    prepared
        The shot.
    points
        In parameter units, shape [n, d].
    box
        Names the parameters.
    held
        Parameters held at another value than the shot's.
    numerics
        Mesh, precision, device.

    Raises
    ------
    ValueError
        If a run does not complete, or a parameter is unknown or outside its range.
    """
    parts = []
    for start in range(0, len(points), CHUNK):
        some = points[start : start + CHUNK]
        columns = {name: some[:, i] for i, name in enumerate(box.names)}
        response = prepared.forward.run({**held, **columns}, numerics)
        lost = np.flatnonzero(~response.completed)
        if lost.size:
            raise ValueError(
                f"{lost.size} of {len(some)} runs did not complete; the one at "
                f"{box.as_dict(some[lost[0]])} ended {response.describe(int(lost[0]))}; take a smaller box"
            )
        parts.append(predict(response, prepared.observations))
    return Prediction(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Prediction)))
