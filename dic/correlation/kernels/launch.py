"""Launches of the search: threads on a CPU, warps on a GPU, with transfers through page-locked memory.

The input and output of a search are numbers per point, stored column by column. A GPU can copy page-locked
memory while both the GPU and the host compute. The next call reuses the memory, because locking a page takes
longer than filling it. A large call is divided into parts: some are copied while others are searched.
"""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cache, partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from dic.basics import FloatArray
from dic.correlation.kernels.device import PAD, between_pixels, gradient_noise, select_device
from dic.correlation.kernels.search import ARRAYS, BLOCK, INPUTS, OUTPUTS, search_source
from dic.correlation.subsets import Correlation, Match, PictureStack, Shape, Templates

PART = 65_536
"""Number of points of a part: 25 MB in both directions, and about thirty rounds of a GPU's warps."""
LANES = 3
"""Number of parts in progress: one is filled, one is searched, one is read."""

Launch = Callable[["Lane", int], None]
"""Launches the search of a lane's first n points on its stream."""


def fill(buffer: FloatArray, columns: Sequence[NDArray[Any]], rows: slice) -> int:
    """Write rows of columns to a buffer, column by column; returns the count of numbers written.

    ``buffer``: the destination, shape [numbers]. ``columns``: each of shape [n] or [n, k].
    """
    begin = 0
    for column in columns:
        some = column[rows].reshape(-1)
        buffer[begin : begin + some.size] = some
        begin += some.size
    return begin


def split(output: FloatArray, n: int) -> tuple[FloatArray, ...]:
    """Warps, covariances, correlations, updates and outcomes of n points, as views."""
    return (
        output[: 12 * n].reshape(n, 12),
        output[12 * n : 16 * n].reshape(n, 2, 2),
        output[16 * n : 17 * n],
        output[17 * n : 18 * n],
        output[18 * n : 19 * n],
    )


@dataclass
class Lane:
    """Memory for one part at a time, on the host and on a device, and the stream of its work."""

    device: Any
    """The device, one of Warp's."""
    stream: Any
    """Its stream of the lane; None on a CPU."""
    room: int = 0
    """Capacity [points]."""
    given_host: Any = None
    given: Any = None
    found_host: Any = None
    found: Any = None
    scratch: Any = None
    """Scratch memory of the search on the device; allocated by the launch."""
    rows: slice | None = field(default=None)
    """Points in progress; None: none."""

    def make_room(self, points: int) -> None:
        """Allocate memory for at least this many points."""
        if points <= self.room:
            return
        self.room = max(points, 2 * self.room)
        for name, numbers in (("given", INPUTS), ("found", OUTPUTS)):
            size = numbers * self.room
            host = wp.empty(size, dtype=wp.float64, device="cpu", pinned=self.device.is_cuda)
            setattr(self, f"{name}_host", host)
            setattr(self, name, wp.empty(size, dtype=wp.float64, device=self.device))

    def begin(self, columns: Sequence[NDArray[Any]], rows: slice, launch: Launch) -> None:
        """Send these points and start their search."""
        n, self.rows = rows.stop - rows.start, rows
        numbers = fill(self.given_host.numpy(), columns, rows)
        if self.stream is not None:  # pictures and masks were made on the default stream
            self.stream.wait_stream(self.device.stream)
        wp.copy(self.given, self.given_host, count=numbers, stream=self.stream)
        launch(self, n)
        wp.copy(self.found_host, self.found, count=OUTPUTS * n, stream=self.stream)

    def end(self, match: Match) -> None:
        """Wait for the points in progress and store their results."""
        if self.rows is None:
            return
        if self.stream is not None:
            wp.synchronize_stream(self.stream)
        parts = split(self.found_host.numpy(), self.rows.stop - self.rows.start)
        names = ("warp", "covariance", "zncc", "iterations", "outcome")
        for name, part in zip(names, parts, strict=True):
            getattr(match, name)[self.rows] = part
        self.rows = None


class _LanePool(threading.local):
    """Lanes of a thread, by device; threads never share a lane."""

    def __init__(self) -> None:
        self.lanes: dict[str, list[Lane]] = {}


_lane_pool = _LanePool()


def in_parts(
    columns: Sequence[NDArray[Any]], n: int, device: Any, launch: Launch, *, most: int = PART
) -> Match:
    """Search points in parts, each on a separate lane."""
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
    lanes = _lane_pool.lanes.setdefault(device.alias, [])
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
        for lane in lanes:  # after an error: discard the parts in progress
            lane.rows = None
    return match


FLAGS = "-march=native -ffp-contract=fast -mprefer-vector-width=512 -mstackrealign"
LEAST_SHARE, SHARE = 128, 512
"""Smallest number of points for a CPU thread, and the largest number that it takes at a time."""
WARPS_PER_PROCESSOR = 16
"""Number of warps that run at once on a GPU's multiprocessor. Each has one template."""


