"""The edge of a speckled body from the correlation of rows: strips with a known edge, closed forms."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, gaussian_filter1d
from scipy.special import ndtr
from speckle_pictures import Speckles
from stereo_scene import CYLINDER, NOISE, RADIUS, SHAPE, rig

from dic.bodies import edge_fit
from dic.bodies.edge_registration import (
    LARGEST_EDGE,
    EdgeRegistration,
    at_rest_before,
    consistent_frames,
    least_zncc,
)
from dic.camera import Camera
from dic.chain.test_frame import MODEL, end_in_camera, of_phases, weighted_mean
from dic.surfaces.cylinder import SpecimenFrame

FINE = 8
U = np.arange(-edge_fit.HALF, edge_fit.HALF + 1.0)


def strips(
    edge: float, *, band: float = 0.0, speckled: bool = True, frames: int = 1, seed: int = 1
) -> np.ndarray:
    """Speckle up to row `edge`, an even band, then other speckle in each frame or something even: integrated
    over pixels, with noise."""
    rng = np.random.default_rng(seed)
    shape = (U.size * FINE, 96 * FINE)

    def speckle() -> np.ndarray:
        f = gaussian_filter(rng.normal(0.0, 1.0, shape), 1.6 * FINE)
        return 1500.0 + 900.0 * np.tanh(1.5 * f / f.std())

    body = speckle()
    v = ((np.arange(shape[0]) + 0.5) / FINE - 0.5 - edge_fit.HALF)[:, None]
    found = []
    for _ in range(frames):
        beyond = speckle() if speckled else 900.0
        fine = np.where(v < edge, body, np.where(v < edge + band, 600.0, beyond))
        fine = gaussian_filter(fine, 0.5 * FINE, mode="nearest")
        coarse = fine.reshape(U.size, FINE, 96, FINE).mean(axis=(1, 3))
        found.append(coarse + rng.normal(0.0, 8.0, coarse.shape))
    return np.array(found)


@pytest.mark.parametrize(("edge", "band"), [(0.3, 0.0), (-0.4, 1.5)])
def test_a_body_that_ends_at_something_even(edge, band):
    found = edge_fit.fit_edge(strips(edge, band=band, speckled=False), U, np.array([[0.0], [2.0]]))
    assert abs(found.place - edge) < 3.0 * np.hypot(
        found.sigma, 0.06
    )  # the model's share: dic.chain.test_frame.MODEL
    assert found.sigma < 0.15


@pytest.mark.parametrize("edge", [0.45, -0.2])
def test_two_speckled_bodies(edge):
    """Rows of the body do not change from frame to frame: its own chance is in the sigma, by blocks of
    columns."""
    found = edge_fit.fit_edge(strips(edge, frames=6), U, np.zeros((2, 6)), reach=1.0, sure=True)
    assert abs(found.place - edge) < 3.0 * np.hypot(found.sigma, 0.06)


def test_fewer_rows_beyond_serve_too():
    few = U <= 3.0
    found = edge_fit.fit_edge(strips(0.2, speckled=False)[:, few], U[few], np.array([[0.0], [0.3]]))
    assert found.place == pytest.approx(0.2, abs=0.25)


def test_an_edge_out_of_reach_is_none():
    assert edge_fit.fit_edge(strips(4.5, speckled=False), U, np.zeros((2, 1)), reach=1.5) is None
    assert edge_fit.fit_edge(np.full((1, U.size, 40), 7.0), U, np.zeros((2, 1))) is None


@pytest.mark.parametrize("edge", [0.37, -9.1])  # within the strip, and beyond all of its paint
def test_slopes_of_the_covariance(edge):
    p = np.array([edge, *np.log([0.8, 1.5, 2.5, 1.2, 0.6, 0.1, 2.0]), 0.4])
    width = np.array([0.33, 1.1])
    for free in (True, False):
        numeric = np.array(
            [
                (edge_fit.covariance(p + h, U, width, free) - edge_fit.covariance(p - h, U, width, free))
                / 2e-5
                for h in 1e-5 * np.eye(p.size)
            ]
        )
        np.testing.assert_allclose(edge_fit.with_slopes(p, U, width, free)[1], numeric, atol=1e-8)


def test_bands_of_several_widths_have_the_covariance_of_each():
    p = np.array([0.37, *np.log([0.8, 1.5, 2.5, 1.2, 0.6, 0.1, 2.0]), 0.4])
    widths = np.array([[0.0, 0.5], [0.33, 1.1], [2.0, 0.0]])
    for width, (C, slopes) in zip(widths, edge_fit.of_bands(p, U, widths, True), strict=True):
        alone = edge_fit.with_slopes(p, U, width, True)
        np.testing.assert_array_equal(C, alone[0])
        np.testing.assert_array_equal(slopes, alone[1])


def test_covariance_of_paint_that_ends():
    """Paint alike over 1000 px is one number a column: a pixel shows the share of it before the edge,
    blurred."""
    p = np.array([0.3, *np.log([0.8, 1e3, 1e3, 2.0, 1.0, 0.1, 20.0]), 0.5])
    width = np.array([0.5, 1.0])
    C = edge_fit.covariance(p, U, width, True)
    inside, outside = ndtr((0.3 - U) / 0.8), ndtr((U - 0.3 - 1.0) / 0.8)  # band: 0.5 + 0.5 * 1
    wanted = 4.0 * np.outer(inside, inside) + np.outer(outside, outside) + 0.01 * np.eye(U.size)
    assert np.allclose(C, wanted, atol=2e-3)
    held = edge_fit.covariance(p, U, width, False)[-1, -1]
    assert held == pytest.approx(ndtr((6.0 - 0.8) / 0.8) ** 2 + 0.01, abs=2e-3)
    assert edge_fit.paint(np.array([2.0]), 1.0, 0.5)[0] == pytest.approx(
        5.0**-0.5
    )  # (1 + 4 / (2 * 0.5)) ** -0.5


def test_shading_along_the_edge_is_taken_out():
    x = np.linspace(-1.0, 1.0, 40)
    rows = np.stack([3.0 + 2.0 * x, 1.0 - x**2])[None]
    assert np.abs(edge_fit.without_shading(rows)).max() < 1e-12
    assert np.abs(edge_fit.without_shading(rows + x**3)).max() > 0.1


def test_sigma_from_the_scatter_of_blocks():
    """One parameter, the level of a covariance C = q: the mean square of n blocks is known to the standard
    deviation of the blocks' means over root n."""
    squares = np.array([1.0, 3.0, 2.0, 6.0])
    g = 0.5 * (squares - squares.mean()) / squares.mean() ** 2
    H = np.array([[4 * 0.5 / squares.mean() ** 2]])
    assert edge_fit.block_sigma(g[:, None], H) == pytest.approx(squares.std(ddof=1) / 2.0)


