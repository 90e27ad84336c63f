"""Run commands of a shot as separate processes.

They continue after the tab or the server is closed. Only the log in the shot's results is stored. Its first
line names the command and its process. The output of the command follows. A later server can therefore find a
run again.
"""

from __future__ import annotations

import os
import re
import runpy
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from threading import Thread

from kolsky.base.errors import InputError

_HEAD = re.compile(r"# kolsky (?P<command>\w+) .*, process (?P<process>\d+), started (?P<started>[\d: -]+)")
_PROGRESS = re.compile(
    r"(?P<name>[^:\n]+): (?P<done>\d+) of (?P<total>\d+), "
    r"(?P<time>\S+ since the start(?:, \S+ left of this stage)?|.* left)"
)
"""A line of progress of a command, or of a sweep."""
END = "# ended: exit code "
COMMANDS = ("identify", "dic", "sweep", "check", "report")
"""Commands that can be run."""
PROGRESS_EVERY = "1"
"""Time between two lines of progress in a log [s]."""
_LONGEST = 200_000
"""Maximum number of bytes shown from the end of a log."""
_CHILDREN: dict[Path, subprocess.Popen[bytes]] = {}
"""Runs of this server, by log."""


@dataclass(frozen=True)
class Stage:
    """Progress of a stage of a run."""

    name: str
    """The stage."""
    done: int
    """Number of runs or frames done."""
    total: int
    """Total number of runs or frames."""
    time: str
    """Time since the run's start, or remaining time."""


@dataclass(frozen=True)
class Job:
    """A run of one command, read from its log."""

    log: Path
    """The log."""
    command: str
    """The command."""
    process: int
    """Number of its process."""
    started: str
    """Time at which it began."""
    text: str
    """Its output, without progress lines."""
    stages: tuple[Stage, ...]
    """The stages so far, with the current one at the end."""
    exit_code: int | None
    """Its exit code. None while it is running, or if the exit code is unknown."""
    running: bool
    """True while it runs."""

    @property
    def state(self) -> str:
        """Its state, in words."""
        if self.running:
            return "running"
        if self.exit_code is None:
            return "ended without its last line, as a killed process does; the log has what it printed"
        if self.exit_code == 0:
            return "finished"
        return "cancelled" if self.exit_code in _CANCELLED else f"failed with exit code {self.exit_code}"


_CANCELLED = (128 + signal.SIGTERM, 130)
"""Exit codes of a command that was ended by a signal."""
GRACE = 10.0
"""Time for a cancelled command to exit before it is killed [s]. `kolsky.cli` aborts a simulation after 3."""


def log_of(folder: Path, command: str) -> Path:
    """The log of a command of a shot."""
    return folder / "results" / f"{command}.log"


def start(folder: Path, command: str, options: list[str]) -> Job:
    """Start a command of a shot.

    ``folder``: the shot's folder. ``command``: one of `COMMANDS`. ``options``: as on the command line. Raises
    InputError if a command of the shot is already running.
    """
    if command not in COMMANDS:
        raise InputError(folder, f"{command} is not run from here", allowed=", ".join(COMMANDS))
    if (running := running_job(folder)) is not None:
        raise InputError(
            folder, f"kolsky {running.command} runs already", cure="wait for its end, or cancel it"
        )
    log = log_of(folder, command)
    log.parent.mkdir(exist_ok=True)
    words = [sys.executable, "-m", "kolsky.app.jobs", command, str(folder), *options]
    with log.open("wb") as file:
        child = subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            env={**os.environ, "KOLSKY_PROGRESS_EVERY": PROGRESS_EVERY},
            start_new_session=os.name == "posix",  # it continues after the server ends
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )
    _CHILDREN[log] = child
    return read_job(log)


def run_here(words: list[str]) -> None:
    """Run a command in this process, and write the first and the last line of its log.

    ``words``: the command, the shot's folder and the options.
    """
    command, _, *options = words
    said = f"# kolsky {command} {' '.join(options)}, process {os.getpid()}, started"
    print(f"{said} {datetime.now():%Y-%m-%d %H:%M}", flush=True)
    sys.argv = ["kolsky", *words]
    code: int | str | None = 1
    try:
        runpy.run_module("kolsky.cli", run_name="__main__", alter_sys=True)
        code = 0
    except SystemExit as end:
        code = end.code or 0
        raise
    finally:
        sys.stderr.flush()
        print(f"{END}{code}", flush=True)


