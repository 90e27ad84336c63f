"""The running process and its workers: garbage collector, threads, termination."""

import ctypes
import gc
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread
from typing import Any

from threadpoolctl import threadpool_limits

from dic import following

WORKER = "WORKER_NUMBER"
"""Environment variable with a worker's number, as `explicit.device` and `dic` read it."""
GC_THRESHOLD = 100_000
"""Net number of new objects between two searches for reference cycles. Python's default is some hundred."""
GC_THRESHOLD_OF_COMMAND = 20_000
"""The corresponding number for other work of a command, in which a cycle may contain large arrays."""


@contextmanager
def infrequent_gc(threshold: int = GC_THRESHOLD) -> Iterator[None]:
    """Search for reference cycles rarely.

    Each search visits all young objects, and some visit all objects. These searches take an eighth of the
    time of a page of figures. Objects outside cycles are freed immediately. ``threshold``: net number of new
    objects between two searches.
    """
    before = gc.get_threshold()
    gc.set_threshold(max(threshold, before[0]), *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


@contextmanager
def last_work() -> Iterator[None]:
    """For the last work of this process: search for cycles rarely, and not at all at the end.

    Python would search all objects before it exits. The memory would be freed by the system in any case.
    """
    with infrequent_gc(GC_THRESHOLD_OF_COMMAND):
        try:
            yield
        finally:
            gc.freeze()


TRIM_THRESHOLD, TOP_PAD, MMAP_THRESHOLD = (-1, 256 * 2**20), (-2, 16 * 2**20), (-3, 32 * 2**20)
"""Parameters of glibc's `mallopt` by number, and their values [bytes]. The last one is the value that glibc
sets automatically when a program frees a large array."""


def keep_freed_memory() -> None:
    """Make glibc keep freed memory for the next array, up to 256 MB.

    It has no effect with another C library. By default, glibc returns every array beyond 128 kB to the
    system. The next array then needs new pages, which the system fills with zeros. This takes a third of the
    system time in a correlation of small pictures. It takes more if forks copy pages that are written to.
    """
    if sys.platform == "linux":
        with suppress(AttributeError, OSError):  # another C library
            library = ctypes.CDLL("libc.so.6")
            for number, value in (TRIM_THRESHOLD, TOP_PAD, MMAP_THRESHOLD):
                library.mallopt(number, value)


BLAS_THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Environment variables that a BLAS reads when it is loaded."""


def set_blas_threads() -> None:
    """Use one thread for each later call of BLAS.

    A number in the environment takes precedence. It has an effect only before NumPy is loaded. The matrices
    of an identification are small. Several threads take longer for them than one, and they wait in busy loops
    on cores that have other work.
    """
    for name in BLAS_THREADS:
        os.environ.setdefault(name, "1")


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """One thread for each call of BLAS, see `set_blas_threads`.

    It also works in a process that has already loaded BLAS.
    """
    with threadpool_limits(limits=1, user_api="blas"):
        yield


@contextmanager
def single_threaded_libraries() -> Iterator[None]:
    """One thread for each call of OpenCV and of BLAS.

    Their thread pools wait in busy loops on cores that have other work.
    """
    with one_blas_thread():
        if find_spec("cv2") is None:  # see `dic.basics`
            yield
            return
        import cv2

        before = cv2.getNumThreads()
        cv2.setNumThreads(1)
        try:
            yield
        finally:
            cv2.setNumThreads(before)


@contextmanager
def process_pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Processes of this machine that end with the block.

    They also end with this process, whatever ends it. If the block ends by an exception, they are stopped at
    once, because their results are not needed. They are not forked, because a copy of a process that has
    started threads may hang. Each has its number in the environment (`WORKER`). Workers with device "cuda"
    use it to share the GPUs.
    """
    context = get_context("spawn")
    started = context.Value("i", 0)
    pool = ProcessPoolExecutor(workers, mp_context=context, initializer=_start_worker, initargs=(started,))
    try:
        yield pool
    except BaseException:
        for process in list((pool._processes or {}).values()):  # public from Python 3.14 on
            process.terminate()
        pool.shutdown(wait=True, cancel_futures=True)
        raise
    pool.shutdown(wait=True)


def run_program(program: Path, *words: str, timeout: float) -> subprocess.CompletedProcess[str]:
    """Run a Python file in a separate process.

    On Linux it always ends together with this process. ``program``: the file, which is run as `__main__`. Its
    imports do not find modules in its folder. ``words``: its arguments in `sys.argv`, after its name.
    ``timeout``: longest allowed time [s]. Raises subprocess.TimeoutExpired if it takes longer. It is then
    terminated.
    """
    return subprocess.run(
        [sys.executable, "-P", following.__file__, str(os.getpid()), str(program), *words],
        capture_output=True,
        timeout=timeout,
        check=False,
        encoding="utf-8",
        env={**os.environ, "PYTHONIOENCODING": "utf-8"},
    )


def _start_worker(started: Any) -> None:
    """Take the next number, and end with the parent."""
    with started.get_lock():
        os.environ[WORKER] = str(started.value)
        started.value += 1
    _follow_parent()


def _follow_parent() -> None:
    """End this worker at once when its parent process has ended. The parent handles Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    assert parent is not None  # the pool starts it

    def wait() -> None:
        parent.join()
        os._exit(1)

    Thread(target=wait, daemon=True).start()
