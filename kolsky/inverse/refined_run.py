"""A run on the refined mesh, judged: its misfit and the step to the optimum that it asks for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.inverse.completed_runs import CompletedRuns
from kolsky.inverse.linear_step import Step, gauss_newton_step
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Prediction
from kolsky.inverse.refined_search import CONFIRMED, refined_numerics
from kolsky.inverse.staged_runs import StagedRuns


@dataclass(frozen=True)
class RefinedRun:
    """A run on the refined mesh and the step it asks for."""

    x: FloatArray
    """Where, shape [d]."""
    vector: FloatArray
    """Its data vector, shape [k]; the measured value where the run does not reach an outline point."""
    check: CompletedRuns
    """The run."""
    step: Step
    """To where the optimum should be instead."""
    missed: FloatArray
    """The run minus what the slopes had foretold, shape [k]."""

    @property
    def confirmed(self) -> bool:
        """True if the run leaves the optimum where it is."""
        return self.step.moved <= CONFIRMED


def completed_apart(stages: StagedRuns, points: FloatArray) -> list[CompletedRuns]:
    """Runs on the refined mesh with all nodes, apart; every one of them must complete."""
    response, rows, prediction = stages.run("check", points, refined_numerics(stages), all_nodes=True)
    if prediction is None or len(rows) < len(points):
        first = int(np.argmin(response.completed))
        values = ", ".join(f"{k} = {v:.4g}" for k, v in stages.box.as_dict(points[first]).items())
        raise ValueError(
            f"the check needs every run on the refined mesh to complete: the one at {values} ended "
            f"{response.describe(first)}"
        )
    found = []
    for row in range(len(points)):
        parts = {name: getattr(prediction, name)[[row]] for name in Prediction.__dataclass_fields__}
        found.append(
            CompletedRuns(points[[row]], np.array([0]), Prediction(**parts), response.select([row]), "")
        )
    return found


def judged(
    stages: StagedRuns,
    objective: Objective,
    slope: FloatArray,
    x: FloatArray,
    check: CompletedRuns,
    before: RefinedRun | None,
) -> RefinedRun:
    """A run, and the step that it asks for."""
    seen = objective.vectors(check.prediction)[0]
    vector = np.where(np.isnan(seen), objective.data, seen)
    missed = np.zeros(len(vector))
    if before is not None:
        missed = vector - before.vector - slope @ (x - before.x)
    step = gauss_newton_step(objective, slope, vector, x, stages.box)
    return RefinedRun(x, vector, check, step, missed)


def cost(run: RefinedRun) -> float:
    """-2 ln of likelihood and prior at a run, up to a constant."""
    weighed = run.step.objective
    return float(weighed.deviance(run.vector[None])[0]) + weighed.prior_chi2(run.x)


def bounds(box: Box) -> tuple[FloatArray, FloatArray]:
    """Lower and upper bounds of a box, shape [d] each."""
    return np.array(box.lower), np.array(box.upper)
