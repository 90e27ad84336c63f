"""Time loops of an identification, compiled at its start on a machine that has not run one like it."""

import numpy as np

import explicit
from kolsky.inverse.forward import Numerics
from kolsky.inverse.staged_runs import StagedRuns

MANY = 64
"""Runs of a design: packs of lanes, where a few runs are made one by one."""


def compile_for(stages: StagedRuns) -> None:
    """Compile, side by side, what runs alone, a design's runs and the other element's need.

    It takes some seconds once on a machine, and is the stage "compile"; otherwise nothing is done.
    """
    numerics = stages.settings.numerics
    explicit.compile_time_loops(
        [_problem(stages, numerics, 1), _problem(stages, numerics, MANY)],
        also=[lambda: other_element(stages)],
        device=numerics.device,
        threads=numerics.threads,
        told=lambda done, total: stages.progress("compile", done, total),
    )


def other_element(stages: StagedRuns) -> explicit.Problem:
    """A run of the other element, which the mesh's error is told by."""
    return _problem(stages, stages.settings.numerics.with_other_element(), 1)


def _problem(stages: StagedRuns, numerics: Numerics, runs: int) -> explicit.Problem:
    named = stages.box.as_dict(np.array(stages.box.lower))
    points = {name: np.full(runs, value) for name, value in {**stages.settings.held, **named}.items()}
    return stages.prepared.forward.problem(points, numerics)
