"""Rigid motions, and bodies whose points come into view, compared with known motions."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from stereo_scene import turned_pair

from dic import FrameOutcome, PointOutcome
from dic.bodies.body_motion import BodyMotion, body_motion
from dic.stereo.reconstruction import NONE, Reconstruction, demeaned, reconstruct, shared_error
from dic.surfaces.cylinder import SpecimenFrame
from dic.tracking.inputs import Track

SIDE, FACE, SCALE = 7.5e-3, 6.5e-3, 1.0 / 18e3
"""Radius of a flyer, height of its face at rest [m], metres a pixel."""
NOISE = np.array([0.6e-6, 0.6e-6, 4e-6])
FRAMES, STATIC, TOP = 60, 6, FACE + 20 * SCALE
"""Frames, frames at rest, the height at which the cameras' view ends."""
AT = np.array([0.0, FACE, 0.0])


def side(columns=12, rows=30, step=5.0):
    """Points on the flyer's side above its face, shape [n, 3]."""
    x = (np.arange(columns) - 0.5 * (columns - 1)) * step * SCALE
    y = FACE + (1.0 + step * np.arange(rows)) * SCALE
    x, y = (a.ravel() for a in np.meshgrid(x, y))
    return np.stack([x, y, np.sqrt(SIDE**2 - x**2)], axis=-1)


def motion(tilting):
    """Displacements of the face's centre and rotation vectors, rest first; 45 px at the end."""
    s = np.maximum(np.arange(FRAMES) - STATIC, 0) / (FRAMES - STATIC)
    u = np.stack([2e-4 * tilting * s**2, -45.0 * SCALE * s, 1e-4 * tilting * s**2], axis=-1)
    return u, 0.02 * tilting * np.outer(np.sin(2.0 * s) ** 2, [1.0, 0.2, -0.7])


def places(X, u, r):
    R = Rotation.from_rotvec(r).as_matrix()
    return np.einsum("kab,ib->kia", R, X - AT) + AT + u[:, None]


def seen(x, noise, seen_where, rng):
    """A reconstruction: half of the variance of each point is the same in all frames."""
    common, own = rng.standard_normal(x.shape[1:]), rng.standard_normal(x.shape)
    outcome = np.where(seen_where, PointOutcome.VALID, PointOutcome.OUT_OF_VIEW).astype(np.int64)
    position = np.where(seen_where[..., None], x + noise * np.sqrt(0.5) * (common + own), np.nan)
    C = np.broadcast_to(np.diag(noise**2), (*seen_where.shape, 3, 3))
    nowhere = np.full((*seen_where.shape, 2), np.nan)
    return Reconstruction(position, C, np.zeros(seen_where.shape), (nowhere, nowhere), outcome)


FRAME = SpecimenFrame(np.eye(3), np.zeros(3), np.zeros((6, 6)))


@pytest.mark.parametrize("tilting", [0.0, 1.0])
def test_a_body_that_rides_into_view_has_calibrated_sigmas_in_all_frames(tilting):
    rng = np.random.default_rng(3)
    X = side()
    u, r = motion(tilting)
    x = places(X, u, r)
    view = x[..., 1] < TOP
    assert view[0].sum() < 60 < 130 < view[-1].sum()  # of 360 points, some never come into view
    true = np.concatenate([r - r[:STATIC].mean(axis=0), u - u[:STATIC].mean(axis=0)], axis=1)
    ratio = []
    for _ in range(6):
        found = body_motion([seen(x, NOISE, view, rng)], FRAME, at=AT, rest_frames=range(STATIC))
        error = np.concatenate([found.rotation, found.displacement], axis=1) - true
        ratio.append(error / np.concatenate([found.rotation_sigma, found.displacement_sigma], axis=1))
        assert found.chi2_per_dof == pytest.approx(1.0, abs=0.05)  # 12 000 dof: 1.3 %
        assert (found.outcome == FrameOutcome.VALID).all()
        y, C = found.along([0.0, 1.0, 0.0])
        np.testing.assert_allclose(np.sqrt(np.diag(C)), found.displacement_sigma[:, 1])
        np.testing.assert_allclose(y, found.displacement[:, 1])
        assert np.linalg.eigvalsh(C)[0] > -1e-6 * np.trace(C)  # semidefinite: the rest frames have mean zero
    spread = np.std(ratio, axis=(0, 1))
    # 6 draws of 60 frames whose errors hang together through the points: some 15 independent each,
    # 90 values, standard deviation 7.5 %.
    assert spread == pytest.approx(np.ones(6), abs=0.25)


