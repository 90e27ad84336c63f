"""Threads of the libraries, while pictures are worked on in threads of our own."""

from collections.abc import Iterator
from contextlib import contextmanager

from threadpoolctl import threadpool_limits


@contextmanager
def libraries_alone() -> Iterator[None]:
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
