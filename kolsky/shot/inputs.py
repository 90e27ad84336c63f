"""The inputs of a shot, one record each: its description, its effect, and its possible error.

An input is a number of shot.toml that the recorded data do not contain. It is a scale, a zero, a clock, a
length, or a constant of the model. Three kinds of module use its record. `kolsky.uncertainty.input_changes`
computes the effect of its declared uncertainty on the result. `kolsky.diagnosis.causes` tests whether it
explains a misfit. `kolsky.studies.budget` and `kolsky.virtual` simulate a laboratory with an error of the
input. A new input is one entry of `INPUTS`.
"""

from __future__ import annotations

from dataclasses import replace
from math import exp, expm1, inf, log, log1p, nan
from typing import Any

from kolsky.shot.corrections import (
    changed_curve,
    with_film,
    with_flyer_clock,
    with_force_clock,
    with_gain,
    with_leak,
    with_mirrored,
    with_motion,
    with_outline,
    with_pictures,
    with_zero,
)
from kolsky.shot.input_records import CLOCK, OFFSET, RELATIVE, Cause, Change, Input, Laboratory
from kolsky.shot.records import Shot


def causes() -> tuple[Cause, ...]:
    """Every input that is tested as a cause, in the order of tables."""
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
"""A cause that is a factor on a simulated quantity; u is the factor minus 1."""
_SHARES = (-0.1, -0.05, -0.025, 0.025, 0.05, 0.1)
_FACTORS = (0.1, 0.5, 2.0, 10.0)
"""Common mistakes in a scale: a radius for a diameter, one digit too many."""
_SIZE: dict[str, Any] = {
    "scan": (-0.5, *_SHARES, 1.0),
    "step": 2e-3,
    "lowest": -0.6,
    "highest": 1.2,
    "mistakes": _FACTORS,
}
_LAGS = tuple(5e-6 * n for n in range(-12, 13) if n)
"""Lags to try [s]."""
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


def _of_curve(name: str, *, key: str, words: str, check: str, form: str, **tried: Any) -> Input:
    """A change of the quasi-static curve, see `kolsky.shot.corrections`. The coordinate u is its amount."""
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
CURVE_SCALE, FRAME_RATE = "curve.stress, its scale", "frames.time"

