"""Output on a terminal: progress of the work on stderr, the answer on stdout.

Standard output holds the answer, with `--json` exactly one object; all else goes to standard error. Names
come from files and folders of anybody: a character that would steer the terminal is shown as its escape.
"""

import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any

from dic.files import one_line
from kolsky.results.nomenclature import STAGES
from kolsky.results.numbers import columns

if TYPE_CHECKING:
    from doe.ledger import Pace


_QUIET: ContextVar[bool] = ContextVar("quiet", default=False)


def is_quiet() -> bool:
    """True within a command with `--quiet`."""
    return _QUIET.get()


@contextmanager
def quietly(asked: bool) -> Iterator[None]:
    """Let everything inside be quiet, if asked for."""
    token = _QUIET.set(asked)
    try:
        yield
    finally:
        _QUIET.reset(token)


_EVERY = 60.0
"""Least time between two lines of a sweep that writes to no terminal [s]."""


def print_result(
    rows: Mapping[str, Any],
    said: Any,
    *,
    rest: Mapping[str, Any],
    answers: Iterable[str] = (),
    warnings: Iterable[str] = (),
) -> None:
    """Print the answer on stdout, as lines or as one JSON object, and the warnings on stderr.

    ``rows``: the answer by name, for a table. ``said``: the answer as one object for JSON; None where a table
    is wanted. ``rest``: where files are, how long it took; on stderr where JSON is printed. ``answers``:
    lines before the table. ``warnings``: what to know before using the answer.
    """
    if is_quiet():
        rest = {}
    if said is None:
        print("\n".join(map(one_line, [*answers, *columns({**rows, **rest})])))
    else:
        print(json.dumps(said, indent=2, allow_nan=False))
        if rest:
            print("\n".join(map(one_line, columns(rest))), file=sys.stderr)
    for warning in warnings:
        print(one_line(f"warning: {warning}"), file=sys.stderr)


def since(started: float) -> str:
    """Seconds since `started`, a value of `time.perf_counter`, as printed."""
    return f"{time.perf_counter() - started:.1f} s"


@contextmanager
def progress_bars() -> Iterator[Callable[[str, int, int], None]]:
    """A progress bar a stage on stderr; nothing if that is no terminal.

    Yields: called with the stage's name, the runs done and the runs there are to do.
    """
    if is_quiet() or not sys.stderr.isatty():
        yield lambda stage, done, total: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:<30}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True)) as progress:
        tasks: dict[str, Any] = {}

        def report(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = progress.add_task(STAGES.get(stage, stage), total=total)
            progress.update(tasks[stage], completed=done, total=total)

        yield report


def counted(progress: Callable[[str, int, int], None], stage: str, total: int) -> Callable[[int], None]:
    """A callback for runs just finished that shows their sum as the progress of one stage."""
    done = 0

    def report(n: int) -> None:
        nonlocal done
        done += n
        progress(stage, done, total)

    return report


@contextmanager
def sweep_progress() -> Iterator[Callable[["Pace"], None]]:
    """A sweep's bar with its rate and the time left on stderr; a line a minute if that is no terminal.

    Yields: called with a `doe.ledger.Pace`.
    """
    if is_quiet():
        yield lambda pace: None
        return
    if not sys.stderr.isatty():
        last = time.monotonic()

        def say(pace: "Pace") -> None:
            nonlocal last
            if time.monotonic() - last >= _EVERY:
                last = time.monotonic()
                print(f"{pace.finished} of {pace.total} runs, {_pace(pace)}", file=sys.stderr, flush=True)

        yield say
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (TextColumn("sweep"), BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[pace]}"))
    with Progress(*columns, console=Console(stderr=True)) as progress:
        task = progress.add_task("sweep", total=None, pace="")
        yield lambda pace: progress.update(task, completed=pace.finished, total=pace.total, pace=_pace(pace))


def _pace(pace: "Pace") -> str:
    """Runs a second and the time left, in words."""
    if pace.rate <= 0.0:
        return ""
    minutes, seconds = divmod(round(pace.seconds_left), 60)
    return f"{pace.rate:.3g} runs/s, {minutes // 60}:{minutes % 60:02d}:{seconds:02d} left"
