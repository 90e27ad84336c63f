"""Warp's devices, without its banner, and the spline coefficients of pictures on them."""

import os
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from dic.correlation.kernels.prefilter import on_device, on_host

WORKER = "WORKER_NUMBER"
"""Variable of the environment that numbers the processes which share the GPUs of a machine, from 0."""
NO_DRIVER = "Could not find or load the NVIDIA CUDA driver"


def select_device(name: str) -> Any:
    """Start Warp quietly and return a device: "cpu", "cuda:1", or by "cuda" this process's own (`own_gpu`).

    Raises
    ------
    ValueError
        If the machine has no such device; the message lists those it has.
    """
    _start()
    known = {"cpu"} | {device.alias for device in wp.get_cuda_devices()}
    alias = f"cuda:{own_gpu(len(wp.get_cuda_devices()))}" if name == "cuda" else name
    if alias not in known:
        raise ValueError(f"device must be one of {sorted(known)}, got {name!r}")
    return wp.get_device(alias)


def started() -> bool:
    """Return True if Warp has begun in this process, and with it the driver of a GPU."""
    return wp._src.context.runtime is not None  # as `warp.init` looks


def open_device(name: str) -> None:
    """Have a device ready: a GPU's context takes a quarter of a second; errors as `select_device`."""
    wp.empty(1, dtype=wp.float32, device=select_device(name))


def own_gpu(count: int) -> int:
    """Number of the GPU that a process takes which shares `count` of them with others: one after the other by
    `WORKER`, the first where it is not set."""
    return int(os.environ.get(WORKER, "0")) % max(count, 1)


@cache
def _start() -> None:
    wp.config.log_level = wp.LOG_ERROR
    with _without(NO_DRIVER):
        wp.init()


@contextmanager
def _without(expected: str) -> Iterator[None]:
    """Keep one expected line of native code off stderr; anything else still gets there.

    Warp's library says on every start that a machine has no GPU; that is no news to its user.
    """
    try:
        saved = os.dup(2)
    except OSError:  # no stderr at all, as under some services: nothing to keep clean
        yield
        return
    with tempfile.TemporaryFile(mode="w+", encoding="utf-8", errors="replace") as caught:
        sys.stderr.flush()
        os.dup2(caught.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(saved, 2)
            os.close(saved)
            caught.seek(0)
            for line in caught:
                if expected not in line:
                    os.write(2, line.encode())


def coefficients(greys: Sequence[NDArray[np.float32]], prefilter: float, device: str) -> Any:
    """Coefficients of the quintic B-splines through pictures of one shape, with mirrored margins, on a
    device; shape [n, rows + 2 PAD, columns + 2 PAD and more]."""
    where = select_device(device)
    if where.is_cuda:
        return on_device(greys, prefilter, where)
    planes = [on_host(grey, prefilter) for grey in greys]
    found = planes[0][None] if len(planes) == 1 else np.stack(planes)
    return wp.array(found, dtype=wp.float32, device=where, copy=False)


def addresses(parts: Sequence[Any]) -> Any:
    """Start of each picture's coefficients in the memory of their device, shape [n]."""
    begin = [part.ptr + k * part.strides[0] for part in parts for k in range(part.shape[0])]
    # a CPU reads an array where it is
    return wp.array(np.array(begin, dtype=np.uint64), dtype=wp.uint64, device=parts[0].device, copy=False)


def uploaded(values: NDArray[np.float64], device: str) -> Any:
    """Numbers on a device, shape [n]."""
    return wp.array(values, dtype=wp.float64, device=select_device(device))
