"""Pictures of a series in the order in which a track asks for them, on a GPU read and prepared ahead."""

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from dic.correlation import Noise, PictureStack
from dic.correlation.stack import TOGETHER
from dic.images.series import Pictures
from dic.tracking.frames import Picture, Series, read

PER_PIXEL = 4
"""Bytes of a coefficient."""


@dataclass(frozen=True)
class Block:
    """Some frames, read and prepared."""

    pictures: dict[int, Picture | None]
    """By frame; None: it cannot be read."""
    stack: PictureStack | None
    """Those that can be prepared."""
    place: dict[int, int]
    """Where in the stack a frame is."""


class FramesAhead:
    """Frames of a series, read and prepared when they are asked for, or a block of them ahead.

    On a GPU the pictures of a block are sent and filtered in one go, and the next block is read, decoded and
    sent by a thread while the frames of this one are searched. On a CPU the thread would only take the cores
    that search.

    Parameters
    ----------
    pictures
        The series.
    noise
        Standard deviation of a grey value, or `dic.correlation.Noise` [grey].
    prefilter
        Standard deviation of the Gaussian before the match [px].
    device
        Where the matches are computed.
    border
        Outermost pixels that are left out of what is prepared.
    together
        Size of the coefficients of a block [bytes]; 0: no blocks; None: `TOGETHER` on a GPU, else 0.
    """

    def __init__(
        self,
        pictures: Series,
        *,
        noise: float | Noise,
        prefilter: float,
        device: str,
        border: int = 0,
        together: int | None = None,
    ) -> None:
        self.pictures, self.noise, self.prefilter, self.device = pictures, noise, prefilter, device
        self.inner = slice(border, -border) if border else slice(None)
        self.together = (0 if device == "cpu" else TOGETHER) if together is None else together
        self._block: Block | None = None
        self._to_come: list[int] = []
        self._coming: list[int] = []
        self._next: Future[Block] | None = None
        self._worker = ThreadPoolExecutor(1) if self.together else None

    def expect(self, frames: Sequence[int]) -> None:
        """Have these frames read ahead, which will be asked for in this order."""
        if self._worker is not None:
            self._to_come = list(frames)
            self._begin()

    def close(self) -> None:
        """Read no more frames ahead."""
        if self._worker is not None:
            self._worker.shutdown(cancel_futures=True)

    def read(self, frame: int) -> Picture | None:
        """One frame as recorded, shape [rows, columns]; None if it cannot be read."""
        if self._next is not None and frame in self._coming:
            self._block = self._next.result()
            self._begin()
        if self._block is not None and frame in self._block.pictures:
            return self._block.pictures[frame]
        return read(self.pictures, frame)

    def prepared(self, frame: int, picture: Picture) -> PictureStack:
        """A frame that was `read`, prepared.

        Raises
        ------
        ValueError
            As `PictureStack.prepare`.
        """
        block = self._block
        if block is not None and block.stack is not None and frame in block.place:
            return block.stack.single(block.place[frame])
        return self._stack([picture])

    def _stack(self, pictures: list[Picture]) -> PictureStack:
        some = [picture[self.inner, self.inner] for picture in pictures]
        return PictureStack.prepare(some, noise=self.noise, prefilter=self.prefilter, device=self.device)

    def _begin(self) -> None:
        """Begin the next block."""
        shape = self.pictures.shape if isinstance(self.pictures, Pictures) else np.shape(self.pictures[0])
        many = max(1, self.together // (PER_PIXEL * int(np.prod(shape))))
        self._coming, self._to_come = self._to_come[:many], self._to_come[many:]
        self._next = None
        if self._coming and self._worker is not None:
            self._next = self._worker.submit(self._read_block, self._coming, tuple(shape))

    def _read_block(self, frames: list[int], shape: tuple[int, ...]) -> Block:
        pictures = {frame: read(self.pictures, frame) for frame in frames}
        # whatever else is prepared, or refused, when it is asked for
        fit = [
            frame
            for frame, picture in pictures.items()
            if picture is not None and picture.shape == shape and np.isfinite(picture.sum(dtype=np.float64))
        ]
        stack = self._stack([picture for f in fit if (picture := pictures[f]) is not None]) if fit else None
        return Block(pictures, stack, {frame: place for place, frame in enumerate(fit)})
