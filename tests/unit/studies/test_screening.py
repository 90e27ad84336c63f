"""Screening of a shot's parameters on a tiny mesh."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from doe import Box
from kolsky.inverse.settings import Numerics
from kolsky.inverse.simulate import simulate
from kolsky.shot.load import load_shot
from kolsky.shot.records import Shot
from kolsky.studies.sweep_analysis import screening

OPEN_01 = Path(__file__).resolve().parents[3] / "runs" / "open-01"
TINY = Numerics(mesh=(6, 8), threads=1)


@pytest.fixture(scope="module")
def shot() -> Shot:
    whole = load_shot(OPEN_01)
    return replace(whole, window=(whole.window[0], 0.5e-3))


def test_effects_of_one_parameter_are_differences_of_single_runs(shot):
    """Two thirds of the edge apart on four levels: from 1.0 or 1.06 up to 1.12 or 1.18."""
    outputs, effects = screening(
        shot, Box.of({"stiffness_factor": (1.0, 1.18)}), trajectories=4, numerics=TINY
    )
    phi = {m: simulate(shot, {"stiffness_factor": m}, numerics=TINY).terms.phi for m in (1, 1.06, 1.12, 1.18)}
    expected = np.array([phi[1.12] - phi[1], phi[1.18] - phi[1.06]]) * 1.5
    found = effects.effects[:, 0, outputs.index("Phi")]
    distance = np.abs(found[:, None] - expected).min(axis=1)
    assert (distance < 1e-9 * np.abs(expected).max()).all()  # 1.06 of the box is another last digit


def test_without_an_outline_there_is_one_misfit_and_a_failed_run_is_named(shot):
    blind = replace(shot, centre_line=None)
    outputs, _ = screening(blind, Box.of({"damping": (2e-5, 6e-5)}), trajectories=2, numerics=TINY)
    assert outputs == ("Phi_F",)
    with pytest.raises(ValueError, match=r"poisson = |'poisson'"):
        screening(shot, Box.of({"poisson": (0.3, 0.6)}), trajectories=2, numerics=TINY)
