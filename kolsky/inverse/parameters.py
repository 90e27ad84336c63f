"""The parameters that a simulation of a shot can vary: one record each, one entry makes a new one.

All that is asked of a parameter by name is in its record: ranges, units, symbols, the value that a shot
declares, how it enters the solver's samples, which contact laws read it. Nothing heavy is imported here, so
that a command line can list the names.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from kolsky.base.apparatus import SLIDING_LAW
from kolsky.inverse.parameter import Fields as Fields
from kolsky.inverse.parameter import Parameter as Parameter
from kolsky.inverse.relaxation_parameters import RELAXING

if TYPE_CHECKING:
    from doe import Box
    from kolsky.shot.records import Shot

MOVED = "stiffness_factor"
"""The parameter that every search of a shot moves, alone where the others are held."""

PARAMETERS: dict[str, Parameter] = {
    p.name: p
    for p in (
        Parameter(
            name="stiffness_factor",
            words="stiffness factor, dynamic over quasi-static modulus",
            symbol="m",
            written="m",
            tex="m",
            lower=0.5,
            upper=2.5,
            allowed=(1e-3, 1e3),
            held=lambda shot: 1.0,
        ),
        Parameter(
            name="friction",
            words="Coulomb friction between specimen and platens",
            symbol="f",
            written="f",
            tex="f",
            lower=0.0,
            upper=2.0,
            allowed=(0.0, 1e3),
            held=lambda shot: shot.interface.friction,
            uncertainty=True,
            slides=True,
            read_by="needs_friction",
            without="nothing slides",
            changed=lambda shot, value: replace(shot, interface=replace(shot.interface, friction=value)),
        ),
        Parameter(
            name="poisson",
            words="Poisson’s ratio of the initial state",
            symbol="nu",
            written="ν",
            tex=r"\nu",
            lower=0.49,
            upper=0.4999,
            allowed=(0.0, 0.4999),
            held=lambda shot: shot.model.poisson,
            uncertainty=True,
        ),
        Parameter(
            name="damping",
            words="stiffness-proportional damping",
            symbol="beta",
            written="β",
            tex=r"\beta",
            unit="s",
            shown_unit="µs",
            shown_factor=1e6,
            lower=0.0,
            upper=1e-4,
            allowed=(0.0, 1e-2),
            held=lambda shot: shot.model.damping,
            uncertainty=True,
        ),
        Parameter(
            name="mass_damping",
            words="mass-proportional damping",
            symbol="alpha",
            written="α",
            tex=r"\alpha",
            unit="1/s",
            shown_unit="1/s",
            lower=0.0,
            upper=100.0,
            allowed=(0.0, 1e6),
            held=lambda shot: shot.model.mass_damping,
        ),
        Parameter(
            name="release_stress",
            words="tensile stress at which a bonded face lets go",
            symbol="sigma_b",
            written="σ_b",
            tex=r"\sigma_b",
            unit="Pa",
            shown_unit="kPa",
            shown_factor=1e-3,
            lower=0.0,
            upper=2e5,
            allowed=(0.0, 1e9),
            held=lambda shot: shot.interface.release_stress,
            read_by="needs_release_stress",
            without="no face lets go",
        ),
        *RELAXING,
    )
}
"""The parameters by name."""


def parameter(name: str) -> Parameter:
    """Look a parameter up.

    Raises
    ------
    ValueError
        If there is no such parameter; the message lists those there are.
    """
    if name not in PARAMETERS:
        raise ValueError(f"there is no parameter {name!r}; choose from {', '.join(PARAMETERS)}")
    return PARAMETERS[name]


def checked_value(name: str, value: float) -> float:
    """A value inside the parameter's allowed range.

    Raises
    ------
    ValueError
        If it is outside; the message names value, range and unit.
    """
    p = parameter(name)
    low, high = p.allowed
    if not low <= value <= high:
        unit = "" if p.unit == "1" else f" {p.unit}"
        raise ValueError(
            f"{name} = {value:.9g}{unit} is not allowed; it must be in [{low:g}, {high:g}]{unit}"
        )
    return float(value)


def any_slides(names: Iterable[str]) -> bool:
    """True if one of these parameters makes the surfaces slide by Coulomb's law once it is named."""
    return any(PARAMETERS[name].slides for name in names if name in PARAMETERS)


def require_declared(names: Iterable[str], shot: Shot) -> None:
    """Refuse constants of what relaxes that the shot does not have.

    Raises
    ------
    ValueError
        If one is named and the shot's [relaxation] has no such constant.
    """
    for name in names:
        if parameter(name).belongs_to(shot):
            continue
        has = "no [relaxation]" if shot.relaxation is None else f"{shot.relaxation.words} in its [relaxation]"
        raise ValueError(
            f"{name} has no effect: the shot declares {has}; declare it there, or give --relaxation "
            'prony, "prony:2" or bergstrom_boyce'
        )


def has_effect(p: Parameter, laws: Iterable[str]) -> bool:
    """True if a contact law among these, by name, reads the parameter, or if it needs none."""
    if not p.read_by:
        return True
    from explicit.contact import CONTACT_LAWS

    return any(name in CONTACT_LAWS and getattr(CONTACT_LAWS[name], p.read_by) for name in laws)


def require_effect(names: Iterable[str], faces: str, side: str) -> None:
    """Refuse parameters that would have no effect with the contact laws of end faces and side surface.

    Raises
    ------
    ValueError
        If one is read by neither law, and none that makes the surfaces slide is named with it; or if it is
        named beside one that does.
    """
    given = [parameter(name) for name in names]
    sliding = [p for p in given if p.slides]
    for p in given:
        if not p.read_by or p.slides:
            continue
        if sliding and not has_effect(p, [SLIDING_LAW]):
            raise ValueError(
                f"{p.name} has no effect beside {sliding[0].name}, which makes everything slide by Coulomb's "
                "law: name one of them"
            )
        if not sliding and not has_effect(p, [faces, side]):
            from explicit.contact import CONTACT_LAWS

            able = " or ".join(f'"{name}"' for name in CONTACT_LAWS if has_effect(p, [name]))
            raise ValueError(
                f"{p.name} has no effect with the interface that the shot declares (faces {faces}, side "
                f"{side}): choose the law {able} in its [interface]"
            )


def design_box(bounds: Mapping[str, tuple[float, float] | None]) -> Box:
    """The box of a design: given bounds, or the default ones where a bound is None.

    Raises
    ------
    ValueError
        If a name is unknown, a bound is outside the allowed range or the bounds are not ascending.
    """
    from doe import Box

    filled = {}
    for name, pair in bounds.items():
        p = parameter(name)
        low, high = pair if pair is not None else (p.lower, p.upper)
        filled[name] = (checked_value(name, low), checked_value(name, high))
        if not low < high:
            raise ValueError(f"{name}: the lower bound {low:.9g} must be below the upper bound {high:.9g}")
    return Box.of(filled)
