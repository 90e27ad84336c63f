"""The kernel of the search and its launches: threads on a CPU, warps on a GPU."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from dic.correlation.kernels.device import select_device
from dic.correlation.kernels.grain import between_pixels, gradient_noise
from dic.correlation.kernels.packs import BLOCK
from dic.correlation.kernels.search import ARRAYS, search_source
from dic.correlation.kernels.spline import PAD
from dic.correlation.match import Match
from dic.correlation.settings import Correlation
from dic.correlation.stack import PictureStack

FLAGS = "-march=native -ffp-contract=fast -mprefer-vector-width=512 -mstackrealign"
SHARE = 512
"""Points a CPU thread takes at a time."""
WARPS_PER_PROCESSOR = 16
"""Warps that search side by side on a GPU's multiprocessor, each with its own template."""


@dataclass(frozen=True)
class Batch:
    """Points to search, arrays checked."""

    points: NDArray[np.float64]
    """[n, 2]"""
    guess: NDArray[np.float64]
    """[n, 12]"""
    reference: NDArray[np.float64] | None
    """[n, 12]"""
    reference_picture: NDArray[np.int32]
    """[n]"""
    deformed_picture: NDArray[np.int32]
    """[n]"""
    mask: NDArray[np.uint8] | None
    """[rows, columns]"""


@wp.struct
class Job:
    """Everything that a search reads and writes."""

    f: wp.array(dtype=wp.float32)
    f_plane: wp.int64
    f_first: int
    f_rows: int
    f_cols: int
    f_stride: int
    f_floor: wp.array(dtype=wp.float64)
    f_gain: wp.array(dtype=wp.float64)
    g: wp.array(dtype=wp.float32)
    g_plane: wp.int64
    g_first: int
    g_rows: int
    g_cols: int
    g_stride: int
    g_floor: wp.array(dtype=wp.float64)
    g_gain: wp.array(dtype=wp.float64)
    mask: wp.array(dtype=wp.uint8)
    has_mask: int
    mask_rows: int
    mask_cols: int
    points: wp.array(dtype=wp.float64)
    guess: wp.array(dtype=wp.float64)
    reference: wp.array(dtype=wp.float64)
    has_reference: int
    reference_picture: wp.array(dtype=wp.int32)
    deformed_picture: wp.array(dtype=wp.int32)
    subset: int
    room: int
    max_iterations: int
    tolerance: wp.float64
    least_zncc: wp.float64
    least_pixels: wp.float64
    prefilter: wp.float64
    grit: wp.float64
    between: wp.float64
    spread: wp.vec4f
    slope: wp.vec4f
    offsets: wp.array(dtype=wp.float32)
    scratch: wp.array(dtype=wp.float32)
    warp: wp.array(dtype=wp.float64)
    covariance: wp.array(dtype=wp.float64)
    zncc: wp.array(dtype=wp.float64)
    iterations: wp.array(dtype=wp.int64)
    outcome: wp.array(dtype=wp.int64)


