"""Chunks through processes and through Dask, workers killed in the middle: the same bits."""

import os
import signal
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import ledger_sweep
import numpy as np
import pytest
from dask_processes import dask_processes

from doe.ledger import Ledger, Pace, Run, run_chunks

POINTS = ledger_sweep.POINTS[:400]


def mortal(marker: Path, points: np.ndarray) -> list[Run]:
    """The oscillator, in a worker that dies once."""
    if np.any(np.all(points == POINTS[150], axis=1)) and not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return ledger_sweep.oscillator(points)


def hopeless(points: np.ndarray) -> list[Run]:
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def slow(points: np.ndarray) -> list[Run]:
    time.sleep(0.02)
    return ledger_sweep.oscillator(points)


def processes() -> ProcessPoolExecutor:
    # Not forked: this process has threads, and what they hold would be held in the child for ever.
    return ProcessPoolExecutor(2, mp_context=get_context("spawn"))


def assert_same_bits(runs: list[Run]) -> None:
    plain = run_chunks(ledger_sweep.oscillator, POINTS, chunk=len(POINTS))
    assert [run.outcome for run in runs] == [run.outcome for run in plain]
    assert [run.results.tobytes() for run in runs] == [run.results.tobytes() for run in plain]


def test_chunks_through_threads_are_recorded_by_the_parent(tmp_path: Path) -> None:
    with Ledger(tmp_path / "l.sqlite", ledger_sweep.MODEL) as book:
        runs = run_chunks(
            ledger_sweep.oscillator, POINTS, chunk=7, ledger=book, executor=partial(ThreadPoolExecutor, 3)
        )
        assert len(book) == 400
    assert_same_bits(runs)


def test_a_process_that_dies_has_its_chunk_run_again(tmp_path: Path) -> None:
    marker = tmp_path / "died"
    with Ledger(tmp_path / "l.sqlite", ledger_sweep.MODEL) as book:
        runs = run_chunks(partial(mortal, marker), POINTS, chunk=20, ledger=book, executor=processes)
        assert len(book) == 400
    assert marker.exists()
    assert_same_bits(runs)


def test_workers_that_always_die_end_the_sweep() -> None:
    with pytest.raises(RuntimeError, match="workers died 2 times in a row with no chunk finished"):
        run_chunks(hopeless, POINTS[:4], chunk=2, executor=processes, attempts=2)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # Dask's own, of sockets that a killed worker left open
def test_a_dask_worker_killed_in_the_middle_changes_no_bit(tmp_path: Path) -> None:
    distributed: Any = pytest.importorskip("distributed", reason="needs the extra [cluster]")
    with (
        dask_processes(tmp_path, Path(__file__).parent) as (file, workers),
        distributed.Client(scheduler_file=file) as client,
    ):
        client.wait_for_workers(2, timeout=60)
        killed: list[int] = []

        def kill_one(pace: Pace) -> None:
            if pace.done >= 100 and not killed:
                killed.append(pace.done)
                workers[0].send_signal(signal.SIGKILL)

        with Ledger(tmp_path / "l.sqlite", ledger_sweep.MODEL) as book:
            runs = run_chunks(
                slow, POINTS, chunk=10, ledger=book, executor=client.get_executor, progress=kill_one
            )
            assert len(book) == 400
        assert 100 <= killed[0] < 400
        assert workers[0].wait(10) == -signal.SIGKILL
        assert_same_bits(runs)
