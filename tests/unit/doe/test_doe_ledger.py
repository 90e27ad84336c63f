"""The ledger of a sweep: kill, damage, merge, retry; no run is lost or repeated."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import ledger_sweep
import numpy as np
import pytest

from doe.ledger import Ledger, LedgerError, Pace, Run, run_chunks, run_key, shard

ROOT = Path(__file__).resolve().parents[3]
MODEL = b"\x01" * 32
POINTS = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [7.0, 8.0]])


def square(points: np.ndarray) -> list[Run]:
    return [
        Run(x[0] != 3.0, "OK" if x[0] != 3.0 else "BAD", x**2, "" if x[0] != 3.0 else "x") for x in points
    ]


def sweeping(ledger: Path, log: Path) -> subprocess.Popen[bytes]:
    script = Path(ledger_sweep.__file__)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    return subprocess.Popen([sys.executable, str(script), str(ledger), str(log)], env=environment)


def made(log: Path) -> np.ndarray:
    return np.fromfile(log, dtype="<i4") if log.exists() else np.empty(0, dtype="<i4")


def test_a_sweep_killed_three_times_is_the_one_that_was_not(tmp_path: Path) -> None:
    rng = np.random.default_rng(int(time.time()))  # another moment each time the test runs
    ledger, log = tmp_path / "killed.sqlite", tmp_path / "log"
    known: set[int] = set()
    for kill in range(3):
        before = len(made(log))
        process = sweeping(ledger, log)
        enough = before + int(rng.integers(100, 1000))
        while len(made(log)) < enough:
            assert process.poll() is None
            time.sleep(rng.uniform(0.0, 0.003))
        process.send_signal(signal.SIGKILL)
        process.wait()
        again = set(made(log)[before:].tolist()) & known
        assert not again, f"kill {kill}: what the ledger held was run again"
        with Ledger(ledger, ledger_sweep.MODEL) as book:
            found = book.find(ledger_sweep.POINTS)
        known = {i for i, run in enumerate(found) if run is not None}
        # All that was begun is kept but the chunk under way, and that wholly or not at all.
        assert 0 <= len(made(log)) - len(known) <= (kill + 1) * ledger_sweep.CHUNK
        assert len(known) % ledger_sweep.CHUNK == 0
    assert sweeping(ledger, log).wait() == 0
    assert set(made(log).tolist()) == set(range(ledger_sweep.N))
    assert len(made(log)) <= ledger_sweep.N + 3 * ledger_sweep.CHUNK
    with Ledger(tmp_path / "whole.sqlite", ledger_sweep.MODEL) as whole:
        plain = run_chunks(ledger_sweep.oscillator, ledger_sweep.POINTS, chunk=1000, ledger=whole)
        with Ledger(ledger, ledger_sweep.MODEL) as book:
            assert book.digest() == whole.digest()
            killed = book.find(ledger_sweep.POINTS)
    for one, other in zip(killed, plain, strict=True):
        assert (one.completed, one.outcome, one.reason) == (other.completed, other.outcome, other.reason)
        assert one.results.tobytes() == other.results.tobytes()


def test_nothing_known_is_run_and_failures_only_on_request(tmp_path: Path) -> None:
    asked: list[float] = []

    def watched(points: np.ndarray) -> list[Run]:
        asked.extend(points[:, 0])
        return square(points)

    paces: list[Pace] = []
    with Ledger(tmp_path / "l.sqlite", MODEL) as book:
        run_chunks(watched, POINTS[:2], chunk=1, ledger=book)
        runs = run_chunks(watched, POINTS, chunk=3, ledger=book, progress=paces.append)
        assert asked == [1.0, 3.0, 5.0, 7.0]
        assert [run.outcome for run in runs] == ["OK", "BAD", "OK", "OK"]
        assert [(p.finished, p.total) for p in paces] == [(2, 4), (4, 4)]
        assert paces[0].seconds_left == np.inf
        assert paces[1].seconds_left == 0.0
        assert run_chunks(watched, POINTS, chunk=3, ledger=book, retry=True)[1].reason == "x"
        assert asked[4:] == [3.0]
    with Ledger(tmp_path / "l.sqlite", b"\x02" * 32) as book:  # another model knows none of them
        assert book.find(POINTS) == [None] * 4


def test_a_point_asked_for_twice_is_run_once_and_zero_has_one_sign() -> None:
    calls: list[int] = []

    def counted(points: np.ndarray) -> list[Run]:
        calls.append(len(points))
        return square(points)

    points = np.array([[0.0], [2.0], [-0.0], [2.0]])
    assert [run.results[0] for run in run_chunks(counted, points, chunk=10)] == [0.0, 4.0, 0.0, 4.0]
    assert calls == [2]
    assert run_key(MODEL, [0.0]) == run_key(MODEL, [-0.0])


def test_shards_merge_to_the_whole(tmp_path: Path) -> None:
    points = np.random.default_rng(0).random((23, 2))
    for i in (1, 2, 3):
        with Ledger(tmp_path / f"{i}.sqlite", MODEL) as book:
            run_chunks(square, points[shard(23, i, 3)], chunk=4, ledger=book)
    with Ledger(tmp_path / "whole.sqlite", MODEL) as whole, Ledger(tmp_path / "1.sqlite", MODEL) as book:
        run_chunks(square, points, chunk=23, ledger=whole)
        assert [book.merge(tmp_path / f"{i}.sqlite") for i in (2, 3, 2)] == [8, 7, 0]
        assert book.digest() == whole.digest()
    with pytest.raises(ValueError, match="shard 4/3 does not exist"):
        shard(23, 4, 3)
    with pytest.raises(ValueError, match="leave some of them empty"):
        shard(2, 1, 3)


def test_merging_prefers_what_completed_and_refuses_a_contradiction(tmp_path: Path) -> None:
    lost, done = Run(False, "LOST", np.array([np.nan]), "gone"), Run(True, "OK", np.array([2.0]))
    with Ledger(tmp_path / "a.sqlite", MODEL) as a:
        a.record(POINTS[:2], [lost, done])
    with Ledger(tmp_path / "b.sqlite", MODEL) as b:
        b.record(POINTS[:2], [done, lost])
        assert b.merge(tmp_path / "a.sqlite") == 1
        assert all(run is not None and run.completed for run in b.find(POINTS[:2]))
        b.record(POINTS[:1], [Run(True, "OK", np.array([2.0 + 1e-15]))])
    with Ledger(tmp_path / "a.sqlite", MODEL) as a:
        a.record(POINTS[:1], [done])
        before = a.digest()
        with pytest.raises(LedgerError, match="has other results than in"):
            a.merge(tmp_path / "b.sqlite")
        assert a.digest() == before
        with pytest.raises(LedgerError, match="there is no such ledger"):
            a.merge(tmp_path / "c.sqlite")


def test_two_processes_cannot_hold_one_ledger(tmp_path: Path) -> None:
    with Ledger(tmp_path / "l.sqlite", MODEL), pytest.raises(LedgerError, match="another sweep is using it"):
        Ledger(tmp_path / "l.sqlite", MODEL)


def filled(path: Path) -> Path:
    with Ledger(path, MODEL) as book:
        book.record(POINTS, square(POINTS))
    return path


def test_a_file_that_is_no_ledger_is_refused_and_left_alone(tmp_path: Path) -> None:
    text = tmp_path / "text.sqlite"
    text.write_text("time,force\n" * 200)
    with pytest.raises(LedgerError, match="not a database"):
        Ledger(text, MODEL)
    other = tmp_path / "other.sqlite"
    with sqlite3.connect(other) as sql:
        sql.execute("CREATE TABLE mine (x)")
    sql.close()
    before = other.read_bytes()
    with pytest.raises(LedgerError, match="is not a ledger of version 2"):
        Ledger(other, MODEL)
    assert other.read_bytes() == before
    with pytest.raises(LedgerError, match="unable to open"):
        Ledger(tmp_path / "nowhere" / "l.sqlite", MODEL)


FORGERIES = {
    "trigger": "CREATE TRIGGER t AFTER INSERT ON runs BEGIN DELETE FROM runs; END",
    "table": "CREATE TABLE more (x)",
    "version": "PRAGMA user_version = 3",
}


@pytest.mark.parametrize("kind", FORGERIES)
def test_a_forged_schema_is_refused(kind: str, tmp_path: Path) -> None:
    path = filled(tmp_path / "l.sqlite")
    with sqlite3.connect(path) as sql:
        sql.execute(FORGERIES[kind])
    sql.close()
    with pytest.raises(LedgerError, match="is not a ledger of version 2"):
        Ledger(path, MODEL)


@pytest.mark.parametrize("column", ["parameters", "results", "model", "outcome", "reason"])
def test_a_changed_row_counts_as_not_there_and_is_named(column: str, tmp_path: Path) -> None:
    path = filled(tmp_path / "l.sqlite")
    key = run_key(MODEL, POINTS[2])
    with sqlite3.connect(path) as sql:
        (before,) = sql.execute(f"SELECT {column} FROM runs WHERE key = ?", (key,)).fetchone()
        # One bit of the last byte, or a letter more: lengths and types stay those of a sound row.
        after = before[:-1] + bytes([before[-1] ^ 1]) if isinstance(before, bytes) else before + "x"
        sql.execute(f"UPDATE runs SET {column} = ? WHERE key = ?", (after, key))
    sql.close()
    asked: list[float] = []

    def again(points: np.ndarray) -> list[Run]:
        asked.extend(points[:, 0])
        return square(points)

    with Ledger(path, MODEL) as book:
        found = run_chunks(again, POINTS, chunk=4, ledger=book)
        assert book.damaged == [key.hex()[:12]]
    assert asked == [POINTS[2, 0]]
    np.testing.assert_array_equal(found[2].results, POINTS[2] ** 2)
    with Ledger(path, MODEL) as book:
        assert None not in book.find(POINTS)
        assert not book.damaged


def test_results_exchanged_between_two_runs_are_found(tmp_path: Path) -> None:
    path = filled(tmp_path / "l.sqlite")
    keys = [run_key(MODEL, point) for point in POINTS[2:]]
    with sqlite3.connect(path) as sql:
        rows = [
            sql.execute("SELECT results, digest FROM runs WHERE key = ?", (key,)).fetchone() for key in keys
        ]
        for key, row in zip(keys, rows[::-1], strict=True):
            sql.execute("UPDATE runs SET results = ?, digest = ? WHERE key = ?", (*row, key))
    sql.close()
    with Ledger(path, MODEL) as book:
        assert [run is None for run in book.find(POINTS)] == [False, False, True, True]


def test_a_torn_file_is_refused(tmp_path: Path) -> None:
    path = filled(tmp_path / "l.sqlite")
    data = bytearray(path.read_bytes())
    data[4200:] = os.urandom(len(data) - 4200)
    path.write_bytes(data)
    with pytest.raises(LedgerError):
        Ledger(path, MODEL).find(POINTS)


def test_refusals() -> None:
    with pytest.raises(ValueError, match="32 bytes, got 3"):
        Ledger(Path("never.sqlite"), b"abc")
    with pytest.raises(ValueError, match=r"shape \[n, d\]"):
        run_chunks(square, [1.0], chunk=1)
    with pytest.raises(ValueError, match="at least 1, got 0 and 3"):
        run_chunks(square, POINTS, chunk=0)
    with pytest.raises(ValueError, match="returned 1 runs for 4 points"):
        run_chunks(lambda points: square(points[:1]), POINTS, chunk=4)
