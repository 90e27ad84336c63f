"""Histories of a large batch from a GPU to the host, while others of its simulations still run.

What fits into `explicit.page_locked` needs none of this. A copy into ordinary memory runs at a tenth of what
the bus can do, and nothing else happens meanwhile. Here pieces go through page-locked memory: the device
fills one piece while threads empty others.
"""

from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from typing import Any

import numpy as np
import warp as wp

from explicit.arrays import FloatArray

HISTORIES = ("force", "impulse", "position", "energy", "ending")
"""The arrays of an output, samples first, one behind the other in its memory."""
PIECE = 1 << 20
"""Numbers of float64 in a piece, 8 MiB: long enough for the bus, short enough to be locked quickly."""
PIECES = 8
"""Pieces of page-locked memory that a process keeps for each device."""
THREADS = 4
"""Threads that empty them: one reaches less than a GPU delivers."""


class HostTransfer:
    """The histories of one batch copied to the host.

    Parameters
    ----------
    output
        The time loop's output on a CUDA device.
    device
        The device.
    """

    def __init__(self, output: Any, device: Any) -> None:
        self._sources = {name: getattr(output, name) for name in HISTORIES}
        self._arrays = {name: np.empty(array.shape) for name, array in self._sources.items()}
        self._stream, self._buffers = streams(device.alias)[-1], _buffers(device.alias)
        self._emptied: list[Future[None] | None] = [None] * PIECES
        self._sent = 0

    def touch_memory(self, count: int) -> None:
        """Touch the memory that the first `count` simulations need, while the device is still at work: the
        system hands it out page by page, which takes longer than to fill it."""
        for target in self._arrays.values():
            target[:count] = 0.0

    def send(self, first: int, count: int, after: Any) -> None:
        """Bring the histories of simulations `first` to `first + count`, once the event `after` happened."""
        self._stream.wait_event(after)
        for name, source in self._sources.items():
            flat, target = source.flatten(), self._arrays[name].reshape(-1)
            each = int(np.prod(source.shape[1:]))
            for begin in range(first * each, (first + count) * each, PIECE):
                self._send_piece(flat, target, begin, min(PIECE, (first + count) * each - begin))

    def collect(self) -> dict[str, FloatArray]:
        """All histories by name, once they are complete."""
        for future in self._emptied:
            if future is not None:
                future.result()
        return self._arrays

    def _send_piece(self, source: Any, target: FloatArray, begin: int, size: int) -> None:
        slot = self._sent % PIECES
        self._sent += 1
        before = self._emptied[slot]
        if before is not None:
            before.result()
        buffer = self._buffers[slot]
        wp.copy(buffer, source, src_offset=begin, count=size, stream=self._stream)
        arrived = self._stream.record_event()

        def empty() -> None:
            wp.synchronize_event(arrived)
            target[begin : begin + size] = buffer.numpy()[:size]

        self._emptied[slot] = _pool().submit(empty)


@cache
def streams(device: str) -> tuple[Any, Any, Any]:
    """Three streams that a process keeps for a device: two for launches in turn, one for copies."""
    return wp.Stream(device), wp.Stream(device), wp.Stream(device)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(THREADS, thread_name_prefix="host-transfer")


@cache
def _buffers(device: str) -> list[Any]:
    """Page-locked pieces of a process: to lock them takes longer than to fill them."""
    return [wp.empty(PIECE, dtype=wp.float64, device="cpu", pinned=True) for _ in range(PIECES)]
