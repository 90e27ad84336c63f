"""A body that only shows its edge strip: rendered cylinders that have moved by a known distance."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from speckle_pictures import Speckles
from stereo_scene import CYLINDER, NOISE, RADIUS, SHAPE, rig

from dic.bodies.edge_registration import (
    LARGEST_EDGE,
    EdgeRegistration,
    at_rest_before,
    consistent_frames,
    least_zncc,
)
from dic.surfaces.cylinder import SpecimenFrame

SCALE = 5400.0 / 0.295  # pixels per metre where the cylinder faces the cameras
TOP = 0.5 * (SHAPE[0] - 1) / SCALE  # height that the first row shows
TRAVEL = 1.2e-3
RIG = rig()
FRAME = SpecimenFrame(np.eye(3), np.zeros(3), np.zeros((6, 6)))


def scene(shift: float, edge: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Both cameras' pictures: the body above `edge` at rest, moved up by `shift` [m], on another pattern."""
    body, ground = Speckles(3.5e-4, seed=5), Speckles(3.5e-4, seed=6)

    def pattern(arc: np.ndarray, height: np.ndarray) -> np.ndarray:
        return np.where(height - shift > edge, body(arc, height - shift), ground(arc, height))

    rng = np.random.default_rng(seed)
    first, second = (
        CYLINDER.picture(camera, SHAPE, pattern) + rng.normal(0.0, NOISE, SHAPE) for camera in RIG.cameras
    )
    return first, second


def search(edge: float) -> EdgeRegistration:
    """Registration with pictures in which it has come down by `TRAVEL`."""
    rows = np.arange(SHAPE[0])[:, None] < (TOP - (edge - TRAVEL)) * SCALE - 2.0
    angle = np.linspace(-0.3, 0.3, 7)
    places = np.stack([RADIUS * np.sin(angle), np.full(7, edge), RADIUS * np.cos(angle)], axis=1)
    move = np.array([0.0, -TRAVEL, 0.0])
    mask = np.broadcast_to(rows, SHAPE)
    return EdgeRegistration(scene(-TRAVEL, edge, 1), mask, RIG, FRAME, places, move)


@pytest.mark.parametrize("rest", [0.0, 13.7e-6])
def test_an_edge_strip_of_three_rows_is_found(rest):
    edge = TOP - 5.0 / SCALE  # five rows, of which two are left out with the edge
    tried = np.arange(-40e-6, 45e-6, 10e-6)
    found = search(edge).register(scene(rest, edge, 2), np.zeros(3), tried)
    assert found is not None
    assert found.zncc > 0.98
    # noise alone: 0.02 px over some hundred pixels; the pixel at the edge is not needed and left out
    assert abs(found.y - rest) < 1e-6
    assert found.clear
    assert found.common < 0.002 / SCALE
    assert abs(found.y - rest) < 4.0 * found.sigma


