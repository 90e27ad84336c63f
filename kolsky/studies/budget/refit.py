"""The estimate of a test with errors, near that without them: least squares on the solver itself.

The misfit of a force that rings has several valleys, and with errors another one may become the deepest. Then
two things happen to an answer: it moves within its valley, by what a budget adds up, and it may jump, by what
no budget of small errors knows. The re-fit starts at the optimum of the test without errors and goes downhill
by Gauss and Newton's steps, so it follows its valley; the whole search of `kolsky.identify` looks everywhere.
Where a whole search ends elsewhere than the re-fit, the answer has jumped.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from doe import Box
from kolsky.base.arrays import FloatArray
from kolsky.inverse.free_parameters import choose
from kolsky.inverse.linear_step import Step, gauss_newton_step
from kolsky.inverse.objective import Objective
from kolsky.inverse.optimum import on_edge
from kolsky.inverse.parameters import design_box
from kolsky.inverse.prepared_shot import prepare_shot
from kolsky.inverse.refined_search import refined_numerics
from kolsky.inverse.search import search_shot
from kolsky.inverse.settings import Settings
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.shot.records import Shot

SAME_VALLEY = 3.0
"""A whole search that ends within so many of its standard deviations of the re-fit is in the same valley."""
MOST_STEPS = 16
"""Most steps of a re-fit."""
AT_REST = 0.1
"""Length of the next step, in standard deviations from the residuals, at which a re-fit is at rest: its
differences are what a budget is made of."""
LONGEST = 0.02
"""Longest step of a coordinate, over the edge of its design: a step must not cross a ridge."""
OUT_OF_STEP = 0.08
"""Change of `phase` beyond which a re-fit has left its valley: 8 % of m / (1 - 2 nu) are 4 % of the ringing's
period, and a third of an oscillation at the end of a test of ten."""
FIRST_DIFFERENCE = 2e-3
"""Half the distance of the first differences over the edge; later half a standard deviation."""


class RealisationOutcome(StrEnum):
    """How one realisation of a test with errors ended."""

    REFITTED = "re-fitted"
    """By the re-fit alone, which was all that was asked."""
    SAME_VALLEY = "same valley"
    """The whole search ends where the re-fit does."""
    OTHER_VALLEY = "another valley"
    """The whole search ends elsewhere: an unattended answer jumps."""
    SEARCHED = "searched"
    """By the whole search alone: the test without errors, or a response too rough for a re-fit."""
    SEARCH_REFUSED = "search refused"
    """The re-fit has an answer, the whole search none."""
    LEFT_VALLEY = "left the valley"
    """The re-fit went so far that the ringing is out of step by a third of an oscillation or more: there was
    no valley left to follow."""
    NOT_AT_REST = "not at rest"
    """The re-fit did not come to rest."""
    AT_BOUND = "at a bound"
    """The re-fit ended at a bound of its parameters."""
    REFUSED = "refused"
    """The test gave no answer."""

    @property
    def counted(self) -> bool:
        """Whether the realisation's estimate enters a spread."""
        return self not in (self.LEFT_VALLEY, self.NOT_AT_REST, self.AT_BOUND, self.REFUSED)


@dataclass(frozen=True)
class Estimate:
    """The estimate of one realisation."""

    values: Mapping[str, float]
    """Free parameters, SI."""
    sigma: Mapping[str, float]
    """Their standard deviations from the residuals."""
    outcome: RealisationOutcome
    """How it ended."""


def whole_search(shot: Shot, settings: Settings) -> Estimate:
    """The optimum of `kolsky.identify`, without its uncertainty from other sources.

    Raises
    ------
    ValueError
        As `kolsky.identify`.
    """
    found = search_shot(prepare_shot(shot), settings, lambda stage, done, total: None)
    names = found.stages.box.names
    return Estimate(
        dict(zip(names, found.fine.x.tolist(), strict=True)),
        dict(zip(names, found.fine.sigma.tolist(), strict=True)),
        RealisationOutcome.SEARCHED,
    )


