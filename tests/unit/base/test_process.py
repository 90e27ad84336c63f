"""Workers of this machine: their numbers divide the GPUs among them."""

import gc
import os
import subprocess
import sys

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import explicit.device
from dic.correlation.kernels import device as dic_device
from kolsky.base import process
from kolsky.base.process import (
    BLAS_THREADS,
    GC_THRESHOLD_OF_COMMAND,
    WORKER,
    infrequent_gc,
    keep_freed_memory,
    last_work,
    one_blas_thread,
    process_pool,
)
from kolsky.pictures import shared_errors
from kolsky.pictures.shared_errors import error_patterns


def test_every_worker_has_a_number_of_its_own() -> None:
    # As text: a function of this file would have each process import what the file does.
    number = (
        f"(__import__('time').sleep(0.2), __import__('os').getpid(), __import__('os').environ[{WORKER!r}])"
    )
    with process_pool(2) as pool:
        found = {worker: name for _, worker, name in pool.map(eval, [number] * 6)}
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


def blas_threads() -> list[int]:
    import numpy as np

    np.linalg.svd(np.eye(2))
    return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]


def test_blas_has_one_thread_inside_and_the_old_number_afterwards() -> None:
    with threadpool_limits(limits=2, user_api="blas"):
        with one_blas_thread():
            assert set(blas_threads()) == {1}
        assert set(blas_threads()) == {2}


def test_an_identification_works_on_one_blas_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    from kolsky import identification
    from kolsky.inverse import problem

    seen: list[int] = []

    def prepare(shot: object) -> None:
        seen.extend(blas_threads())
        raise ValueError("enough")

    monkeypatch.setattr(problem, "prepare_shot", prepare)
    monkeypatch.setattr(problem, "with_pull", lambda shot, pull: shot)
    with threadpool_limits(limits=2, user_api="blas"), pytest.raises(ValueError, match="enough"):
        identification.identify(None)  # type: ignore[arg-type]
    assert set(seen) == {1}


def test_commands_start_before_blas_with_one_thread_unless_told_otherwise() -> None:
    program = (
        "import os, sys\nsys.argv = ['kolsky', '--version']\nfrom kolsky.cli import commandline\n"
        "assert 'numpy' not in sys.modules\n"
        "try:\n    commandline.main()\nexcept SystemExit:\n    pass\n"
        "print(*(os.environ[name] for name in ('OPENBLAS_NUM_THREADS', 'MKL_NUM_THREADS')))\n"
    )
    plain = {name: value for name, value in os.environ.items() if name not in BLAS_THREADS}
    for told, wanted in (({}, "1 1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3 1")):
        said = subprocess.run(
            [sys.executable, "-c", program], env={**plain, **told}, capture_output=True, text=True, check=True
        )
        assert said.stdout.splitlines()[-1] == wanted


def test_what_a_command_leaves_is_not_searched_for_cycles_at_its_end() -> None:
    before, within = gc.get_threshold(), []

    @last_work()
    def command() -> None:
        within.append(gc.get_threshold())
        with infrequent_gc():
            within.append(gc.get_threshold())
        raise SystemExit(2)

    try:
        with pytest.raises(SystemExit):
            command()
        assert gc.get_freeze_count() > 0
        assert gc.get_count()[0] < before[0]  # so that the old threshold begins no search at once
    finally:
        gc.unfreeze()
    assert within[0] == (GC_THRESHOLD_OF_COMMAND, *before[1:])
    assert within[1][0] > within[0][0]
    assert gc.get_threshold() == before


def test_less_frequent_searches_are_not_made_more_frequent_within() -> None:
    with infrequent_gc(), infrequent_gc(GC_THRESHOLD_OF_COMMAND):
        assert gc.get_threshold()[0] == process.GC_THRESHOLD


def test_freed_memory_is_kept_where_the_library_can(monkeypatch: pytest.MonkeyPatch) -> None:
    set_: dict[int, int] = {}

    class Library:
        def mallopt(self, number: int, value: int) -> int:
            set_[number] = value
            return 1

    monkeypatch.setattr(process.sys, "platform", "linux")
    monkeypatch.setattr(process.ctypes, "CDLL", lambda name: Library())
    keep_freed_memory()
    # M_TRIM_THRESHOLD, M_TOP_PAD and M_MMAP_THRESHOLD of malloc.h; glibc refuses more than 32 MB of the last
    assert set_ == {-1: 256 * 2**20, -2: 16 * 2**20, -3: 32 * 2**20}
    monkeypatch.setattr(process.ctypes, "CDLL", lambda name: object())  # one without mallopt
    keep_freed_memory()


TIME = np.repeat(1e-5 * np.arange(12), 9)
PLACE = np.tile(np.linspace(0.0, 6e-3, 9), 12)


def test_patterns_add_up_to_the_covariance(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shared_errors, "PATTERN_VARIANCE", 1.0)
    monkeypatch.setattr(shared_errors, "MOST_PATTERNS", 10_000)
    found, left = error_patterns(TIME, PLACE, sigma=2e-6, memory=4e-5, length=3e-3)
    # nodes of 0.75 mm are those of the places: nothing is interpolated
    dt, dy = np.abs(TIME[:, None] - TIME), PLACE[:, None] - PLACE
    expected = 4e-12 * np.exp(-dt / 4e-5) * np.exp(-((dy / 3e-3) ** 2))
    np.testing.assert_allclose(found.T @ found, expected, atol=1e-9 * 4e-12)
    assert left == pytest.approx(0.0, abs=1e-10)


def test_what_is_left_out_is_given_back() -> None:
    found, left = error_patterns(TIME, PLACE, sigma=2e-6, memory=4e-5, length=3e-3)
    assert len(found) < 40  # of 108
    np.testing.assert_allclose((found**2).sum(axis=0).mean() + left**2, 4e-12, rtol=1e-9)
    assert left**2 <= 0.05 * 4e-12 * 1.001


def test_refusals() -> None:
    with pytest.raises(ValueError, match="both must be > 0"):
        error_patterns(TIME, PLACE, sigma=1.0, memory=0.0, length=1.0)
    with pytest.raises(ValueError, match="0 data"):
        error_patterns(TIME[:0], PLACE[:0], sigma=1.0, memory=1.0, length=1.0)