def blurred(pictures: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The first row is blurred from one side only, as a filter does that repeats it beyond the border."""
    first, second = (gaussian_filter1d(picture, 0.6, axis=0, mode="nearest") for picture in pictures)
    return first, second


def test_the_offset_of_the_last_row_is_found_from_frames_that_show_more():
    edge = TOP - 3.0 / SCALE  # one row, after the two at the edge
    rows = np.arange(SHAPE[0])[:, None] < (TOP - (edge - TRAVEL)) * SCALE - 2.0
    angle = np.linspace(-0.3, 0.3, 7)
    places = np.stack([RADIUS * np.sin(angle), np.full(7, edge), RADIUS * np.cos(angle)], axis=1)
    move, mask = np.array([0.0, -TRAVEL, 0.0]), np.broadcast_to(rows, SHAPE)
    edge_strip = EdgeRegistration(blurred(scene(-TRAVEL, edge, 1)), mask, RIG, FRAME, places, move)
    resting, tried = blurred(scene(0.0, edge, 2)), np.arange(-40e-6, 45e-6, 10e-6)
    before = edge_strip.register(resting, np.zeros(3), tried)
    shifts = -np.linspace(0.35e-3, 0.9e-3, 3)
    known = [
        (blurred(scene(shift, edge, 10 + k)), np.array([0.0, shift, 0.0])) for k, shift in enumerate(shifts)
    ]
    offset, scatter = edge_strip.fit_row_offsets(known)
    after = edge_strip.register(resting, np.zeros(3), tried)
    assert before is not None
    assert after is not None
    # The first row stands for all beyond it: its mean place lies further in by sum of k times weight k.
    weight = gaussian_filter1d(np.eye(1, 21, 10)[0], 0.6)[10:]
    assert offset[:, 0] * SCALE == pytest.approx(weight @ np.arange(11), abs=0.02)  # of a hundred pixels
    assert np.all(scatter[:, 0] * SCALE < 0.02)
    assert np.abs(offset[:, 2:]).max() * SCALE < 0.01  # rows that the border is not near
    assert before.y > 5.0 * before.sigma  # what this is about
    assert not after.clear
    nearer = [
        (blurred(scene(shift, edge, 20 + k)), np.array([0.0, shift, 0.0]))
        for k, shift in enumerate(-4e-5 * np.arange(2, 7))
    ]
    error = edge_strip.end_error(nearer)
    assert error is not None
    assert error * SCALE < 0.05  # the row at the end is two pixels clear of the body's edge
    sigma = np.hypot(np.hypot(after.sigma, after.common), error)
    assert abs(after.y) < 3.0 * sigma
    # told places that are 0.2 px off, the row at the end is found to err by as much, and is not used
    away = np.array([0.0, 2.0 * LARGEST_EDGE / SCALE, 0.0])
    wrong = [(pair, move + away) for pair, move in nearer]
    assert edge_strip.end_error(wrong) is None
    assert edge_strip.end_error(nearer[:2]) is None  # too few frames


def test_a_body_out_of_view_is_not_found():
    edge = TOP + 2.0 / SCALE
    tried = np.arange(-40e-6, 45e-6, 10e-6)
    assert search(edge).register(scene(0.0, edge, 2), np.zeros(3), tried) is None


def test_another_pattern_is_not_found():
    edge = TOP - 5.0 / SCALE
    rng = np.random.default_rng(3)
    other = (rng.uniform(size=SHAPE), rng.uniform(size=SHAPE))
    assert search(edge).register(other, np.zeros(3), np.arange(-40e-6, 45e-6, 10e-6)) is None


EDGE = TOP - 8.0 / SCALE
"""The body's rim at rest: eight rows of it are in view."""


def test_a_strip_looks_like_the_body_where_it_is_known():
    assert least_zncc([]) == 0.9  # nothing is known
    assert least_zncc([0.999, 0.998, 0.9995]) == pytest.approx(0.97)
    assert least_zncc([0.985, 0.999, 0.991]) == pytest.approx(1.0 - 6.0 * 0.009)
    assert least_zncc([0.95, 0.9, 0.93]) == 0.9


def test_a_strip_that_looks_unlike_the_body_is_not_taken_for_it():
    """Once frames have shown what the body looks like, a strip a tenth of which is another's is not."""
    edge_strip = search(EDGE)
    rng = np.random.default_rng(7)
    resting = [picture + rng.normal(0.0, 0.07, SHAPE) for picture in scene(0.0, EDGE, 2)]
    tried = np.arange(-40e-6, 45e-6, 10e-6)
    before = edge_strip.register((resting[0], resting[1]), np.zeros(3), tried)
    assert before is not None
    assert 0.9 < before.zncc < 0.97
    known = [(scene(y, EDGE, 40 + k), np.array([0.0, y, 0.0])) for k, y in enumerate((-4e-4, -6e-4, -8e-4))]
    edge_strip.fit_row_offsets(known)
    assert edge_strip.register((resting[0], resting[1]), np.zeros(3), tried) is None
    assert edge_strip.register(scene(0.0, EDGE, 2), np.zeros(3), tried) is not None


def test_a_wrong_place_agreed_on_by_few_points_is_left_out():
    rows, static = list(range(5, 30)), np.arange(30) < 3
    found = [-19e-6 * k for k in rows]
    wrong = [k + (300e-6 if i < 6 else 0.0) for i, k in enumerate(found)]
    counts = [8 if i < 6 else 30 + i for i in range(len(rows))]
    assert consistent_frames(rows, found, counts, static, 50e-6) == [True] * len(rows)
    assert consistent_frames(rows, wrong, counts, static, 50e-6) == [False] * 6 + [True] * (len(rows) - 6)
    assert consistent_frames([], [], [], static, 50e-6) == []


def test_a_static_frame_far_from_where_the_body_came_from_is_left_out():
    """Twelve static frames, two of them seen; the body comes to 19 um a frame from rest. Printed dots repeat
    themselves: a few points agree on a place 220 um off, either way."""
    rows, static = [10, 11, *range(18, 40)], np.arange(40) < 12
    moving = [-19e-6 * k for k in rows[2:]]
    counts = [8, 8, *range(30, 52)]
    for rest in (
        moving[0],
        moving[0] + 6.5 * 19e-6,
    ):  # it stood still until then, or moved
        for off in (-220e-6, 360e-6):
            found = [rest, rest + off, *moving]
            assert consistent_frames(rows, found, counts, static, 50e-6) == [True, False] + [True] * 22
        assert consistent_frames(rows, [rest, rest, *moving], counts, static, 50e-6) == [True] * 24


def test_a_body_rested_no_farther_than_its_speed_says():
    """It went 3 um of at most 10, give or take 1."""
    for way in (1.0, -1.0):
        told = [at_rest_before(way * change, way * 10.0, 1.0) for change in (-1.1, -0.9, 3.0, 10.9, 11.1)]
        assert told == [False, True, True, True, False]


@pytest.mark.parametrize("scale", [0.1, 10.0])
def test_the_same_pictures_of_a_scene_of_another_size_give_the_same_places_in_it(scale):
    edge = TOP - 5.0 / SCALE
    pictures, tried = scene(13.7e-6, edge, 2), np.arange(-40e-6, 45e-6, 10e-6)
    usual = search(edge)
    found = usual.register(pictures, np.zeros(3), tried)
    cameras = [replace(camera, translation=scale * camera.translation) for camera in RIG.cameras]
    rows = np.arange(SHAPE[0])[:, None] < (TOP - (edge - TRAVEL)) * SCALE - 2.0
    angle = np.linspace(-0.3, 0.3, 7)
    places = np.stack([RADIUS * np.sin(angle), np.full(7, edge), RADIUS * np.cos(angle)], axis=1)
    other = EdgeRegistration(
        scene(-TRAVEL, edge, 1),
        np.broadcast_to(rows, SHAPE),
        replace(RIG, cameras=(cameras[0], cameras[1])),
        FRAME,
        scale * places,
        scale * np.array([0.0, -TRAVEL, 0.0]),
    )
    again = other.register(pictures, np.zeros(3), scale * tried)
    assert found is not None
    assert again is not None
    assert other.pixel == pytest.approx(scale * usual.pixel)
    assert usual.pixel == pytest.approx(1.0 / SCALE, rel=0.02)  # at mid-height, where the body was
    assert again.n_pixels == found.n_pixels
    # both end where a step is below 2e-4 px
    assert again.y / scale == pytest.approx(found.y, abs=4e-4 / SCALE)
    assert again.sigma / scale == pytest.approx(found.sigma, rel=1e-3)
