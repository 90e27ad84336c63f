"""Gates and outlier limits in closed form: points one per cent inside and outside of each limit."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm, rayleigh
from speckle_pictures import render, speckle_pattern
from test_dic_triangulate import TRACKED_RIG as RIG
from test_dic_triangulate import followed

from dic.basics import MAD, MEDIAN_LENGTH
from dic.bodies.axial_displacement import AxialDisplacement, ObservedPoints, _of_mean
from dic.bodies.body_motion import MotionPrior, Observations, adjust
from dic.bodies.follow import TrackedBody, least_in_strip, material_frame
from dic.bodies.region import Region, carry_region
from dic.chain.follow_bodies import usable_region
from dic.chain.inputs import ChainError
from dic.chain.outliers import gate_epipolar, gate_residual, off_surface, spacing, unlike_points
from dic.chain.remarks import fastest_share, of_radius, of_travel, uneven_steps
from dic.correlation import Correlation
from dic.images.health import frame_health
from dic.outcome import FrameOutcome, PointOutcome
from dic.stereo.reconstruction import reconstruct
from dic.surfaces.cylinder import fit_cylinder

INSIDE, OUTSIDE = 0.99, 1.01


def test_robust_constants_are_those_of_normal_distributions():
    assert pytest.approx(1.0 / norm.ppf(0.75), rel=2e-5) == MAD  # four decimals
    assert pytest.approx(rayleigh.median(), rel=3e-3) == MEDIAN_LENGTH  # two decimals


# --- off the smooth surface -------------------------------------------------------------------------------

SIDE = 9
CELL = np.stack(np.meshgrid(np.arange(SIDE), np.arange(SIDE)), axis=-1).reshape(-1, 2)
MIDDLE = SIDE * SIDE // 2
SIGMA = np.array([2e-6, 3e-6, 5e-6])
DISTANCE = 0.4e-3  # of neighbouring points [m]


def judged(position: np.ndarray, cell: np.ndarray = CELL) -> np.ndarray:
    """Which of the points are off, in the second of two frames; nothing is off in the first."""
    both = np.stack([np.zeros_like(position), position])
    return off_surface(
        both, np.broadcast_to(SIGMA, both.shape), np.ones(both.shape[:2], dtype=bool), cell,
        distance=DISTANCE,
    )[1]  # fmt: skip


def allowed(neighbours: np.ndarray, order: int, sigma: float) -> float:
    """Distance that a point may have from the polynomial through neighbours at these offsets [m].

    3.5 % of the points' distance, times the weights' size if they extrapolate, and five standard deviations
    of the difference between the point and the constant term of the least squares.
    """
    i, j = neighbours.T.astype(float)
    terms = np.stack([np.ones_like(i), i, j, i * i, i * j, j * j][:order], axis=1)
    weights = np.linalg.pinv(terms)[0]
    return 14e-6 * max(1.0, np.abs(weights).sum()) + 5.0 * sigma * np.sqrt(1.0 + weights @ weights)


@pytest.mark.parametrize("component", [0, 1, 2])
@pytest.mark.parametrize(("share", "off"), [(INSIDE, False), (OUTSIDE, True)])
def test_a_point_is_off_beyond_a_share_of_their_distance_and_five_sigmas(component, share, off):
    around = np.array([(i, j) for i in range(-2, 3) for j in range(-2, 3) if (i, j) != (0, 0)])
    position = np.zeros((len(CELL), 3))
    position[MIDDLE, component] = share * allowed(around, 6, SIGMA[component])
    found = judged(position)
    assert bool(found[MIDDLE]) is off
    assert found.sum() == off  # and none of its neighbours


def test_few_neighbours_judge_by_a_plane():
    cell = np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])
    limit = allowed(cell[1:], 3, SIGMA[2])
    for share, off in ((INSIDE, False), (OUTSIDE, True)):
        position = np.zeros((5, 3))
        position[0, 2] = share * limit
        # The others are judged by a plane through the four that remain, which extrapolates and allows more.
        assert judged(position, cell)[0] == off


def test_a_curved_surface_is_smooth_and_one_false_match_condemns_nobody_else():
    i, j = (CELL - SIDE // 2).T
    inner = np.flatnonzero((np.abs(i) < 4) & (np.abs(j) < 4))  # a corner has too few neighbours for a curve
    position = 1e-4 * np.stack([i, j, 0.3 * i * i - 0.2 * i * j + 0.1 * j * j], axis=1)  # 0.1 mm a cell
    assert not judged(position)[inner].any()
    position[MIDDLE, 2] += 1e-3
    assert inner[judged(position)[inner]].tolist() == [MIDDLE]


@pytest.mark.parametrize(("count", "off"), [(0, True), (1, True), (2, False), (3, False)])
def test_a_point_needs_two_neighbours_and_is_judged_by_four(count, off):
    block = np.array([(i, j) for i in range(10, 14) for j in range(4)])
    lone = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])[: count + 1]
    position = np.zeros((len(block) + len(lone), 3))
    position[len(block), 2] = 1e-3  # far off: but two or three neighbours do not judge
    found = judged(position, np.concatenate([block, lone]))
    assert not found[: len(block)].any()
    assert bool(found[len(block)]) is off


@pytest.mark.parametrize("scale", [0.1, 10.0])
def test_the_smooth_surface_is_judged_alike_at_any_size(scale):
    rng = np.random.default_rng(0)
    position = rng.normal(0.0, 1.5 * SIGMA[2], (1, len(CELL), 3)) + np.pad(DISTANCE * CELL, ((0, 0), (0, 1)))
    sigma, valid = np.broadcast_to(SIGMA, position.shape), np.ones((1, len(CELL)), dtype=bool)
    position[0, ::7] += 40e-6  # some beyond the limit, some by chance
    usual = off_surface(position, sigma, valid, CELL, distance=spacing(position[0], CELL))
    assert 0 < usual.sum() < len(CELL)
    other = scale * position
    found = off_surface(other, scale * sigma, valid, CELL, distance=spacing(other[0], CELL))
    assert found.tolist() == usual.tolist()


def test_the_spacing_is_the_distance_of_points_beside_each_other():
    position = np.pad(CELL * [3e-4, 4e-4], ((0, 0), (0, 1)))
    # half of the pairs are 0.3 mm apart and half 0.4: their median lies between; diagonals do not count
    assert spacing(position, CELL) == pytest.approx(3.5e-4)
    position[1::2] = np.nan  # of an odd row every second point, and its neighbours in the column too
    assert np.isnan(spacing(position, CELL))
    with pytest.raises(ValueError, match="distance must be a positive length"):
        off_surface(np.zeros((1, 81, 3)), np.ones((1, 81, 3)), np.ones((1, 81), bool), CELL, distance=0.0)


# --- the residual map -------------------------------------------------------------------------------------


def unlike(level: dict[int, float]) -> list[int]:
    """Points of a grid found unlike what was followed, by their residuals over that of the others."""
    excess = np.zeros((2, len(CELL)))
    excess[1] = 3.0  # the whole frame is off by as much: haze, say
    for point, times in level.items():
        excess[1, point] = 4.0 * times - 1.0
    found = unlike_points(excess, np.ones(excess.shape, dtype=bool), CELL)
    assert not found[0].any()
    return np.flatnonzero(found[1]).tolist()


def test_a_patch_has_a_point_of_ten_times_the_residual_and_all_around_it():
    assert unlike({MIDDLE: 10.0 * INSIDE}) == []
    assert unlike({MIDDLE: 10.0 * OUTSIDE}) == [MIDDLE]
    beside, farther, apart = MIDDLE + 2, MIDDLE + 4, MIDDLE + 4 * SIDE
    around = {MIDDLE: 20.0, beside: 1.5 * OUTSIDE, farther: 1.5 * OUTSIDE, apart: 1.5 * OUTSIDE}
    assert unlike(around) == [MIDDLE, beside, farther]  # from one to the next, two cells at a time
    assert unlike({MIDDLE: 20.0, beside: 1.5 * INSIDE, farther: 1.5 * OUTSIDE}) == [MIDDLE]
    assert unlike({beside: 9.0, farther: 9.0}) == []


def test_what_is_not_known_is_judged_by_nothing():
    excess = np.full((1, len(CELL)), np.nan)
    valid = np.ones(excess.shape, dtype=bool)
    assert not unlike_points(excess, valid, CELL).any()
    excess[:] = 0.0
    excess[0, MIDDLE] = 99.0
    valid[0, MIDDLE] = False
    assert not unlike_points(excess, valid, CELL).any()


def test_a_point_that_one_camera_sees_changed_is_no_point_of_the_surface():
    points = body(np.zeros((2, 40)), 1e-4)
    excess = np.zeros((2, 40))
    excess[1, 3] = 50.0
    cell = np.stack([np.arange(40), np.zeros(40, dtype=int)], axis=1)
    tracks = points.tracks[0], replace(points.tracks[1], excess=excess)
    found = gate_residual(replace(points, cell=cell, tracks=tracks))
    expected = np.zeros((2, 40), dtype=int)
    expected[1, 3] = PointOutcome.LOW_CORRELATION
    assert found.reconstruction.outcome.tolist() == expected.tolist()
    assert np.isnan(found.reconstruction.position[1, 3]).all()
    unasked = body(np.zeros((2, 40)), 1e-4)  # nobody asked for residuals
    assert not gate_residual(unasked).reconstruction.outcome.any()


def test_a_point_past_an_end_begins_no_patch():
    points = body(np.zeros((2, 40)), 1e-4)
    excess = np.zeros((2, 40))
    excess[1, 3:6] = [50.0, 3.0, 3.0]
    cell = np.stack([np.arange(40), np.zeros(40, dtype=int)], axis=1)
    points = replace(points, cell=cell, tracks=(replace(points.tracks[0], excess=excess), points.tracks[1]))
    outcome = points.reconstruction.outcome.copy()
    assert (gate_residual(points).reconstruction.outcome[1] != PointOutcome.VALID).sum() == 3
    outcome[1, 3] = PointOutcome.AT_END
    ended = replace(points, reconstruction=replace(points.reconstruction, outcome=outcome.copy()))
    np.testing.assert_array_equal(gate_residual(ended).reconstruction.outcome, outcome)


# --- the epipolar gate of the chain -----------------------------------------------------------------------


def body(errors: np.ndarray, sigma: float) -> TrackedBody:
    """Points near the rig's origin whose pixels in camera 1 are `errors` [px] off their epipolar lines."""
    n_frames, n = errors.shape
    X = np.zeros((n_frames, n, 3))
    X[..., 0] = np.linspace(-2e-4, 2e-4, n)  # near the middle: the lines run along x to 0.1 %
    tracks = (followed(RIG.cameras[0], X, sigma), followed(RIG.cameras[1], X, sigma))
    tracks[1].warp[..., 1] += errors
    return TrackedBody(
        points=tracks[0].points, cell=np.zeros((n, 2), dtype=int), mask=np.ones((4, 4), dtype=bool),
        material=0, stereo=None, tracks=tracks, reconstruction=reconstruct(RIG, *tracks), common=None,
    )  # fmt: skip


