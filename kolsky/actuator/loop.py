"""The closed loop with a simulated plant, and the wall time of every tick."""

from dataclasses import dataclass
from time import perf_counter, process_time, sleep

import numpy as np
from scipy.interpolate import PchipInterpolator

from kolsky.actuator.controller import Controller, Plant
from kolsky.base.arrays import BoolArray, FloatArray

SETTLED = 0.5
"""Last share of the time of each wanted angle in which the error is judged [-]."""


@dataclass(frozen=True)
class Closed:
    """A run of the closed loop."""

    time: FloatArray
    """Of the ticks [s], shape [n]."""
    wanted: FloatArray
    """Wanted angle [rad], shape [n]."""
    measured: FloatArray
    """Angle that the controller saw [rad], shape [n]."""
    angle: FloatArray
    """Angle of the plant [rad], shape [n]."""
    pressure: FloatArray
    """Pressure that was asked for [Pa], shape [n]."""
    wall: FloatArray
    """Wall time from the beginning of each tick to its pressure [s], shape [n]."""
    processor: FloatArray
    """Processor time of the controller in each tick [s], which other programs do not lengthen, shape [n]."""
    bounded: BoolArray
    """Ticks at a bound of the pressure, shape [n]."""
    held: BoolArray
    """Ticks in which the model gave no pressure, shape [n]."""
    rate: float
    """Ticks a second [1/s]."""
    real_time: bool = False
    """Whether every tick waited for its time; its wall time then begins when it was due."""

    @property
    def late(self) -> int:
        """Ticks that took longer than their period."""
        return int((self.wall > 1.0 / self.rate).sum())

    def settled_error(self) -> FloatArray:
        """Root mean square of plant less wanted angle in the last half of each wanted angle [rad]."""
        starts = np.flatnonzero(np.diff(self.wanted, prepend=np.nan) != 0.0)
        ends = [*starts[1:], len(self.wanted)]
        found = []
        for a, b in zip(starts, ends, strict=True):
            part = slice(a + int(SETTLED * (b - a)), b)
            found.append(float(np.sqrt(np.mean((self.angle[part] - self.wanted[part]) ** 2))))
        return np.array(found)


def run_loop(
    controller: Controller,
    plant: Plant,
    wanted: FloatArray,
    *,
    rate: float,
    seed: int,
    real_time: bool = False,
) -> Closed:
    """Close the loop for wanted angles [rad] of shape [n], one a tick.

    The pressure in the actuator follows the one asked for with the plant's lag; the camera sees its angle,
    with noise, some ticks late. In real time a tick waits until it is due, and what it takes to wake up is
    part of its wall time; else the ticks follow one another at once.
    """
    rng = np.random.default_rng(seed)
    bend = PchipInterpolator(plant.pressure, plant.angle)
    n, dt = len(wanted), 1.0 / rate
    follow = 1.0 - np.exp(-dt / plant.lag) if plant.lag > 0.0 else 1.0
    inside = 0.0
    columns = {name: np.zeros(n) for name in ("measured", "angle", "pressure", "wall", "processor")}
    bounded, held = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    begun = perf_counter()
    for k in range(n):
        columns["angle"][k] = bend(inside)
        seen = columns["angle"][max(k - plant.delay, 0)] + plant.noise * rng.standard_normal()
        due = begun + k * dt
        while real_time and (left := due - perf_counter()) > 0.0:
            sleep(left)
        started, worked = due if real_time else perf_counter(), process_time()
        decided = controller.tick(float(wanted[k]), float(seen))
        columns["wall"][k], columns["processor"][k] = perf_counter() - started, process_time() - worked
        columns["measured"][k], columns["pressure"][k] = seen, decided.pressure
        bounded[k], held[k] = decided.bounded, decided.held
        inside += follow * (decided.pressure - inside)
    time = np.asarray(dt * np.arange(n), dtype=np.float64)
    return Closed(
        time, np.asarray(wanted), **columns, bounded=bounded, held=held, rate=rate, real_time=real_time
    )
