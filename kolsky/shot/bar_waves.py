"""A shot whose front face is driven by bar waves: a classical record made ready for the inverse method."""

from dataclasses import fields
from typing import Any

import numpy as np

from kolsky.bars.flyer.front_path import BarForce, back_force, front_path, front_velocity
from kolsky.bars.records import FaceWaves, Reduction
from kolsky.base.records import CentreLine
from kolsky.shot.records import Shot, ShotBase

REACH = 0.9
"""Largest approach of the faces over the specimen's length that is simulated [-]."""


def bar_force(reduction: Reduction, waves: FaceWaves) -> BarForce:
    """The transmitted force of a reduction as a shot's force."""
    measured, scale = back_force(reduction, waves)
    return BarForce(measured, scale)


def driven_by_waves(
    base: ShotBase,
    reduction: Reduction,
    waves: FaceWaves,
    *,
    sigma_zero: float = 0.0,
    centre_line: CentreLine | None = None,
    end: float | None = None,
) -> Shot:
    """The shot whose front face moves with ``c0 (eps_i - eps_r)`` instead of with a flyer that cameras saw.

    Everything is on the shot's clock, also where the transmitted force is a transducer's (`base.force`).

    Parameters
    ----------
    base
        The test apart from its motion. Its support should be the bar: the back face moves as well.
    reduction, waves
        The reduced record, and the waves that it was made from.
    sigma_zero
        Standard uncertainty of the zero of the face's velocity [m/s].
    centre_line
        The specimen's outline, where there is one; without it the force alone identifies.
    end
        Last time that is simulated and compared, on the shot's clock [s], e.g. where the waves begin to
        overlap; the end of the reduction if left out.

    Raises
    ------
    ValueError
        If the end is outside the reduction, the face's velocity cannot be used, or the face moves away from
        the specimen or through it.
    """
    motion = front_velocity(reduction, waves, sigma_zero=sigma_zero)
    path = front_path(motion)
    last = path.end if end is None else end
    first = float(motion.time[0])
    if not first < last <= path.end:
        raise ValueError(
            f"the end is {last:.9g} s, must be after the wave's arrival at {first:.9g} s and not after the"
            f" reduction's last time {path.end:.9g} s"
        )
    times = motion.time[motion.time <= last]
    reached, length = path.position(times), base.specimen.length
    if base.support == "bar":
        step = float(times[1] - times[0])
        back = reduction.back_velocity.value[: times.size]
        reached = reached - step * (np.cumsum(back) - 0.5 * (back + back[0]))
    if not (reached.max() > 0.0 and reached[-1] > 0.0):
        raise ValueError(
            f"the front face moves away from the specimen, by {-reached[-1] * 1e3:.4g} mm: check the signs"
            " of the gauges, compression is positive"
        )
    if reached.max() > REACH * length:
        raise ValueError(
            f"the faces approach by {reached.max() * 1e3:.4g} mm, allowed are {REACH:g} of the specimen's"
            f" length of {length * 1e3:.4g} mm: end the window earlier, or check the gauge factors"
        )
    declared: dict[str, Any] = {field.name: getattr(base, field.name) for field in fields(ShotBase)}
    return Shot(**declared, flyer=motion, centre_line=centre_line, window=(path.start, last))
