"""The inputs of a shot, one record each: what it is, what it changes, and how wrong it may be.

An input is a number of shot.toml that the data do not hold: a scale, a zero, a clock, a length, a constant of
the model. The parts of its record are read by those who ask about it: by how much a declared uncertainty
moves the answer (`kolsky.uncertainty.input_changes`), whether it explains a misfit
(`kolsky.diagnosis.causes`), and what a laboratory that errs in it would measure (`kolsky.studies.budget`,
`kolsky.virtual`). A new input is one entry of `INPUTS`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import exp, expm1, hypot, inf, isnan, log, log1p, nan
from typing import Any, Literal, Protocol

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion
from kolsky.shot.curve_changes import changed_curve
from kolsky.shot.records import ForceChannel, Shot

RELATIVE = 0.0025
"""Step of an input that is a scale, relative to it [-]: more would turn the phase of what rings, less would
show the roughness of the contact where the side surface rolls onto a platen."""
CLOCK = 1e-6
"""Step of a clock [s]."""
OFFSET = 1e-5
"""Step of a place [m]."""
SHOWN = {"s": (1e6, "us"), "m": (1e6, "um")}
"""Factor and unit in which an amount or a value is written."""

Needs = Literal[
    "nothing",
    "force channel",
    "outline",
    "faces that stick",
    "film of the flyer",
    "curve",
    "stiffness at its bound",
]
"""What a shot must have for an input to have a part."""


class Model(Protocol):
    """The model's force and outline at the optimum, through which an input is seen that needs no run."""

    def change(self, *, transmitted: Any = 0.0, force: Any = 0.0, outline: Any = 0.0) -> FloatArray:
        """A change of prediction minus data from those of its parts, shape [k]."""

    def transmitted(self) -> FloatArray:
        """The transmitted force in its bins [N]."""

    def force_rate(self) -> FloatArray:
        """Time derivative of every bin's force [N/s]."""

    def outline_rate(self) -> FloatArray:
        """Time derivative of the radius at every counted point's height [m/s]."""

    def higher(self, step: float) -> FloatArray:
        """Change of the prediction by outline points that lie higher [m], shape [k]."""


@dataclass(frozen=True)
class Change:
    """What an input at another value changes: what is simulated, and what is made of a run."""

    values: Mapping[str, float] = field(default_factory=dict)
    """Parameters of the simulation at other values than the shot's."""
    specimen: Mapping[str, float] = field(default_factory=dict)
    """Factors on fields of the specimen."""
    motion: float = 1.0
    """Factor on the motion of the front face."""
    force_factor: float = 1.0
    """The force is so many times the simulated one [-]."""
    force_offset: float = 0.0
    """And so much larger [N]."""
    force_lag: float = 0.0
    """The force comes so much later [s]."""
    spread: float = 0.0
    """The force begins over times so much earlier to so much later, as over a tilted round face [s]."""
    outline_lag: float = 0.0
    """The outline comes so much later [s]."""
    y_offset: float = 0.0
    """The outline's points lie so much higher than their file says [m]."""
    Z_offset: float = 0.0
    """And so much further from the axis [m]."""
    mirror: float = nan
    """Heights count down from the other end, which lies so much higher than the length at rest [m]; NaN if
    they do not."""
    film: float = 1.0
    """Factor on the times of all frames, from the shot's zero on."""
    picture: float = 1.0
    """Factor on all lengths in the pictures: the flyer's motion and the outline."""
    time_constant: float = 0.0
    """Of a first-order low-pass of the force [s]."""
    leak: float = 0.0
    """Rate at which the charge of the force's transducer leaks [1/s]."""
    flyer_share: float = 0.0
    """Share of the force at the flyer's face in the transmitted force's channel [-]."""
    curve: Mapping[str, float] = field(default_factory=dict)
    """Changes of the quasi-static curve, see `kolsky.shot.curve_changes`."""

    def then(self, other: Change) -> Change:
        """Both at once: of a parameter the other's value holds, factors multiply, lags and offsets add,
        spreads add in quadrature."""
        factors = dict(self.specimen)
        for name, factor in other.specimen.items():
            factors[name] = factors.get(name, 1.0) * factor
        return Change(
            values={**self.values, **other.values},
            specimen=factors,
            motion=self.motion * other.motion,
            force_factor=self.force_factor * other.force_factor,
            force_offset=self.force_offset * other.force_factor + other.force_offset,
            force_lag=self.force_lag + other.force_lag,
            spread=hypot(self.spread, other.spread),
            outline_lag=self.outline_lag + other.outline_lag,
            y_offset=self.y_offset + other.y_offset,
            Z_offset=self.Z_offset + other.Z_offset,
            mirror=self.mirror if isnan(other.mirror) else other.mirror,
            film=self.film * other.film,
            picture=self.picture * other.picture,
            time_constant=self.time_constant + other.time_constant,
            leak=self.leak + other.leak,
            flyer_share=self.flyer_share + other.flyer_share,
            curve={**self.curve, **other.curve},
        )

    @property
    def sight(self) -> tuple[float, ...]:
        """What distinguishes the radii that are seen of one run: when and where points are looked for."""
        mirror = inf if isnan(self.mirror) else self.mirror  # NaN is not equal to itself
        return self.outline_lag, self.y_offset, mirror, self.film, self.picture

    @property
    def path(self) -> tuple[float, float]:
        """What distinguishes the motion of the front face: factors on its displacement and on its times."""
        return self.motion * self.picture, self.film

    @property
    def seen(self) -> tuple[float, ...]:
        """What tells the data that are made of one run from those of another change."""
        force = self.force_factor, self.force_offset, self.force_lag, self.spread
        channel = self.time_constant, self.leak, self.flyer_share
        return *force, *channel, *self.sight, self.Z_offset


