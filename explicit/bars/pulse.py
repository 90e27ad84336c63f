"""Elastic parts as a linear system: motion and force by convolution with what one pulse of force does.

The parts strain by 1e-6, so that what they do is linear in the force on their face and the same at any time.
One run under a pulse, a hat of one newton over two steps, is therefore all runs: the force of a simulation,
linear between the steps, is a sum of such pulses. A batch costs a convolution in place of a march in time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from explicit.arrays import FloatArray
from explicit.bars.elastic import elastic_bar
from explicit.bars.lines import loaded_line
from explicit.bars.sections import Section

FINEST = 1e-7
"""Longest time step of the one-dimensional waves under a pulse [s]; travel times are rounded to one between
this and a quarter of it, the one that fits them best."""


@dataclass(frozen=True)
class PulseResponse:
    """What elastic parts at rest do when a pulse of 1 N presses on their face.

    The pulse rises from 0 at time 0 to 1 N after a step and falls to 0 after two.
    """

    step: float
    """Distance of the times, the first at 0 [s]."""
    path: FloatArray
    """Displacement of the face, into the parts [m/N], shape [n]."""
    seen: FloatArray
    """The same of the place that a camera sees [m/N], shape [n]."""
    section: FloatArray
    """Compressive force through the section of the transducer [1], shape [n]."""

    def histories(self, impulse: FloatArray, kind: str) -> FloatArray:
        """Histories under forces that act from rest, shape of `impulse`.

        Parameters
        ----------
        impulse
            Impulse of the force on the face at the steps, 0 at the first [N s], shape [n_samples, n]; from a
            NaN on nothing presses any more.
        kind
            "path", "seen" or "section".

        Raises
        ------
        ValueError
            If there are more steps than the response has.
        """
        n = impulse.shape[1]
        table = getattr(self, kind)
        if n > len(table):
            raise ValueError(f"{n} steps are asked for, the pulse's response has {len(table)}")
        from scipy.signal import fftconvolve  # of use with bars only

        return np.asarray(fftconvolve(mean_about(impulse, self.step), table[None, :], axes=1)[:, 1 : n + 1])


def mean_about(impulse: FloatArray, step: float) -> FloatArray:
    """Mean force over a step about every step but the first, where it is 0 [N], shape of `impulse`.

    The sum of the pulses has the impulse of the force.
    """
    finite = np.isfinite(impulse)
    last = impulse.shape[1] - 1 - np.argmax(finite[:, ::-1], axis=1)
    whole = np.where(finite, impulse, np.take_along_axis(impulse, last[:, None], axis=1))
    halves = 0.5 * (whole[:, 1:] + whole[:, :-1])
    ends = np.concatenate([whole[:, :1], halves, whole[:, -1:]], axis=1)
    force = np.diff(ends, axis=1) / step
    force[:, 1] += force[:, 0]  # the first half step's impulse
    force[:, 0] = 0.0
    force[:, -1] *= 2.0  # the last half step's mean
    return np.asarray(force)


def pulse_on_bars(
    sections: Sequence[Section], *, step: float, n: int, sensor: float = 0.0, seen: float = 0.0
) -> PulseResponse:
    """The response of one-dimensional bars, free at their far end.

    Parameters
    ----------
    sections
        Bars bonded one behind the other, the loaded one first.
    step
        Distance of the times [s].
    n
        Number of times.
    sensor, seen
        Distance of the transducer's section and of the place that is seen from the loaded face [m].

    Raises
    ------
    ValueError
        If a distance is outside the bars, or a section is shorter than half a wave's way in a time step.
    """
    least = max(2, int(np.ceil(step / FINEST)))
    travel = np.array([section.travel_time for section in sections])
    counts = np.arange(least, 4 * least + 1)
    delays = travel * counts[:, None] / step
    parts = int(counts[np.argmin(np.abs(np.round(delays) / delays - 1.0).max(axis=1))])
    fine = step / parts
    force = np.interp(fine * np.arange(parts * n + 1), step * np.arange(3), [0.0, 1.0, 0.0])
    line = loaded_line(sections, force, step=fine)

    def path(depth: float) -> FloatArray:
        velocity = line.velocity(depth)
        summed = np.cumsum(0.5 * fine * (velocity[1:] + velocity[:-1]))
        return np.concatenate([[0.0], summed])[::parts][:n]

    return PulseResponse(step, path(0.0), path(seen), line.force(sensor)[::parts][:n])


def pulse_on_mesh(
    sections: Sequence[Section],
    *,
    step: float,
    n: int,
    size: float,
    radius: float,
    sensor: float = 0.0,
    seen: float = 0.0,
) -> PulseResponse:
    """The response of elastic parts as an axisymmetric mesh.

    Parameters
    ----------
    sections, step, n, sensor, seen
        As of `pulse_on_bars`; `seen` lies on the outer surface. A sensor at 0 is the face itself.
    size
        Largest side of an element [m].
    radius
        Radius within which the force presses on the face, evenly [m].

    Raises
    ------
    ValueError
        If a distance is outside the parts or on their far end, or a size is not positive.
    """
    depths = [] if sensor == 0.0 else [sensor]
    parts = elastic_bar(sections, size=size, depths=depths, marks=[seen])
    end = step * max(n, 3)
    # Whole steps of the march in one of the pulse: its impulse is then exact.
    safety = step / np.ceil(step / (0.9 * parts.stable_step)) / parts.stable_step * (1.0 + 1e-9)
    pulse = np.array([0.0, 1.0, 0.0, 0.0])
    history = parts.integrate(np.array([0.0, step, 2.0 * step, end]), pulse, radius, safety=safety)
    times = step * np.arange(n)

    def at(values: FloatArray) -> FloatArray:
        return np.interp(times, history.times, values)

    section = history.section_force[:, 0] if depths else history.force
    return PulseResponse(step, at(history.path), at(history.seen[:, 0]), at(section))
