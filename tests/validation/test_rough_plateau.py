"""Friction freed where no finite coefficient is true: nothing on the misfit's plateau is identified."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kolsky.identification import identify
from kolsky.inverse.forward import Numerics
from kolsky.inverse.problem import Settings
from kolsky.inverse.result import Verdict
from kolsky.shot.load import load_shot
from populations.coverage_problem import SLIDING, drawn, experiment, simulate

OPEN = Path(__file__).resolve().parents[2] / "runs" / "open-01"


@pytest.mark.slow
def test_nothing_is_identified_on_a_plateau() -> None:
    truth = json.loads((OPEN / "truth.json").read_text("utf-8"))
    assert truth["friction"] == "no slip"
    coarse = Settings(
        free={"stiffness_factor": (0.9, 1.4), "friction": (0.05, 1.0)},
        numerics=Numerics(mesh=(12, 16)),
        refined_mesh=(18, 24),
        replicate_mesh=(12, 16),
        replicates=8,
    )
    found = identify(load_shot(OPEN), coarse)
    for e in found.estimates.values():
        assert not e.outcome.identified, e
    # A face that sticks is one of any large coefficient: from where on is said, and that nothing ends it.
    assert any("friction is at least" in w and "nothing bounds it" in w for w in found.warnings)
    low, high = found.estimates["stiffness_factor"].interval
    assert low < truth["m"] < high


@pytest.mark.slow
def test_no_friction_is_not_told_from_a_little() -> None:
    """Made without friction: the coefficient's interval begins at none, and how far it reaches is said."""
    seed = 83
    setup, truth = drawn(0, seed)
    truth = replace(truth, friction=0.0)
    # Finer by a third than the answer's mesh: without friction the specimen stays nearly a cylinder.
    (seen,) = simulate(setup, [truth], mesh=(24, 32), device="cpu", interface=SLIDING)
    shot = experiment(0, setup, truth, seen, SLIDING, np.random.default_rng([seed, 1]))
    coarse = Settings(
        free={"stiffness_factor": (0.7, 1.5), "friction": (0.0, 0.5)},
        numerics=Numerics(mesh=(12, 16)),
        refined_mesh=(18, 24),
        replicate_mesh=(12, 16),
        replicates=8,
    )
    found = identify(shot, coarse)
    friction, m = found.estimates["friction"], found.estimates["stiffness_factor"]
    assert all(channel.explained for channel in found.fit)
    assert friction.outcome is Verdict.BOUND_REACHED
    assert any("friction is at most" in w and "nothing bounds it" in w for w in found.warnings)
    assert any(
        "interval of friction reaches past the bounds of its design (0 to 0.5)" in w for w in found.warnings
    )
    # The plateau is narrow: a coefficient of 0.01 lies far outside.
    low, high = friction.interval
    assert low == 0.0 < high < 0.01  # it ends where the search did
    # m, which does not lie on it, is told.
    assert m.outcome.identified
    assert m.interval[0] < truth.stiffness_factor < m.interval[1]
