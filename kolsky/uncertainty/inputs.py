"""The inputs of an identification that no residual need show to be wrong: one record each.

An input is a number of shot.toml that the data do not hold: a scale, a zero, a clock, a length, a constant
of the model. Its record says what it is, where it is declared, and by how much it is moved to see what it
does; `kolsky.uncertainty.input_changes` moves them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import floor, log10
from typing import Literal

from explicit.model import scale_of
from kolsky.inverse.objective import Objective
from kolsky.inverse.observations import Observations
from kolsky.inverse.parameters import PARAMETERS, has_effect
from kolsky.shot.records import ForceChannel, Shot

RELATIVE = 0.0025
"""Step of an input that is a scale, relative to it [-]: more would turn the phase of what rings, less would
show the roughness of the contact where the side surface rolls onto a platen."""
CLOCK = 1e-6
"""Step of a clock [s]."""
OFFSET = 1e-5
"""Step of a place [m]."""
PERCENT = 0.01
"""Plain amount of a scale, relative to it, and of friction [-]."""
ROUNDING = 1e-9
"""What a logarithm may miss a whole number by."""
SHARES = {"stiffness_factor": 0.003, "poisson": 0.01}
"""Step of a parameter over its scale, `explicit.model.scale_of`: for Poisson's ratio that is its distance
from 1/2, which sets the frequency of what rings [-]."""
SHARE = 0.05
"""The same for the other parameters [-]."""


Needs = Literal["nothing", "force channel", "outline"]
"""What a shot must have for an input to have a part."""
ActsOn = Literal["data", "model"]
"""Whether an input changes what was measured, or what is simulated."""


@dataclass(frozen=True, kw_only=True)
class Input:
    """One input: what it is, where it is declared, how far it is moved."""

    key: str
    """Its key; that of [uncertainty] where it has one there."""
    words: str
    """What it is, as tables and sentences write it."""
    place: str
    """Table and key of shot.toml that declare it."""
    unit: str = "1"
    """SI unit of its step; "1" for a plain number."""
    relative: bool = False
    """Whether its step and its uncertainty are shares of it."""
    acts_on: ActsOn
    """Whether it changes what was measured, or what is simulated."""
    needs: Needs = "nothing"
    """What a shot must have for it to have a part."""
    step: Callable[[Shot, Objective], float]
    """By how much it is moved, in its unit or relative."""


def _clock(shot: Shot, objective: Objective) -> float:
    return CLOCK


def _offset(shot: Shot, objective: Objective) -> float:
    return OFFSET


def _zero(shot: Shot, objective: Objective) -> float:
    """A share of the largest force [N]."""
    return RELATIVE * float(abs(objective.data[: objective.n_force]).max())


def parameter_step(name: str, value: float) -> float:
    """Step of a parameter from a value, in its unit."""
    own = PARAMETERS[name].scale
    scale = scale_of(name, value) if own is None else own(value)
    return SHARES.get(name, SHARE) * scale


def _poisson(shot: Shot, objective: Objective) -> float:
    return parameter_step("poisson", shot.model.poisson)


def _damping(shot: Shot, objective: Objective) -> float:
    return parameter_step("damping", shot.model.damping)


def _friction(shot: Shot, objective: Objective) -> float:
    return parameter_step("friction", shot.interface.friction)


def _share(key: str, words: str, place: str, *, acts_on: ActsOn, needs: Needs = "nothing") -> Input:
    """An input whose step and uncertainty are shares of it."""
    return Input(
        key=key,
        words=words,
        place=place,
        relative=True,
        acts_on=acts_on,
        needs=needs,
        step=lambda shot, objective: RELATIVE,
    )


INPUTS: dict[str, Input] = {
    one.key: one
    for one in (
        Input(
            key="poisson",
            words="Poisson’s ratio",
            place="[model] poisson",
            acts_on="model",
            step=_poisson,
        ),
        Input(
            key="damping",
            words="stiffness-proportional damping",
            place="[model] damping",
            unit="s",
            acts_on="model",
            step=_damping,
        ),
        Input(
            key="friction",
            words="Coulomb friction",
            place="[interface] friction",
            acts_on="model",
            step=_friction,
        ),
        _share("curve_scale", "scale of the quasi-static stress", "[curve] stress", acts_on="model"),
        _share("specimen_diameter", "specimen’s diameter", "[specimen] diameter", acts_on="model"),
        _share("specimen_length", "specimen’s length", "[specimen] length", acts_on="model"),
        _share("specimen_density", "specimen’s density", "[specimen] density", acts_on="model"),
        _share(
            "sensitivity",
            "sensitivity of the force",
            "[force] sensitivity",
            acts_on="data",
            needs="force channel",
        ),
        Input(
            key="force_zero",
            words="zero of the force",
            place="[force] baseline",
            unit="N",
            acts_on="data",
            step=_zero,
        ),
        Input(
            key="clock_offset",
            words="clock of the force against the cameras’",
            place="[force] clock_offset",
            unit="s",
            acts_on="data",
            needs="force channel",
            step=_clock,
        ),
        Input(
            key="outline_clock",
            words="clock of the outline against force and flyer",
            place="[centre_line] time",
            unit="s",
            acts_on="data",
            needs="outline",
            step=_clock,
        ),
        Input(
            key="flyer_clock",
            words="clock of the flyer against force and outline",
            place="[flyer] time",
            unit="s",
            acts_on="model",
            step=_clock,
        ),
        Input(
            key="Z_offset",
            words="axis of the outline, Z",
            place="[centre_line] Z_offset",
            unit="m",
            acts_on="data",
            needs="outline",
            step=_offset,
        ),
        Input(
            key="y_offset",
            words="height of the outline, y",
            place="[centre_line] y_offset",
            unit="m",
            acts_on="data",
            needs="outline",
            step=_offset,
        ),
    )
}
"""The inputs by key, in the order of tables."""


def plain_amount(key: str, value: float) -> float:
    """A plain amount of an input, in its unit or relative: 1 %, 1 us, 10 um; of the other constants the power
    of ten that is not above a hundredth of its distance from 1/2 (Poisson's ratio) or 0.01.

    ``key``: the input. ``value``: its value in SI; only Poisson's ratio needs it.
    """
    one = INPUTS[key]
    if one.relative:
        return PERCENT
    if key == "poisson":
        return 10.0 ** floor(log10(SHARES["poisson"] * (0.5 - value)) + ROUNDING)
    return {"s": CLOCK, "m": OFFSET}.get(one.unit, PERCENT)


def no_part(key: str, *, free: Iterable[str], held: Iterable[str], shot: Shot, seen: Observations) -> str:
    """The reason why an input has no part, or none of its own, in this shot's answer; empty if it has."""
    if key in free:
        return "free, found from the data"
    laws = {shot.interface.faces, shot.interface.side}
    p = PARAMETERS.get(key)
    if p is not None and key not in held and not has_effect(p, laws):
        return f"no part: {p.without}"
    needs = INPUTS[key].needs
    if needs == "force channel" and not isinstance(shot.force, ForceChannel):
        return "no part: the force is from the bar's waves"
    if needs == "outline" and not seen.has_shape:
        return "no part: no outline was measured"
    return ""
