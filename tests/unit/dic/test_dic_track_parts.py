"""Parts of the tracking: prediction, neighbours, usable pictures, seeds, chains of references."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from speckle_pictures import render, speckle_pattern

from dic.correlation import Correlation, Noise
from dic.correlation.subsets import identity
from dic.images import PictureError
from dic.outcome import FrameOutcome
from dic.tracking import Tracking, _compose_points, enlarged_subset
from dic.tracking.frame_match import (
    Neighbours,
    Predictor,
    affine_consensus,
    correlate_windows,
    match_features,
    spread,
)
from dic.tracking.inputs import Scene, read
from dic.tracking.matcher import (
    ACROSS,
    ALONG,
    RESIDUE,
    References,
    Template,
    compose,
    enlarged,
    excess,
    local_variance,
    principal,
    stretch,
)

SHAPE = (100, 120)


def grid(nx: int, ny: int, step: float) -> np.ndarray:
    x, y = np.meshgrid(20.0 + step * np.arange(nx), 10.0 + step * np.arange(ny))
    return np.stack([x, y], axis=-1).reshape(-1, 2)


def affine(F: np.ndarray, n: int) -> np.ndarray:
    warp = identity(n)
    warp[:, 2:6] = (F - np.eye(2)).ravel()
    return warp


def noise_picture(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(100.0, 2.0, SHAPE)


def template(warp: np.ndarray, frame: int = 0, root: bool = True, before: float = 0.0) -> Template:
    n = len(warp)
    return Template(
        np.full(n, frame), warp, np.tile(before * np.eye(2), (n, 1, 1)), np.full(n, root),
        np.full(n, 21), np.ones(n), np.zeros(n),
    )  # fmt: skip


@pytest.mark.parametrize("frames", [(0, 1, 2, 3, 4, 5), (0, 2, 3, 7, 8, 12), (9, 8, 6, 5, 1, 0)])
def test_prediction_is_exact_for_constant_acceleration_across_gaps(frames: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    a, b, c = rng.normal(size=(3, 5, 12))
    predictor = Predictor(5)
    rows = np.arange(5)
    for frame in frames[:-1]:
        predictor.predict(frame)  # what it would have said decides about the order
        predictor.add(frame, rows, a + b * frame + c * frame**2)
    end = frames[-1]
    # rounding, amplified by the weights of an extrapolation (below 100)
    np.testing.assert_allclose(predictor.predict(end), a + b * end + c * end**2, rtol=0, atol=1e-10)


def test_prediction_of_noise_about_rest_stays_at_rest() -> None:
    rng = np.random.default_rng(2)
    predictor = Predictor(200)
    for frame in range(8):
        guess = predictor.predict(frame)
        predictor.add(frame, np.arange(200), 0.01 * rng.normal(size=(200, 12)))
    assert predictor.order == [0, 0, 0]
    assert guess.std() < 0.012  # of noise with 0.01; a line through two would have 0.022


def test_a_point_with_a_short_past_is_predicted_with_what_it_has() -> None:
    predictor = Predictor(2)
    for frame in range(4):
        predictor.predict(frame)
        rows = np.arange(2) if frame == 3 else np.array([0])
        predictor.add(frame, rows, np.full((len(rows), 12), float(frame)))
    guess = predictor.predict(5)
    np.testing.assert_allclose(guess[0], 5.0, rtol=1e-12)
    np.testing.assert_allclose(guess[1], 3.0, rtol=1e-12)


def test_neighbours_hand_on_a_homogeneous_deformation_exactly() -> None:
    points = grid(6, 5, 7.0)
    F = np.array([[1.2, 0.1], [-0.05, 0.6]])
    warp = affine(F, len(points))
    warp[:, :2] = points @ (F - np.eye(2)).T
    beside = Neighbours.of(points)
    rows = np.arange(len(points))
    guesses = beside.guesses(warp, rows)[beside.exists]
    exact = np.repeat(warp, beside.exists.sum(axis=1), axis=0)
    np.testing.assert_allclose(guesses, exact, rtol=0, atol=1e-12)  # rounding
    assert beside.exists[rows].sum(axis=1).min() >= 3  # a corner of the grid


def test_the_best_neighbour_is_the_found_one_with_the_highest_correlation() -> None:
    points = grid(3, 1, 5.0)
    warp = identity(3)
    warp[:, 0] = [1.0, 2.0, 3.0]
    beside = Neighbours.of(points)
    middle = np.array([1])
    zncc = np.array([0.8, np.nan, 0.9])
    assert beside.best(warp, zncc, np.array([True, False, True]), middle)[0, 0] == 3.0
    assert beside.best(warp, zncc, np.array([True, False, False]), middle)[0, 0] == 1.0


def test_a_point_away_from_where_its_neighbours_put_it_disagrees() -> None:
    points = grid(7, 7, 5.0)
    warp = affine(np.diag([1.3, 0.4]), len(points))
    warp[:, :2] = points * [0.3, -0.6]
    wrong = 24
    warp[wrong, 0] += 1.5
    found = np.ones(len(points), dtype=bool)
    agrees = Neighbours.of(points).agreeing(warp, found, np.arange(len(points)), 1.0)
    assert np.flatnonzero(~agrees).tolist() == [wrong]


def test_two_bodies_that_part_are_both_believed() -> None:
    points = grid(8, 8, 5.0)
    warp = identity(len(points))
    warp[points[:, 1] > 27.0, 1] = 30.0
    assert Neighbours.of(points).agreeing(warp, np.ones(64, dtype=bool), np.arange(64), 1.0).all()


def test_single_and_coinciding_points_have_neighbours_or_none() -> None:
    assert not Neighbours.of(np.array([[3.0, 4.0]])).exists.any()
    twice = Neighbours.of(np.array([[3.0, 4.0], [3.0, 4.0], [8.0, 4.0]]))
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
    pattern = speckle_pattern(SHAPE)
    speckles = render(pattern, SHAPE, noise=2.0, bits=8)
    pictures = {
        "speckles": speckles,
        "flattened": render(pattern, SHAPE, material=lambda p: p * [0.8, 4.0], noise=2.0, bits=8),
        "dimmed": 0.3 * speckles,
        "noise": noise_picture(),
        "zero": np.zeros(SHAPE),
        "flash": np.minimum(speckles + 150.0, 255.0),
        "missing": None,
        "not finite": np.where(speckles > 100.0, np.nan, speckles),
    }
    assert Scene.of(speckles).judge(pictures[name]) is outcome


def test_a_frame_that_cannot_be_read_is_none() -> None:
    class Broken:
        path, n_frames, shape, bits, crop_offset, times = None, 3, SHAPE, 8, (0.0, 0.0), None

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
    places, found = affine_consensus(*match_features(first, second), origin)
    # SIFT places a feature to some tenths of a pixel; a match starts from 1 px off (Correlation page)
    np.testing.assert_allclose(places, truth, rtol=0, atol=0.6)
    np.testing.assert_allclose(found, np.broadcast_to(F, (3, 2, 2)), rtol=0, atol=0.05)
    turned = np.broadcast_to(F, (3, 2, 2))
    windows, score = correlate_windows(first, second, origin, origin, turned, half=12, search=30)
    np.testing.assert_allclose(windows, truth, rtol=0, atol=0.75)  # to a whole pixel, and its noise
    assert score.min() > 0.9
    away, none = correlate_windows(first, second, origin, origin + 500.0, turned, half=12, search=30)
    assert np.isnan(away).all()
    assert (none == -1.0).all()


def test_features_of_a_blank_picture_agree_on_nothing() -> None:
    places, F = affine_consensus(*match_features(np.zeros(SHAPE), np.zeros(SHAPE)), np.array([[50.0, 50.0]]))
    assert np.isnan(places).all()
    assert np.isnan(F).all()


def test_spread_points_are_few_and_far_apart() -> None:
    points = grid(20, 20, 1.0)
    picked = spread(points, np.arange(400), 9)
    assert len(set(picked.tolist())) == 9
    apart = np.hypot(*(points[picked][:, None] - points[picked][None]).transpose(2, 0, 1))
    assert apart[~np.eye(9, dtype=bool)].min() > 5.0  # nine on a square of 19 px, best 9.5
    assert spread(points, np.array([4, 7]), 9).tolist() == [4, 7]


def test_stretches_are_singular_values() -> None:
    F = np.random.default_rng(4).normal(size=(50, 2, 2))
    values = np.linalg.svd(F, compute_uv=False)
    largest, smallest = principal(F)
    # the smaller one is a difference: rounding of squares
    np.testing.assert_allclose(largest, values[:, 0], rtol=1e-12)
    np.testing.assert_allclose(smallest, values[:, 1], rtol=0, atol=1e-7)
    np.testing.assert_allclose(stretch(F), np.maximum(values[:, 0], 1.0 / values[:, 1]), rtol=1e-5)


def test_a_chain_of_matches_has_the_sigma_of_one() -> None:
    one = np.tile(1e-6 * np.eye(2), (3, 1, 1))  # 1 mpx
    none = np.zeros(3)
    total, carried = compose(one, identity(3), template(identity(3)), none)
    np.testing.assert_allclose(total, one, rtol=1e-12)
    for frame in range(1, 5):  # at rest, both pictures alike: half of the variance is the root's
        # the noise's share in the gradients of 441 samples is 4e-4, the residue twice that each time
        np.testing.assert_allclose(carried, one / 2.0, rtol=5e-3, atol=1e-20)
        later = Template(
            np.full(3, frame), identity(3), carried, np.zeros(3, bool), np.full(3, 21), none, none
        )
        total, carried = compose(one, identity(3), later, none)
        np.testing.assert_allclose(total, one, rtol=5e-3, atol=1e-20)


def test_noisy_gradients_leave_a_residue_at_every_change_of_reference() -> None:
    one = np.tile(1e-3 * np.eye(2), (1, 1, 1))  # 32 mpx
    _, carried = compose(one, identity(1), template(identity(1), root=False), np.zeros(1))
    # as in `compose`: RESIDUE x samples x variance of half the match, at most all of it
    expected = min(RESIDUE * 441 * 1e-3, 1.0) * 0.5e-3
    np.testing.assert_allclose(carried[0], expected * np.eye(2), rtol=1e-9, atol=1e-20)


def test_what_a_chain_carries_is_flattened_with_the_material() -> None:
    F = np.diag([1.25, 0.5])
    before = template(affine(np.diag([1.0, 0.8]), 1), frame=3, root=False, before=4.0)
    _, carried = compose(np.zeros((1, 2, 2)), affine(F, 1), before, np.zeros(1))
    np.testing.assert_allclose(carried[0], 4.0 * np.diag([1.25**2, (0.5 / 0.8) ** 2]), rtol=1e-12)


def test_an_excess_residual_enlarges_sigma_along_the_flattening() -> None:
    angle = 0.3
    R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    F = (R @ np.diag([0.4, 1.2]) @ R.T)[None]  # flattened along the first axis of R
    large = enlarged(np.eye(2)[None], F, np.array([2.0]))[0]
    along, across = (1.0 + 2.0 * ALONG) / 3.0, (1.0 + 2.0 * ACROSS) / 3.0
    np.testing.assert_allclose(R.T @ large @ R, np.diag([along, across]), rtol=0, atol=1e-12)


def test_residual_of_noise_alone_has_no_excess() -> None:
    rng = np.random.default_rng(5)
    picture = 50.0 * gaussian_filter(rng.normal(size=(200, 200)), 2.0) / 0.14
    places = np.array([[100.0, 90.0]])
    variance = local_variance(picture, places, 41)
    window = picture[70:111, 80:121]
    np.testing.assert_allclose(variance, window.var(), rtol=1e-9)
    f, g = (window + rng.normal(0.0, 5.0, window.shape) for _ in range(2))
    zncc = np.array([np.corrcoef(f.ravel(), g.ravel())[0, 1]])
    # 1681 samples: the variance of the residual is known to 3.5 %, here to two sigma
    assert excess(zncc, variance, Noise(5.0), 0.0)[0] < 0.07
    assert excess(zncc, variance, Noise(2.5), 0.0)[0] == pytest.approx(3.0, abs=0.3)
    assert excess(zncc, variance, Noise(3.0, 0.16), 100.0)[0] < 0.07  # 9 + 16
    assert excess(zncc, variance, Noise(0.0), 0.0)[0] == 0.0


def test_a_residual_is_kept_through_changes_of_reference() -> None:
    here = SimpleNamespace(
        covariance=np.tile(1e-6 * np.eye(2), (3, 1, 1)),
        valid=np.array([True, True, False]),
        template=replace(template(identity(3)), excess=np.array([0.0, 5.0, 2.0])),
        warp=identity(3),
        zncc=np.ones(3),
        matcher=SimpleNamespace(excess=lambda zncc, template: np.array([3.0, 1.0])),
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
    references = References(2)
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
