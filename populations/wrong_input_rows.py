"""Rows of the study of wrong inputs: the error in a correct shot, and the cause that describes it."""

import math
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from kolsky.bars.signals.transducers import low_pass
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion, MaterialCurve
from kolsky.shot.corrections import changed_curve
from kolsky.shot.inputs import CURVE_SCALE, DAMPING, DENSITY, POISSON, SENSITIVITY
from kolsky.shot.load import load_shot
from kolsky.shot.records import ForceChannel, Shot

Wrong = Callable[[Path], Shot]
"""Function of a shot's folder that returns the shot with a wrong input."""
RIGHT, CURVE, VOLTAGE = "right", "curve -5 %", "time column as voltage"
MODEL = ("stiffness_factor",)
"""Free parameters if Poisson's ratio and damping are fixed."""


@dataclass(frozen=True)
class Row:
    """One wrong input."""

    name: str
    """Description of the wrong input."""
    key: str
    """Key of the correct cause in `kolsky.shot.input_records.Cause`. Empty if there is none."""
    wrong: Wrong
    """Function that makes the shot with this input."""
    free: bool = False
    """True if Poisson's ratio and damping are identified (the default), False if they are fixed."""
    names: tuple[str, ...] = ()
    """Other keys that are equally correct: density, stress and force have the same scale."""


def _changed(change: Callable[[Shot], Shot]) -> Wrong:
    return lambda folder: change(load_shot(folder))


def _gain(factor: float) -> Wrong:
    """Shot with a declared sensitivity of `factor` times the true one."""
    return _changed(lambda shot: _scaled(shot, factor))


def _scaled(shot: Shot, factor: float) -> Shot:
    assert isinstance(shot.force, ForceChannel)
    transducer = shot.force.transducer
    wrong = replace(transducer, sensitivity=factor * transducer.sensitivity)
    return replace(shot, force=replace(shot.force, transducer=wrong))


def _damping(factor: float) -> Wrong:
    return _changed(lambda s: replace(s, model=replace(s.model, damping=factor * s.model.damping)))


def _poisson(excess: float) -> Wrong:
    """Shot with 1 - 2 nu multiplied by `excess`. 0.499 declared as 0.495 is 5; declared as 0.4999 it is
    0.1."""

    def change(shot: Shot) -> Shot:
        wrong = min(0.5 - excess * (0.5 - shot.model.poisson), 0.4999)
        return replace(shot, model=replace(shot.model, poisson=wrong))

    return _changed(change)


def _late(lag: float) -> Wrong:
    return _changed(lambda shot: _moved_clock(shot, lag))


def _moved_clock(shot: Shot, lag: float) -> Shot:
    assert isinstance(shot.flyer, FlyerMotion)
    end = min(shot.window[1], float(shot.flyer.time[-1]))
    late = replace(shot.flyer, time=shot.flyer.time + lag)
    return replace(shot, flyer=late, window=(shot.window[0], end))


def _late_force(lag: float) -> Wrong:
    return _changed(lambda shot: _late_clock(shot, lag))


def _late_clock(shot: Shot, lag: float) -> Shot:
    assert isinstance(shot.force, ForceChannel)
    return replace(shot, force=replace(shot.force, clock_offset=shot.force.clock_offset + lag))


def _late_outline(lag: float) -> Wrong:
    def change(shot: Shot) -> Shot:
        line = shot.centre_line
        assert line is not None
        return replace(shot, centre_line=replace(line, time=line.time + lag))

    return _changed(change)


def _specimen(name: str, factor: float) -> Wrong:
    """Shot with a size or density multiplied by `factor`; `check` reads the same value."""

    def wrong(folder: Path) -> Shot:
        content = tomllib.loads((folder / "shot.toml").read_text("utf-8"))
        number, _, unit = content["specimen"][name].partition(" ")
        return _edited(folder, "specimen", name, f'{name} = "{factor * float(number):.9g} {unit}"')

    return wrong


def _curve(factor: float) -> Wrong:
    return _changed(lambda s: replace(s, curve=replace(s.curve, stress=factor * s.curve.stress)))


def _outline(name: str, offset: float) -> Wrong:
    return _changed(lambda shot: _placed(shot, name, offset))


def _placed(shot: Shot, name: str, offset: float) -> Shot:
    line = shot.centre_line
    assert line is not None
    return replace(shot, centre_line=replace(line, **{name: getattr(line, name) + offset}))


def _motion(factor: float) -> Wrong:
    def change(shot: Shot) -> Shot:
        assert isinstance(shot.flyer, FlyerMotion)
        return replace(shot, flyer=replace(shot.flyer, displacement=factor * shot.flyer.displacement))

    return _changed(change)


