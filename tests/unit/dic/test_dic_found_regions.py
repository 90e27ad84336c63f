"""Detected regions: rendered bodies with known rows in four directions, and bad scenes."""

import tracemalloc
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from memory_pictures import Memory
from speckle_pictures import render, speckle_pattern

from dic.bodies.edges import _last_edge, follow_edge, rigid_limit, row_correlation
from dic.bodies.region import Region, _painted, find_regions, polygon_mask
from dic.correlation.subsets import overlap_correlation, overlap_factor, overlap_matrix
from dic.images import frame_health
from kolsky.shot.dic import regions_in_pictures

SHAPE, STATIC, FRAMES, SPEED = (96, 112), 4, 30, 1.7
TOP, BOTTOM = 5.3, 84.6  # where the specimen begins and ends at rest [px]
FLYER, SIDE = speckle_pattern((200, 112), seed=1), speckle_pattern((200, 112), seed=2)
PLATEN = speckle_pattern((200, 112), seed=3)


def scene(frame: int, *, platen: str = "even", sides: bool = True, top: float = TOP) -> np.ndarray:
    """The flyer comes down on a specimen that is compressed, above a platen; background left and right."""
    edge = top + SPEED * max(frame - STATIC + 1, 0)
    stretch = (BOTTOM - edge) / (BOTTOM - top)

    def specimen(x):
        return np.stack([x[..., 0], BOTTOM - (BOTTOM - x[..., 1]) / stretch], axis=-1)

    def flyer(x):
        return np.stack([x[..., 0], x[..., 1] - edge + 100.0], axis=-1)

    bodies = [
        render(FLYER, SHAPE, material=flyer),
        render(SIDE, SHAPE, material=specimen),
        render(PLATEN, SHAPE) if platen == "speckled" else np.full(SHAPE, 60.0),
    ]
    row = np.arange(SHAPE[0])[:, None]
    upper = np.clip(edge + 0.5 - row, 0.0, 1.0)  # share of a pixel above the edge
    lower = np.clip(row + 0.5 - BOTTOM, 0.0, 1.0)
    picture = upper * bodies[0] + (1.0 - upper - lower) * bodies[1] + lower * bodies[2]
    if sides:
        picture[:, :10], picture[:, 100:] = 40.0, 40.0
    return picture + np.random.default_rng(frame).normal(0.0, 1.0, SHAPE)


def series(**options) -> Memory:
    return Memory(tuple(scene(k, **options) for k in range(FRAMES)))


def search(pictures: Memory, toward: str = "up", usable=None):
    usable = np.ones(FRAMES, dtype=bool) if usable is None else usable
    return find_regions(pictures, np.arange(FRAMES) < STATIC, usable, toward=toward)


@pytest.fixture(scope="module")
def plain() -> Memory:
    return series()


def extent(region) -> tuple[float, float, float, float]:
    x, y = zip(*region.corners, strict=True)
    return min(x), max(x), min(y), max(y)


def test_rows_of_one_body_are_alike_and_an_edge_is_not(plain):
    likeness = row_correlation(plain.frame(0)[:, 14:96])
    assert np.median(likeness[10:80]) > 0.6  # speckles of 5 px, rows 2 px apart
    assert likeness[5:7].mean() < 0.3


def test_what_a_shot_file_leaves_out_is_proposed_and_nothing_else(plain):
    region = SimpleNamespace(corners=((20.0, 10.0), (90.0, 10.0), (90.0, 80.0)), frame=0)
    section = SimpleNamespace(specimen=region, flyer=None, transmission_edge=None, flyer_side="up")
    declared = SimpleNamespace(dic=section, frames=SimpleNamespace(static=STATIC))
    whole = Memory(tuple(plain.frame(k).round().clip(0, 255).astype(np.uint8) for k in range(FRAMES)))
    pictures = SimpleNamespace(
        toml=SimpleNamespace(declared=declared),
        time=np.arange(float(FRAMES)),
        series=(whole, whole),
        health=(frame_health(whole), frame_health(whole)),
    )
    proposed, why = regions_in_pictures(pictures)
    found = search(whole)
    assert list(proposed) == ["flyer", "transmission_edge"]
    assert proposed["flyer"] == [Region(found.flyer.corners, found.flyer.frame)]
    assert proposed["transmission_edge"] == [Region((found.edge,), 0)]
    assert why == found.why