@cache
def search_kernel(parameters: int) -> Any:
    """Generate the kernel of a shape function."""

    @wp.func_native(snippet=search_source(parameters))
    def search(job: Job, slot: int, slots: int, first: int, count: int): ...

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": FLAGS})
    def search_points(job: Job, slots: int, first: int, count: int, lanes: int):
        search(job, wp.tid() // lanes, slots, first, count)

    return search_points


def offsets(subset: int) -> tuple[NDArray[np.float32], int]:
    """x, y in units of half a subset and 1 for the pixels that are some, in whole packs."""
    room = -(-subset * subset // 32) * 32
    half = (subset - 1) / 2
    y, x = np.divmod(np.arange(subset * subset), subset)
    table = np.zeros((3, room), dtype=np.float32)
    table[:, : subset * subset] = x / half - 1.0, y / half - 1.0, np.ones(subset * subset)
    return table, room


def launch(job: Any, parameters: int, n: int, device: Any, threads: int) -> None:
    """Search all points of a job."""
    kernel = search_kernel(parameters)
    if device.is_cuda:
        slots = min(n, device.sm_count * WARPS_PER_PROCESSOR)
        job.scratch = wp.empty(slots * ARRAYS * job.room, dtype=wp.float32, device=device)
        wp.launch(kernel, dim=slots * 32, inputs=[job, slots, 0, n, 32], device=device, block_dim=BLOCK)
        return
    wp.load_module(kernel.module, device=device, block_dim=1)
    scratch = [wp.empty(ARRAYS * job.room, dtype=wp.float32, device=device) for _ in range(threads)]

    def share(thread: int) -> None:
        mine = Job()
        for name in Job.vars:
            setattr(mine, name, getattr(job, name))
        mine.scratch = scratch[thread]
        for first in range(thread * SHARE, n, threads * SHARE):
            wp.launch(
                kernel, dim=1, inputs=[mine, 1, first, min(SHARE, n - first), 1], device=device, block_dim=1
            )

    if threads == 1 or n <= SHARE:
        share_all = range(threads)
        for thread in share_all:
            share(thread)
        return
    with ThreadPoolExecutor(threads) as pool:
        for done in [pool.submit(share, thread) for thread in range(threads)]:
            done.result()


def prepare(reference: PictureStack, deformed: PictureStack, batch: Batch, settings: Correlation) -> Any:
    """Everything that a launch reads and writes, on the device of the pictures."""
    device, n = select_device(reference.device), len(batch.points)
    job = Job()

    def to_device(array: NDArray[Any], dtype: Any) -> Any:
        return wp.array(np.ascontiguousarray(array).reshape(-1), dtype=dtype, device=device)

    for name, stack in (("f", reference), ("g", deformed)):
        _, rows, stride = stack.coefficients.shape
        setattr(job, name, stack.coefficients.flatten())
        setattr(job, f"{name}_plane", rows * stride)
        setattr(job, f"{name}_first", PAD * stride + PAD)
        setattr(job, f"{name}_rows", stack.shape[0])
        setattr(job, f"{name}_cols", stack.shape[1])
        setattr(job, f"{name}_stride", stride)
        setattr(job, f"{name}_floor", to_device(np.array([v.floor**2 for v in stack.noise]), wp.float64))
        setattr(job, f"{name}_gain", to_device(np.array([v.gain for v in stack.noise]), wp.float64))
    job.points = to_device(batch.points, wp.float64)
    job.guess = to_device(batch.guess, wp.float64)
    if batch.reference is not None:
        job.reference, job.has_reference = to_device(batch.reference, wp.float64), 1
    if batch.mask is not None:
        job.mask, job.has_mask = to_device(batch.mask, wp.uint8), 1
        job.mask_rows, job.mask_cols = batch.mask.shape
    job.reference_picture = to_device(batch.reference_picture, wp.int32)
    job.deformed_picture = to_device(batch.deformed_picture, wp.int32)
    job.subset, job.max_iterations = settings.subset, settings.max_iterations
    job.tolerance, job.least_zncc = settings.tolerance, settings.least_zncc
    job.least_pixels = settings.least_pixels
    job.prefilter, job.grit = settings.prefilter, gradient_noise(settings.prefilter)
    job.between, spread, slope = between_pixels(settings.prefilter)
    job.spread, job.slope = wp.vec4f(*spread), wp.vec4f(*slope)
    table, job.room = offsets(settings.subset)
    job.offsets = to_device(table, wp.float32)
    job.warp = wp.empty(12 * n, dtype=wp.float64, device=device)
    job.covariance = wp.empty(4 * n, dtype=wp.float64, device=device)
    job.zncc = wp.empty(n, dtype=wp.float64, device=device)
    job.iterations = wp.empty(n, dtype=wp.int64, device=device)
    job.outcome = wp.empty(n, dtype=wp.int64, device=device)
    return job


def search(
    reference: PictureStack, deformed: PictureStack, batch: Batch, settings: Correlation, threads: int
) -> Match:
    """Search a batch on the device of its pictures."""
    job, n = prepare(reference, deformed, batch, settings), len(batch.points)
    if n:
        launch(job, int(settings.shape), n, select_device(reference.device), threads)
    return Match(
        warp=job.warp.numpy().reshape(n, 12),
        covariance=job.covariance.numpy().reshape(n, 2, 2),
        zncc=job.zncc.numpy(),
        iterations=job.iterations.numpy(),
        outcome=job.outcome.numpy(),
    )
