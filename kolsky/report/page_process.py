"""A process beside an identification that loads what its page is drawn with, and draws the page at the end.

Matplotlib, its fonts and the template take half a second of Python, which threads of one interpreter cannot
share. The process is forked before there are threads and before a GPU is used, while the libraries of the
identification itself are still to be loaded and a core is idle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import Pipe
from pathlib import Path
from typing import TYPE_CHECKING

from dic.forks import beside, can_fork, cores
from kolsky.base.process import infrequent_gc

if TYPE_CHECKING:
    from kolsky.inverse.result import Identification
    from kolsky.shot.recorded import Recorded

MOST_DRAWERS = 4
"""Most processes that draw a page: the figure that takes longest takes a quarter of what all take."""

Begin = Callable[[Path, "Identification", "Recorded"], Callable[[], None]]
"""Hands over the file and what it shows; what it returns waits until the page is written."""


def drawers() -> int:
    """Processes that draw a page when nothing else is done: as many as there are cores, 2 to 4."""
    return min(max(cores(), 2), MOST_DRAWERS)


@contextmanager
def page_process(processes: int) -> Iterator[Begin | None]:
    """Fork a process that draws the page of an identification; it ends with the block.

    Parameters
    ----------
    processes
        Processes that draw, this new one among them; see `dic.forks.side_by_side`.

    Yields
    ------
    callable or None
        See `Begin`. A page that the process does not write is drawn here. None with one process, and where
        a fork is not safe or of no use: the page is then drawn as `kolsky.report.result_folder` does without.
    """
    if processes < 2 or not can_fork():
        yield None
        return
    wanted: list[tuple[Path, Identification, Recorded]] = []
    taken, handed = Pipe(duplex=False)

    def page() -> None:
        with infrequent_gc():
            from kolsky.report.result_folder import load_identify_page

            load_identify_page()
            from kolsky.report.pages.identification import write_report

            write_report(*(wanted[0] if wanted else taken.recv()), processes=processes)

    with beside(page, fork=True) as drawn, handed:
        taken.close()  # or else a process that is gone would be waited for

        def begin(path: Path, found: Identification, recordings: Recorded) -> Callable[[], None]:
            wanted.append((path, found, recordings))
            with suppress(OSError):  # it is gone
                handed.send(wanted[0])
            return drawn

        yield begin