def gated(errors: np.ndarray, sigma: float = 1e-4) -> np.ndarray:
    """Which points of the last frame pass the gate that the other frames, at rest, ask for."""
    rest = SimpleNamespace(frames=list(range(len(errors) - 1)))
    found = gate_epipolar(SimpleNamespace(rig=RIG), body(errors, sigma), rest)
    return found.reconstruction.outcome[-1] == PointOutcome.VALID


@pytest.mark.parametrize(
    ("rest", "sigma", "gate"),
    [
        (0.05, 1e-4, 6.0 * 0.05 / norm.ppf(0.75)),  # six standard deviations of the frames at rest
        (0.002, 1e-4, 0.1),  # never less than a tenth of a pixel
        (0.002, 0.1, 4.0 * 0.1 * np.sqrt(2.0)),  # four of the point's own, from both cameras' noise
    ],
    ids=["rest", "least", "own"],
)
def test_the_epipolar_gate_of_the_chain(rest, sigma, gate):
    errors = np.full((4, 6), rest) * np.array([1, -1, 1, -1, 1, -1])
    errors[-1] = gate * np.array([INSIDE, -INSIDE, OUTSIDE, -OUTSIDE, 0.0, 0.5])
    assert gated(errors, sigma).tolist() == [True, True, False, False, True, True]