@pytest.mark.parametrize("platen", ["even", "speckled"])
def test_edges_are_found_and_kept_clear_of(plain, platen):
    found = search(plain if platen == "even" else series(platen="speckled"))
    x0, x1, y0, y1 = extent(found.specimen)
    # a pixel clear: the first row that is whole is 6, the last one 84
    assert y0 in (7.0, 8.0)
    assert y1 in (82.0, 83.0)
    assert x0 == pytest.approx(10.0, abs=4.0)  # columns are told by a contrast that is smoothed over 3 px
    assert x1 == pytest.approx(99.0, abs=4.0)
    assert found.edge[1] == pytest.approx(BOTTOM, abs=1.0)  # the chain looks for it within 2 px
    assert found.flyer.frame == FRAMES - 1
    last = TOP + SPEED * (FRAMES - STATIC)
    assert extent(found.flyer)[2] == 0.0
    assert last - 3.0 < extent(found.flyer)[3] < last - 0.5


def test_an_even_platen_may_fill_most_of_the_picture(plain):
    """A short specimen: its rows are fewer than those of the platen, which alone are the usual ones."""
    rng = np.random.default_rng(9)
    below = 60.0 + 8.0 * np.sin(np.arange(SHAPE[1])) + rng.normal(0.0, 1.0, (110, SHAPE[1]))
    found = search(Memory(tuple(np.vstack([picture, below]) for picture in plain.frames)))
    assert extent(found.specimen)[3] in (82.0, 83.0)
    assert found.edge[1] == pytest.approx(BOTTOM, abs=1.0)


@pytest.mark.parametrize(("toward", "turns"), [("right", -1), ("down", 2), ("left", 1)])
def test_any_direction(plain, toward, turns):
    turned = Memory(tuple(np.rot90(frame, turns) for frame in plain.frames))
    up, other = search(plain), search(turned, toward)
    for name in ("specimen", "flyer"):
        here, there = (np.zeros(shape) for shape in (plain.shape, turned.shape))
        x0, x1, y0, y1 = (int(v) for v in extent(getattr(up, name)))
        here[y0 : y1 + 1, x0 : x1 + 1] = 1.0
        x0, x1, y0, y1 = (int(v) for v in extent(getattr(other, name)))
        there[y0 : y1 + 1, x0 : x1 + 1] = 1.0
        np.testing.assert_array_equal(np.rot90(here, turns), there)


@pytest.mark.parametrize(("top", "toward", "turns"), [(-4.2, "up", 0), (-4.2, "down", 2), (1.2, "up", 0)])
def test_a_flyer_of_which_little_or_nothing_is_seen_at_rest_is_found_by_its_motion(top, toward, turns):
    hidden = Memory(tuple(np.rot90(scene(k, top=top), turns) for k in range(FRAMES)))
    found = search(hidden, toward)
    last = top + SPEED * (FRAMES - STATIC)
    rows = np.array([extent(found.flyer)[2:], extent(found.specimen)[2:]])
    rows = rows if toward == "up" else SHAPE[0] - 1.0 - rows[:, ::-1]
    (f0, f1), (s0, s1) = rows
    assert f0 == 0.0
    assert last - 3.0 < f1 < last - 0.5
    assert max(top, 0.0) < s0 <= max(top, 0.0) + 3.0  # at the border, or a pixel clear of the flyer
    assert s1 in (82.0, 83.0)
    assert "were followed back to frame" in found.why


def test_a_flyer_that_hardly_comes_in_is_told_by_looks(plain):
    """Within seven frames of motion it fills five rows more: too few to be followed."""
    usable = np.arange(FRAMES) < STATIC + 4
    found = search(plain, usable=usable)
    assert "do not resemble either" in found.why
    assert extent(found.specimen)[2] in (7.0, 8.0)


def test_what_does_not_move_rigidly_is_no_flyer():
    """The specimen alone, stretched into view: its rows at the border move, and not as one."""
    rng = np.random.default_rng(1)

    def stretched(k):
        share = 1.0 - 0.012 * k

        def material(x):
            return np.stack([x[..., 0], 90.0 + (x[..., 1] - 90.0) / share], axis=-1)

        rows = render(SIDE, SHAPE, material=material)
        return (rows + rng.normal(0.0, 1.0, SHAPE))[:, 10:100]

    pictures = np.array([stretched(k) for k in range(12)])
    even = pictures - pictures.mean(axis=2, keepdims=True)
    with pytest.raises(ValueError, match=r"not clear|at least 3 px"):
        follow_edge(even, 1.0)


