"""What is done together gives what was done one by one: cameras in two processes, places of a rigid body in
one launch, masks that stay on a device."""

import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from speckle_pictures import render, speckle_pattern

from dic.bodies import follow
from dic.calibration import solve
from dic.calibration.bundle import SHARED_PARAMETERS
from dic.correlation import Correlation
from dic.correlation.kernels import launch
from dic.correlation.kernels.device import select_device
from dic.images.series import PicturesInMemory
from dic.outcome import FrameOutcome, PointOutcome
from dic.processes import allow_forks, can_fork
from dic.tracking import rigid

sharing = pytest.mark.skipif(not can_fork(), reason="one core, or no copies of processes here")


def processes(monkeypatch, *sizes, device="cpu"):
    """Processes that follow camera 0 and camera 1 of bodies with so many points times frames, and what is
    told of the progress."""
    monkeypatch.setattr(follow, "track_body", lambda body, camera, told: (body.name, camera, os.getpid()))
    monkeypatch.setattr(follow, "_common_of", lambda body, stereo, tracks: len(body.name))
    monkeypatch.setattr(follow, "reconstruct", lambda rig, *tracks, common: (tracks, common))

    def tracked(body, tracks, made, common):
        assert made == (tracks, common)
        return tracks

    monkeypatch.setattr(follow, "_tracked", tracked)
    bodies = [
        SimpleNamespace(name=f"body {k}", size=size, device=device, health=(np.zeros(9), np.zeros(9)))
        for k, size in enumerate(sizes)
    ]
    told = []
    with allow_forks():
        found = follow.follow_bodies(bodies, None, None, progress=lambda *said: told.append(said))
    assert [[track[:2] for track in tracks] for tracks in found] == [
        [(f"body {k}", 0), (f"body {k}", 1)] for k in range(len(sizes))
    ]
    assert told == [(f"body {k}, camera 1", 9, 9) for k in range(len(sizes))]
    return [{track[2] for track in column} for column in zip(*found, strict=True)]


@sharing
def test_cameras_are_followed_by_two_processes_where_what_they_send_is_small(monkeypatch):
    here, there = processes(monkeypatch, 1000, follow.MOST_SENT - 1000)
    assert here == {os.getpid()}
    assert len(there) == 1
    assert there != here
    assert processes(monkeypatch, 1000, follow.MOST_SENT) == [here, here]
    assert processes(monkeypatch, 1000, device="cuda:0") == [here, here]


def rigid_series():
    """A body that rests, jumps by 5 px along y, moves on as fast, and is gone; points and motion [px]."""
    shape = (110, 100)
    pattern = speckle_pattern(shape, size=4.0, seed=3)
    moves = np.array([[0.0, 0.0], [0.1, 0.2], [0.1, 5.2], [0.1, 10.3]])
    frames = [
        render(pattern, shape, material=lambda p, move=move: p - move, noise=1.0, seed=k)
        for k, move in enumerate(moves)
    ]
    frames.append(render(speckle_pattern(shape, size=4.0, seed=9), shape, noise=1.0, seed=9))
    y, x = np.mgrid[20:81:12, 20:81:12]
    return np.stack(frames), np.stack([x.ravel(), y.ravel()], axis=1).astype(float), moves


def followed(monkeypatch, together):
    frames, points, _ = rigid_series()
    launches = []
    matched = rigid.correlate
    monkeypatch.setattr(rigid, "MOST_TOGETHER", together)
    monkeypatch.setattr(rigid, "correlate", lambda *a, **k: launches.append(len(a[2])) or matched(*a, **k))
    series = PicturesInMemory(tuple(np.rint(50.0 * frames + 500.0).astype(np.uint16)))
    found = rigid.track_rigid(
        series, points, Correlation(subset=15, least_zncc=0.8), noise=50.0,
        frame_outcome=np.full(len(frames), int(FrameOutcome.VALID)),
    )  # fmt: skip
    monkeypatch.setattr(rigid, "correlate", matched)
    return found, launches


def test_places_tried_together_are_those_tried_one_by_one(monkeypatch):
    (together, few), (alone, many) = (followed(monkeypatch, most) for most in (4096, 1))
    for name in ("warp", "covariance", "zncc", "outcome"):
        np.testing.assert_array_equal(getattr(together, name), getattr(alone, name), err_msg=name)
    _, points, moves = rigid_series()
    valid = together.outcome == int(PointOutcome.VALID)
    assert (
        valid[:4].mean(axis=1).min() > 0.9
    )  # the first place from which half of the points are found serves
    assert not valid[4].any()
    off = np.where(valid[:4, :, None], together.warp[:4, :, :2] - moves[:, None], 0.0)
    assert (
        np.abs(off).max() < 0.05
    )  # a subset of 15 px with 1 grey level of noise: some hundredths of a pixel
    # one launch where the prediction holds, one more for all other places where it does not
    assert set(few) == {len(points), 12 * len(points)}
    assert len(few) <= 2 * 4
    assert len(few) < len(many)


def test_a_mask_is_sent_once_and_again_when_it_has_changed():
    device = select_device("cpu")
    mask = np.zeros((6, 5), dtype=np.uint8)
    mask[2:, 1:4] = 1
    first = launch.mask_on_device(mask, device)
    assert launch.mask_on_device(mask.copy(), device) is first
    np.testing.assert_array_equal(first.numpy(), mask.reshape(-1))
    mask[0, 0] = 1
    other = launch.mask_on_device(mask, device)
    assert other is not first
    assert first.numpy()[0] == 0
    assert other.numpy()[0] == 1
    turned = launch.mask_on_device(np.ascontiguousarray(mask.reshape(5, 6)), device)
    assert isinstance(turned, wp.array)
    for k in range(2 * launch.MOST_MASKS):
        launch.mask_on_device(np.full((3, 3 + k), 1, dtype=np.uint8), device)
    assert len(launch._masks) == launch.MOST_MASKS