# --- the material frame -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("bad", "wanted", "chosen"),
    [
        ([(), ()], 3, 3),
        ([(3,), ()], 3, 2),  # of two that are as near, the earlier
        ([(3,), (2,)], 3, 4),  # both cameras must have it
        ([(3, 4, 5), (1, 2)], 3, 0),
        ([(), ()], 99, 7),
    ],
)
def test_the_material_frame_is_the_nearest_that_both_cameras_have(bad, wanted, chosen):
    health = np.zeros((2, 8), dtype=np.int64)
    for camera, frames in enumerate(bad):
        health[camera, list(frames)] = FrameOutcome.BLACK
    if wanted == 3 and bad[0] == (3, 4, 5):
        health[0, 6:] = FrameOutcome.UNREADABLE
    assert material_frame((health[0], health[1]), wanted) == chosen


def test_without_a_frame_of_both_cameras_there_is_no_material_frame():
    health = (np.array([0, 2, 0]), np.array([1, 0, 3]))
    with pytest.raises(ValueError, match="no frame has a usable picture of both cameras"):
        material_frame(health, 0)


# --- outliers of rigid bodies and cylinders ---------------------------------------------------------------

SPREAD = 2.0  # median of the residuals, in their declared sigmas
LIMIT = 4.0 * SPREAD / norm.ppf(0.75)  # four robust standard deviations [declared sigmas]


