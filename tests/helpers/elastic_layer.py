"""Exact solution of an elastic specimen between two elastic bars: every reflection of one-dimensional waves.

A wave of force passes from impedance Za to Zb with the factor 2 Zb / (Za + Zb). It is reflected with the
factor (Zb - Za) / (Zb + Za). For a trapezoidal incident pulse all waves, and their integrals over time, are
sums of shifted trapezoids.
"""

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from kolsky.bars.records import BarSignal, Signal
from kolsky.base.apparatus import Bar, Specimen

STEEL = Bar(diameter=0.015, length=1.5, youngs_modulus=190e9, density=8048.0)
ALUMINIUM = Bar(diameter=0.018, length=1.4, youngs_modulus=70e9, density=2700.0)
POLYMER = Specimen(diameter=0.010, length=0.005, density=1200.0)


@dataclass(frozen=True)
class Layer:
    """The test. Compressive forces are positive. At time 0 the incident wave reaches the specimen."""

    first: Bar = STEEL
    second: Bar = STEEL
    specimen: Specimen = POLYMER
    modulus: float = 4e9
    peak: float = 20e3
    rise: float = 20e-6
    hold: float = 100e-6
    gauges: tuple[float, float] = (0.75, 0.5)
    sign: float = 1.0

    @property
    def transit(self) -> float:
        return self.specimen.length * (self.specimen.density / self.modulus) ** 0.5

    @property
    def impedance(self) -> float:
        return (self.modulus * self.specimen.density) ** 0.5 * self.specimen.area

    def pulse(self, time: np.ndarray) -> np.ndarray:
        """Force of the incident wave [N]."""
        up = np.clip(time / self.rise, 0.0, 1.0)
        down = np.clip((time - self.rise - self.hold) / self.rise, 0.0, 1.0)
        return self.sign * self.peak * (up - down)

    def impulse(self, time: np.ndarray) -> np.ndarray:
        """Its integral over time [N s]."""

        def ramp(t: np.ndarray) -> np.ndarray:
            return np.where(t < self.rise, 0.5 * np.maximum(t, 0.0) ** 2 / self.rise, t - 0.5 * self.rise)

        return self.sign * self.peak * (ramp(time) - ramp(time - self.rise - self.hold))

    def transmitted(self, time: np.ndarray, of=None) -> np.ndarray:
        """Force of the wave in the second bar at its face."""
        of = of or self.pulse
        z, z1, z2 = self.impedance, self.first.impedance, self.second.impedance
        r1, r2 = (z1 - z) / (z1 + z), (z2 - z) / (z2 + z)
        passed = 2 * z / (z1 + z) * 2 * z2 / (z + z2)
        return passed * sum((r1 * r2) ** n * of(time - (2 * n + 1) * self.transit) for n in self.echoes(time))

    def reflected(self, time: np.ndarray, of=None) -> np.ndarray:
        """Force of the returning wave in the first bar at its face."""
        of = of or self.pulse
        z, z1, z2 = self.impedance, self.first.impedance, self.second.impedance
        r1, r2 = (z1 - z) / (z1 + z), (z2 - z) / (z2 + z)
        passed = 2 * z / (z1 + z) * r2 * 2 * z1 / (z + z1)
        echoes = sum((r1 * r2) ** n * of(time - 2 * (n + 1) * self.transit) for n in self.echoes(time))
        return -r1 * of(time) + passed * echoes

    def echoes(self, time: np.ndarray) -> range:
        """Numbers of the echoes up to the last time."""
        return range(int(max(0.0, np.max(time)) / (2 * self.transit)) + 1)

    def strain(self, time: np.ndarray) -> np.ndarray:
        """Nominal strain of the specimen, exactly."""
        i, r, t = self.impulse(time), self.reflected(time, self.impulse), self.transmitted(time, self.impulse)
        return ((i - r) / self.first.impedance - t / self.second.impedance) / self.specimen.length

    def signals(
        self, *, interval: float = 0.1e-6, noise: float = 0.0, seed: int = 0, before: float = 100e-6
    ) -> tuple[BarSignal, BarSignal]:
        """The strains of both gauges with the same time 0. The record ends before a wave returns from the far
        ends."""
        rng = np.random.default_rng(seed)
        far = min(2 * b.length / b.wave_speed - x / b.wave_speed for b, x in self.stations)
        start = -self.gauges[0] / self.first.wave_speed - before
        time = start + interval * np.arange(int((far - start) / interval))
        x1, x2 = (x / b.wave_speed for b, x in self.stations)
        forces = (self.pulse(time + x1) + self.reflected(time - x1), self.transmitted(time - x2))
        return tuple(
            BarSignal(
                Signal(
                    start, interval, force / elastic(bar) + noise * rng.normal(size=time.size), noise, "1",
                    f"{side} gauge",
                ),
                bar,
                x,
                side,
            )
            for force, (bar, x), side in zip(forces, self.stations, ("incident", "transmission"), strict=True)
        )  # fmt: skip

    @property
    def stations(self) -> tuple[tuple[Bar, float], tuple[Bar, float]]:
        return (self.first, self.gauges[0]), (self.second, self.gauges[1])

    def pulled(self) -> "Layer":
        """The same in tension."""
        return replace(self, sign=-self.sign)


def elastic(bar: Bar) -> float:
    """Force per strain [N]."""
    return bar.youngs_modulus * pi * bar.diameter**2 / 4
