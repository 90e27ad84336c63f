"""A recorded sequence of time steps, and how the recorded histories follow from the forces of the steps."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from explicit.arrays import FloatArray


@dataclass(frozen=True)
class StepSequence:
    """The steps that a forward run took; a gradient holds them fixed."""

    start: float
    """Time at which the specimen is at rest [s]."""
    dt: FloatArray
    """Steps [s], shape [n_steps]."""

    def __len__(self) -> int:
        return len(self.dt)

    @cached_property
    def time(self) -> FloatArray:
        """Beginning of each step [s], shape [n_steps]."""
        return np.cumsum(np.concatenate([[self.start], self.dt]))[:-1]

    @cached_property
    def before(self) -> FloatArray:
        """The step before each one, 0 before the first [s], shape [n_steps]."""
        return np.concatenate([[0.0], self.dt[:-1]])

    @cached_property
    def interval(self) -> FloatArray:
        """Time between the velocities, (dt_before + dt) / 2 [s], shape [n_steps]."""
        return 0.5 * (self.before + self.dt)


@dataclass(frozen=True)
class ForceSampling:
    """The linear map from the forces of the steps to force and impulse at the requested times.

    The same interpolation as the time loop's: a force is linear between two steps, and an impulse grows
    with the force of the step around it.
    """

    steps: StepSequence
    """The steps."""
    times: FloatArray
    """Requested times [s], shape [n_times]."""

    @cached_property
    def _step(self) -> NDArray[np.intp]:
        """The first step that does not begin before each requested time."""
        return np.searchsorted(self.steps.time, self.times, side="left")

    @cached_property
    def _blend(self) -> FloatArray:
        before = self.steps.before[self._step]
        since = self.times - (self.steps.time[self._step] - before)
        return np.divide(since, before, out=np.ones_like(since), where=before > 0.0)

    @cached_property
    def _since(self) -> FloatArray:
        """Time from where the impulse is known to the requested time [s]."""
        return self.times - (self.steps.time[self._step] - 0.5 * self.steps.before[self._step])

    def force(self, of_steps: FloatArray) -> FloatArray:
        """Force at the requested times [N] from those of the steps."""
        known = np.concatenate([[0.0], of_steps])  # no force before the first step
        before, now = known[self._step], known[self._step + 1]
        return before + self._blend * (now - before)

    def impulse(self, of_steps: FloatArray) -> FloatArray:
        """Impulse at the requested times [N s] from the forces of the steps."""
        known = np.concatenate([[0.0], of_steps])
        sums = np.concatenate([[0.0], np.cumsum(of_steps * self.steps.interval)])
        return sums[self._step] + self._since * known[self._step + (self._since >= 0.0)]

    def transposed(self, force: FloatArray, impulse: FloatArray) -> FloatArray:
        """Cotangent of the forces of the steps from those of `force` and `impulse`, shape [n_steps]."""
        n = len(self.steps)
        known, ends = np.zeros(n + 1), np.zeros(n + 1)
        np.add.at(known, self._step, (1.0 - self._blend) * force)
        np.add.at(known, self._step + 1, self._blend * force)
        np.add.at(known, self._step + (self._since >= 0.0), self._since * impulse)
        np.add.at(ends, self._step, impulse)
        later = np.cumsum(ends[::-1])[::-1][1:]  # an impulse sums the steps before its own
        return known[1:] + later * self.steps.interval
