"""Parallel work in forks of this process, or in threads where forks are not safe.

Threads that run only Python share one interpreter lock, so work is divided between forks. A lock that another
thread holds at a fork stays locked in the copy. The caller therefore declares where forks are safe. In all
other places threads are used. If a fork fails, its work is repeated in this process, with the same result.
"""

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from contextvars import ContextVar
from functools import partial
from typing import Any, Generic, TypeVar

from dic.following import end_with

Result = TypeVar("Result")

_FORKS_ALLOWED: ContextVar[bool] = ContextVar("forking", default=False)


@contextmanager
def allow_forks() -> Iterator[None]:
    """Allow `background` and `run_parallel` to fork; only where this process runs a single thread."""
    before = _FORKS_ALLOWED.set(True)
    try:
        yield
    finally:
        _FORKS_ALLOWED.reset(before)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def can_fork() -> bool:
    """Return True where a fork is safe and useful: on Linux with at least two cores."""
    return sys.platform == "linux" and cores() > 1


def may_fork() -> bool:
    """Return True within `allow_forks`, if `can_fork` is True."""
    return _FORKS_ALLOWED.get() and can_fork()


MOST_PARTS = 4
"""Largest number of processes that share one array. Starting a process takes as long as a few frames."""


def parts() -> int:
    """Number of parts into which small work is divided: the number of cores minus one, at most `MOST_PARTS`.
    One core stays free for other work. 1 where forks are not allowed."""
    return min(cores() - 1, MOST_PARTS) if may_fork() else 1


class PendingResult(Generic[Result]):
    """Result of work that runs in the background."""

    def __init__(self, wait: Callable[[], Result]) -> None:
        self._wait, self._found = wait, list[Result]()

    def __call__(self) -> Result:
        """Wait for the work and return its result; an exception of the work is raised here."""
        if not self._found:
            self._found.append(self._wait())
        return self._found[0]


@contextmanager
def background(work: Callable[[], Result], *, fork: bool | None = None) -> Iterator[PendingResult[Result]]:
    """Do work during the block, in a fork or in a thread. The work is stopped at the end of the block.

    ``work``: the work. A fork works on a copy of the present data and cannot change the data of this process.
    Its result is copied back and should be small. ``fork``: whether in a fork; None: if `may_fork`. Yields: a
    call returns the result, or raises the exception of the work.
    """
    if not ((_FORKS_ALLOWED.get() if fork is None else fork) and can_fork()):
        with ThreadPoolExecutor(1) as pool:
            yield PendingResult(pool.submit(work).result)
        return
    receiver, sender = multiprocessing.Pipe(duplex=False)
    process = _fork(work, sender)
    sender.close()

    def received() -> Result:
        with suppress(Exception):  # an error or a signal ended it early, or its result cannot be read
            result: Result = receiver.recv()
            return result
        return work()  # raises the exception of the work here

    try:
        yield PendingResult(received)
    finally:
        receiver.close()
        with suppress(
            ProcessLookupError, ChildProcessError
        ):  # a program may ignore the signals of its children
            os.kill(process, signal.SIGKILL)
            os.waitpid(process, 0)


@contextmanager
def background_pool(
    works: Sequence[Callable[[], Result]], *, processes: int | None = None
) -> Iterator[Callable[..., list[Result]]]:
    """Begin several tasks in forks, if these are allowed, while this process does other work.

    Yields: a function that helps with the work and returns the results as `run_parallel` does. It takes
    `progress`.
    """
    forked = can_fork() and (processes is not None or _FORKS_ALLOWED.get())
    workers = min(cores() if processes is None else processes, len(works)) if forked else 1
    if workers < 2:
        threads = cores() if processes is None and not forked else 1
        yield lambda progress=None: _by_threads(works, threads, progress or _no_progress)
        return
    counter = multiprocessing.get_context("fork").Value("i", 0)
    with ExitStack() as stack:
        some = partial(_run_claimed, works, counter)
        helpers = [stack.enter_context(background(some, fork=True)) for _ in range(workers - 1)]

        def joined(progress: Callable[[int, int], None] | None = None) -> list[Result]:
            report, by_number = progress or _no_progress, {}
            for number, result in _claim_works(works, counter):
                by_number[number] = result
                report(min(int(counter.value), len(works)), len(works))
            for helper in helpers:
                by_number |= helper()
            results = [
                by_number[number] if number in by_number else work() for number, work in enumerate(works)
            ]
            report(len(works), len(works))
            return results

        yield joined


def _no_progress(count: int, total: int) -> None:
    """Progress that is not reported."""


def run_parallel(
    works: Sequence[Callable[[], Result]],
    *,
    processes: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Result]:
    """Do several tasks in parallel and return their results in order; each process takes the next open task.

    With None, `allow_forks` gives one process per core; without it one process has one thread per core.
    ``progress``: called in this process with the number of finished tasks (with forks: of started tasks) and
    their total.
    """
    with background_pool(works, processes=processes) as joined:
        return joined(progress)


def _by_threads(
    works: Sequence[Callable[[], Result]], threads: int, report: Callable[[int, int], None]
) -> list[Result]:
    """Do the tasks in threads of this process, including the calling thread."""
    results = []
    with ThreadPoolExecutor(threads) as pool:
        for result in (map if threads == 1 else pool.map)(lambda work: work(), works):
            results.append(result)
            report(len(results), len(works))
    return results


def _claim_works(works: Sequence[Callable[[], Result]], counter: Any) -> Iterator[tuple[int, Result]]:
    """Take open tasks one after another; yields the number and result of each."""
    while True:
        with counter.get_lock():
            number = int(counter.value)
            counter.value = number + 1
        if number >= len(works):
            return
        yield number, works[number]()


def _run_claimed(works: Sequence[Callable[[], Result]], counter: Any) -> dict[int, Result]:
    return dict(_claim_works(works, counter))


def _fork(work: Callable[[], Any], sender: Any) -> int:
    """Fork this process, do the work there and send its result; returns the fork's process number."""
    parent = os.getpid()
    number = os.fork()  # the workers of a pool may not start a `multiprocessing.Process`
    if number:
        return number
    try:
        end_with(parent)  # the result is then not needed
        # A failure is repeated and reported in the parent.
        sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115
        _FORKS_ALLOWED.set(False)  # a fork must not make forks
        sender.send(work())
    finally:
        os._exit(0)
