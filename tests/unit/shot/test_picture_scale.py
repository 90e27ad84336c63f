"""A declared length against the pictures' scale: bounds in closed form, messages, no false alarm."""

from pathlib import Path

import numpy as np
import pytest
from shot_folders import OPEN_01
from synthetic_dic import rig

from dic.camera import Camera, StereoRig
from dic.images.series import PicturesInMemory
from kolsky.base.errors import InputError
from kolsky.pictures.correlation import check_length, length_contradicts, visible_distances, visible_lengths
from kolsky.pictures.picture_set import MOST_COMPARED, picture_changes
from kolsky.schema.shot_file import shot_toml

FOCAL, BASE, WIDTH = 5000.0, 0.1, 1000
SHAPE = (600, WIDTH)
# Camera 1 stands beside camera 0 and looks the same way through a shifted lens: it sees a point of camera 0's
# axis at x = 2000 - FOCAL BASE / z, which lies between 0 and 999 for z from 500 / 2000 to 500 / 1001.
FIRST = Camera(FOCAL, FOCAL, 500.0, 300.0)
SECOND = Camera(FOCAL, FOCAL, 2000.0, 300.0, translation=np.array([-BASE, 0.0, 0.0]))
NEAR, FAR = FOCAL * BASE / 2000.0, FOCAL * BASE / (2000.0 - (WIDTH - 1))
CORNERS = np.array([[450.0, 280.0], [550.0, 280.0], [550.0, 320.0], [450.0, 320.0]])


def test_distances_at_which_both_cameras_see_a_point() -> None:
    found = visible_distances(FIRST, SECOND, np.array([500.0, 300.0]), SHAPE)
    assert found.min() == pytest.approx(NEAR, rel=1e-3)
    assert found.max() == pytest.approx(FAR, rel=1e-3)


@pytest.mark.parametrize(
    ("toward", "pixels"), [("left", 100.0), ("right", 100.0), ("up", 40.0), ("down", 40.0)]
)
def test_lengths_of_a_region(toward: str, pixels: float) -> None:
    seen = visible_lengths(StereoRig((FIRST, SECOND)), CORNERS, toward, (SHAPE, SHAPE))  # type: ignore[arg-type]
    assert seen == pytest.approx((pixels / FOCAL * NEAR, pixels / FOCAL * FAR), rel=1e-3)


def test_a_ray_that_camera_1_does_not_see() -> None:
    away = Camera(FOCAL, FOCAL, 2000.0, 300.0, translation=np.array([BASE, 0.0, 0.0]))
    assert visible_lengths(StereoRig((FIRST, away)), CORNERS, "up", (SHAPE, SHAPE)) is None


@pytest.mark.parametrize("length", [6.5e-3, 3.34e-3, 49.9e-3])
def test_lengths_that_the_pictures_allow(length: float) -> None:
    assert not length_contradicts(length, (5e-3, 10e-3))  # 5 / 1.5 = 3.33 mm to 10 / 0.2 = 50 mm
    assert not length_contradicts(length, None)


@pytest.mark.parametrize("length", [65e-3, 6.5, 0.65e-3, 3.32e-3, 50.1e-3])
def test_lengths_that_the_pictures_contradict(length: float) -> None:
    assert length_contradicts(length, (5e-3, 10e-3))
    assert not length_contradicts(length, None)


def test_a_sound_rig_holds_its_specimen() -> None:
    corners = np.array([[10.0, 5.0], [117.0, 5.0], [117.0, 122.0], [10.0, 122.0]])
    shapes = ((128, 128), (128, 128))
    seen = visible_lengths(rig(), corners, "up", shapes)
    assert seen[0] < 6.5e-3 < seen[1] < 10e-3  # 117 px at 18 px/mm
    assert not length_contradicts(6.5e-3, seen)
    assert length_contradicts(65e-3, seen)


def test_the_refusal_names_both(tmp_path: Path) -> None:
    path = tmp_path / "shot.toml"
    path.write_text((OPEN_01 / "shot.toml").read_text().replace('"6.5 mm"', '"65 mm"'))
    toml = shot_toml(path)
    check_length(toml, None)
    check_length(toml, (60e-3, 70e-3))
    with pytest.raises(InputError) as raised:
        check_length(toml, (5e-3, 10e-3))
    said = str(raised.value)
    assert "shot.toml" in said
    assert 'specimen.length = "65 mm" contradicts the pictures' in said
    assert "5 to 10 mm long" in said
    assert "3.333 to 50 mm" in said
    assert "Cure: " in said


def series(levels: list[int]) -> PicturesInMemory:
    """Even pictures of 10 bits with given grey values."""
    return PicturesInMemory(tuple(np.full((4, 5), level, np.uint16) for level in levels), bits=10)


def test_change_is_relative_to_white_and_to_the_first_picture() -> None:
    time = 1e-6 * np.arange(5.0)
    found = picture_changes((series([100, 100, 90, 200, 1023]), series([7, 7, 7, 7, 8])), time, 2)
    np.testing.assert_allclose(found.change[0], np.array([0.0, 0.0, 10.0, 100.0, 923.0]) / 1023.0, rtol=1e-12)
    np.testing.assert_allclose(found.change[1], np.array([0.0, 0.0, 0.0, 0.0, 1.0]) / 1023.0, rtol=1e-12)
    assert found.rest_end == time[1]
    assert [at for at, _ in found.shown] == [time[0], time[1], time[4]]
    assert [float(picture[0, 0]) for _, picture in found.shown] == pytest.approx(
        [100 / 1023, 100 / 1023, 1.0], rel=1e-12
    )


def test_a_long_series_is_compared_at_equal_distances_to_its_end() -> None:
    n = 3 * MOST_COMPARED
    time = np.arange(float(n))
    pictures = series([0] * (n - 1) + [1023])
    found = picture_changes((pictures, pictures), time, 1)
    assert found.time.size == MOST_COMPARED
    assert found.time[-1] == time[-1]
    assert found.change[0, -1] == 1.0
    assert len(found.shown) == 2  # the first frame is the last static one
