"""Settings of the running process for a while: the garbage collector, the libraries' threads."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits

__all__ = ["infrequent_gc", "single_threaded_libraries"]

GC_THRESHOLD = 100_000
"""Objects made, less those gone, from one look for cycles to the next; Python looks after some hundred."""


@contextmanager
def infrequent_gc() -> Iterator[None]:
    """Look for cycles seldom: each look goes through all young objects, every so many through all there are.

    A page of figures took an eighth of its time for it. Objects that no cycle holds go at once, as ever.
    """
    before = gc.get_threshold()
    gc.set_threshold(GC_THRESHOLD, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


@contextmanager
def single_threaded_libraries() -> Iterator[None]:
    """One thread for each call of OpenCV and of BLAS: their own ones wait for work by spinning, on cores that
    have some."""
    import cv2

    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(limits=1, user_api="blas"):
            yield
    finally:
        cv2.setNumThreads(before)
