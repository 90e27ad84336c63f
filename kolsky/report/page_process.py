"""A process beside an identification that draws its page: it loads what that needs while the identification
loads its own, draws the check run as soon as it is known, and the rest at the end.

Matplotlib, its fonts and the template take half a second of Python, and the figures two, which threads of one
interpreter cannot share with the search. The process is forked before there are threads and before a GPU is
used.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from multiprocessing import Pipe
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dic.forks import Later, begun, beside, can_fork, cores
from kolsky.base.process import infrequent_gc

if TYPE_CHECKING:
    from kolsky.inverse.check_run import CheckRun
    from kolsky.inverse.result import Identification
    from kolsky.shot.recorded import Recorded

MOST_DRAWERS = 4
"""Most processes that draw a page: the figure that takes longest takes a quarter of what all take."""
PATIENCE = 5
"""By how much the niceness of a process grows that draws beside the identification: it gets a quarter of a
core that the search works on too. With 10 it would get a tenth, and on a busy machine the page would wait."""


def drawers() -> int:
    """Processes that draw a page when nothing else is done: as many as there are cores, 2 to 4."""
    return min(max(cores(), 2), MOST_DRAWERS)


def load_identify_page() -> None:
    """Import what the page of an identification is drawn with, Matplotlib above all, and load its fonts.

    Of use in a thread while simulations run, which need no interpreter, see `dic.forks.beside`.
    """
    import matplotlib.backends.backend_svg  # noqa: F401

    from kolsky.report.canvas import load_drawing
    from kolsky.report.pages.identification import load_template

    load_drawing()
    load_template()


class PageProcess:
    """The process that draws; what it does not deliver is drawn here.

    Parameters
    ----------
    tell : callable
        Sends to it.
    drawn
        Waits until it has written the page.
    """

    def __init__(self, tell: Callable[[Any], None], drawn: Later[None]) -> None:
        self._tell, self._drawn = tell, drawn
        self._ahead: CheckRun | None = None

    def draw_ahead(self, run: CheckRun) -> None:
        """Let the figures of a check run be drawn while nobody waits for them."""
        if self._ahead is None:
            self._ahead = run
            self._tell(run)

    def begin(self, path: Path, found: Identification, recordings: Recorded) -> Later[None]:
        """Let the page of an identification be written to a file; the result waits for it.

        Figures drawn ahead are used if they are of the check run that the identification has.
        """
        known = self._ahead is not None and self._ahead.is_of(found)
        self._tell((path, found, recordings, known))
        return self._drawn


@contextmanager
def page_process(processes: int) -> Iterator[PageProcess | None]:
    """Fork a process that draws the page of an identification; it ends with the block.

    Parameters
    ----------
    processes
        Processes that draw, this new one among them; see `dic.forks.side_by_side`.

    Yields
    ------
    PageProcess or None
        None with one process, and where a fork is not safe or of no use.
    """
    if processes < 2 or not can_fork():
        yield None
        return
    taken, handed = Pipe(duplex=False)
    here, told = os.getpid(), list[Any]()

    def draw() -> None:
        if os.getpid() == here:  # the process is gone, without the page
            _write(*told[-1][:3], processes=processes)
        else:
            _draw(taken.recv, processes)

    with beside(draw, fork=True) as drawn, handed:
        taken.close()  # or else a process that is gone would be waited for

        def tell(what: Any) -> None:
            told.append(what)
            with suppress(OSError):  # it is gone
                handed.send(what)

        yield PageProcess(tell, drawn)


def _draw(take: Callable[[], Any], processes: int) -> None:
    """Load what a page needs, draw ahead what is told of, and write the page."""
    gc.freeze()  # what is loaded by now is not looked through, which would copy it
    with infrequent_gc(), ExitStack() as stack:
        load_identify_page()
        told, ahead = take(), dict[str, Callable[[], str]]()
        if not isinstance(told, tuple):
            ahead = stack.enter_context(_drawn_ahead(told, processes))
            told = take()
        *page, known = told
        _write(*page, processes=processes, ahead=ahead if known else {})


def _write(*page: Any, processes: int, ahead: dict[str, Callable[[], str]] | None = None) -> None:
    from kolsky.report.pages.identification import write_report

    write_report(*page, processes=processes, ahead=ahead)


@contextmanager
def _drawn_ahead(run: CheckRun, processes: int) -> Iterator[dict[str, Callable[[], str]]]:
    """Begin to draw the figures of a check run beside the identification; yields each by its name.

    The one that is asked for first draws what nobody has begun by then.
    """
    from kolsky.report.canvas import inline_svg
    from kolsky.report.figures import figures_of

    kinds = [kind for kind in figures_of(run).values() if kind.applies(run)]
    draw = standing_back(lambda k: inline_svg(kinds[k], run))
    last_first = range(len(kinds))[::-1]
    with begun([partial(draw, k) for k in last_first], processes=processes) as joined:
        drawn = Later(joined)
        yield {kinds[k].name: partial(_item, drawn, place) for place, k in enumerate(last_first)}


def standing_back(work: Callable[[int], str]) -> Callable[[int], str]:
    """The same work; a process other than this one is nicer than this one by `PATIENCE` while it does it."""
    here, usual = os.getpid(), os.getpriority(os.PRIO_PROCESS, 0)

    def done(k: int) -> str:
        if os.getpid() != here and os.getpriority(os.PRIO_PROCESS, 0) == usual:
            os.nice(PATIENCE)
        return work(k)

    return done


def _item(drawn: Later[list[str]], place: int) -> str:
    return drawn()[place]