def test_rows_that_vary_by_more_than_the_noise_are_not_rigid():
    """Forty rows stand still, speckles change beyond: an edge at row 40, if the noise explains them."""
    rng = np.random.default_rng(2)
    still = rng.normal(0.0, 2.0, (8, 40, 60))
    changing = rng.normal(0.0, 30.0, (8, 40, 60))
    pictures = np.concatenate([still, changing], axis=1)
    edge, _ = _last_edge(pictures, np.zeros(8), 2.0)
    assert edge == pytest.approx(40.0, abs=1.0)  # the rows say it to a row
    with pytest.raises(ValueError, match=r"vary by 2\.0 of the noise, at most 1\.4 is rigid"):
        _last_edge(pictures, np.zeros(8), 1.0)


WAVE, SLOPE = 0.5, 100.0  # rad/px across the rows, and their largest slope [1/px]


def waves(at: np.ndarray, noise: float, rng: np.random.Generator) -> np.ndarray:
    """Rows at such places of a wave across them, whose phase goes round once along a row."""
    phase = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    return SLOPE / WAVE * np.sin(WAVE * at[:, None] + phase) + rng.normal(0.0, noise, (at.size, 60))


def test_rows_are_held_still_to_so_many_pixels():
    """A slope of 100/px has a root mean square of 70.7 over all phases, as differences 0.959 of it."""
    slope = SLOPE / WAVE * np.sin(WAVE) / 2.0**0.5
    rows = waves(np.arange(8.0), 0.0, np.random.default_rng(3))
    assert rigid_limit(rows, 0.0) == pytest.approx(0.1 * slope)
    assert rigid_limit(rows, 10.0) == pytest.approx((14.0**2 + 0.01 * (slope**2 - 50.0)) ** 0.5)
    assert rigid_limit(np.zeros((8, 60)), 2.0) == pytest.approx(2.8)


@pytest.mark.parametrize(("stretch", "problem"), [(0.0, None), (0.15, r"at most 7\.\d is rigid")])
def test_warm_air_moves_a_rigid_row_and_a_specimen_stretches(stretch, problem):
    """Forty rows that the air moves by 0.03 px: 2.3 of the noise. Stretched they vary by much more."""
    rng = np.random.default_rng(4)

    def picture():
        at = np.arange(40.0) * (1.0 + stretch * rng.normal()) + 0.03 * rng.normal()
        return np.concatenate([waves(at, 1.0, rng), rng.normal(0.0, 150.0, (40, 60))])

    pictures = np.array([picture() for _ in range(20)])
    if problem is None:
        assert _last_edge(pictures, np.zeros(20), 1.0)[0] == pytest.approx(40.0, abs=1.0)
        return
    with pytest.raises(ValueError, match=problem):
        _last_edge(pictures, np.zeros(20), 1.0)


def test_a_missing_last_picture_is_passed_over(plain):
    usable = np.arange(FRAMES) < FRAMES - 2
    assert search(plain, usable=usable).flyer.frame == FRAMES - 3


def test_what_is_not_clear_is_refused_with_a_cure(plain):
    no_flyer = Memory(tuple(scene(k, top=-60.0) for k in range(FRAMES)))
    with pytest.raises(
        ValueError, match=r"no clear edge is seen where the flyer meets the specimen.*declare"
    ):
        search(no_flyer)
    blank = Memory(tuple(frame * 0.0 + 50.0 for frame in plain.frames))
    with pytest.raises(ValueError, match="declare"):
        search(blank)
    with pytest.raises(ValueError, match="toward must be one of up"):
        search(plain, "north")
    with pytest.raises(ValueError, match=r"needs? a usable static picture"):
        search(plain, usable=np.zeros(FRAMES, dtype=bool))


def test_contrast_of_speckles_is_told_from_that_of_bare_rows():
    assert _painted(np.repeat([1.0, 20.0, 22.0], [70, 15, 15])) == pytest.approx(21.0, abs=1.0)
    assert _painted(np.repeat([20.0, 22.0], [50, 50])) == pytest.approx(21.0, abs=1.0)