def test_points_of_a_second_picture_join_the_body_and_false_ones_leave_it():
    rng = np.random.default_rng(4)
    u, r = motion(1.0)
    X = side()
    low = X[:, 1] < FACE + 18 * SCALE
    x = places(X, u, r)
    view = x[..., 1] < TOP
    first, second = seen(x[:, low], NOISE, view[:, low], rng), seen(x[:, ~low], NOISE, view[:, ~low], rng)
    first.outcome[30:] = PointOutcome.LOW_CORRELATION  # the first picture's points are lost half-way
    second.position[40:, 0] += 1e-4
    found = body_motion([first, second], FRAME, at=AT, rest_frames=range(STATIC))
    error = (found.displacement - u + u[:STATIC].mean(axis=0)) / found.displacement_sigma
    assert np.abs(error).max() < 4.5  # 180 values; 7e-6 each
    assert found.chi2_per_dof < 1.1
    alone = body_motion([first], FRAME, at=AT, rest_frames=range(STATIC))
    assert (alone.outcome[30:] == FrameOutcome.LOST).all()
    assert np.isnan(alone.displacement[30:]).all()
    assert (alone.n_points[30:] == 0).all()


def test_a_prior_of_small_turns_lends_attitude_to_narrow_views():
    rng = np.random.default_rng(5)
    u, r = motion(0.0)
    x = places(side(), u, r)
    data = seen(x, NOISE, x[..., 1] < TOP, rng)
    free = body_motion([data], FRAME, at=AT, rest_frames=range(STATIC))
    held = body_motion([data], FRAME, at=AT, rest_frames=range(STATIC), rotation_change=2e-5)
    assert held.displacement_sigma[:, 1].mean() < 0.5 * free.displacement_sigma[:, 1].mean()
    error = (held.displacement - u) / held.displacement_sigma
    assert np.abs(error).max() < 4.0  # the prior is true here: nothing turns


def test_what_one_camera_sees_carries_the_motion_through_frames_the_other_does_not():
    rng = np.random.default_rng(6)
    u, r = motion(0.0)
    x = places(side(), u, r)
    # the second sees 0.6 mm less of the flyer
    rig, spread = turned_pair(63.5, (70.0, 60.0)), 0.01
    tracks = []
    for camera in rig.cameras:
        pixels = camera.project(x) + spread * rng.standard_normal((*x.shape[:2], 2))
        points = pixels[-1]
        warp = np.zeros((*x.shape[:2], 12))
        warp[..., :2] = pixels - points
        outcome = np.where(pixels[..., 1] >= 0.0, PointOutcome.VALID, PointOutcome.OUT_OF_VIEW)
        C = np.broadcast_to(spread**2 * np.eye(2), (*x.shape[:2], 2, 2))
        number = np.zeros(outcome.shape, dtype=np.int64)
        health = np.zeros(FRAMES, dtype=np.int64)
        tracks.append(
            Track(points, warp, C, np.ones(outcome.shape), outcome.astype(np.int64), number, health)
        )
    both = reconstruct(rig, *tracks)
    rest = range(STATIC)
    assert not (both.outcome[: STATIC + 1] == PointOutcome.VALID).any()
    with pytest.raises(ValueError, match="none of the rest frames"):
        body_motion([both], FRAME, at=AT, rest_frames=rest, shared=0.0)
    found = body_motion(
        [both], FRAME, at=AT, rest_frames=rest, shared=0.0, rig=rig, tracks=[(tracks[0], tracks[1])],
        rotation_change=1e-5, lateral_change=1e-6,
    )  # fmt: skip
    assert (found.outcome == FrameOutcome.VALID).all()
    error = found.displacement - u
    assert np.abs(error / found.displacement_sigma).max() < 4.5  # 180 values
    # 0.01 px is 0.56 µm a point; the mean of a row of 12 is 0.16 µm, the attitude adds a few times that.
    assert np.abs(error[:, 1]).max() < 2e-6


