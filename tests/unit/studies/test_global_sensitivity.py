"""Sobol' indices of a shot on tiny meshes: solver and surrogate agree if the surrogate is accurate enough."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from doe import Box
from doe.surrogates import SurrogateError
from kolsky.inverse.settings import Numerics
from kolsky.report.canvas import build
from kolsky.report.figures import SENSITIVITY
from kolsky.shot.load import load_shot
from kolsky.shot.records import Shot
from kolsky.studies.global_sensitivity import (
    LARGEST_ERROR,
    GlobalSensitivity,
    global_sensitivity,
    screening,
    solver_sensitivity,
)

OPEN_01 = Path(__file__).resolve().parents[3] / "runs" / "open-01"
TINY = Numerics(mesh=(6, 8), threads=1)
BOX = Box.of({"stiffness_factor": (1.0, 1.2), "damping": (2e-5, 6e-5)})


@pytest.fixture(scope="module")
def shot() -> Shot:
    whole = load_shot(OPEN_01)
    return replace(whole, window=(whole.window[0], 0.5e-3))


@pytest.fixture(scope="module")
def by_solver(shot: Shot) -> GlobalSensitivity:
    return solver_sensitivity(shot, BOX, n=32, numerics=TINY)


@pytest.fixture(scope="module")
def by_surrogate(shot: Shot) -> GlobalSensitivity:
    return global_sensitivity(shot, BOX, runs=60, unseen=16, n=32, numerics=TINY)


@pytest.mark.slow
def test_solver_and_surrogate_agree(by_solver, by_surrogate):
    assert by_solver.errors == {}
    assert by_solver.runs == 32 * 4
    assert by_surrogate.runs == 76
    theirs = by_surrogate.scalars
    assert "Phi_S" in theirs.outputs
    for i, name in enumerate(theirs.outputs):
        k = by_solver.scalars.outputs.index(name)
        # The same points of the box: what differs is the surrogate. The square root of the share of variance
        # that it gets wrong enters an index in first order.
        tolerance = 2.0 * np.sqrt(by_surrogate.errors[name]) + 0.02
        np.testing.assert_allclose(theirs.total[i], by_solver.scalars.total[k], atol=tolerance)
    assert by_surrogate.errors["outline"] < LARGEST_ERROR
    tolerance = 2.0 * np.sqrt(by_surrogate.errors["outline"]) + 0.02
    np.testing.assert_allclose(
        by_surrogate.outline.aggregated_total, by_solver.outline.aggregated_total, atol=tolerance
    )


def test_indices_of_frames_put_together_are_those_of_the_outline(by_solver):
    times, first, total = by_solver.outline_by_frame()
    assert times.size == np.unique(by_solver.outline_times).size
    _, frame = np.unique(by_solver.outline_times, return_inverse=True)
    weight = np.bincount(frame, weights=by_solver.outline.variance)
    # All sigmas of the outline are one, so the generalised index weighs by the variance alone. 0.02: what is
    # left out, components and frames that hardly vary.
    for index, whole in (
        (first, by_solver.outline.aggregated_first),
        (total, by_solver.outline.aggregated_total),
    ):
        together = np.nansum(index * weight, axis=1) / weight.sum()
        np.testing.assert_allclose(together, whole, atol=0.02)


def test_damping_takes_away_the_ringing_not_the_start(by_solver):
    early = by_solver.outline_times < 0.15e-3
    late = by_solver.outline_times > 0.4e-3
    by_damping = by_solver.outline.total[1]
    assert np.nanmean(by_damping[late]) > np.nanmean(by_damping[early])


@pytest.mark.slow
def test_a_surrogate_of_which_nothing_is_good_enough(shot, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("kolsky.studies.global_sensitivity.LARGEST_ERROR", 1e-9)
    with pytest.raises(SurrogateError, match=r"force: the surrogate gets .* ask the solver"):
        global_sensitivity(shot, BOX, runs=12, unseen=8, n=64, numerics=TINY)


@pytest.mark.slow
def test_part_of_a_surrogate_can_be_good_enough(shot):
    narrow = Box.of({"stiffness_factor": (0.9, 1.3), "poisson": (0.495, 0.499)})
    found = global_sensitivity(shot, narrow, runs=40, unseen=16, n=64, numerics=TINY)
    assert found.errors["Phi_S"] < LARGEST_ERROR < found.errors["force"]
    assert found.force is None
    assert "ask the solver" in found.refused["force"]
    assert "Phi_S" in found.scalars.outputs
    (kind,) = SENSITIVITY.values()
    assert "on a surrogate" in kind.caption(found)
    assert len(build(kind, found).axes) == 1 + (found.outline is not None)


def test_a_run_that_fails_is_named(shot):
    impossible = Box.of({"stiffness_factor": (1.0, 1.2), "poisson": (0.3, 0.6)})
    with pytest.raises(ValueError, match="poisson = "):
        solver_sensitivity(shot, impossible, n=4, numerics=TINY)


def test_screening_ranks_like_the_indices(shot, by_solver):
    outputs, effects = screening(shot, BOX, trajectories=8, numerics=TINY)
    assert outputs == by_solver.scalars.outputs
    i = outputs.index("Phi_S")
    assert np.argmax(effects.size[i]) == np.argmax(by_solver.scalars.total[i])


def test_without_an_outline_there_are_two_outputs(shot):
    blind = replace(shot, centre_line=None)
    found = solver_sensitivity(blind, BOX, n=8, numerics=TINY)
    assert found.scalars.outputs == ("Phi_F", "peak force")
    assert found.outline is None
    with pytest.raises(ValueError, match="no indices of the outline"):
        found.outline_by_frame()
    (kind,) = SENSITIVITY.values()
    assert len(build(kind, found).axes) == 2


def test_the_figure(by_solver):
    (kind,) = SENSITIVITY.values()
    assert kind.applies(by_solver)
    assert "m = 1 to 1.2, β = 20 to 60 µs" in kind.caption(by_solver)
    assert len(build(kind, by_solver).axes) == 3


@pytest.mark.slow
def test_the_script(tmp_path: Path):
    script = OPEN_01.parent / "sensitivity.py"
    command = [sys.executable, str(script), str(OPEN_01), str(tmp_path), "16"]
    run = subprocess.run(command, capture_output=True, text=True, cwd=OPEN_01.parent.parent, timeout=300)
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "sensitivity.svg").exists()
    assert "by the solver, 80 runs" in run.stdout
    assert "by the surrogate, 160 runs" in run.stdout
    assert "force: the surrogate gets" in run.stdout