def _zero(shot: Shot) -> Shot:
    """Shot with a force offset of 5 % of the largest force from the beginning of the test."""
    assert isinstance(shot.force, ForceChannel)
    recording, time = shot.force.recording, shot.force.time
    volts = recording.value - shot.force.baseline_volts().mean()
    step = 0.05 * float(np.abs(volts).max()) * (time > shot.force.baseline[1])
    return replace(
        shot, force=replace(shot.force, recording=replace(recording, value=recording.value + step))
    )


def _form(name: str, amount: float) -> Wrong:
    """Shot whose curve needs the correction `name` of `kolsky.shot.corrections`, because a column has another
    definition."""
    return _changed(lambda s: replace(s, curve=wrong_curve(s.curve, name, amount)))


def wrong_curve(curve: MaterialCurve, name: str, amount: float) -> MaterialCurve:
    """A curve that a correction by `amount` makes correct."""
    stretch, stress = curve.stretch, curve.stress
    if name == "true stress":
        return replace(curve, stress=stress * stretch**amount, law=None)
    return changed_curve(curve, {name: amount})


def _film(factor: float) -> Wrong:
    """Shot with frame times multiplied by `factor`."""

    def change(shot: Shot) -> Shot:
        line, motion = shot.centre_line, shot.flyer
        assert line is not None
        assert isinstance(motion, FlyerMotion)
        motion = replace(motion, time=factor * motion.time)
        end = min(shot.window[1], float(motion.time[-1]))
        late = replace(line, time=factor * line.time)
        return replace(shot, flyer=motion, centre_line=late, window=(shot.window[0], end))

    return _changed(change)


def _pictures(factor: float) -> Wrong:
    """Shot with lengths in the pictures multiplied by `factor`."""

    def change(shot: Shot) -> Shot:
        line, motion = shot.centre_line, shot.flyer
        assert line is not None
        assert isinstance(motion, FlyerMotion)
        return replace(
            shot,
            flyer=replace(motion, displacement=factor * motion.displacement),
            centre_line=replace(line, y=factor * line.y, Z=factor * line.Z),
        )

    return _changed(change)


def _mirrored(shot: Shot) -> Shot:
    line = shot.centre_line
    assert line is not None
    return replace(shot, centre_line=replace(line, y=shot.specimen.length - line.y))


def _recorded(change: Callable[[FloatArray, float], FloatArray]) -> Wrong:
    """Shot whose transducer signal is changed by a function of samples and time step."""

    def changed(shot: Shot) -> Shot:
        assert isinstance(shot.force, ForceChannel)
        recording = shot.force.recording
        zero, step = shot.force.baseline_volts().mean(), float(np.diff(recording.time).mean())
        volts = zero + change(recording.value - zero, step)
        return replace(shot, force=replace(shot.force, recording=replace(recording, value=volts)))

    return _changed(changed)


def _other_channel(folder: Path) -> Shot:
    """Shot with the flyer's transducer declared as the one behind the specimen."""
    return _edited(folder, "force", "voltage", 'voltage = { column = "CH1 incident (V)", unit = "V" }')


def _droop(volts: FloatArray, step: float) -> FloatArray:
    """Signal of a charge with a leakage time constant of 3 ms."""
    return np.asarray(volts - low_pass(volts, step, 1.0 / (2.0 * np.pi * 3e-3)))


def _voltage(folder: Path) -> Shot:
    """Shot with the recorder's time column declared as the voltage."""
    return _edited(folder, "force", "voltage", 'voltage = { column = "Time (s)", unit = "V" }')


def _edited(folder: Path, table: str, key: str, line: str) -> Shot:
    """The shot with a changed line of its shot file."""
    lines = (folder / "shot.toml").read_text("utf-8").splitlines()
    at = lines.index(f"[{table}]")
    for i in range(at + 1, len(lines)):
        if lines[i].startswith(f"{key} ="):
            lines[i] = line
            break
    return _with_file(folder, "shot.toml", "\n".join(lines))


def _with_file(folder: Path, name: str, text: str) -> Shot:
    """The shot with a different text in one of its files."""
    with TemporaryDirectory() as place:
        for file in folder.iterdir():
            if file.is_file() and file.name != name:
                (Path(place) / file.name).symlink_to(file.resolve())
        (Path(place) / name).write_text(text, "utf-8")
        return load_shot(Path(place))


