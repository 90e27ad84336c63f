"""The kernel of the search and its launches: threads on a CPU, warps on a GPU."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from dic.correlation.kernels.device import select_device
from dic.correlation.kernels.lanes import BLOCK
from dic.correlation.kernels.pixel_noise import between_pixels, gradient_noise
from dic.correlation.kernels.search import ARRAYS, FOUND, search_source
from dic.correlation.kernels.spline import PAD
from dic.correlation.settings import Correlation, Match, Templates
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
    templates: Templates | None
    place: NDArray[np.int64]
    """In the templates, [n]"""


@wp.struct
class Job:
    """Everything that a search reads and writes."""

    f: wp.array(dtype=wp.uint64)
    f_first: int
    f_rows: int
    f_cols: int
    f_stride: int
    f_noise: wp.array(dtype=wp.float64)
    g: wp.array(dtype=wp.uint64)
    g_first: int
    g_rows: int
    g_cols: int
    g_stride: int
    g_noise: wp.array(dtype=wp.float64)
    mask: wp.array(dtype=wp.uint8)
    has_mask: int
    mask_rows: int
    mask_cols: int
    points: int
    given: wp.array(dtype=wp.float64)
    has_kept: int
    known: wp.array(dtype=wp.int32)
    kept_pixels: wp.array(dtype=wp.float32)
    kept_sums: wp.array(dtype=wp.float64)
    has_reference: int
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
    found: wp.array(dtype=wp.float64)


@cache
def search_kernel(parameters: int) -> Any:
    """Generate the kernel of a shape function."""

    @wp.func_native(snippet=search_source(parameters))
    def search(job: Job, slot: int, slots: int, first: int, count: int): ...

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": FLAGS})
    def search_points(job: Job, slots: int, first: int, count: int, lanes: int):
        search(job, wp.tid() // lanes, slots, first, count)

    return search_points


@cache
def offsets(subset: int, device: str) -> tuple[Any, int]:
    """x, y in units of half a subset and 1 for the pixels that are some, in whole packs, on a device."""
    room = -(-subset * subset // 32) * 32
    half = (subset - 1) / 2
    y, x = np.divmod(np.arange(subset * subset), subset)
    table = np.zeros((3, room), dtype=np.float32)
    table[:, : subset * subset] = x / half - 1.0, y / half - 1.0, np.ones(subset * subset)
    return wp.array(table.reshape(-1), dtype=wp.float32, device=select_device(device)), room


_masks: list[tuple[NDArray[np.uint8], Any, Any]] = []
MOST_MASKS = 4
"""Masks that are kept on a device: a body's is the same in every launch of its track."""


def mask_on_device(mask: NDArray[np.uint8], device: Any) -> Any:
    """A mask on a device, sent there once as long as its pixels stay what they are, shape [n]."""
    for kept, where, found in _masks:
        if where == device and kept.shape == mask.shape and np.array_equal(kept, mask):
            return found
    kept = mask.copy()  # the caller's may change; a CPU reads this one where it is
    found = wp.array(kept.reshape(-1), dtype=wp.uint8, device=device, copy=False)
    _masks.insert(0, (kept, device, found))
    del _masks[MOST_MASKS:]
    return found


@cache
def _between(prefilter: float) -> tuple[float, Any, Any]:
    mean, spread, slope = between_pixels(prefilter)
    return mean, wp.vec4f(*spread), wp.vec4f(*slope)


