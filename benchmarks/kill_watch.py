"""The end of a command that is killed, for `benchmarks.kills`: how long it took, other work set apart.

On a machine with other work a process that would end at once waits for a core. What the system says of that
(`/proc/PID/schedstat`, Linux) is taken off; a process that sleeps or computes gets nothing taken off.
"""

import subprocess
import time
from collections.abc import Mapping
from pathlib import Path

import psutil

OFTEN = 0.02
"""Time between two looks at the processes [s]."""
GIVEN_UP = 10.0
"""Time after the command's end at which its children are given up [s]."""


def waited(pids: list[int]) -> dict[int, float]:
    """Time that each thread of some processes has waited for a core so far [s]; those that are there."""
    found = {}
    for pid in pids:
        for place in Path(f"/proc/{pid}/task").glob("*/schedstat"):
            try:
                found[int(place.parent.name)] = int(place.read_text().split()[1]) / 1e9
            except (OSError, IndexError, ValueError):
                continue
    return found


def own_time(elapsed: float, before: Mapping[int, float], after: Mapping[int, float]) -> float:
    """An elapsed time without what threads waited for a core in it [s].

    Parameters
    ----------
    elapsed
        By the clock [s].
    before, after
        As `waited` gives them. Threads wait side by side: the longest wait counts, not their sum.
    """
    longest = max((wait - before.get(thread, 0.0) for thread, wait in after.items()), default=0.0)
    return max(0.0, elapsed - longest)


def end_of(run: subprocess.Popen[str], since: float, longest: float) -> tuple[str, float]:
    """What a command says on standard error until it ends, and its own time from `since` on [s]."""
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

    One that has stays in the table of processes until somebody takes its exit code: of an orphan that is the
    first process of the machine, which may take seconds for it.
    """
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def end_of_children(children: list[psutil.Process]) -> tuple[float, int]:
    """Own time until the last of some processes has ended [s], and how many are there at the end."""
    pids = [child.pid for child in children]
    since, before = time.monotonic(), waited(pids)
    after, alive = dict(before), children
    while (alive := [child for child in alive if runs(child)]) and time.monotonic() - since < GIVEN_UP:
        after |= waited(pids)
        time.sleep(OFTEN)
    return own_time(time.monotonic() - since, before, after) if children else 0.0, len(alive)
