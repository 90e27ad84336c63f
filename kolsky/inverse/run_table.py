"""The table of every run that a loop over simulations made."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from doe import Box
from explicit import Ending
from kolsky.base.arrays import FloatArray
from kolsky.inverse.misfit import Observations, Prediction, terms
from kolsky.inverse.result import DesignTable, Terms


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