def test_places_are_weighted_and_disagreement_counts():
    mean, sigma = weighted_mean(np.array([1.0, 1.0]), np.array([3.0, 4.0]))
    assert (mean, sigma) == (1.0, pytest.approx(2.4))  # 1 / sqrt(1/9 + 1/16)
    mean, sigma = weighted_mean(np.array([0.0, 10.0]), np.array([1.0, 2.0]))
    assert mean == pytest.approx(2.0)
    assert sigma == pytest.approx(np.sqrt(20.0 * 0.8))  # chi2 4 + 16, one degree of freedom; 1/(1 + 1/4)


def view(height: float) -> Camera:
    """A camera 0.3 m from the axis that looks across it at a place `height` above the lower end, its x along
    x."""
    return Camera(
        fx=5000.0, fy=5000.0, cx=63.5, cy=63.5, distortion=(0.0,) * 5,
        rotation=np.diag([1.0, -1.0, -1.0]), translation=np.array([0.0, height, 0.3]),
    )  # fmt: skip


@pytest.mark.parametrize("height", [3e-3, -3e-3])
def test_a_rim_that_hides_the_end(height):
    """A specimen of 5 mm on a platen of 7.5 mm: from 3 mm below its plane the platen's rim is the edge that
    is seen, 25 um higher in the picture, a third of a pixel, than the end itself would be; from above, the
    end."""
    camera, frame = view(height), SpecimenFrame(np.eye(3), np.zeros(3), np.zeros((6, 6)))
    radius = 5e-3 if height > 0.0 else 7.5e-3
    row = float(camera.project(np.array([[0.0, 0.0, radius]]))[0, 1])
    rng = np.random.default_rng(3)
    speckle = gaussian_filter(rng.normal(0.0, 1.0, (128 * 4, 128 * 4)), 7.0)
    v = (np.arange(512) + 0.5)[:, None] / 4 - 0.5
    fine = np.where(v < row, 1500.0 + 900.0 * np.tanh(1.5 * speckle / speckle.std()), 900.0)
    picture = gaussian_filter(fine, 2.0).reshape(128, 4, 128, 4).mean(axis=(1, 3))
    found = end_in_camera(camera, picture + rng.normal(0.0, 8.0, (128, 128)), frame, 20e-6, 5e-3, 7.5e-3, 0.0)
    assert abs(found[0]) < 2.5 * found[1]
    assert found[1] < 7e-6  # a tenth of a pixel of 60 um


