"""Page-locked memory for results from a GPU, lent to them and used again when they are gone.

The device copies into it at the speed of the bus, on the stream of the launch, and what arrives is the
result: nothing is copied again. To lock pages takes longer than to fill them, so a process keeps what it has
locked.
"""

from threading import Lock
from typing import Any
from weakref import finalize

import numpy as np
import warp as wp

from explicit.arrays import FloatArray

STEP = 1 << 17
"""Pieces are multiples of so many numbers of float64, 1 MiB."""
LIMIT = 1 << 25
"""Most numbers of float64 that a process locks, 256 MiB: other processes have no use of locked memory."""


class Piece:
    """A piece of memory on the host.

    Parameters
    ----------
    memory
        Its Warp array.
    """

    def __init__(self, memory: Any) -> None:
        self.memory = memory
        self._arrival: Any = None

    def fill(self, source: Any, stream: Any) -> Any:
        """Copy a Warp array of a device into it, on a stream; returns the event of its arrival."""
        wp.copy(self.memory, source, count=source.size, stream=stream)
        self._arrival = stream.record_event()
        return self._arrival

    def wait(self) -> None:
        """Wait until nothing is on its way any more."""
        if self._arrival is not None:
            wp.synchronize_event(self._arrival)


class _Owner:
    """What NumPy keeps alive for every view of a piece."""

    def __init__(self, memory: Any, count: int) -> None:
        self.__array_interface__ = {
            "data": (memory.ptr, False), "shape": (count,), "typestr": "<f8", "version": 3,
        }  # fmt: skip


class Pool:
    """Pieces of page-locked memory, the smallest that is large enough first.

    Parameters
    ----------
    limit
        Most numbers in all pieces together.
    pinned
        False for ordinary memory, where there is no GPU to lock pages for.
    """

    def __init__(self, limit: int = LIMIT, *, pinned: bool = True) -> None:
        self._free: list[Piece] = []
        self._room, self._pinned, self._lock = limit, pinned, Lock()

    def lend(self, count: int) -> tuple[Piece, FloatArray] | None:
        """A piece for `count` numbers and these numbers, or None where all that may be locked is in use.

        The piece is lent again when neither the numbers nor a view of them live any more.
        """
        with self._lock:
            # Only appended to by others meanwhile, so that a place in the list stays what it is.
            fitting = [
                (piece.memory.size, place)
                for place, piece in enumerate(tuple(self._free))
                if count <= piece.memory.size <= 2 * count + STEP
            ]
            piece = (
                self._free.pop(min(fitting)[1]) if fitting else self._new(-(-max(count, 1) // STEP) * STEP)
            )
        if piece is None:
            return None
        piece.wait()
        owner = _Owner(piece.memory, count)
        # Without the lock: whoever holds it may be interrupted by the collection of a result.
        finalize(owner, self._free.append, piece).atexit = False
        return piece, np.asarray(owner)

    def _new(self, size: int) -> Piece | None:
        while self._free and size > self._room:
            unused = self._free.pop(0)
            unused.wait()
            self._room += unused.memory.size
        if size > self._room:
            return None
        self._room -= size
        return Piece(wp.empty(size, dtype=wp.float64, device="cpu", pinned=self._pinned))


POOL = Pool()
"""The pieces of this process."""
