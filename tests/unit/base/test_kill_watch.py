"""The record of kills and of an hour's work: time, growth, and different bits."""

import subprocess
import sys
import time

import psutil
import pytest

from benchmarks.kill_watch import end_of, end_of_children, own_time, runs
from benchmarks.kills import Killed, Trial, _begun, recorded
from benchmarks.soak import judged
from benchmarks.soak import recorded as soak_recorded


def test_waits_for_a_core_are_taken_off() -> None:
    # Of 5 s, one thread waited 3 s of them and another, new, 1 s: side by side, so 3 s go.
    assert own_time(5.0, {1: 2.0}, {1: 5.0, 2: 1.0}) == pytest.approx(2.0)
    assert own_time(5.0, {}, {}) == 5.0
    assert own_time(1.0, {1: 0.0}, {1: 4.0}) == 0.0


def test_a_process_that_sleeps_gets_nothing_taken_off() -> None:
    words = [sys.executable, "-c", "import time; time.sleep(0.5)"]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as run:
        said, seconds = end_of(run, time.monotonic() - 10.0, 60.0)
    assert said == ""
    assert seconds > 10.0
    with subprocess.Popen(words) as run:
        gone, alive = end_of_children([psutil.Process(run.pid)])
    assert alive == 0
    assert gone > 0.0
    assert end_of_children([]) == (0.0, 0)


DEAD_CHILD = """
import subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", ""])
time.sleep(0.3)
print(child.pid, flush=True)
time.sleep(60)
"""


def test_a_process_that_has_ended_counts_as_ended_though_nobody_took_its_exit_code() -> None:
    with subprocess.Popen([sys.executable, "-c", DEAD_CHILD], stdout=subprocess.PIPE, text=True) as run:
        child = psutil.Process(int(run.stdout.readline()))
        assert psutil.pid_exists(child.pid)
        gone, alive = end_of_children([child])
        assert runs(psutil.Process(run.pid))
        run.kill()
    assert alive == 0
    assert gone < 0.3


def test_a_process_that_does_not_end_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("benchmarks.kill_watch.GIVEN_UP", 0.2)
    with subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"]) as run:
        gone, alive = end_of_children([psutil.Process(run.pid)])
        run.kill()
    assert alive == 1
    assert 0.0 < gone <= 0.5


def test_an_interrupt_before_the_command_line_is_pythons_to_answer() -> None:
    def said(code: int, text: str) -> bool:
        return _begun(Killed(0.1, code, text, 0.0, 0.0, 0))

    assert not said(-2, "Traceback\n  File x/runpy.py, line 1, in _run\nKeyboardInterrupt")
    assert said(-2, "Traceback\n  File x/cli/commandline.py, line 9, in main\nKeyboardInterrupt")
    assert said(130, "")


def test_the_record_of_kills() -> None:
    trials = [
        Trial(0, "dic", "SIGKILL", 0.5, -9, 0.1, 0.3, ()),
        Trial(1, "dic", "SIGTERM", 0.2, 143, 0.4, 0.0, ("left after SIGTERM: .x", "exit code 1")),
    ]
    record = recorded(7, trials, {"dic": 4.0, "waves": 2.0})
    assert record["kills"] == 2
    assert record["problems"] == ["1 dic: left after SIGTERM: .x", "1 dic: exit code 1"]
    assert record["commands"]["dic"] == {
        "undisturbed [s]": 4.0, "kills": {"SIGKILL": 1, "SIGTERM": 1}, "wrong": 1, "longest stop [s]": 0.4,
        "longest child [s]": 0.3,
    }  # fmt: skip
    assert record["commands"]["waves"]["kills"] == {}


def rounds(memory: list[float], handles: list[int], digest: str = "a") -> list[dict[str, object]]:
    return [
        {"at": float(k), "memory": 1e6 * m, "handles": h, "digests": {"sweep": digest}}
        for k, (m, h) in enumerate(zip(memory, handles, strict=True))
    ]


def test_growth_is_from_the_second_tenth_on() -> None:
    # Ten rounds: the first does not count; medians of the first and the last three of the other nine.
    found = judged(rounds([10.0, *[100.0] * 6, *[103.0] * 3], [1, *[5] * 6, *[6] * 3]))
    assert found["memory [MB]"] == [100.0, 103.0]
    assert found["growth"] == pytest.approx(0.03)
    assert found["handles"] == [5, 6]
    assert found["done"] == {"sweep": 10_000}
    assert found["seconds"] == 9
    # Of three rounds medians are single values: that of the first would show.
    assert judged(rounds([10.0, 100.0, 103.0], [5, 5, 6]))["memory [MB]"] == [100.0, 103.0]


def test_what_grew_and_what_differed_is_named() -> None:
    flat, grown = rounds([100.0] * 10, [5] * 10), rounds([*[100.0] * 7, *[103.0] * 3], [5] * 10)
    handles = rounds([100.0] * 10, [*[5] * 7, *[6] * 3])
    record = soak_recorded([flat, grown, handles])
    assert record["workers that grew"] == [1, 2]
    assert record["tasks with different bits"] == []
    assert record["done"]["sweep"] == 30_000
    assert soak_recorded([flat])["workers that grew"] == []
    other = rounds([100.0] * 10, [5] * 10, "b")
    assert soak_recorded([flat, other])["tasks with different bits"] == ["sweep"]