# fmt: off
INPUTS: dict[str, Input] = {
    one.key: one
    for one in (
        Input(
            key="sensitivity", words="sensitivity of the force", place="[force] sensitivity", relative=True,
            shared="rig", needs="force channel", step=RELATIVE,
            # A larger sensitivity gives a smaller force.
            seen=lambda model, u: model.change(transmitted=u * model.transmitted()), applied=with_gain,
            cause=Cause(
                key=SENSITIVITY, words="a force gain", check="check force.sensitivity",
                # The evaluated force times the gain equals the simulated force.
                changed=lambda u: Change(force_factor=u),
                scan=_RATIOS, step=1e-3, typical=0.03, value=lambda u: 1.0 / u,
                coordinate=lambda value: 1.0 / value, lowest=0.01, highest=100.0, exact=1.0,
                mistakes=(*_FACTORS, 0.25, 4.0),
            ),
            laboratory=Laboratory(
                "imperfections.sensitivity", "1 %", 3, words="force transducer’s sensitivity",
            ),
        ),
        Input(
            key="force_zero", words="zero of the force", place="[force] baseline", unit="N", step=RELATIVE,
            # The assumed zero is subtracted.
            seen=lambda model, u: model.change(transmitted=u), applied=with_zero,
            cause=Cause(
                key="force.baseline", words="a zero of the force",
                check="check force.baseline: no force may act in it",
                changed=lambda u: Change(force_offset=u), needs="force channel", step=0.1, typical=0.1,
            ),
            laboratory=Laboratory(
                "imperfections.baseline", "1 mV", 10, words="step of the force’s baseline",
            ),
        ),
        Input(
            key="clock_offset", words="clock of the force against the cameras’", place="[force] clock_offset",
            unit="s", shared="rig", needs="force channel", step=CLOCK,
            seen=lambda model, u: model.change(force=u * model.force_rate()), applied=with_force_clock,
            cause=Cause(
                key="force.clock_offset", words="a lag of the force",
                check="check force.clock_offset and frames.clock_offset",
                changed=lambda u: Change(force_lag=u),
                scan=_LAGS, step=1e-6, typical=3e-6, onset=True,
            ),
            laboratory=Laboratory(
                "imperfections.trigger", "1 us", 7, words="cameras’ clock against the recorder’s", anew=True,
            ),
        ),
        Input(
            key="outline_clock", words="clock of the outline against force and flyer",
            place="[centre_line] time", unit="s", needs="outline", step=CLOCK,
            seen=lambda model, u: model.change(outline=u * model.outline_rate()),
            applied=with_outline("time", -1.0),
            cause=Cause(
                key="centre_line.time", words="a lag of the outline",
                check="check the times and frame numbers of centre_line.file",
                changed=lambda u: Change(outline_lag=u), needs="outline",
                scan=_LAGS, step=1e-6, typical=2e-6,
            ),
        ),
        Input(
            key="flyer_clock", words="clock of the flyer against force and outline", place="[flyer] time",
            unit="s", step=CLOCK,
            # All simulated data are delayed.
            seen=lambda model, u: model.change(
                force=-u * model.force_rate(), outline=-u * model.outline_rate()
            ),
            applied=with_flyer_clock,
            cause=Cause(
                key="flyer.time", words="a lag of the flyer's record",
                check="check the times and frame numbers of flyer.file",
                changed=lambda u: Change(force_lag=-u, outline_lag=-u),
                scan=_LAGS, step=1e-6, typical=2e-6, onset=True,
            ),
        ),
        Input(
            key="flyer_displacement", words="scale of the flyer’s displacement", place="[flyer] displacement",
            relative=True, applied=with_motion,
            cause=Cause(
                key="flyer.displacement", words="a factor on the flyer's displacement",
                check="check flyer.displacement: its unit, and the scale of the pictures",
                changed=lambda u: Change(motion=1.0 + u),
                scan=_SHARES, step=2e-3, typical=0.003, lowest=-0.5, highest=0.5, **_FACTOR,
            ),
        ),
        Input(
            # its scale is its distance from 1/2, which sets the frequency of oscillations
            key="poisson", words="Poisson’s ratio", place="[model] poisson", shared="group", step=0.01,
            parameter="poisson",
            cause=Cause(
                key=POISSON, words="another Poisson's ratio", check="check model.poisson, or free it",
                changed=lambda u: Change(values={"poisson": -0.5 * expm1(u)}),
                step=0.02, typical=0.0005,  # far values: `kolsky.diagnosis.causes`
                value=lambda u: -0.5 * expm1(u), coordinate=lambda value: log1p(-2.0 * value),
                lowest=log(2e-4 * (1.0 + 1e-9)), highest=log(0.3), simulated=True,
            ),
            laboratory=Laboratory("imperfections.poisson", 0.0003, 5),
        ),
        Input(
            key="damping", words="stiffness-proportional damping", place="[model] damping", unit="s",
            shared="group", step=0.05, parameter="damping",
            cause=Cause(
                key=DAMPING, words="another damping", check="check model.damping, or free it",
                changed=lambda u: Change(values={"damping": u}),
                scan=(0.0, 5e-6, 1e-5, 1.5e-5, 2e-5, 2.7e-5, 3.5e-5, 5e-5, 7e-5, 1e-4, 1.5e-4), step=1e-6,
                typical=1e-5, lowest=0.0, highest=1e-3, simulated=True,
            ),
            laboratory=Laboratory("imperfections.damping", "5 us", 6, words="damping"),
        ),
        Input(
            key="mass_damping", words="mass-proportional damping", unit="1/s", parameter="mass_damping",
            cause=Cause(
                key="model.mass_damping", words="an additional damping proportional to mass",
                check="the damping of the material may differ from model.damping",
                changed=lambda u: Change(values={"mass_damping": u}),
                scan=(50.0, 150.0, 400.0, 1000.0, 2500.0), step=20.0, typical=20.0, lowest=0.0, highest=1e4,
                simulated=True,
            ),
        ),
        Input(
            key="friction", words="Coulomb friction", place="[interface] friction", shared="group", step=0.05,
            parameter="friction",
        ),
        Input(
            key="curve_scale", words="scale of the quasi-static stress", place="[curve] stress",
            relative=True, shared="curve", step=RELATIVE,
            laboratory=Laboratory(
                "imperfections.curve", "1 %", 4, words="scale of the quasi-static curve",
            ),
        ),
        _of_specimen(
            "length", Laboratory("imperfections.length", "0.5 %", 0), typical=0.01, **_SIZE,
        ),
        _of_specimen(
            "diameter", Laboratory("imperfections.diameter", "0.3 %", 1), typical=0.005, **_SIZE,
        ),
        _of_specimen(
            "density", Laboratory("imperfections.density", "0.5 %", 2), shared="group", step=0.01,
            # far values are started from those of the force's gain
            typical=0.01, mistakes=_FACTORS,
            lowest=-0.95, highest=10.0,
        ),
        Input(
            key="y_offset", words="height of the outline, y", place="[centre_line] y_offset", unit="m",
            needs="outline", step=OFFSET,
            seen=lambda model, u: model.higher(u), applied=with_outline("y"),
            cause=Cause(
                key="centre_line.y_offset", words="an offset of the outline's height",
                check="check centre_line.y_offset",
                changed=lambda u: Change(y_offset=u), needs="outline",
                scan=(-3e-4, -1e-4, 1e-4, 3e-4), step=1e-5, typical=1e-4, lowest=-1e-3, highest=1e-3,
            ),
            laboratory=Laboratory("imperfections.y_offset", "20 um", 8, words="height of the outline"),
        ),
        Input(
            key="Z_offset", words="axis of the outline, Z", place="[centre_line] Z_offset", unit="m",
            needs="outline", step=OFFSET,
            seen=lambda model, u: model.change(outline=-u), applied=with_outline("Z"),
            cause=Cause(
                key="centre_line.Z_offset", words="an offset of the outline from the axis",
                check="check centre_line.Z_offset",
                changed=lambda u: Change(Z_offset=u), needs="outline", step=1e-5, typical=2e-5,
            ),
            laboratory=Laboratory("imperfections.Z_offset", "10 um", 9, words="axis of the outline"),
        ),
        Input(
            key="flyer_tilt", words="pitch of the flyer", unit="s",
            cause=Cause(
                key="flyer tilt", words="a contact that spreads over the face, or a slow force channel",
                check="check the flyer's tilt, and the bandwidth of the force channel",
                changed=lambda u: Change(spread=max(u, 0.0) ** 0.5),
                # a frame: the flyer's onset between two of them is the fitted path's
                scan=(2.5e-11, 1e-10, 4e-10, 1.6e-9), step=2.5e-11, typical=5e-6, allowance=8e-6,
                value=lambda u: max(u, 0.0) ** 0.5, coordinate=lambda value: value**2, lowest=0.0,
                highest=1e-8,
            ),
            laboratory=Laboratory("imperfections.tilt", "0.3 deg", 11),
        ),
        Input(
            key="faces", words="law of the end faces", place="[interface] faces",
            cause=Cause(
                key="interface.faces", words="faces that slide, with a friction coefficient",
                check="check interface.faces: did the specimen stick?",
                changed=lambda u: Change(values={"friction": u}), needs="faces that stick",
                scan=(0.1, 0.3, 1.0), step=0.02, typical=inf, lowest=0.0, highest=3.0, exact=nan,
                simulated=True,
            ),
        ),
        Input(
            key="film", words="rate of the camera", place="[frames] time", relative=True, applied=with_film,
            cause=Cause(
                key=FRAME_RATE, words="a factor on the times of all frames",
                check="check the camera's rate: frames.time, and its unit",
                changed=lambda u: Change(film=1.0 + u), needs="film of the flyer",
                scan=(-0.5, -0.1, -0.05, -0.025, -0.01, 0.01, 0.025, 0.05, 0.1, 1.0), step=1e-3,
                typical=0.002, lowest=-0.6, highest=1.5, mistakes=(0.5, 2.0), **_FACTOR,
            ),
        ),
        Input(
            key="picture_scale", words="scale of the pictures", place="[pictures] scale", relative=True,
            applied=with_pictures,
            cause=Cause(
                key="pictures.scale", words="a factor on all lengths in the pictures",
                check="check the scale of the pictures, mm per pixel: flyer and outline have it in common",
                changed=lambda u: Change(picture=1.0 + u), needs="film of the flyer",
                scan=_SHARES, step=2e-3, typical=0.005, lowest=-0.3, highest=0.3, **_FACTOR,
            ),
        ),
        Input(
            key="axis", words="direction of the outline’s axis", place="[centre_line] y", unit="m",
            applied=with_mirrored,
            cause=Cause(
                key="centre_line.y", words="heights that count from the other end, with an offset",
                check="check centre_line.y: it counts from the fixed end toward the flyer",
                changed=lambda u: Change(mirror=u), needs="outline",
                scan=(0.0,), step=1e-5, typical=1e-4, lowest=-1e-3, highest=1e-3, exact=nan, mistakes=(0.0,),
            ),
        ),
        Input(
            key="bandwidth", words="bandwidth of the force’s amplifier", unit="s",
            cause=Cause(
                key="force.bandwidth", words="an amplifier with a time constant",
                check="check the amplifier's bandwidth, 1 / (2 pi times the time constant), and its filter",
                changed=lambda u: Change(time_constant=max(u, 0.0)), needs="force channel",
                scan=(5e-6, 1e-5, 2e-5, 4e-5, 8e-5, 1.6e-4, 3.2e-4), step=1e-6, typical=5e-6, lowest=0.0,
                highest=2e-3,
            ),
        ),
        Input(
            key="leak", words="leak of the force’s charge", place="[force] time_constant", unit="1/s",
            applied=with_leak,
            cause=Cause(
                key="force.time_constant", words="a charge that leaks at a rate",
                check="declare force.time_constant, 1 / rate",
                changed=lambda u: Change(leak=max(u, 0.0)), needs="force channel",
                scan=(30.0, 100.0, 300.0, 1000.0, 3000.0), step=3.0, typical=20.0, lowest=0.0, highest=1e4,
            ),
        ),
        Input(
            key="channel", words="channel of the force", place="[force] voltage",
            cause=Cause(
                key="force.voltage", words="a share of the force at the flyer's end",
                check="check force.voltage: is it the column of the other bar?",
                changed=lambda u: Change(flyer_share=u), needs="force channel",
                scan=(1.0,), step=0.01, typical=0.05, lowest=-0.5, highest=1.5, mistakes=(1.0,),
            ),
        ),
        _of_curve(
            "true_stress", key="curve.stress",
            words="a curve of true instead of nominal stress, with a share",
            check="check curve.stress: it must be force over the first area", form="true stress",
            scan=(1.0,), mistakes=(1.0,), lowest=-2.0, highest=2.0,
        ),
        _of_curve(
            "true_strain", key="curve.strain",
            words="a curve of logarithmic instead of nominal strain, with a share",
            check="check curve.strain: it must be the change of length over the first length",
            form="true strain",
            scan=(1.0,), mistakes=(1.0,), lowest=-1.0, highest=1.5,
        ),
        _of_curve(
            "curve_shape", key="curve shape", words="a curve that stiffens more toward its end by a share",
            check="check the slow test of the curve: conditioning, rate, temperature, friction of its ends",
            form="tilt",
            scan=(-0.6, -0.25, 0.25, 0.6), lowest=-1.5, highest=1.9,
        ),
        _of_curve(
            "curve_end", key="curve past its end",
            words="a curve that is stiffer past its last point by a share",
            check="measure the curve to larger strain, or end the window before the curve ends",
            form="past end",
            scan=(-1.0, 3.0, 10.0), lowest=-3.0, highest=100.0, typical=1.0,
        ),
        _of_curve(
            "curve_branch", key="curve.branch", words="a curve of the other branch",
            check="check curve.branch and curve.convention: tension or compression", form="branch",
            scan=(1.0,), mistakes=(1.0,), exact=nan, lowest=0.0, highest=1.0,
        ),
        Input(
            key="curve_at_bound", words="stiffness beyond its bound", place="[curve] stress",
            cause=Cause(
                key=CURVE_SCALE, words="a stiffness factor beyond its bound",
                check="widen the bound if the material may be that stiff or soft; otherwise suspect the "
                "scale of curve.stress: its unit, its area (a factor of (D/d)²), or another "
                "material's curve",
                changed=lambda u: Change(values={"stiffness_factor": exp(u)}), needs="stiffness at its bound",
                scan=tuple(
                    log(v) for v in (0.01, 0.03, 0.1, 0.17, 0.25, 0.35, 0.5, 2.0, 3.0, 4.0, 6.0, 10.0)
                ),
                step=0.01, typical=inf, value=exp, coordinate=log, lowest=log(1e-3), highest=log(1e3),
                exact=nan, simulated=True,
            ),
        ),
        Input(
            key="off_centre", words="specimen off centre",
            laboratory=Laboratory("imperfections.off_centre", "0.1 mm", 12),
        ),
        Input(
            key="amplifier_gain", words="gain of the force’s amplifier", shared="rig",
            laboratory=Laboratory("imperfections.gain"),
        ),
        Input(
            key="force_delay", words="delay of the force’s cable", shared="rig",
            laboratory=Laboratory("transmitted.delay"),
        ),
        Input(
            key="force_drift", words="drift of the force’s baseline",
            laboratory=Laboratory("transmitted.drift"),
        ),
    )
}
# fmt: on
"""The inputs by key, in the order in which they are tried as causes; registry."""
