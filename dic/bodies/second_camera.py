"""Camera 1's points followed by a process of its own, where a GPU matches them.

Cameras that are followed by two threads share one interpreter, and of some hundred points that is what takes
the time: a frame's matches take a GPU a fraction of a millisecond, and what surrounds them is Python. On a
CPU a fork that is made when the points are known serves (`dic.forks.beside`). A GPU is of no use in a fork of
a process that has opened it; so this one is made before that, opens the GPU for itself, and is told the
points. Both search with the same kernels: the tracks have the same bits.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from dic.apart import Apart, apart
from dic.bodies.matched import MatchedBody, track_body
from dic.correlation.kernels.device import open_device, started
from dic.forks import Later, allowed
from dic.images import Pictures
from dic.tracking import Track


class SecondCamera:
    """The process that follows camera 1.

    Parameters
    ----------
    pictures
        The series that it has, of camera 0 and camera 1.
    process
        The process.
    """

    def __init__(self, pictures: tuple[Pictures, Pictures], process: Apart[list[Track]]) -> None:
        self._pictures, self._process, self._told = pictures, process, False

    def can_follow(self, bodies: Sequence[MatchedBody]) -> bool:
        """Whether it has followed nothing yet, and has these bodies' pictures."""
        return not self._told and all(body.pictures is self._pictures for body in bodies)

    def follow(self, bodies: Sequence[MatchedBody]) -> Later[list[Track]]:
        """Follow bodies in camera 1, as `dic.bodies.matched.track_body`: one result, once."""
        self._told = True
        self._process.tell([{**vars(body), "pictures": None} for body in bodies])
        return self._process.result


@contextmanager
def second_camera(pictures: tuple[Pictures, Pictures], device: str) -> Iterator[SecondCamera | None]:
    """Fork the process; it ends with the block.

    Parameters
    ----------
    pictures
        The series of camera 0 and camera 1; best are those that are in memory (`dic.images.kept`).
    device
        Where pictures are correlated.

    Yields
    ------
    SecondCamera or None
        None on a CPU, where forks are not allowed (`dic.forks.forking`), and where Warp has begun.
    """
    if device == "cpu" or not allowed() or started():
        yield None
        return

    def tracks(told: list[dict[str, Any]]) -> list[Track]:
        return [track_body(MatchedBody(**{**fields, "pictures": pictures}), 1) for fields in told]

    def work(take: Callable[[], list[dict[str, Any]]]) -> list[Track]:
        open_device(device)  # while the points are chosen and matched
        return tracks(take())

    with apart(work, lambda told: tracks(told[-1])) as process:
        yield SecondCamera(pictures, process)
