"""The ledger of a sweep: every run on disk as soon as its chunk is done, found again by what was asked.

A run's key is the SHA-256 of the model's hash and the parameters' bytes, so the same question has the same
key in every process and on every machine, and two ledgers can be merged without asking anything else.
"""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from doe.ledger_rows import (
    APPLICATION,
    COLUMNS,
    FIRST_TABLE,
    MARKS,
    TABLE,
    VERSION,
    Run,
    bytes_of,
    digest_of,
    row_of,
    run_key,
    run_of,
)

OLDEST = (3, 37, 0)
"""The first SQLite with STRICT tables."""


class LedgerError(Exception):
    """A file that is no ledger, is damaged, or is in use."""


class Ledger:
    """A SQLite file of runs, held by one process at a time; a context manager.

    The file is in WAL mode and every `record` is one transaction with a sync: a process killed at any
    moment leaves the chunks recorded before, whole. Nothing in the file is believed before it is checked: a
    row carries the SHA-256 of its key and its results, and one that does not fit counts as not there.

    Parameters
    ----------
    path
        The file; it is made if there is none.
    model
        Hash of everything but the parameters that a run's result depends on, 32 bytes.

    Raises
    ------
    LedgerError
        If the file is no ledger, is damaged, or another process holds it.
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
        """Beginnings of the keys of rows that were found damaged, in hexadecimal digits."""
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
        """Let go of the file."""
        self._sql.close()

    def __len__(self) -> int:
        """Number of runs of every model in the file."""
        with self._refusing():
            return int(self._sql.execute("SELECT count(*) FROM runs").fetchone()[0])

    def find(self, points: ArrayLike) -> list[Run | None]:
        """The runs at some points of this model, None where there is none or the row is damaged.

        A damaged row is named in `damaged`; to `record` the run again replaces it.

        Parameters
        ----------
        points
            Parameter values, shape [n, d].

        Raises
        ------
        LedgerError
            If the file cannot be read.
        """
        found: list[Run | None] = []
        with self._refusing():
            for point in np.asarray(points, dtype=np.float64):
                key = run_key(self.model, point)
                row = self._sql.execute(f"SELECT {COLUMNS} FROM runs WHERE key = ?", (key,)).fetchone()
                run = None if row is None else run_of(row)
                if row is not None and run is None:
                    self.damaged.append(key.hex()[:12])
                found.append(run)
        return found

    def record(self, points: ArrayLike, runs: Sequence[Run]) -> None:
        """Write a chunk of runs, all or none; a run recorded before at the same point is replaced.

        Parameters
        ----------
        points
            Parameter values, shape [n, d].
        runs
            What became of them, length n.

        Raises
        ------
        LedgerError
            If the file cannot be written.
        """
        rows = [
            row_of(
                run_key(self.model, point),
                self.model,
                bytes_of(point + 0.0),
                int(run.completed),
                run.outcome,
                run.reason,
                bytes_of(run.results),
                float(run.seconds),
            )
            for point, run in zip(np.asarray(points, dtype=np.float64), runs, strict=True)
        ]
        with self._transaction():
            self._sql.executemany(f"INSERT OR REPLACE INTO runs ({COLUMNS}) VALUES ({MARKS})", rows)

    def merge(self, path: Path) -> int:
        """Take over the runs of another ledger, of every model in it, all or none.

        A completed run replaces one that did not complete, and nothing replaces a completed one.

        Returns
        -------
        int
            Number of runs taken over.

        Raises
        ------
        LedgerError
            If the other file does not exist, is no ledger or holds a damaged row, or if the two hold
            different results of one completed run.
        """
        if not Path(path).is_file():
            raise LedgerError(f"{path}: there is no such ledger")
        taken = 0
        with Ledger(path, self.model) as other, self._transaction():
            for row in other._rows():
                theirs = run_of(row)
                if theirs is None:
                    raise LedgerError(
                        f"{path}: run {row[0].hex()[:12]} is damaged; run its sweep again: it is made anew"
                    )
                mine = self._sql.execute(f"SELECT {COLUMNS} FROM runs WHERE key = ?", (row[0],)).fetchone()
                if mine is not None and (ours := run_of(mine)) is not None:
                    if ours.completed and theirs.completed and mine[:-1] != row[:-1]:
                        raise LedgerError(
                            f"{path}: run {row[0].hex()[:12]} has other results than in {self.path}; "
                            "the two were not made by the same program on machines of one kind"
                        )
                    if ours.completed or not theirs.completed:
                        continue
                self._sql.execute(f"INSERT OR REPLACE INTO runs ({COLUMNS}) VALUES ({MARKS})", row)
                taken += 1
        return taken

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
        # Exclusive before WAL: no shared memory, so the file may lie on a network drive, and a second
        # process is refused instead of repeating the first one's runs.
        self._sql.execute("PRAGMA trusted_schema = OFF")
        self._sql.execute("PRAGMA locking_mode = EXCLUSIVE")
        schema = self._sql.execute("SELECT type, name, sql FROM sqlite_master").fetchall()
        stamp = tuple(
            self._sql.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version")
        )
        empty = not schema and stamp == (0, 0)
        first = stamp == (APPLICATION, 1) and schema == [("table", "runs", FIRST_TABLE)]
        known = stamp == (APPLICATION, VERSION) and schema == [("table", "runs", TABLE)]
        if not (empty or first or known):
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
        if first:
            self._rewrite_first()
        self._sql.execute("COMMIT")
        health = self._sql.execute("PRAGMA quick_check(1)").fetchone()[0]
        if health != "ok" or mode != "wal":
            raise LedgerError(
                f"{self.path}: is damaged ({_line(health)}, journal {mode}); restore it or remove it"
            )

    def _rewrite_first(self) -> None:
        """Give the rows of version 1 their digests: they are believed as they stand."""
        rows = self._sql.execute(f"SELECT {COLUMNS.replace('digest, ', '')} FROM runs").fetchall()
        self._sql.execute("DROP TABLE runs")
        self._sql.execute(TABLE)
        self._sql.executemany(
            f"INSERT INTO runs ({COLUMNS}) VALUES ({MARKS})", [row_of(*row) for row in rows]
        )
        self._sql.execute(f"PRAGMA user_version = {VERSION}")

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
            used = "another sweep is using it; wait, or give this one a ledger of its own"
            full = "full" in str(error) or "I/O" in str(error)
            cure = (
                "make room and run it again" if full else "restore it, or give another place for the ledger"
            )
            raise LedgerError(f"{self.path}: {used if busy else f'{_line(error)}; {cure}'}") from error


def _line(text: object) -> str:
    """What SQLite says, in one line."""
    return " ".join(str(text).split())[:200]
