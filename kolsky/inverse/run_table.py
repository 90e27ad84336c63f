"""The table of every run that a loop over simulations made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from doe import Box
from explicit import Ending, Outcome
from kolsky.base.arrays import FloatArray
from kolsky.inverse.misfit import Terms, terms
from kolsky.inverse.observations import Observations, Prediction


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
    """Element where it failed, of its own mesh; -1 if it completed, shape [n_runs]."""
    failed_places: FloatArray
    """Centre (R, Y) of that element in the undeformed mesh [m], shape [n_runs, 2]; NaN if it completed."""
    stage: tuple[str, ...]
    """Why the run was made: "design", "refinement" or "check", length n_runs."""
    phi_shape: FloatArray
    """Phi_S of each run [-], shape [n_runs]; NaN for a run that did not complete, or without an outline."""
    phi_force: FloatArray
    """Phi_F of each run [N], shape [n_runs]; NaN for a run that did not complete."""
    chi2_shape: FloatArray
    """Shape chi-square of each run [-], shape [n_runs]; NaN likewise."""
    chi2_force: FloatArray
    """Force chi-square of each run [-], shape [n_runs]; NaN for a run that did not complete."""

    def ending(self, run: int) -> Ending:
        """The ending of a run: outcome, time, element."""
        r, y = self.failed_places[run]
        return Ending(
            outcome=Outcome[self.outcomes[run]],
            time=float(self.end_times[run]),
            element=int(self.failed_elements[run]),
            place=(float(r), float(y)),
        )

    @property
    def lost(self) -> tuple[int, ...]:
        """The runs that did not complete."""
        return tuple(i for i, name in enumerate(self.outcomes) if name != Outcome.COMPLETED.name)


class RunTable:
    """Runs in the order they were made, with their ending and misfit terms."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self.points: list[FloatArray] = []
        self.endings: list[Ending] = []
        self.stages: list[str] = []
        self.terms: list[Terms | None] = []

    def add(
        self,
        stage: str,
        points: FloatArray,
        endings: Sequence[Ending],
        completed: NDArray[np.intp],
        prediction: Prediction | None,
        observations: Observations,
    ) -> None:
        """Append a batch; `prediction` holds the rows of `completed` only (None if there are none)."""
        place = {int(row): k for k, row in enumerate(completed)}
        for row, (point, ending) in enumerate(zip(points, endings, strict=True)):
            self.points.append(np.asarray(point, dtype=float))
            self.endings.append(ending)
            self.stages.append(stage)
            if prediction is not None and row in place:
                self.terms.append(terms(prediction, observations, place[row]))
            else:
                self.terms.append(None)

    def take(self, other: RunTable, held: Mapping[str, float]) -> None:
        """Append the runs of another table, of some of the parameters, the others held.

        Parameters
        ----------
        other
            Its parameters are among these.
        held
            Value of each parameter that the other table has not, by name.
        """
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
        # Two second designs can share a point; the same point gives the same run, bit for bit.
        _, first = np.unique(points.round(12), axis=0, return_index=True)
        return points[first], cost[first]

    def build(self, box: Box) -> DesignTable:
        """The finished table; a run that did not complete has NaN misfits beside its outcome."""

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
