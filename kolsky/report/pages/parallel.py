"""Drawing of figures by two processes; each takes the next figure that is not drawn yet."""

import multiprocessing
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

Draw = Callable[[], str]
"""Draws one figure."""
LONGEST = 60.0
"""Longest wait for the fork when nothing else is left to draw [s]; then its figures are drawn here."""


def can_fork() -> bool:
    """Return True if a forked second process can draw too: on Linux with at least two cores."""
    return sys.platform == "linux" and len(os.sched_getaffinity(0)) > 1


def draw_in_processes(processes: int, draws: Sequence[Draw]) -> list[str]:
    """Call every one of `draws` and return their results in order.

    Parameters
    ----------
    processes
        With 2, a fork of this process draws too where `can_fork`. Do not ask for it while threads run.
    draws
        Functions that draw one figure each. Figures that the fork does not deliver are drawn here.
    """
    found: dict[int, str] = {}
    if processes < 2 or len(draws) < 2 or not can_fork():
        return [draw() for draw in draws]
    context = multiprocessing.get_context("fork")
    taken = context.Value("i", 0)
    here, there = context.Pipe(duplex=False)
    other = context.Process(target=_draw_in_fork, args=(draws, taken, there), daemon=True)
    other.start()
    there.close()
    try:
        while (number := _next(taken)) < len(draws):
            found[number] = draws[number]()
        with suppress(EOFError):  # it ended early without a result
            if here.poll(LONGEST):
                found |= here.recv()
                other.join()
    finally:
        here.close()
        if other.is_alive():
            other.kill()
        other.join()
    return [found[number] if number in found else draw() for number, draw in enumerate(draws)]


def _draw_in_fork(draws: Sequence[Draw], taken: Any, there: Any) -> None:
    """Draw in the fork and send the results."""
    sys.stderr = open(os.devnull, "w")  # noqa: SIM115  # a failure here is repeated and reported in the parent
    found = {}
    while (number := _next(taken)) < len(draws):
        found[number] = draws[number]()
    there.send(found)


def _next(taken: Any) -> int:
    """Return the number of the next figure that is not drawn yet."""
    with taken.get_lock():
        number = int(taken.value)
        taken.value = number + 1
    return number
