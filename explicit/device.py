"""Warp's devices, without its banner."""

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import RLock
from typing import Any

import warp as wp

WORKER = "WORKER_NUMBER"
"""Environment variable with the number of a process, from 0, if processes share the GPUs of a machine."""
RESERVED = 1 << 30
"""Unused device memory that a process keeps [bytes]."""
NO_DRIVER = "Could not find or load the NVIDIA CUDA driver"

GENERATING = RLock()
"""Lock for the generation and loading of kernels: Warp stores them in tables of the process."""


def cores() -> int:
    """Cores that this process may use. A batch system or a container may limit them."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def select_device(name: str) -> Any:
    """Start Warp without its banner and return a device: "cpu", "cuda:1", or for "cuda" this process's GPU
    (`own_gpu`).

    Raises ValueError if the machine has no such device; the message lists those it has.
    """
    _start()
    aliases = {"cpu"} | {device.alias for device in wp.get_cuda_devices()}
    alias = f"cuda:{own_gpu(len(wp.get_cuda_devices()))}" if name == "cuda" else name
    if alias not in aliases:
        raise ValueError(f"device must be one of {sorted(aliases)}, got {name!r}")
    device = wp.get_device(alias)
    if device.is_cuda:
        _keep_memory(alias)
    return device


@cache
def _keep_memory(alias: str) -> None:
    """Keep a device's memory between batches: a new allocation takes longer than copying into it."""
    if wp.is_mempool_enabled(alias):
        wp.set_mempool_release_threshold(alias, max(RESERVED, wp.get_mempool_release_threshold(alias)))


def own_gpu(count: int) -> int:
    """Number of the GPU for a process that shares `count` GPUs with others. `WORKER` assigns them in turn. It
    is the first GPU if `WORKER` is not set.
    """
    return int(os.environ.get(WORKER, "0")) % max(count, 1)


def gpus(name: str) -> tuple[str, ...]:
    """Number of GPUs that processes can share: all GPUs of the machine for "cuda", 1 for a specific one
    ("cuda:1"), 0 for "cpu".
    """
    if name == "cpu":
        return ()
    _start()
    return tuple(device.alias for device in wp.get_cuda_devices() if name == "cuda") or (name,)


@cache
def _start() -> None:
    wp.config.log_level = wp.LOG_ERROR
    with _without(NO_DRIVER):
        wp.init()


@contextmanager
def _without(expected: str) -> Iterator[None]:
    """Suppress one line of native code on stderr, which Warp writes at every start without a GPU."""
    try:
        saved = os.dup(2)
    except OSError:  # some services have no stderr: suppression is unnecessary
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


def available() -> tuple[str, ...]:
    """Names of the available devices, the CPU first, each with its description."""
    _start()
    return tuple(f"{device.alias} ({device.name})" for device in wp.get_devices())


def kernel_cache() -> Path:
    """The folder of compiled kernels."""
    _start()
    return Path(str(wp.config.kernel_cache_dir))
