"""Rows of the study of wrong inputs: the error in a correct shot, and the cause that describes it."""

import math
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from kolsky.bars.signals.transducers import low_pass
from kolsky.base.arrays import FloatArray
from kolsky.base.records import MaterialCurve
from kolsky.base.toml import with_values
from kolsky.shot.corrections import (
    changed_curve,
    with_film,
    with_flyer_clock,
    with_force_clock,
    with_gain,
    with_mirrored,
    with_motion,
    with_outline,
    with_pictures,
)
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
    second: tuple[str, ...] = ()
    """Keys of a second wrong input; each is correct. Empty without one."""


@dataclass(frozen=True)
class _Changed:
    """Shot that is correct except for a correction by a value, the reciprocal of its error or minus it."""

    correction: Callable[[Shot, float], Shot]
    value: float

    def __call__(self, folder: Path) -> Shot:
        return self.correction(load_shot(folder), self.value)


def _model(**values: Callable[[float], float]) -> Wrong:
    """Shot with declared constants of the model replaced by functions of them."""

    def wrong(folder: Path) -> Shot:
        shot = load_shot(folder)
        changed: Any = {name: change(getattr(shot.model, name)) for name, change in values.items()}
        return replace(shot, model=replace(shot.model, **changed))

    return wrong


def _poisson(excess: float) -> Wrong:
    """Shot with 1 - 2 nu multiplied by `excess`. 0.499 declared as 0.495 is 5; declared as 0.4999 it is
    0.1."""
    return _model(poisson=lambda poisson: min(0.5 - excess * (0.5 - poisson), 0.4999))


def _specimen(name: str, factor: float) -> Wrong:
    """Shot with a size or density multiplied by `factor`; `check` reads the same value."""

    def wrong(folder: Path) -> Shot:
        content = tomllib.loads((folder / "shot.toml").read_text("utf-8"))
        number, _, unit = content["specimen"][name].partition(" ")
        return _edited(folder, "specimen", name, f'"{factor * float(number):.9g} {unit}"')

    return wrong


def _curve(name: str, amount: float) -> Wrong:
    """Shot whose curve needs the correction `name` of `kolsky.shot.corrections`, because a column has another
    definition."""

    def wrong(folder: Path) -> Shot:
        shot = load_shot(folder)
        return replace(shot, curve=wrong_curve(shot.curve, name, amount))

    return wrong


def wrong_curve(curve: MaterialCurve, name: str, amount: float) -> MaterialCurve:
    """A curve that a correction by `amount` makes correct. Factors do not change the declared sigma."""
    if name in ("true stress", "scale"):
        factor = 1.0 + amount if name == "scale" else curve.stretch**amount
        return replace(curve, stress=factor * curve.stress, law=None)
    return changed_curve(curve, {name: amount})


def _recorded(change: Callable[[FloatArray, float, ForceChannel], FloatArray]) -> Wrong:
    """Shot whose transducer signal is a function of its samples, its time step and its channel."""

    def wrong(folder: Path) -> Shot:
        shot = load_shot(folder)
        assert isinstance(shot.force, ForceChannel)
        recording = shot.force.recording
        zero, step = shot.force.baseline_volts().mean(), float(np.diff(recording.time).mean())
        volts = zero + change(recording.value - zero, step, shot.force)
        return replace(shot, force=replace(shot.force, recording=replace(recording, value=volts)))

    return wrong


def _droop(volts: FloatArray, step: float, channel: ForceChannel) -> FloatArray:
    """Signal of a charge with a leakage time constant of 3 ms."""
    return np.asarray(volts - low_pass(volts, step, 1.0 / (2.0 * np.pi * 3e-3)))


def _zero(volts: FloatArray, step: float, channel: ForceChannel) -> FloatArray:
    """Signal with an offset of 5 % of the largest force after the baseline."""
    return np.asarray(volts + 0.05 * float(np.abs(volts).max()) * (channel.time > channel.baseline[1]))


def _voltage(column: str) -> Wrong:
    """Shot with another column of the recorder declared as the voltage of the force."""
    return lambda folder: _edited(folder, "force", "voltage", f'{{ column = "{column}", unit = "V" }}')


