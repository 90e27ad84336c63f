"""Drivers of a batch's time loops: packs of SIMD lanes on the cores of a CPU, thread blocks on a GPU.

A GPU writes small results into page-locked memory at the speed of the bus. Histories of a large batch are
copied to the host in pieces through page-locked memory, while other simulations run.
"""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache, partial
from itertools import zip_longest
from math import prod
from threading import Lock
from typing import Any
from weakref import finalize

import numpy as np
import warp as wp

from explicit.arguments import body_of, state_of
from explicit.arrays import FloatArray
from explicit.device import GENERATING
from explicit.model import Model
from explicit.precision import Precision
from explicit.simd import PACK_BYTES, Mapping, lane_kernel
from explicit.simd.team import SharedRun
from explicit.time_loop.kernel import TimeLoopKernel

HISTORIES = ("force", "impulse", "position", "energy", "ending")
"""The arrays of an output, samples first, contiguous in its memory."""
PIECE = 1 << 20
"""Number of float64 values in a piece (8 MiB). It is large enough for the bus and small enough to be locked
quickly."""
PIECES = 8
"""Pieces of page-locked memory that a process keeps for each device."""
THREADS = 4
"""Number of threads that copy from these pieces: one thread is slower than a GPU's transfer."""


class _HostTransfer:
    """The histories of one batch copied to the host."""

    def __init__(self, output: Any, device: Any) -> None:
        self._sources = {name: getattr(output, name) for name in HISTORIES}
        self._arrays = {name: np.empty(array.shape) for name, array in self._sources.items()}
        self._stream, self._buffers = streams(device.alias)[-1], _buffers(device.alias)
        self._emptied: list[Future[None] | None] = [None] * PIECES
        self._sent = 0

    def touch_memory(self, count: int) -> None:
        """Touch the memory of the first `count` simulations while the device is busy. The system allocates it
        page by page, which takes longer than a copy.
        """
        for target in self._arrays.values():
            target[:count] = 0.0

    def send(self, first: int, count: int, after: Any) -> None:
        """Copy the histories of simulations `first` to `first + count` after the event `after`."""
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
    """Page-locked pieces of a process. It reuses them, because locking takes longer than filling."""
    return [wp.empty(PIECE, dtype=wp.float64, device="cpu", pinned=True) for _ in range(PIECES)]


STEP = 1 << 17
"""Pieces are multiples of this number of float64 values (1 MiB)."""
LIMIT = 1 << 25
"""Largest number of float64 values that a process locks (256 MiB). Other processes cannot use locked
memory."""


class Piece:
    """A piece of memory on the host."""

    def __init__(self, memory: Any) -> None:
        self.memory = memory
        self._arrival: Any = None

    def fill(self, source: Any, stream: Any) -> Any:
        """Copy a Warp array of a device into it, on a stream; returns the event of its arrival."""
        wp.copy(self.memory, source, count=source.size, stream=stream)
        self._arrival = stream.record_event()
        return self._arrival

    def wait(self) -> None:
        """Wait until all transfers are complete."""
        if self._arrival is not None:
            wp.synchronize_event(self._arrival)


class _Owner:
    """Owner of a piece of memory. NumPy keeps it alive with every view of the piece."""

    def __init__(self, memory: Any, count: int) -> None:
        self.__array_interface__ = {
            "data": (memory.ptr, False), "shape": (count,), "typestr": "<f8", "version": 3,
        }  # fmt: skip


class Pool:
    """Pieces of page-locked memory, the smallest that is large enough first.

    ``limit``: largest number of values in all pieces. ``pinned``: False for ordinary memory, on machines
    without a GPU.
    """

    def __init__(self, limit: int = LIMIT, *, pinned: bool = True) -> None:
        self._free: list[Piece] = []
        self._room, self._pinned, self._lock = limit, pinned, Lock()

    def lend(self, count: int) -> tuple[Piece, FloatArray] | None:
        """A piece of memory for `count` numbers, and the numbers; None if no more memory may be locked.

        The piece is reused once neither the numbers nor a view of them exist.
        """
        with self._lock:
            # Other threads only append to the list, so an index remains valid.
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
        # Without the lock: garbage collection may call this in a thread that holds the lock.
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


