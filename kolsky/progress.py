"""Progress on a terminal: a bar for every stage of the work."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from kolsky.report.labels import STAGES


@contextmanager
def bars() -> Iterator[Callable[[str, int, int], None]]:
    """A progress bar a stage on stderr; nothing if that is no terminal.

    Yields
    ------
    callable
        Called with the stage's name, the runs done and the runs there are to do.
    """
    if not sys.stderr.isatty():
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
