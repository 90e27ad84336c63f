"""The prescribed motion of the flyer's platen."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from explicit.arrays import FloatArray


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

    @cached_property
    def cubics(self) -> FloatArray:
        """Coefficients of the position's cubic in the share of an interval that has passed, constant first
        [m], shape [n_knots, 4]; the last row is the straight line past the last knot."""
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
