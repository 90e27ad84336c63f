"""The kernel of the search along epipolar curves and its launches: threads on a CPU, warps on a GPU."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from dic.correlation.kernels.device import select_device
from dic.correlation.kernels.lanes import BLOCK
from dic.correlation.kernels.launch import FLAGS, WARPS_PER_PROCESSOR, load_kernel
from dic.forks import cores
from dic.stereo.kernels.curve import FOUND, curve_source

SHARE = 64
"""Points a CPU thread takes at a time."""
LONGEST = 1024
"""Steps of a curve that there is room for at first."""


@wp.struct
class CurveJob:
    """Everything that a search along curves reads and writes."""

    camera: wp.array(dtype=wp.float64)
    picture: wp.array(dtype=wp.float32)
    rows: int
    columns: int
    given: wp.array(dtype=wp.float64)
    has_gradient: int
    turns: wp.array(dtype=wp.float64)
    n_turns: int
    step: wp.float64
    offsets: wp.array(dtype=wp.float32)
    extent: wp.float32
    room: int
    sample: wp.array(dtype=wp.float32)
    weight: wp.array(dtype=wp.float32)
    seen: wp.array(dtype=wp.float64)
    profile: wp.array(dtype=wp.float64)
    longest: int
    found: wp.array(dtype=wp.float64)


@dataclass(frozen=True)
class Curves:
    """Subsets and the curves along which they are looked for; arrays in C order."""

    camera: NDArray[np.float64]
    """Camera 1 as the kernel reads it, and camera 0's centre, shape [29]."""
    picture: NDArray[np.float32]
    """Camera 1's picture, smoothed, shape [rows, columns]."""
    given: NDArray[np.float64]
    """Numbers of each point, shape [n, `dic.stereo.kernels.curve.GIVEN`]."""
    has_gradient: bool
    """True if these hold a gradient that is used all along the curve."""
    turns: NDArray[np.float64]
    """Cosine and sine of each turn within and out of the epipolar plane, shape [h, 4]."""
    step: float
    """Along the curve [px]."""
    xi: NDArray[np.float64]
    """Offsets of the samples [px], shape [m, 2]."""
    template: NDArray[np.float32]
    """Templates, shape [n, m]."""
    weight: NDArray[np.float32]
    """1 for a sample that counts, shape [n, m]."""


@cache
def curve_kernel() -> Any:
    """Generate the kernel."""

    @wp.func_native(snippet=curve_source())
    def search(job: CurveJob, slot: int, slots: int, first: int, count: int): ...

    @wp.kernel(module="unique", enable_backward=False, module_options={"cpu_compiler_flags": FLAGS})
    def search_curves(job: CurveJob, slots: int, first: int, count: int, lanes: int):
        search(job, wp.tid() // lanes, slots, first, count)

    return search_curves


def search(curves: Curves, device: str, threads: int | None = None) -> NDArray[np.float64]:
    """Search the curves of all points.

    Parameters
    ----------
    curves
        What to look for, and where.
    device
        "cpu" or "cuda".
    threads
        CPU threads; None: all cores the process may use. A result does not depend on it.

    Returns
    -------
    NDArray
        Of each point place (2), gradient (4), correlation, second peak, distance and number of steps, shape
        [n, `dic.stereo.kernels.curve.FOUND`].
    """
    n, where = len(curves.given), select_device(device)
    result = np.zeros((n, FOUND))
    rows, longest = np.arange(n), LONGEST
    while rows.size:  # a curve longer than there is room for is walked again
        result[rows] = _search(curves, rows, longest, where, threads or cores())
        rows = rows[result[rows, 9] > longest]
        longest = int(result[rows, 9].max(initial=0.0))
    return result


def _search(
    curves: Curves, rows: NDArray[np.int64], longest: int, device: Any, threads: int
) -> NDArray[np.float64]:
    n, m = len(rows), len(curves.xi)
    room = -(-m // 32) * 32
    wide = np.zeros((2, n, room), dtype=np.float32)
    wide[0, :, :m], wide[1, :, :m] = curves.template[rows], curves.weight[rows]
    offsets = np.zeros((2, room), dtype=np.float32)
    offsets[:, :m] = curves.xi.T
    job = CurveJob()
    for name, array, dtype in (
        ("camera", curves.camera, wp.float64),
        ("picture", curves.picture.reshape(-1), wp.float32),
        ("given", curves.given[rows].reshape(-1), wp.float64),
        ("turns", curves.turns.reshape(-1), wp.float64),
        ("offsets", offsets.reshape(-1), wp.float32),
        ("sample", wide[0].reshape(-1), wp.float32),
        ("weight", wide[1].reshape(-1), wp.float32),
        ("seen", np.maximum(curves.weight[rows].sum(axis=1, dtype=np.float64), 1.0), wp.float64),
    ):
        # a CPU reads an array where it is; the job keeps it
        setattr(job, name, wp.array(np.ascontiguousarray(array), dtype=dtype, device=device, copy=False))
    job.rows, job.columns = curves.picture.shape
    job.has_gradient, job.n_turns = int(curves.has_gradient), len(curves.turns)
    job.step = curves.step
    job.extent, job.room, job.longest = float(np.abs(curves.xi).max(initial=0.0)), room, longest
    job.found = wp.empty(n * FOUND, dtype=wp.float64, device=device)
    kernel = curve_kernel()
    if device.is_cuda:
        slots = min(n, device.sm_count * WARPS_PER_PROCESSOR)
        job.profile = wp.empty(slots * longest, dtype=wp.float64, device=device)
        wp.launch(kernel, dim=slots * 32, inputs=[job, slots, 0, n, 32], device=device, block_dim=BLOCK)
        return np.asarray(job.found.numpy().reshape(n, FOUND))
    load_kernel(kernel, device.alias, 1)
    workers = max(1, min(threads, -(-n // SHARE)))
    job.profile = wp.empty(workers * longest, dtype=wp.float64, device=device)

    def share(worker: int) -> None:
        for first in range(worker * SHARE, n, workers * SHARE):
            # slots 1: the worker's own profile by the first index of its own view
            inputs = [_own(job, worker, longest), 1, first, min(SHARE, n - first), 1]
            wp.launch(kernel, dim=1, inputs=inputs, device=device, block_dim=1)

    if workers == 1:
        share(0)
    else:
        with ThreadPoolExecutor(workers) as pool:
            list(pool.map(share, range(workers)))
    return np.asarray(job.found.numpy().reshape(n, FOUND))


def _own(job: Any, worker: int, longest: int) -> Any:
    """The job with the profile of one worker."""
    other = CurveJob()
    for name in CurveJob.vars:
        setattr(other, name, getattr(job, name))
    other.profile = job.profile[worker * longest : (worker + 1) * longest]
    return other
