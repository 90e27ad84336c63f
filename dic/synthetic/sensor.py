"""What a sensor makes of light: electrons, noise, fixed pattern, grey values of whole steps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dic.arrays import FloatArray


@dataclass(frozen=True)
class Sensor:
    """A camera's sensor.

    Raises
    ------
    ValueError
        A value outside its range.
    """

    bits: int = 12
    """Of a grey value."""
    full_well: float = 15_000.0
    """Electrons of the largest grey value."""
    read_noise: float = 30.0
    """Standard deviation without light [electrons]."""
    black: float = 0.02
    """Grey value without light over the largest one [-]."""
    white: float = 0.7
    """Grey value of light 1 over the largest one [-]."""
    fixed_pattern: float = 0.0
    """Standard deviation of the pixels' gains [-]."""
    flicker: float = 0.0
    """Standard deviation of the light's brightness from frame to frame [-]."""
    gradient: float = 0.0
    """Light at the right edge of the picture over that at its left, less 1, linear between [-]."""

    def __post_init__(self) -> None:
        if not 1 <= self.bits <= 16:
            raise ValueError(f"bits must be 1 to 16, got {self.bits}")
        if not 0.0 <= self.black < self.white <= 1.0:
            raise ValueError(f"0 <= black < white <= 1 is needed, got {self.black}, {self.white}")
        for name in ("read_noise", "fixed_pattern", "flicker"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} must be finite and not negative, got {getattr(self, name)}")
        if not 0.0 < self.full_well < np.inf or not -1.0 < self.gradient < 10.0:
            raise ValueError(
                f"full_well must be > 0 and gradient > -1, got {self.full_well}, {self.gradient}"
            )

    @property
    def largest(self) -> int:
        """Largest grey value."""
        return int(2**self.bits - 1)

    @property
    def per_electron(self) -> float:
        """Grey values per electron."""
        return self.largest / self.full_well

    def electrons(self, light: NDArray[np.floating]) -> FloatArray:
        """Mean electrons of light on a pixel."""
        return np.asarray(light, dtype=np.float64) * (self.white - self.black) * self.full_well

    def pattern(self, shape: tuple[int, int], rng: np.random.Generator) -> FloatArray:
        """Gains of the pixels with the lamp's gradient, mean 1, shape [rows, columns]."""
        across = 1.0 + self.gradient * (np.linspace(0.0, 1.0, shape[1]) if shape[1] > 1 else np.zeros(1))
        gains = 1.0 + self.fixed_pattern * rng.standard_normal(shape)
        return np.asarray(gains * across / across.mean())

    def expose(
        self, light: NDArray[np.floating], pattern: FloatArray, brightness: float, rng: np.random.Generator
    ) -> NDArray[np.uint16]:
        """Grey values of one picture, shape [rows, columns].

        Photons are Poisson's, read noise is Gaussian; the sum is rounded, and clipped at 0 and the largest.

        Parameters
        ----------
        light
            Light on the pixels, 1 of white paint, shape [rows, columns].
        pattern
            What `pattern` gave for this camera.
        brightness
            Of the lamp in this frame, 1 on average.
        rng
            Random numbers.
        """
        mean = np.maximum(self.electrons(light) * pattern * brightness, 0.0)
        caught = rng.poisson(mean) + self.read_noise * rng.standard_normal(mean.shape)
        grey = self.black * self.largest + caught * self.per_electron
        return np.clip(np.rint(grey), 0, self.largest).astype(np.uint16)
