"""Tracking of points in rendered series with exact motion."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from speckle_pictures import render, speckle_pattern

from dic.correlation import Correlation, Noise
from dic.correlation.subsets import apply, identity
from dic.images import PictureError
from dic.outcome import FrameOutcome, PointOutcome
from dic.tracking import Track, Tracking, _compose_points, enlarged_subset, frame_match, matcher, track
from dic.tracking.inputs import Scene, read

SHAPE = (110, 120)
CENTRE, BASE = 60.0, 100.0  # the axis [px] and the resting edge [px] of the compression
NOISE = 2.0
GREY = np.hypot(NOISE, 0.29)  # rounded to whole grey values
LAMBDA = np.array([1.0, 0.95, 0.9, 0.82, 0.74, 0.66, 0.58, 0.5, 0.42])
SETTINGS = Tracking(correlation=Correlation(subset=21))


def stretches(lam: float) -> tuple[float, float]:
    return 1.0 + 0.499 * (1.0 - lam), lam


def grid() -> np.ndarray:
    x, y = np.meshgrid(np.arange(35.0, 86.0, 10.0), np.arange(20.0, 91.0, 10.0))
    return np.stack([x, y], axis=-1).reshape(-1, 2)


def exact(points: np.ndarray, lam: float, shift: float = 0.0) -> np.ndarray:
    wide, flat = stretches(lam)
    return np.stack([CENTRE + wide * (points[:, 0] - CENTRE) + shift, BASE + flat * (points[:, 1] - BASE)], 1)


@cache
def picture(lam: float, seed: int, shift: float = 0.0) -> np.ndarray:
    wide, flat = stretches(lam)

    def material(p: np.ndarray) -> np.ndarray:
        x, y = p[..., 0] - shift, p[..., 1]
        return np.stack([CENTRE + (x - CENTRE) / wide, BASE + (y - BASE) / flat], axis=-1)

    pattern = speckle_pattern(SHAPE, margin=160.0, seed=7)
    return render(pattern, SHAPE, material=material, noise=NOISE, bits=8, seed=seed).astype(np.uint8)


def compression(lam: np.ndarray = LAMBDA) -> np.ndarray:
    return np.stack([picture(float(value), seed) for seed, value in enumerate(lam)])


def errors(result: Track, lam: np.ndarray = LAMBDA) -> np.ndarray:
    truth = np.array([exact(result.points, value) for value in lam])
    return apply(result.points, result.warp) - truth


def valid(result: Track) -> np.ndarray:
    return result.outcome == int(PointOutcome.VALID)


@cache
def followed() -> Track:
    return track(compression(), grid(), SETTINGS, noise=GREY)


def test_points_are_followed_to_less_than_half_their_height_with_a_right_sigma() -> None:
    result = followed()
    assert valid(result).all()
    assert (result.frame_outcome == int(FrameOutcome.VALID)).all()
    # 5 px speckles at sigma = 2: 8 mpx at rest (Correlation page), 20 mpx flattened to 0.4; five times that
    assert np.abs(errors(result)).max() < 0.1
    assert len(np.unique(result.reference[-1])) >= 1
    assert result.reference[-1].min() > 0  # all have changed
    sigma = np.sqrt(result.covariance[:, :, [0, 1], [0, 1]])
    normalised = errors(result)[1:] / sigma[1:]
    # 48 points of which a third are independent (subset 21, step 10), 8 frames that share their root's noise
    assert 0.7 < normalised.std() < 1.35
    assert (result.warp[0] == 0.0).all()
    assert (result.covariance[0] == 0.0).all()
    assert (result.reference[0] == 0).all()


def test_changes_of_reference_do_not_add_drift() -> None:
    often = track(
        compression(), grid(), Tracking(correlation=SETTINGS.correlation, update_stretch=1.05), noise=GREY
    )
    seldom = followed()
    assert len(np.unique(often.reference)) >= len(np.unique(seldom.reference)) + 3
    # independent errors of seven matches would add up to 2.6 times those of one
    assert errors(often)[-1].std() < 1.5 * errors(seldom)[-1].std()


def test_a_specimen_that_comes_back_returns_to_its_first_reference() -> None:
    lam = np.concatenate([LAMBDA[:7], LAMBDA[5::-1]])
    settings = Tracking(correlation=SETTINGS.correlation, return_every=1)
    result = track(compression(lam), grid(), settings, noise=GREY)
    assert valid(result).all()
    assert result.reference[6].min() > 0
    assert (result.reference[-1] == 0).all()
    assert np.abs(errors(result, lam)[-1]).max() < 0.06  # as in the first frames: 8 mpx, 96 numbers


def test_without_updates_the_flattened_points_are_lost_and_said_so() -> None:
    settings = Tracking(
        correlation=Correlation(subset=21, least_zncc=0.95), update_stretch=10.0, update_zncc=0.0
    )
    ordinary = track(compression(), grid(), Tracking(correlation=settings.correlation), noise=GREY)
    result = track(compression(), grid(), settings, noise=GREY)
    assert np.sum(valid(result)) <= np.sum(valid(ordinary))
    assert np.isfinite(result.covariance[valid(result)]).all()
    assert np.isnan(result.covariance[~valid(result)]).all()


class Series:
    """Pictures of which some cannot be read."""

    path, bits, crop_offset, times = None, 8, (0.0, 0.0), None

    def __init__(self, pictures: np.ndarray, missing: tuple[int, ...]) -> None:
        self.pictures, self.missing, self.asked = pictures, missing, []
        self.n_frames, self.shape = len(pictures), pictures.shape[1:]

    def frame(self, index: int) -> np.ndarray:
        self.asked.append(index)
        if index in self.missing:
            raise PictureError("series.tif", "ends before its last row", frame=index)
        return self.pictures[index]


def test_bad_frames_are_named_and_the_others_stand() -> None:
    pictures = compression().copy()
    pictures[3] = np.random.default_rng(0).normal(5.0, 1.0, SHAPE).clip(0).astype(np.uint8)
    pictures[5] = 255
    series = Series(pictures, missing=(2,))
    steps: list[tuple[int, int]] = []
    result = track(series, grid(), SETTINGS, noise=GREY, progress=lambda *done: steps.append(done))
    assert result.frame_outcome is not None
    bad = {2: FrameOutcome.UNREADABLE, 3: FrameOutcome.BLACK, 5: FrameOutcome.SATURATED}
    for frame in range(len(pictures)):
        assert result.frame_outcome[frame] == int(bad.get(frame, FrameOutcome.VALID))
        cause = PointOutcome.NO_PICTURE if frame in bad else PointOutcome.VALID
        assert (result.outcome[frame] == int(cause)).all()
    good = [frame for frame in range(len(pictures)) if frame not in bad]
    assert np.abs(errors(result)[good]).max() < 0.1  # as without them
    assert series.asked == list(range(len(pictures)))  # one at a time, each once
    assert steps[-1] == (len(pictures), len(pictures))


def test_frames_that_the_caller_declares_bad_are_left_out() -> None:
    declared = np.zeros(len(LAMBDA), dtype=np.int64)
    declared[4] = int(FrameOutcome.SATURATED)
    result = track(compression(), grid(), SETTINGS, noise=GREY, frame_outcome=declared)
    assert result.frame_outcome.tolist() == declared.tolist()
    assert valid(result)[np.arange(len(LAMBDA)) != 4].all()


def test_a_flash_on_part_of_a_frame_costs_only_what_it_hides() -> None:
    pictures = compression().copy()
    pictures[4, 40:, 15:60] = 255
    result = track(pictures, grid(), SETTINGS, noise=GREY)
    places = exact(grid(), LAMBDA[4])
    wide, flat = (10.0 * value for value in stretches(LAMBDA[4]))
    clear = (places[:, 0] - wide > 60.0) | (places[:, 1] + flat < 40.0)
    hidden = (places[:, 0] + wide < 60.0) & (places[:, 0] - wide > 15.0) & (places[:, 1] - flat > 40.0)
    assert hidden.sum() > 5
    assert clear.sum() > 10
    assert valid(result)[4, clear].all()
    assert not valid(result)[4, hidden].any()
    assert valid(result)[5:].all()
    assert np.abs(errors(result)[5:]).max() < 0.1  # as without it


def test_speckles_that_vanish_cost_only_their_points() -> None:
    pictures = compression().copy()
    rng = np.random.default_rng(3)
    for frame in range(3, len(LAMBDA)):
        blank = rng.normal(128.0, NOISE, (SHAPE[0], 55))
        pictures[frame, :, :55] = np.clip(blank, 0, 255).astype(np.uint8)
    result = track(pictures, grid(), SETTINGS, noise=GREY)
    half = 10.0 * stretches(LAMBDA[-1])[0]
    x = exact(grid(), LAMBDA[-1])[:, 0]
    assert valid(result)[:, x - half > 55.0].all()
    gone = x + half < 55.0
    assert gone.any()
    assert not valid(result)[3:, gone].any()
    assert (result.outcome[3:, gone] != int(PointOutcome.NO_PICTURE)).all()


def test_a_jump_beyond_the_match_is_found_by_seeds() -> None:
    pictures = np.stack([picture(1.0, 0), picture(0.9, 1), picture(0.85, 2, shift=23.0)])
    points = grid()[grid()[:, 0] < 80.0]
    result = track(pictures, points, SETTINGS, noise=GREY)
    assert valid(result)[2].all()
    off = apply(points, result.warp[2]) - exact(points, 0.85, shift=23.0)
    assert np.abs(off).max() < 0.06  # 8 mpx, 80 numbers
    lost = track(pictures, points, Tracking(correlation=SETTINGS.correlation, search=0), noise=GREY)
    assert valid(lost)[2].mean() < 0.5
    assert valid(lost)[1].all()


def test_another_scene_is_a_lost_frame() -> None:
    other = render(speckle_pattern(SHAPE, seed=99), SHAPE, noise=NOISE, bits=8, seed=5).astype(np.uint8)
    pictures = np.stack([picture(1.0, 0), other, picture(0.95, 1)])
    result = track(pictures, grid(), SETTINGS, noise=GREY)
    assert result.frame_outcome.tolist() == [
        int(FrameOutcome.VALID), int(FrameOutcome.LOST), int(FrameOutcome.VALID)
    ]  # fmt: skip
    assert valid(result)[2].all()


def test_a_series_can_be_followed_both_ways_from_its_middle() -> None:
    lam = LAMBDA[:7]
    first = 3
    result = track(compression(lam), grid(), SETTINGS, noise=GREY, first=first)
    assert valid(result).all()
    # a point of frame 3 lies elsewhere in the material at rest
    points = grid()
    wide, flat = stretches(lam[first])
    rest = np.stack([CENTRE + (points[:, 0] - CENTRE) / wide, BASE + (points[:, 1] - BASE) / flat], axis=1)
    truth = np.array([exact(rest, value) for value in lam])
    assert np.abs(apply(points, result.warp) - truth).max() < 0.1  # as forward


def test_total_warps_from_another_picture_are_kept() -> None:
    material, later = picture(1.0, 0), compression()[2:6]
    points = grid()
    truth = np.array([exact(points, value) for value in LAMBDA[2:6]])
    by_picture = track(later, points, SETTINGS, noise=GREY, material=material)
    assert (by_picture.reference[0] == -1).all()
    assert np.abs(apply(points, by_picture.warp) - truth).max() < 0.08  # 8 mpx, 384 numbers
    start, covariance = by_picture.warp[0], by_picture.covariance[0]
    by_start = track(later, points, SETTINGS, noise=GREY, start=start, start_covariance=covariance)
    assert (by_start.warp[0] == start).all()
    assert (by_start.reference[1] == 0).all()
    off = apply(points, by_start.warp) - truth
    assert np.abs(off).max() < 0.08
    sigma = np.sqrt(by_start.covariance[:, :, [0, 1], [0, 1]])
    # 4 frames, 48 points of which a third are independent
    assert 0.7 < (off / sigma).std() < 1.35


def test_a_point_without_contrast_or_outside_is_said_so_from_the_start() -> None:
    pictures = compression()[:3].copy()
    pictures[:, 40:75, 40:75] = 128
    points = np.array([[57.0, 57.0], [2.0, 2.0], [90.0, 20.0]])
    result = track(pictures, points, SETTINGS, noise=GREY)
    causes = (PointOutcome.LOW_CONTRAST, PointOutcome.OUT_OF_VIEW, PointOutcome.VALID)
    assert result.outcome[0].tolist() == [int(cause) for cause in causes]
    assert result.outcome[2, 2] == int(PointOutcome.VALID)
    assert not valid(result)[:, 0].any()


def test_the_mask_keeps_the_neighbouring_body_out() -> None:
    pictures = compression()[:4].copy()
    still = picture(1.0, 20)
    for frame in pictures:
        frame[:, 75:] = still[:, 75:]  # a body at rest beside the specimen
    mask = np.zeros(SHAPE, dtype=bool)
    mask[:, :70] = True
    points = grid()[grid()[:, 0] <= 65.0]
    result = track(pictures, points, SETTINGS, noise=GREY, mask=mask)
    assert valid(result).all()
    # subsets of down to two thirds of their pixels, off their centre
    assert np.abs(errors(result, LAMBDA[:4])).max() < 0.12


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"points": np.zeros((3, 3))}, "points must be finite pixels"),
        ({"points": np.array([[1.0, np.nan]])}, "points must be finite pixels"),
        ({"first": 3}, "first must be a frame from 0 to 2, got 3"),
        ({"start": identity(3)}, r"start has shape \(3, 12\), must be"),
        ({"start": np.full((48, 12), np.nan)}, "start must be finite"),
        ({"start_covariance": np.zeros((48, 2, 2))}, "start_covariance belongs to a start"),
        ({"frame_outcome": np.zeros(2)}, r"frame_outcome has shape \(2,\)"),
        ({"first": 1}, "frame 1 cannot be the first reference: a picture shows no more than its noise"),
    ],
)
def test_what_does_not_fit_is_refused_with_the_cure(change: dict, text: str) -> None:
    pictures = compression()[:3].copy()
    pictures[1] = 0
    arguments = {"points": grid(), **change}
    with pytest.raises(ValueError, match=text):
        track(pictures, arguments.pop("points"), SETTINGS, noise=GREY, **arguments)


PARTS_SHAPE = (100, 120)


def parts_grid(nx: int, ny: int, step: float) -> np.ndarray:
    x, y = np.meshgrid(20.0 + step * np.arange(nx), 10.0 + step * np.arange(ny))
    return np.stack([x, y], axis=-1).reshape(-1, 2)


def affine(F: np.ndarray, n: int) -> np.ndarray:
    warp = identity(n)
    warp[:, 2:6] = (F - np.eye(2)).ravel()
    return warp


def noise_picture(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(100.0, 2.0, PARTS_SHAPE)


def template(warp: np.ndarray, frame: int = 0, root: bool = True, before: float = 0.0) -> matcher.Template:
    n = len(warp)
    return matcher.Template(
        np.full(n, frame), warp, np.tile(before * np.eye(2), (n, 1, 1)), np.full(n, root),
        np.full(n, 21), np.ones(n), np.zeros(n),
    )  # fmt: skip


@pytest.mark.parametrize("frames", [(0, 1, 2, 3, 4, 5), (0, 2, 3, 7, 8, 12), (9, 8, 6, 5, 1, 0)])
def test_prediction_is_exact_for_constant_acceleration_across_gaps(frames: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    a, b, c = rng.normal(size=(3, 5, 12))
    predictor = frame_match.Predictor(5)
    rows = np.arange(5)
    for frame in frames[:-1]:
        predictor.predict(frame)  # what it would have said decides about the order
        predictor.add(frame, rows, a + b * frame + c * frame**2)
    end = frames[-1]
    # rounding, amplified by the weights of an extrapolation (below 100)
    np.testing.assert_allclose(predictor.predict(end), a + b * end + c * end**2, rtol=0, atol=1e-10)


def test_prediction_of_noise_about_rest_stays_at_rest() -> None:
    rng = np.random.default_rng(2)
    predictor = frame_match.Predictor(200)
    for frame in range(8):
        guess = predictor.predict(frame)
        predictor.add(frame, np.arange(200), 0.01 * rng.normal(size=(200, 12)))
    assert predictor.order == [0, 0, 0]
    assert guess.std() < 0.012  # of noise with 0.01; a line through two would have 0.022


def test_a_point_with_a_short_past_is_predicted_with_what_it_has() -> None:
    predictor = frame_match.Predictor(2)
    for frame in range(4):
        predictor.predict(frame)
        rows = np.arange(2) if frame == 3 else np.array([0])
        predictor.add(frame, rows, np.full((len(rows), 12), float(frame)))
    guess = predictor.predict(5)
    np.testing.assert_allclose(guess[0], 5.0, rtol=1e-12)
    np.testing.assert_allclose(guess[1], 3.0, rtol=1e-12)


def test_neighbours_hand_on_a_homogeneous_deformation_exactly() -> None:
    points = parts_grid(6, 5, 7.0)
    F = np.array([[1.2, 0.1], [-0.05, 0.6]])
    warp = affine(F, len(points))
    warp[:, :2] = points @ (F - np.eye(2)).T
    beside = frame_match.Neighbours.of(points)
    rows = np.arange(len(points))
    guesses = beside.guesses(warp, rows)[beside.exists]
    exact = np.repeat(warp, beside.exists.sum(axis=1), axis=0)
    np.testing.assert_allclose(guesses, exact, rtol=0, atol=1e-12)  # rounding
    assert beside.exists[rows].sum(axis=1).min() >= 3  # a corner of the grid


def test_the_best_neighbour_is_the_found_one_with_the_highest_correlation() -> None:
    points = parts_grid(3, 1, 5.0)
    warp = identity(3)
    warp[:, 0] = [1.0, 2.0, 3.0]
    beside = frame_match.Neighbours.of(points)
    middle = np.array([1])
    zncc = np.array([0.8, np.nan, 0.9])
    assert beside.best(warp, zncc, np.array([True, False, True]), middle)[0, 0] == 3.0
    assert beside.best(warp, zncc, np.array([True, False, False]), middle)[0, 0] == 1.0


def test_a_point_away_from_where_its_neighbours_put_it_disagrees() -> None:
    points = parts_grid(7, 7, 5.0)
    warp = affine(np.diag([1.3, 0.4]), len(points))
    warp[:, :2] = points * [0.3, -0.6]
    wrong = 24
    warp[wrong, 0] += 1.5
    found = np.ones(len(points), dtype=bool)
    agrees = frame_match.Neighbours.of(points).agreeing(warp, found, np.arange(len(points)), 1.0)
    assert np.flatnonzero(~agrees).tolist() == [wrong]


def test_two_bodies_that_part_are_both_believed() -> None:
    points = parts_grid(8, 8, 5.0)
    warp = identity(len(points))
    warp[points[:, 1] > 27.0, 1] = 30.0
    assert frame_match.Neighbours.of(points).agreeing(warp, np.ones(64, dtype=bool), np.arange(64), 1.0).all()


def test_single_and_coinciding_points_have_neighbours_or_none() -> None:
    assert not frame_match.Neighbours.of(np.array([[3.0, 4.0]])).exists.any()
    twice = frame_match.Neighbours.of(np.array([[3.0, 4.0], [3.0, 4.0], [8.0, 4.0]]))
    assert all(i not in twice.index[i][twice.exists[i]] for i in range(3))


@pytest.mark.parametrize(
    ("name", "outcome"),
    [
        ("speckles", FrameOutcome.VALID),
        ("flattened", FrameOutcome.VALID),
        ("dimmed", FrameOutcome.VALID),
        ("noise", FrameOutcome.BLACK),
        ("zero", FrameOutcome.BLACK),
        ("flash", FrameOutcome.SATURATED),
        ("missing", FrameOutcome.UNREADABLE),
        ("not finite", FrameOutcome.UNREADABLE),
    ],
)
def test_a_picture_without_a_scene_is_named(name: str, outcome: FrameOutcome) -> None:
    pattern = speckle_pattern(PARTS_SHAPE)
    speckles = render(pattern, PARTS_SHAPE, noise=2.0, bits=8)
    pictures = {
        "speckles": speckles,
        "flattened": render(pattern, PARTS_SHAPE, material=lambda p: p * [0.8, 4.0], noise=2.0, bits=8),
        "dimmed": 0.3 * speckles,
        "noise": noise_picture(),
        "zero": np.zeros(PARTS_SHAPE),
        "flash": np.minimum(speckles + 150.0, 255.0),
        "missing": None,
        "not finite": np.where(speckles > 100.0, np.nan, speckles),
    }
    assert Scene.of(speckles).judge(pictures[name]) is outcome


def test_a_frame_that_cannot_be_read_is_none() -> None:
    class Broken:
        path, n_frames, shape, bits, crop_offset, times = None, 3, PARTS_SHAPE, 8, (0.0, 0.0), None

        def frame(self, index: int) -> np.ndarray:
            raise PictureError("a.tif", "cut short", frame=index)

    assert read(Broken(), 1) is None


def test_seeds_find_a_large_affine_motion() -> None:
    pattern = speckle_pattern((160, 200), seed=3)
    F, shift = np.array([[1.1, 0.05], [-0.1, 0.8]]), np.array([23.0, -12.0])
    centre = np.array([100.0, 80.0])
    first = render(pattern, (160, 200), noise=2.0)
    second = render(
        pattern,
        (160, 200),
        material=lambda p: (p - centre - shift) @ np.linalg.inv(F).T + centre,
        noise=2.0,
        seed=1,
    )
    origin = centre + np.array([[0.0, 0.0], [-25.0, 15.0], [20.0, -20.0]])
    truth = (origin - centre) @ F.T + centre + shift
    places, found = frame_match.affine_consensus(*frame_match.match_features(first, second), origin)
    # SIFT places a feature to some tenths of a pixel; a match starts from 1 px off (Correlation page)
    np.testing.assert_allclose(places, truth, rtol=0, atol=0.6)
    np.testing.assert_allclose(found, np.broadcast_to(F, (3, 2, 2)), rtol=0, atol=0.05)
    turned = np.broadcast_to(F, (3, 2, 2))
    windows, score = frame_match.correlate_windows(first, second, origin, origin, turned, half=12, search=30)
    np.testing.assert_allclose(windows, truth, rtol=0, atol=0.75)  # to a whole pixel, and its noise
    assert score.min() > 0.9
    away, none = frame_match.correlate_windows(
        first, second, origin, origin + 500.0, turned, half=12, search=30
    )
    assert np.isnan(away).all()
    assert (none == -1.0).all()


def test_features_of_a_blank_picture_agree_on_nothing() -> None:
    places, F = frame_match.affine_consensus(
        *frame_match.match_features(np.zeros(PARTS_SHAPE), np.zeros(PARTS_SHAPE)), np.array([[50.0, 50.0]])
    )
    assert np.isnan(places).all()
    assert np.isnan(F).all()


def test_spread_points_are_few_and_far_apart() -> None:
    points = parts_grid(20, 20, 1.0)
    picked = frame_match.spread(points, np.arange(400), 9)
    assert len(set(picked.tolist())) == 9
    apart = np.hypot(*(points[picked][:, None] - points[picked][None]).transpose(2, 0, 1))
    assert apart[~np.eye(9, dtype=bool)].min() > 5.0  # nine on a square of 19 px, best 9.5
    assert frame_match.spread(points, np.array([4, 7]), 9).tolist() == [4, 7]


def test_stretches_are_singular_values() -> None:
    F = np.random.default_rng(4).normal(size=(50, 2, 2))
    values = np.linalg.svd(F, compute_uv=False)
    largest, smallest = matcher.principal(F)
    # the smaller one is a difference: rounding of squares
    np.testing.assert_allclose(largest, values[:, 0], rtol=1e-12)
    np.testing.assert_allclose(smallest, values[:, 1], rtol=0, atol=1e-7)
    np.testing.assert_allclose(matcher.stretch(F), np.maximum(values[:, 0], 1.0 / values[:, 1]), rtol=1e-5)


def test_a_chain_of_matches_has_the_sigma_of_one() -> None:
    one = np.tile(1e-6 * np.eye(2), (3, 1, 1))  # 1 mpx
    none = np.zeros(3)
    total, carried = matcher.compose(one, identity(3), template(identity(3)), none)
    np.testing.assert_allclose(total, one, rtol=1e-12)
    for frame in range(1, 5):  # at rest, both pictures alike: half of the variance is the root's
        # the noise's share in the gradients of 441 samples is 4e-4, the residue twice that each time
        np.testing.assert_allclose(carried, one / 2.0, rtol=5e-3, atol=1e-20)
        later = matcher.Template(
            np.full(3, frame), identity(3), carried, np.zeros(3, bool), np.full(3, 21), none, none
        )
        total, carried = matcher.compose(one, identity(3), later, none)
        np.testing.assert_allclose(total, one, rtol=5e-3, atol=1e-20)


def test_noisy_gradients_leave_a_residue_at_every_change_of_reference() -> None:
    one = np.tile(1e-3 * np.eye(2), (1, 1, 1))  # 32 mpx
    _, carried = matcher.compose(one, identity(1), template(identity(1), root=False), np.zeros(1))
    # as in `compose`: RESIDUE x samples x variance of half the match, at most all of it
    expected = min(matcher.RESIDUE * 441 * 1e-3, 1.0) * 0.5e-3
    np.testing.assert_allclose(carried[0], expected * np.eye(2), rtol=1e-9, atol=1e-20)


def test_what_a_chain_carries_is_flattened_with_the_material() -> None:
    F = np.diag([1.25, 0.5])
    before = template(affine(np.diag([1.0, 0.8]), 1), frame=3, root=False, before=4.0)
    _, carried = matcher.compose(np.zeros((1, 2, 2)), affine(F, 1), before, np.zeros(1))
    np.testing.assert_allclose(carried[0], 4.0 * np.diag([1.25**2, (0.5 / 0.8) ** 2]), rtol=1e-12)


def test_an_excess_residual_enlarges_sigma_along_the_flattening() -> None:
    angle = 0.3
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    F = (R @ np.diag([0.4, 1.2]) @ R.T)[None]  # flattened along the first axis of R
    large = matcher.enlarged(np.eye(2)[None], F, np.array([2.0]))[0]
    along, across = (1.0 + 2.0 * matcher.ALONG) / 3.0, (1.0 + 2.0 * matcher.ACROSS) / 3.0
    np.testing.assert_allclose(R.T @ large @ R, np.diag([along, across]), rtol=0, atol=1e-12)


def test_residual_of_noise_alone_has_no_excess() -> None:
    rng = np.random.default_rng(5)
    picture = 50.0 * gaussian_filter(rng.normal(size=(200, 200)), 2.0) / 0.14
    variance = matcher.local_variance(picture, 41)[90:91, 100]
    window = picture[70:111, 80:121]
    np.testing.assert_allclose(variance, window.var(), rtol=1e-9)
    f, g = (window + rng.normal(0.0, 5.0, window.shape) for _ in range(2))
    zncc = np.array([np.corrcoef(f.ravel(), g.ravel())[0, 1]])
    # 1681 samples: the variance of the residual is known to 3.5 %, here to two sigma
    assert matcher.excess(zncc, variance, Noise(5.0), 0.0)[0] < 0.07
    assert matcher.excess(zncc, variance, Noise(2.5), 0.0)[0] == pytest.approx(3.0, abs=0.3)
    assert matcher.excess(zncc, variance, Noise(3.0, 0.16), 100.0)[0] < 0.07  # 9 + 16
    assert matcher.excess(zncc, variance, Noise(0.0), 0.0)[0] == 0.0


def test_a_residual_is_kept_through_changes_of_reference() -> None:
    here = SimpleNamespace(
        covariance=np.tile(1e-6 * np.eye(2), (3, 1, 1)),
        valid=np.array([True, True, False]),
        template=replace(template(identity(3)), excess=np.array([0.0, 5.0, 2.0])),
        warp=identity(3),
        zncc=np.ones(3),
        matcher=SimpleNamespace(excess=lambda rows, zncc, template: np.array([3.0, 1.0])),
    )
    np.testing.assert_array_equal(_compose_points(here)[2], [3.0, 5.0, np.nan])


def test_subsets_grow_with_the_flattening_up_to_the_limit() -> None:
    warp = np.concatenate([affine(np.diag([1.4, value]), 1) for value in (1.0, 0.7, 0.5, 0.25)])
    assert enlarged_subset(31, warp, 1.0).tolist() == [31] * 4
    side = enlarged_subset(31, warp, 3.0)
    assert (side % 2 == 1).all()
    assert (side[:3] * [1.0, 0.7, 0.5] >= 30.0).all()  # to a step of two pixels
    assert side[3] == 93  # three times


def test_chains_forget_the_middle_and_keep_the_root() -> None:
    references = matcher.References(2)
    references.start(template(identity(2), frame=0))
    rows = np.array([1])
    for frame in range(1, 20):
        references.renew(rows, template(identity(1), frame=frame, root=False))
    assert references.template(np.arange(2)).frame.tolist() == [0, 19]
    for back in range(int(references.level[1])):
        assert references.template(rows, back=back).frame[0] == 19 - back
    root = references.template(rows, back=int(references.level[1]))
    assert root.frame[0] == 0
    assert root.root[0]
    references.go_back(rows)
    assert references.template(rows).frame[0] == 18


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("update_stretch", 1.0),
        ("update_zncc", 1.0),
        ("return_every", -1),
        ("growth", 0.9),
        ("search", -1),
        ("neighbour_gate", 0.0),
        ("least_valid", 1.1),
    ],
)
def test_settings_name_what_is_out_of_range(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{name} must be .*got {value}"):
        Tracking(correlation=Correlation(), **{name: value})
