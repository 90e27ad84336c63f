"""A launch of a time loop on a CPU, and threads that join it when they have nothing else to do."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any

from explicit.simd.team import MOST_SEATS, Seats, alone

ELEMENTS_EACH = 768
"""Elements of a thread, at least: with fewer, the threads meet too often."""


class SharedRun:
    """One launch, of one simulation or of a pack.

    Parameters
    ----------
    begin
        Makes the launch when it is its turn: to be called with the argument of each thread, see
        `explicit.simd.team`.
    count
        Simulations of the launch.
    n_elements
        Elements of a simulation that several threads can share, 0 for others.
    where
        The Warp device.
    """

    def __init__(
        self, begin: Callable[[], Callable[[Any], None]], count: int, n_elements: int, where: Any
    ) -> None:
        self.count = count
        self._begin, self._n_elements, self._where = begin, n_elements, where
        self._seats = 1
        self._begun: Future[tuple[Callable[[Any], None], Seats] | None] = Future()

    def offer(self, threads: int) -> Sequence[Callable[[], None]]:
        """Let so many threads share it: what those do that join, before or after it begins."""
        self._seats = max(1, min(threads, self._n_elements // ELEMENTS_EACH, MOST_SEATS))
        return [lambda seat=seat: self._join(seat) for seat in range(1, self._seats)]  # type: ignore[misc]

    def run(self) -> int:
        """Run it whole; how many simulations these were."""
        try:
            launch = self._begin()
            if self._seats == 1:
                launch(alone())
                return self.count
            seats = Seats(self._n_elements, self._seats, self._where)
            try:
                self._begun.set_result((launch, seats))
                launch(seats.team(0))
            finally:
                seats.close()
        finally:
            if not self._begun.done():  # who wants to join need not wait
                self._begun.set_result(None)
        return self.count

    def _join(self, seat: int) -> None:
        begun = self._begun.result()
        if begun is not None:
            launch, seats = begun
            launch(seats.team(seat))
