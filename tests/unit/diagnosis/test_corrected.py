"""Correction of a likely cause: the corrected shot equals the correct one."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from kolsky.base.records import FlyerMotion
from kolsky.diagnosis.cause_inputs import corrected
from kolsky.inverse.result import CauseFinding
from kolsky.inverse.settings import Settings
from kolsky.shot.load import load_shot
from kolsky.shot.records import ForceChannel, Shot

OPEN_01 = Path(__file__).parents[3] / "runs" / "open-01"


@cache
def right() -> Shot:
    return load_shot(OPEN_01)


def put_right(shot: Shot, key: str, value: float) -> Shot:
    finding = CauseFinding(key, "", "1", 0.0, value, 0.0, 1.0, 0.0, 0.0, {}, {}, named=True)
    found = corrected(shot, Settings(), finding)
    assert found is not None
    return found[0]


def channel(shot: Shot) -> ForceChannel:
    assert isinstance(shot.force, ForceChannel)
    return shot.force


def flyer(shot: Shot) -> FlyerMotion:
    assert isinstance(shot.flyer, FlyerMotion)
    return shot.flyer


def test_half_the_sensitivity_is_a_gain_of_one_half() -> None:
    force = channel(right())
    wrong = replace(
        right(),
        force=replace(
            force, transducer=replace(force.transducer, sensitivity=0.5 * force.transducer.sensitivity)
        ),
    )
    again = put_right(wrong, "force.sensitivity", 0.5)
    assert channel(again).transducer.sensitivity == pytest.approx(force.transducer.sensitivity, rel=1e-15)
    np.testing.assert_allclose(channel(again).raw_force(), force.raw_force(), rtol=1e-12)


def test_a_zero_is_taken_off_after_the_baseline() -> None:
    """What no zero of the baseline's own can be: a step of the force by so many newtons."""
    force = channel(right())
    lower = channel(put_right(right(), "force.baseline", 2.0))
    change = lower.raw_force() - force.raw_force()
    later = force.time > force.baseline[1]
    np.testing.assert_allclose(change[later], -2.0, rtol=1e-9)
    np.testing.assert_allclose(change[~later], 0.0, atol=1e-12)


def test_late_records_come_earlier() -> None:
    late = 2e-5
    np.testing.assert_allclose(
        channel(put_right(right(), "force.clock_offset", late)).time, channel(right()).time - late, atol=1e-15
    )
    early = put_right(right(), "flyer.time", late)
    np.testing.assert_allclose(flyer(early).time, flyer(right()).time - late, atol=1e-15)
    assert early.window == (right().window[0], pytest.approx(flyer(right()).time[-1] - late))
    line, moved = right().centre_line, put_right(right(), "centre_line.time", late).centre_line
    assert line is not None
    assert moved is not None
    np.testing.assert_allclose(moved.time, line.time - late, atol=1e-15)


def test_places_scales_and_the_specimen() -> None:
    line = right().centre_line
    height = put_right(right(), "centre_line.y_offset", -1e-4).centre_line
    radius = put_right(right(), "centre_line.Z_offset", -2e-5).centre_line
    assert line is not None
    assert height is not None
    assert radius is not None
    np.testing.assert_allclose(height.y, line.y - 1e-4, atol=1e-15)
    np.testing.assert_allclose(radius.Z, line.Z - 2e-5, atol=1e-15)
    scaled = flyer(put_right(right(), "flyer.displacement", 1.01))
    np.testing.assert_allclose(scaled.displacement, 1.01 * flyer(right()).displacement, rtol=1e-12)
    for name in ("length", "density", "diameter"):
        specimen = put_right(right(), f"specimen.{name}", 1.02).specimen
        assert getattr(specimen, name) == pytest.approx(1.02 * getattr(right().specimen, name), rel=1e-12)


def test_parameters_are_held_and_a_tilt_cannot_be_put_right() -> None:
    finding = CauseFinding("model.poisson", "", "1", 0.499, 0.4985, 0.0, 1.0, 0.0, 0.0, {}, {}, named=True)
    found = corrected(right(), Settings(held={"damping": 2e-5}), finding)
    assert found is not None
    assert found[1].held == {"damping": 2e-5, "poisson": 0.4985}
    assert corrected(right(), Settings(), replace(finding, key="flyer tilt")) is None
