"""Points to a device and back through page-locked memory, in parts: some are copied, others searched.

What a search is given and what it finds are numbers of points, column after column. Page-locked memory is
what a GPU copies by itself, beside its own work and the host's; it is kept from one call to the next, for to
lock a page takes longer than to fill it. A call of few points is one part.
"""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from dic.arrays import FloatArray
from dic.correlation.kernels.search import FOUND, GIVEN
from dic.correlation.settings import Match

PART = 65_536
"""Points of a part: 25 MB to and fro, and some thirty rounds of a GPU's warps."""
LANES = 3
"""Parts under way at a time: one is filled, one is searched, one is read."""

Launch = Callable[["Lane", int], None]
"""Launches the search of so many points of a lane on its stream."""


def fill(given: FloatArray, columns: Sequence[NDArray[Any]], rows: slice) -> int:
    """Write rows of columns one column after the other; the count of numbers written.

    Parameters
    ----------
    given
        Where to, shape [numbers].
    columns
        Each of shape [n] or [n, k].
    rows
        Which of the n rows.
    """
    begin = 0
    for column in columns:
        some = column[rows].reshape(-1)
        given[begin : begin + some.size] = some
        begin += some.size
    return begin


def split(found: FloatArray, n: int) -> tuple[FloatArray, ...]:
    """Warps, covariances, correlations, updates and outcomes of n points, as views."""
    return (
        found[: 12 * n].reshape(n, 12),
        found[12 * n : 16 * n].reshape(n, 2, 2),
        found[16 * n : 17 * n],
        found[17 * n : 18 * n],
        found[18 * n : 19 * n],
    )


@dataclass
class Lane:
    """Memory of one part at a time, on the host and on a device, and the stream that its work is done on."""

    device: Any
    """The device, one of Warp's."""
    stream: Any
    """Its stream of the lane; None on a CPU."""
    room: int = 0
    """Points that there is room for."""
    given_host: Any = None
    given: Any = None
    found_host: Any = None
    found: Any = None
    scratch: Any = None
    """Of the search on the device; what launches it makes it."""
    rows: slice | None = field(default=None)
    """Points that are under way; None: none."""

    def make_room(self, points: int) -> None:
        """Have memory for so many points, and some more."""
        if points <= self.room:
            return
        self.room = max(points, 2 * self.room)
        for name, numbers in (("given", GIVEN), ("found", FOUND)):
            size = numbers * self.room
            host = wp.empty(size, dtype=wp.float64, device="cpu", pinned=self.device.is_cuda)
            setattr(self, f"{name}_host", host)
            setattr(self, name, wp.empty(size, dtype=wp.float64, device=self.device))

    def begin(self, columns: Sequence[NDArray[Any]], rows: slice, launch: Launch) -> None:
        """Send these points and start their search."""
        n, self.rows = rows.stop - rows.start, rows
        numbers = fill(self.given_host.numpy(), columns, rows)
        if self.stream is not None:  # pictures and masks were made on that one
            self.stream.wait_stream(self.device.stream)
        wp.copy(self.given, self.given_host, count=numbers, stream=self.stream)
        launch(self, n)
        wp.copy(self.found_host, self.found, count=FOUND * n, stream=self.stream)

    def end(self, match: Match) -> None:
        """Wait for the points under way and write down what was found."""
        if self.rows is None:
            return
        if self.stream is not None:
            wp.synchronize_stream(self.stream)
        parts = split(self.found_host.numpy(), self.rows.stop - self.rows.start)
        names = ("warp", "covariance", "zncc", "iterations", "outcome")
        for name, part in zip(names, parts, strict=True):
            getattr(match, name)[self.rows] = part
        self.rows = None


class _Kept(threading.local):
    """Lanes of a thread by their device: two threads never share one."""

    def __init__(self) -> None:
        self.lanes: dict[str, list[Lane]] = {}


_kept = _Kept()


def in_parts(
    columns: Sequence[NDArray[Any]], n: int, device: Any, launch: Launch, *, most: int = PART
) -> Match:
    """Search points in parts, each on a lane of its own.

    Parameters
    ----------
    columns
        What the search is given of each point, each of shape [n] or [n, k].
    n
        Points.
    device
        The device, one of Warp's.
    launch
        Launches the search of a part.
    most
        Points of a part.
    """
    match = Match(
        warp=np.empty((n, 12)),
        covariance=np.empty((n, 2, 2)),
        zncc=np.empty(n),
        iterations=np.empty(n, dtype=np.int64),
        outcome=np.empty(n, dtype=np.int64),
    )
    if not n:
        return match
    count = -(-n // most)
    ends = [k * n // count for k in range(count + 1)]
    lanes = _kept.lanes.setdefault(device.alias, [])
    while len(lanes) < min(count, LANES):
        lanes.append(Lane(device, wp.Stream(device) if device.is_cuda else None))
    try:
        for k in range(count):
            lane = lanes[k % LANES]
            lane.end(match)
            lane.make_room(ends[k + 1] - ends[k])
            lane.begin(columns, slice(ends[k], ends[k + 1]), launch)
        for k in range(count, count + LANES):  # in the order in which they were begun
            if k % LANES < len(lanes):
                lanes[k % LANES].end(match)
    finally:
        for lane in lanes:  # after an error: what is under way belongs to no later call
            lane.rows = None
    return match
