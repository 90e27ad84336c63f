"""The piece of an epipolar curve that a picture shows: held to closed forms and to dense sampling."""

import numpy as np
import pytest
from epipolar_numpy import points_along, shows
from stereo_scene import CYLINDER, DISTANCE, FOCAL, SHAPE, grid, pictures, rig

from dic.camera import Camera, StereoRig
from dic.correlation.subsets import identity
from dic.stereo.epipolar_search import StereoSearch, distance_along, ideal_box, search, subsets, visible_piece
from dic.stereo.geometry import directions

LIMITS = (0.015, 6.0)


def _side_by_side(focal: float, baseline: float, columns: int) -> StereoRig:
    """Parallel cameras along x, the principal points in the middle."""
    cameras = [
        Camera(focal, focal, 0.5 * (columns - 1), 0.5 * (columns - 1), translation=np.array([-x, 0.0, 0.0]))
        for x in (0.0, baseline)
    ]
    return StereoRig((cameras[0], cameras[1]))


def test_parallel_cameras_show_disparities_from_zero_to_the_border() -> None:
    focal, baseline, columns = 6000.0, 0.08, 101
    pair = _side_by_side(focal, baseline, columns)
    d = directions(pair.cameras[0], np.array([[50.0, 50.0], [80.0, 50.0]]))
    piece = visible_piece(pair, d, (columns, columns), (1.0, 1000.0))
    # x1 = x0 - f b q: from the farthest limit to the left border, which lies 2 % of the width farther out
    room = 0.02 * (columns - 1)
    np.testing.assert_allclose(piece[0], [1e-3, (50.0 + room) / (focal * baseline)], rtol=1e-4)
    np.testing.assert_allclose(piece[1, 1], (80.0 + room) / (focal * baseline), rtol=1e-4)


@pytest.mark.parametrize("angle", [4.0, 12.5, 30.0])
def test_all_that_a_dense_walk_sees_lies_in_the_piece(angle: float) -> None:
    pair, pixels = rig(angle), grid(24, 8)
    piece = visible_piece(pair, directions(pair.cameras[0], pixels), SHAPE, LIMITS)
    q = np.broadcast_to(np.linspace(1.0 / LIMITS[1], 1.0 / LIMITS[0], 20000), (len(pixels), 20000))
    seen = shows(pair.cameras[1], points_along(pair, pixels, 1.0 / q), SHAPE)
    assert seen.any(axis=1).sum() > 8
    for row in np.flatnonzero(seen.any(axis=1)):
        where = q[row, seen[row]]
        assert piece[row, 0] <= where[0]
        assert where[-1] <= piece[row, 1]
        # the box is larger by 2 % of the picture on each side, the lens bends it by as much again
        room = 0.06 * SHAPE[1] / (FOCAL * 2.0 * DISTANCE * np.sin(0.5 * np.radians(angle)))
        assert piece[row, 1] - piece[row, 0] < 1.2 * (where[-1] - where[0]) + room


def test_a_ray_that_the_picture_does_not_show_has_no_piece() -> None:
    pair = _side_by_side(6000.0, 0.08, 101)
    piece = visible_piece(pair, np.array([[0.0, 0.5, np.sqrt(0.75)]]), (101, 101), LIMITS)
    assert piece[0, 0] == piece[0, 1] == 1.0 / LIMITS[1]


def test_without_a_box_a_place_behind_the_camera_is_in_no_piece() -> None:
    # the lens folds on the border; camera 1 stands 0.2 m ahead of camera 0: what is nearer lies behind it
    folding = {"distortion": (-0.6, 0.0, 0.0, 0.0, 0.0)}
    first = Camera(60.0, 60.0, 50.0, 50.0, **folding)
    second = Camera(60.0, 60.0, 50.0, 50.0, translation=np.array([0.0, 0.0, -0.2]), **folding)
    assert ideal_box(second, (101, 101)) is None
    piece = visible_piece(StereoRig((first, second)), np.array([[0.0, 0.0, 1.0]]), (101, 101), (0.15, 200.0))
    np.testing.assert_allclose(piece[0], [1.0 / 200.0, 1.0 / 0.2], rtol=1e-12)


@pytest.mark.parametrize("angle", np.linspace(6.0, 24.0, 7))
def test_surfaces_are_found_whatever_the_angle(angle: float) -> None:
    pair, points = rig(angle), grid(32, 32)
    images = [picture.astype(np.float32) for picture in pictures(angle)]
    wanted = subsets(images[0], points, identity(len(points)), 25, None)
    found = search(pair, wanted, images[1], limits=None, turns=StereoSearch().turns)
    assert np.isfinite(found.distance).all()  # no curve passes the picture by
    exact = distance_along(pair, points, CYLINDER.hit(pair.cameras[0], points))
    assert np.median(np.abs(found.distance - exact)) < 1e-3
