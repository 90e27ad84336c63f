"""Shared launches of threads. They begin when all threads are ready."""

import ctypes
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from explicit.simd.team import LINE, MET, MOST_LOOKS, STATE, Seats

LONG = MOST_LOOKS  # number of polls of a patient thread: a core with other work returns earlier
NAP = 5e-5  # time of a thread's absence [s]. It is short, so the thread returns often.


@ctypes.CFUNCTYPE(None, ctypes.c_uint)
def short_nap(_microseconds: int) -> None:
    """A sleep of constant length, independent of the request."""
    time.sleep(NAP)


class FullSeats(Seats):
    """Seats whose run begins when all threads are ready."""

    def __init__(self, n_elements: int, seats: int, where: Any, patience: int) -> None:
        super().__init__(n_elements, seats, where)
        address = ctypes.cast(short_nap, ctypes.c_void_p).value
        assert address is not None
        self.nap, self.ready, self.patience = address, MOST_LOOKS, patience

    def team(self, seat: int) -> Any:
        """The argument of a thread. That of the first thread is requested last."""
        others = self.words.numpy()[STATE + LINE : STATE + self.seats * LINE : LINE]
        until = time.monotonic() + 20.0
        while seat == 0 and not (others == 1).all():
            assert time.monotonic() < until, "threads that have not come"
            time.sleep(1e-5)
        return super().team(seat)

    def met(self) -> int:
        """Number of times that the threads have met."""
        return int(self.words.numpy()[MET])


def launch_shared(launch: Callable[[Any], None], seats: FullSeats) -> int:
    """Launch in every seat. Returns how often the threads met."""
    with ThreadPoolExecutor(seats.seats - 1) as pool:
        others = [pool.submit(lambda k=k: launch(seats.team(k))) for k in range(1, seats.seats)]
        try:
            launch(seats.team(0))
        finally:
            seats.close()
        for other in others:
            other.result()
    return seats.met()
