"""A force that is none, or of another size, never ends "identified": open-01 with a wrong force channel."""

from dataclasses import replace
from pathlib import Path

import pytest

from kolsky.identification import identify
from kolsky.inverse.forward import Numerics
from kolsky.inverse.problem import Settings
from kolsky.shot.load import load_shot
from kolsky.shot.records import ForceChannel, Shot

OPEN_01 = Path(__file__).parents[2] / "runs" / "open-01"
COARSE = Settings(free={"stiffness_factor": None}, numerics=Numerics(mesh=(12, 16)), refined_mesh=(18, 24))
"""Meshes on which this takes seconds; their own error is in what a right model is expected to leave."""


def with_force(wrong: str) -> Shot:
    """Open-01 with its sensitivity wrong by a factor, or with the time column for the voltage."""
    shot = load_shot(OPEN_01)
    channel = shot.force
    assert isinstance(channel, ForceChannel)
    if wrong == "time as voltage":
        recording = replace(channel.recording, value=channel.recording.time.copy())
        return replace(shot, force=replace(channel, recording=recording))
    transducer = channel.transducer
    other = replace(transducer, sensitivity=transducer.sensitivity / float(wrong))
    return replace(shot, force=replace(channel, transducer=other))


def said(shot: Shot) -> tuple[bool, str]:
    """Whether the stiffness factor is called identified, and the first warning."""
    result = identify(shot, COARSE)
    return result.estimates["stiffness_factor"].outcome.identified, next(iter(result.warnings), "")


@pytest.mark.slow  # four identifications on coarse meshes
@pytest.mark.parametrize("wrong", ["0.5", "2", "10", "time as voltage"])
def test_a_wrong_force_is_not_identified(wrong: str) -> None:
    identified, warning = said(with_force(wrong))
    assert not identified
    assert warning.startswith("the model does not explain the force")


@pytest.mark.slow  # one identification on coarse meshes
def test_the_right_force_is() -> None:
    identified, warning = said(with_force("1"))
    assert identified
    assert "does not explain" not in warning
