"""The rows of the study of wrong inputs: what is wrong, applied to a right shot, and what names it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from kolsky.base.records import FlyerMotion
from kolsky.shot.inputs import DAMPING, DENSITY, POISSON, SENSITIVITY
from kolsky.shot.load import load_shot
from kolsky.shot.records import ForceChannel, Shot

Wrong = Callable[[Path], Shot]
"""A shot's folder -> the shot with an input wrong."""
RIGHT, CURVE, VOLTAGE = "right", "curve -5 %", "time column as voltage"
MODEL = ("stiffness_factor",)
"""Free where Poisson's ratio and damping are held."""


@dataclass(frozen=True)
class Row:
    """One wrong input."""

    name: str
    """What is wrong."""
    key: str
    """The cause that is right, a key of `kolsky.shot.inputs.Cause`; empty if none can be named."""
    wrong: Wrong
    """The shot with it."""
    free: bool = False
    """Whether Poisson's ratio and damping are found from the data, as by default; else held."""
    names: tuple[str, ...] = ()
    """Other keys that are as right: density, stress and force scale alike."""


def _changed(change: Callable[[Shot], Shot]) -> Wrong:
    return lambda folder: change(load_shot(folder))


def _gain(factor: float) -> Wrong:
    """The declared sensitivity is `factor` times the true one."""

    def change(shot: Shot) -> Shot:
        assert isinstance(shot.force, ForceChannel)
        transducer = shot.force.transducer
        wrong = replace(transducer, sensitivity=factor * transducer.sensitivity)
        return replace(shot, force=replace(shot.force, transducer=wrong))

    return _changed(change)


def _damping(factor: float) -> Wrong:
    return _changed(lambda s: replace(s, model=replace(s.model, damping=factor * s.model.damping)))


def _poisson(excess: float) -> Wrong:
    """1 - 2 nu so many times the true one: 0.499 declared as 0.495 is 5, as 0.4999 is 0.1."""

    def change(shot: Shot) -> Shot:
        wrong = min(0.5 - excess * (0.5 - shot.model.poisson), 0.4999)
        return replace(shot, model=replace(shot.model, poisson=wrong))

    return _changed(change)


def _late(lag: float) -> Wrong:
    def change(shot: Shot) -> Shot:
        assert isinstance(shot.flyer, FlyerMotion)
        end = min(shot.window[1], float(shot.flyer.time[-1]))
        late = replace(shot.flyer, time=shot.flyer.time + lag)
        return replace(shot, flyer=late, window=(shot.window[0], end))

    return _changed(change)


def _late_force(lag: float) -> Wrong:
    def change(shot: Shot) -> Shot:
        assert isinstance(shot.force, ForceChannel)
        return replace(shot, force=replace(shot.force, clock_offset=shot.force.clock_offset + lag))

    return _changed(change)


def _late_outline(lag: float) -> Wrong:
    def change(shot: Shot) -> Shot:
        line = shot.centre_line
        assert line is not None
        return replace(shot, centre_line=replace(line, time=line.time + lag))

    return _changed(change)


def _specimen(name: str, factor: float) -> Wrong:
    def change(shot: Shot) -> Shot:
        wrong = {name: factor * getattr(shot.specimen, name)}
        return replace(shot, specimen=replace(shot.specimen, **wrong))

    return _changed(change)


def _curve(factor: float) -> Wrong:
    return _changed(lambda s: replace(s, curve=replace(s.curve, stress=factor * s.curve.stress)))


def _outline(name: str, offset: float) -> Wrong:
    def change(shot: Shot) -> Shot:
        line = shot.centre_line
        assert line is not None
        return replace(shot, centre_line=replace(line, **{name: getattr(line, name) + offset}))

    return _changed(change)


def _voltage(folder: Path) -> Shot:
    """The recorder's time column is declared as the voltage."""
    lines = (folder / "shot.toml").read_text("utf-8").splitlines()
    at = lines.index("[force]")
    for i in range(at + 1, len(lines)):
        if lines[i].startswith("voltage"):
            lines[i] = 'voltage = { column = "Time (s)", unit = "V" }'
            break
    with TemporaryDirectory() as place:
        for file in folder.iterdir():
            if file.is_file():
                (Path(place) / file.name).symlink_to(file.resolve())
        (Path(place) / "shot.toml").unlink()
        (Path(place) / "shot.toml").write_text("\n".join(lines), "utf-8")
        return load_shot(Path(place))


ROWS: tuple[Row, ...] = (
    Row(RIGHT, "", load_shot),
    Row(f"{RIGHT}, nu and beta free", "", load_shot, free=True),
    Row("sensitivity x 1/2", SENSITIVITY, _gain(0.5)),
    Row("sensitivity x 1/2, nu and beta free", SENSITIVITY, _gain(0.5), free=True),
    Row("sensitivity x 2", SENSITIVITY, _gain(2.0)),
    Row("force x 10", SENSITIVITY, _gain(0.1)),
    Row("beta = 0", DAMPING, _damping(0.0)),
    Row("beta x 2", DAMPING, _damping(2.0)),
    Row("beta x 4", DAMPING, _damping(4.0)),
    Row("1 - 2 nu x 1/10", POISSON, _poisson(0.1)),
    Row("1 - 2 nu x 5", POISSON, _poisson(5.0)),
    Row("flyer 20 us late", "flyer.time", _late(20e-6)),
    Row("flyer 20 us late, nu and beta free", "flyer.time", _late(20e-6), free=True),
    Row("length -1.5 %", "specimen.length", _specimen("length", 0.985)),
    Row("length -1.5 %, nu and beta free", "specimen.length", _specimen("length", 0.985), free=True),
    Row("density +5 %", DENSITY, _specimen("density", 1.05), names=(SENSITIVITY,)),
    Row("density -10 %", DENSITY, _specimen("density", 0.9), names=(SENSITIVITY,)),
    Row(CURVE, "", _curve(0.95)),
    Row("y + 100 um", "centre_line.y_offset", _outline("y", 1e-4)),
    Row("Z + 20 um", "centre_line.Z_offset", _outline("Z", 2e-5)),
    Row(VOLTAGE, "", _voltage),
    Row("force 20 us late, nu and beta free", "force.clock_offset", _late_force(20e-6), free=True),
    Row("outline 20 us late, nu and beta free", "centre_line.time", _late_outline(20e-6), free=True),
    Row("outline 20 us early, nu and beta free", "centre_line.time", _late_outline(-20e-6), free=True),
)
"""Every row of the study, in the order of its table."""
