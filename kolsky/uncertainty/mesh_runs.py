"""The runs at an answer that tell its mesh's error, side by side, and beside work that does not need them."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.inverse.forward import Numerics
from kolsky.inverse.graded_mesh import coarser_graded, graded
from kolsky.inverse.idle_core import in_thread, leaves_a_core
from kolsky.inverse.launches import Launch, run_side_by_side
from kolsky.inverse.observations import Prediction, predict
from kolsky.inverse.refined_search import RefinedOptimum
from kolsky.inverse.staged_runs import StagedRuns
from kolsky.uncertainty.numerical import GradedChange, LostRun, MeshChange, windows_of


@dataclass(frozen=True)
class MeshRun:
    """A run at the answer on another mesh, or with the other element."""

    numerics: Numerics
    """Its numerical choices."""
    prediction: Prediction | None
    """What the instruments would have seen; None if it did not complete."""
    ending: str
    """How it ended, a sentence without a final stop."""


BOTH_ELEMENTS = 2
"""Runs of `wanted` on the surrogate's mesh; what follows them is graded."""
Begun = Callable[[], MeshChange]
"""Waits for the runs, and gives what they say."""


@contextmanager
def mesh_change_beside(stages: StagedRuns, fine: RefinedOptimum) -> Iterator[Begun]:
    """The same as `mesh_change`, its runs in a thread beside the block where a core may be idle in it.

    The longest of them is a lone run on the finest mesh, and what is done meanwhile leaves cores idle. On a
    GPU, or with one thread, they are made when they are first asked for.
    """
    numerics = stages.settings.numerics
    runs, idle = wanted(stages, fine), leaves_a_core(numerics.device, numerics.threads)
    with in_thread(lambda: made(stages, fine.x, runs), idle=idle) as found:

        def told() -> MeshChange:
            started = time.perf_counter()
            seen = found()
            stages.seconds["check"] = stages.seconds.get("check", 0.0) + time.perf_counter() - started
            return change_of(stages, fine, seen)

        yield told


def mesh_change(stages: StagedRuns, fine: RefinedOptimum) -> MeshChange:
    """Run the answer on the surrogate's mesh with both elements, and on two graded meshes.

    Raises
    ------
    ValueError
        If the run with the element of the identification does not complete on the surrogate's mesh.
    """
    return change_of(stages, fine, made(stages, fine.x, wanted(stages, fine)))


def wanted(stages: StagedRuns, fine: RefinedOptimum) -> list[Numerics]:
    """Both elements on the surrogate's mesh, then the coarser and the finer graded mesh.

    Graded ones are left out on purpose where a surface slides, since single runs jump, and where runs are
    corrected for Poisson's ratio, since that correction has meshes of its own.
    """
    numerics, refined = stages.settings.numerics, stages.settings.refined_mesh
    found = [numerics, numerics.with_other_element()]
    if fine.roughness is not None or numerics.compressible is not None:
        return found
    return [*found, coarser_graded(numerics, refined), graded(numerics, refined)]


def made(stages: StagedRuns, point: FloatArray, numerics: Sequence[Numerics]) -> list[MeshRun]:
    """Runs of `wanted` at a point, those on the surrogate's mesh where it resembles the refined one.

    The last of them may be at work already.
    """
    launches = []
    for k, one in enumerate(numerics):
        at = stages.solver_values(point[None], one.mesh)[0] if k < BOTH_ELEMENTS else point
        values = {**stages.settings.held, **dict(zip(stages.box.names, at.tolist(), strict=True))}
        launches.append(Launch(stages.prepared.forward, values, one))
    early, last = stages.early, graded(stages.settings.numerics, stages.settings.refined_mesh)
    if early is not None and numerics[-1] == last and early.is_of(stages.prepared.forward, point):
        responses = [*run_side_by_side(launches[-2::-1])[::-1], early.response()]
    else:
        responses = run_side_by_side(launches[::-1])[::-1]  # the longest first
    return [
        MeshRun(
            one,
            predict(response, stages.observations) if response.outcomes[0].ok else None,
            response.describe(0),
        )
        for one, response in zip(numerics, responses, strict=True)
    ]


def change_of(stages: StagedRuns, fine: RefinedOptimum, runs: Sequence[MeshRun]) -> MeshChange:
    """What the runs say of the mesh.

    Parameters
    ----------
    stages, fine
        The identification's simulations, and the answer.
    runs
        Those of `wanted`, in its order.

    Raises
    ------
    ValueError
        If the first of them did not complete.
    """
    numerics, x = stages.settings.numerics, fine.x
    vectors = [None if run.prediction is None else fine.objective.vectors(run.prediction)[0] for run in runs]
    coarse, element = vectors[:2]
    if coarse is None:
        across, along = numerics.mesh
        raise ValueError(
            f"the run at the answer on the surrogate's mesh of {across} x {along} elements did not complete, "
            "so that the error of the refined one cannot be told: refine the surrogate's mesh"
        )
    # Where the mesh is run at shifted points, in step with the refined one, the shift is taken back along the
    # slopes, which are right there; a run that is out of step with the data has other ones.
    offset = stages.offsets.get(numerics.mesh, np.zeros(len(x)))
    # Where a surface slides the model is the quadratic, which does not follow the jumps of single runs.
    model = fine.model(x)[0]
    found = MeshChange(
        coarser=np.nan_to_num(coarse - model) - fine.jacobian @ offset,
        element=None if element is None else np.nan_to_num(element - coarse),
        ratio=stages.settings.refined_mesh[0] / numerics.mesh[0],
        windows=windows_of(fine.objective.times),
        lost=tuple(
            LostRun(run.numerics, run.ending, is_graded=k >= BOTH_ELEMENTS)
            for k, run in enumerate(runs)
            if run.prediction is None
        ),
    )
    if len(runs) == BOTH_ELEMENTS:
        return found
    few, many = vectors[2:]
    if few is None or many is None:
        return found
    ratio = runs[3].numerics.mesh[0] / runs[2].numerics.mesh[0]
    change = GradedChange(np.nan_to_num(many - model), np.nan_to_num(few - many), ratio)
    return replace(found, graded=change)