UNCHANGED = Change()
"""Everything as the shot declares it."""


def _plain(u: float) -> float:
    return u


@dataclass(frozen=True, kw_only=True)
class Cause:
    """An input tried as the cause of a misfit, as a coordinate u in which the response is nearly linear."""

    key: str
    """Key of shot.toml, or what else is wrong; results have it."""
    words: str
    """What is changed, as a sentence begins: "a factor on the force"."""
    check: str
    """What to check, as a sentence ends: "check force.sensitivity"."""
    changed: Callable[[float], Change]
    """The input at a coordinate."""
    needs: Needs = "nothing"
    """What a shot must have for it to be tried."""
    scan: tuple[float, ...] = ()
    """Values of the coordinate that are tried before the search, far from what is declared."""
    finer: float = 0.0
    """Distance of the values tried about the best of those, where its basin is narrow; 0 for none."""
    step: float
    """Step of the coordinate for differences."""
    typical: float
    """Standard uncertainty that is usual where none is declared, in the value's unit; orders what the data
    cannot tell apart."""
    mistakes: tuple[float, ...] = ()
    """Values of usual mistakes, in the value's unit: a factor of two or ten, another definition."""
    allowance: float = 0.0
    """Standard uncertainty that is granted beside the declared one: what no laboratory can know better."""
    onset: bool = False
    """Whether what the flyer's path leaves open of its onset is granted too: where no frame shows it, a force
    or a flyer that seems late by as much is no wrong clock."""
    value: Callable[[float], float] = _plain
    """Value at a coordinate."""
    coordinate: Callable[[float], float] = _plain
    """Coordinate of a value."""
    lowest: float = -inf
    """Least coordinate."""
    highest: float = inf
    """Largest coordinate."""
    exact: float = 0.0
    """The value that is right if the input is: 1 for a factor, 0 for an offset."""
    simulated: bool = False
    """Whether other runs are needed."""
    unit: str = "1"
    """SI unit of the value; that of the input, as are the next two."""
    declared: str = ""
    """Its key in [uncertainty], if it has one there."""
    parameter: str = ""
    """The parameter of the simulation that it is; then what is held is right if the input is."""


@dataclass(frozen=True)
class Laboratory:
    """How a virtual laboratory errs in an input."""

    key: str
    """Dotted key of its specification."""
    usual: str | float | None = None
    """Standard uncertainty in a careful laboratory; None if it is no source of error there."""
    order: int = 99
    """Its place among the sources of a careful laboratory, whose draws depend on it."""
    words: str = ""
    """What it is there; that of the input if left out."""
    anew: bool = False
    """Whether it is drawn anew for each shot, though what is declared of it holds for all."""


