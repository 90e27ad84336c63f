"""The rows of a ledger: the SQLite table, the record of a run, its key, and the digest it is believed by."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

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
FIRST_TABLE = """CREATE TABLE runs (
  key BLOB PRIMARY KEY NOT NULL CHECK (length(key) = 32),
  model BLOB NOT NULL CHECK (length(model) = 32),
  parameters BLOB NOT NULL,
  completed INTEGER NOT NULL CHECK (completed IN (0, 1)),
  outcome TEXT NOT NULL,
  reason TEXT NOT NULL,
  results BLOB NOT NULL,
  seconds REAL NOT NULL
) STRICT, WITHOUT ROWID"""
"""The table of version 1, which had no digests; it is rewritten when it is opened."""
LITTLE = np.dtype("<f8")
"""Floats on disk, whatever the machine's byte order."""
COLUMNS = "key, model, parameters, completed, outcome, reason, results, digest, seconds"
"""Columns of the table, in their order."""
MARKS = ", ".join("?" * 9)
"""Places of a row's entries in a statement."""


def row_of(*entries: Any) -> tuple[Any, ...]:
    """The entries of a row with their digest before the seconds."""
    return (*entries[:-1], digest_of(entries[:-1]), entries[-1])


def digest_of(entries: Iterable[Any]) -> bytes:
    """SHA-256 of entries, each behind its length."""
    total = hashlib.sha256()
    for entry in entries:
        data = entry if isinstance(entry, bytes) else str(entry).encode()
        total.update(len(data).to_bytes(8, "little") + data)
    return total.digest()


def bytes_of(values: ArrayLike) -> bytes:
    """Numbers as they stand in a row."""
    return np.ascontiguousarray(values, dtype=LITTLE).tobytes()


@dataclass(frozen=True)
class Run:
    """The record of one run."""

    completed: bool
    """Whether it ended as it should."""
    outcome: str
    """How it ended, one word."""
    results: FloatArray
    """Its numbers, shape [k]; NaN is kept."""
    reason: str = ""
    """Why it did not complete; empty if it did."""
    seconds: float = 0.0
    """Its share of the time of the chunk it was run in [s]; the only field that a repeat may change."""


def run_key(model: bytes, point: ArrayLike) -> bytes:
    """SHA-256 of a model's hash and a point's float64 bytes, 32 bytes; -0.0 and 0.0 are one value."""
    return hashlib.sha256(model + bytes_of(np.asarray(point, dtype=np.float64) + 0.0)).digest()


def run_of(row: tuple[Any, ...]) -> Run | None:
    """A row as a run; None if its digest is not its contents', or its key not its parameters'."""
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