def refit(shot: Shot, settings: Settings, start: Mapping[str, float]) -> Estimate:
    """The optimum next to a start, on the refined mesh, with the weights of `whole_search`.

    The path of the flyer stays as fitted to its record, as with `settings.replicates` of 0.

    Parameters
    ----------
    shot
        The test.
    settings
        As those of the whole search; what is free is what the start names.
    start
        Free parameters and where they begin, SI.

    Raises
    ------
    ValueError
        If no run at the start completes.
    """
    free = {name: (settings.free or {}).get(name) for name in start}
    freed = choose(replace(settings, free=free), shot)
    box = design_box(freed.free)
    stages = StagedRuns(
        prepare_shot(shot),
        freed.settings,
        box,
        lambda stage, done, total: None,
        prior=freed.prior(shot),
    )
    first = np.clip([start[name] for name in box.names], box.lower, box.upper)
    x, step = _downhill(stages, box, first)
    outcome = RealisationOutcome.REFITTED
    if step.moved > AT_REST:
        outcome = RealisationOutcome.NOT_AT_REST
    elif on_edge(x, box).any():
        outcome = RealisationOutcome.AT_BOUND
    elif abs(phase(box.as_dict(x)) - phase(box.as_dict(first))) > OUT_OF_STEP:
        outcome = RealisationOutcome.LEFT_VALLEY
    return Estimate(
        dict(zip(box.names, x.tolist(), strict=True)),
        dict(zip(box.names, step.sigma.tolist(), strict=True)),
        outcome,
    )


def _downhill(stages: StagedRuns, box: Box, x: FloatArray) -> tuple[FloatArray, Step]:
    """Gauss-Newton steps with slopes of their own on the refined mesh, no longer than `LONGEST`."""
    edge = np.array(box.upper) - np.array(box.lower)
    half, share, before = FIRST_DIFFERENCE * edge, 1.0, np.zeros(len(x))
    for _ in range(MOST_STEPS):
        h = np.diag(half)
        up, down = np.minimum(x + h, box.upper), np.maximum(x - h, box.lower)
        _, rows, prediction = stages.run("check", np.vstack([x, up, down]), refined_numerics(stages))
        if prediction is None or len(rows) < 2 * len(x) + 1:
            raise ValueError("the re-fit needs every run beside its point to complete")
        inside = np.asarray(prediction.inside.all(axis=0))
        objective = Objective(stages.observations, inside, prior=stages.prior, slowly=True)
        vectors, d = objective.vectors(prediction), len(x)
        slope = (vectors[1 : d + 1] - vectors[d + 1 :]).T / (up - down).sum(axis=1)
        step = gauss_newton_step(objective, slope, vectors[0], x, box)
        if step.moved <= AT_REST:
            return x + step.change, step
        back = float(before / step.sigma @ (step.change / step.sigma))
        if back < 0.0:
            share *= 0.5  # it steps to and fro
        before = step.change
        x = x + np.clip(share * step.change, -LONGEST * edge, LONGEST * edge)
        half = np.clip(0.5 * step.sigma, 0.1 * FIRST_DIFFERENCE * edge, FIRST_DIFFERENCE * edge)
    return x, step


def phase(values: Mapping[str, float]) -> float:
    """What sets the period of the ringing, m / (1 - 2 nu), as a logarithm; of what is free alone [-]."""
    m, nu = values.get("stiffness_factor", 1.0), values.get("poisson", 0.0)
    return float(np.log(m) - np.log(1.0 - 2.0 * nu))


def same_valley(near: Estimate, whole: Estimate) -> bool:
    """Whether a whole search ends where the re-fit does, for every parameter that both have free."""
    common = near.values.keys() & whole.values.keys()
    return all(
        abs(near.values[name] - whole.values[name]) <= SAME_VALLEY * whole.sigma[name] for name in common
    )
