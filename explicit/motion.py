"""The prescribed motion of the flyer's platen."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class PlatenMotion:
    """Displacement of the flyer's platen toward the specimen, tabulated with its velocity.

    Between the knots position and velocity belong to one cubic, so they are consistent; the solver
    moves the platen by the *difference of positions* over a step, so no drift accumulates. Past the last
    knot the platen keeps its last velocity; the solver steps past the last requested time by less than
    one time step.
    """

    start: float
    """Time of the first knot: the specimen is at rest then [s]."""
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
        k = np.clip(((time - self.start) / self.step).astype(int), 0, len(self.position) - 2)
        x = (time - self.start) / self.step - k
        f0, f1 = self.position[k], self.position[k + 1]
        d0, d1 = self.velocity[k] * self.step, self.velocity[k + 1] * self.step
        cubic = f0 + x * (d0 + x * (3 * (f1 - f0) - 2 * d0 - d1 + x * (2 * (f0 - f1) + d0 + d1)))
        return np.where(x <= 1.0, cubic, f1 + d1 * (x - 1.0))
