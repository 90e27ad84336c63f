"""A process that draws the page of an identification or of a correlation beside it: it loads what that needs
while the command loads its own, draws what it can as soon as that is known, and the rest at the end.

Matplotlib, its fonts and the template take half a second of Python, and the figures two, which threads of one
interpreter cannot share with the work. The process is forked before there are threads and before a GPU is
used.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dic.processes import PendingResult, WorkerProcess, background_pool, can_fork, cores, worker_process
from kolsky.base.process import infrequent_gc

if TYPE_CHECKING:
    from dic.result import StereoResult
    from kolsky.bars.flyer.flight import FlightOfSpecimen
    from kolsky.inverse.result import CheckRun, Identification
    from kolsky.report.picture_views import SurfaceView
    from kolsky.shot.recordings import ShotRecordings

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

    Of use in a thread while simulations run, which need no interpreter, see `dic.processes.background`.
    """
    import matplotlib.backends.backend_svg  # noqa: F401

    from kolsky.report.canvas import load_drawing
    from kolsky.report.pages.identification import load_template

    load_drawing()
    load_template()


def load_surface_page() -> None:
    """Import what the page of `kolsky dic` is drawn with, and load its fonts: as `load_identify_page`."""
    import matplotlib.backends.backend_svg  # noqa: F401

    import kolsky.report.pages.surfaces  # noqa: F401
    from kolsky.report.canvas import load_drawing

    load_drawing()


class PageProcess:
    """The process that draws the page of an identification; what it does not deliver is drawn here.

    ``process``: the process, told of a check run, of nothing or of several, and of the page.
    """

    def __init__(self, process: WorkerProcess[None]) -> None:
        self._process = process
        self._ahead: CheckRun | None = None

    def draw_ahead(self, run: CheckRun) -> None:
        """Let the figures of a check run be drawn while nobody waits for them."""
        if self._ahead is None:
            self._ahead = run
            self._process.tell(run)

    def begin(self, path: Path, found: Identification, recordings: ShotRecordings) -> PendingResult[None]:
        """Let the page of an identification be written to a file; the result waits for it.

        Figures drawn ahead are used if they are of the check run that the identification has.
        """
        known = self._ahead is not None and self._ahead.is_of(found)
        self._process.tell((path, found, recordings, known))
        return self._process.result


@contextmanager
def page_process(processes: int) -> Iterator[PageProcess | None]:
    """Fork a process that draws the page of an identification; it ends with the block.

    Parameters
    ----------
    processes
        Processes that draw, this new one among them; see `dic.processes.run_parallel`.

    Yields
    ------
    PageProcess or None
        None with one process, and where a fork is not safe or of no use.
    """
    if processes < 2 or not can_fork():
        yield None
        return
    with worker_process(
        lambda take: _draw(take, processes), lambda told: _write(*told[-1][:3], processes=processes)
    ) as process:
        yield PageProcess(process)


class SurfacePageProcess:
    """The process that draws the page of `kolsky dic`; what it does not deliver is drawn here.

    ``process``: the process, told of a view without the flyer's flight, and of the page.
    """

    def __init__(self, process: WorkerProcess[None]) -> None:
        self._process = process
        self._ahead: SurfaceView | None = None

    def draw_ahead(self, view: SurfaceView) -> None:
        """Let the figures of a result be drawn whose flight is not known yet."""
        self._ahead = view
        self._process.tell(view)

    def view_of(self, result: StereoResult) -> SurfaceView | None:
        """The view that is drawn ahead, if it is of this result."""
        return self._ahead if self._ahead is not None and self._ahead.result is result else None

    def begin(self, path: Path, view: SurfaceView, inputs: Mapping[str, str]) -> PendingResult[None]:
        """Let the page be written to a file; the result waits for it."""
        if self.view_of(view.result) is None:
            self.draw_ahead(view)
        self._process.tell((path, view.flight, dict(inputs)))
        return self._process.result


@contextmanager
def surface_page_process(processes: int) -> Iterator[SurfacePageProcess | None]:
    """Fork a process that draws the page of `kolsky dic`: as `page_process`."""
    if processes < 2 or not can_fork():
        yield None
        return
    with worker_process(
        lambda take: _draw_surfaces(take, processes),
        lambda told: _write_surfaces(told[-2], *told[-1], processes=processes),
    ) as process:
        yield SurfacePageProcess(process)


def _draw_surfaces(take: Callable[[], Any], processes: int) -> None:
    """Load what the page needs, draw what is known without the flight, and write the page."""
    gc.freeze()
    with infrequent_gc(), ExitStack() as stack:
        load_surface_page()
        told, ahead = take(), dict[str, Callable[[], str]]()
        while not isinstance(told, tuple):  # the latest view is that of the page
            view, ahead = told, stack.enter_context(_drawn_ahead(told, processes))
            told = take()
        _write_surfaces(view, *told, processes=processes, ahead=ahead)


def _write_surfaces(
    view: SurfaceView,
    path: Path,
    flight: FlightOfSpecimen | str,
    inputs: Mapping[str, str],
    *,
    processes: int,
    ahead: dict[str, Callable[[], str]] | None = None,
) -> None:
    from kolsky.report.pages.surfaces import write_page

    write_page(path, replace(view, flight=flight), inputs, processes=processes, ahead=ahead)


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
def _drawn_ahead(run: CheckRun | SurfaceView, processes: int) -> Iterator[dict[str, Callable[[], str]]]:
    """Begin to draw the figures of a result beside the rest of the work; yields each by its name.

    The one that is asked for first draws what nobody has begun by then.
    """
    from kolsky.report.canvas import inline_svg
    from kolsky.report.figures import figures_of

    kinds = [kind for kind in figures_of(run).values() if kind.applies(run)]
    draw = standing_back(lambda k: inline_svg(kinds[k], run))
    last_first = range(len(kinds))[::-1]
    with background_pool([partial(draw, k) for k in last_first], processes=processes) as joined:
        drawn = PendingResult(joined)
        yield {kinds[k].name: partial(_item, drawn, place) for place, k in enumerate(last_first)}


def standing_back(work: Callable[[int], str]) -> Callable[[int], str]:
    """The same work; a process other than this one is nicer than this one by `PATIENCE` while it does it."""
    here, usual = os.getpid(), os.getpriority(os.PRIO_PROCESS, 0)

    def done(k: int) -> str:
        if os.getpid() != here and os.getpriority(os.PRIO_PROCESS, 0) == usual:
            os.nice(PATIENCE)
        return work(k)

    return done


def _item(drawn: PendingResult[list[str]], place: int) -> str:
    return drawn()[place]
