"""Points followed through rendered series whose motion is exact."""

from functools import cache

import numpy as np
import pytest
from speckle_pictures import render, speckle_pattern

from dic.correlation import Correlation
from dic.correlation.subsets import apply, identity
from dic.images import PictureError
from dic.outcome import FrameOutcome, PointOutcome
from dic.tracking import Track, Tracking, track

SHAPE = (110, 120)
CENTRE, BASE = 60.0, 100.0
"""The axis [px] and the resting edge [px] of the compression."""
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


def test_all_points_are_followed_to_less_than_half_their_height() -> None:
    result = followed()
    assert valid(result).all()
    assert (result.frame_outcome == int(FrameOutcome.VALID)).all()
    # 5 px speckles at sigma = 2: 8 mpx at rest (Correlation page), 20 mpx flattened to 0.4; five times that
    assert np.abs(errors(result)).max() < 0.1


def test_references_change_and_sigma_stays_calibrated() -> None:
    result = followed()
    assert len(np.unique(result.reference[-1])) >= 1
    assert result.reference[-1].min() > 0  # all have changed
    sigma = np.sqrt(result.covariance[:, :, [0, 1], [0, 1]])
    normalised = errors(result)[1:] / sigma[1:]
    # 48 points of which a third are independent (subset 21, step 10), 8 frames that share their root's noise
    assert 0.7 < normalised.std() < 1.35


def test_the_material_frame_is_its_own_place_without_sigma() -> None:
    result = followed()
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
    assert result.frame_outcome is not None
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
    assert result.frame_outcome is not None
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