@dataclass(frozen=True, kw_only=True)
class Input:
    """One input: what it is, where it is declared, and what a wrong one does."""

    key: str
    """Its key; that of [uncertainty] where it has one there."""
    words: str
    """What it is, as tables and sentences write it."""
    place: str = ""
    """Table and key of shot.toml that declare it; empty if none does."""
    unit: str = "1"
    """SI unit of its step; "1" for a plain number."""
    relative: bool = False
    """Whether its step and its uncertainty are shares of it."""
    shared: str = ""
    """What shots share it through: "rig", "curve" or "group"; empty if each has its own."""
    needs: Needs = "nothing"
    """What a shot must have for its uncertainty to have a part in the answer."""
    step: float = 0.0
    """By how much it is moved to see what it does, in its unit or relative; of a parameter a share of its
    scale, of a force one of the largest. Zero if it is not moved."""
    parameter: str = ""
    """The parameter of the simulation that it is."""
    specimen: str = ""
    """The field of the specimen that it is a factor of."""
    seen: Callable[[Model, float], FloatArray] | None = None
    """Exact first-order change of prediction minus data by a step; None if runs must be made for it."""
    applied: Callable[[Shot, float], Shot] | None = None
    """The shot with the input at a value of its `cause`: a factor, a lag, an offset that was found."""
    cause: Cause | None = None
    """How it is tried as a cause; None if it leaves no residual that is its own."""
    laboratory: Laboratory | None = None
    """How a virtual laboratory errs in it."""


def causes() -> tuple[Cause, ...]:
    """Every input that is tried as a cause, in the order of tables."""
    return tuple(
        replace(one.cause, unit=one.unit, declared=one.key, parameter=one.parameter)
        for one in INPUTS.values()
        if one.cause is not None
    )


_FACTOR: dict[str, Any] = {
    "value": lambda u: 1.0 + u,
    "coordinate": lambda value: value - 1.0,
    "exact": 1.0,
    "simulated": True,
}
"""A cause that is a factor on what is simulated; u is by how much it is not 1."""
_SHARES = (-0.1, -0.05, -0.025, 0.025, 0.05, 0.1)
_FACTORS = (0.1, 0.5, 2.0, 10.0)
"""Usual mistakes of a scale: a radius for a diameter, a digit too many."""
_SIZE: dict[str, Any] = {
    "scan": (-0.5, *_SHARES, 1.0),
    "step": 2e-3,
    "lowest": -0.6,
    "highest": 1.2,
    "mistakes": _FACTORS,
}
_LAGS = tuple(5e-6 * n for n in range(-12, 13) if n)
"""Lags that are tried [s]."""
_RATIOS = (0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.2, 1.45, 2.0, 3.0, 5.0, 10.0)


def _of_specimen(name: str, laboratory: Laboratory, *, shared: str = "", **tried: Any) -> Input:
    """A factor on a length or the density of the specimen."""

    def applied(shot: Shot, factor: float) -> Shot:
        right = factor * getattr(shot.specimen, name)
        return replace(shot, specimen=replace(shot.specimen, **{name: right}))

    return Input(
        key=f"specimen_{name}",
        words=f"specimen’s {name}",
        place=f"[specimen] {name}",
        relative=True,
        shared=shared,
        step=RELATIVE,
        specimen=name,
        applied=applied,
        cause=Cause(
            key=f"specimen.{name}",
            words=f"a factor on the specimen's {name}",
            check=f"check specimen.{name}",
            changed=lambda u: Change(specimen={name: 1.0 + u}),
            **_FACTOR,
            **tried,
        ),
        laboratory=laboratory,
    )


def _gain(shot: Shot, value: float) -> Shot:
    force = shot.force
    if isinstance(force, ForceChannel):
        right = replace(force.transducer, sensitivity=force.transducer.sensitivity / value)
        return replace(shot, force=replace(force, transducer=right))
    history = force.history()
    right_history = replace(history, force=value * history.force, sigma=value * history.sigma)
    return replace(shot, force=replace(force, measured=right_history))


