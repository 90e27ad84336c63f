"""Friction freed on a shot whose truth has none: nothing on the plateau of its rough misfit is identified."""

import json
from pathlib import Path

import pytest

from kolsky.identification import identify
from kolsky.inverse.forward import Numerics
from kolsky.inverse.settings import Settings
from kolsky.shot.load import load_shot

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