@dataclass(frozen=True)
class Batch:
    """Points to be searched, with checked arrays."""

    points: NDArray[np.float64]
    """Positions of the points [px], shape [n, 2]."""
    guess: NDArray[np.float64]
    """Initial warps, shape [n, 12]."""
    reference: NDArray[np.float64] | None
    """Warps to the reference pictures, shape [n, 12]."""
    reference_picture: NDArray[np.int32]
    """Index of the reference picture, shape [n]."""
    deformed_picture: NDArray[np.int32]
    """Index of the deformed picture, shape [n]."""
    mask: NDArray[np.uint8] | None
    """Mask of the material picture, shape [rows, columns]."""
    templates: Templates | None
    place: NDArray[np.int64]
    """Row in the templates, shape [n]."""


@wp.struct
class Job:
    """Inputs and outputs of a search. Memory addresses are stored as numbers, because numbers are fast to
    set."""

    f: wp.uint64
    f_first: int
    f_rows: int
    f_cols: int
    f_stride: int
    f_noise: wp.uint64
    g: wp.uint64
    g_first: int
    g_rows: int
    g_cols: int
    g_stride: int
    g_noise: wp.uint64
    mask: wp.uint64
    has_mask: int
    mask_rows: int
    mask_cols: int
    points: int
    given: wp.uint64
    has_kept: int
    known: wp.uint64
    kept_pixels: wp.uint64
    kept_sums: wp.uint64
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
    offsets: wp.uint64
    scratch: wp.uint64
    found: wp.uint64


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
    """x, y in units of half a subset, and 1 for pixels of the subset (0 for padding), in whole packs, on a
    device."""
    room = -(-subset * subset // 32) * 32
    half = (subset - 1) / 2
    y, x = np.divmod(np.arange(subset * subset), subset)
    table = np.zeros((3, room), dtype=np.float32)
    table[:, : subset * subset] = x / half - 1.0, y / half - 1.0, np.ones(subset * subset)
    return wp.array(table.reshape(-1), dtype=wp.float32, device=select_device(device)), room


_masks: list[tuple[NDArray[np.uint8], Any, Any]] = []
MOST_MASKS = 4
"""Number of masks kept on a device: a body has the same mask in every launch of its track."""


def mask_on_device(mask: NDArray[np.uint8], device: Any) -> Any:
    """A mask on a device, shape [n]. It is sent again only if its pixels have changed."""
    for values, where, on_device in _masks:
        if where == device and values.shape == mask.shape and np.array_equal(values, mask):
            return on_device
    values = mask.copy()  # the caller's mask may change; a CPU reads this copy in place
    on_device = wp.array(values.reshape(-1), dtype=wp.uint8, device=device, copy=False)
    _masks.insert(0, (values, device, on_device))
    del _masks[MOST_MASKS:]
    return on_device


@cache
def _between(prefilter: float) -> tuple[float, Any, Any]:
    mean, spread, slope = between_pixels(prefilter)
    return mean, wp.vec4f(*spread), wp.vec4f(*slope)


class _Jobs(threading.local):
    """Jobs of a thread. The key is the part that does not change between calls. Threads never share a job."""

    def __init__(self) -> None:
        self.known: dict[Any, Any] = {}


_jobs = _Jobs()
MOST_JOBS = 16
"""Largest number of jobs that a thread keeps: one for each picture shape and each set of settings."""


def _job(reference: PictureStack, deformed: PictureStack, settings: Correlation) -> Any:
    """The job of a call, with all values that do not change between calls."""
    strides = tuple(stack.coefficients[0].shape[2] for stack in (reference, deformed))
    key = (settings, reference.device, reference.shape, deformed.shape, strides)
    existing = _jobs.known.get(key)
    if existing is not None:
        return existing
    job = Job()
    for name, stack, stride in zip("fg", (reference, deformed), strides, strict=True):
        setattr(job, f"{name}_first", PAD * stride + PAD)
        setattr(job, f"{name}_rows", stack.shape[0])
        setattr(job, f"{name}_cols", stack.shape[1])
        setattr(job, f"{name}_stride", stride)
    job.subset, job.max_iterations = settings.subset, settings.max_iterations
    job.tolerance, job.least_zncc = settings.tolerance, settings.least_zncc
    job.least_pixels = settings.least_pixels
    job.prefilter, job.grit = settings.prefilter, gradient_noise(settings.prefilter)
    job.between, job.spread, job.slope = _between(settings.prefilter)
    table, job.room = offsets(settings.subset, reference.device)
    job.offsets = table.ptr
    while len(_jobs.known) >= MOST_JOBS:
        del _jobs.known[next(iter(_jobs.known))]
    _jobs.known[key] = job
    return job


def prepare(
    reference: PictureStack, deformed: PictureStack, batch: Batch, settings: Correlation, device: Any
) -> tuple[Any, Any]:
    """All inputs of a launch except the points, on the device of the pictures, and the mask there. The caller
    must keep a reference to the mask until the search has ended."""
    job = _job(reference, deformed, settings)
    job.f, job.f_noise = reference.addresses.ptr, reference.noise_on_device.ptr
    job.g, job.g_noise = deformed.addresses.ptr, deformed.noise_on_device.ptr
    job.has_reference = int(batch.reference is not None)
    job.has_mask = int(batch.mask is not None)
    mask = None
    if batch.mask is not None:
        mask = mask_on_device(batch.mask, device)
        job.mask = mask.ptr
        job.mask_rows, job.mask_cols = batch.mask.shape
    job.has_kept = 0
    return job, mask


def search(
    reference: PictureStack, deformed: PictureStack, batch: Batch, settings: Correlation, threads: int
) -> Match:
    """Search a batch on the device of its pictures."""
    columns = [batch.reference_picture, batch.deformed_picture, batch.place, batch.points, batch.guess]
    if batch.reference is not None:
        columns.append(batch.reference)
    device, n = select_device(reference.device), len(batch.points)
    kernel = search_kernel(int(settings.shape))
    job, _mask = prepare(reference, deformed, batch, settings, device)
    if device.is_cuda:
        load_kernel(kernel, device.alias, BLOCK)
        return in_parts(columns, n, device, partial(_launch_on_device, kernel, job))
    buffer, output = np.empty(sum(column.size for column in columns)), np.empty(OUTPUTS * n)
    fill(buffer, columns, slice(None))
    if n:
        job.points, job.given, job.found = n, buffer.ctypes.data, output.ctypes.data
        if batch.templates is not None:
            templates = batch.templates
            job.has_kept, job.known = 1, templates.known.ctypes.data
            job.kept_pixels, job.kept_sums = templates.pixels.ctypes.data, templates.sums.ctypes.data
        _launch_on_host(kernel, job, n, device, threads)
    warp, covariance, zncc, iterations, outcome = split(output, n)
    return Match(
        warp=warp,
        covariance=covariance,
        zncc=zncc,
        iterations=iterations.astype(np.int64),
        outcome=outcome.astype(np.int64),
    )


def _launch_on_device(kernel: Any, job: Any, lane: Lane, n: int) -> None:
    """Search the points of a lane on its stream."""
    slots = min(n, lane.device.sm_count * WARPS_PER_PROCESSOR)
    size = slots * ARRAYS * job.room
    if lane.scratch is None or lane.scratch.size < size:
        lane.scratch = wp.empty(size, dtype=wp.float32, device=lane.device)
        lane.stream.wait_stream(lane.device.stream)  # its memory was allocated on this stream
    job.points, job.given, job.found, job.scratch = n, lane.given.ptr, lane.found.ptr, lane.scratch.ptr
    wp.launch(
        kernel, dim=slots * 32, inputs=[job, slots, 0, n, 32], device=lane.device, stream=lane.stream,
        block_dim=BLOCK,
    )  # fmt: skip


def _launch_on_host(kernel: Any, job: Any, n: int, device: Any, threads: int) -> None:
    """Search all points of a job, divided between threads."""
    threads = max(1, min(threads, n // LEAST_SHARE))
    share = min(SHARE, -(-n // threads))
    load_kernel(kernel, device.alias, 1)
    if threads == 1:
        _share(kernel, job, device, range(0, n, share), share, n)
        return
    with ThreadPoolExecutor(threads) as pool:
        shares = [range(thread * share, n, threads * share) for thread in range(threads)]
        for future in [
            pool.submit(_share, kernel, _copy(job), device, firsts, share, n) for firsts in shares
        ]:
            future.result()


_loading = threading.Lock()


@cache
def load_kernel(kernel: Any, device: str, block: int) -> None:
    """Compile and load the kernel once. Two threads, one for each camera, may call this at the same time. A
    second load would unload the module during the launches of the first thread.

    `warp.load_module` is not used, because it requires the CUDA context. A forked process does not have this
    context, and Warp would report this on stderr.
    """
    with _loading:
        kernel.module.load(wp.get_device(device), block)


def load_kernels(device: str) -> None:
    """Start a device and load the search of every shape function, which `search` otherwise does at first use.

    Raises ValueError if the machine has no such device.
    """
    where = select_device(device)
    for shape in Shape:
        load_kernel(search_kernel(int(shape)), where.alias, BLOCK if where.is_cuda else 1)


def _share(kernel: Any, job: Any, device: Any, firsts: range, share: int, n: int) -> None:
    """Search the points of a CPU thread, in increasing order, `share` at a time."""
    scratch = np.empty(ARRAYS * job.room, dtype=np.float32)
    job.scratch = scratch.ctypes.data
    for first in firsts:
        inputs = [job, 1, first, min(share, n - first), 1]
        wp.launch(kernel, dim=1, inputs=inputs, device=device, block_dim=1)


def _copy(job: Any) -> Any:
    """A copy of a job that uses the same memory."""
    copy = Job()
    for name in Job.vars:
        setattr(copy, name, getattr(job, name))
    return copy
