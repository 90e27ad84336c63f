"""Runs of a design in chunks, in this process or through any executor, recorded in a ledger on disk.

Workers do not access the ledger. The parent sends chunks, receives results, and records each chunk on arrival
in one SQLite table. A run's key is the SHA-256 of the model's hash and the parameters' bytes. The same run
therefore has the same key in every process and on every machine. Two ledgers can be merged. The result of a
point must not depend on the other points of its chunk.
"""

from __future__ import annotations

import hashlib
import sqlite3
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from doe.arrays import FloatArray

APPLICATION = 0x6B6F6C73
"""SQLite's application id of a ledger: "kols"."""
VERSION = 2
"""Version of the table."""
TABLE = """CREATE TABLE runs (
  key BLOB PRIMARY KEY NOT NULL CHECK (length(key) = 32),
  model BLOB NOT NULL CHECK (length(model) = 32),
  parameters BLOB NOT NULL,
  completed INTEGER NOT NULL CHECK (completed IN (0, 1)),
  outcome TEXT NOT NULL,
  reason TEXT NOT NULL,
  results BLOB NOT NULL,
  digest BLOB NOT NULL CHECK (length(digest) = 32),
  seconds REAL NOT NULL
) STRICT, WITHOUT ROWID"""
LITTLE = np.dtype("<f8")
"""Floats on disk, independent of the machine's byte order."""
COLUMNS = "key, model, parameters, completed, outcome, reason, results, digest, seconds"
"""Columns of the table, in their order."""
MARKS = ", ".join("?" * 9)
"""Placeholders of a row's entries in an SQL statement."""


def row_of(*entries: Any) -> tuple[Any, ...]:
    """The entries of a row with their digest before the seconds."""
    return (*entries[:-1], digest_of(entries[:-1]), entries[-1])


def digest_of(entries: Iterable[Any]) -> bytes:
    """SHA-256 of entries, each preceded by its length."""
    total = hashlib.sha256()
    for entry in entries:
        data = entry if isinstance(entry, bytes) else str(entry).encode()
        total.update(len(data).to_bytes(8, "little") + data)
    return total.digest()


def _bytes_of(values: ArrayLike) -> bytes:
    """Numbers as bytes, in the form stored in a row."""
    return np.ascontiguousarray(values, dtype=LITTLE).tobytes()


@dataclass(frozen=True)
class Run:
    """The record of one run."""

    completed: bool
    outcome: str
    results: FloatArray
    """Results of the run, shape [k]; NaN is kept."""
    reason: str = ""
    """Reason why it did not complete; empty if it did."""
    seconds: float = 0.0
    """Its share of the computing time of its chunk [s]. Only this field may differ if a run is repeated."""


def run_key(model: bytes, point: ArrayLike) -> bytes:
    """SHA-256 of a model's hash and a point's float64 bytes, 32 bytes; -0.0 and 0.0 are one value."""
    return hashlib.sha256(model + _bytes_of(np.asarray(point, dtype=np.float64) + 0.0)).digest()


def _run_of(row: tuple[Any, ...]) -> Run | None:
    """A row as a run. None if the digest does not match the contents, or if the key does not match the
    parameters.
    """
    key, model, parameters, completed, outcome, reason, results, digest, seconds = row
    sound = (
        digest == digest_of(row[:-2])
        and key == hashlib.sha256(model + parameters).digest()
        and len(parameters) % 8 == 0
        and len(results) % 8 == 0
        and seconds >= 0.0
    )
    if not sound:
        return None
    numbers = np.frombuffer(results, dtype=LITTLE).astype(np.float64)
    return Run(bool(completed), outcome, numbers, reason, seconds)


OLDEST = (3, 37, 0)
"""The first SQLite with STRICT tables."""


class LedgerError(Exception):
    """The file is not a ledger, is damaged, or is in use."""


