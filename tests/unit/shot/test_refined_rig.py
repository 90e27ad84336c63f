"""Refinement of the pose on request of [calibration], and the choice between both rigs."""

from types import SimpleNamespace

import numpy as np
import pytest

import dic.calibration.refine
from dic import Camera, Correlation, StereoRig
from dic.calibration.refine import Refinement
from dic.correlation.subsets import Shape
from dic.images.series import PicturesInMemory
from kolsky.pictures.rig import refine_rig, refinement_words
from kolsky.schema.pictures import CalibrationSection

BLANK = np.full((64, 64), 100, dtype=np.uint8)
MASK = np.ones((64, 64), dtype=bool)
GIVEN = StereoRig(
    (
        Camera(500.0, 500.0, 32.0, 32.0),
        Camera(500.0, 500.0, 32.0, 32.0, translation=np.array([-0.1, 0.0, 0.0])),
    )
)
BETTER = StereoRig(
    (GIVEN.cameras[0], Camera(500.0, 500.0, 32.0, 32.0, translation=np.array([-0.1, 1e-4, 0.0])))
)


def asked(refine, monkeypatch=None, *, helps=True):
    section = SimpleNamespace(refine=refine)
    pictures = [PicturesInMemory([BLANK])] * 2
    if monkeypatch is not None:
        zero = np.zeros(3)
        after = 0.05 if helps else 0.19
        found = Refinement(BETTER, zero, zero[:2], np.eye(5), 0.2, after, 0.2, after, 100)
        monkeypatch.setattr(dic.calibration.refine, "refine_from_pictures", lambda *given, **more: found)
    settings = Correlation(shape=Shape.QUADRATIC)
    return refine_rig(section, GIVEN, pictures, 0, MASK, settings, step=8)


def test_nothing_is_refined_unless_it_is_asked_for():
    assert CalibrationSection(file="rig.xml").refine is False
    assert asked(False) == (GIVEN, {})
    assert refinement_words({}) == ""


@pytest.mark.parametrize(
    ("refine", "helps", "taken"),
    [(True, True, BETTER), (True, False, BETTER), ("auto", True, BETTER), ("auto", False, GIVEN)],
)
def test_auto_takes_the_refined_pose_where_it_helps(monkeypatch, refine, helps, taken):
    rig, facts = asked(refine, monkeypatch, helps=helps)
    assert rig is taken
    assert facts["used"] is (taken is BETTER)
    assert facts["helps"] is helps
    said = refinement_words(facts)
    assert said.startswith("used" if taken is BETTER else "not used")
    assert "0.2000 px by the calibration" in said


def test_pictures_without_speckles_leave_the_cameras_and_say_so():
    rig, facts = asked("auto")
    assert rig is GIVEN
    assert facts["used"] is False
    assert refinement_words(facts).startswith("not possible")
