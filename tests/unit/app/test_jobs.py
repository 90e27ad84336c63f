"""Commands as separate processes: progress, end, cancel, and a killed server."""

from __future__ import annotations

import os
import shutil
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

pytest.importorskip("nicegui", reason="the extra `app` is not installed")

from laboratory_files import OPEN_05
from nicegui.testing import User
from simulated import walk

from doe.ledger import Pace
from kolsky.app import jobs
from kolsky.base.errors import InputError
from kolsky.cli import terminal


def wait(log: Path, seconds: float = 60.0) -> jobs.Job:
    """The run once it has ended."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if log.stat().st_size and not (job := jobs.read_job(log)).running:
            if log in jobs._CHILDREN:
                jobs._CHILDREN[log].wait(20.0)  # it ends a moment after its last line
            return job
        time.sleep(0.05)
    raise AssertionError(f"still running: {log.read_text('utf-8')}")


def shot(folder: Path) -> Path:
    folder.mkdir(parents=True)
    (folder / "shot.toml").write_text('format = 1\n[specimen]\ndiameter = ""\n', encoding="utf-8")
    return folder


def written(folder: Path, text: str) -> Path:
    """A log with this text."""
    log = jobs.log_of(folder, "identify")
    log.parent.mkdir()
    log.write_text(text, encoding="utf-8")
    return log


def test_a_command_runs_in_its_own_process_and_leaves_its_log(tmp_path: Path) -> None:
    folder = shot(tmp_path / "one")
    job = jobs.start(folder, "check", [])
    assert job.running
    assert jobs.is_running(folder)
    ended = wait(job.log)
    assert ended.process == job.process != os.getpid()
    assert ended.exit_code == 2
    assert ended.state == "failed with exit code 2"
    assert "specimen.diameter is not filled in" in ended.text
    assert not jobs.is_running(folder)


def test_progress_is_the_last_line_and_no_part_of_the_text(tmp_path: Path) -> None:
    log = written(
        shot(tmp_path / "one"),
        "# kolsky identify --mesh 12x16, process 1, started 2026-01-02 03:04\n"
        "coarse search: 10 of 40, 0:00:01 since the start\n"
        "warning: odd\n"
        "mesh error: 3 of 7, 0:00:09 since the start, 0:00:12 left of this stage\n",
    )
    job = jobs.read_job(log)
    assert job.stages[-1] == jobs.Stage(
        "mesh error", 3, 7, "0:00:09 since the start, 0:00:12 left of this stage"
    )
    assert [one.name for one in job.stages] == ["coarse search", "mesh error"]
    assert job.text == "warning: odd"
    assert job.started == "2026-01-02 03:04"
    assert not job.running  # process 1 is no command of ours
    assert "without its last line" in job.state


def test_a_stage_that_comes_back_is_the_current_one(tmp_path: Path) -> None:
    """And a sweep's lines are progress too, before and after its rate is known."""
    log = written(
        shot(tmp_path / "one"),
        "# kolsky sweep , process 1, started 2026-01-02 03:04\n"
        "design: 10 of 40, 0:00:01 since the start\n"
        "sweep: 0 of 256, 0:00:01 since the start\n"
        "design: 40 of 40, 0:00:02 since the start\n"
        "sweep: 30 of 256, 12.1 runs/s, 0:00:19 left\n"
        "fit: force 1 of 3\n",
    )
    job = jobs.read_job(log)
    assert [(one.name, one.done, one.time) for one in job.stages] == [
        ("design", 40, "0:00:02 since the start"),
        ("sweep", 30, "12.1 runs/s, 0:00:19 left"),
    ]
    assert job.text == "fit: force 1 of 3"


