"""Parallel work of an identification: batches of several models at once, threads beside a single run.

`run_side_by_side` runs several models together. A single run on a refined mesh leaves a core idle;
`IdleCore` holds work for it, `in_thread` runs work in a thread beside a block, `EarlyRun` starts the
finest mesh-error run before the answer is confirmed. None of them changes a number.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

import explicit
from dic.processes import PendingResult, background
from explicit import Response
from explicit.device import select_device
from kolsky.base.arrays import FloatArray
from kolsky.inverse.forward import Forward, Numerics, graded, in_surroundings
from kolsky.inverse.problem import Settings


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


Result = TypeVar("Result")

SWITCH_INTERVAL = 1e-4
"""Longest wait for the interpreter beside a run [s]. A run begins with a hundred calls that let go of it, and
would wait Python's 5 ms for it after each."""


def leaves_a_core(device: str, threads: int | None) -> bool:
    """Whether a lone run leaves a core idle on which other runs may be made: on a CPU, with more than one."""
    return (threads or os.cpu_count() or 1) > 1 and not select_device(device).is_cuda


@contextmanager
def in_thread(work: Callable[[], Result], *, idle: bool = True) -> Iterator[PendingResult[Result]]:
    """Do work in a thread beside the block, if a core is idle in it; else when its result is asked for.

    Yields: gives the result, or raises what the work raised.
    """
    if not idle:
        yield PendingResult(work)
        return
    before = sys.getswitchinterval()
    sys.setswitchinterval(SWITCH_INTERVAL)
    try:
        with background(work, fork=False) as done:
            yield done
    finally:
        sys.setswitchinterval(before)


def start_in_thread(work: Callable[[], Result]) -> PendingResult[Result]:
    """Begin work in a thread, which goes on when the caller has returned.

    For work that is lost without harm if nobody asks for its result.
    """
    pool = ThreadPoolExecutor(1)
    found = pool.submit(work)
    pool.shutdown(wait=False)
    return PendingResult(found.result)


class IdleCore:
    """Works that wait for a lone run on the refined mesh, and are then done in a thread beside it.

    Each is what would otherwise be loaded or run where it is first used, so that nothing is missing where no
    run is alone. None of them changes a number.

    Parameters
    ----------
    waiting
        The works, in their order.
    """

    def __init__(self, waiting: Sequence[Callable[[], object]] = ()) -> None:
        self._waiting: tuple[Callable[[], object], ...] = tuple(waiting)
        self._put_off: tuple[Callable[[], object], ...] = ()

    def put_off(self, work: Callable[[], Result]) -> PendingResult[Result]:
        """Let runs wait for a lone run beside which nothing is loaded, or until they are asked for."""
        found = PendingResult(work)
        self._put_off = (*self._put_off, found)
        return found

    @contextmanager
    def used(self, *, idle: bool) -> Iterator[None]:
        """Do what is waiting beside the block, if a core is idle in it; what it raises is raised here."""
        works: tuple[Callable[[], object], ...] = ()
        if idle and self._waiting:
            works, self._waiting = self._waiting, ()
        elif idle:
            works, self._put_off = self._put_off, ()
        if not works:
            yield
            return
        with in_thread(lambda: [work() for work in works]) as done:
            yield
            done()


PROBABLY_CONFIRMED = 1.0
"""Step in standard deviations behind which the next run is probably confirmed [-]: a step with the slopes of
the coarser mesh leaves about a tenth, and a fifth is confirmed."""


@dataclass(frozen=True)
class EarlyRun:
    """A run on the finest graded mesh that is at work."""

    x: FloatArray
    """Where, shape [d]."""
    forward: Forward
    """Of what: under another path of the front face it is another run."""
    response: Callable[[], Response]
    """Waits for it."""

    @classmethod
    def begun(
        cls, forward: Forward, settings: Settings, names: Sequence[str], x: FloatArray
    ) -> EarlyRun | None:
        """Begin the run of a point on one thread; None where no core is idle beside a run.

        Parameters
        ----------
        forward, settings
            The shot under the path as it is now, and what is held.
        names, x
            The free parameters, and the point in SI, shape [d].
        """
        numerics = settings.numerics
        if numerics.compressible is not None or not leaves_a_core(numerics.device, numerics.threads):
            return None
        values = {**settings.held, **dict(zip(names, x.tolist(), strict=True))}
        alone = replace(graded(numerics, settings.refined_mesh), threads=1)
        return cls(x, forward, start_in_thread(lambda: forward.run(values, alone)))

    def is_of(self, forward: Forward, x: FloatArray) -> bool:
        """True if it is the run of a point under that very path."""
        return self.forward is forward and np.array_equal(self.x, x)
