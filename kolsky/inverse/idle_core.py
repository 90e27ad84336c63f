"""Work beside other work that leaves a core idle: libraries and time loops of use later, lone runs."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

from dic.forks import Later, beside
from explicit.device import select_device

Result = TypeVar("Result")

SWITCH = 1e-4
"""Longest wait for the interpreter beside a run [s]. A run begins with a hundred calls that let go of it, and
would wait Python's 5 ms for it after each."""


def leaves_a_core(device: str, threads: int | None) -> bool:
    """Whether a lone run leaves a core idle on which other runs may be made: on a CPU, with more than one."""
    return (threads or os.cpu_count() or 1) > 1 and not select_device(device).is_cuda


@contextmanager
def in_thread(work: Callable[[], Result], *, idle: bool = True) -> Iterator[Later[Result]]:
    """Do work in a thread beside the block, if a core is idle in it; else when its result is asked for.

    Yields
    ------
    Later
        Gives the result, or raises what the work raised.
    """
    if not idle:
        yield Later(work)
        return
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH)
    try:
        with beside(work, fork=False) as done:
            yield done
    finally:
        sys.setswitchinterval(before)


def begun_in_thread(work: Callable[[], Result]) -> Later[Result]:
    """Begin work in a thread, which goes on when the caller has returned.

    For work that is lost without harm if nobody asks for its result.
    """
    pool = ThreadPoolExecutor(1)
    found = pool.submit(work)
    pool.shutdown(wait=False)
    return Later(found.result)


class IdleCore:
    """Works that wait for a lone run on the refined mesh, and are then done in a thread beside it.

    Each is what would otherwise be loaded or run where it is first used, so that nothing is missing where no
    run is alone. None of them changes a number.

    Parameters
    ----------
    waiting
        The works, in their order.
    """

    def __init__(self, waiting: Sequence[Callable[[], object]] = ()) -> None:
        self._waiting: tuple[Callable[[], object], ...] = tuple(waiting)
        self._put_off: tuple[Callable[[], object], ...] = ()

    def put_off(self, work: Callable[[], Result]) -> Later[Result]:
        """Let runs wait for a lone run beside which nothing is loaded, or until they are asked for."""
        found = Later(work)
        self._put_off = (*self._put_off, found)
        return found

    @contextmanager
    def used(self, *, idle: bool) -> Iterator[None]:
        """Do what is waiting beside the block, if a core is idle in it; what it raises is raised here."""
        works: tuple[Callable[[], object], ...] = ()
        if idle and self._waiting:
            works, self._waiting = self._waiting, ()
        elif idle:
            works, self._put_off = self._put_off, ()
        if not works:
            yield
            return
        with in_thread(lambda: [work() for work in works]) as done:
            yield
            done()