class Ledger:
    """A SQLite file of runs, open in one process at a time; a context manager.

    The file is in WAL mode, and every `record` is one transaction with a sync. If a process is killed at any
    moment, all recorded chunks are complete. Every row contains the SHA-256 of its key and its results. It is
    checked before use; a row with a wrong hash counts as missing.

    Parameters
    ----------
    path
        The file; it is created if it does not exist.
    model
        Hash of all inputs of a run except the parameters, 32 bytes.

    Raises
    ------
    LedgerError
        If the file is not a ledger, is damaged, or is open in another process.
    ValueError
        If `model` is not 32 bytes.
    """

    def __init__(self, path: Path, model: bytes) -> None:
        if len(model) != 32:
            raise ValueError(f"model must be a SHA-256, 32 bytes, got {len(model)}")
        if sqlite3.sqlite_version_info < OLDEST:
            raise LedgerError(f"a ledger needs SQLite 3.37 or newer, this is {sqlite3.sqlite_version}")
        self.path, self.model = Path(path), bytes(model)
        self.damaged: list[str] = []
        """First hexadecimal digits of the keys of damaged rows."""
        with self._refusing():
            self._sql = sqlite3.connect(self.path, isolation_level=None, timeout=0.0)
        try:
            with self._refusing():
                self._open()
        except BaseException:
            self._sql.close()
            raise

    def __enter__(self) -> Ledger:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._sql.close()

    def __len__(self) -> int:
        """Number of runs of every model in the file."""
        with self._refusing():
            return int(self._sql.execute("SELECT count(*) FROM runs").fetchone()[0])

    def find(self, points: ArrayLike) -> list[Run | None]:
        """The runs of this model at some points, shape [n, d]; None for a missing or damaged row. A damaged
        row is listed in `damaged`; calling `record` for that run replaces it. Raises LedgerError if the file
        cannot be read."""
        runs: list[Run | None] = []
        with self._refusing():
            for point in np.asarray(points, dtype=np.float64):
                key = run_key(self.model, point)
                row = self._sql.execute(f"SELECT {COLUMNS} FROM runs WHERE key = ?", (key,)).fetchone()
                run = None if row is None else _run_of(row)
                if row is not None and run is None:
                    self.damaged.append(key.hex()[:12])
                runs.append(run)
        return runs

    def record(self, points: ArrayLike, runs: Sequence[Run]) -> None:
        """Write a chunk of runs at points, shape [n, d], all or none; an earlier record of a point is
        replaced.

        Raises LedgerError if the file cannot be written.
        """
        rows = [
            row_of(
                run_key(self.model, point),
                self.model,
                _bytes_of(point + 0.0),
                int(run.completed),
                run.outcome,
                run.reason,
                _bytes_of(run.results),
                float(run.seconds),
            )
            for point, run in zip(np.asarray(points, dtype=np.float64), runs, strict=True)
        ]
        with self._transaction():
            self._sql.executemany(f"INSERT OR REPLACE INTO runs ({COLUMNS}) VALUES ({MARKS})", rows)

    def merge(self, path: Path) -> int:
        """Copy the runs of all models of another ledger in one transaction, and return their number.

        A completed run replaces one that did not complete; a completed run is never replaced. Raises
        LedgerError if the other file does not exist, is not a ledger or contains a damaged row. Also if the
        two files have different results of one completed run.
        """
        if not Path(path).is_file():
            raise LedgerError(f"{path}: there is no such ledger")
        count = 0
        with Ledger(path, self.model) as source, self._transaction():
            for row in source._rows():
                theirs = _run_of(row)
                if theirs is None:
                    raise LedgerError(
                        f"{path}: run {row[0].hex()[:12]} is damaged; run its sweep again: it is made again"
                    )
                mine = self._sql.execute(f"SELECT {COLUMNS} FROM runs WHERE key = ?", (row[0],)).fetchone()
                if mine is not None and (ours := _run_of(mine)) is not None:
                    if ours.completed and theirs.completed and mine[:-1] != row[:-1]:
                        raise LedgerError(
                            f"{path}: run {row[0].hex()[:12]} has other results than in {self.path}; "
                            "the two were not made by the same program on machines of one kind"
                        )
                    if ours.completed or not theirs.completed:
                        continue
                self._sql.execute(f"INSERT OR REPLACE INTO runs ({COLUMNS}) VALUES ({MARKS})", row)
                count += 1
        return count

    def digest(self) -> str:
        """SHA-256 of every row but its seconds, in the order of the keys: equal for equal contents."""
        total = hashlib.sha256()
        for row in self._rows():
            total.update(digest_of(row[:-1]))
        return total.hexdigest()

    def _rows(self) -> Iterator[tuple[Any, ...]]:
        with self._refusing():
            yield from self._sql.execute(f"SELECT {COLUMNS} FROM runs ORDER BY key")

    def _open(self) -> None:
        # Exclusive mode before WAL needs no shared memory, so the file may lie on a network drive. A second
        # process is rejected and does not repeat the runs of the first one.
        self._sql.execute("PRAGMA trusted_schema = OFF")
        self._sql.execute("PRAGMA locking_mode = EXCLUSIVE")
        schema = self._sql.execute("SELECT type, name, sql FROM sqlite_master").fetchall()
        stamp = tuple(
            self._sql.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version")
        )
        empty = not schema and stamp == (0, 0)

        compatible = stamp == (APPLICATION, VERSION) and schema == [("table", "runs", TABLE)]
        if not (empty or compatible):
            raise LedgerError(
                f"{self.path}: is not a ledger of version {VERSION}; give another place for the ledger"
            )
        mode = self._sql.execute("PRAGMA journal_mode = WAL").fetchone()[0]
        self._sql.execute("PRAGMA synchronous = FULL")
        self._sql.execute("BEGIN IMMEDIATE")
        if empty:
            self._sql.execute(TABLE)
            self._sql.execute(f"PRAGMA application_id = {APPLICATION}")
            self._sql.execute(f"PRAGMA user_version = {VERSION}")

        self._sql.execute("COMMIT")
        health = self._sql.execute("PRAGMA quick_check(1)").fetchone()[0]
        if health != "ok" or mode != "wal":
            raise LedgerError(
                f"{self.path}: is damaged ({_line(health)}, journal {mode}); restore it or remove it"
            )

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        with self._refusing():
            self._sql.execute("BEGIN IMMEDIATE")
            try:
                yield
            except BaseException:
                self._sql.execute("ROLLBACK")
                raise
            self._sql.execute("COMMIT")

    @contextmanager
    def _refusing(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.Error as error:
            busy = "locked" in str(error)
            used = "another sweep is using it; wait, or give this one a separate ledger"
            full = "full" in str(error) or "I/O" in str(error)
            cure = (
                "make room and run it again" if full else "restore it, or give another place for the ledger"
            )
            raise LedgerError(f"{self.path}: {used if busy else f'{_line(error)}; {cure}'}") from error


def _line(text: object) -> str:
    """SQLite's message, in one line."""
    return " ".join(str(text).split())[:200]


ChunkFunction = Callable[[FloatArray], Sequence[Run]]
"""Takes points, shape [n, d], and returns the run of each, length n."""
ExecutorFactory = Callable[[], AbstractContextManager[Executor]]
"""Function that makes an executor; called again after an executor has failed."""

AHEAD = 64
"""Largest number of chunks submitted to an executor at once. It is enough for its workers and limits the
memory."""


@dataclass(frozen=True)
class Pace:
    """Progress of a sweep and its speed."""

    finished: int
    """Number of finished runs, including runs from the ledger."""
    total: int
    """Runs of the design."""
    rate: float
    """Runs per second since the start, without runs from the ledger; 0 before the first chunk."""

    @property
    def seconds_left(self) -> float:
        """Time left at this rate [s]; infinite before the first chunk, 0 at the end."""
        remaining = self.total - self.finished
        return remaining / self.rate if self.rate > 0.0 else (np.inf if remaining else 0.0)


def shard(n: int, i: int, of: int) -> NDArray[np.intp]:
    """Rows of a design of n points that shard i of `of` runs: i - 1, i - 1 + of, i - 1 + 2 of, ...

    Raises ValueError if i is not in [1, of], or there are more shards than points.
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
    """Run a function at points, chunk by chunk, skipping runs that are already in the ledger.

    Parameters
    ----------
    function
        The function. With processes or hosts it must be picklable.
    points
        Parameter values, shape [n, d]; a point that occurs twice is run once.
    chunk
        Largest number of points in one call of the function.
    ledger
        Ledger in which runs are looked up and each chunk is recorded, by this process only.
    executor
        Function that makes the executor of the chunks; by default they run in this process.
    retry
        Repeat runs that are not completed in the ledger.
    attempts
        Largest number of successive executor failures without a returned chunk. After a failure, chunks in
        progress are submitted to a new executor.
    progress
        Called once at the start and after each chunk.

    Returns
    -------
    list
        One run for each point, in the order of the points.

    Raises
    ------
    RuntimeError
        If executors failed `attempts` times in succession.
    ValueError
        If `points` is not of shape [n, d], `chunk` or `attempts` is below 1, or the function did not return
        one run for each point.
    """
    points = np.asarray(points, dtype=np.float64)
    if points.ndim != 2:
        raise ValueError(f"points must have shape [n, d], got {list(points.shape)}")
    if chunk < 1 or attempts < 1:
        raise ValueError(f"chunk and attempts must be at least 1, got {chunk} and {attempts}")
    distinct, places = np.unique(points + 0.0, axis=0, return_inverse=True)
    # In the order of the points: an interrupted sweep has completed its first points.
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
    """The chunk's runs, each with its share of the time; executed in the worker."""
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
    """Run chunks through executors until all are complete. Chunks of a broken executor go to the next one."""
    waiting, broken = list(reversed(chunks)), 0
    while waiting:
        flying: dict[Future[list[Run]], list[int]] = {}
        try:
            with factory() as pool:
                while waiting or flying:
                    while waiting and len(flying) < AHEAD:
                        rows = waiting[-1]
                        flying[pool.submit(_timed, function, points[rows])] = rows
                        waiting.pop()  # only after submission: a broken executor rejects it
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
