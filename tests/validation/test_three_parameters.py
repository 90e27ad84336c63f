"""The default: m, nu and beta of known-answer shots, two of them with other nu and beta than declared."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from kolsky.identification import identify
from kolsky.shot.load import load_shot

RUNS = Path(__file__).resolve().parents[2] / "runs"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["open-03", "open-04"])
def test_the_ringing_tells_poisson_and_damping(name: str) -> None:
    told = json.loads((RUNS / name / "truth.json").read_text())
    truth = {"stiffness_factor": told["m"], "poisson": told["nu"], "damping": told["beta_s"]}
    shot = load_shot(RUNS / name)
    found = identify(shot)
    assert list(found.estimates) == list(truth)
    z = [(e.value - truth[p]) / e.sigma for p, e in found.estimates.items()]
    # All three inside k = 2, and jointly within what 95 % of right intervals stay below.
    assert np.abs(z).max() < 2.0, z
    assert np.square(z).sum() < chi2.ppf(0.95, 3), z
    # A data sheet's Poisson's ratio is known to a few 1e-4; the ringing tells it to some 1e-6.
    assert found.estimates["poisson"].sigma < 2e-5
    assert not [text for text in found.warnings if "disagree" in text]
    # With the declared values the model leaves a hundred times the misfit of the force.
    held = found.held_answer
    assert held is not None
    assert held.held == {"poisson": shot.model.poisson, "damping": shot.model.damping}
    assert held.chi2_force > 100.0 * held.free_chi2_force
    assert held.sigma > found.estimates["stiffness_factor"].sigma