def cancel(job: Job) -> None:
    """End a running command as by Ctrl+C.

    It cleans up, and earlier results are kept. A command that does not end within `GRACE` is killed with its
    forks. A command that is aborted in a simulation cannot write the last line of its log. This function
    writes it.
    """
    if job.running:
        with suppress(ProcessLookupError):
            os.kill(job.process, signal.SIGTERM)
        Thread(target=_see_end, args=(job,), daemon=True).start()


def _see_end(job: Job) -> None:
    """Wait for the end of a cancelled command. It is killed after `GRACE`, and its log is completed."""
    until = time.monotonic() + GRACE
    while _alive(job.process, job.log):
        if time.monotonic() > until:
            for kill in (os.kill, os.killpg):
                with suppress(ProcessLookupError):
                    kill(job.process, signal.SIGKILL)
        time.sleep(0.05)
    text = job.log.read_text("utf-8", errors="replace")
    if f", process {job.process}, started" in text and f"\n{END}" not in text:
        with job.log.open("a", encoding="utf-8") as file:
            file.write(f"\n{END}{_CANCELLED[0]}\n")


def read_job(log: Path) -> Job:
    """A run, read from its log. Raises InputError if the file is not the log of a command."""
    size = log.stat().st_size
    with log.open("rb") as file:
        head = file.readline().decode("utf-8", "replace")
        file.seek(max(file.tell(), size - _LONGEST))
        tail = file.read().decode("utf-8", "replace").split("\n")
    found, child = _HEAD.match(head), _CHILDREN.get(log)
    if found is None and child is not None:  # it has not begun to write, or ended before that
        code = _code_of(child)
        return Job(log, log.stem, child.pid, "just now", "\n".join(tail).strip(), (), code, code is None)
    if found is None:
        raise InputError(log, "is not a log of a command", cure="remove it")
    ends = [line for line in tail if line.startswith(END)]
    process = int(found["process"])
    code = _code_of(child) if child is not None and child.pid == process else None
    return Job(
        log=log,
        command=found["command"],
        process=process,
        started=found["started"].strip(),
        text="\n".join(
            line for line in tail if not _PROGRESS.fullmatch(line) and not line.startswith(END)
        ).strip(),
        stages=_stages(tail),
        exit_code=int(ends[-1].removeprefix(END)) if ends else code,
        running=not ends and _alive(process, log),
    )


def _code_of(child: subprocess.Popen[bytes]) -> int | None:
    """The exit code of a process as in a shell, for a log without a last line. None while it runs."""
    code = child.poll()
    return code if code is None or code >= 0 else 128 - code


def _stages(lines: list[str]) -> tuple[Stage, ...]:
    """The last state of each stage. A repeated stage moves to the end."""
    last: dict[str, Stage] = {}
    for m in filter(None, map(_PROGRESS.fullmatch, lines)):
        last.pop(m["name"], None)
        last[m["name"]] = Stage(m["name"], int(m["done"]), int(m["total"]), m["time"])
    return tuple(last.values())


def jobs_of(folder: Path) -> list[Job]:
    """The last run of each command of a shot."""
    found = []
    for command in COMMANDS:
        with suppress(OSError, InputError):
            found.append(read_job(log_of(folder, command)))
    return found


def running_job(folder: Path) -> Job | None:
    """The running command of a shot; None if none is running."""
    return next((job for job in jobs_of(folder) if job.running), None)


def is_running(folder: Path) -> bool:
    """True if a command of a shot is running. For speed, only runs of this server are checked."""
    return any(child.poll() is None for log, child in _CHILDREN.items() if log.parent.parent == folder)


def _alive(process: int, log: Path) -> bool:
    """True if a process exists and is a kolsky command. Another process may have the same number."""
    child = _CHILDREN.get(log)
    if child is not None and child.pid == process:
        return child.poll() is None
    try:
        os.kill(process, 0)
        return "kolsky" in Path(f"/proc/{process}/cmdline").read_text("utf-8", errors="replace")
    except FileNotFoundError:  # it has just ended, or there is no /proc
        return os.name != "posix"
    except OSError:
        return False


if __name__ == "__main__":
    run_here(sys.argv[1:])
