"""Drivers of a batch's time loops: packs of SIMD lanes on the cores of a CPU, thread blocks on a GPU."""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest
from math import prod
from threading import Lock
from typing import Any

import warp as wp

from explicit.arguments import state_of
from explicit.arrays import FloatArray
from explicit.device import GENERATING
from explicit.host_transfer import HISTORIES, HostTransfer, streams
from explicit.mesh_arguments import body_of
from explicit.model import Model
from explicit.page_locked import POOL
from explicit.precision import Precision
from explicit.shared_run import SharedRun
from explicit.simd import PACK_BYTES, Mapping, lane_kernel
from explicit.time_loop.kernel import TimeLoopKernel

WORTH_A_PACK = 0.75
"""Share of a pack's lanes that must be at work: with fewer, its simulations are faster one by one."""
PART_WAVES = 8
"""Simulations per multiprocessor in one launch: their histories are copied while others run."""
LARGE_MESH = 1500
"""Elements from which the state of a pack leaves the caches and simulations are faster one by one."""

Progress = Callable[[int], None]


@dataclass(frozen=True)
class PreparedBatch:
    """A batch on its device, ready to run."""

    kernel: TimeLoopKernel
    """The scalar time loop."""
    model: Model
    """What is simulated."""
    numbers: Precision
    """Its arithmetic."""
    where: Any
    """The device."""
    parameters: Any
    """Parameters of every simulation, on the device."""
    output: Any
    """Histories of every simulation, on the device."""
    recorded: Any
    """The one array that they are in."""
    n_samples: int
    """How many there are."""
    on_chip: bool
    """Whether a GPU keeps the state of a simulation in shared memory."""


@dataclass(frozen=True)
class Launched:
    """A batch at work on a GPU."""

    batch: PreparedBatch
    """The batch."""
    state: Any
    """Its fields on the device, kept until it is collected."""
    parts: tuple[tuple[int, int, Any], ...]
    """First simulation, how many, and the event at the end of each launch."""
    lanes: tuple[Any, ...]
    """The streams."""
    result: FloatArray | None
    """Where on the host the histories arrive with the end of the only launch; None where they are fetched."""


def run_on_gpu(batch: PreparedBatch, progress: Progress | None) -> dict[str, FloatArray]:
    """Run every simulation as a block of threads; of a large batch, histories are copied while others run.

    Two streams take turns, so that the next part fills the multiprocessors that the last blocks of the one
    before leave idle.
    """
    return collect_from_gpu(launch_on_gpu(batch, streams(batch.where.alias)[:2]), progress)


def launch_on_gpu(batch: PreparedBatch, lanes: Sequence[Any]) -> Launched:
    """Launch a batch on streams that take turns, without waiting for it."""
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
    transfer = HostTransfer(launched.batch.output, launched.batch.where)
    transfer.touch_memory(launched.parts[0][1])
    for first, count, end in launched.parts:
        wp.synchronize_event(end)
        if progress:
            progress(count)
        transfer.send(first, count, end)
    return transfer.collect()


def _parts_of(recorded: FloatArray, output: Any) -> dict[str, FloatArray]:
    """The histories by name, in the one array that they are in."""
    parts, begin = {}, 0
    for name in HISTORIES:
        shape = getattr(output, name).shape
        parts[name] = recorded[begin : begin + prod(shape)].reshape(shape)
        begin += prod(shape)
    return parts


def packs(n_samples: int, lanes: int, n_elements: int, threads: int = 1) -> list[tuple[Mapping, int, int]]:
    """Divide a batch: (mapping, first simulation, how many) of every launch.

    What is left when every thread has had the same number of packs is run one by one if the threads are done
    with it sooner than one of them with a pack. Of the threads only the time depends: a simulation has the
    same bits in a pack and alone.

    Parameters
    ----------
    n_samples, lanes, n_elements
        Simulations, lanes of a pack, elements of the mesh.
    threads
        Threads that have nothing else to do.
    """
    jobs: list[tuple[Mapping, int, int]] = []
    first = 0
    if n_elements <= LARGE_MESH:
        rest = n_samples % (threads * lanes)
        packed = n_samples - rest if -(-rest // threads) < WORTH_A_PACK * lanes else n_samples
        while packed - first >= WORTH_A_PACK * lanes:
            count = min(lanes, n_samples - first)
            jobs.append(("simulation", first, count))
            first += count
    return jobs + [("worker", i, 1) for i in range(first, n_samples)]


def run_in_lanes(batch: PreparedBatch, threads: int, progress: Progress | None) -> dict[str, FloatArray]:
    """Packs of simulations, or simulations of packs of elements, shared out over threads.

    Threads for which none is left join one that is at work (`explicit.shared_run`).
    """
    _work(lane_jobs(batch, threads), threads, progress)
    return histories_of(batch)


def run_all_in_lanes(batches: Sequence[PreparedBatch], threads: int) -> list[dict[str, FloatArray]]:
    """Batches of different models, the launches of all of them shared out over threads."""
    _work([job for batch in batches for job in lane_jobs(batch)], threads, None)
    return [histories_of(batch) for batch in batches]


def histories_of(batch: PreparedBatch) -> dict[str, FloatArray]:
    """What a batch on the CPU has recorded."""
    return {name: getattr(batch.output, name).numpy().copy() for name in HISTORIES}


def constants_of(batch: PreparedBatch) -> Any:
    """The constants of a batch's mesh on the CPU; made once."""
    return body_of(batch.kernel, batch.model, batch.numbers, batch.where, False)


def lane_jobs(batch: PreparedBatch, threads: int = 1) -> list[SharedRun]:
    """The launches of a batch on a CPU, in any order.

    Kernels are generated and loaded here: a launch compiles nothing. The first one makes the constants of the
    mesh, beside other batches at work. `threads` are those that have nothing else to do, see `packs`.
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
            body = constants_of(batch)

        def launch(team: Any) -> None:
            inputs = [body, batch.parameters, state, batch.output, first, count, team]
            wp.launch(kernels[mapping], dim=1, inputs=inputs, device=batch.where, block_dim=1)

        return launch

    def one(mapping: Mapping, first: int, count: int) -> SharedRun:
        shared = model.mesh.n_elements if mapping == "worker" else 0
        return SharedRun(partial(begin, mapping, first, count), count, shared, batch.where)

    return [one(*job) for job in jobs]


def _work(jobs: Sequence[SharedRun], threads: int, progress: Progress | None) -> None:
    """Run all launches; threads that are left without one join the last ones."""
    last = jobs[max(len(jobs) - threads + 1, 0) :] if threads > 1 else []
    joining = [job.offer(threads) for job in reversed(last)]
    tasks = [one for seat in zip_longest(*joining) for one in seat if one is not None]
    if len(jobs) + len(tasks) < 2:  # a thread takes longer to start than a tenth of a run
        _report((job.run() for job in jobs), progress)
        return
    with ThreadPoolExecutor(min(threads, len(jobs) + len(tasks))) as pool:
        done = as_completed([pool.submit(job.run) for job in jobs])
        joined = [pool.submit(task) for task in tasks]  # no thread takes one while a launch is waiting
        _report((future.result() for future in done), progress)
        for future in joined:
            future.result()


def _report(counts: Iterable[int], progress: Progress | None) -> None:
    for count in counts:
        if progress:
            progress(count)