def _true_strain(folder: Path) -> Shot:
    """Shot whose curve file contains logarithmic strain. The reader may reject strains beyond the full
    length."""
    name = "quasi_static.csv"
    head, *rows = (folder / name).read_text("utf-8").splitlines()
    pairs = [row.split(",", 1) for row in rows]
    logarithmic = [f"{math.log1p(float(strain))!r},{stress}" for strain, stress in pairs]
    return _with_file(folder, name, "\n".join([head, *logarithmic]))


CURVES = ("curve.stress", "curve.strain", "curve shape")
"""Keys of the shape of a curve. A wrong definition also changes the shape."""

ROWS: tuple[Row, ...] = (
    Row(RIGHT, "", load_shot, free=True),
    Row("sensitivity x 1/2", SENSITIVITY, _gain(0.5), free=True, names=(DENSITY,)),
    Row("sensitivity x 2", SENSITIVITY, _gain(2.0), free=True, names=(DENSITY,)),
    Row("force x 10", SENSITIVITY, _gain(0.1), free=True, names=(DENSITY,)),
    Row("beta = 0, held", DAMPING, _damping(0.0)),
    Row("beta x 4, held", DAMPING, _damping(4.0)),
    Row("1 - 2 nu x 1/10, held", POISSON, _poisson(0.1)),
    Row("1 - 2 nu x 5, held", POISSON, _poisson(5.0)),
    Row("flyer 20 us late", "flyer.time", _late(20e-6), free=True),
    Row("force 20 us late", "force.clock_offset", _late_force(20e-6), free=True),
    Row("outline 20 us late", "centre_line.time", _late_outline(20e-6), free=True),
    Row("outline 20 us early", "centre_line.time", _late_outline(-20e-6), free=True),
    Row("length -1.5 %", "specimen.length", _specimen("length", 0.985), free=True),
    Row("length x 2", "specimen.length", _specimen("length", 2.0), free=True),
    Row("diameter -2 %", "specimen.diameter", _specimen("diameter", 0.98), free=True),
    Row("diameter x 1/2", "specimen.diameter", _specimen("diameter", 0.5), free=True),
    Row("density x 1/2", DENSITY, _specimen("density", 0.5), free=True, names=(SENSITIVITY,)),
    Row("density x 2", DENSITY, _specimen("density", 2.0), free=True, names=(SENSITIVITY,)),
    Row("density -10 %", DENSITY, _specimen("density", 0.9), free=True, names=(SENSITIVITY,)),
    Row("y + 100 um", "centre_line.y_offset", _outline("y", 1e-4), free=True),
    Row("Z + 20 um", "centre_line.Z_offset", _outline("Z", 2e-5), free=True),
    Row("y from the other end", "centre_line.y", _changed(_mirrored), free=True),
    Row("pictures x 1.02", "pictures.scale", _pictures(1.02), free=True),
    Row("flyer x 1.03", "flyer.displacement", _motion(1.03), free=True),
    Row("frames x 1.0084", "frames.time", _film(1.0084), free=True),
    Row("frames x 0.97", "frames.time", _film(0.97), free=True),
    Row("amplifier of 2 kHz", "force.bandwidth", _recorded(lambda v, h: low_pass(v, h, 2e3)), free=True),
    Row("charge leaks in 3 ms", "force.time_constant", _recorded(_droop), free=True),
    Row("baseline off by 5 %", "force.baseline", _changed(_zero), free=True),
    Row("other bar's channel", "force.voltage", _other_channel, free=True),
    Row(VOLTAGE, "", _voltage, free=True),
    Row(CURVE, "", _curve(0.95), free=True),
    Row("curve x 4", CURVE_SCALE, _curve(4.0), free=True),
    Row("curve of true stress", "curve.stress", _form("true stress", 1.0), free=True, names=CURVES),
    Row("curve of true strain", "curve.strain", _true_strain, free=True, names=CURVES),
    Row("curve + 25 % curvature", "curve shape", _form("tilt", 0.25), free=True, names=CURVES),
    Row("curve of the other branch", "curve.branch", _form("branch", 1.0), free=True, names=CURVES),
    Row(
        "sensitivity x 1/2, flyer 20 us late",
        SENSITIVITY,
        _changed(lambda s: _moved_clock(_scaled(s, 0.5), 20e-6)),
        free=True,
        names=("flyer.time", DENSITY),
    ),
    Row(
        "Z + 40 um, force 20 us late",
        "centre_line.Z_offset",
        _changed(lambda s: _late_clock(_placed(s, "Z", 4e-5), 20e-6)),
        free=True,
        names=("force.clock_offset",),
    ),
)
"""Every row of the study, in the order of its table."""