def launch(job: Any, parameters: int, n: int, device: Any, threads: int) -> None:
    """Search all points of a job."""
    kernel = search_kernel(parameters)
    if device.is_cuda:
        slots = min(n, device.sm_count * WARPS_PER_PROCESSOR)
        job.scratch = wp.empty(slots * ARRAYS * job.room, dtype=wp.float32, device=device)
        wp.launch(kernel, dim=slots * 32, inputs=[job, slots, 0, n, 32], device=device, block_dim=BLOCK)
        return
    wp.load_module(kernel.module, device=device, block_dim=1)
    threads = min(threads, -(-n // SHARE))
    if threads == 1:
        _share(kernel, job, device, range(0, n, SHARE), n)
        return
    with ThreadPoolExecutor(threads) as pool:
        shares = [range(thread * SHARE, n, threads * SHARE) for thread in range(threads)]
        for done in [pool.submit(_share, kernel, _copy(job), device, share, n) for share in shares]:
            done.result()


def _share(kernel: Any, job: Any, device: Any, firsts: range, n: int) -> None:
    """Search the points of a CPU thread, in the order of their number."""
    job.scratch = wp.empty(ARRAYS * job.room, dtype=wp.float32, device=device)
    for first in firsts:
        inputs = [job, 1, first, min(SHARE, n - first), 1]
        wp.launch(kernel, dim=1, inputs=inputs, device=device, block_dim=1)


def _copy(job: Any) -> Any:
    """A job that shares all arrays with another one."""
    other = Job()
    for name in Job.vars:
        setattr(other, name, getattr(job, name))
    return other


def prepare(reference: PictureStack, deformed: PictureStack, batch: Batch, settings: Correlation) -> Any:
    """Everything that a launch reads and writes, on the device of the pictures."""
    device, n = select_device(reference.device), len(batch.points)
    job = Job()
    for name, stack in (("f", reference), ("g", deformed)):
        stride = stack.coefficients[0].shape[2]
        setattr(job, name, stack.addresses)
        setattr(job, f"{name}_first", PAD * stride + PAD)
        setattr(job, f"{name}_rows", stack.shape[0])
        setattr(job, f"{name}_cols", stack.shape[1])
        setattr(job, f"{name}_stride", stride)
        setattr(job, f"{name}_noise", stack.noise_on_device)
    columns = [batch.reference_picture, batch.deformed_picture, batch.place, batch.points, batch.guess]
    if batch.reference is not None:
        columns.append(batch.reference)
        job.has_reference = 1
    given = np.concatenate([column.reshape(-1) for column in columns], dtype=np.float64)
    # a CPU reads an array where it is; the job keeps it
    job.given = wp.array(given, dtype=wp.float64, device=device, copy=False)
    if batch.mask is not None:
        job.mask, job.has_mask = mask_on_device(batch.mask, device), 1
        job.mask_rows, job.mask_cols = batch.mask.shape
    if batch.templates is not None and not device.is_cuda:
        job.has_kept = 1
        for name, array in _kept(batch.templates, device).items():
            setattr(job, name, array)
    job.points = n
    job.subset, job.max_iterations = settings.subset, settings.max_iterations
    job.tolerance, job.least_zncc = settings.tolerance, settings.least_zncc
    job.least_pixels = settings.least_pixels
    job.prefilter, job.grit = settings.prefilter, gradient_noise(settings.prefilter)
    job.between, job.spread, job.slope = _between(settings.prefilter)
    job.offsets, job.room = offsets(settings.subset, reference.device)
    job.found = wp.empty(FOUND * n, dtype=wp.float64, device=device)
    return job


def _kept(templates: Templates, device: Any) -> dict[str, Any]:
    """Kept templates as a CPU reads and writes them where they are."""
    if not templates.bound:
        for name, array in (
            ("known", templates.known), ("kept_pixels", templates.pixels), ("kept_sums", templates.sums),
        ):  # fmt: skip
            templates.bound[name] = wp.array(array.reshape(-1), device=device, copy=False)
    return templates.bound


def search(
    reference: PictureStack, deformed: PictureStack, batch: Batch, settings: Correlation, threads: int
) -> Match:
    """Search a batch on the device of its pictures."""
    job, n = prepare(reference, deformed, batch, settings), len(batch.points)
    if n:
        launch(job, int(settings.shape), n, select_device(reference.device), threads)
    warp, covariance, zncc, iterations, outcome = np.split(
        job.found.numpy(), [12 * n, 16 * n, 17 * n, 18 * n]
    )
    return Match(
        warp=warp.reshape(n, 12),
        covariance=covariance.reshape(n, 2, 2),
        zncc=zncc,
        iterations=iterations.astype(np.int64),
        outcome=outcome.astype(np.int64),
    )
