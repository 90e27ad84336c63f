"""`kolsky sweep` with its ledger: resume, shards, merge, kill; and the available designs."""

import os
import pickle
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kolsky_command import run_kolsky
from shot_folders import ROOT, TINY
from typer.testing import CliRunner

from doe.ledger import Ledger
from kolsky.base.errors import InputError
from kolsky.cli import app
from kolsky.inverse.forward import Forward
from kolsky.inverse.problem import prepare_shot
from kolsky.inverse.settings import Numerics
from kolsky.shot.load import load_shot
from kolsky.studies.sweep import ShotRuns, read_design

runner = CliRunner()
VARY = ["--vary", "stiffness_factor=0.9:1.3", "--vary", "damping=0:50 us"]


def swept(shot: Path, *options: str, exit_code: int = 0) -> Any:
    return run_kolsky("sweep", shot, *TINY, *options, code=exit_code)


def never(*_: Any, **__: Any) -> None:
    raise AssertionError("a run that the ledger holds was made again")


def test_a_second_sweep_runs_nothing_and_writes_the_same(shot: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options = ["--design", "lhs", "--runs", "5", *VARY]
    swept(shot, *options)
    written = (shot / "results" / "sweep.csv").read_bytes()
    monkeypatch.setattr(Forward, "run", never)
    swept(shot, *options, "--threads", "1")
    assert (shot / "results" / "sweep.csv").read_bytes() == written
    with pytest.raises(AssertionError, match="was made again"):
        runner.invoke(app, ["sweep", str(shot), *TINY, *options, "--ledger", "none"], catch_exceptions=False)


def test_shards_merge_to_the_whole(shot: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options = ["--design", "halton", "--runs", "7", *VARY]
    results = shot / "results"
    for i in (1, 2):
        swept(shot, *options, "--shard", f"{i}/2")
        assert (results / f"sweep-{i}of2.csv").exists()
    whole = ["--ledger", str(shot.parent / "whole.sqlite"), "--out", str(shot.parent / "whole")]
    swept(shot, *options, *whole)
    monkeypatch.setattr(Forward, "run", never)
    swept(shot, *options, *(f"--merge={results / f'sweep-{i}of2.sqlite'}" for i in (1, 2)))
    assert (results / "sweep.csv").read_bytes() == (shot.parent / "whole" / "sweep.csv").read_bytes()


def test_runs_that_failed_are_kept_with_their_reason_and_retried_on_request(
    shot: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The curve ends before the strain of the test: every run stops there.
    options = ["--design", "lhs", "--runs", "3", *VARY, "--past-data", "stop"]
    swept(shot, *options)
    with sqlite3.connect(shot / "results" / "sweep.sqlite") as sql:
        rows = sql.execute("SELECT completed, outcome, reason FROM runs").fetchall()
    sql.close()
    assert {row[:2] for row in rows} == {(0, "TABLE_EXCEEDED")}
    assert all("Cure: measure the curve to larger strain" in row[2] for row in rows)
    monkeypatch.setattr(Forward, "run", never)
    swept(shot, *options)
    with pytest.raises(AssertionError, match="was made again"):
        runner.invoke(app, ["sweep", str(shot), *TINY, *options, "--retry"], catch_exceptions=False)


def test_the_model_hash_knows_what_decides_a_result(shot: Path) -> None:
    runs = ShotRuns(prepare_shot(load_shot(shot)), ("damping",), {}, Numerics(mesh=(8, 11)))
    known = runs.model_hash()
    same = [replace(runs, numerics=replace(runs.numerics, threads=1))]
    other = [
        replace(runs, numerics=replace(runs.numerics, mesh=(8, 12))),
        replace(runs, numerics=replace(runs.numerics, precision="fp32")),
        replace(runs, numerics=replace(runs.numerics, device="cuda:0")),
        replace(runs, held={"poisson": 0.49}),
        replace(runs, names=("friction",)),
    ]
    toml = shot / "shot.toml"
    toml.write_text(toml.read_text() + "\n# another shot\n")
    other.append(replace(runs, prepared=prepare_shot(load_shot(shot))))
    assert [run.model_hash() == known for run in same] == [True]
    assert len({known, *(run.model_hash() for run in other)}) == 7


DESIGNS = {
    "fractional": (["--generators", "a b"], 4),
    "composite": ([], 9),
    "maximin": (["--runs", "4"], 4),
    "d-optimal": (["--runs", "6"], 6),
}


@pytest.mark.parametrize("design", DESIGNS)
def test_designs_of_the_command(design: str, shot: Path) -> None:
    options, n = DESIGNS[design]
    swept(shot, "--design", design, *options, *VARY)
    assert len((shot / "results" / "sweep.csv").read_text().splitlines()) == n + 1


def test_a_design_from_a_file(shot: Path) -> None:
    file = shot.parent / "points.csv"
    file.write_text("damping (us),stiffness_factor\n10,1.0\n25,1.1\n40,1.2\n")
    design = read_design(file)
    np.testing.assert_allclose(design.points, [[1e-5, 1.0], [2.5e-5, 1.1], [4e-5, 1.2]], rtol=1e-14)
    swept(shot, "--design", "csv", "--points", str(file))
    assert len((shot / "results" / "sweep.csv").read_text().splitlines()) == 4


BAD_FILES = {
    "damping (us),mass\n1,2\n": "there is no parameter 'mass'", "damping (furlong)\n1\n2\n": "line 1",
    "damping (us)\n1\n": "holds 1 points",
    "damping (us)\n1\nx\n": "line 3: column 'damping (us)' is not a number: 'x'",
    "damping (us)\n1\nnan\n": "line 3: column 'damping (us)' is not a finite number: 'nan'",
    "damping (us)\n1\n-1\n": "line 3: damping = -1e-06 s is not allowed",
    "damping (us),friction\n1\n": "line 2: ", "damping (us),damping\n1,1\n": "damping stands twice",
    "poisson\n0.4\n0.4\n": "poisson has one value only", "=cmd()\n1\n": "is no column", "": "is empty",
}  # fmt: skip


@pytest.mark.parametrize("text", BAD_FILES)
def test_bad_design_files_are_refused(text: str, tmp_path: Path) -> None:
    file = tmp_path / "points.csv"
    file.write_text(text)
    with pytest.raises(InputError) as caught:
        read_design(file)
    assert BAD_FILES[text] in str(caught.value)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--shard", "3/2"], "I/N with I from 1 to N"),
        (["--shard", "1/200"], "200 shards of 100 points"),
        (["--generators", "a b"], "--generators and --design fractional need each other"),
        (["--design", "csv"], "--points and --design csv need each other"),
        (["--design", "csv", *VARY], "--vary excludes --design csv"),
        (["--design", "box-behnken", *VARY], "needs three parameters or more"),
        (["--ledger", "none", "--merge", "x.sqlite"], "--merge needs a ledger"),
        (["--merge", "x.sqlite"], "there is no such ledger"),
    ],
)
def test_refusals(options: list[str], words: str, shot: Path) -> None:
    assert words in swept(shot, *options, exit_code=2).stderr


def test_a_ledger_that_is_none_is_refused(shot: Path) -> None:
    file = shot.parent / "notes.txt"
    file.write_text("mine\n" * 100)
    assert "not a database" in swept(shot, "--ledger", str(file), exit_code=2).stderr
    assert file.read_text() == "mine\n" * 100


@pytest.mark.long
def test_a_sweep_killed_three_times_on_the_real_solver(shot: Path) -> None:
    results = shot / "results"
    options = ["--mesh", "8x11", "--design", "halton", "--runs", "1000", "--threads", "1", *VARY]
    command = [sys.executable, "-m", "kolsky.cli", "sweep", str(shot), *options]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    rng = np.random.default_rng(int(time.time()))

    def size() -> int:
        wal = results / "sweep.sqlite-wal"
        return wal.stat().st_size if wal.exists() else 0

    for _ in range(3):
        process = subprocess.Popen(command, env=environment, stdout=subprocess.DEVNULL)
        before = size()
        while process.poll() is None and size() == before:  # until something new is recorded
            time.sleep(0.01)
        time.sleep(rng.uniform(0.0, 0.3))
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert not (results / "sweep.csv").exists()
    assert subprocess.run(command, env=environment, stdout=subprocess.DEVNULL, check=False).returncode == 0
    killed = (results / "sweep.csv").read_bytes()
    plain = shot.parent / "plain.sqlite"
    whole = [*command, "--ledger", str(plain), "--out", str(shot.parent / "whole")]
    assert subprocess.run(whole, env=environment, stdout=subprocess.DEVNULL, check=False).returncode == 0
    assert killed == (shot.parent / "whole" / "sweep.csv").read_bytes()
    # Nine digits in the table, every bit in the ledger.
    with Ledger(results / "sweep.sqlite", bytes(32)) as one, Ledger(plain, bytes(32)) as other:
        assert len(one) == 1000
        assert one.digest() == other.digest()


def test_a_worker_elsewhere_gets_the_whole_shot(shot: Path) -> None:
    runs = ShotRuns(
        prepare_shot(load_shot(shot)), ("stiffness_factor",), {}, Numerics(mesh=(8, 11), threads=1)
    )
    points = np.array([[0.9], [1.0], [1.1]])
    here, there = runs(points), pickle.loads(pickle.dumps(runs))
    # One at a time, as if each were another worker's chunk.
    away = [there(point[None])[0] for point in points]
    assert [run.results.tobytes() for run in away] == [run.results.tobytes() for run in here]
    assert there.model_hash() == runs.model_hash()
