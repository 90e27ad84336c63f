"""Time until a killed command ends, for `benchmarks.kills`, corrected for other work on the machine.

On a busy machine a process that could end at once waits for a core. This waiting time (`/proc/PID/schedstat`,
Linux) is subtracted. The time in which a process sleeps or computes still counts.
"""

import subprocess
import time
from collections.abc import Mapping
from pathlib import Path

import psutil

OFTEN = 0.02
"""Time between two checks of the processes [s]."""
GIVEN_UP = 10.0
"""Time after the command's end until which its children are watched [s]."""


def waited(pids: list[int]) -> dict[int, float]:
    """Time that each existing thread of some processes has waited for a core so far [s]."""
    found = {}
    for pid in pids:
        for place in Path(f"/proc/{pid}/task").glob("*/schedstat"):
            try:
                found[int(place.parent.name)] = int(place.read_text().split()[1]) / 1e9
            except (OSError, IndexError, ValueError):
                continue
    return found


def own_time(elapsed: float, before: Mapping[int, float], after: Mapping[int, float]) -> float:
    """An elapsed wall time minus the time in which threads waited for a core [s].

    ``before``, ``after``: results of `waited` [s]. Threads wait in parallel, so the longest wait is
    subtracted.
    """
    longest = max((wait - before.get(thread, 0.0) for thread, wait in after.items()), default=0.0)
    return max(0.0, elapsed - longest)


def end_of(run: subprocess.Popen[str], since: float, longest: float) -> tuple[str, float]:
    """Standard error of a command until its end, and its own time since `since` [s]."""
    pids = [run.pid, *(child.pid for child in psutil.Process(run.pid).children(recursive=True))]
    before = waited(pids)
    after = dict(before)
    while True:
        after |= waited(pids)
        try:
            _, said = run.communicate(timeout=OFTEN)
        except subprocess.TimeoutExpired:
            if time.monotonic() - since > longest:
                raise
            continue
        return said, own_time(time.monotonic() - since, before, after)


def runs(process: psutil.Process) -> bool:
    """Whether a process has not ended.

    An ended process remains in the process table until its exit code is read. For an orphan the machine's
    first process reads it, possibly seconds later.
    """
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def end_of_children(children: list[psutil.Process]) -> tuple[float, int]:
    """Own time until the last of some processes has ended [s], and the number of those that have not
    ended."""
    pids = [child.pid for child in children]
    since, before = time.monotonic(), waited(pids)
    after, alive = dict(before), children
    while (alive := [child for child in alive if runs(child)]) and time.monotonic() - since < GIVEN_UP:
        after |= waited(pids)
        time.sleep(OFTEN)
    return own_time(time.monotonic() - since, before, after) if children else 0.0, len(alive)
