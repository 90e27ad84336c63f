"""A process that is told later what to work on; camera 1 followed by one."""

import os
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from speckle_pictures import render, speckle_pattern

from dic.basics import FloatArray
from dic.bodies import follow
from dic.bodies import follow as second_camera
from dic.bodies.follow import MatchedBody, track_body
from dic.correlation import Correlation, Noise
from dic.images.series import PicturesInMemory
from dic.outcome import FrameOutcome, PointOutcome
from dic.processes import allow_forks, can_fork, may_fork, worker_process
from dic.tracking import Tracking

pytestmark = pytest.mark.skipif(not can_fork(), reason="one core, or no copies of processes here")


def test_a_process_works_on_what_it_is_told_later() -> None:
    began: list[str] = []

    def work(take: Any) -> tuple[int, list[Any], int]:
        return os.getpid(), [take(), take()], len(began)

    with worker_process(work, lambda told: (os.getpid(), told, -1)) as process:
        began.append("here only")
        process.tell(np.arange(100_000))  # more than a pipe holds
        process.tell("two")
        pid, (first, second), there = process.result()
        assert process.result() is process.result()
    assert pid != os.getpid()
    np.testing.assert_array_equal(first, np.arange(100_000))
    assert (second, there) == ("two", 0)


@pytest.mark.parametrize("end", ["at once", "by an error"])
def test_what_the_process_does_not_deliver_is_done_here(end: str) -> None:
    here = os.getpid()

    def work(take: Any) -> str:
        assert os.getpid() != here
        os._exit(1) if end == "at once" else take()
        raise RuntimeError

    with worker_process(work, lambda told: f"{told} by {os.getpid()}") as process:
        process.tell("one")
        process.tell("two")
        assert process.result() == f"['one', 'two'] by {here}"


def bodies() -> tuple[tuple[PicturesInMemory, PicturesInMemory], list[MatchedBody]]:
    """A body that moves by a pixel a frame before two cameras, its points where they are in both, and the
    same as a rigid one."""
    shape, n = (90, 90), 5

    def camera(own: int) -> PicturesInMemory:
        pattern, frames = speckle_pattern(shape, size=4.0, seed=3), []
        for k in range(n):
            move = np.array([0.3 * own, k * 1.0])

            def moved(p: FloatArray, move: FloatArray = move) -> FloatArray:
                return p - move

            grey = render(pattern, shape, material=moved, noise=1.0, seed=10 * own + k)
            frames.append(np.rint(1000.0 + 100.0 * grey).astype(np.uint16))
        return PicturesInMemory(tuple(frames))

    series = camera(0), camera(1)
    y, x = np.mgrid[25:61:9, 25:61:9]
    points = np.stack([x.ravel(), y.ravel()], axis=1).astype(float)
    m = len(points)
    warp = np.zeros((m, 12))
    warp[:, 0] = 0.3
    valid = np.ones(m, dtype=bool)
    valid[3] = False
    match: Any = SimpleNamespace(
        warp=warp,
        covariance=np.full((m, 2, 2), 1e-4) * np.eye(2),
        valid=valid,
        zncc=np.ones(m),
        outcome=np.where(valid, int(PointOutcome.VALID), int(PointOutcome.STEREO_MISMATCH)),
    )
    health = np.full(n, int(FrameOutcome.VALID))
    made = [
        MatchedBody(
            series, points, np.zeros((m, 2), dtype=np.int64), np.ones(shape, dtype=bool), 0, match,
            Tracking(correlation=Correlation(subset=15)), (Noise(100.0), Noise(100.0)), (health, health),
            rigid, "cpu", name,
        )
        for name, rigid in (("specimen", False), ("flyer", True))
    ]  # fmt: skip
    return series, made


def followed(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Tracks of camera 1 by a process of its own, as where a GPU matches."""
    monkeypatch.setattr(second_camera, "started", lambda: False)
    opened: list[str] = []
    monkeypatch.setattr(second_camera, "open_device", opened.append)
    series, made = bodies()
    with allow_forks(), second_camera.second_camera(series, "cuda") as second:
        assert second is not None
        assert second.can_follow(made)
        tracks = second.follow(made)()
        assert not second.can_follow(made)  # once
    assert not opened  # there, not here
    return tracks


def test_tracks_of_the_process_have_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    _, made = bodies()
    for track, body in zip(followed(monkeypatch), made, strict=True):
        alone = track_body(body, 1)
        assert (alone.outcome == int(PointOutcome.VALID)).mean() > 0.9
        for name, value in vars(alone).items():
            np.testing.assert_array_equal(getattr(track, name), value, err_msg=name)


def test_the_process_is_there_for_a_gpu_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    series: Any = bodies()[0]
    monkeypatch.setattr(second_camera, "started", lambda: False)
    with allow_forks(), second_camera.second_camera(series, "cpu") as second:
        assert second is None
    with second_camera.second_camera(series, "cuda") as second:  # no forks here
        assert second is None
    monkeypatch.setattr(second_camera, "started", lambda: True)
    with allow_forks(), second_camera.second_camera(series, "cuda") as second:
        assert second is None


def test_a_process_with_other_pictures_follows_nothing() -> None:
    series, made = bodies()
    other = second_camera.SecondCamera((series[0], series[1]), None)  # type: ignore[arg-type]
    assert not other.can_follow(made)
    assert second_camera.SecondCamera(series, None).can_follow(made)  # type: ignore[arg-type]


@pytest.mark.parametrize("fits", [True, False])
def test_bodies_are_followed_by_the_process_where_what_it_sends_is_small(
    monkeypatch: pytest.MonkeyPatch, fits: bool
) -> None:
    monkeypatch.setattr(follow, "track_body", lambda body, camera, told: (body.name, camera))
    monkeypatch.setattr(follow, "_common_of", lambda body, stereo, tracks: None)
    monkeypatch.setattr(follow, "reconstruct", lambda rig, *tracks, common: tracks)
    monkeypatch.setattr(follow, "_tracked", lambda body, tracks, made, common: tracks)
    size = follow.MOST_SENT + (not fits)
    body: Any = SimpleNamespace(name="flyer", size=size, device="cuda:0", health=(np.zeros(3), np.zeros(3)))
    second: Any = SimpleNamespace(
        can_follow=lambda bodies: True, follow=lambda bodies: lambda: [("flyer", "1 there")]
    )
    found = follow.follow_bodies([body], None, None, second=second)  # type: ignore[arg-type]
    assert found == [(("flyer", 0), ("flyer", "1 there" if fits else 1))]


def test_forks_are_allowed_within_forking() -> None:
    assert not may_fork()
    with allow_forks():
        assert may_fork()
    assert not may_fork()