def test_held_out_residuals_are_pooled_and_unknown_where_a_part_cannot_be_solved(monkeypatch):
    views = [SimpleNamespace(pair=pair, camera=camera) for pair in range(5) for camera in (0, 1)]
    fit = SimpleNamespace(rig=None)
    monkeypatch.setattr(solve, "adjust", lambda rig, kept, *a, **k: SimpleNamespace(rig=len(kept)))
    # pair k has k + 1 residuals of length k in each camera
    monkeypatch.setattr(solve, "residuals", lambda rig, view: np.full((view.pair + 1, 1), float(view.pair)))
    found = solve.cross_validation_error(fit, views, np.zeros((SHARED_PARAMETERS, 0)), 3)
    squares, count = sum(k**2 * (k + 1) for k in range(5)), sum(k + 1 for k in range(5))
    assert found == pytest.approx(np.sqrt(squares / count), rel=1e-12)

    def refused(rig, kept, *a, **k):
        if len(kept) > 2 and not any(view.pair == 2 for view in kept):
            raise ValueError("too little")
        return SimpleNamespace(rig=rig)

    monkeypatch.setattr(solve, "adjust", refused)
    assert np.isnan(solve.cross_validation_error(fit, views, np.zeros((SHARED_PARAMETERS, 0)), 3))


def agreed(n, move):
    """A match in which the first n of ten points moved by so much along y, the others were not found."""
    found = rigid._out_of_view(np.zeros((10, 12)))
    found.outcome[:] = int(PointOutcome.LOW_CORRELATION)
    found.outcome[:n] = int(PointOutcome.VALID)
    found.warp[:n, 1] = move
    found.covariance[:] = 1e-4 * np.eye(2)
    return found


def test_of_a_pair_of_places_the_one_that_more_points_agree_on_counts(monkeypatch):
    nothing = np.full((1, 10, 12), np.nan)
    asked = []

    def matches(stack, here, points, root, moves, *rest):
        asked.append(len(moves))
        if len(moves) == 1:
            return [agreed(4, 1.0)]  # fewer than half: go on
        return [agreed(*of) for of in ((6, 2.0), (8, 3.0), *((10, 9.0),) * 10)]

    monkeypatch.setattr(rigid, "_matches", matches)
    found = rigid.Track(
        np.zeros((10, 2)), nothing.copy(), np.zeros((1, 10, 2, 2)), nothing[..., 0].copy(),
        np.zeros((1, 10), dtype=np.int64), np.zeros((1, 10), dtype=np.int64),
    )  # fmt: skip
    root, zero = np.zeros((10, 12)), np.zeros((10, 2, 2))
    move = rigid._step(found, 0, None, None, root[:, :2], root, zero, None, None, None, np.zeros(2), 1.0)
    # the first pair of places serves, of it that with more points, and no later one counts
    np.testing.assert_array_equal(move, [0.0, 3.0])
    assert np.sum(found.outcome[0] == int(PointOutcome.VALID)) == 8
    assert asked == [1, 12]


def test_a_rigid_body_is_not_taken_for_one_that_looks_three_quarters_like_it():
    """Two bodies with printed dots on one lattice, and a quarter of their variance their own."""
    shape = (90, 90)
    y, x = np.mgrid[0.0:90.0, 0.0:90.0]

    def painted(own, move):
        at = x - move[0], y - move[1]
        dots = np.sin(2.0 * np.pi * at[0] / 9.0) * np.sin(2.0 * np.pi * at[1] / 9.0)
        spots = render(own, shape, material=lambda p: p - np.asarray(move), noise=0.0, seed=0)
        spots = (spots - spots.mean()) / spots.std()
        grey = 120.0 + 40.0 * (0.75**0.5 * dots / dots.std() + 0.5 * spots)
        return np.random.default_rng(int(10 * move[1])).normal(grey, 1.0)

    first, other = (speckle_pattern(shape, size=4.0, seed=seed) for seed in (3, 9))
    moves = [(0.0, 0.0), (0.1, 0.2), (0.1, 0.5), (0.1, 0.9), (0.1, 1.3)]
    frames = [painted(first if k < 4 else other, move) for k, move in enumerate(moves)]
    series = SimpleNamespace(
        path=Path("made"), n_frames=5, shape=shape, bits=8, crop_offset=(0.0, 0.0), times=None,
        frame=lambda k: frames[k],
    )  # fmt: skip
    points = np.stack(np.meshgrid(np.arange(20.0, 71.0, 10.0), np.arange(20.0, 71.0, 10.0)), axis=-1)
    found = rigid.track_rigid(
        series, points.reshape(-1, 2), Correlation(subset=15), noise=1.0,
        frame_outcome=np.full(5, int(FrameOutcome.VALID)),
    )  # fmt: skip
    valid = found.outcome == int(PointOutcome.VALID)
    assert valid[:4].mean(axis=1).min() > 0.9
    assert not valid[4].any()
    assert np.median(found.zncc[4]) > 0.7  # the match itself would let it through


def test_how_unlike_itself_a_rigid_body_may_look():
    assert rigid.most_unlike([]) == 1.0  # nothing is known yet: as the match has it
    assert rigid.most_unlike([0.002, 0.003, 0.001]) == 0.1
    assert rigid.most_unlike([0.02, 0.05, 0.03]) == pytest.approx(6.0 * 0.03)
