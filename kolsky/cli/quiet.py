"""Whether a command was asked to be quiet; known to what prints and to nothing else."""

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_asked: ContextVar[bool] = ContextVar("quiet", default=False)


def is_quiet() -> bool:
    """True within a command with `--quiet`."""
    return _asked.get()


@contextmanager
def quietly(asked: bool) -> Iterator[None]:
    """Let everything inside be quiet, if asked for."""
    token = _asked.set(asked)
    try:
        yield
    finally:
        _asked.reset(token)
