"""A process of its own for work that is known later: forked early, told when there is something to do.

`dic.forks.beside` forks when the work begins, and the fork has everything as it stands then. Where it must be
forked before that, because a GPU is opened meanwhile, or because the process has libraries to load, what it
works on is sent to it.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import Pipe
from typing import Any, Generic, TypeVar

from dic.forks import Later, beside

Result = TypeVar("Result")


class Apart(Generic[Result]):
    """The process, as the one that forked it sees it.

    Parameters
    ----------
    tell : callable
        Sends something to it, which must be picklable; returns when it was taken, or the process is gone.
    result
        Waits for what its work returns.
    """

    def __init__(self, tell: Callable[[Any], None], result: Later[Result]) -> None:
        self.tell, self.result = tell, result


@contextmanager
def apart(
    work: Callable[[Callable[[], Any]], Result], instead: Callable[[list[Any]], Result]
) -> Iterator[Apart[Result]]:
    """Fork a process that is told later what to work on; it ends with the block. See `dic.forks.can_fork`.

    Parameters
    ----------
    work
        Its work, of a function that waits for the next thing told and returns it. The result is copied.
    instead
        The same work here, of all that was told: where the process does not deliver. What it raises is
        raised by the result.

    Yields
    ------
    Apart
        The process.
    """
    said, (taken, handed) = list[Any](), Pipe(duplex=False)
    forked = list[bool]()  # filled here only

    def either() -> Result:
        if forked:
            return instead(said)
        handed.close()  # or else a parent that is gone would be waited for
        return work(taken.recv)

    with beside(either, fork=True) as result, handed:
        forked.append(True)
        taken.close()  # or else a process that is gone would be waited for

        def tell(what: Any) -> None:
            said.append(what)
            with suppress(OSError):  # it is gone
                handed.send(what)

        yield Apart(tell, result)
