"""Subsets past the specimen's ends, and behind a platen's rim: closed forms with pinhole cameras."""

from types import SimpleNamespace

import numpy as np
import pytest

from dic.camera import Camera, StereoRig
from dic.chain import outliers
from dic.chain.outliers import axis_in_picture, past_the_ends, visible_room
from dic.outcome import PointOutcome
from dic.surfaces.cylinder import SpecimenFrame

FOCAL, AWAY = 5400.0, 0.3
"""Focal length [px] and distance of the cameras from the axis [m]: 18 px/mm."""
FRAME = SpecimenFrame(np.eye(3), np.zeros(3), np.zeros((6, 6)))
RADIUS, RIM, LENGTH = 5e-3, 7.5e-3, 6e-3
UP, DOWN = np.array([0.0, -1.0]), np.array([0.0, 1.0])


def level(height: float) -> Camera:
    """A camera at this height [m] that looks across the axis."""
    turned = np.diag([1.0, -1.0, -1.0])
    return Camera(FOCAL, FOCAL, 100.0, 100.0, 0.0, np.zeros(5), turned, -turned @ [0.0, height, AWAY])


def room(height: float, y: float, end: float, outward: np.ndarray, *, x: float = 0.0) -> float:
    """Room of a point on the specimen's side, to the rim."""
    camera = level(height)
    place = np.array([[x, y, np.sqrt(RADIUS**2 - x**2)]])
    return float(visible_room(camera, FRAME, place, camera.project(place), end, outward, RIM)[0])


def test_a_camera_over_the_end_sees_it_behind_the_rim():
    """4 mm above the upper end and below the lower one: the rim stands 2.5 mm before the side."""
    own, rim = AWAY - RADIUS, AWAY - RIM
    h = LENGTH + 4e-3
    assert room(h, 5.5e-3, LENGTH, UP) == pytest.approx(FOCAL * (4.5e-3 / own - 4e-3 / rim))
    assert room(-4e-3, 0.5e-3, 0.0, DOWN) == pytest.approx(FOCAL * (4.5e-3 / own - 4e-3 / rim))


def test_a_camera_before_the_end_sees_the_end_itself():
    assert room(3e-3, 5.5e-3, LENGTH, UP) == pytest.approx(FOCAL * 0.5e-3 / (AWAY - RADIUS))
    assert room(3e-3, 0.5e-3, 0.0, DOWN) == pytest.approx(FOCAL * 0.5e-3 / (AWAY - RADIUS))


def test_beside_the_axis_the_rim_is_met_where_the_ray_crosses_it():
    """The ray to x = 3 mm, z = 4 mm is at the share s of its way where it crosses the rim."""
    x, z, h = 3e-3, 4e-3, LENGTH + 4e-3
    reach = np.hypot(x, AWAY - z)
    middle = AWAY * (AWAY - z) / reach**2
    s = middle - np.sqrt(middle**2 - (AWAY**2 - RIM**2) / reach**2)
    assert np.hypot(s * x, AWAY - s * (AWAY - z)) == pytest.approx(RIM)
    expected = FOCAL * (4.5e-3 - 4e-3 / s) / (AWAY - z)
    assert room(h, 5.5e-3, LENGTH, UP, x=x) == pytest.approx(expected)


def test_a_side_that_bulges_beyond_the_rim_is_seen_to_its_end():
    camera = level(LENGTH + 4e-3)
    place = np.array([[0.0, 5.5e-3, 1.05 * RIM]])
    found = visible_room(camera, FRAME, place, camera.project(place), LENGTH, UP, RIM)
    assert found[0] == pytest.approx(FOCAL * 0.5e-3 / (AWAY - 1.05 * RIM))


def test_direction_and_scale_of_the_axis():
    along, scale = axis_in_picture(level(0.0), FRAME, np.array([[0.0, 1e-3, RADIUS], [0.0, 3e-3, RADIUS]]))
    assert along == pytest.approx(UP)
    assert scale == pytest.approx(FOCAL / (AWAY - RADIUS))


