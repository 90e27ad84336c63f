"""Frames prepared in blocks ahead, and points searched in parts, are those done one by one."""

from functools import partial

import numpy as np
import pytest
from speckle_pictures import render, speckle_pattern

from dic import tracking
from dic.correlation import Correlation, PictureStack, Shape, Templates, correlate
from dic.correlation.kernels import launch
from dic.correlation.kernels import launch as transfer
from dic.correlation.kernels.device import select_device
from dic.images import PictureError
from dic.images.series import PicturesInMemory
from dic.outcome import FrameOutcome
from dic.tracking import inputs, track
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
    return (
        np.rint(np.stack(moved)).astype(np.uint8),
        np.stack([x.ravel(), y.ravel()], axis=1).astype(float),
    )


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
        launch,
        "in_parts",
        lambda columns, n, where, go: real_parts(columns, n, device, go, most=most),
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
