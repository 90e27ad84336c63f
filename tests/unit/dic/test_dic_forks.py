"""Work in forks and threads gives what the work gives here, and what a fork fails at is done here."""

import os
import threading
import time
from functools import partial
from pathlib import Path

import pytest

from dic.images import PictureError
from dic.processes import allow_forks, background, background_pool, can_fork, run_parallel

sharing = pytest.mark.skipif(not can_fork(), reason="one core, or no copies of processes here")


def number(k: int) -> str:
    return f"{k} " + "x" * 100_000


def who(wait: float = 0.05) -> int:
    time.sleep(wait)
    return os.getpid()


@pytest.mark.parametrize("processes", [None, 1, 2])
def test_every_work_once_and_in_order(processes: int | None) -> None:
    works = [partial(number, k) for k in range(7)]
    assert run_parallel(works, processes=processes) == [work() for work in works]
    with allow_forks():
        assert run_parallel(works, processes=processes) == [work() for work in works]


@sharing
def test_both_processes_work() -> None:
    assert len(set(run_parallel([who] * 12, processes=2))) == 2
    with allow_forks():
        assert len(set(run_parallel([who] * 12))) > 1


@sharing
def test_begun_work_goes_on_while_this_process_does_something_else() -> None:
    here, works = os.getpid(), [partial(who, 0.01)] * 12
    with allow_forks(), background_pool(works) as joined:
        time.sleep(3.0)  # far longer than all of it takes
        assert here not in joined()
    with background_pool(works) as joined:  # threads begin when this process joins in
        assert joined() == [here] * 12
    told: list[tuple[int, int]] = []
    with allow_forks(), background_pool(works) as joined:
        assert len(joined(lambda done, total: told.append((done, total)))) == 12
    assert told[-1] == (12, 12)


def test_forks_are_made_where_they_are_allowed_only() -> None:
    assert set(run_parallel([who] * 4)) == {os.getpid()}
    with background(who) as later:
        assert later() == os.getpid()
    with allow_forks(), background(who, fork=False) as later:
        assert later() == os.getpid()

    def from_a_thread() -> None:
        with background(who) as later:
            seen.append(later())

    seen: list[int] = []
    with allow_forks():
        thread = threading.Thread(target=from_a_thread)
        thread.start()
        thread.join()
    assert seen == [os.getpid()]


@sharing
def test_work_beside_runs_in_a_fork_that_makes_none_itself() -> None:
    def twice() -> tuple[int, int]:
        with background(who) as own:
            return os.getpid(), own()

    with allow_forks(), background(twice) as later:
        assert later() is later()
        fork, within = later()
    assert fork != os.getpid()
    assert within == fork


@sharing
def test_what_a_fork_fails_at_is_done_here() -> None:
    here = os.getpid()

    def only_here(end: object = None) -> str:
        if os.getpid() != here:
            os._exit(1) if end else (_ for _ in ()).throw(RuntimeError("no"))
        time.sleep(0.02)
        return "done"

    assert run_parallel([only_here] * 6, processes=2) == ["done"] * 6
    for end in (None, "at once"):
        with allow_forks(), background(partial(only_here, end)) as later:
            assert later() == "done"


class Sent:
    """Cannot be read where it is sent to."""

    def __reduce__(self) -> tuple[object, ...]:
        return int, ("no number",)


@sharing
def test_what_cannot_be_sent_is_done_here() -> None:
    for made in (Sent, lambda: lambda: 0):
        with allow_forks(), background(made) as later:
            assert later() is not None


@pytest.mark.parametrize("processes", [None, 2])
def test_what_fails_here_too_is_told(processes: int | None) -> None:
    def never() -> str:
        raise ValueError("cannot be drawn")

    with pytest.raises(ValueError, match="cannot be drawn"):
        run_parallel([never] * 4, processes=processes)
    with allow_forks(), pytest.raises(ValueError, match="cannot be drawn"), background(never) as later:
        later()


@sharing
def test_work_that_nobody_waits_for_ends_with_the_block() -> None:
    started = time.perf_counter()
    with allow_forks(), background(partial(time.sleep, 30.0)):
        pass
    assert time.perf_counter() - started < 10.0  # far less than the sleep, on a busy machine too


@sharing
def test_progress_counts_up_to_the_number_of_works() -> None:
    for processes in (None, 2):
        told: list[tuple[int, int]] = []
        run_parallel([who] * 5, processes=processes, progress=lambda *done, told=told: told.append(done))
        assert told == sorted(told)
        assert told[-1] == (5, 5)


@sharing
def test_a_picture_error_is_sent_as_it_is() -> None:
    error = PictureError(Path("a.tif"), "is cut off", frame=3, cure="export it again")

    def made() -> tuple[PictureError, int]:
        return error, os.getpid()

    with allow_forks(), background(made) as later:
        found, where = later()
    assert where != os.getpid()  # sent, not made here
    assert (str(found), vars(found)) == (str(error), vars(error))
