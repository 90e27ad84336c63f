"""Threads that join a launch: who may, who waits for whom, what is raised, and the bits of a run."""

import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import explicit
from explicit import drivers
from explicit.device import select_device
from explicit.materials import neo_hookean
from explicit.simd import team
from explicit.simd.team import ELEMENTS_EACH, FINISHED, MOST_SEATS, SharedRun

END = 6e-4
MANY = ELEMENTS_EACH * MOST_SEATS


class Launches:
    """Launches that note their threads; the first thread's waits until the others have come."""

    def __init__(self, others: int = 0, error: Exception | None = None, early: bool = False) -> None:
        self.others, self.error, self.early = others, error, early
        self.seats: list[int] = []

    def begin(self) -> Any:
        if self.early and self.error:
            raise self.error
        return self.launch

    def launch(self, team: Any) -> None:
        self.seats.append(team.seat)
        if team.seat == 0:
            while len(self.seats) <= self.others:
                time.sleep(1e-4)
            if self.error:
                raise self.error
        else:  # as the time loop does
            while not team.words.numpy()[FINISHED]:
                time.sleep(1e-4)


@pytest.mark.parametrize(
    ("n_elements", "threads", "seats"),
    [
        (MANY, 1, 1),
        (MANY, 2, 2),
        (2 * ELEMENTS_EACH - 1, 5, 1),
        (2 * ELEMENTS_EACH, 5, 2),
        (10 * MANY, 99, MOST_SEATS),
        (0, 9, 1),
    ],
)
def test_as_many_join_as_have_work(n_elements: int, threads: int, seats: int) -> None:
    run = SharedRun(Launches().begin, 3, n_elements, select_device("cpu"))
    assert len(run.offer(threads)) == seats - 1
    assert run.run() == 3


def test_who_joins_has_a_seat_of_its_own_and_leaves_with_the_run() -> None:
    launches = Launches(others=3)
    run = SharedRun(launches.begin, 1, MANY, select_device("cpu"))
    with ThreadPoolExecutor(3) as pool:
        joined = [pool.submit(one) for one in run.offer(4)]
        assert run.run() == 1
        for future in joined:
            future.result(timeout=10.0)
    assert sorted(launches.seats) == [0, 1, 2, 3]


@pytest.mark.parametrize("early", [True, False], ids=["before", "within"])
def test_an_error_reaches_who_runs_and_sends_the_others_away(early: bool) -> None:
    launches = Launches(others=0 if early else 2, error=ValueError("no room"), early=early)
    run = SharedRun(launches.begin, 1, MANY, select_device("cpu"))
    with ThreadPoolExecutor(2) as pool:
        joined = [pool.submit(one) for one in run.offer(3)]
        with pytest.raises(ValueError, match="no room"):
            run.run()
        for future in joined:
            future.result(timeout=10.0)
    assert sorted(launches.seats) == ([] if early else [0, 1, 2])


def test_who_comes_after_the_end_leaves_at_once() -> None:
    launches = Launches()
    run = SharedRun(launches.begin, 1, MANY, select_device("cpu"))
    (late,) = run.offer(2)
    run.run()
    late()
    assert launches.seats == [0, 1]


def test_the_last_launches_are_joined_one_after_the_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of five launches on three threads the last two can be at work while a thread is idle."""
    offered = []

    class Watched(SharedRun):
        def offer(self, threads: int) -> Any:
            offered.append(self.count)
            return super().offer(threads)

    runs = [Watched(Launches().begin, k, MANY, select_device("cpu")) for k in range(5)]
    counts: list[int] = []
    drivers._work(runs, 3, counts.append)
    assert offered == [4, 3]
    assert sorted(counts) == [0, 1, 2, 3, 4]
    offered.clear()
    drivers._work(runs[:1], 1, None)
    assert offered == []


def model(contact: str) -> explicit.Model:
    motion = explicit.PlatenMotion.sampled(
        lambda t: 3.0 * t**2 / END, lambda t: 6.0 * t / END, start=0.0, end=END, n_knots=65
    )
    mesh = explicit.cylinder(4.75e-3, 6.5e-3, n_radial=6, n_axial=9)
    return explicit.Model(mesh, 870.0, (neo_hookean(27e3),), (motion,), faces=contact, side=contact)


@pytest.mark.parametrize("contact", ["bonded", "coulomb"])
def test_a_run_has_the_same_bits_on_any_threads(contact: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One run, and five of which the last are joined; simulations of a mesh that counts as large."""
    monkeypatch.setattr(team, "ELEMENTS_EACH", 8)
    times = np.linspace(0.0, END, 25)
    sampling = explicit.Sampling(times, times, ledger_every=3)
    for n in (1, 5):
        samples = explicit.Samples.of(
            stiffness_factor=np.linspace(0.8, 1.2, n), friction=0.3, poisson=0.499, damping=2e-5
        )
        one, *others = (
            explicit.run(model(contact), samples, sampling, threads=threads) for threads in (1, 2, 3)
        )
        assert (one.steps > 50).all()
        assert one.completed.all()
        for other in others:
            for name in ("force_flyer", "impulse_transmission", "surface_r", "steps", "smallest_step"):
                np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
            for name, value in vars(one.energy).items():
                np.testing.assert_array_equal(value, getattr(other.energy, name), err_msg=name)