def opposed(places: np.ndarray, directions: np.ndarray, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every place twice, shifted by `size` along a direction and against it: no force, no moment."""
    shift = size[:, None] * directions
    return np.concatenate([places, places]), np.concatenate([places + shift, places - shift])


@pytest.mark.parametrize(("share", "used"), [(INSIDE, True), (OUTSIDE, False)])
def test_poses_leave_out_what_is_beyond_the_robust_sigmas(share, used):
    sigma, n = 1e-6, 30
    rng = np.random.default_rng(6)
    places = rng.uniform(-1e-3, 1e-3, (n, 3))
    directions = np.eye(3)[np.arange(n) % 3]
    size = np.full(n, SPREAD)
    size[0] = share * LIMIT
    # Two frames that both show every place ± its shift, the other way round in the second: the best poses
    # and places leave each point its whole shift as the residual, in either frame.
    X, x = opposed(places, directions, np.sqrt(3.0) * sigma * size)
    W = np.broadcast_to(np.eye(3) / sigma**2, (2, 2 * n, 3, 3)).copy()
    ones = np.ones((2, 2 * n), dtype=bool)
    observed = Observations(np.stack([x, 2.0 * X - x]), W, ones, ~ones, np.ones(ones.shape))
    found = adjust(observed, MotionPrior(None, None), reject=4.0)
    assert found.count.tolist() == [2 * n if used else 2 * n - 2] * 2


@pytest.mark.parametrize(("share", "used"), [(INSIDE, True), (OUTSIDE, False)])
def test_a_cylinder_leaves_out_what_is_beyond_four_robust_sigmas(share, used):
    sigma, radius, n = 1e-6, 5e-3, 30
    rng = np.random.default_rng(7)
    angle, y = rng.uniform(-1.2, 1.2, n), rng.uniform(-3e-3, 3e-3, n)
    normals = np.stack([np.sin(angle), np.zeros(n), np.cos(angle)], axis=1)
    size = np.full(n, SPREAD)
    size[0] = share * LIMIT
    _, X = opposed(radius * normals + y[:, None] * [0.0, 1.0, 0.0], normals, sigma * size)
    found = fit_cylinder(X, np.broadcast_to(sigma**2 * np.eye(3), (2 * n, 3, 3)))
    assert found.radius == pytest.approx(radius, abs=1e-9)
    assert found.used[[0, n]].tolist() == [used, used]
    assert np.delete(found.used, [0, n]).all()


def test_points_off_the_flyers_motion_are_judged_by_the_median_length():
    # 41 residuals of 2 px, one of them changed: five robust standard deviations are 5 · 2 / √(2 ln 2) px.
    sigma, limit = 0.5, 5.0 * 2.0 / rayleigh.median()
    angle = 2.0 * np.pi * np.arange(40) / 40
    ring = 2.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    off = np.concatenate([ring, [[INSIDE * limit, 0.0], [-OUTSIDE * limit, 0.0]]])
    noise = np.broadcast_to(sigma**2 * np.eye(2), (42, 2, 2))
    points = ObservedPoints(None, np.zeros(42, dtype=int), None, None, None, noise)
    assert points.inliers(off).tolist() == [True] * 41 + [False]


def test_the_place_at_rest_keeps_the_noise_of_its_reference():
    # Half of a match's variance is its own frame's, which a mean of n frames divides by n.
    for n in (1, 4, 12):
        assert _of_mean(np.full(n, 3e-6)) == pytest.approx(3e-6 * np.sqrt(0.5 + 0.5 / n), rel=1e-12)


@pytest.mark.parametrize(
    ("sigma", "limit"), [(1e-6, 0.01 * 5e-3), (20e-6, 80e-6)], ids=["one per cent", "four sigmas"]
)
def test_another_radius_is_remarked_on_beyond_both_limits(sigma, limit):
    for share, remarks in ((INSIDE, 0), (OUTSIDE, 1), (-INSIDE, 0), (-OUTSIDE, 1)):
        placement = SimpleNamespace(radius=5e-3 + share * limit, radius_sigma=sigma)
        assert len(of_radius(placement, 5e-3)) == remarks


# --- strips of a body that are narrower than a subset -----------------------------------------------------


@pytest.mark.parametrize(
    ("rows", "share"), [(16, 0.75 * 16 / 29), (19, 0.75 * 19 / 29), (20, 0.5), (29, 0.5), (120, 0.5)]
)
def test_of_a_strip_the_pictures_must_show_three_quarters_of_what_it_holds(rows: int, share: float) -> None:
    """A subset of 29 px in the middle of a strip of 16 rows holds 16 of its 29; half is asked for at most."""
    mask = np.zeros((160, 192), dtype=bool)
    mask[:rows] = True
    points = np.array([[96.0, min(0.5 * rows - 0.5, 60.0)], [96.0, 2.0]])
    assert least_in_strip(mask, points, Correlation(subset=29)) == pytest.approx(share)


SPEED, FRAME, STATIC = 2.5, 1e-5, 6


def travel(n: int = 40) -> AxialDisplacement:
    """At rest for six frames, set in motion within three, then 25 µm a frame."""
    t = FRAME * np.arange(n)
    since = np.maximum(t - FRAME * (STATIC - 1), 0.0)
    ramp = 3.0 * FRAME
    d = SPEED * np.where(since < ramp, since**2 / (2.0 * ramp), since - 0.5 * ramp)
    return AxialDisplacement(t, np.arange(n), d, np.full(n, 1e-7), np.full(n, 9), 1e-7)


def test_a_flyer_that_starts_and_goes_on_has_even_steps():
    assert uneven_steps(travel()).size == 0
    steady = travel()
    half = np.delete(np.arange(40), [20, 21])  # frames that are left out change no speed
    kept = AxialDisplacement(
        *(getattr(steady, name)[half] for name in ("t", "frame", "displacement", "sigma", "n_points")), 1e-7
    )
    assert uneven_steps(kept).size == 0


@pytest.mark.parametrize("share", [0.0, 0.6, 1.4, 2.0])
def test_a_doubled_and_a_missing_frame_are_named(share):
    """From frame 25 on the places are those of one frame earlier, or later."""
    right = travel()
    shifted = right.displacement.copy()
    shifted[25:] += (share - 1.0) * SPEED * FRAME
    assert uneven_steps(replace(right, displacement=shifted)).tolist() == [25]
    little = right.displacement.copy()
    little[25:] += 0.3 * SPEED * FRAME  # less than a third of a step: the flyer may do that
    assert uneven_steps(replace(right, displacement=little)).size == 0


def specimen(share: float) -> SimpleNamespace:
    """A hundred points, of which ten move `share` times as far as the flyer, the others half as far."""
    part = np.where(np.arange(100) < 10, share, 0.5)
    u = np.zeros((40, 100, 3))
    u[..., 1] = -part * travel().displacement[:, None]
    return SimpleNamespace(surface=SimpleNamespace(u=u, outcome=np.zeros((40, 100), dtype=int)))


@pytest.mark.parametrize(("share", "said"), [(0.8, 0), (1.04, 0), (1.06, 1), (1.4, 1)])
def test_no_point_of_the_specimen_outruns_the_flyer(share, said):
    """Ten of a hundred points, more than a twentieth, move `share` times as far as the flyer."""
    assert fastest_share(travel(), specimen(share)) == pytest.approx(share)
    assert len(of_travel(travel(), specimen(share))) == said


@pytest.mark.parametrize(("sigmas", "said"), [(4.9, 0), (5.1, 1), (-5.1, 1)])
def test_a_rim_off_the_specimens_end_is_said(sigmas, said):
    axial = replace(travel(), rim_disagreement=(sigmas * 5e-6, 5e-6))
    assert [r.name for r in of_travel(axial, specimen(1.0))] == ["flyer off the specimen's end"] * said
    assert of_travel(None, specimen(1.0)) == []


SHAPE, STEP = (96, 80), 2.3
PATTERN = speckle_pattern((260, 80), seed=4)


def picture(k: int, seed: int = 0) -> np.ndarray:
    """Speckles that come down by `STEP` a frame."""
    moved = render(PATTERN, SHAPE, material=lambda x: x + np.array([0.0, 120.0 - STEP * k]))
    return (
        np.round(moved + np.random.default_rng(100 * seed + k).normal(0.0, 1.0, SHAPE))
        .clip(0, 255)
        .astype(np.uint8)
    )


def series(frames) -> SimpleNamespace:
    return SimpleNamespace(
        shape=SHAPE, bits=8, path=Path("memory"), n_frames=len(frames), frame=lambda k: frames[k]
    )


REGION = Region(corners=((5.0, 30.0), (74.0, 30.0), (74.0, 80.0), (5.0, 80.0)), frame=9)


def test_a_region_is_carried_with_what_it_shows():
    frames = [picture(k) for k in range(10)]
    health = np.zeros(10, dtype=np.int64)
    found = carry_region(series(frames), health, REGION, 4, direction=(0.0, -1.0))
    assert found.frame == 4
    shift = np.asarray(found.corners) - np.asarray(REGION.corners)
    np.testing.assert_allclose(shift, np.tile([0.0, -5 * STEP], (4, 1)), atol=0.5)  # whole pixels
    other = [*frames[:4], *(picture(k, 7)[:, ::-1] for k in range(4, 9)), frames[9]]
    assert carry_region(series(other), health, REGION, 4, direction=(0.0, -1.0)) is None
    health[9] = FrameOutcome.UNREADABLE
    assert carry_region(series(frames), health, REGION, 4, direction=(0.0, -1.0)) is None


def test_a_region_is_used_in_another_frame_with_proof_only():
    frames = [picture(k) for k in range(10)]
    first, second = np.zeros(10, dtype=np.int64), np.zeros(10, dtype=np.int64)
    second[5:] = FrameOutcome.UNREADABLE
    inputs = SimpleNamespace(
        pictures=(series(frames), series(frames)),
        health=(first, second),
        static=np.arange(10) < 2,
        settings=SimpleNamespace(direction=(0.0, -1.0)),
    )
    assert usable_region(inputs, REGION, "flyer").frame == 4
    at_rest = replace(REGION, frame=1)
    assert usable_region(inputs, at_rest, "specimen") is at_rest
    second[1] = FrameOutcome.BLACK  # it rests in frame 0 as well
    assert usable_region(inputs, at_rest, "specimen") is at_rest
    first[9] = FrameOutcome.BLACK
    with pytest.raises(
        ChainError, match=r"frame 9, of which a camera has no usable picture.*declare it in frame 4"
    ):
        usable_region(inputs, REGION, "flyer")


def test_a_picture_that_is_the_one_before_is_not_used():
    frames = [picture(k) for k in range(24)]
    frames[13] = frames[12]
    outcome = frame_health(series(frames)).outcome
    assert np.flatnonzero(outcome == FrameOutcome.REPEATED).tolist() == [13]
    assert (np.delete(outcome, 13) == FrameOutcome.VALID).all()
    # computed pictures without noise are alike wherever nothing moves
    still = [frames[0]] * 12 + frames[:12]
    assert (frame_health(series(still)).outcome == FrameOutcome.VALID).all()
