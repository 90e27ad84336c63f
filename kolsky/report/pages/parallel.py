"""Figures drawn by two processes, each taking the next one that is not drawn yet."""

import multiprocessing
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

Draw = Callable[[], str]
"""Draws one figure."""
LONGEST = 60.0
"""Seconds that the copy is waited for when nothing else is left to draw; then its figures are drawn here."""


def can_fork() -> bool:
    """Whether a second process can draw too: it must begin as a copy of this one, on a core of its own."""
    return sys.platform == "linux" and len(os.sched_getaffinity(0)) > 1


def draw_in_processes(processes: int, draws: Sequence[Draw]) -> list[str]:
    """What every one of `draws` returns, in their order.

    Parameters
    ----------
    processes
        With 2 a copy of this process draws along where `can_share`. It must not be asked for where threads
        are at work.
    draws
        The figures. What the copy does not deliver is drawn here.
    """
    found: dict[int, str] = {}
    if processes < 2 or len(draws) < 2 or not can_fork():
        return [draw() for draw in draws]
    context = multiprocessing.get_context("fork")
    taken = context.Value("i", 0)
    here, there = context.Pipe(duplex=False)
    other = context.Process(target=_along, args=(draws, taken, there), daemon=True)
    other.start()
    there.close()
    try:
        while (number := _next(taken)) < len(draws):
            found[number] = draws[number]()
        with suppress(EOFError):  # it ended early, and so without a word
            if here.poll(LONGEST):
                found |= here.recv()
                other.join()
    finally:
        here.close()
        if other.is_alive():
            other.kill()
        other.join()
    return [found[number] if number in found else draw() for number, draw in enumerate(draws)]


def _along(draws: Sequence[Draw], taken: Any, there: Any) -> None:
    """The copy's share."""
    sys.stderr = open(os.devnull, "w")  # noqa: SIM115  # what fails here is tried again, and told, above
    found = {}
    while (number := _next(taken)) < len(draws):
        found[number] = draws[number]()
    there.send(found)


def _next(taken: Any) -> int:
    """Number of the next figure that nobody draws."""
    with taken.get_lock():
        number = int(taken.value)
        taken.value = number + 1
    return number
