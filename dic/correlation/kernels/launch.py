"""The kernel of the search and its launches: threads on a CPU, warps on a GPU."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from dic.correlation.kernels.device import select_device
from dic.correlation.kernels.grain import between_pixels, gradient_noise
from dic.correlation.kernels.packs import BLOCK
from dic.correlation.kernels.search import ARRAYS, FOUND, search_source
from dic.correlation.kernels.spline import PAD
from dic.correlation.match import Match
from dic.correlation.settings import Correlation
from dic.correlation.stack import Noise, PictureStack
from dic.correlation.templates import Templates

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
class Series:
    """The pictures of a stack."""

    pictures: wp.array(dtype=wp.uint64)
    first: int
    rows: int
    cols: int
    stride: int
    noise: wp.array(dtype=wp.float64)


@wp.struct
class Rules:
    """How all searches with the same settings go about."""

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


@wp.struct
class Kept:
    """Templates of calls before, if there are `any`."""

    any: int
    known: wp.array(dtype=wp.int32)
    pixels: wp.array(dtype=wp.float32)
    sums: wp.array(dtype=wp.float64)


@wp.struct
class Job:
    """What one search reads and writes beside the pictures."""

    mask: wp.array(dtype=wp.uint8)
    has_mask: int
    mask_rows: int
    mask_cols: int
    given: wp.array(dtype=wp.float64)
    has_reference: int
    scratch: wp.array(dtype=wp.float32)
    found: wp.array(dtype=wp.float64)


@cache
def search_kernel(parameters: int) -> Any:
    """Generate the kernel of a shape function."""

    @wp.func_native(snippet=search_source(parameters))
    def search(
        series_f: Series,
        series_g: Series,
        rules: Rules,
        kept: Kept,
        job: Job,
        slot: int,
        slots: int,
        first: int,
        count: int,
    ): ...

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": FLAGS})
    def search_points(
        series_f: Series,
        series_g: Series,
        rules: Rules,
        kept: Kept,
        job: Job,
        slots: int,
        first: int,
        count: int,
        lanes: int,
    ):
        search(series_f, series_g, rules, kept, job, wp.tid() // lanes, slots, first, count)

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


@lru_cache(maxsize=64)
def grey_noise(noise: tuple[Noise, ...], device: str) -> Any:
    """Variance in the dark and gain of each picture, side by side, on a device."""
    values = np.array([(grey.floor**2, grey.gain) for grey in noise]).reshape(-1)
    return wp.array(values, dtype=wp.float64, device=select_device(device))


def series(stack: PictureStack) -> Any:
    """The pictures of a stack as a search reads them."""
    if not stack.bound:
        named, stride = Series(), stack.coefficients[0].shape[2]
        named.pictures, named.noise = stack.addresses, grey_noise(stack.noise, stack.device)
        named.rows, named.cols = stack.shape
        named.first, named.stride = PAD * stride + PAD, stride
        stack.bound["series"] = named
    return stack.bound["series"]


@lru_cache(maxsize=64)
def rules(settings: Correlation, device: str) -> Any:
    """Settings as a search reads them."""
    named = Rules()
    named.subset, named.max_iterations = settings.subset, settings.max_iterations
    named.tolerance, named.least_zncc = settings.tolerance, settings.least_zncc
    named.least_pixels = settings.least_pixels
    named.prefilter, named.grit = settings.prefilter, gradient_noise(settings.prefilter)
    named.between, spread, slope = between_pixels(settings.prefilter)
    named.spread, named.slope = wp.vec4f(*spread), wp.vec4f(*slope)
    named.offsets, named.room = offsets(settings.subset, device)
    return named


def launch(given: list[Any], job: Any, parameters: int, n: int, device: Any, threads: int) -> None:
    """Search all points of a job with the `given` pictures, rules and templates."""
    kernel, room = search_kernel(parameters), given[2].room
    if device.is_cuda:
        slots = min(n, device.sm_count * WARPS_PER_PROCESSOR)
        job.scratch = wp.empty(slots * ARRAYS * room, dtype=wp.float32, device=device)
        inputs = [*given, job, slots, 0, n, 32]
        wp.launch(kernel, dim=slots * 32, inputs=inputs, device=device, block_dim=BLOCK)
        return
    wp.load_module(kernel.module, device=device, block_dim=1)
    threads = min(threads, -(-n // SHARE))
    if threads == 1:
        _share(kernel, given, job, device, range(0, n, SHARE), n)
        return
    with ThreadPoolExecutor(threads) as pool:
        shares = [range(thread * SHARE, n, threads * SHARE) for thread in range(threads)]
        jobs = [pool.submit(_share, kernel, given, _copy(job), device, share, n) for share in shares]
        for done in jobs:
            done.result()


def _share(kernel: Any, given: list[Any], job: Any, device: Any, firsts: range, n: int) -> None:
    """Search the points of a CPU thread, in the order of their number."""
    job.scratch = wp.empty(ARRAYS * given[2].room, dtype=wp.float32, device=device)
    for first in firsts:
        inputs = [*given, job, 1, first, min(SHARE, n - first), 1]
        wp.launch(kernel, dim=1, inputs=inputs, device=device, block_dim=1)


def _copy(job: Any) -> Any:
    """A job that shares all arrays with another one."""
    other = Job()
    for name in Job.vars:
        setattr(other, name, getattr(job, name))
    return other


def prepare(batch: Batch, device: Any) -> Any:
    """What a search reads and writes beside the pictures, on their device."""
    job, n = Job(), len(batch.points)
    which = (batch.reference_picture, batch.deformed_picture, batch.place)
    columns = [*(column[:, None] for column in which), batch.points, batch.guess]
    if batch.reference is not None:
        columns.append(batch.reference)
        job.has_reference = 1
    given = np.concatenate(columns, axis=1, dtype=np.float64).reshape(-1)
    # a CPU reads an array where it is; the job keeps it
    job.given = wp.array(given, dtype=wp.float64, device=device, copy=False)
    if batch.mask is not None:
        job.mask, job.has_mask = (
            wp.array(batch.mask.reshape(-1), dtype=wp.uint8, device=device, copy=False),
            1,
        )
        job.mask_rows, job.mask_cols = batch.mask.shape
    job.found = wp.empty(FOUND * n, dtype=wp.float64, device=device)
    return job


def _kept(templates: Templates, device: Any) -> Any:
    """Kept templates as a CPU reads and writes them where they are."""
    if not templates.bound:
        kept = Kept()
        kept.any = 1
        for name in ("known", "pixels", "sums"):
            array = getattr(templates, name).reshape(-1)
            setattr(kept, name, wp.array(array, device=device, copy=False))
        templates.bound["kept"] = kept
    return templates.bound["kept"]


def search(
    reference: PictureStack, deformed: PictureStack, batch: Batch, settings: Correlation, threads: int
) -> Match:
    """Search a batch on the device of its pictures."""
    device, n = select_device(reference.device), len(batch.points)
    job = prepare(batch, device)
    if n:
        templates = None if device.is_cuda else batch.templates
        given = [
            series(reference),
            series(deformed),
            rules(settings, reference.device),
            Kept() if templates is None else _kept(templates, device),
        ]
        launch(given, job, int(settings.shape), n, device, threads)
    found = job.found.numpy().reshape(n, FOUND)
    return Match(
        warp=found[:, :12].copy(),
        covariance=found[:, 12:16].reshape(n, 2, 2),
        zncc=found[:, 16].copy(),
        iterations=found[:, 17].astype(np.int64),
        outcome=found[:, 18].astype(np.int64),
    )
