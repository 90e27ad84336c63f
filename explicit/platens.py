"""Motion of the platens: that of the flyer is prescribed; the transmission platen has a support.

A support is rigid, a bar by its characteristics, or any prescribed motion. The bar is one-dimensional and
elastic. At its front the velocity away from the specimen is v = g + h and the compressive force F = Z (g -
h). g travels away and h returns. The far end is free, so h(t) = g(t - 2 L / c). The front's velocity is v = F
/ Z + 2 h. It needs no elements and does not limit the time step. F is available one step late. The solver
solves for v together with the mass of the nodes on the platen. This is stable for a bar of any impedance.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np

from explicit.arrays import FloatArray


@dataclass(frozen=True)
class PlatenMotion:
    """Displacement of the flyer's platen toward the specimen, tabulated with its velocity.

    Between the knots position and velocity belong to one cubic, so they are consistent. The solver moves the
    platen by the *difference of positions* over a step, so no drift accumulates. After the last knot the
    platen keeps its last velocity. The solver exceeds the last requested time by less than one time step.
    """

    start: float
    """Time of the first knot, at which the specimen is at rest [s]."""
    step: float
    """Distance of the knots [s]."""
    position: FloatArray
    """Displacement toward the specimen [m], shape [n_knots]; zero at the first knot."""
    velocity: FloatArray
    """Its time derivative [m/s], shape [n_knots]."""

    def __post_init__(self) -> None:
        if len(self.position) != len(self.velocity) or len(self.position) < 2:
            raise ValueError("a motion needs as many velocities as positions, at least 2")
        if not self.step > 0.0:
            raise ValueError(f"step must be > 0 s, got {self.step}")
        if not (np.isfinite(self.position).all() and np.isfinite(self.velocity).all()):
            raise ValueError("a motion must be finite everywhere")
        if self.position[0] != 0.0:
            raise ValueError(f"a motion starts at displacement 0, got {self.position[0]} m")

    @property
    def end(self) -> float:
        """Time of the last knot [s]."""
        return self.start + self.step * (len(self.position) - 1)

    @cached_property
    def cubics(self) -> FloatArray:
        """Coefficients of the position as a cubic of the relative time in an interval, constant first [m],
        shape [n_knots, 4]. The last row is the straight line after the last knot."""
        f, d = self.position, self.velocity * self.step
        rise = np.append(np.diff(f), d[-1])
        following = np.append(d[1:], d[-1])
        return np.column_stack([f, d, 3 * rise - 2 * d - following, d + following - 2 * rise])

    @classmethod
    def sampled(
        cls,
        position: Callable[[FloatArray], FloatArray],
        velocity: Callable[[FloatArray], FloatArray],
        *,
        start: float,
        end: float,
        n_knots: int = 1025,
    ) -> "PlatenMotion":
        """Tabulate a motion given as two functions of time."""
        times = np.linspace(start, end, n_knots)
        x = np.asarray(position(times), dtype=float)
        return cls(
            start=start,
            step=(end - start) / (n_knots - 1),
            position=x - x[0],
            velocity=np.asarray(velocity(times), dtype=float),
        )

    def __call__(self, time: FloatArray) -> FloatArray:
        """Displacement at any time from the start on [m]: NumPy twin of the kernel's evaluation."""
        place = (np.asarray(time) - self.start) / self.step
        k = np.clip(place.astype(int), 0, len(self.position) - 1)
        f, d, a, c = np.moveaxis(self.cubics[k], -1, 0)
        x = place - k
        return f + x * (d + x * (a + x * c))


@dataclass(frozen=True)
class CharacteristicBar:
    """A uniform bar with a free far end."""

    impedance: float
    """Force per velocity Z = rho c A [N s/m]; infinity: a rigid support."""
    round_trip: float
    """Time of a wave to the far end and back [s]; infinity: an infinitely long bar."""

    def __post_init__(self) -> None:
        if not self.impedance > 0.0:
            raise ValueError(f"impedance must be > 0 N s/m, got {self.impedance}")
        if not self.round_trip > 0.0:
            raise ValueError(f"round_trip must be > 0 s, got {self.round_trip}")


@dataclass(frozen=True)
class MovingSupport:
    """A support whose motion is prescribed, one for all samples or one for each.

    It is used in a partitioned coupling: a model of the parts behind the specimen computes this motion from a
    force (`explicit.bars.coupling`).
    """

    motions: tuple[PlatenMotion, ...]
    """Motion of the transmission platen, displacement toward the specimen positive; length 1 or n_samples.
    Start and number of knots are those of the flyer's motions."""

    def __post_init__(self) -> None:
        if not self.motions:
            raise ValueError("a moving support needs a motion for all samples or one for each, got none")


Support = CharacteristicBar | MovingSupport

RIGID = CharacteristicBar(impedance=inf, round_trip=inf)
"""A support that does not move."""
