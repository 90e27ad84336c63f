"""Workers of this machine: each has a number, by which they share out its GPUs."""

import os
import time

import pytest

import explicit.device
from dic.correlation.kernels import device as dic_device
from kolsky.base.process import WORKER, process_pool


def number(pause: float) -> tuple[int, str]:
    time.sleep(pause)
    return os.getpid(), os.environ[WORKER]


def test_every_worker_has_a_number_of_its_own() -> None:
    with process_pool(2) as pool:
        found = dict(pool.map(number, [0.2] * 6))
    assert sorted(found.values()) == [str(n) for n in range(len(found))]


@pytest.mark.parametrize("rooms", [explicit.device, dic_device])
def test_processes_take_gpus_one_after_the_other(rooms, monkeypatch: pytest.MonkeyPatch) -> None:
    assert rooms.WORKER == WORKER
    taken = []
    for worker in range(5):
        monkeypatch.setenv(WORKER, str(worker))
        taken.append(rooms.own_gpu(2))
    assert taken == [0, 1, 0, 1, 0]
    monkeypatch.delenv(WORKER)
    assert rooms.own_gpu(4) == 0
    assert rooms.own_gpu(0) == 0  # no GPU at all: "cuda:0" is refused by its name
