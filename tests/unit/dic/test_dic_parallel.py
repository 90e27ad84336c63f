"""Frames prepared in blocks and points searched in parts give the same results as one by one."""

import os
import threading
import time
from dataclasses import make_dataclass
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from speckle_pictures import render, speckle_pattern

from dic import tracking
from dic.bodies import follow
from dic.calibration import solve
from dic.calibration.bundle import SHARED_PARAMETERS
from dic.correlation import Correlation, Noise, PictureStack, Shape, Templates, correlate
from dic.correlation.kernels import launch
from dic.correlation.kernels import launch as transfer
from dic.correlation.kernels.device import select_device
from dic.correlation.subsets import identity
from dic.images import PictureError
from dic.images.series import PicturesInMemory
from dic.outcome import FrameOutcome, PointOutcome
from dic.processes import allow_forks, background, background_pool, can_fork, run_parallel
from dic.tracking import Tracking, View, inputs, rigid, track, track_together
from dic.tracking.rigid import track_rigid

SIDE = 90


def frames(n=7):
    """Pictures of a pattern that moves on by a third of a pixel each, and 25 points [px]."""
    pattern = speckle_pattern((SIDE, SIDE), size=4.0, seed=3)
    moved = [
        render(pattern, (SIDE, SIDE), material=lambda p, k=k: p - 0.3 * k, noise=1.0, seed=k)
        for k in range(n)
    ]
    y, x = np.mgrid[20:71:12, 20:71:12]
    return (np.rint(np.stack(moved)).astype(np.uint8), np.stack([x.ravel(), y.ravel()], axis=1).astype(float))


class Damaged(PicturesInMemory):
    """A series of which frame 3 cannot be read."""

    def frame(self, index):
        if index == 3:
            raise PictureError(self.path, "damaged")
        return super().frame(index)


def same(a, b, names):
    for name in names:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


NAMES = ("warp", "covariance", "zncc", "outcome", "reference", "frame_outcome")


@pytest.mark.parametrize("blocks", [1, 2 * 4 * SIDE * SIDE, 2**30])
@pytest.mark.parametrize("first", [0, 4])
def test_a_track_with_blocks_ahead_is_that_of_single_frames(monkeypatch, blocks, first):
    pictures, points = frames()
    series = Damaged(tuple(pictures))
    read = []
    take = inputs.read
    monkeypatch.setattr(inputs, "read", lambda series, k: read.append(k) or take(series, k))
    plain = track(series, points, noise=1.0, first=first)
    assert len(read) == len(set(read)) == 7
    read.clear()
    monkeypatch.setattr(tracking, "FramesAhead", partial(inputs.FramesAhead, together=blocks))
    found = track(series, points, noise=1.0, first=first)
    same(found, plain, NAMES)
    assert len(read) == len(set(read)) == 7  # each is decoded once
    assert found.frame_outcome[3] == FrameOutcome.UNREADABLE
    assert np.mean(found.outcome[[k for k in range(7) if k != 3]] == 0) > 0.9


