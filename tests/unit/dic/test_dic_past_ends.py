"""Subsets past the specimen's ends, and behind a platen's rim: closed forms with pinhole cameras."""

from types import MappingProxyType, SimpleNamespace

import numpy as np
import pytest
from speckle_pictures import render, speckle_pattern

from dic.bodies.axial_displacement import LATERAL_SIGMA, LEAST_LATERAL, lateral_places
from dic.bodies.edges import BLOCKS, block_edge, end_arc
from dic.camera import Camera, StereoRig
from dic.chain import outliers
from dic.chain.outliers import axis_in_picture, past_the_ends, visible_room
from dic.outcome import PointOutcome
from dic.surfaces.cylinder import SpecimenFrame
from dic.surfaces.outline import beyond_noise, departures
from dic.surfaces.surface_history import CentrePoints, SurfaceHistory

FOCAL, AWAY = 5400.0, 0.3  # focal length [px] and distance of the cameras from the axis [m]: 18 px/mm
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


SHAPE = (140, 160)


def planted(bend: float, *, level: float = 60.0, hidden: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Speckles that end at an arc above a platen of one grey level; the picture and the arc."""
    x = np.linspace(-1.0, 1.0, SHAPE[1])
    arc = 90.3 + 0.4 * x + bend * x**2
    row = np.arange(SHAPE[0])[:, None]
    lower = np.clip(row + 0.5 - arc, 0.0, 1.0)
    picture = (1.0 - lower) * render(speckle_pattern((200, 200), seed=4), SHAPE) + lower * level
    if hidden:  # in one block the last rows look like the platen
        picture[80:, 60:80] = level
    return picture + np.random.default_rng(1).normal(0.0, 1.0, SHAPE), arc


@pytest.mark.parametrize("level", [60.0, 128.0])
@pytest.mark.parametrize("bend", [0.0, 4.0, -4.0])
def test_an_arc_is_found(bend: float, level: float) -> None:
    picture, arc = planted(bend, level=level)
    found = end_arc(picture, float(arc.mean()))
    assert found is not None
    # the edge falls between row centres, which count from 0.5 above; spots end early by a part of a pixel
    assert np.abs(found - arc).max() < 1.0
    assert found[len(found) // 2] == pytest.approx(arc[len(arc) // 2], abs=0.7)
    assert found.min() == pytest.approx(arc.min(), abs=0.8)


def test_one_block_that_ends_early_does_not_move_the_arc() -> None:
    picture, arc = planted(4.0, hidden=True)
    found = end_arc(picture, float(arc.mean()))
    assert np.abs(found - arc).max() < 1.2  # least squares would be 4 px off


def test_an_edge_lies_where_the_departure_falls_to_half() -> None:
    block = np.full((40, 10), 50.0)
    block[:20] += np.where(np.arange(10) % 2, 30.0, -30.0)
    block[20] += np.where(np.arange(10) % 2, 12.0, -12.0)
    # from 30 in row 19 to 12 in row 20: half of 30 at 19 + 15 / 18
    assert block_edge(block, 28) == pytest.approx(19.0 + 15.0 / 18.0, rel=1e-12)


def test_too_little_of_a_platen_or_too_few_columns() -> None:
    picture, _ = planted(0.0)
    assert end_arc(picture[:96], 90.3) is None
    assert end_arc(picture[:, : 8 * BLOCKS - 1], 90.3) is None


T = 1e-5 * np.arange(120)
PIXEL = 4e-5


def moved(speed: float, noise: float) -> np.ndarray:
    """Both cameras see frames 40 and on; the body drifts along x, its Z is known to `noise`."""
    moves = np.full((120, 3), np.nan)
    moves[40:] = 0.0
    moves[40:, 0] = speed * T[40:]
    moves[40:, 2] = noise * np.where(np.arange(80) % 2, 1.0, -1.0)
    return moves


def test_a_body_that_does_not_drift_is_where_it_is_seen() -> None:
    place, sigma, own = lateral_places(T, moved(0.0, 1e-6), np.full(120, 50), PIXEL)
    np.testing.assert_allclose(place, 0.0, atol=1e-18)
    np.testing.assert_allclose(sigma[30:40], LEAST_LATERAL * PIXEL)
    np.testing.assert_allclose(own, [0.0, 1e-6 * np.sqrt(80 / 78)], rtol=1e-3, atol=1e-18)


def test_a_drift_widens_with_the_time_to_the_mean_of_the_nearest() -> None:
    """0.02 m/s: frame 0 is 495 us before the mean of frames 40 to 59, 9.9 um; nothing scatters."""
    place, sigma, _ = lateral_places(T, moved(0.02, 0.0), np.full(120, 50), PIXEL)
    assert place[0, 0] == pytest.approx(0.02 * 49.5e-5)
    assert sigma[0] == pytest.approx(0.02 * 49.5e-5, rel=1e-6)
    _, fast, _ = lateral_places(T, moved(1.0, 0.0), np.full(120, 50), PIXEL)
    assert fast[0] == pytest.approx(LATERAL_SIGMA * PIXEL)


def test_the_scatter_and_what_it_hides_of_the_drift() -> None:
    """Z alternates by 10 um: its scatter is that times sqrt(80 / 78), and twice the slope's own deviation
    counts, sigma / sqrt(sum of squared times), beside the slope that the alternation gives."""
    noise = 1e-5
    _, sigma, own = lateral_places(T, moved(0.0, noise), np.full(120, 7), PIXEL)
    since = T[40:] - T[40:].mean()
    z = moved(0.0, noise)[40:, 2]
    slope = since @ z / (since @ since)
    scatter = np.sqrt(np.sum((z - z.mean() - slope * since) ** 2) / 78)
    speed = abs(slope) + 2.0 * scatter / np.sqrt(since @ since)
    assert sigma[0] == pytest.approx(speed * 49.5e-5, rel=1e-9)
    assert own[1] == pytest.approx(scatter, rel=1e-9)


def test_frames_with_few_points_count_little() -> None:
    moves, counts = moved(0.0, 0.0), np.full(120, 100)
    moves[40, 2], counts[40] = 2e-5, 1
    place, _, _ = lateral_places(T, moves, counts, PIXEL)
    assert place[0, 1] == pytest.approx(2e-5 / 1901)
    _, few, _ = lateral_places(T[:45], moves[:45], counts[:45], PIXEL)
    np.testing.assert_allclose(few, LATERAL_SIGMA * PIXEL)


HALF = 0.5e-3
ACROSS = 0.25e-3 * np.arange(-8, 9)
HEIGHTS = 0.25e-3 * np.arange(1, 9)
R, SLOPE, BUMP, ASIDE, LEAN = 5e-3, 0.1, 7e-6, 20e-6, 0.2
"""Radius at y = 0, its slope; what is added within the strip, to the right and from the left beside it, and
how much higher a column to the right stands in the grid."""


def surface(valid=None) -> SurfaceHistory:
    x, y = (a.ravel() for a in np.meshgrid(ACROSS, HEIGHTS))
    y = y + LEAN * np.abs(x)  # rows of the grid are bent
    side = np.where(np.abs(x) > 1.2 * HALF, np.sign(x), 0.0)
    radius = R + SLOPE * y + ASIDE * side + BUMP * (side == 0.0)
    X = np.stack([x, y, np.sqrt(radius**2 - x**2)], axis=1)
    n = len(X)
    outcome = np.full((1, n), int(PointOutcome.VALID))
    if valid is not None:
        outcome[0, ~valid(x, y)] = int(PointOutcome.LOW_CORRELATION)
    return SurfaceHistory(np.zeros(1), X, np.zeros((1, n, 3)), np.full((1, n, 3), 3e-6), outcome)


def grid() -> np.ndarray:
    i, j = np.meshgrid(np.arange(ACROSS.size), np.arange(HEIGHTS.size))
    return np.stack([4.0 * i.ravel(), -4.0 * j.ravel()], axis=1)


def line(heights) -> CentrePoints:
    y = np.asarray(heights)
    n = y.size
    zero = np.zeros(n, dtype=np.int64)
    return CentrePoints(np.zeros(n), zero, y, R + SLOPE * y + BUMP, np.full(n, 4e-6), MappingProxyType({}))


def test_a_bump_of_the_strip_is_what_departs():
    """The axis off to one side cancels, a radius that changes along the axis is met at the same height, and
    heights that no row beside the strip encloses are not known."""
    # beside the strip lie the columns from 0.75 to 1.75 mm, whose mean height is 0.25 mm above the middle
    heights = np.array([0.45e-3, 0.55e-3, 1.2e-3, 2.2e-3, 2.3e-3])
    found, sigma = departures(surface(), grid(), line(heights), half_width=HALF)
    np.testing.assert_array_equal(np.isfinite(found), [False, True, True, True, False])
    np.testing.assert_allclose(found[1:4], BUMP, atol=1e-9)
    np.testing.assert_allclose(sigma[1:4], np.hypot(4e-6, 3e-6 / 2**0.5))  # two sides of 3 µm each


@pytest.mark.parametrize(
    "valid",
    [
        lambda x, y: x > -0.6e-3,  # one side alone
        lambda x, y: (np.abs(x) < 0.6e-3) | (np.abs(x) > 1.6e-3),  # one point a row on each
        lambda x, y: (np.abs(x) < 0.6e-3) | (y < 0.7e-3),  # two rows at most
    ],
)
def test_too_little_beside_the_strip_tells_nothing(valid):
    found, sigma = departures(surface(valid), grid(), line([0.6e-3]), half_width=HALF)
    assert np.isnan(found).all()
    assert np.isnan(sigma).all()


def test_what_noise_explains_is_taken_off():
    """Twice the noise: the mean square over it is 4, three quarters of which are beyond it."""
    departure, sigma = np.array([6e-6, -6e-6, np.nan]), np.array([3e-6, 3e-6, np.nan])
    share = 0.75**0.5
    np.testing.assert_allclose(beyond_noise(departure, sigma), [6e-6 * share, -6e-6 * share, 0.0])
    assert not beyond_noise(0.5 * departure, sigma).any()
    assert not beyond_noise(np.full(2, np.nan), sigma[:2]).any()
    assert not beyond_noise(np.zeros(2), sigma[:2]).any()
