"""Misfit terms of a run, Eqs. (M.3)-(M.8) and chi-square, and the table of all runs.

(M.n) is equation n of Mates et al. (2012). The paper's cost sums absolute residuals. Chi-square weights each
residual by its measured noise: the force in bins, the outline point by point. The noise of a point's height
would enter Z through the slope, sigma_Z,eff^2 = sigma_Z^2 + (dr/dy)^2 sigma_y^2. This term is NOT used:
`CentreLine` has no sigma_y. The slope is small except near the platens.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from doe import Box
from explicit import Ending, Outcome, Response
from kolsky.bars.flyer.path import FlyerPath
from kolsky.base.arrays import FloatArray, IntArray
from kolsky.inverse.observations import Observations, Prediction, predict

SCALE_FORCE = 1000.0
"""SF_F of Eq. (M.5) [N]."""
SCALE_SHAPE = 0.001
"""SF_S of Eq. (M.5) [-]."""


@dataclass(frozen=True)
class Terms:
    """The misfit terms of a simulation, NaN if they need a missing outline: Eqs. (M.3)-(M.8), chi-square."""

    phi_shape: float
    """Phi_S, Eq. (M.3) [-]."""
    phi_force: float
    """Phi_F, Eq. (M.4) [N]."""
    phi: float
    """Phi, Eq. (M.5) [-]."""
    sigma_phi_shape: float
    """delta Phi_S, Eq. (M.6) [-]."""
    sigma_phi_force: float
    """delta Phi_F, Eq. (M.7) [N]."""
    sigma_phi: float
    """delta Phi, Eq. (M.8) [-]."""
    chi2_force: float
    """Noise-weighted sum of squares of the force residual [-]."""
    chi2_shape: float
    """Noise-weighted sum of squares of the outline residual [-]."""
    n_force: int
    """Number of force values counted."""
    n_shape: int
    """Number of outline points counted."""
    n_outside: int
    """Number of outline points outside the model's range; they are not counted."""

    @property
    def chi2(self) -> float:
        """Joint chi-square [-]; that of the force without an outline."""
        return self.chi2_force + (self.chi2_shape if self.has_shape else 0.0)

    @property
    def has_shape(self) -> bool:
        """True if an outline was measured."""
        return self.n_shape + self.n_outside > 0


def terms(prediction: Prediction, observations: Observations, i: int) -> Terms:
    """Misfit terms of simulation `i`; those that need an outline, with Phi of Eq. (M.5), are NaN without one.

    Phi_S, Eq. (M.3), is a mean over the counted points of each frame, then over the frames with a counted
    point. Its uncertainty, Eq. (M.6), is the same mean of Z_FEA sigma_Z / Z_DIC^2: as in the paper, the
    errors count as common to all points. Phi_F is a sum over samples, Eq. (M.4), and its uncertainty the sum
    of their sigmas, P delta F in Eq. (M.7). Chi-square uses bins and points.

    Raises ValueError if no outline point is inside the model's range.
    """
    line, counted = observations.centre_line, prediction.inside[i]
    if observations.has_shape and not counted.any():
        raise ValueError(
            f"none of the {counted.size} outline points lies on the surface of simulation {i}; check y_offset"
            " and the unit of y"
        )
    phi_shape = sigma_shape = chi2_shape = np.nan
    r_force, r_shape, _, _ = residuals(prediction, observations, i)
    if observations.has_shape:
        Z, Z_model, sigma = line.Z[counted], prediction.Z[i, counted], line.sigma[counted]
        frame = line.frame[counted]
        phi_shape = _frame_mean(np.abs(Z_model - Z) / Z, frame)  # Eq. (M.3)
        sigma_shape = _frame_mean(Z_model * sigma / Z**2, frame)  # Eq. (M.6)
        chi2_shape = float(r_shape @ r_shape)
    phi_force = float(np.abs(prediction.force[i] - observations.force.force).sum())  # Eq. (M.4)
    sigma_force = float(observations.force.sigma.sum())  # Eq. (M.7)
    return Terms(
        phi_shape=phi_shape,
        phi_force=phi_force,
        phi=phi_force / SCALE_FORCE + phi_shape / SCALE_SHAPE,  # Eq. (M.5)
        sigma_phi_shape=sigma_shape,
        sigma_phi_force=sigma_force,
        sigma_phi=float(np.hypot(sigma_force / SCALE_FORCE, sigma_shape / SCALE_SHAPE)),  # Eq. (M.8)
        chi2_force=float(r_force @ r_force),
        chi2_shape=chi2_shape,
        n_force=r_force.size,
        n_shape=r_shape.size,
        n_outside=int((~counted).sum()),
    )


