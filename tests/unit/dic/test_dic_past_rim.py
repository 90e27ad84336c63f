"""A region of the flyer that reaches past the rim of its face: the used part, in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest
from stereo_scene import FOCAL, RADIUS, SHAPE, rig

from dic.chain import follow_bodies, remarks
from dic.chain.follow_bodies import CLEAR, before_rim
from dic.outcome import PointOutcome
from dic.surfaces.cylinder import SpecimenFrame

CAMERA = rig().cameras[0]
FRAME = SpecimenFrame(np.eye(3), np.zeros(3), np.zeros((6, 6)))
MIDDLE = SHAPE[1] // 2


def rim_at(row: float) -> float:
    """y of the place on the cylinder's side toward the camera that is seen in a row of the middle column."""
    low, high = -3e-3, 3e-3
    toward = CAMERA.centre[[0, 2]] / np.linalg.norm(CAMERA.centre[[0, 2]])
    for _ in range(60):
        y = 0.5 * (low + high)
        seen = CAMERA.project(np.array([[RADIUS * toward[0], y, RADIUS * toward[1]]]))[0, 1]
        low, high = (y, high) if seen > row else (low, y)  # rows are counted downward
    return low


def region(last: int) -> np.ndarray:
    """Ten columns about the middle, from the picture's border down to a row."""
    mask = np.zeros(SHAPE, dtype=bool)
    mask[: last + 1, MIDDLE - 5 : MIDDLE + 5] = True
    return mask


@pytest.mark.parametrize("move", [(0.0, 0.0, 0.0), (0.0, -0.5e-3, 0.0)])
def test_what_lies_past_the_rim_is_left_out_with_a_pixel_before_it(move):
    """The rim is seen at row 60.3 and the region ends with row 62, 1.7 px past it; what is left ends with
    59, the last row that is a pixel clear of it."""
    rim = rim_at(60.3) - move[1]
    kept, past = before_rim(region(62), CAMERA, FRAME, RADIUS, np.array(move), rim)
    assert past == pytest.approx(1.7, abs=0.05)
    np.testing.assert_array_equal(kept, region(59))
    assert CLEAR == 1.0


def test_a_region_that_ends_before_the_rim_is_left_as_it_is():
    kept, past = before_rim(region(60), CAMERA, FRAME, RADIUS, np.zeros(3), rim_at(60.3))
    assert past == 0.0
    np.testing.assert_array_equal(kept, region(60))


def test_a_flyer_off_the_axis_is_looked_at_where_it_is():
    """The camera stands 2 mm above the rim's plane: a side that is a tenth of a metre nearer, a third of its
    distance, shows the plane half as far again below the middle row."""
    move = np.array([0.1 * CAMERA.centre[0] / CAMERA.centre[2], 0.0, 0.1])
    distance = np.hypot(*CAMERA.centre[[0, 2]]) - np.hypot(move[0], move[2]) - RADIUS
    below = 0.5 * (SHAPE[0] - 1) + FOCAL * 2e-3 / distance
    kept, past = before_rim(region(120), CAMERA, FRAME, RADIUS, move, -2e-3)
    assert past == pytest.approx(120 - below, abs=0.25)  # the lens bends by less
    assert np.flatnonzero(kept.any(axis=1))[-1] == int(np.floor(below - 1.0))


def test_a_ray_that_misses_the_flyer_shows_none_of_it():
    wide = np.ones(SHAPE, dtype=bool)
    kept, past = before_rim(wide, CAMERA, FRAME, 0.5e-3, np.zeros(3), 0.0)
    columns = np.flatnonzero(kept.any(axis=0))
    assert past > 0.0
    assert np.ptp(columns) < 2.0 * 0.5e-3 * FOCAL / 0.299 + 1.0  # its silhouette, of 128 columns


def test_what_holds_no_point_is_not_followed_and_said(monkeypatch):
    def no_room(inputs, region, mask):
        raise ValueError("no room")

    monkeypatch.setattr(follow_bodies, "match_flyer", no_room)
    assert follow_bodies.follow_before_rim(None, None, region(3)) is None
    outcome = np.full((2, 3), int(PointOutcome.STEREO_MISMATCH))
    body = SimpleNamespace(reconstruction=SimpleNamespace(outcome=outcome))
    monkeypatch.setattr(follow_bodies, "match_flyer", lambda *given: None)
    monkeypatch.setattr(follow_bodies, "follow", lambda *given: [body])
    assert follow_bodies.follow_before_rim(None, None, region(3)) is None
    outcome[1, 2] = int(PointOutcome.VALID)
    assert follow_bodies.follow_before_rim(None, None, region(3)) is body
    assert remarks.of_rim(0.0, False) == []
    (left_out,), (kept,) = remarks.of_rim(1.74, True), remarks.of_rim(1.74, False)
    assert "1.7 px past the rim" in left_out.text
    assert "left out" in left_out.text
    assert "left out" not in kept.text
    assert kept.cure.startswith("declare a region")
