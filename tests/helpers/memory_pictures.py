"""A series of pictures in memory, some of which cannot be read."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dic.images import PictureError


@dataclass(frozen=True)
class Memory:
    """Pictures in memory; a frame that is None cannot be read."""

    frames: Sequence[np.ndarray | None]
    bits: int = 8
    crop_offset: tuple[float, float] = (0.0, 0.0)
    times: None = None
    path: Path = Path("memory")

    @property
    def n_frames(self) -> int:
        return len(self.frames)

    @property
    def shape(self) -> tuple[int, int]:
        rows, columns = next(frame for frame in self.frames if frame is not None).shape
        return rows, columns

    def frame(self, index: int) -> np.ndarray:
        picture = self.frames[index]
        if picture is None:
            raise PictureError(self.path, "is not there", frame=index)
        return picture