@pytest.mark.parametrize("cut", [0, 6])
def test_two_cameras_tracked_together_are_each_tracked_as_alone(monkeypatch, cut):
    """One camera misses frame 3 and the other frame 5; noise, points and start differ, then the size too."""
    monkeypatch.setattr(tracking, "QUORUM", 0.2)
    monkeypatch.setattr(tracking.frame_match, "TRIES", 1)
    monkeypatch.setattr(tracking.frame_match, "EVERY", 2)
    _, points = frames()
    pattern, square = speckle_pattern((SIDE, SIDE), size=4.0, seed=3), (SIDE, SIDE)
    pictures = np.stack(
        [
            render(pattern, square, material=lambda p, k=k: p * (1.0, 1.0 + 0.02 * k), noise=1.0, seed=k)
            for k in range(7)
        ]
    )
    usable = np.full(7, int(FrameOutcome.VALID))
    usable[5] = int(FrameOutcome.BLACK)
    noisy = pictures[::-1, : SIDE - cut].astype(float)
    noisy[3] += np.random.default_rng(1).normal(0.0, 40.0, noisy[3].shape)  # loses points, then finds them
    start, covariance = identity(20), np.tile(1e-4 * np.eye(2), (20, 1, 1))
    views = [
        View(Damaged(tuple(pictures)), points, 1.0),
        View(PicturesInMemory(tuple(noisy)), points[:20], Noise(2.0, 0.1), start, covariance, usable),
    ]
    settings = Tracking(update_stretch=1.02, return_every=2)
    found = track_together(views, settings, first=2)
    for one, view in zip(found, views, strict=True):
        alone = track(settings=settings, first=2, **vars(view))
        same(one, alone, (*NAMES, "excess"))
        assert (one.root is None) == (view.start is not None)
        assert len(np.unique(one.reference[one.outcome == 0])) >= 2  # points changed their references
    assert (found[1].outcome[3] != 0).any()  # the noisy picture


def test_a_rigid_track_with_blocks_ahead_is_that_of_single_frames(monkeypatch):
    from dic.tracking import rigid

    pictures, points = frames()
    series = Damaged(tuple(pictures))
    usable = np.full(7, int(FrameOutcome.VALID))
    usable[5] = int(FrameOutcome.BLACK)
    run = partial(
        track_rigid, series, points, Correlation(subset=15), noise=1.0, first=2, frame_outcome=usable
    )
    plain = run()
    monkeypatch.setattr(rigid, "FramesAhead", partial(inputs.FramesAhead, together=3 * 4 * SIDE * SIDE))
    same(run(), plain, NAMES)
    assert np.mean(plain.outcome[[0, 1, 2, 4, 6]] == 0) > 0.9


def test_a_frame_of_another_size_is_refused_when_it_is_asked_for_and_not_before():
    pictures, _ = frames(4)
    odd = [*pictures[:2], pictures[2][:-4], pictures[3]]
    some = inputs.FramesAhead(odd, noise=1.0, prefilter=0.0, device="cpu", together=2**20)
    some.expect(range(4))
    try:
        for k, shape in enumerate([(SIDE, SIDE), (SIDE, SIDE), (SIDE - 4, SIDE), (SIDE, SIDE)]):
            assert some.prepared(k, some.read(k)).shape == shape
    finally:
        some.close()


def batch(points, pictures):
    stack = PictureStack.prepare(pictures, noise=1.0)
    guess = np.zeros((len(points), 12))
    guess[:, :2] = 0.3 * np.arange(len(points))[:, None] / len(points)
    return stack, guess


