"""Support for the simulations of an identification: progress, wall time, several models in parallel."""

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
    """Reports the progress of stages, if ``progress`` is given, and records their wall time."""

    def __init__(self, progress: Progress | None = None) -> None:
        self.progress: Progress = progress or (lambda stage, done, total: None)
        self.seconds: dict[str, float] = {}
        """Wall time by stage [s]."""

    @contextmanager
    def stage(self, name: str, runs: int | None = None) -> Iterator[Callable[[int], None]]:
        """Time a block of ``runs`` runs in a stage; yields a function to call with the runs just finished."""
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
    """Runs of one model, executed in parallel with runs of other models, see `run_side_by_side`."""

    forward: Forward
    points: Mapping[str, ArrayLike]
    numerics: Numerics
    motion: ArrayLike = 0
    material: ArrayLike = 0


def run_side_by_side(launches: Sequence[Launch]) -> list[explicit.Response]:
    """Run several models in parallel; each result is bit-identical to that of `Forward.run`, as its errors.

    Runs with a correction for Poisson's ratio follow each other, because each already uses three meshes.
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