def test_a_gap_before_the_edge_is_measured_from_where_half_the_contrast_is_left():
    u = np.arange(-6.0, 7.0)
    sharp = np.where(u <= 0.0, 10.0, 0.0)  # paint up to the edge at 0.5: half is left there
    assert edge_fit.gap_before(sharp, u, 0.5) == pytest.approx(0.0)
    # ends in a gap: 10, 10, 10, 10 at -3, 4 at -2: half of it at -3 + 5/6
    fades = np.array([10.0, 10.0, 10.0, 10.0, 4.0, 2.0, 1.0, 0, 0, 0, 0, 0, 0])
    assert edge_fit.gap_before(fades, u, -0.2) == pytest.approx(-0.2 + 3.0 - 5.0 / 6.0)
    assert edge_fit.gap_before(np.full(13, 10.0), u, 2.0) == 0.0


def test_phases_of_a_strip_add_what_they_differ_by_and_what_a_gap_leaves_open():
    place, sigma = of_phases(np.array([[0.1, 0.03, 0.2], [0.5, 0.05, 0.4]]))
    assert place == pytest.approx(0.3)
    assert sigma == pytest.approx((0.04**2 + MODEL**2 + 0.2**2) ** 0.5)  # half of 0.4 px; gaps below 0.5 px
    alone = of_phases(np.array([[0.1, 0.03, 2.0]]))[1]
    assert alone == pytest.approx((0.03**2 + MODEL**2 + 1.5**2 / 12.0) ** 0.5)


SCALE = 5400.0 / 0.295  # pixels per metre where the cylinder faces the cameras
TOP = 0.5 * (SHAPE[0] - 1) / SCALE  # height that the first row shows
TRAVEL = 1.2e-3
RIG = rig()
FRAME = SpecimenFrame(np.eye(3), np.zeros(3), np.zeros((6, 6)))


@cache
def scene(shift: float, edge: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Both cameras' pictures: the body above `edge` at rest, moved up by `shift` [m], on another pattern."""
    body, ground = Speckles(3.5e-4, seed=5), Speckles(3.5e-4, seed=6)

    def pattern(arc: np.ndarray, height: np.ndarray) -> np.ndarray:
        return np.where(height - shift > edge, body(arc, height - shift), ground(arc, height))

    rng = np.random.default_rng(seed)
    first, second = (
        CYLINDER.picture(camera, SHAPE, pattern, oversample=3) + rng.normal(0.0, NOISE, SHAPE)
        for camera in RIG.cameras
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
        for k, shift in enumerate(-4e-5 * np.arange(2, 7, 2))
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


def test_a_body_out_of_view_and_another_pattern_are_not_found():
    edge = TOP + 2.0 / SCALE
    tried = np.arange(-40e-6, 45e-6, 10e-6)
    assert search(edge).register(scene(0.0, edge, 2), np.zeros(3), tried) is None
    edge = TOP - 5.0 / SCALE
    rng = np.random.default_rng(3)
    other = (rng.uniform(size=SHAPE), rng.uniform(size=SHAPE))
    assert search(edge).register(other, np.zeros(3), np.arange(-40e-6, 45e-6, 10e-6)) is None


EDGE = TOP - 8.0 / SCALE  # the body's rim at rest: eight rows of it are in view


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
    for rest in (moving[0], moving[0] + 6.5 * 19e-6):  # it stood still until then, or moved
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
        scene(-TRAVEL, edge, 1), np.broadcast_to(rows, SHAPE), replace(RIG, cameras=(cameras[0], cameras[1])),
        FRAME, scale * places, scale * np.array([0.0, -TRAVEL, 0.0]),
    )  # fmt: skip
    again = other.register(pictures, np.zeros(3), scale * tried)
    assert found is not None
    assert again is not None
    assert other.pixel == pytest.approx(scale * usual.pixel)
    assert usual.pixel == pytest.approx(1.0 / SCALE, rel=0.02)  # at mid-height, where the body was
    assert again.n_pixels == found.n_pixels
    # both end where a step is below 2e-4 px
    assert again.y / scale == pytest.approx(found.y, abs=4e-4 / SCALE)
    assert again.sigma / scale == pytest.approx(found.sigma, rel=1e-3)