def seen(heights: tuple[float, float], places: np.ndarray, *, bend: float = 0.0) -> tuple:
    """A body of one frame whose material picture is camera 0's, and the cameras."""
    cameras = (level(heights[0]), level(heights[1]))
    pixels = [camera.project(places)[None] for camera in cameras]
    warps = [np.zeros((1, len(places), 12)) for _ in cameras]
    warps[1][..., :2] = pixels[1] - pixels[0]
    warps[1][..., 11] = bend  # second derivative along the axis of what camera 1 sees
    body = SimpleNamespace(
        points=pixels[0][0],
        mask=np.ones((4500, 200), dtype=bool),
        tracks=tuple(SimpleNamespace(warp=warp) for warp in warps),
        reconstruction=SimpleNamespace(
            position=places[None],
            pixels=tuple(pixels),
            outcome=np.full((1, len(places)), int(PointOutcome.VALID)),
        ),
    )
    return body, StereoRig(cameras)


ENDS = (np.zeros(1), np.full(1, LENGTH))


def judged(body: tuple, platen: float | None) -> list[bool]:
    return past_the_ends(body[0], body[1], FRAME, 15, (0.0, -1.0), ENDS, platen=platen)[0].tolist()


def column(distances: list[float]) -> np.ndarray:
    """Points so many pixels below the upper end as it is seen by a camera at its height."""
    y = LENGTH - np.array(distances) * (AWAY - RADIUS) / FOCAL
    return np.stack([np.zeros_like(y), y, np.full_like(y, RADIUS)], axis=1)


def test_a_subset_keeps_half_a_pixel_from_the_end():
    """One of 15 px reaches 7.5 px from its point: past an end 7.9 px away, not past one 8.1 px away."""
    body = seen((3e-3, 3e-3), column([7.9, 8.1]))
    assert judged(body, None) == [True, False]
    assert judged(body, RIM) == [True, False]


@pytest.mark.parametrize("above", [40e-3, 200e-3])
def test_what_one_camera_sees_behind_the_rim_is_past(above: float):
    """A camera stands above the end: its rim hides 6.2 or 31 px of the side, of which the other sees all."""
    h = LENGTH + above
    hidden = FOCAL * above * (1.0 / (AWAY - RIM) - 1.0 / (AWAY - RADIUS))
    for heights in ((3e-3, h), (h, 3e-3)):
        body = seen(heights, column([7.9 + hidden, 8.1 + hidden]))
        assert judged(body, RIM) == [True, False]
        assert judged(body, None) == [False, False]


def test_the_lower_end_too():
    """6 mm are 109.8 px: points 7.9 and 8.1 px above what camera 1 sees of the lower end, from below it."""
    hidden = FOCAL * 40e-3 * (1.0 / (AWAY - RIM) - 1.0 / (AWAY - RADIUS))
    whole = FOCAL * LENGTH / (AWAY - RADIUS)
    body = seen((3e-3, -40e-3), column([whole - 7.9 - hidden, whole - 8.1 - hidden]))
    assert judged(body, RIM) == [True, False]
    assert judged(body, None) == [False, False]


def test_a_subset_that_bends_reaches_as_far_as_its_own_warp_says():
    """A second derivative of -0.02 per pixel adds 0.02 7.5²/2 = 0.56 px upward, the picture's y down."""
    places = column([8.4, 8.7])
    assert judged(seen((3e-3, 3e-3), places), None) == [False, False]
    assert judged(seen((3e-3, 3e-3), places, bend=-0.02), None) == [True, False]


def test_without_a_known_end_nothing_is_past_it():
    body = seen((3e-3, 3e-3), column([1.0]))
    unknown = (np.zeros(1), np.full(1, np.nan))
    assert not past_the_ends(body[0], body[1], FRAME, 15, (0.0, -1.0), unknown, platen=RIM).any()


def test_frames_are_judged_alike_one_by_one_and_together(monkeypatch):
    """Two frames of which the second has its end half a pixel lower."""
    (body, rig), lower = seen((3e-3, 3e-3), column([7.9, 8.1, 8.7])), 0.5 * (AWAY - RADIUS) / FOCAL
    for track in body.tracks:
        track.warp = np.repeat(track.warp, 2, axis=0)
    r = body.reconstruction
    r.position, r.outcome = np.repeat(r.position, 2, axis=0), np.repeat(r.outcome, 2, axis=0)
    r.pixels = tuple(np.repeat(pixels, 2, axis=0) for pixels in r.pixels)
    ends = (np.zeros(2), np.array([LENGTH, LENGTH - lower]))
    wanted = [[True, False, False], [True, True, False]]
    for most in (50_000, 1):
        monkeypatch.setattr(outliers, "AT_ONCE", most)
        assert past_the_ends(body, rig, FRAME, 15, (0.0, -1.0), ends, platen=RIM).tolist() == wanted