WORTH_A_PACK = 0.75
"""Smallest share of a pack's lanes that must be in use. With fewer, its simulations are faster one by one."""
PART_WAVES = 8
"""Number of simulations per multiprocessor in one launch. Their histories are copied while others run."""
LARGE_MESH = 1500
"""Above this number of elements the state of a pack exceeds the caches, and simulations are faster one by
one."""

Progress = Callable[[int], None]


@dataclass(frozen=True)
class PreparedBatch:
    """A batch on its device, ready to run."""

    kernel: TimeLoopKernel
    """The scalar time loop."""
    model: Model
    """The simulated model."""
    numbers: Precision
    """Arithmetic of the batch."""
    where: Any
    parameters: Any
    """Parameters of every simulation, on the device."""
    output: Any
    """Histories of every simulation, on the device."""
    recorded: Any
    """The array that contains all histories."""
    n_samples: int
    """Number of simulations."""
    on_chip: bool
    """Whether a GPU keeps the state of a simulation in shared memory."""


@dataclass(frozen=True)
class Launched:
    """A running batch on a GPU."""

    batch: PreparedBatch
    state: Any
    """Its fields on the device, kept until it is collected."""
    parts: tuple[tuple[int, int, Any], ...]
    """First simulation, number of simulations, and end event of each launch."""
    lanes: tuple[Any, ...]
    """The streams."""
    result: FloatArray | None
    """Array on the host into which a single launch writes the histories; None if they are copied later."""


def run_on_gpu(batch: PreparedBatch, progress: Progress | None) -> dict[str, FloatArray]:
    """Run every simulation as a block of threads. The histories of a large batch are copied while others run.

    Two streams alternate. The next part then uses the multiprocessors that the last blocks of the previous
    part leave idle.
    """
    return collect_from_gpu(launch_on_gpu(batch, streams(batch.where.alias)[:2]), progress)


def launch_on_gpu(batch: PreparedBatch, lanes: Sequence[Any]) -> Launched:
    """Launch a batch on alternating streams, without waiting for it."""
    body = body_of(batch.kernel, batch.model, batch.numbers, batch.where, batch.on_chip)
    state = state_of(batch.kernel, batch.model, batch.numbers, batch.where, batch.n_samples, 1, batch.on_chip)
    block = batch.kernel.block
    part = PART_WAVES * batch.where.sm_count
    ready, parts = wp.get_stream(batch.where).record_event(), []
    for k, first in enumerate(range(0, batch.n_samples, part)):
        stream, count = lanes[k % len(lanes)], min(part, batch.n_samples - first)
        if k < len(lanes):
            stream.wait_event(ready)
        wp.launch(
            batch.kernel.kernel,
            dim=(count, block * batch.kernel.cluster),
            inputs=[body, batch.parameters, state, batch.output, first],
            stream=stream,
            block_dim=block,
        )
        parts.append((first, count, stream.record_event()))
    lent = POOL.lend(batch.recorded.size) if len(parts) == 1 else None
    if lent is None:
        return Launched(batch, state, tuple(parts), tuple(lanes), None)
    piece, result = lent
    arrival = piece.fill(batch.recorded, lanes[0])
    return Launched(batch, state, ((0, batch.n_samples, arrival),), tuple(lanes), result)


def collect_from_gpu(launched: Launched, progress: Progress | None) -> dict[str, FloatArray]:
    """Wait for a launched batch and copy its histories to the host."""
    if launched.result is not None:
        (_, count, end), *_ = launched.parts
        wp.synchronize_event(end)
        if progress:
            progress(count)
        return _parts_of(launched.result, launched.batch.output)
    transfer = _HostTransfer(launched.batch.output, launched.batch.where)
    transfer.touch_memory(launched.parts[0][1])
    for first, count, end in launched.parts:
        wp.synchronize_event(end)
        if progress:
            progress(count)
        transfer.send(first, count, end)
    return transfer.collect()


def _parts_of(recorded: FloatArray, output: Any) -> dict[str, FloatArray]:
    """The histories by name, as views of the array that contains them."""
    parts, begin = {}, 0
    for name in HISTORIES:
        shape = getattr(output, name).shape
        parts[name] = recorded[begin : begin + prod(shape)].reshape(shape)
        begin += prod(shape)
    return parts