def test_bodies_that_cannot_be_followed_are_refused():
    u, r = motion(0.0)
    x = places(side(), u, r)
    data = seen(x, NOISE, x[..., 1] < TOP, np.random.default_rng(0))
    nothing = seen(x, NOISE, np.zeros(x.shape[:2], dtype=bool), np.random.default_rng(0))
    for given, options, message in (
        ([], {}, "no points"),
        ([data], {"rest_frames": [FRAMES]}, "rest_frames must name frames"),
        ([data], {"shared": 1.0}, "shared must be"),
        ([data], {"rotation_change": 0.0}, "rotation_change"),
        ([data], {"at": [0.0, np.nan, 0.0]}, "at must be"),
        ([nothing], {}, "no frame sees"),
    ):
        with pytest.raises(ValueError, match=message):
            body_motion(given, FRAME, **({"at": AT, "rest_frames": range(STATIC)} | options))


def test_the_covariance_of_a_motion_is_that_of_the_frames_with_a_pose():
    """Four of twelve frames have a pose; a file of before holds all twelve."""
    rng = np.random.default_rng(4)
    posed, six = np.array([3, 5, 6, 10]), np.arange(6)
    root = rng.normal(size=(24, 24))
    small = (root @ root.T).reshape(4, 6, 4, 6)
    whole = np.full((12, 6, 12, 6), np.nan)
    whole[np.ix_(posed, six, posed, six)] = small
    outcome = np.full(12, int(FrameOutcome.LOST))
    outcome[posed] = int(FrameOutcome.VALID)
    u = np.full((12, 3), np.nan)
    u[posed] = rng.normal(size=(4, 3))
    motion = BodyMotion(np.zeros(3), u, u, whole, np.zeros(12, int), outcome, 1.0, 1.0)
    assert motion.covariance.nbytes == small.nbytes
    np.testing.assert_array_equal(motion.covariance, small)
    np.testing.assert_array_equal(motion.covariance_of(4, posed[1:3]), small[1:3, 4, 1:3, 4])
    unit = np.array([0.6, 0.8, 0.0])
    along, C = motion.along(unit)
    expected = np.einsum("a,kalb,b->kl", unit, small[:, 3:, :, 3:], unit)
    np.testing.assert_allclose(C[np.ix_(posed, posed)], expected, rtol=1e-12)
    assert np.isnan(C[0]).all()
    assert np.isnan(along[4])
    np.testing.assert_allclose(motion.displacement_sigma[6, 1], small[2, 4, 2, 4] ** 0.5)
    with pytest.raises(ValueError, match=r"frames \[4\] have no pose"):
        motion.covariance_of(0, np.array([3, 4]))


FloatArray = NDArray[np.float64]
SUBSET = 15
GRID = np.stack(np.meshgrid(np.arange(0.0, 180.0, 9.0), np.arange(0.0, 180.0, 9.0)), axis=-1).reshape(-1, 2)


def made(
    sigma: float, length: float, memory: float, *, own: float, n: int = 400, seed: int = 0
) -> FloatArray:
    """Distances of a shared error, an own one, and an offset of each place that all frames have."""
    rng = np.random.default_rng(seed)
    apart = np.linalg.norm(GRID[:, None] - GRID, axis=-1)
    root = np.linalg.cholesky(np.exp(-((apart / length) ** 2)) + 1e-6 * np.eye(len(GRID)))
    keep, state = np.exp(-1.0 / memory), root @ rng.standard_normal(len(GRID))
    found = np.empty((n, len(GRID)))
    for k in range(n):
        found[k] = state
        state = keep * state + np.sqrt(1.0 - keep**2) * (root @ rng.standard_normal(len(GRID)))
    return sigma * found + own * rng.standard_normal(found.shape) + 0.05 * rng.standard_normal(len(GRID))


