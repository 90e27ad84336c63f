"""A design run in chunks, here or through any executor, with a ledger that survives the process.

The workers know nothing of the ledger: the parent gives out chunks, takes results back and records each
chunk as it comes. A function must give every point the same numbers whatever else is in its chunk.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from doe.arrays import FloatArray
from doe.ledger import Ledger
from doe.ledger_rows import Run

ChunkFunction = Callable[[FloatArray], Sequence[Run]]
"""Takes points, shape [n, d], and returns what became of each, length n."""
ExecutorFactory = Callable[[], AbstractContextManager[Executor]]
"""Makes an executor; called again where one broke."""

AHEAD = 64
"""Most chunks handed to an executor at once: enough for its workers, few enough to hold in memory."""


@dataclass(frozen=True)
class Pace:
    """Progress of a sweep and its speed."""

    done: int
    """Runs finished, those found in the ledger included."""
    total: int
    """Runs of the design."""
    rate: float
    """Runs a second since the start, those found in the ledger not counted; 0 before the first chunk."""

    @property
    def seconds_left(self) -> float:
        """Time left at this rate [s]; infinite before the first chunk, 0 at the end."""
        left = self.total - self.done
        return left / self.rate if self.rate > 0.0 else (np.inf if left else 0.0)


def shard(n: int, i: int, of: int) -> NDArray[np.intp]:
    """Rows of a design of n points that shard i of `of` runs: i - 1, i - 1 + of, i - 1 + 2 of, ...

    Raises
    ------
    ValueError
        If i is not in [1, of], or there are more shards than points.
    """
    if not 1 <= i <= of:
        raise ValueError(f"shard {i}/{of} does not exist; the first number must be in [1, {of}]")
    if of > n:
        raise ValueError(f"{of} shards of {n} points leave some of them empty; take at most {n}")
    return np.arange(i - 1, n, of)


def run_chunks(
    function: ChunkFunction,
    points: ArrayLike,
    *,
    chunk: int,
    ledger: Ledger | None = None,
    executor: ExecutorFactory | None = None,
    retry: bool = False,
    attempts: int = 3,
    progress: Callable[[Pace], None] | None = None,
) -> list[Run]:
    """Run a function over points, chunk by chunk, and nothing that the ledger holds already.

    Parameters
    ----------
    function
        The work. With processes or hosts it must be picklable.
    points
        Parameter values, shape [n, d]; a point that occurs twice is run once.
    chunk
        Most points handed over at once.
    ledger
        Where runs are found and each chunk is recorded, by this process only.
    executor
        Makes the executor that chunks go through; in this process if left out.
    retry
        Run again what the ledger holds as not completed.
    attempts
        How often in a row an executor may break without a chunk having come back. What was under way is
        handed to a new one.
    progress
        Called once at the start and after each chunk.

    Returns
    -------
    list
        One run a point, in their order.

    Raises
    ------
    RuntimeError
        If executors broke `attempts` times in a row.
    ValueError
        If `points` is not of shape [n, d], `chunk` or `attempts` is below 1, or the function did not
        return one run a point.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2:
        raise ValueError(f"points must have shape [n, d], got {list(points.shape)}")
    if chunk < 1 or attempts < 1:
        raise ValueError(f"chunk and attempts must be at least 1, got {chunk} and {attempts}")
    distinct, places = np.unique(points + 0.0, axis=0, return_inverse=True)
    # In the order in which they were asked for: a sweep that is cut short has done its first points.
    order = np.unique(places.ravel(), return_index=True)[1].argsort()
    runs: list[Run | None] = ledger.find(distinct) if ledger else [None] * len(distinct)
    todo = [row for row in order if (run := runs[row]) is None or (retry and not run.completed)]
    finished = len(distinct) - len(todo)
    started, fresh = time.monotonic(), 0

    def report() -> None:
        if progress is not None:
            elapsed = time.monotonic() - started
            progress(Pace(finished + fresh, len(distinct), fresh / elapsed if fresh and elapsed else 0.0))

    def keep(rows: Sequence[int], back: Sequence[Run]) -> None:
        nonlocal fresh
        if ledger is not None:
            ledger.record(distinct[rows], back)
        for row, run in zip(rows, back, strict=True):
            runs[row] = run
        fresh += len(rows)
        report()

    report()
    chunks = [todo[i : i + chunk] for i in range(0, len(todo), chunk)]
    if executor is None:
        for rows in chunks:
            keep(rows, _timed(function, distinct[rows]))
    elif chunks:
        _through(executor, function, distinct, chunks, keep, attempts)
    return [run for place in places.ravel() if (run := runs[place]) is not None]


def _timed(function: ChunkFunction, points: FloatArray) -> list[Run]:
    """The chunk's runs, each with its share of the time; runs where the work is done."""
    started = time.monotonic()
    runs = list(function(points))
    if len(runs) != len(points):
        raise ValueError(f"the function returned {len(runs)} runs for {len(points)} points")
    share = (time.monotonic() - started) / len(points)
    return [replace(run, seconds=share) for run in runs]


def _through(
    factory: ExecutorFactory,
    function: ChunkFunction,
    points: FloatArray,
    chunks: list[list[int]],
    keep: Callable[[Sequence[int], Sequence[Run]], None],
    attempts: int,
) -> None:
    """Chunks through executors until all are back; those of one that broke go to the next."""
    waiting, broken = list(reversed(chunks)), 0
    while waiting:
        flying: dict[Future[list[Run]], list[int]] = {}
        try:
            with factory() as pool:
                while waiting or flying:
                    while waiting and len(flying) < AHEAD:
                        rows = waiting[-1]
                        flying[pool.submit(_timed, function, points[rows])] = rows
                        waiting.pop()  # only now: a broken executor refuses it
                    for future in wait(flying, return_when=FIRST_COMPLETED).done:
                        back: Any = future.result()
                        keep(flying.pop(future), back)
                        broken = 0
        except BrokenExecutor as error:
            broken += 1
            if broken >= attempts:
                raise RuntimeError(
                    f"workers died {broken} times in a row with no chunk finished: {error}; run with smaller "
                    "chunks, more memory or fewer workers. What had finished is kept"
                ) from error
            for future, rows in reversed(flying.items()):
                if future.done() and not future.cancelled() and future.exception() is None:
                    keep(rows, future.result())
                else:
                    waiting.append(rows)
