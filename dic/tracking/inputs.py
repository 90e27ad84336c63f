"""Inputs and result of tracking: settings, usable pictures prepared in advance, tracks."""

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dic.basics import FloatArray, IntArray, cv2
from dic.correlation import Noise, PictureStack
from dic.correlation.subsets import TOGETHER, Correlation
from dic.images.series import PictureError, Pictures
from dic.outcome import FrameOutcome, PointOutcome


@dataclass(frozen=True, kw_only=True)
class Tracking:
    """Settings of the tracking of points in time.

    Raises
    ------
    ValueError
        If a value is outside its range; the message names it.
    """

    correlation: Correlation = field(default_factory=Correlation)
    """Settings of the match of one subset."""
    update_stretch: float = 1.5
    """A point gets the current picture as its new reference if its subset has been stretched or flattened by
    this factor since the last reference. Above 1."""
    update_zncc: float = 0.9
    """A point also gets a new reference when its correlation is below this value in two successive frames."""
    growth: float = 1.0
    """Largest growth of a flattened subset in the material picture. A subset grows at changes of reference,
    to keep its shortest side in the current picture. 1: no growth."""
    return_every: int = 5
    """Number of frames between attempts to return to an earlier reference; 0: never."""
    search: int = 24
    """Half width of the search window [px]; 0: no search. If all other guesses fail, cross-correlation
    searches a point in this window around its guess."""
    neighbour_gate: float = 1.0
    """Largest distance of a point from the position predicted by at least two of its neighbours [px]."""
    least_valid: float = 0.2
    """If a smaller share of the points is found in a frame, the frame is searched again with seeds."""

    def __post_init__(self) -> None:
        checks = (
            ("update_stretch", 1.0 < self.update_stretch <= 10.0, "above 1, at most 10"),
            ("update_zncc", 0.0 <= self.update_zncc < 1.0, "from 0 to below 1"),
            ("growth", 1.0 <= self.growth <= 10.0, "from 1 to 10"),
            ("return_every", self.return_every >= 0, "0 or more frames"),
            ("search", 0 <= self.search <= 512, "from 0 to 512 px"),
            ("neighbour_gate", self.neighbour_gate > 0.0, "above 0 px"),
            ("least_valid", 0.0 <= self.least_valid <= 1.0, "from 0 to 1"),
        )
        for name, fine, allowed in checks:
            if not fine:
                raise ValueError(f"{name} must be {allowed}, got {getattr(self, name)}")


@dataclass(frozen=True)
class Track:
    """Subsets tracked through a series; material picture and points are the same in all frames."""

    points: FloatArray
    """Positions in the material picture (x, y) [px], shape [n_points, 2]."""
    warp: FloatArray
    """Total warps, shape [n_frames, n_points, 12]; meaningful where the outcome is VALID."""
    covariance: FloatArray
    """Covariance of the position [px²], shape [n_frames, n_points, 2, 2]: noise of the match and of all
    earlier changes of reference."""
    zncc: FloatArray
    """Correlation with the reference used, shape [n_frames, n_points]."""
    outcome: IntArray
    """`dic.PointOutcome`, shape [n_frames, n_points]."""
    reference: IntArray
    """Frame whose picture was the reference, shape [n_frames, n_points]."""
    frame_outcome: IntArray | None = None
    """`dic.FrameOutcome` of the pictures, shape [n_frames]; None if they were not checked."""
    excess: FloatArray | None = None
    """Excess of the residual's variance over that of the noise, relative to the noise [-], shape [n_frames,
    n_points]. It is the largest of all matches in the chain of references from the material picture. NaN
    where the point was not found, None if not computed."""
    root: FloatArray | None = None
    """Covariance of the positions due to the noise of the first reference only, in the material picture
    [px²], shape [n_points, 2, 2]. NaN for points without a template, None if not known."""

    @classmethod
    def empty(cls, points: FloatArray, reference: int, frame_outcome: IntArray) -> "Track":
        """A track without a found point. ``reference``: the reference in all frames."""
        size = len(frame_outcome), len(points)
        return cls(
            points=points,
            warp=np.full((*size, 12), np.nan),
            covariance=np.full((*size, 2, 2), np.nan),
            zncc=np.full(size, np.nan),
            outcome=np.full(size, int(PointOutcome.NO_PICTURE)),
            reference=np.full(size, reference),
            frame_outcome=frame_outcome,
        )


Picture = NDArray[Any]
Series = Pictures | Sequence[Picture] | Picture
"""A series of pictures: from a file, or arrays [rows, columns] in memory."""