@pytest.mark.parametrize("own", [0.0, 0.03])
def test_size_length_and_memory_are_found(own: float) -> None:
    distances = made(0.02, 45.0, 10.0, own=own)
    found = shared_error(distances, np.ones(distances.shape, dtype=bool), GRID, subset=SUBSET)
    # 400 frames of memory 10 are 20 independent ones of some 9 patches: 180 values know a standard deviation
    # to 5 %, a memory and a length to some 15 %; twice that
    assert found.sigma == pytest.approx(0.02, rel=0.12)
    assert found.length == pytest.approx(45.0, rel=0.3)
    assert found.memory == pytest.approx(10.0, rel=0.35)


def test_noise_of_the_points_alone_is_not_shared() -> None:
    rng = np.random.default_rng(1)
    distances = 0.02 * rng.standard_normal((200, len(GRID)))
    found = shared_error(distances, np.ones(distances.shape, dtype=bool), GRID, subset=SUBSET)
    assert found.sigma < 0.1 * 0.02


def test_points_that_are_lost_say_nothing() -> None:
    distances = made(0.02, 45.0, 10.0, own=0.01)
    valid = np.random.default_rng(2).random(distances.shape) > 0.3
    spoilt = np.where(valid, distances, np.nan)
    found = shared_error(spoilt, valid, GRID, subset=SUBSET)
    assert found.sigma == pytest.approx(0.02, rel=0.12)
    assert shared_error(spoilt[:, :5], valid[:, :5], GRID[:5], subset=SUBSET) is NONE
    assert shared_error(spoilt[:11], valid[:11], GRID, subset=SUBSET) is NONE


def test_what_the_mean_over_time_takes() -> None:
    """Two values of correlation r about their mean are -+ half their difference, of variance (1 - r) / 2."""
    r = np.exp(-1.0 / 3.0)
    np.testing.assert_allclose(demeaned(2, 3.0), [0.5 * (1.0 - r), -0.5 * (1.0 - r)])
    np.testing.assert_allclose(demeaned(5, 1e-3), [0.8, -0.2, -0.2, -0.2, -0.2])
    # Three values of correlations r and r²: with the means of the rows a, b, a and of all, the product of
    # neighbours is r - a - b + all
    a, b, whole = (1.0 + r + r**2) / 3.0, (1.0 + 2.0 * r) / 3.0, (3.0 + 4.0 * r + 2.0 * r**2) / 9.0
    np.testing.assert_allclose(demeaned(3, 3.0)[:2], [1.0 - whole, r - a - b + whole])


def test_a_short_record_has_all_of_the_error() -> None:
    """Eight records of eight memories each: their mean over time takes some 0.2 of the variance with it. 300
    independent values know the root mean square to 4 %."""
    records = [made(0.02, 45.0, 10.0, own=0.01, n=80, seed=seed) for seed in range(8)]
    sigmas = [shared_error(one, np.ones(one.shape, dtype=bool), GRID, subset=SUBSET).sigma for one in records]
    assert np.sqrt(np.mean(np.square(sigmas))) == pytest.approx(0.02, rel=0.07)


def test_what_ends_within_a_subset_is_not_continued_to_no_distance() -> None:
    """Errors over 7 px: at a subset's 15 px 1 % of their variance is left, and no more is said of them."""
    distances = made(0.02, 7.0, 10.0, own=0.0)
    found = shared_error(distances, np.ones(distances.shape, dtype=bool), GRID, subset=SUBSET)
    assert found.sigma < 0.4 * 0.02
