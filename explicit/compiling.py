"""Time loops compiled for a CPU before they are wanted, several at once: a wait of once on a machine."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import partial
from typing import Any

import warp as wp

from explicit.device import GENERATING, select_device
from explicit.drivers import packs
from explicit.run_batch import Problem, time_loop_of
from explicit.simd import PACK_BYTES, Mapping, is_known, lane_kernel

Told = Callable[[int, int], None]
"""Called with the time loops compiled and how many there are to compile."""


def compile_time_loops(
    problems: Sequence[Problem],
    *,
    also: Sequence[Callable[[], Problem]] = (),
    device: str = "cpu",
    threads: int | None = None,
    told: Told | None = None,
) -> int:
    """Compile what batches are run with, side by side, where this machine has not yet done so.

    Parameters
    ----------
    problems
        Batches to come, each with as many samples as it will have.
    also : sequence of callable
        Further ones, made and looked at only if one of `problems` has to be compiled.
    device, threads
        As of `explicit.run`. A GPU has its own way (`explicit.modules`): nothing is done for it.
    told : callable, optional
        Called before the first and after each one.

    Returns
    -------
    int
        How many were compiled.

    Raises
    ------
    ValueError
        As `explicit.run`.
    """
    where, threads = select_device(device), threads or os.cpu_count() or 1
    if where.is_cuda:
        return 0
    with GENERATING:
        wanted = _unknown(problems, where, threads)
        if wanted:
            wanted |= _unknown([make() for make in also], where, threads)
        kernels = [lane_kernel(*choice).kernel for choice in wanted]
    if not kernels:
        return 0
    tell = told or (lambda done, total: None)
    tell(0, len(kernels))
    with ThreadPoolExecutor(threads) as pool:
        load = partial(wp.load_module, device=where, block_dim=1)
        waiting = [pool.submit(load, kernel.module) for kernel in kernels]
        for done, future in enumerate(as_completed(waiting), start=1):
            future.result()
            tell(done, len(kernels))
    return len(kernels)


def _unknown(problems: Sequence[Problem], where: Any, threads: int) -> dict[tuple[Any, ...], None]:
    """The choices of `lane_kernel` that are not known yet, each once and in order."""
    found: dict[tuple[Any, ...], None] = {}
    for problem in problems:
        made, numbers, _ = time_loop_of(problem, where)
        lanes = PACK_BYTES // numbers.dtype().itemsize
        jobs = packs(len(problem.samples), lanes, problem.model.mesh.n_elements, threads)
        mappings: dict[Mapping, None] = dict.fromkeys(job[0] for job in jobs)
        for mapping in mappings:
            if not is_known(made.kernel, numbers, mapping, lanes):
                found[made.kernel, made.structs, numbers, mapping, lanes] = None
    return found
