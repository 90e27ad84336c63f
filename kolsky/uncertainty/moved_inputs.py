"""Changes of the data vector by inputs that need no run of their own.

Scales, clocks and offsets, and what of the outline goes with the specimen's size.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from explicit import Response
from kolsky.bars.signals.transducers import ForceBins
from kolsky.base.arrays import FloatArray
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Observations, predict
from kolsky.shot.records import Shot
from kolsky.uncertainty.inputs import CLOCK


def outline_follows(change: FloatArray, step: float, diameter: float, n_force: int) -> FloatArray:
    """Change of prediction minus data by a larger diameter, where the outline's axis was placed by it.

    An axis that lies the declared radius behind the surface at rest moves back with it, and every measured Z
    grows by as much: the model's outline and the measured one grow alike, and what is left is their strain.

    Parameters
    ----------
    change
        Change of the prediction alone, shape [k].
    step
        By how much the diameter is larger, relative to it.
    diameter
        The declared one [m].
    n_force
        Entries of the force at the head of the data vector.
    """
    found = change.copy()
    found[n_force:] -= 0.5 * step * diameter
    return found


def height_follows(shot: Shot, step: float) -> float:
    """By how much the outline's heights are too large where the length is too large by a share of it [m].

    Where the pictures have a part in the length, errors of length and heights go together
    (`kolsky.shot.length_by_pictures`): what of the heights' error goes with the length's is in the direction
    of the length, what is left in that of the heights, and both are independent.

    Parameters
    ----------
    shot
        The shot.
    step
        By how much its length is larger, relative to it.
    """
    found = shot.length_by_pictures
    return 0.0 if found is None else found.y_per_length * step * shot.specimen.length


@dataclass(frozen=True)
class MovedInputs:
    """Changes of the data vector by inputs that need no run of their own.

    A scale and a clock act on the data, but are taken through the model's force and outline, which have no
    noise and ring in the mesh as the Jacobian does.
    """

    objective: Objective
    """The objective."""
    observations: Observations
    """What was measured."""
    reference: Response
    """The run at the optimum, its surface `CLOCK` before and after each frame among its times."""

    def change(self, key: str, step: float) -> FloatArray:
        """Change of prediction minus data when the input is larger by a step, shape [k]."""
        n, change = self.objective.n_force, np.zeros(len(self.objective.data))
        own = len(self.observations.bins.mean)  # of the transmitted force alone
        match key:
            case "sensitivity":  # a larger sensitivity is a smaller force
                change[:own] = step * self._seen()[:own]
            case "force_zero":  # what is taken for zero is subtracted
                change[:own] = step
            case "clock_offset":
                change[:n] = step * self.force_rate()
            case "outline_clock":
                change[n:] = step * self.outline_rate()
            case "flyer_clock":  # all that is simulated comes later
                change[:n], change[n:] = -step * self.force_rate(), -step * self.outline_rate()
            case "Z_offset":
                change[n:] = -step
            case "y_offset":
                y = self.observations.centre_line.y
                change = 0.5 * (self._seen(y=y + step) - self._seen(y=y - step))
            case _:
                raise KeyError(f"{key} needs a run")
        return change

    def heights_with_length(self, shot: Shot, step: float) -> FloatArray:
        """Change of prediction minus data by the outline's heights that go with a longer specimen
        (`height_follows`), shape [k]; zero without an outline."""
        heights = height_follows(shot, step)
        if heights == 0.0 or not self.objective.counted.any():
            return np.zeros(len(self.objective.data))
        return self.change("y_offset", heights)

    def force_rate(self) -> FloatArray:
        """Time derivative of each bin's force, of the model, which has no noise [N/s], shape [n_bins]."""

        def rate(bins: ForceBins, which: str) -> FloatArray:
            run = self.reference
            force = run.force_transmission if which == "transmission" else run.force_flyer
            at = np.interp(bins.edges, run.force_times, force[0])
            return np.asarray(np.diff(at) / np.diff(bins.edges))

        return self.observations.of_forces(rate)

    def outline_rate(self) -> FloatArray:
        """Time derivative of the radius at each counted point's height [m/s], shape [n_counted]."""
        time = self.observations.centre_line.time
        before, after = beside(time, self.reference)
        up, down = self._seen(time=after), self._seen(time=before)
        return np.asarray((up - down)[self.objective.n_force :] / (after - before)[self.objective.counted])

    def _seen(self, y: FloatArray | None = None, time: FloatArray | None = None) -> FloatArray:
        """The predicted data vector with the outline seen at other heights or times."""
        line = self.observations.centre_line
        line = replace(line, y=line.y if y is None else y, time=line.time if time is None else time)
        seen = replace(self.observations, centre_line=line)
        return np.asarray(self.objective.vectors(predict(self.reference, seen))[0])


def beside(time: FloatArray, response: Response) -> tuple[FloatArray, FloatArray]:
    """Times `CLOCK` before and after; at the ends of what was simulated the time itself [s]."""
    first, last = response.surface_times[0], response.surface_times[-1]
    return np.maximum(time - CLOCK, first), np.minimum(time + CLOCK, last)
