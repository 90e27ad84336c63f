"""Output on a terminal: progress of the work on stderr, the answer on stdout.

Standard output contains the result, with `--json` exactly one object. Everything else goes to standard error.
Names come from files and folders of any origin. A control character is shown as its escape sequence.
"""

import json
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dic.files import one_line
from kolsky.results.nomenclature import STAGES
from kolsky.results.numbers import columns

if TYPE_CHECKING:
    from doe.ledger import Pace


@dataclass(frozen=True)
class _Printing:
    """The print settings of a command, and the time of its start."""

    as_json: bool = False
    quiet: bool = False
    started: float | None = None


_OUTSIDE = _Printing()
_PRINTING: ContextVar[_Printing] = ContextVar("printing", default=_OUTSIDE)
_EVERY = float(os.environ.get("KOLSKY_PROGRESS_EVERY", "60"))
"""Smallest time between two lines of progress if the output is not a terminal [s]. `kolsky open` uses 1."""


def is_quiet() -> bool:
    """True within a command with `--quiet`."""
    return _PRINTING.get().quiet


def as_json() -> bool:
    """True within a command with `--json`."""
    return _PRINTING.get().as_json


@contextmanager
def printing(*, as_json: bool = False, quiet: bool = False) -> Iterator[None]:
    """Context that prints according to `--json` and `--quiet`. Its wall time begins on entry."""
    token = _PRINTING.set(_Printing(as_json, quiet, time.perf_counter()))
    try:
        yield
    finally:
        _PRINTING.reset(token)


def print_json(answer: Any) -> None:
    """Print one JSON object on stdout."""
    print(json.dumps(answer, indent=2, allow_nan=False))


def print_result(
    rows: Mapping[str, Any],
    answer: Any,
    *,
    files: Mapping[str, Any] | None = None,
    lines: Iterable[str] = (),
    warnings: Iterable[str] = (),
) -> None:
    """Print the answer on stdout, as lines or with `--json` as one object, and the warnings on stderr.

    ``rows``: the answer by name, for a table. ``answer``: the same as one object for JSON. ``files``: paths
    of the results, printed with the wall time, on stderr if JSON is printed. ``lines``: text before the
    table.
    """
    how = _PRINTING.get()
    places = {} if how.quiet else dict(files or {})
    if how.started is not None and not how.quiet:
        places["wall time"] = f"{time.perf_counter() - how.started:.1f} s"
    if how.as_json:
        print_json(answer)
        if places:
            print("\n".join(map(one_line, columns(places))), file=sys.stderr)
    else:
        print("\n".join(map(one_line, [*lines, *columns({**rows, **places})])))
    for warning in warnings:
        print(one_line(f"warning: {warning}"), file=sys.stderr)


@contextmanager
def progress_bars() -> Iterator[Callable[..., None]]:
    """One line on stderr, removed at the end; without a terminal, one line per minute.

    Yields: function of the stage's name, the number of finished runs and the total number. A fourth argument
    is the pace of the stage in words, if it is known.
    """
    if is_quiet():
        yield lambda stage, done, total, pace="": None
        return
    started = time.monotonic()
    if not sys.stderr.isatty():
        last, shown, begun, first = started, "", started, 0

        def print_stage(stage: str, done: int, total: int, pace: str = "") -> None:
            nonlocal last, shown, begun, first
            now = time.monotonic()
            if stage != shown:
                shown, begun, first = stage, now, done
            if now - last >= _EVERY:
                last = now
                words = pace or f"{_clock(now - started)} since the start"
                if done > first and not pace:
                    left = (now - begun) / (done - first) * (total - done)
                    words += f", {_clock(left)} left of this stage"
                print(f"{STAGES.get(stage, stage)}: {done} of {total}, {words}", file=sys.stderr, flush=True)

        yield print_stage
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description:<30}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
        TextColumn("left of this stage, {task.fields[since]} since the start{task.fields[pace]}"),
    )  # fmt: skip
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        task, shown = progress.add_task("", total=None, since="0:00:00", pace=""), ""

        def report(stage: str, done: int, total: int, pace: str = "") -> None:
            nonlocal shown
            since = _clock(time.monotonic() - started)
            fields: dict[str, Any] = {"since": since, "pace": f"; {pace}" if pace else ""}
            if stage != shown:
                shown = stage
                progress.reset(task, description=STAGES.get(stage, stage), total=total, **fields)
            progress.update(task, completed=done, total=total, **fields)

        yield report


def counted(progress: Callable[[str, int, int], None], stage: str, total: int) -> Callable[[int], None]:
    """A callback for numbers of finished runs that shows their sum as the progress of one stage."""
    done = 0

    def report(n: int) -> None:
        nonlocal done
        done += n
        progress(stage, done, total)

    return report


@contextmanager
def sweep_progress() -> Iterator[Callable[["Pace"], None]]:
    """As `progress_bars`, with rate and remaining time of a sweep. Yields: function of its `Pace`."""
    with progress_bars() as progress:
        yield lambda pace: progress("sweep", pace.finished, pace.total, _pace(pace))


def _pace(pace: "Pace") -> str:
    """Runs per second and remaining time, as text."""
    if pace.rate <= 0.0:
        return ""
    return f"{pace.rate:.3g} runs/s, {_clock(pace.seconds_left)} left"


def _clock(seconds: float) -> str:
    """A time as hours, minutes and seconds."""
    minutes, whole = divmod(round(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02d}:{whole:02d}"