def _edited(folder: Path, table: str, key: str, value: str) -> Shot:
    """The shot with a changed value in its shot file."""
    text = (folder / "shot.toml").read_text("utf-8")
    return _with_file(folder, "shot.toml", with_values(text, table, {key: value}))


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
    Row("sensitivity x 1/2", SENSITIVITY, _Changed(with_gain, 2.0), free=True, names=(DENSITY,)),
    Row("sensitivity x 2", SENSITIVITY, _Changed(with_gain, 0.5), free=True, names=(DENSITY,)),
    Row("force x 10", SENSITIVITY, _Changed(with_gain, 10.0), free=True, names=(DENSITY,)),
    Row("beta = 0, held", DAMPING, _model(damping=lambda damping: 0.0)),
    Row("beta x 4, held", DAMPING, _model(damping=lambda damping: 4.0 * damping)),
    Row("1 - 2 nu x 1/10, held", POISSON, _poisson(0.1)),
    Row("1 - 2 nu x 5, held", POISSON, _poisson(5.0)),
    Row("flyer 20 us late", "flyer.time", _Changed(with_flyer_clock, -20e-6), free=True),
    Row("force 20 us late", "force.clock_offset", _Changed(with_force_clock, -20e-6), free=True),
    Row("outline 20 us late", "centre_line.time", _Changed(with_outline("time"), 20e-6), free=True),
    Row("outline 20 us early", "centre_line.time", _Changed(with_outline("time"), -20e-6), free=True),
    Row("length -1.5 %", "specimen.length", _specimen("length", 0.985), free=True),
    Row("length x 2", "specimen.length", _specimen("length", 2.0), free=True),
    Row("diameter -2 %", "specimen.diameter", _specimen("diameter", 0.98), free=True),
    Row("diameter x 1/2", "specimen.diameter", _specimen("diameter", 0.5), free=True),
    Row("density x 1/2", DENSITY, _specimen("density", 0.5), free=True, names=(SENSITIVITY,)),
    Row("density x 2", DENSITY, _specimen("density", 2.0), free=True, names=(SENSITIVITY,)),
    Row("density -10 %", DENSITY, _specimen("density", 0.9), free=True, names=(SENSITIVITY,)),
    Row("y + 100 um", "centre_line.y_offset", _Changed(with_outline("y"), 1e-4), free=True),
    Row("Z + 20 um", "centre_line.Z_offset", _Changed(with_outline("Z"), 2e-5), free=True),
    Row("y from the other end", "centre_line.y", _Changed(with_mirrored, 0.0), free=True),
    Row("pictures x 1.02", "pictures.scale", _Changed(with_pictures, 1.02), free=True),
    Row("flyer x 1.03", "flyer.displacement", _Changed(with_motion, 1.03), free=True),
    Row("frames x 1.0084", "frames.time", _Changed(with_film, 1.0084), free=True),
    Row("frames x 0.97", "frames.time", _Changed(with_film, 0.97), free=True),
    Row("amplifier of 2 kHz", "force.bandwidth", _recorded(lambda v, h, _: low_pass(v, h, 2e3)), free=True),
    Row("charge leaks in 3 ms", "force.time_constant", _recorded(_droop), free=True),
    Row("baseline off by 5 %", "force.baseline", _recorded(_zero), free=True),
    Row("other bar's channel", "force.voltage", _voltage("CH1 incident (V)"), free=True),
    Row(VOLTAGE, "", _voltage("Time (s)"), free=True),
    Row(CURVE, "", _curve("scale", -0.05), free=True),
    Row("curve x 4", CURVE_SCALE, _curve("scale", 3.0), free=True),
    Row("curve of true stress", "curve.stress", _curve("true stress", 1.0), free=True, names=CURVES),
    Row("curve of true strain", "curve.strain", _true_strain, free=True, names=CURVES),
    Row("curve + 25 % curvature", "curve shape", _curve("tilt", 0.25), free=True, names=CURVES),
    Row("curve of the other branch", "curve.branch", _curve("branch", 1.0), free=True, names=CURVES),
    Row(
        "sensitivity x 1/2, flyer 20 us late",
        SENSITIVITY,
        _Changed(lambda shot, late: with_flyer_clock(with_gain(shot, 2.0), -late), 20e-6),
        free=True,
        names=("flyer.time", DENSITY),
    ),
    Row(
        "Z + 40 um, force 20 us late",
        "centre_line.Z_offset",
        _Changed(lambda shot, late: with_force_clock(with_outline("Z")(shot, 4e-5), -late), 20e-6),
        free=True,
        names=("force.clock_offset",),
    ),
)
"""Every row of the study, in the order of its table."""


def _pair(first: str, second: str) -> Row:
    """The wrong inputs of two rows in one shot."""
    one, other = (next(row for row in ROWS if row.name == name) for name in (first, second))
    changed = other.wrong
    assert isinstance(changed, _Changed)
    return replace(
        one,
        name=f"{first}; {second}",
        wrong=lambda folder: changed.correction(one.wrong(folder), changed.value),
        second=(other.key, *other.names),
    )


PAIRS = (
    _pair("1 - 2 nu x 5, held", "sensitivity x 1/2"),
    _pair("beta x 4, held", "Z + 20 um"),
    _pair("curve x 4", "force 20 us late"),
    _pair("length -1.5 %", "sensitivity x 1/2"),
    _pair("flyer 20 us late", "sensitivity x 2"),
    _pair("diameter -2 %", "outline 20 us late"),
    _pair("pictures x 1.02", "force 20 us late"),
    _pair("density x 1/2", "flyer x 1.03"),
)
"""Rows with two wrong inputs. They are not in the table of `ROWS`."""
BY_NAME = {row.name: row for row in (*ROWS, *PAIRS)}
"""All rows by their names."""