def test_a_specimen_ends_clear_of_the_arc_of_a_rim(plain):
    """The platen's rim is 3 px higher in the middle than at the flanks."""
    x = np.linspace(-1.0, 1.0, SHAPE[1])
    rim = BOTTOM - 6.0 + 3.0 * x**2
    share = np.clip(np.arange(SHAPE[0])[:, None] + 0.5 - rim, 0.0, 1.0)
    rng = np.random.default_rng(6)
    bent = [(1.0 - share) * p + share * (60.0 + rng.normal(0.0, 1.0, p.shape)) for p in plain.frames]
    found = search(Memory(tuple(bent)))
    assert found.edge[1] == pytest.approx(rim.min(), abs=1.0)
    assert rim.min() - 4.0 < extent(found.specimen)[3] <= rim.min() - 1.0


def test_a_polygon_holds_the_pixels_whose_centres_it_holds():
    """A right triangle with legs of 4 px on pixel centres: 5 + 4 + 3 + 2 + 1 of them, its sides included;
    with its corners half a pixel beyond them the same. OpenCV fills what the sides pass through too."""
    mask = polygon_mask([(2.0, 1.0), (6.0, 1.0), (2.0, 5.0)], (8, 9))
    expected = np.zeros((8, 9), dtype=bool)
    for k in range(5):
        expected[1 + k, 2 : 7 - k] = True
    np.testing.assert_array_equal(mask, expected)
    wider = [(1.6, 0.6), (6.8, 0.6), (1.6, 5.8)]
    np.testing.assert_array_equal(polygon_mask(wider, (8, 9)), expected)
    filled = np.zeros((8, 9), dtype=np.uint8)
    cv2.fillPoly(filled, [np.round(np.array(wider) * 256.0).astype(np.int32)], 1, shift=8)
    assert (filled[expected] == 1).all()
    assert filled.sum() > expected.sum()
    # Even-odd: what a polygon goes around twice, or not at all, is outside.
    bow = polygon_mask([(0.0, 0.0), (6.0, 6.0), (6.0, 0.0), (0.0, 6.0)], (7, 7))
    assert not bow[1, 3]
    assert bow[3, [0, 1, 5, 6]].all()


def test_polygons_that_hold_nothing_are_refused():
    with pytest.raises(ValueError, match="holds no pixel"):
        polygon_mask([(1.2, 1.2), (1.8, 1.2), (1.8, 1.8)], (4, 4))
    with pytest.raises(ValueError, match="three corners"):
        polygon_mask([(1.0, 1.0), (2.0, 1.0)], (4, 4))


def _grid(columns: int, rows: int, step: float = 6.0) -> np.ndarray:
    return step * np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2)


def test_pairs_hold_the_common_area_and_both_points_of_a_pair_have_it():
    # 20 px squares: beside (6, 0) 14/20, below (0, 12) 8/20, diagonal (6, 12) their product, (24, 0) nothing
    points = np.array([[0.0, 0.0], [6.0, 0.0], [0.0, 12.0], [24.0, 0.0]])
    expected = np.array(
        [[1.0, 0.7, 0.4, 0.0], [0.7, 1.0, 0.28, 0.1], [0.4, 0.28, 1.0, 0.0], [0.0, 0.1, 0.0, 1.0]]
    )
    found = overlap_matrix(points, 20.0)
    np.testing.assert_allclose(found.toarray(), expected, atol=1e-15)
    assert found.nnz == 4 + 2 * 4  # none of the pairs that share nothing


def test_pairs_agree_with_all_distances_of_scattered_points():
    points = np.random.default_rng(3).uniform(0.0, 120.0, (300, 2))
    whole = overlap_correlation(points, points, 25.0)
    np.testing.assert_allclose(overlap_matrix(points, 25.0).toarray(), whole, atol=1e-15)
    np.testing.assert_allclose(overlap_factor(points, 25.0), whole.sum(axis=1), rtol=1e-13)


def test_memory_grows_with_the_points_and_not_with_their_square():
    peaks = []
    for rows in (100, 200):
        points = _grid(100, rows)
        tracemalloc.start()
        overlap_factor(points, 25.0)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 2.5 * peaks[0]  # twice the points; the square would be four times
    assert peaks[1] < 20_000 * 5000  # bytes: a point has 80 neighbours, of all points 160 kB
