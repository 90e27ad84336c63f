"""The position at rest of a flyer that no static frame shows: closed forms, and rendered pictures."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from speckle_pictures import Speckles
from stereo_scene import CYLINDER, NOISE, RADIUS, SHAPE, rig

from dic.bodies.axial_displacement import combine_rest, common_sigma, include_static_frames
from dic.bodies.rest_from_rim import RestGeometry, combine_rims, face_width, find_rim, first_varying
from dic.images import PictureError
from dic.surfaces.cylinder import SpecimenFrame

SCALE = 5400.0 / 0.295  # pixels per metre where the cylinder faces the cameras
RIG = rig()
FRAME = SpecimenFrame(np.eye(3), np.zeros(3), np.zeros((6, 6)))


def test_the_first_row_that_varies():
    """Five times the flyer's 1, and 0.12 of the specimen's 40: 5; the third row from the end is the first
    above."""
    spread = np.array([1.0, 1.0, 1.0, 1.0, 4.9, 5.1, 30.0, 40.0])
    assert first_varying(spread, 6, 40.0) == 5
    assert first_varying(spread, 6, 45.0) == 6  # 0.12 of it is 5.4


def test_what_was_seen_and_the_end_are_joined():
    place, sigma = combine_rest((0.0, 3e-6), (10e-6, 4e-6))
    assert place == pytest.approx(10e-6 * 9.0 / 25.0)
    assert sigma == pytest.approx(2.4e-6)  # 1 / sqrt(1/9 + 1/16)
    assert combine_rest((0.0, 3e-6), (20.1e-6, 4e-6)) == (0.0, 3e-6)  # more than four times 5 um apart


def test_what_static_frames_share():
    assert common_sigma(0.5) == 0.008
    assert common_sigma(5.0) == pytest.approx(np.hypot(0.008, 0.004))  # 0.001 of what is more than 1 px


def test_the_face_is_seen_at_a_glance_from_below_only():
    """A rim of 7.5 mm, 2 mm above a camera 292.5 mm from it: rays to it and to a specimen of 5 mm, 2.5 mm
    behind, meet the plane of the rim 2.5 * 2 / 292.5 mm apart."""
    geometry = RestGeometry(length=6e-3, length_sigma=0.0, radius=5e-3)
    camera = np.array([0.0, 4e-3, 0.3])
    assert face_width(camera, 6e-3, 7.5e-3, geometry) == pytest.approx([2.5e-3 * 2e-3 / 0.2925] * 2)
    assert face_width(camera, 3.9e-3, 7.5e-3, geometry) == (0.0, 0.0)
    # half as long it has twice the cross-section, unless its end holds to the face
    low = np.array([0.0, 1e-3, 0.3])
    held, mean = face_width(low, 3e-3, 7.5e-3, geometry)
    assert held == pytest.approx(2.5e-3 * 2e-3 / 0.2925)
    assert mean == pytest.approx((7.5 - 5 * 2**0.5) * 1e-3 * 2e-3 / 0.2925)
    assert face_width(low, 3e-3, 5e-3, geometry) == (0.0, 0.0)


def series_of(frame):
    return SimpleNamespace(shape=SHAPE, frame=frame)


def unreadable(frame):
    raise PictureError(Path("cam1.tif"), "is not there", frame=frame)


def test_cameras_that_disagree_widen_the_rim_and_an_unknown_length_gives_no_rest():
    """Two places of sigma 3 and 4 µm, five and ten times 4 µm apart; half of that is in the mean's sigma."""
    for apart in (19.9e-6, 40e-6):
        found = combine_rims([0.0, apart], [3e-6, 4e-6])
        assert found.y == pytest.approx(0.5 * apart)
        assert found.sigma == pytest.approx(np.hypot(5e-6 / 2**0.5, 0.5 * apart))  # the mean of 9 and 16
    assert not RestGeometry(length=6e-3, length_sigma=found.sigma, radius=5e-3).length_is_certain
    alone = combine_rims([1e-6], [3e-6])
    assert (alone.y, alone.sigma, alone.cameras) == (1e-6, 3e-6, 1)
    # One part in four hundred of 6 mm is 15 µm, more than the travel may be off by.
    assert RestGeometry(length=6e-3, length_sigma=14.9e-6, radius=5e-3).length_is_certain
    assert not RestGeometry(length=6e-3, length_sigma=15.1e-6, radius=5e-3).length_is_certain


LOW = -1.0e-3  # rim at translation zero [m]
TRAVELS = 100e-6 * np.arange(10)


def test_the_rim_of_a_body_that_passes_a_specimen_is_found():
    """The body comes down 1 mm over speckles at rest; its region ends two pixels short of the rim."""
    body, ground = Speckles(3.5e-4, seed=5), Speckles(3.5e-4, seed=6)
    rng = np.random.default_rng(2)

    def pattern(travel: float):
        return lambda arc, height: np.where(
            height + travel > LOW, body(arc, height + travel), ground(arc, height)
        )

    camera = RIG.cameras[0]
    clean = (CYLINDER.picture(camera, SHAPE, pattern(d), oversample=3) for d in TRAVELS)
    pictures = [picture + rng.normal(0.0, NOISE, SHAPE) for picture in clean]
    series = (series_of(pictures.__getitem__), series_of(unreadable))
    angle, height = np.meshgrid(np.linspace(-0.2, 0.2, 9), np.linspace(-0.5e-3, 0.5e-3, 5))
    places = np.stack([RADIUS * np.sin(angle), height, RADIUS * np.cos(angle)], axis=-1).reshape(-1, 3)
    moves = np.stack([0.0 * TRAVELS, -TRAVELS, 0.0 * TRAVELS], axis=1)
    points = RIG.cameras[0].project(FRAME.in_rig(places))
    edge = float(RIG.cameras[0].project(FRAME.in_rig(np.array([[0.0, LOW, RADIUS]])))[0, 1])
    mask = np.broadcast_to(np.arange(SHAPE[0])[:, None] < edge - 2.0, SHAPE)
    tracked = SimpleNamespace(points=points, mask=mask)
    geometry = RestGeometry(length=6e-3, length_sigma=0.0, radius=RADIUS)
    found = find_rim(series, tracked, RIG, FRAME, places, moves, geometry)
    assert found.cameras == 1  # the other has no pictures
    assert 0.12 <= found.sigma * SCALE < 0.15  # the model's 0.12 px, and the fit of ten frames
    assert abs(found.y - LOW) * SCALE < 0.2  # the paint reaches to the rim: three times half of that
    # a body that does not move relative to what is below has no rim that motion could tell
    still = np.zeros_like(moves)
    frozen = (series_of(lambda k: pictures[0]), series_of(unreadable))
    assert find_rim(frozen, tracked, RIG, FRAME, places, still, geometry) is None


def test_static_frames_that_do_not_show_the_body_are_at_rest() -> None:
    """Frames 0 to 2 rest at 6 mm; frame 1 was seen a little off, and stays as it was seen."""
    index, y, sigma, counts = include_static_frames(
        np.arange(3), 6e-3, np.array([1, 3]), np.array([6.001e-3, 5e-3]), [1e-6, 3e-6], [4, 9]
    )
    assert index.tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(y, [6e-3, 6.001e-3, 6e-3, 5e-3])
    np.testing.assert_allclose(sigma, [2e-6, 1e-6, 2e-6, 3e-6])
    assert counts == [0, 4, 0, 9]