def residuals(
    prediction: Prediction, observations: Observations, i: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Model minus measurement, divided by sigma, of simulation `i`.

    Returns: residuals of the force bins, [n_bins], and of the outline points inside the model's range,
    [n_counted] [-]; the times of the bins' centres and of these points [s].
    """
    line, counted = observations.centre_line, prediction.inside[i]
    force = (prediction.force_bins[i] - observations.force_mean) / observations.force_sigma
    shape = (prediction.Z[i, counted] - line.Z[counted]) / line.sigma[counted]
    return force, shape, observations.force_times, line.time[counted]


def _frame_mean(value: FloatArray, frame: IntArray) -> float:
    """Mean over frames of the mean over each frame's points."""
    _, row, count = np.unique(frame, return_inverse=True, return_counts=True)
    return float(np.mean(np.bincount(row, weights=value) / count))


@dataclass(frozen=True)
class DesignTable:
    """Every run of the design, in run order."""

    names: tuple[str, ...]
    """Free parameters, column order of `points`."""
    points: FloatArray
    """Parameter values, shape [n_runs, n_parameters]."""
    lower: FloatArray
    """Lower bounds of the design, shape [n_parameters]."""
    upper: FloatArray
    """Upper bounds, shape [n_parameters]."""
    outcomes: tuple[str, ...]
    """`explicit.Outcome` names, length n_runs."""
    end_times: FloatArray
    """Time each run reached [s], shape [n_runs]."""
    failed_elements: NDArray[np.int64]
    """Element where the run failed, numbered in the run's mesh; -1 if it completed, shape [n_runs]."""
    failed_places: FloatArray
    """Centre (R, Y) of that element in the undeformed mesh [m], shape [n_runs, 2]; NaN if it completed."""
    stage: tuple[str, ...]
    """Purpose of the run: "design", "refinement" or "check", length n_runs."""
    phi_shape: FloatArray
    """Phi_S of each run [-], shape [n_runs]; NaN for a run that did not complete, or without an outline."""
    phi_force: FloatArray
    """Phi_F of each run [N], shape [n_runs]; NaN for a run that did not complete."""
    chi2_shape: FloatArray
    """Shape chi-square of each run [-], shape [n_runs]; NaN as for Phi_S."""
    chi2_force: FloatArray
    """Force chi-square of each run [-], shape [n_runs]; NaN for a run that did not complete."""

    def ending(self, run: int) -> Ending:
        """The ending of a run: outcome, time, element."""
        r, y = self.failed_places[run]
        outcome = Outcome[self.outcomes[run]]
        time = float(self.end_times[run])
        element = int(self.failed_elements[run])
        return Ending(outcome=outcome, time=time, element=element, place=(float(r), float(y)))

    @property
    def lost(self) -> tuple[int, ...]:
        """The runs that did not complete."""
        return tuple(i for i, name in enumerate(self.outcomes) if name != Outcome.COMPLETED.name)


@dataclass(frozen=True)
class CompletedRuns:
    """Completed runs of one stage."""

    points: FloatArray
    """Parameters, shape [n, d]."""
    rows: NDArray[np.intp]
    """Their rows in the design, shape [n]."""
    prediction: Prediction
    response: Response
    lost: str
    """The failed runs in words, with details of the first one; empty if there are none."""


@dataclass(frozen=True)
class Runs:
    """Runs of one batch, completed or failed."""

    names: tuple[str, ...]
    points: FloatArray
    """Their points, shape [n, d]."""
    response: Response
    rows: NDArray[np.intp]
    prediction: Prediction | None
    """Simulated measurements of these runs; None if there are none."""

    @classmethod
    def of(
        cls, names: tuple[str, ...], points: FloatArray, response: Response, observations: Observations
    ) -> Runs:
        """Runs from the solver's response."""
        rows = np.flatnonzero(response.completed)
        prediction = predict(response.select(rows), observations) if len(rows) else None
        return cls(names, points, response, rows, prediction)

    @property
    def first_lost(self) -> str:
        """The first failed run in words: its parameters and its ending."""
        first = int(np.argmin(self.response.completed))
        values = zip(self.names, self.points[first].tolist(), strict=True)
        point = ", ".join(f"{name} = {value:.4g}" for name, value in values)
        return f"the one at {point} ended {self.response.describe(first)}"

    @property
    def lost(self) -> str:
        """Failed runs in words: their number, and the ending of the first one. Empty if all completed."""
        n, lost = len(self.points), len(self.points) - len(self.rows)
        return f"{lost} of {n} runs did not complete; {self.first_lost}" if lost else ""

    def completed(self, problem: str) -> CompletedRuns:
        """The completed runs. Without any, raises ValueError with a problem and the first failure."""
        if self.prediction is None:
            raise ValueError(f"{problem}: {self.first_lost}")
        response = self.response.select(self.rows)
        return CompletedRuns(self.points[self.rows], self.rows, self.prediction, response, self.lost)


Place = tuple[tuple[int, int], FlyerPath, FloatArray]
"""Mesh, path of the front face and offset of the points, shape [d], of a batch."""


class RunTable:
    """Runs in the order they were made, with their ending and misfit terms. Runs are never removed."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self.points: list[FloatArray] = []
        self.endings: list[Ending] = []
        self.stages: list[str] = []
        self.terms: list[Terms | None] = []
        self._batches: list[tuple[Place, Runs]] = []

    def add(
        self, stage: str, values: FloatArray, runs: Runs, observations: Observations, *, on: Place
    ) -> None:
        """Append a batch with the values run on its mesh, [n, d]; its points are the refined mesh's."""
        self._batches.append((on, runs))
        place = {int(row): k for k, row in enumerate(runs.rows)}
        for row, (point, ending) in enumerate(zip(values, runs.response.endings, strict=True)):
            self.points.append(np.asarray(point, dtype=float))
            self.endings.append(ending)
            self.stages.append(stage)
            if runs.prediction is not None and row in place:
                self.terms.append(terms(runs.prediction, observations, place[row]))
            else:
                self.terms.append(None)

    def on(self, mesh: tuple[int, int], path: FlyerPath, offset: FloatArray) -> tuple[FloatArray, Prediction]:
        """Points and predictions of all completed runs on a mesh under a path, in their order.

        ``offset``: present offset of the values run on this mesh from a point, shape [d]. The point of a run
        made with another offset is converted.
        """
        kept = [
            (runs.points[runs.rows] - (offset - before), runs.prediction)
            for (its_mesh, its_path, before), runs in self._batches
            if its_mesh == mesh and its_path is path and runs.prediction is not None
        ]
        points, predictions = zip(*kept, strict=True)
        return np.concatenate(points), Prediction.joined(predictions)

    def take(self, other: RunTable, held: Mapping[str, float]) -> None:
        """Append the runs of another table with a subset of the parameters; ``held``: the missing values."""
        for point in other.points:
            values = {**held, **dict(zip(other.names, point.tolist(), strict=True))}
            self.points.append(np.array([values[name] for name in self.names]))
        self.endings += other.endings
        self.stages += other.stages
        self.terms += other.terms

    def paper_cost(self) -> tuple[FloatArray, FloatArray]:
        """Points and Phi, Eq. (M.5), of the completed runs on the surrogate's mesh, each point once."""
        kept = [
            (point, t.phi)
            for point, t, stage in zip(self.points, self.terms, self.stages, strict=True)
            if t is not None and stage != "check"
        ]
        points, cost = np.array([point for point, _ in kept]), np.array([phi for _, phi in kept])
        # Two second designs can share a point. The same point gives exactly the same run.
        _, first = np.unique(points.round(12), axis=0, return_index=True)
        return points[first], cost[first]

    def build(self, box: Box) -> DesignTable:
        """The finished table; a run that did not complete has NaN misfits."""

        def column(name: str) -> FloatArray:
            return np.array([np.nan if t is None else getattr(t, name) for t in self.terms])

        return DesignTable(
            names=self.names,
            points=np.array(self.points),
            lower=np.array(box.lower),
            upper=np.array(box.upper),
            outcomes=tuple(ending.outcome.name for ending in self.endings),
            end_times=np.array([ending.time for ending in self.endings]),
            failed_elements=np.array([ending.element for ending in self.endings], dtype=np.int64),
            failed_places=np.array([ending.place for ending in self.endings]),
            stage=tuple(self.stages),
            phi_shape=column("phi_shape"),
            phi_force=column("phi_force"),
            chi2_shape=column("chi2_shape"),
            chi2_force=column("chi2_force"),
        )


@dataclass(frozen=True)
class Replicates:
    """Runs at one point with other flyer motions and other curves, drawn from their noise."""

    prediction: Prediction
    """Row 0 is the reference, with the fitted motion and curve."""
    flyer: NDArray[np.bool_]
    """Mask of the rows with another motion."""
    lesson: NDArray[np.bool_]
    """Mask of the rows with further motions. They are used for the weights, and `flyer` stays independent."""
    curve: NDArray[np.bool_]
    """Mask of the rows with another curve."""
    scale: NDArray[np.bool_]
    """Mask of the row, if any, with the motion scaled up by one standard uncertainty of its scale."""
    lost: int
