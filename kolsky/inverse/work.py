"""What the simulations of an identification are made with: progress, seconds, several models at once."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

from numpy.typing import ArrayLike

import explicit
from kolsky.inverse.forward import Forward, in_surroundings
from kolsky.inverse.settings import Numerics

Progress = Callable[[str, int, int], None]
"""Called as ``progress(stage, runs done, runs in the stage)``."""


class Work:
    """Tells the progress of stages and keeps their seconds.

    ``progress``: notified of every stage; nobody is if it is left out.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self.progress: Progress = progress or (lambda stage, done, total: None)
        self.seconds: dict[str, float] = {}
        """Wall time by stage [s]."""

    @contextmanager
    def stage(self, name: str, runs: int | None = None) -> Iterator[Callable[[int], None]]:
        """Time a block as part of a stage.

        ``runs``: how many are made in it; None tells nobody. Yields: what is told of runs just finished.
        """
        done, started = 0, time.perf_counter()

        def report(more: int) -> None:
            nonlocal done
            done += more
            if runs is not None:
                self.progress(name, done, runs)

        report(0)
        try:
            yield report
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - started


@dataclass(frozen=True)
class Launch:
    """Runs of one model, to be made at the same time as those of others, see `run_side_by_side`."""

    forward: Forward
    """The shot."""
    points: Mapping[str, ArrayLike]
    """As of `Forward.run`."""
    numerics: Numerics
    """As of `Forward.run`."""
    motion: ArrayLike = 0
    """As of `Forward.run`."""
    material: ArrayLike = 0
    """As of `Forward.run`."""


def run_side_by_side(launches: Sequence[Launch]) -> list[explicit.Response]:
    """Run several models at once, each with the same bits as `Forward.run` alone.

    What is corrected for Poisson's ratio runs one after the other: it is three meshes already.

    Raises
    ------
    ValueError
        As `Forward.run`.
    """
    if len(launches) < 2 or any(one.numerics.compressible is not None for one in launches):
        return [
            one.forward.run(one.points, one.numerics, motion=one.motion, material=one.material)
            for one in launches
        ]
    problems = [
        one.forward.problem(one.points, one.numerics, motion=one.motion, material=one.material)
        for one in launches
    ]
    numerics = launches[0].numerics
    return in_surroundings(
        [one.forward.shot for one in launches],
        problems,
        partial(explicit.run_side_by_side, device=numerics.device, threads=numerics.threads),
    )
