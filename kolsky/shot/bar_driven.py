"""A shot whose bars are its only instruments: bar waves drive the simulation, and the force identifies."""

import numpy as np

from kolsky.bars.flyer.front_path import BarForce, back_force, front_path, front_velocity
from kolsky.bars.records import FaceWaves, Reduction
from kolsky.bars.reduction.analyse import analyse
from kolsky.base.apparatus import Bar
from kolsky.base.errors import InputError
from kolsky.base.records import CentreLine
from kolsky.schema.shot_file import BarDrivenShotFile, Source, parsed
from kolsky.shot.bars import load_waves
from kolsky.shot.curve import shot_fields
from kolsky.shot.plausibility import with_warnings
from kolsky.shot.records import Shot, ShotBase, fields_of

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
    return Shot(**fields_of(base), flyer=motion, centre_line=centre_line, window=(path.start, last))


def load_bar_driven(source: Source) -> Shot:
    """Reduce the gauges of a shot and make it ready for `identify`.

    ``source``: the shot's folder with its shot.toml, the path of such a file, or the file parsed. Returns:
    without a centre line: the force alone identifies. Raises InputError if a file is missing or damaged, a
    declaration is impossible, or the signals hold no such test.
    """
    file = parsed(source)
    declared = file.validated(BarDrivenShotFile)
    given = load_waves(file)
    if declared.window.start is not None:
        raise file.error(
            "window.start",
            "has no effect where bar waves drive the test: it begins with their arrival",
            cure="remove it",
        )
    try:
        result = analyse(given)
        fields = shot_fields(file, declared)
        fields["inputs"] = {**given.inputs, **fields["inputs"]}
        base = ShotBase(
            **fields,
            support="bar",
            transmission_bar=Bar(**vars(given.bars["transmission"])),
            force=bar_force(result.reduction, result.faces),
        )
        shot = driven_by_waves(base, result.reduction, result.faces, end=declared.window.end)
    except ValueError as error:
        raise InputError(
            file.path.parent, str(error), cure="correct the gauge or bar that it names in shot.toml"
        ) from error
    return with_warnings(shot)
