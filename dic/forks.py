"""Work in forks of this process, beside the work here.

What runs in Python alone shares one interpreter lock among threads: two of them take as long as one after the
other, and longer. A fork has its own. It is a copy of one thread only, so that a lock which another thread
held at that moment stays shut in it; hence a caller says where forks may be made (`forking`), and everywhere
else the same work is done by a thread. Whatever a fork does not deliver is done here, with the same result.
"""

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from contextvars import ContextVar
from functools import partial
from typing import Any, Generic, TypeVar

from dic.following import end_with

Result = TypeVar("Result")

_FORKING: ContextVar[bool] = ContextVar("forking", default=False)


@contextmanager
def forking() -> Iterator[None]:
    """Let `beside` and `side_by_side` fork this process: for the one thread that works in it."""
    before = _FORKING.set(True)
    try:
        yield
    finally:
        _FORKING.reset(before)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def can_fork() -> bool:
    """Return True where a fork is safe and of use: on Linux with at least two cores."""
    return sys.platform == "linux" and cores() > 1


def allowed() -> bool:
    """Return True within `forking`, where `can_fork`."""
    return _FORKING.get() and can_fork()


MOST_PARTS = 4
"""Most processes that one array is divided between: to fork one takes as long as some frames."""


def parts() -> int:
    """Parts that small work is worth being divided into: as many as there are cores but one, which other work
    has, at most `MOST_PARTS`; 1 where forks are not allowed."""
    return min(cores() - 1, MOST_PARTS) if allowed() else 1


class Later(Generic[Result]):
    """Result of work that is under way beside this."""

    def __init__(self, wait: Callable[[], Result]) -> None:
        self._wait, self._found = wait, list[Result]()

    def __call__(self) -> Result:
        """Wait for the work and return its result; what it raised is raised here."""
        if not self._found:
            self._found.append(self._wait())
        return self._found[0]


@contextmanager
def beside(work: Callable[[], Result], *, fork: bool | None = None) -> Iterator[Later[Result]]:
    """Do work beside the block: in a fork, or else in a thread. It ends with the block, wanted or not.

    Parameters
    ----------
    work
        The work. In a fork it sees everything as it stands now, and changes nothing here; its result is
        copied, so let it be small.
    fork
        Whether in a fork; None: within `forking`, where `can_fork`.

    Yields
    ------
    Later
        Gives the result, or raises what the work raised.
    """
    if not ((_FORKING.get() if fork is None else fork) and can_fork()):
        with ThreadPoolExecutor(1) as pool:
            yield Later(pool.submit(work).result)
        return
    here, there = multiprocessing.Pipe(duplex=False)
    other = _forked(work, there)
    there.close()

    def received() -> Result:
        with suppress(Exception):  # it ended early, by an error or a signal, or sent what cannot be read
            result: Result = here.recv()
            return result
        return work()  # raises here what it raised there

    try:
        yield Later(received)
    finally:
        here.close()
        with suppress(
            ProcessLookupError, ChildProcessError
        ):  # a program may have its children's ends ignored
            os.kill(other, signal.SIGKILL)
            os.waitpid(other, 0)


@contextmanager
def begun(
    works: Sequence[Callable[[], Result]], *, processes: int | None = None
) -> Iterator[Callable[..., list[Result]]]:
    """Begin several works in forks, if there are some, while this process does something else.

    Parameters
    ----------
    works, processes
        As of `side_by_side`.

    Yields
    ------
    callable
        Joins in the work and gives what `side_by_side` gives; takes its `progress`.
    """
    if processes is None and not (_FORKING.get() and can_fork()):
        yield lambda progress=None: _by_threads(works, progress or _untold)
        return
    workers = min(cores() if processes is None else processes, len(works)) if can_fork() else 1
    taken = multiprocessing.get_context("fork").Value("i", 0) if workers > 1 else _Count()
    with ExitStack() as stack:
        some = partial(_taken, works, taken)
        others = [stack.enter_context(beside(some, fork=True)) for _ in range(workers - 1)]

        def joined(progress: Callable[[int, int], None] | None = None) -> list[Result]:
            told, found = progress or _untold, {}
            for number, result in _taking(works, taken):
                found[number] = result
                told(min(int(taken.value), len(works)), len(works))
            for other in others:
                found |= other()
            results = [found[number] if number in found else work() for number, work in enumerate(works)]
            told(len(works), len(works))
            return results

        yield joined


def _untold(done: int, total: int) -> None:
    """Progress that nobody is told of."""


def side_by_side(
    works: Sequence[Callable[[], Result]],
    *,
    processes: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Result]:
    """Do several works, each of which takes the next one that nobody has begun, and return their results in
    order.

    Parameters
    ----------
    works
        As for `beside`.
    processes
        Processes that work, this one among them. With None as many as there are cores within `forking`, and
        else this one alone, with a thread a core.
    progress
        Told here of the works done, or begun where forks work, and their number.
    """
    with begun(works, processes=processes) as joined:
        return joined(progress)


def _by_threads(works: Sequence[Callable[[], Result]], told: Callable[[int, int], None]) -> list[Result]:
    found = []
    with ThreadPoolExecutor(cores()) as pool:
        for result in pool.map(lambda work: work(), works):
            found.append(result)
            told(len(found), len(works))
    return found


class _Count:
    """Number of works begun, of a process that works alone."""

    def __init__(self) -> None:
        self.value = 0

    def get_lock(self) -> AbstractContextManager[None]:
        return nullcontext()


def _taking(works: Sequence[Callable[[], Result]], taken: Any) -> Iterator[tuple[int, Result]]:
    """Results of the works that nobody else has taken, each with its number."""
    while True:
        with taken.get_lock():
            number = int(taken.value)
            taken.value = number + 1
        if number >= len(works):
            return
        yield number, works[number]()


def _taken(works: Sequence[Callable[[], Result]], taken: Any) -> dict[int, Result]:
    return dict(_taking(works, taken))


def _forked(work: Callable[[], Any], there: Any) -> int:
    """Fork this process, do the work there and send its result; the fork's number.

    Not by `multiprocessing.Process`, which the workers of a pool may not start.
    """
    parent = os.getpid()
    number = os.fork()
    if number:
        return number
    try:
        end_with(parent)  # nobody wants the result then
        # A failure is repeated and reported in the parent.
        sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115
        _FORKING.set(False)  # a fork makes no forks
        there.send(work())
    finally:
        os._exit(0)
