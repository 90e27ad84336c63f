"""Run a batch of a constant `Model` and its `Samples` on a CPU or a CUDA device. The result is a `Response`.

`compile_time_loops` compiles the time loops of later batches for a CPU in advance, several at once.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from explicit.aot import load_module
from explicit.arguments import batch_of, fits_on_chip, fits_on_several, output_of
from explicit.arrays import FloatArray
from explicit.device import GENERATING, cores, select_device
from explicit.drivers import (
    HISTORIES,
    PreparedBatch,
    collect_from_gpu,
    launch_on_gpu,
    packs,
    run_all_in_lanes,
    run_in_lanes,
    run_on_gpu,
)
from explicit.layout.lanes import block_for, cluster_for, supports_chip_memory
from explicit.layout.structs import Ending
from explicit.mesh import element_geometry
from explicit.model import Model, Samples, Sampling, Stepping
from explicit.platens import MovingSupport
from explicit.precision import Precision, precision
from explicit.response import EnergyLedger, Outcome, Response
from explicit.simd import PACK_BYTES, Mapping, is_translated, lane_kernel
from explicit.time_loop.kernel import TimeLoopKernel, time_loop_kernel


@dataclass(frozen=True)
class Problem:
    """A batch to be run in parallel with others, see `run_side_by_side`."""

    model: Model
    """What to simulate."""
    samples: Samples
    """Its parameters."""
    sampling: Sampling
    """What to record."""
    stepping: Stepping = field(default_factory=Stepping)
    """Numerical choices of the time loop."""


def run(
    model: Model,
    samples: Samples,
    sampling: Sampling,
    *,
    stepping: Stepping | None = None,
    device: str = "cpu",
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
    modules: Path | str | None = None,
) -> Response:
    """Simulate every sample of a batch.

    Parameters
    ----------
    model, samples, sampling
        The model, the parameters of each simulation, and the recorded quantities.
    stepping : Stepping, optional
        Numerical choices of the time loop; default `Stepping()`.
    device : str
        "cpu", or a CUDA device such as "cuda" or "cuda:0".
    threads : int, optional
        CPU threads; default all cores. Threads without a simulation help with a running one if its mesh is
        large enough. With 1 no simulation is shared. Results do not depend on the number.
    progress : callable, optional
        Called with the number of simulations finished since the last call.
    modules : Path or str, optional
        Folder of time loops compiled by `explicit.aot.ahead_of_time`, for CUDA devices; default is the value
        of the environment variable ``KOLSKY_AOT``. Without a folder, and on a CPU, time loops are compiled at
        their first use.

    Returns
    -------
    Response
        One row per sample. A simulation that ends early has its `Outcome`, its time, its element and its
        records. After its end they are NaN. It does not affect the other simulations.

    Raises
    ------
    ValueError
        If a requested time is before the model's start, or a sample refers to a missing material or motion.
        Also if the folder `modules` does not exist.
    """
    problem = Problem(model, samples, sampling, stepping or Stepping())
    prepared, nodes = _prepared(problem, select_device(device), modules)
    if prepared.where.is_cuda:
        histories = run_on_gpu(prepared, progress)
    else:
        histories = run_in_lanes(prepared, threads or cores(), progress)
    return _response(model, sampling, histories, nodes)


def run_side_by_side(
    problems: Sequence[Problem],
    *,
    device: str = "cpu",
    threads: int | None = None,
    modules: Path | str | None = None,
) -> list[Response]:
    """Simulate batches of different models at the same time.

    A simulation is one thread block of a GPU, or the work of one core. With a batch of one simulation, all
    other multiprocessors and cores are idle. Batches on separate streams use them. On a CPU, threads share
    the simulations of all batches. A response is bitwise equal to that of `run`.

    Parameters
    ----------
    problems
        The batches. All of them are in the device's memory at the same time.
    device, threads, modules
        As in `run`.

    Raises
    ------
    ValueError
        As `run`.
    """
    where = select_device(device)
    prepared = [_prepared(problem, where, modules) for problem in problems]
    if not where.is_cuda:
        histories = run_all_in_lanes([one for one, _ in prepared], threads or cores())
        return [
            _response(problem.model, problem.sampling, histories_of_problem, nodes)
            for problem, (_, nodes), histories_of_problem in zip(problems, prepared, histories, strict=True)
        ]
    for kernel, block in {(one.kernel.kernel, one.kernel.block) for one, _ in prepared}:
        # before the launches: a load waits for running kernels, and a compilation takes longer than most of
        # them
        wp.load_module(kernel.module, device=where, block_dim=block)
    wp.synchronize_device(where)
    launched = [launch_on_gpu(one, [wp.Stream(where)]) for one, _ in prepared]
    return [
        _response(one.batch.model, problem.sampling, collect_from_gpu(one, None), nodes)
        for problem, one, (_, nodes) in zip(problems, launched, prepared, strict=True)
    ]


def _time_loop_of(problem: Problem, where: Any) -> tuple[TimeLoopKernel, Precision, bool]:
    """The time loop of a batch, its arithmetic, and whether a GPU has the state in shared memory of one or
    several blocks."""
    model, stepping = problem.model, problem.stepping
    numbers = precision(stepping.precision)
    on_chip, n = where.is_cuda and fits_on_chip(model.mesh, numbers), len(problem.samples)
    block, fits = block_for(n, where, on_chip), partial(fits_on_several, model.mesh)
    cluster = cluster_for(n, model.mesh.n_elements, where, on_chip, fits)
    on_chip = on_chip or (cluster > 1 and supports_chip_memory(where) and fits(cluster))
    kernel = time_loop_kernel(
        type(model.materials[0]), model.faces, model.side, numbers, model.element, on_chip,
        block, stepping.bound, model.volumetric, model.relaxation_kind, cluster,
    )  # fmt: skip
    return kernel, numbers, on_chip


def _prepared(problem: Problem, where: Any, modules: Path | str | None) -> tuple[PreparedBatch, Any]:
    """A batch on its device, and the nodes that it records."""
    model, samples, sampling, stepping = problem.model, problem.samples, problem.sampling, problem.stepping
    _check(model, samples, sampling)
    nodes = np.arange(model.mesh.n_nodes) if sampling.all_nodes else model.mesh.side
    with GENERATING:
        kernel, numbers, on_chip = _time_loop_of(problem, where)
    output, recorded = output_of(kernel, model.mesh, len(samples), sampling, nodes, where)
    batch = batch_of(kernel, model, samples, sampling, stepping, numbers, where)
    if where.is_cuda:
        load_module(kernel, where, modules)
    return PreparedBatch(kernel, model, numbers, where, batch, output, recorded, len(samples), on_chip), nodes


def _check(model: Model, samples: Samples, sampling: Sampling) -> None:
    first = min(float(sampling.force_times[0]), float(sampling.surface_times[0]))
    if first < model.start:
        raise ValueError(f"requested time {first:.9g} s is before the model's start {model.start:.9g} s")
    for name, index, count in (
        ("material", samples.material, len(model.materials)),
        ("motion", samples.motion, len(model.motions)),
        ("relaxation", samples.relaxation, max(len(model.relaxation), 1)),
    ):
        wrong = index[(index < 0) | (index >= count)]
        if wrong.size:
            raise ValueError(f"a sample names {name} {wrong[0]}, the model has 0 to {count - 1}")
    if isinstance(model.support, MovingSupport) and len(model.support.motions) not in (1, len(samples)):
        raise ValueError(
            f"a moving support needs 1 motion or one for each of {len(samples)} samples, "
            f"got {len(model.support.motions)}"
        )


def _response(model: Model, sampling: Sampling, histories: dict[str, FloatArray], nodes: Any) -> Response:
    force, impulse, position, energy, endings = (histories[name] for name in HISTORIES)
    ending = endings.T
    failed = ending[Ending.FAILED_ELEMENT].astype(np.int64)
    side = np.searchsorted(nodes, model.mesh.side) if sampling.all_nodes else slice(None)
    return Response(
        force_times=sampling.force_times.copy(),
        force_flyer=force[:, :, 0],
        force_transmission=force[:, :, 1],
        impulse_flyer=impulse[:, :, 0],
        impulse_transmission=impulse[:, :, 1],
        surface_times=sampling.surface_times.copy(),
        surface_r=position[:, :, side, 0],
        surface_y=position[:, :, side, 1],
        energy=EnergyLedger(*(energy[:, :, k] for k in range(9))),
        outcomes=tuple(Outcome(int(code)) for code in ending[Ending.STATUS]),
        failed_elements=failed,
        failed_places=np.where(failed[:, None] >= 0, model.mesh.centres[failed], np.nan),
        end_times=ending[Ending.END_TIME].copy(),
        steps=ending[Ending.STEPS].astype(np.int64),
        smallest_step=ending[Ending.SMALLEST_STEP].copy(),
        extrapolated_share=ending[Ending.PAST_DATA] / element_geometry(model.mesh).volume.sum(),
        largest_strain_measure=ending[Ending.MOST_STRAINED].copy(),
        nodes=position if sampling.all_nodes else None,
    )


CompileProgress = Callable[[int, int], None]
"""Called with the number of compiled time loops and the total number."""


def compile_time_loops(
    problems: Sequence[Problem],
    *,
    also: Sequence[Callable[[], Problem]] = (),
    device: str = "cpu",
    threads: int | None = None,
    progress: CompileProgress | None = None,
) -> int:
    """Compile the time loops of batches in parallel, if they are not yet compiled on this machine.

    Parameters
    ----------
    problems
        Batches to be run later, each with its number of samples.
    also : sequence of callable
        Functions that make more batches. They are called only if one of `problems` must be compiled.
    device, threads
        As in `explicit.run`. Nothing is done for a GPU, see `explicit.aot`.
    progress : callable, optional
        Called before the first and after each one.

    Returns
    -------
    int
        Number of compiled time loops.

    Raises
    ------
    ValueError
        As `explicit.run`.
    """
    where, threads = select_device(device), threads or cores()
    if where.is_cuda:
        return 0
    with GENERATING:
        choices = _unknown(problems, where, threads)
        if choices:
            choices |= _unknown([make() for make in also], where, threads)
        kernels = [lane_kernel(*choice).kernel for choice in choices]
    if not kernels:
        return 0
    report = progress or (lambda done, total: None)
    report(0, len(kernels))
    with ThreadPoolExecutor(threads) as pool:
        load = partial(wp.load_module, device=where, block_dim=1)
        waiting = [pool.submit(load, kernel.module) for kernel in kernels]
        for count, future in enumerate(as_completed(waiting), start=1):
            future.result()
            report(count, len(kernels))
    return len(kernels)


def _unknown(problems: Sequence[Problem], where: Any, threads: int) -> dict[tuple[Any, ...], None]:
    """The choices of `lane_kernel` that are not yet compiled, in order and without repeats."""
    choices: dict[tuple[Any, ...], None] = {}
    for problem in problems:
        time_loop, numbers, _ = _time_loop_of(problem, where)
        lanes = PACK_BYTES // numbers.dtype().itemsize
        jobs = packs(len(problem.samples), lanes, problem.model.mesh.n_elements, threads)
        mappings: dict[Mapping, None] = dict.fromkeys(job[0] for job in jobs)
        for mapping in mappings:
            if not is_translated(time_loop.kernel, numbers, mapping, lanes):
                choices[time_loop.kernel, time_loop.structs, numbers, mapping, lanes] = None
    return choices