CONTRAST = 0.1
"""A picture with less than this share of the material picture's contrast is black."""
ROUGHNESS = 0.8
"""In pure noise neighbouring pixels differ as much as distant pixels. A picture above this ratio is noise."""
THINNED = 4
"""Stride of rows and columns in the comparison of neighbouring pixels."""
CLIPPED = 0.5
"""A picture is saturated if at least this share of its pixels has the largest grey value."""


def count(pictures: Series) -> int:
    """Number of frames."""
    return pictures.n_frames if isinstance(pictures, Pictures) else len(pictures)


def read(pictures: Series, index: int) -> Picture | None:
    """One frame, shape [rows, columns]; None if it cannot be read."""
    frame = getattr(pictures, "frame", None)  # faster than isinstance with a protocol
    if frame is None:
        return np.asarray(pictures[index])  # type: ignore[index]  # arrays in memory
    try:
        return np.asarray(frame(index))
    except (PictureError, OSError):
        return None


def _mean_and_spread(grey: NDArray[np.float32]) -> tuple[float, float]:
    """Mean and standard deviation of the grey values, in one pass."""
    mean, spread = cv2.meanStdDev(grey)
    return float(mean[0, 0]), float(spread[0, 0])


@dataclass(frozen=True)
class Scene:
    """Mean and contrast of the material picture. A picture of the specimen is recognised by them."""

    mean: float
    """Mean grey value [grey]."""
    contrast: float
    """Standard deviation of the grey values [grey]."""

    @classmethod
    def of(cls, picture: Picture) -> "Scene":
        """Mean and contrast of a picture, shape [rows, columns]."""
        return cls(*_mean_and_spread(np.asarray(picture, dtype=np.float32)))

    def judge(self, picture: Picture | None) -> FrameOutcome:
        """Outcome of a picture: whether it shows the specimen.

        A picture is saturated if at least half of its pixels are within 2 % of its largest grey value. This
        value must be above the mean of the material picture. It is black if its contrast is below a tenth of
        that of the material picture. It is also black if neighbouring pixels differ as much as distant ones
        do.

        ``picture``: the frame, shape [rows, columns]; None if it could not be read.
        """
        if picture is None or picture.ndim != 2 or picture.size == 0:
            return FrameOutcome.UNREADABLE
        grey = np.asarray(picture, dtype=np.float32)
        mean, contrast = _mean_and_spread(grey)
        if not np.isfinite(mean):
            return FrameOutcome.UNREADABLE
        top = float(grey.max())
        if np.count_nonzero(grey >= 0.98 * top) >= CLIPPED * grey.size and top > self.mean:
            return FrameOutcome.SATURATED
        if contrast <= CONTRAST * self.contrast:
            return FrameOutcome.BLACK
        lines = (grey[::THINNED], grey[:, ::THINNED].T)
        rough = min(float(np.diff(some, axis=1).std()) for some in lines) / (np.sqrt(2.0) * contrast)
        return FrameOutcome.BLACK if rough > ROUGHNESS else FrameOutcome.VALID


PER_PIXEL = 4
"""Bytes of a coefficient."""


@dataclass(frozen=True)
class Block:
    """Some frames, read and prepared."""

    pictures: dict[int, Picture | None]
    """Pictures by frame; None: unreadable."""
    stack: PictureStack | None
    """The prepared pictures."""
    place: dict[int, int]
    """Index in the stack by frame."""


class FramesAhead:
    """Frames of a series, read and prepared on request or one block in advance.

    On a GPU the pictures of a block are sent and filtered together. A thread reads, decodes and sends the
    next block while the frames of the present block are searched. On a CPU there is no such thread, because
    it would compete with the search for cores.

    ``noise``: standard deviation of a grey value, or `dic.correlation.Noise` [grey]. ``prefilter``: standard
    deviation of the Gaussian before the match [px]. ``border``: width of the border that is cut off before
    the preparation [px]. ``together``: size of the coefficients of a block [bytes]; 0: no blocks; None:
    `TOGETHER` on a GPU, else 0.
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
        """Announce the next frames in the order of their requests. They are read ahead."""
        if self._worker is not None:
            self._to_come = list(frames)
            self._begin()

    def close(self) -> None:
        """Stop reading frames ahead."""
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
        """Prepare a frame that was returned by `read`.

        Raises ValueError as `PictureStack.prepare`.
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
        # all other frames are prepared or rejected on request
        fit = [
            frame
            for frame, picture in pictures.items()
            if picture is not None and picture.shape == shape and np.isfinite(picture.sum(dtype=np.float64))
        ]
        stack = self._stack([picture for f in fit if (picture := pictures[f]) is not None]) if fit else None
        return Block(pictures, stack, {frame: place for place, frame in enumerate(fit)})