def _zero(shot: Shot, value: float) -> Shot:
    """Volts taken off outside the baseline, whose own mean is the zero: after it, or before one that follows
    the test."""
    force = shot.force
    assert isinstance(force, ForceChannel)  # it is not tried on another
    volts = force.transducer.compression_sign * force.transducer.sensitivity * value
    first, last = force.baseline
    moved = force.time > last if first <= shot.window[0] else force.time < first
    recording = replace(force.recording, value=force.recording.value - np.where(moved, volts, 0.0))
    return replace(shot, force=replace(force, recording=recording))


def _force_clock(shot: Shot, lag: float) -> Shot:
    force = shot.force
    if isinstance(force, ForceChannel):
        return replace(shot, force=replace(force, clock_offset=force.clock_offset - lag))
    history = force.history()
    return replace(shot, force=replace(force, measured=replace(history, time=history.time - lag)))


def _flyer_clock(shot: Shot, lag: float) -> Shot:
    """The motion is known until its last frame, and compared no longer."""
    motion = replace(shot.flyer, time=shot.flyer.time - lag)
    first, last = shot.window
    return replace(shot, flyer=motion, window=(first, min(last, float(motion.time[-1]))))


def _motion(shot: Shot, factor: float) -> Shot:
    motion = shot.flyer
    if isinstance(motion, FlyerMotion):
        return replace(shot, flyer=replace(motion, displacement=factor * motion.displacement))
    return replace(shot, flyer=replace(motion, velocity=factor * motion.velocity))


def _outline(name: str, sign: float = 1.0) -> Callable[[Shot, float], Shot]:
    """A column of the outline, moved by what was found."""

    def applied(shot: Shot, found: float) -> Shot:
        line = shot.centre_line
        assert line is not None  # it is not tried without one
        return replace(shot, centre_line=replace(line, **{name: getattr(line, name) + sign * found}))

    return applied


def _film(shot: Shot, factor: float) -> Shot:
    """The frames' times, and a window that ends with them."""
    motion, line = replace(shot.flyer, time=factor * shot.flyer.time), shot.centre_line
    if line is not None:
        line = replace(line, time=factor * line.time)
    first, last = shot.window
    return replace(shot, flyer=motion, centre_line=line, window=(first, min(last, float(motion.time[-1]))))


def _pictures(shot: Shot, factor: float) -> Shot:
    """Every length of the pictures, with its uncertainty as it is."""
    line = shot.centre_line
    if line is not None:
        line = replace(line, y=factor * line.y, Z=factor * line.Z)
    return replace(_motion(shot, factor), centre_line=line)


def _mirrored(shot: Shot, offset: float) -> Shot:
    line = shot.centre_line
    assert line is not None  # it is not tried without one
    return replace(shot, centre_line=replace(line, y=shot.specimen.length + offset - line.y))


def _leak(shot: Shot, rate: float) -> Shot:
    """The rate of a transducer whose charge is declared to leak already is added."""
    force = shot.force
    assert isinstance(force, ForceChannel)  # it is not tried on another
    constant = 1.0 / (1.0 / force.transducer.time_constant + rate)
    return replace(shot, force=replace(force, transducer=replace(force.transducer, time_constant=constant)))


def _of_curve(name: str, *, key: str, words: str, check: str, form: str, **tried: Any) -> Input:
    """A change of the reference curve, see `kolsky.shot.curve_changes`; u is its amount."""
    return Input(
        key=name,
        words=words,
        place="[curve]",
        applied=lambda shot, amount: replace(shot, curve=changed_curve(shot.curve, {form: amount})),
        cause=Cause(
            key=key,
            words=words,
            check=check,
            changed=lambda u: Change(curve={form: u}),
            needs="curve",
            simulated=True,
            **{"step": 0.05, "typical": 0.1, **tried},
        ),
    )


SENSITIVITY, DENSITY = "force.sensitivity", "specimen.density"
POISSON, DAMPING = "model.poisson", "model.damping"
CURVE_SCALE = "curve.stress, its scale"

