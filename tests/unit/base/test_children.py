"""Every kind of child process ends with its parent, at any time of the kill."""

import os
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from benchmarks.kill_watch import end_of_children, runs
from benchmarks.kills import CHILDREN

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the system ends children on Linux")

ROOT = Path(__file__).resolve().parents[3]
MOMENTS = (0.0, 0.05, 0.2, 0.6)  # times from the birth of the first child to the kill [s]

POOL = """
import time
from concurrent.futures import wait
from kolsky.base.process import process_pool

def work():
    import kolsky.identification  # what workers load first takes seconds
    time.sleep(60)

if __name__ == "__main__":
    with process_pool(2) as pool:
        wait([pool.submit(work) for _ in range(2)])
"""
FORK = """
import os, re, time
from dic import processes

here = os.getpid()

def draw():
    if os.getpid() == here:
        time.sleep(60)
    re.sub("(a+)+c", "", "a" * 28)  # a library that gives no other thread a turn
    return ""

processes.can_fork = lambda: True
processes.run_parallel([draw] * 40, processes=2)
"""
PROGRAM = """
import sys
from pathlib import Path
from kolsky.base.process import run_program

run_program(Path(sys.argv[1]), timeout=60)
"""
BUSY = 'import re\nre.sub("(a+)+c", "", "a" * 60)\n'
KINDS = {"worker": POOL, "fork": FORK, "program": PROGRAM}


def _killed(script: Path, words: list[str], moment: float) -> tuple[float, int]:
    """Own time of the children of a script that was killed, and how many went on."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen([sys.executable, script, *words], env=environment) as run:
        parent = psutil.Process(run.pid)
        until = time.monotonic() + 60.0
        while not parent.children() and time.monotonic() < until:
            time.sleep(0.005)
        time.sleep(moment)
        children = parent.children(recursive=True)
        assert children
        run.kill()
        run.wait()
    try:
        return end_of_children(children)
    finally:
        for child in filter(runs, children):  # a failure must not leave what computes for ever
            child.kill()


@pytest.mark.parametrize("kind", KINDS)
def test_children_end_within_a_second(kind: str, tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(KINDS[kind])
    (tmp_path / "busy.py").write_text(BUSY)
    words = [str(tmp_path / "busy.py")] if kind == "program" else []
    for moment in MOMENTS:
        gone, alive = _killed(tmp_path / "script.py", words, moment)
        assert alive == 0, f"killed {moment} s after the first child"
        assert gone < CHILDREN, f"killed {moment} s after the first child"
