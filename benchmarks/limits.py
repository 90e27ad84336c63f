"""Performance limits of a device, measured in the same run as the solver.

The arithmetic limit is the rate of independent fused multiply-adds at the solver's vector width. It is
divided by the number of arithmetic instructions of an element update (`benchmarks.counting`). No program with
these instructions can be faster. Real programs are slower. Divisions and roots take several times as long as
a multiply-add, and results and memory have latencies. On a GPU a second limit is the bandwidth of shared
memory divided by the bytes that an update moves there.
"""

import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import warp as wp

from benchmarks.limit_kernels import READS, THREADS, fma_kernel, lanes, shared_kernel
from explicit.precision import Precision

CHAINS = (4, 8, 12, 16)
"""Numbers of chains that are tried. They fill a processor's pipelines and fit into its registers. The best
result is used."""
BLOCKS = 8
"""Blocks on each multiprocessor of a GPU, enough for its largest number of threads."""
SECONDS = 0.05
"""Approximate duration of a measurement [s]."""
REPEATS = 5
"""Number of measurements; the best one is used."""
NUMBERS_MOVED = 40
"""Real numbers that an element update moves to or from a simulation's fields, counted by hand from
`explicit.time_loop.kernel`. The element has 16 for displacements and velocities of four corners, and 8 for
their forces. Each element has one node. The node has 8 for the forces of four corners, and 8 for velocity and
displacement."""


@dataclass(frozen=True)
class Limit:
    """A measured limit of a device."""

    name: str
    """Name of the limit."""
    rate: float
    """Rate per second, in `unit`."""
    unit: str
    """Unit of `rate`."""
    updates: float
    """Element updates per second at this limit [1/s]."""


def limits(device: Any, numbers: Precision, instructions: float, threads: int) -> list[Limit]:
    """Measure a device's limits for an element update with a number of arithmetic instructions. The limits
    are arithmetic and, on a GPU, shared memory; ``threads`` are those of a CPU."""
    if not device.is_cuda:
        rate = _fma_cpu(device, numbers, threads)
        return [Limit("SIMD arithmetic", rate, "multiply-adds/s", rate / instructions)]
    rate, moved = _fma_gpu(device, numbers), _shared_gpu(device, numbers)
    size = int(numbers.dtype().itemsize)
    return [
        Limit("arithmetic", rate, "multiply-adds/s", rate / instructions),
        Limit("shared memory", moved, "bytes/s", moved / (NUMBERS_MOVED * size)),
    ]


def _fma_cpu(device: Any, numbers: Precision, threads: int) -> float:
    width, best = lanes(numbers), 0.0
    outs = [wp.zeros(width, dtype=numbers.real, device=device) for _ in range(threads)]
    with ThreadPoolExecutor(threads) as pool:
        for chains in CHAINS:
            kernel = fma_kernel(numbers, chains, False)
            wp.load_module(kernel.module, device=device, block_dim=1)
            best = max(best, _rate(partial(_on_threads, pool, kernel, outs), chains * width * threads))
    return best


def _on_threads(pool: ThreadPoolExecutor, kernel: Any, outs: list[Any], turns: int) -> None:
    def one(out: Any) -> None:
        wp.launch(kernel, dim=1, inputs=[turns, 0, out], device=out.device, block_dim=1)

    list(pool.map(one, outs))


def _fma_gpu(device: Any, numbers: Precision) -> float:
    n = device.sm_count * BLOCKS * THREADS
    out, best = wp.zeros(n, dtype=numbers.real, device=device), 0.0
    for chains in CHAINS:
        kernel = fma_kernel(numbers, chains, True)
        best = max(best, _rate(partial(_launch, kernel, n, out, device), chains * n))
    return best


def _shared_gpu(device: Any, numbers: Precision) -> float:
    n = device.sm_count * BLOCKS * THREADS
    out = wp.zeros(n, dtype=numbers.real, device=device)
    moved = READS * int(numbers.dtype().itemsize) * n
    return _rate(partial(_launch, shared_kernel(numbers), n, out, device), moved)


def _launch(kernel: Any, n: int, out: Any, device: Any, turns: int) -> None:
    wp.launch(kernel, dim=n, inputs=[turns, 0, out], device=device, block_dim=THREADS)
    wp.synchronize_device(device)


def _rate(do: Callable[[int], None], each_turn: float) -> float:
    """The best of several measurements, each long enough for the clock."""
    turns, elapsed = 1000, 0.0
    do(turns)
    while True:
        started = time.perf_counter()
        do(turns)
        elapsed = time.perf_counter() - started
        if elapsed >= SECONDS / 4.0:
            break
        turns *= 4
    turns = int(turns * SECONDS / elapsed)
    times = []
    for _ in range(REPEATS):
        started = time.perf_counter()
        do(turns)
        times.append(time.perf_counter() - started)
    return turns * each_turn / float(np.min(times))