INPUTS: dict[str, Input] = {
    one.key: one
    for one in (
        Input(
            key="sensitivity",
            words="sensitivity of the force",
            place="[force] sensitivity",
            relative=True,
            shared="rig",
            needs="force channel",
            step=RELATIVE,
            # A larger sensitivity is a smaller force.
            seen=lambda model, u: model.change(transmitted=u * model.transmitted()),
            applied=_gain,
            cause=Cause(
                key=SENSITIVITY,
                words="a force gain",
                check="check force.sensitivity",
                # The force that was evaluated, times the gain, is the simulated one.
                changed=lambda u: Change(force_factor=u),
                scan=_RATIOS,
                step=1e-3,
                typical=0.03,
                value=lambda u: 1.0 / u,
                coordinate=lambda value: 1.0 / value,
                lowest=0.01,
                highest=100.0,
                exact=1.0,
                mistakes=(*_FACTORS, 0.25, 4.0),
            ),
            laboratory=Laboratory(
                "imperfections.sensitivity", "1 %", 3, words="force transducer’s sensitivity"
            ),
        ),
        Input(
            key="force_zero",
            words="zero of the force",
            place="[force] baseline",
            unit="N",
            step=RELATIVE,
            # What is taken for zero is subtracted.
            seen=lambda model, u: model.change(transmitted=u),
            applied=_zero,
            cause=Cause(
                key="force.baseline",
                words="a zero of the force",
                check="check force.baseline: no force may act in it",
                changed=lambda u: Change(force_offset=u),
                needs="force channel",
                step=0.1,
                typical=0.1,
            ),
            laboratory=Laboratory("imperfections.baseline", "1 mV", 10, words="step of the force’s baseline"),
        ),
        Input(
            key="clock_offset",
            words="clock of the force against the cameras’",
            place="[force] clock_offset",
            unit="s",
            shared="rig",
            needs="force channel",
            step=CLOCK,
            seen=lambda model, u: model.change(force=u * model.force_rate()),
            applied=_force_clock,
            cause=Cause(
                key="force.clock_offset",
                words="a lag of the force",
                check="check force.clock_offset and frames.clock_offset",
                changed=lambda u: Change(force_lag=u),
                scan=_LAGS,
                step=1e-6,
                typical=3e-6,
                onset=True,
            ),
            laboratory=Laboratory(
                "imperfections.trigger",
                "1 us",
                7,
                words="cameras’ clock against the recorder’s",
                anew=True,
            ),
        ),
        Input(
            key="outline_clock",
            words="clock of the outline against force and flyer",
            place="[centre_line] time",
            unit="s",
            needs="outline",
            step=CLOCK,
            seen=lambda model, u: model.change(outline=u * model.outline_rate()),
            applied=_outline("time", -1.0),
            cause=Cause(
                key="centre_line.time",
                words="a lag of the outline",
                check="check the times and frame numbers of centre_line.file",
                changed=lambda u: Change(outline_lag=u),
                needs="outline",
                scan=_LAGS,
                step=1e-6,
                typical=2e-6,
            ),
        ),
        Input(
            key="flyer_clock",
            words="clock of the flyer against force and outline",
            place="[flyer] time",
            unit="s",
            step=CLOCK,
            # All that is simulated comes later.
            seen=lambda model, u: model.change(
                force=-u * model.force_rate(), outline=-u * model.outline_rate()
            ),
            applied=_flyer_clock,
            cause=Cause(
                key="flyer.time",
                words="a lag of the flyer's record",
                check="check the times and frame numbers of flyer.file",
                changed=lambda u: Change(force_lag=-u, outline_lag=-u),
                scan=_LAGS,
                step=1e-6,
                typical=2e-6,
                onset=True,
            ),
        ),
        Input(
            key="flyer_displacement",
            words="scale of the flyer’s displacement",
            place="[flyer] displacement",
            relative=True,
            applied=_motion,
            cause=Cause(
                key="flyer.displacement",
                words="a factor on the flyer's displacement",
                check="check flyer.displacement: its unit, and the scale of the pictures",
                changed=lambda u: Change(motion=1.0 + u),
                scan=_SHARES,
                step=2e-3,
                typical=0.003,
                lowest=-0.5,
                highest=0.5,
                **_FACTOR,
            ),
        ),
        Input(
            key="poisson",
            words="Poisson’s ratio",
            place="[model] poisson",
            shared="group",
            step=0.01,  # its scale is its distance from 1/2, which sets the frequency of what rings
            parameter="poisson",
            cause=Cause(
                key=POISSON,
                words="another Poisson's ratio",
                check="check model.poisson, or free it",
                changed=lambda u: Change(values={"poisson": -0.5 * expm1(u)}),
                scan=tuple(-8.3 + 0.2 * n for n in range(31)),
                finer=0.03,
                step=0.02,
                typical=0.0005,
                value=lambda u: -0.5 * expm1(u),
                coordinate=lambda value: log1p(-2.0 * value),
                lowest=log(2e-4 * (1.0 + 1e-9)),
                highest=log(0.3),
                simulated=True,
            ),
            laboratory=Laboratory("imperfections.poisson", 0.0003, 5),
        ),
        Input(
            key="damping",
            words="stiffness-proportional damping",
            place="[model] damping",
            unit="s",
            shared="group",
            step=0.05,
            parameter="damping",
            cause=Cause(
                key=DAMPING,
                words="another damping",
                check="check model.damping, or free it",
                changed=lambda u: Change(values={"damping": u}),
                scan=(0.0, 5e-6, 1e-5, 1.5e-5, 2e-5, 2.7e-5, 3.5e-5, 5e-5, 7e-5, 1e-4, 1.5e-4),
                step=1e-6,
                typical=1e-5,
                lowest=0.0,
                highest=1e-3,
                simulated=True,
            ),
            laboratory=Laboratory("imperfections.damping", "5 us", 6, words="damping"),
        ),
        Input(
            key="mass_damping",
            words="mass-proportional damping",
            unit="1/s",
            parameter="mass_damping",
            cause=Cause(
                key="model.mass_damping",
                words="a damping proportional to mass beside it",
                check="the material may be damped otherwise than model.damping says",
                changed=lambda u: Change(values={"mass_damping": u}),
                scan=(50.0, 150.0, 400.0, 1000.0, 2500.0),
                step=20.0,
                typical=20.0,
                lowest=0.0,
                highest=1e4,
                simulated=True,
            ),
        ),
        Input(
            key="friction",
            words="Coulomb friction",
            place="[interface] friction",
            shared="group",
            step=0.05,
            parameter="friction",
        ),
        Input(
            key="curve_scale",
            words="scale of the quasi-static stress",
            place="[curve] stress",
            relative=True,
            shared="curve",
            step=RELATIVE,
            laboratory=Laboratory("imperfections.curve", "1 %", 4, words="scale of the quasi-static curve"),
        ),
        _of_specimen("length", Laboratory("imperfections.length", "0.5 %", 0), typical=0.01, **_SIZE),
        _of_specimen("diameter", Laboratory("imperfections.diameter", "0.3 %", 1), typical=0.005, **_SIZE),
        _of_specimen(
            "density",
            Laboratory("imperfections.density", "0.5 %", 2),
            shared="group",
            step=0.01,
            typical=0.01,
            mistakes=_FACTORS,  # far values are started from those of the force's gain
            lowest=-0.95,
            highest=10.0,
        ),
        Input(
            key="y_offset",
            words="height of the outline, y",
            place="[centre_line] y_offset",
            unit="m",
            needs="outline",
            step=OFFSET,
            seen=lambda model, u: model.higher(u),
            applied=_outline("y"),
            cause=Cause(
                key="centre_line.y_offset",
                words="an offset of the outline's height",
                check="check centre_line.y_offset",
                changed=lambda u: Change(y_offset=u),
                needs="outline",
                scan=(-3e-4, -1e-4, 1e-4, 3e-4),
                step=1e-5,
                typical=1e-4,
                lowest=-1e-3,
                highest=1e-3,
            ),
            laboratory=Laboratory("imperfections.y_offset", "20 um", 8, words="height of the outline"),
        ),
        Input(
            key="Z_offset",
            words="axis of the outline, Z",
            place="[centre_line] Z_offset",
            unit="m",
            needs="outline",
            step=OFFSET,
            seen=lambda model, u: model.change(outline=-u),
            applied=_outline("Z"),
            cause=Cause(
                key="centre_line.Z_offset",
                words="an offset of the outline from the axis",
                check="check centre_line.Z_offset",
                changed=lambda u: Change(Z_offset=u),
                needs="outline",
                step=1e-5,
                typical=2e-5,
            ),
            laboratory=Laboratory("imperfections.Z_offset", "10 um", 9, words="axis of the outline"),
        ),
        Input(
            key="flyer_tilt",
            words="pitch of the flyer",
            unit="s",
            cause=Cause(
                key="flyer tilt",
                words="a contact that spreads over the face, or a slow force channel",
                check="check the flyer's tilt, and the bandwidth of the force channel",
                changed=lambda u: Change(spread=max(u, 0.0) ** 0.5),
                scan=(2.5e-11, 1e-10, 4e-10, 1.6e-9),
                step=2.5e-11,
                typical=5e-6,
                allowance=8e-6,  # a frame: the flyer's onset between two of them is the fitted path's
                value=lambda u: max(u, 0.0) ** 0.5,
                coordinate=lambda value: value**2,
                lowest=0.0,
                highest=1e-8,
            ),
            laboratory=Laboratory("imperfections.tilt", "0.3 deg", 11),
        ),
        Input(
            key="faces",
            words="law of the end faces",
            place="[interface] faces",
            cause=Cause(
                key="interface.faces",
                words="faces that slide, with a friction coefficient",
                check="check interface.faces: did the specimen stick?",
                changed=lambda u: Change(values={"friction": u}),
                needs="faces that stick",
                scan=(0.1, 0.3, 1.0),
                step=0.02,
                typical=inf,
                lowest=0.0,
                highest=3.0,
                exact=nan,
                simulated=True,
            ),
        ),
        Input(
            key="film",
            words="rate of the camera",
            place="[frames] time",
            relative=True,
            applied=_film,
            cause=Cause(
                key="frames.time",
                words="a factor on the times of all frames",
                check="check the camera's rate: frames.time, and its unit",
                changed=lambda u: Change(film=1.0 + u),
                needs="film of the flyer",
                scan=(-0.5, -0.1, -0.05, -0.025, -0.01, 0.01, 0.025, 0.05, 0.1, 1.0),
                step=1e-3,
                typical=0.002,
                lowest=-0.6,
                highest=1.5,
                mistakes=(0.5, 2.0),
                **_FACTOR,
            ),
        ),
        Input(
            key="picture_scale",
            words="scale of the pictures",
            place="[pictures] scale",
            relative=True,
            applied=_pictures,
            cause=Cause(
                key="pictures.scale",
                words="a factor on all lengths in the pictures",
                check="check the scale of the pictures, mm per pixel: flyer and outline have it in common",
                changed=lambda u: Change(picture=1.0 + u),
                needs="film of the flyer",
                scan=_SHARES,
                step=2e-3,
                typical=0.005,
                lowest=-0.3,
                highest=0.3,
                **_FACTOR,
            ),
        ),
        Input(
            key="axis",
            words="direction of the outline’s axis",
            place="[centre_line] y",
            unit="m",
            applied=_mirrored,
            cause=Cause(
                key="centre_line.y",
                words="heights that count from the other end, with an offset",
                check="check centre_line.y: it counts from the fixed end toward the flyer",
                changed=lambda u: Change(mirror=u),
                needs="outline",
                scan=(0.0,),
                step=1e-5,
                typical=1e-4,
                lowest=-1e-3,
                highest=1e-3,
                exact=nan,
                mistakes=(0.0,),
            ),
        ),
        Input(
            key="bandwidth",
            words="bandwidth of the force’s amplifier",
            unit="s",
            cause=Cause(
                key="force.bandwidth",
                words="an amplifier with a time constant",
                check="check the amplifier's bandwidth, 1 / (2 pi times the time constant), and its filter",
                changed=lambda u: Change(time_constant=max(u, 0.0)),
                needs="force channel",
                scan=(5e-6, 1e-5, 2e-5, 4e-5, 8e-5, 1.6e-4, 3.2e-4),
                step=1e-6,
                typical=5e-6,
                lowest=0.0,
                highest=2e-3,
            ),
        ),
        Input(
            key="leak",
            words="leak of the force’s charge",
            place="[force] time_constant",
            unit="1/s",
            applied=_leak,
            cause=Cause(
                key="force.time_constant",
                words="a charge that leaks at a rate",
                check="declare force.time_constant, 1 / rate",
                changed=lambda u: Change(leak=max(u, 0.0)),
                needs="force channel",
                scan=(30.0, 100.0, 300.0, 1000.0, 3000.0),
                step=3.0,
                typical=20.0,
                lowest=0.0,
                highest=1e4,
            ),
        ),
        Input(
            key="channel",
            words="channel of the force",
            place="[force] voltage",
            cause=Cause(
                key="force.voltage",
                words="a share of the force at the flyer's end",
                check="check force.voltage: is it the column of the other bar?",
                changed=lambda u: Change(flyer_share=u),
                needs="force channel",
                scan=(1.0,),
                step=0.01,
                typical=0.05,
                lowest=-0.5,
                highest=1.5,
                mistakes=(1.0,),
            ),
        ),
        _of_curve(
            "true_stress",
            key="curve.stress",
            words="a curve whose stress is true, not nominal, to a share",
            check="check curve.stress: it must be force over the first area",
            form="true stress",
            scan=(1.0,),
            mistakes=(1.0,),
            lowest=-2.0,
            highest=2.0,
        ),
        _of_curve(
            "true_strain",
            key="curve.strain",
            words="a curve whose strain is logarithmic, not nominal, to a share",
            check="check curve.strain: it must be the change of length over the first length",
            form="true strain",
            scan=(1.0,),
            mistakes=(1.0,),
            lowest=-1.0,
            highest=1.5,
        ),
        _of_curve(
            "curve_shape",
            key="curve shape",
            words="a curve that stiffens more toward its end by a share",
            check="check the slow test of the curve: conditioning, rate, temperature, friction of its ends",
            form="tilt",
            scan=(-0.6, 0.6),
            lowest=-1.5,
            highest=1.9,
        ),
        _of_curve(
            "curve_end",
            key="curve past its end",
            words="a curve that goes on stiffer past its last point by a share",
            check="measure the curve to larger strain, or end the window before the curve ends",
            form="past end",
            scan=(-1.0, 3.0, 10.0),
            lowest=-3.0,
            highest=100.0,
            typical=1.0,
        ),
        _of_curve(
            "curve_branch",
            key="curve.branch",
            words="a curve of the other branch",
            check="check curve.branch and curve.convention: tension or compression",
            form="branch",
            scan=(1.0,),
            mistakes=(1.0,),
            exact=nan,
            lowest=0.0,
            highest=1.0,
        ),
        Input(
            key="curve_at_bound",
            words="stiffness beyond its bound",
            place="[curve] stress",
            cause=Cause(
                key=CURVE_SCALE,
                words="a stiffness factor beyond its bound",
                check="widen the bound if the material may be so; else suspect the scale of curve.stress: "
                "its unit, its area (a factor of (D/d)²), or another material's curve",
                changed=lambda u: Change(values={"stiffness_factor": exp(u)}),
                needs="stiffness at its bound",
                scan=tuple(
                    log(v) for v in (0.01, 0.03, 0.1, 0.17, 0.25, 0.35, 0.5, 2.0, 3.0, 4.0, 6.0, 10.0)
                ),
                step=0.01,
                typical=inf,
                value=exp,
                coordinate=log,
                lowest=log(1e-3),
                highest=log(1e3),
                exact=nan,
                simulated=True,
            ),
        ),
        Input(
            key="off_centre",
            words="specimen off centre",
            laboratory=Laboratory("imperfections.off_centre", "0.1 mm", 12),
        ),
        Input(
            key="amplifier_gain",
            words="gain of the force’s amplifier",
            shared="rig",
            laboratory=Laboratory("imperfections.gain"),
        ),
        Input(
            key="force_delay",
            words="delay of the force’s cable",
            shared="rig",
            laboratory=Laboratory("transmitted.delay"),
        ),
        Input(
            key="force_drift",
            words="drift of the force’s baseline",
            laboratory=Laboratory("transmitted.drift"),
        ),
    )
}
"""The inputs by key, in the order in which they are tried as causes; registry."""
