"""Pictures prepared for the match: spline coefficients on a device, with the noise of their grey values."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dic.correlation.kernels import device as device_pictures

TOGETHER = 64 * 2**20
"""Pictures that are sent to a GPU and filtered there in one go [bytes]."""


@dataclass(frozen=True)
class Noise:
    """Noise of grey values, independent from pixel to pixel: variance = floor² + gain × grey value.

    Raises
    ------
    ValueError
        A number that is negative or not finite.
    """

    floor: float
    """Standard deviation in the dark [grey]."""
    gain: float = 0.0
    """Growth of the variance with the grey value, as of photons that are counted [grey]."""

    def __post_init__(self) -> None:
        for name in ("floor", "gain"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise ValueError(f"{name} of the noise must be finite and not negative, got {value}")


@dataclass(frozen=True)
class PictureStack:
    """Pictures of one camera, ready to be matched; make it with `prepare`."""

    n_pictures: int
    """Number of pictures."""
    shape: tuple[int, int]
    """Rows and columns [px]."""
    noise: tuple[Noise, ...]
    """Of each picture, before any filter."""
    prefilter: float
    """Standard deviation of the Gaussian that the pictures were smoothed with [px]."""
    device: str
    """Device of the coefficients."""
    coefficients: tuple[Any, ...]
    """Of the quintic B-splines, fp32, with mirrored margins; arrays of the device."""
    addresses: Any
    """Start of each picture's on the device, an array of it."""
    noise_on_device: Any
    """Variance in the dark and gain of each picture, side by side, an array of the device."""

    @property
    def memory(self) -> int:
        """Bytes of the coefficients on the device: 4 a pixel, margins included."""
        return sum(int(part.size) for part in self.coefficients) * 4

    @classmethod
    def prepare(
        cls,
        pictures: ArrayLike | Iterable[ArrayLike],
        *,
        noise: float | Noise | Sequence[float | Noise],
        prefilter: float = 0.0,
        device: str = "cpu",
    ) -> "PictureStack":
        """Smooth pictures, if asked, and turn them into spline coefficients.

        Parameters
        ----------
        pictures
            Grey values, shape [rows, columns] or [n, rows, columns], or pictures of one shape one after the
            other, of which no more are held than go to the device at a time.
        noise
            Standard deviation of a grey value, the same in all pictures or one a picture [grey].
        prefilter
            Standard deviation of the Gaussian [px], 0 to 5; that of the `Correlation` used later.
        device
            "cpu" or "cuda".

        Raises
        ------
        ValueError
            No picture, pictures of several shapes or smaller than 8 x 8, grey values that are not finite, a
            noise for another number of pictures, a device that is not there.
        """
        if not 0.0 <= prefilter <= 5.0:
            raise ValueError(f"prefilter must be from 0 to 5 px, got {prefilter}")
        if isinstance(pictures, np.ndarray) and pictures.ndim == 2:
            pictures = pictures[None]
        planes: list[Any] = []
        waiting: list[Any] = []
        n_pictures = 0
        shape: tuple[int, int] | None = None
        for index, picture in enumerate(pictures):  # type: ignore[arg-type]
            grey = np.asarray(picture, dtype=np.float32)
            if grey.ndim != 2 or min(grey.shape) < 8:
                raise ValueError(
                    f"picture {index} must have two axes of at least 8 px, got shape {grey.shape}"
                )
            shape = shape or (grey.shape[0], grey.shape[1])
            if grey.shape != shape:
                raise ValueError(
                    f"picture {index} has shape {grey.shape}, those before have {shape}: "
                    "pictures of one stack come from one camera"
                )
            if not np.isfinite(grey.sum(dtype=np.float64)):
                raise ValueError(f"picture {index} has grey values that are not finite")
            waiting.append(grey)
            n_pictures += 1
            if len(waiting) * grey.nbytes >= TOGETHER or device == "cpu":
                planes.append(device_pictures.coefficients(waiting, prefilter, device))
                waiting = []
        if shape is None:
            raise ValueError("a stack needs at least one picture")
        if waiting:
            planes.append(device_pictures.coefficients(waiting, prefilter, device))
        single = isinstance(noise, (int, float, Noise))
        given = [noise] * n_pictures if single else list(noise)  # type: ignore[arg-type]
        if len(given) != n_pictures:
            raise ValueError(f"noise must be one value or {n_pictures}, one a picture; got {len(given)}")
        coefficients = tuple(planes)
        greys = tuple(value if isinstance(value, Noise) else Noise(float(value)) for value in given)  # type: ignore[arg-type]
        return cls(
            n_pictures=n_pictures,
            shape=shape,
            noise=greys,
            prefilter=prefilter,
            device=device,
            coefficients=coefficients,
            addresses=device_pictures.addresses(coefficients),
            noise_on_device=_on_device(greys, device),
        )

    @classmethod
    def join(cls, stacks: Sequence["PictureStack"]) -> "PictureStack":
        """One stack of the pictures of several, one after the other; the coefficients are shared.

        Raises
        ------
        ValueError
            No stack, or stacks of several shapes, prefilters or devices.
        """
        kinds = {(stack.shape, stack.prefilter, stack.device) for stack in stacks}
        if len(kinds) != 1:
            raise ValueError(f"stacks to join must agree in shape, prefilter and device, got {sorted(kinds)}")
        if len(stacks) == 1:
            return stacks[0]
        shape, prefilter, device = kinds.pop()
        coefficients = tuple(part for stack in stacks for part in stack.coefficients)
        greys = tuple(noise for stack in stacks for noise in stack.noise)
        return cls(
            n_pictures=sum(stack.n_pictures for stack in stacks),
            shape=shape,
            noise=greys,
            prefilter=prefilter,
            device=device,
            coefficients=coefficients,
            addresses=device_pictures.addresses(coefficients),
            noise_on_device=_on_device(greys, device),
        )

    def single(self, index: int) -> "PictureStack":
        """A stack of one of its pictures, whose coefficients are shared."""
        place = index
        for part in self.coefficients:
            if place < part.shape[0]:
                break
            place -= part.shape[0]
        return PictureStack(
            n_pictures=1,
            shape=self.shape,
            noise=self.noise[index : index + 1],
            prefilter=self.prefilter,
            device=self.device,
            coefficients=(part[place : place + 1],),
            addresses=self.addresses[index : index + 1],
            noise_on_device=_on_device(self.noise[index : index + 1], self.device),
        )


@lru_cache(maxsize=64)
def _on_device(noise: tuple[Noise, ...], device: str) -> Any:
    values = np.array([(grey.floor**2, grey.gain) for grey in noise]).reshape(-1)
    return device_pictures.uploaded(values, device)