@pytest.mark.parametrize("referred", [False, True])
@pytest.mark.parametrize("most", [1000, 10, 4, 1])
def test_points_in_parts_are_found_as_together(monkeypatch, most, referred):
    """The way to a GPU and back, on a CPU: what is sent and what comes back lands where it belongs."""
    pictures, points = frames(3)
    stack, guess = batch(points, pictures)
    points = np.concatenate([points, [[-50.0, 10.0]]])  # one that is nowhere in view
    guess = np.concatenate([guess, guess[:1]])
    picture = np.arange(len(points)) % 3
    mask = np.ones((SIDE, SIDE), dtype=bool)
    mask[:, :24] = False
    settings = Correlation(subset=15, shape=Shape.AFFINE)
    options = {"reference_picture": 0, "deformed_picture": picture, "mask": mask}
    if referred:
        options["reference_warp"] = guess
    plain = correlate(stack, stack, points, guess, settings, **options)
    device, parts = select_device("cpu"), []

    def searched(kernel, job, lane, n):
        parts.append(n)
        job.points, job.given, job.found = n, lane.given.ptr, lane.found.ptr
        launch._launch_on_host(kernel, job, n, device, 1)

    class Everywhere:
        is_cuda = True

        def __getattr__(self, name):
            return getattr(device, name)

    real_parts = launch.in_parts
    monkeypatch.setattr(launch, "_launch_on_device", searched)
    monkeypatch.setattr(
        launch, "in_parts", lambda columns, n, where, go: real_parts(columns, n, device, go, most=most)
    )
    real = launch.select_device
    monkeypatch.setattr(
        launch, "select_device", lambda name: Everywhere() if name == stack.device else real(name)
    )
    monkeypatch.setattr(launch, "mask_on_device", lambda mask, where: real_mask(mask, device))
    found = correlate(stack, stack, points, guess, settings, **options)
    same(found, plain, ("warp", "covariance", "zncc", "iterations", "outcome"))
    assert found.iterations.dtype == found.outcome.dtype == np.int64
    assert sum(parts) == len(points)
    assert max(parts) <= most
    assert len(parts) == -(-len(points) // most)
    assert (found.outcome == 0).sum() > 15


real_mask = launch.mask_on_device


def test_a_call_does_not_depend_on_the_one_before(monkeypatch):
    """What does not change from call to call is set up once, all else in each."""
    pictures, points = frames(3)
    stack, guess = batch(points, pictures)
    mask = np.ones((SIDE, SIDE), dtype=bool)
    mask[:, :24] = False
    settings = Correlation(subset=15)
    calls = [
        {"deformed_picture": 1},
        {
            "deformed_picture": 2,
            "mask": mask,
            "reference_warp": guess,
            "templates": Templates.of(25, settings),
        },
        {"deformed_picture": 1},
    ]
    monkeypatch.setattr(launch, "_jobs", launch._Jobs())
    together = [correlate(stack, stack, points, guess, settings, **options) for options in calls]
    assert len(launch._jobs.known) == 1
    for found, options in zip(together, calls, strict=True):
        monkeypatch.setattr(launch, "_jobs", launch._Jobs())
        if "templates" in options:
            options = {**options, "templates": None}
        alone = correlate(stack, stack, points, guess, settings, **options)
        same(found, alone, ("warp", "covariance", "zncc", "iterations", "outcome"))
    assert (together[1].outcome != 0).sum() > (together[0].outcome != 0).sum()
    for k in range(2 * launch.MOST_JOBS):
        correlate(stack, stack, points[:1], guess[:1], Correlation(subset=15, tolerance=1e-3 + 1e-5 * k))
    assert len(launch._jobs.known) == launch.MOST_JOBS


def test_the_search_of_every_shape_is_loaded_ahead():
    launch.load_kernel.cache_clear()
    launch.load_kernels("cpu")
    loaded = launch.load_kernel.cache_info().misses
    pictures, points = frames(2)
    stack, guess = batch(points, pictures)
    for shape in Shape:
        correlate(stack, stack, points, guess, Correlation(subset=15, shape=shape), deformed_picture=1)
    assert launch.load_kernel.cache_info().misses == loaded == len(Shape)
    with pytest.raises(ValueError, match="device must be one of"):
        launch.load_kernels("abacus")


def test_a_part_after_an_error_does_not_end_up_in_the_next_call():
    device = select_device("cpu")
    columns = [np.arange(6.0)]

    def failed(lane, n):
        raise RuntimeError("no memory")

    with pytest.raises(RuntimeError, match="no memory"):
        transfer.in_parts(columns, 6, device, failed, most=2)

    def numbered(lane, n):
        lane.found.numpy()[: 19 * n] = np.concatenate(
            [np.repeat(lane.given.numpy()[:n], 12), np.zeros(4 * n), lane.given.numpy()[:n], np.zeros(2 * n)]
        )

    found = transfer.in_parts(columns, 6, device, numbered, most=2)
    np.testing.assert_array_equal(found.zncc, np.arange(6.0))
    np.testing.assert_array_equal(found.warp, np.arange(6.0)[:, None] * np.ones(12))


def test_no_points_are_no_part(monkeypatch):
    monkeypatch.setattr(transfer, "_lane_pool", transfer._LanePool())
    none = transfer.in_parts([np.zeros(0)], 0, select_device("cpu"), lambda lane, n: pytest.fail("launched"))
    assert none.warp.shape == (0, 12)


sharing = pytest.mark.skipif(not can_fork(), reason="one core, or no copies of processes here")


def processes(monkeypatch, *sizes, device="cpu"):
    """Processes that follow bodies with so many points times frames, and what is told of the progress."""
    monkeypatch.setattr(follow, "_follow", lambda body, *_: (body.name, f"{os.getpid()} {body.device}"))
    body = make_dataclass("Body", ("name", "size", "device", "health"))
    health = (np.zeros(9), np.zeros(9))
    bodies, told = [body(f"body {k}", size, device, health) for k, size in enumerate(sizes)], []
    with allow_forks():
        found = follow.follow_bodies(bodies, None, None, progress=lambda *said: told.append(said))
    assert [name for name, _ in found] == [f"body {k}" for k in range(len(sizes))]
    assert told == [(f"body {k}", 9, 9) for k in range(1, len(sizes))]
    return [process for _, process in found]


@sharing
def test_other_bodies_are_followed_by_another_process_where_what_it_sends_is_small(monkeypatch):
    here, there, same = processes(monkeypatch, 10**9, 1000, follow.MOST_SENT - 1000)
    assert here == f"{os.getpid()} cpu"
    assert same == there != here
    assert processes(monkeypatch, 1, 1000, follow.MOST_SENT) == [here] * 3
    on_gpu, on_cpu = processes(monkeypatch, 1, 1000, device="cuda:0")  # a fork cannot use a GPU
    assert on_gpu == f"{os.getpid()} cuda:0"
    assert on_cpu.endswith(" cpu")
    assert on_cpu != here


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


def test_a_body_lost_for_some_frames_is_searched_in_some_of_them(monkeypatch):
    """Tried in two frames, then in every third one after the last success, which is here in frame 7."""
    monkeypatch.setattr(rigid, "TRIES", 2)
    monkeypatch.setattr(rigid, "EVERY", 3)
    searched = []

    def step(result, frame, *rest):
        searched.append(len(rest[-1]) > 0)
        result.outcome[frame, 0] = int(PointOutcome.VALID)
        return np.zeros(2) if frame == 7 else None

    monkeypatch.setattr(rigid, "_step", step)
    frames = tuple(np.random.default_rng(1).integers(0, 4000, (12, 40, 40)).astype(np.uint16))
    rigid.track_rigid(
        PicturesInMemory(frames), np.array([[20.0, 20.0]]), Correlation(subset=15), noise=1.0,
        frame_outcome=np.full(12, int(FrameOutcome.VALID)),
    )  # fmt: skip
    assert searched == [True, True, False, True, False, False, True, True, True, False, True]


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
    move = rigid._step(
        found, 0, None, None, root[:, :2], root, zero, None, None, None, np.zeros(2), 1.0, rigid.SEARCHED
    )  # fmt: skip
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


def number(k: int) -> str:
    return f"{k} " + "x" * 100_000


def who(wait: float = 0.05, done: Path | None = None) -> int:
    time.sleep(wait)
    if done:
        done.touch()
    return os.getpid()


@pytest.mark.parametrize("processes", [None, 1, 2])
def test_every_work_once_and_in_order(processes: int | None) -> None:
    works = [partial(number, k) for k in range(7)]
    assert run_parallel(works, processes=processes) == [work() for work in works]
    with allow_forks():
        assert run_parallel(works, processes=processes) == [work() for work in works]


@sharing
def test_both_processes_work() -> None:
    assert len(set(run_parallel([who] * 12, processes=2))) == 2
    with allow_forks():
        assert len(set(run_parallel([who] * 12))) > 1


@sharing
def test_begun_work_goes_on_while_this_process_does_something_else(tmp_path: Path) -> None:
    here, works = os.getpid(), [partial(who, 0.01, tmp_path / str(k)) for k in range(12)]
    with allow_forks(), background_pool(works) as joined:
        until = time.monotonic() + 60.0
        while len(list(tmp_path.iterdir())) < 12 and time.monotonic() < until:
            time.sleep(0.01)
        assert here not in joined()
    with background_pool(works) as joined:  # threads begin when this process joins in
        assert joined() == [here] * 12
    told: list[tuple[int, int]] = []
    with allow_forks(), background_pool(works) as joined:
        assert len(joined(lambda done, total: told.append((done, total)))) == 12
    assert told[-1] == (12, 12)


def test_forks_are_made_where_they_are_allowed_only() -> None:
    assert set(run_parallel([who] * 4)) == {os.getpid()}
    with background(who) as later:
        assert later() == os.getpid()
    with allow_forks(), background(who, fork=False) as later:
        assert later() == os.getpid()

    def from_a_thread() -> None:
        with background(who) as later:
            seen.append(later())

    seen: list[int] = []
    with allow_forks():
        thread = threading.Thread(target=from_a_thread)
        thread.start()
        thread.join()
    assert seen == [os.getpid()]


@sharing
def test_work_beside_runs_in_a_fork_that_makes_none_itself() -> None:
    def twice() -> tuple[int, int]:
        with background(who) as own:
            return os.getpid(), own()

    with allow_forks(), background(twice) as later:
        assert later() is later()
        fork, within = later()
    assert fork != os.getpid()
    assert within == fork


@sharing
def test_what_a_fork_fails_at_is_done_here() -> None:
    here = os.getpid()

    def only_here(end: object = None) -> str:
        if os.getpid() != here:
            os._exit(1) if end else (_ for _ in ()).throw(RuntimeError("no"))
        time.sleep(0.02)
        return "done"

    assert run_parallel([only_here] * 6, processes=2) == ["done"] * 6
    for end in (None, "at once"):
        with allow_forks(), background(partial(only_here, end)) as later:
            assert later() == "done"


class Sent:
    """Cannot be read where it is sent to."""

    def __reduce__(self) -> tuple[object, ...]:
        return int, ("no number",)


@sharing
def test_what_cannot_be_sent_is_done_here() -> None:
    for made in (Sent, lambda: lambda: 0):
        with allow_forks(), background(made) as later:
            assert later() is not None


@pytest.mark.parametrize("processes", [None, 2])
def test_what_fails_here_too_is_told(processes: int | None) -> None:
    def never() -> str:
        raise ValueError("cannot be drawn")

    with pytest.raises(ValueError, match="cannot be drawn"):
        run_parallel([never] * 4, processes=processes)
    with allow_forks(), pytest.raises(ValueError, match="cannot be drawn"), background(never) as later:
        later()


@sharing
def test_work_that_nobody_waits_for_ends_with_the_block() -> None:
    started = time.perf_counter()
    with allow_forks(), background(partial(time.sleep, 30.0)):
        pass
    assert time.perf_counter() - started < 10.0  # far less than the sleep, on a busy machine too


@sharing
def test_progress_counts_up_to_the_number_of_works() -> None:
    for processes in (None, 2):
        told: list[tuple[int, int]] = []
        run_parallel([who] * 5, processes=processes, progress=lambda *done, told=told: told.append(done))
        assert told == sorted(told)
        assert told[-1] == (5, 5)


@sharing
def test_a_picture_error_is_sent_as_it_is() -> None:
    error = PictureError(Path("a.tif"), "is cut off", frame=3, cure="export it again")

    def made() -> tuple[PictureError, int]:
        return error, os.getpid()

    with allow_forks(), background(made) as later:
        found, where = later()
    assert where != os.getpid()  # sent, not made here
    assert (str(found), vars(found)) == (str(error), vars(error))
