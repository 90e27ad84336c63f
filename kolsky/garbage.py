"""Python's collector of reference cycles, while much is made that holds few of them."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

SELDOM = 100_000
"""Objects made, less those gone, from one look for cycles to the next; Python looks after some hundred."""


@contextmanager
def collected_seldom() -> Iterator[None]:
    """Look for cycles seldom: each look goes through all young objects, every so many through all there are.

    A page of figures took an eighth of its time for it. Objects that no cycle holds go at once, as ever.
    """
    before = gc.get_threshold()
    gc.set_threshold(SELDOM, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)