def test_what_the_commands_print_is_progress(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The lines of `kolsky sweep` and of all others, as the terminal writes them."""
    monkeypatch.setattr(terminal, "_EVERY", 0.0)
    with terminal.printing(), terminal.progress_bars() as progress, terminal.sweep_progress() as pace:
        progress("design", 3, 40)
        pace(Pace(finished=0, total=256, rate=0.0))
        pace(Pace(finished=30, total=256, rate=12.13))
    lines = capsys.readouterr().err.splitlines()
    found = [(one.name, one.done, one.total) for line in lines for one in jobs._stages([line])]
    assert found == [("design", 3, 40), ("sweep", 0, 256), ("sweep", 30, 256)]


@pytest.mark.parametrize(
    ("code", "state"), [(0, "finished"), (3, "failed with exit code 3"), (143, "cancelled")]
)
def test_ends(code: int, state: str, tmp_path: Path) -> None:
    head = "# kolsky identify , process 1, started 2026-01-02 03:04\nm = 1\n"
    log = written(shot(tmp_path / "one"), f"{head}{jobs.END}{code}\n")
    assert jobs.read_job(log).state == state
    assert jobs.read_job(log).text == "m = 1"


def test_no_second_command_and_no_other_one(tmp_path: Path) -> None:
    folder = shot(tmp_path / "one")
    with pytest.raises(InputError, match="is not run from here"):
        jobs.start(folder, "virtual", [])
    job = jobs.start(folder, "check", [])
    with pytest.raises(InputError, match="runs already"):
        jobs.start(folder, "identify", [])
    wait(job.log)


SERVER = """
import os, sys, time
from pathlib import Path
from kolsky.app import jobs
jobs.start(Path(sys.argv[1]), "check", [])
os.kill(os.getpid(), 9)
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_run_outlives_a_killed_server(tmp_path: Path) -> None:
    folder = shot(tmp_path / "one")
    killed = subprocess.run([sys.executable, "-c", SERVER, str(folder)], check=False)
    assert killed.returncode == -9
    log = jobs.log_of(folder, "check")
    assert wait(log).exit_code == 2
    assert [job.command for job in jobs.jobs_of(folder)] == ["check"]


ENDLESS = """
import os, runpy, signal, sys, time
from kolsky.app import jobs
runpy.run_module = lambda *words, **named: [print("began", flush=True), *map(time.sleep, [0.1] * 999)]
signal.signal(signal.SIGTERM, {handler})
jobs.run_here(["identify", "one", "--mesh", "8x8"])
"""
ENDS = {
    "cleans up": "lambda number, frame: sys.exit(128 + number)",
    "cut off in a simulation": "lambda number, frame: os._exit(128 + number)",
    "takes no signal": "signal.SIG_IGN",
}
"""How a command takes SIGTERM; the last must be killed."""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("handler", ENDS.values(), ids=ENDS)
def test_cancel_ends_a_command_and_its_log_says_so(
    handler: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also of a server that did not start it."""
    monkeypatch.setattr(jobs, "GRACE", 0.5)
    log = written(shot(tmp_path / "one"), "")
    with log.open("wb") as file:
        child = subprocess.Popen([sys.executable, "-c", ENDLESS.format(handler=handler)], stdout=file)
    while "began" not in log.read_text("utf-8"):
        assert child.poll() is None
        time.sleep(0.05)
    job = jobs.read_job(log)
    assert job.running
    assert (job.process, job.command) == (child.pid, "identify")
    jobs.cancel(job)
    assert child.wait(20.0) == (-9 if "IGN" in handler else 143)
    _until(lambda: jobs.read_job(log).state == "cancelled", 5.0)
    assert log.read_text("utf-8").count(jobs.END) == 1


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_command_that_is_cancelled_at_once(tmp_path: Path) -> None:
    """Before it has written anything."""
    job = jobs.start(shot(tmp_path / "one"), "check", [])
    jobs.cancel(job)
    _until(lambda: jobs.read_job(job.log).state == "cancelled", 20.0)


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_cancel_of_a_sweep_keeps_its_runs(tmp_path: Path) -> None:
    """Cancelled while it simulates a batch."""
    folder = tmp_path / "one"
    shutil.copytree(OPEN_05, folder, ignore=shutil.ignore_patterns("results"))
    job = jobs.start(folder, "sweep", ["--design", "sobol", "--runs", "65536", "--mesh", "8x11"])
    _until(lambda: any(one.done for one in jobs.read_job(job.log).stages), 120.0)
    done = jobs.read_job(job.log).stages[-1].done
    jobs.cancel(jobs.read_job(job.log))
    _until(lambda: jobs.read_job(job.log).state == "cancelled", jobs.GRACE)
    with closing(sqlite3.connect(folder / "results" / "sweep.sqlite")) as ledger:
        assert ledger.execute("select count(*) from runs").fetchone()[0] >= done


@pytest.mark.skipif(os.name != "posix", reason="/proc")
def test_a_process_that_ends_while_it_is_looked_at_is_not_alive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    child = subprocess.Popen([sys.executable, "-c", ""])
    child.wait(20.0)
    monkeypatch.setattr(os, "kill", lambda process, signal: None)  # it still answered here
    assert not jobs._alive(child.pid, tmp_path / "log")


def _until(true: Callable[[], bool], seconds: float) -> None:
    """Wait until something is true."""
    until = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < until
        time.sleep(0.05)


def test_the_page_shows_a_run(tmp_path: Path) -> None:
    folder = shot(tmp_path / "root" / "one")

    async def steps(user: User) -> None:
        await user.open("/run?shot=one")
        await user.should_see("Nothing has been run from here yet.")
        written(folder, f"# kolsky identify , process 1, started 2026-01-02 03:04\nm = 1.1\n{jobs.END}0\n")
        await user.should_see("kolsky identify, started 2026-01-02 03:04: finished", retries=30)
        await user.should_see("m = 1.1")
        await user.should_see("Look at the result")

    walk(tmp_path / "root", tmp_path / "main.py", steps)