def packs(n_samples: int, lanes: int, n_elements: int, threads: int = 1) -> list[tuple[Mapping, int, int]]:
    """Divide a batch: (mapping, first simulation, number of simulations) of every launch.

    All threads first get the same number of packs. The remaining simulations are run one by one if this is
    faster than a pack. The number of threads affects only the time: a simulation is bitwise equal in a pack
    and outside.

    Parameters
    ----------
    n_samples, lanes, n_elements
        Simulations, lanes of a pack, elements of the mesh.
    threads
        Number of idle threads.
    """
    jobs: list[tuple[Mapping, int, int]] = []
    first = 0
    if n_elements <= LARGE_MESH:
        remainder = n_samples % (threads * lanes)
        packed = n_samples - remainder if -(-remainder // threads) < WORTH_A_PACK * lanes else n_samples
        while packed - first >= WORTH_A_PACK * lanes:
            count = min(lanes, n_samples - first)
            jobs.append(("simulation", first, count))
            first += count
    return jobs + [("worker", i, 1) for i in range(first, n_samples)]


def run_in_lanes(batch: PreparedBatch, threads: int, progress: Progress | None) -> dict[str, FloatArray]:
    """Distribute packs of simulations, or simulations of packs of elements, over threads.

    Threads without a launch join a running one (`explicit.simd.team`).
    """
    _work(lane_jobs(batch, threads), threads, progress)
    return histories_of(batch)


def run_all_in_lanes(batches: Sequence[PreparedBatch], threads: int) -> list[dict[str, FloatArray]]:
    """Batches of different models, with the launches of all of them distributed over threads."""
    _work([job for batch in batches for job in lane_jobs(batch)], threads, None)
    return [histories_of(batch) for batch in batches]


def histories_of(batch: PreparedBatch) -> dict[str, FloatArray]:
    """Records of a batch on the CPU."""
    return {name: getattr(batch.output, name).numpy().copy() for name in HISTORIES}


def lane_jobs(batch: PreparedBatch, threads: int = 1) -> list[SharedRun]:
    """The launches of a batch on a CPU. Their order is arbitrary.

    Kernels are generated and loaded here; a launch compiles nothing. The first launch makes the constants of
    the mesh, in parallel with other running batches. `threads` is the number of idle threads, see `packs`.
    """
    kernel, model, numbers = batch.kernel, batch.model, batch.numbers
    lanes = PACK_BYTES // numbers.dtype().itemsize
    jobs = packs(batch.n_samples, lanes, model.mesh.n_elements, threads)
    once, kernels = Lock(), {}
    with GENERATING:
        for mapping in {job[0] for job in jobs}:
            kernels[mapping] = lane_kernel(kernel.kernel, kernel.structs, numbers, mapping, lanes).kernel
            wp.load_module(kernels[mapping].module, device=batch.where, block_dim=1)

    def begin(mapping: Mapping, first: int, count: int) -> Callable[[Any], None]:
        width = lanes if mapping == "simulation" else 1
        state = state_of(kernel, model, numbers, batch.where, 1, width)
        with once:
            body = body_of(kernel, model, numbers, batch.where, False)

        def launch(team: Any) -> None:
            inputs = [body, batch.parameters, state, batch.output, first, count, team]
            wp.launch(kernels[mapping], dim=1, inputs=inputs, device=batch.where, block_dim=1)

        return launch

    def one(mapping: Mapping, first: int, count: int) -> SharedRun:
        shared = model.mesh.n_elements if mapping == "worker" else 0
        return SharedRun(partial(begin, mapping, first, count), count, shared, batch.where)

    return [one(*job) for job in jobs]


def _work(jobs: Sequence[SharedRun], threads: int, progress: Progress | None) -> None:
    """Run all launches; idle threads join the last ones."""
    last = jobs[max(len(jobs) - threads + 1, 0) :] if threads > 1 else []
    joining = [job.offer(threads) for job in reversed(last)]
    tasks = [one for seat in zip_longest(*joining) for one in seat if one is not None]
    if len(jobs) + len(tasks) < 2:  # the start of a thread takes longer than a tenth of a run
        _report((job.run() for job in jobs), progress)
        return
    with ThreadPoolExecutor(min(threads, len(jobs) + len(tasks))) as pool:
        finished = as_completed([pool.submit(job.run) for job in jobs])
        joined = [pool.submit(task) for task in tasks]  # no thread starts one while another is waiting
        _report((future.result() for future in finished), progress)
        for future in joined:
            future.result()


def _report(counts: Iterable[int], progress: Progress | None) -> None:
    for count in counts:
        if progress:
            progress(count)
