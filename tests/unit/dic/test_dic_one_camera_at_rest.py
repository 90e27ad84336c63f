"""A body that only one camera sees at rest: its lateral position is that from both cameras."""

import numpy as np
import pytest
from test_dic_triangulate import TRACKED_RIG as RIG
from test_dic_triangulate import followed

from dic.bodies import axial_displacement
from dic.bodies.axial_displacement import Translations, translations
from dic.bodies.follow import TrackedBody
from dic.outcome import PointOutcome
from dic.stereo.reconstruction import reconstruct
from dic.surfaces.cylinder import SpecimenFrame

STATIC, ALONE, FRAMES = 4, 6, 16
HIGH, FAR = 0.01, 0.3
FRAME = SpecimenFrame(np.eye(3), np.zeros(3), np.zeros((6, 6)))
MOVED = 20e-6 * np.maximum(np.arange(FRAMES) - STATIC + 1, 0)
PLACE, SINCE = 5e-6, 12e-6


def found(monkeypatch: pytest.MonkeyPatch, *, scale: float = 0.0, sigma: float = 0.01) -> Translations:
    """A body 10 mm above the axes of cameras 0.3 m away that moves along y; camera 1 is blind at first.

    Its place across the axis is known to `PLACE` along Z, and may have changed by `SINCE` along x and Z; warm
    air magnifies it by `scale` in the frames that one camera sees. Pixels are said to be known to `sigma`.
    """
    x, y = np.meshgrid(np.linspace(-6e-4, 6e-4, 5), HIGH + np.linspace(-6e-4, 6e-4, 4))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    X = points + MOVED[:, None, None] * np.array([0.0, -1.0, 0.0])
    tracks = [followed(camera, X, sigma) for camera in RIG.cameras]
    pixels = RIG.cameras[0].project(X[:ALONE])
    tracks[0].warp[:ALONE, :, :2] += scale * (pixels - pixels.mean(axis=1, keepdims=True))
    tracks[1].outcome[:ALONE] = PointOutcome.LOW_CORRELATION
    body = TrackedBody(
        points=tracks[0].points, cell=np.zeros((x.size, 2), dtype=np.int64), mask=np.ones((4, 4), dtype=bool),
        material=FRAMES - 1, stereo=None, tracks=(tracks[0], tracks[1]),
        reconstruction=reconstruct(RIG, tracks[0], tracks[1]), common=None,
    )  # fmt: skip
    known = (np.zeros((FRAMES, 2)), np.full(FRAMES, SINCE), np.array([0.0, PLACE]))
    monkeypatch.setattr(axial_displacement, "lateral_places", lambda *_: known)
    static = np.arange(FRAMES) < STATIC
    result = translations(body, RIG, FRAME, np.arange(FRAMES) * 1e-5, static, subset=5)
    assert result is not None
    return result


def test_frames_at_rest_share_what_the_place_across_may_be_off(monkeypatch):
    """Along the camera's ray, turned by 0.1 about y, the place may be off by 12 µm sin 0.1 + 13 µm cos 0.1;
    the ray climbs by 10 mm in 300: 0.47 µm. Perspective across 20 points changes it by less than 0.1 %."""
    result = found(monkeypatch)
    along = SINCE * np.sin(0.1) + np.hypot(PLACE, SINCE) * np.cos(0.1)
    assert result.common == pytest.approx(along * HIGH / FAR, rel=2e-3)
    np.testing.assert_allclose(result.y - result.y[-1], MOVED[-1] - MOVED, atol=2e-9)  # no noise


def test_warm_air_that_magnifies_is_not_taken_for_a_way_toward_the_camera(monkeypatch):
    """Magnified by 2e-4 it looks 60 µm nearer, which would lift it by 2 µm; pixels of 1e-3 px would say so
    beside a place that may change by 12 µm."""
    result = found(monkeypatch, scale=2e-4, sigma=1e-3)
    np.testing.assert_allclose(result.y - result.y[-1], MOVED[-1] - MOVED, atol=0.1e-6)
