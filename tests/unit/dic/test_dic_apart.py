"""A process that is told later what to work on."""

import os
from typing import Any

import numpy as np
import pytest

from dic.processes import allow_forks, can_fork, may_fork, worker_process

pytestmark = pytest.mark.skipif(not can_fork(), reason="one core, or no copies of processes here")


def test_a_process_works_on_what_it_is_told_later() -> None:
    began: list[str] = []

    def work(take: Any) -> tuple[int, list[Any], int]:
        return os.getpid(), [take(), take()], len(began)

    with worker_process(work, lambda told: (os.getpid(), told, -1)) as process:
        began.append("here only")
        process.tell(np.arange(100_000))  # more than a pipe holds
        process.tell("two")
        pid, (first, second), there = process.result()
        assert process.result() is process.result()
    assert pid != os.getpid()
    np.testing.assert_array_equal(first, np.arange(100_000))
    assert (second, there) == ("two", 0)


@pytest.mark.parametrize("end", ["at once", "by an error"])
def test_what_the_process_does_not_deliver_is_done_here(end: str) -> None:
    here = os.getpid()

    def work(take: Any) -> str:
        assert os.getpid() != here
        os._exit(1) if end == "at once" else take()
        raise RuntimeError

    with worker_process(work, lambda told: f"{told} by {os.getpid()}") as process:
        process.tell("one")
        process.tell("two")
        assert process.result() == f"['one', 'two'] by {here}"


def test_forks_are_allowed_within_forking() -> None:
    assert not may_fork()
    with allow_forks():
        assert may_fork()
    assert not may_fork()
