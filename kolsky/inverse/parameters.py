"""Parameters that a simulation of a shot can vary, one record each, including constants of relaxation.

A new parameter is one entry of `PARAMETERS`: its unit, range, default design, and the field of
`explicit.Samples` that it enters. `what_relaxes` converts named constants of a Prony series or of a
Bergström-Boyce network into the solver's input.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from math import nan
from typing import TYPE_CHECKING, Any

from kolsky.base.apparatus import (
    LARGEST_POISSON,
    MOST_BRANCHES,
    NETWORK_CONSTANTS,
    NETWORK_DEFAULTS,
    NETWORK_FREE,
    SLIDING_LAW,
    Interface,
    Relaxation,
    RelaxationKind,
    prony_names,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from doe import Box
    from explicit.relaxation.base import RateDependence
    from kolsky.base.arrays import FloatArray
    from kolsky.shot.records import Shot


Fields = Mapping[str, Any]
"""Fields of `explicit.Samples` by name: numbers, or arrays of shape [n_samples]."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter of the simulated test."""

    name: str
    """Name at the API and the command line."""
    words: str
    """Description, as used in tables and on axes of the report."""
    symbol: str
    """Symbol in plain text of the command line."""
    written: str
    """Symbol in the text of pages."""
    tex: str
    """Symbol in figures and documentation, without dollar signs."""
    unit: str = "1"
    """SI unit, "1" if none."""
    shown_unit: str = "1"
    """Unit in which pages and figures show it."""
    shown_factor: float = 1.0
    """Shown number over the number in SI."""
    lower: float
    """Lower bound of the default design."""
    upper: float
    """Upper bound of the default design."""
    allowed: tuple[float, float]
    """Range of allowed values; others are rejected."""
    held: Callable[[Shot], float]
    """The value that a shot declares for it."""
    enters: Callable[[Fields, Any], Fields] | None = None
    """Function that enters a value into the solver's samples; with None, the field of its name is set."""
    uncertainty: bool = False
    """True if [uncertainty] of shot.toml has a key of this name."""
    slides: bool = False
    """True if naming the parameter makes faces and side slide by Coulomb's law, whatever is declared."""
    read_by: str = ""
    """Field of `explicit.contact.ContactLaw`, true if a law reads the parameter; empty if none must."""
    without: str = ""
    """The reason, in words, why it has no effect without a contact law that reads it."""
    scale: Callable[[float], float] | None = None
    """A large change from a value, in its unit; None: `explicit.model.scale_of`."""
    changed: Callable[[Shot, float], Shot] | None = None
    """The shot with another declared value, if naming the parameter does more than changing it."""
    logarithmic: bool = False
    """True if a search uses its logarithm because its range spans decades."""
    relaxes: bool = False
    """True if it is a constant of the relaxation. Only a shot with such a [relaxation] has the parameter."""

    def belongs_to(self, shot: Shot) -> bool:
        """True if the shot has the parameter; only constants of the relaxation may be missing."""
        return not self.relaxes or (shot.relaxation is not None and self.name in shot.relaxation.values)


_MICROSECONDS: dict[str, Any] = {"unit": "s", "shown_unit": "µs", "shown_factor": 1e6}
_KILOPASCALS: dict[str, Any] = {"unit": "Pa", "shown_unit": "kPa", "shown_factor": 1e-3}


def _constant(
    name: str,
    words: str,
    symbols: tuple[str, str, str],
    design: tuple[float, float],
    allowed: tuple[float, float],
    **more: Any,
) -> Parameter:
    """A constant of the relaxation; its declared value is NaN for a shot that has no such constant."""
    symbol, written, tex = symbols
    return Parameter(
        name=name,
        words=words,
        symbol=symbol,
        written=written,
        tex=tex,
        lower=design[0],
        upper=design[1],
        allowed=allowed,
        held=lambda shot: nan if shot.relaxation is None else shot.relaxation.values.get(name, nan),
        relaxes=True,
        **more,
    )


def _branch(k: int) -> tuple[Parameter, Parameter]:
    """Strength and relaxation time of the k-th branch of a Prony series."""
    strength = f"strength of the Prony branch {k}, its modulus over the long-term one"
    time = f"relaxation time of the Prony branch {k}"
    c, tau = (f"c_{k}",) * 3, (f"tau_{k}", f"τ_{k}", rf"\tau_{k}")
    scale = partial(max, 0.1)
    return (
        _constant(f"prony_strength_{k}", strength, c, (0.0, 2.0), (0.0, 1e3), scale=scale),
        _constant(f"prony_time_{k}", time, tau, (2e-5, 5e-3), (1e-7, 1e6), **_MICROSECONDS, logarithmic=True),
    )


# fmt: off
RELAXING: tuple[Parameter, ...] = (
    *(one for k in range(1, MOST_BRANCHES + 1) for one in _branch(k)),
    _constant(
        "creep_ratio", "stiffness of the creeping network over the long-term law", ("s",) * 3,
        (0.0, 2.0), (0.0, 1e3),
    ),
    _constant(
        "creep_resistance", "stress at which the creeping network flows", ("tau_hat", "τ̂", r"\hat\tau"),
        (5e2, 1e5), (1e-3, 1e12), **_KILOPASCALS, logarithmic=True,
    ),
    _constant(
        "creep_exponent", "exponent of the creeping network’s stress", ("n",) * 3, (1.0, 10.0), (1.0, 50.0),
    ),
    _constant("creep_chain_exponent", "exponent of the previous creep", ("C",) * 3, (-1.0, 0.0), (-1.0, 0.0)),
    _constant(
        "creep_first", "stretch that keeps the first creep finite", ("xi", "xi", r"\xi"),
        (1e-3, 0.1), (1e-9, 1.0),
    ),
)
"""Constants of the relaxation; a shot has those of its [relaxation]."""


MOVED = "stiffness_factor"
"""The parameter that every search of a shot varies. It is free even if all others are held."""

PARAMETERS: dict[str, Parameter] = {
    p.name: p
    for p in (
        Parameter(
            name="stiffness_factor", words="stiffness factor, dynamic over quasi-static modulus",
            symbol="m", written="m", tex="m", lower=0.5, upper=2.5, allowed=(1e-3, 1e3),
            held=lambda shot: 1.0,
        ),
        Parameter(
            name="friction", words="Coulomb friction between specimen and platens",
            symbol="f", written="f", tex="f", lower=0.0, upper=2.0, allowed=(0.0, 1e3),
            held=lambda shot: shot.interface.friction, uncertainty=True, slides=True,
            read_by="needs_friction", without="nothing slides",
            changed=lambda shot, value: replace(shot, interface=replace(shot.interface, friction=value)),
        ),
        Parameter(
            name="poisson", words="Poisson’s ratio of the initial state",
            symbol="nu", written="ν", tex=r"\nu", lower=0.49, upper=0.4999, allowed=(0.0, LARGEST_POISSON),
            held=lambda shot: shot.model.poisson, uncertainty=True,
        ),
        Parameter(
            name="damping", words="stiffness-proportional damping",
            symbol="beta", written="β", tex=r"\beta", lower=0.0, upper=1e-4, allowed=(0.0, 1e-2),
            held=lambda shot: shot.model.damping, uncertainty=True, **_MICROSECONDS,
        ),
        Parameter(
            name="mass_damping", words="mass-proportional damping", unit="1/s", shown_unit="1/s",
            symbol="alpha", written="α", tex=r"\alpha", lower=0.0, upper=100.0, allowed=(0.0, 1e6),
            held=lambda shot: shot.model.mass_damping,
        ),
        Parameter(
            name="release_stress", words="tensile stress at which a bonded face is released",
            symbol="sigma_b", written="σ_b", tex=r"\sigma_b", lower=0.0, upper=2e5, allowed=(0.0, 1e9),
            held=lambda shot: shot.interface.release_stress, **_KILOPASCALS,
            read_by="needs_release_stress", without="no face lets go",
        ),
        *RELAXING,
    )
}
# fmt: on
"""The parameters by name."""


def parameter(name: str) -> Parameter:
    """Look up a parameter by name. Raises ValueError with the list of all parameters if there is none."""
    if name not in PARAMETERS:
        raise ValueError(f"there is no parameter {name!r}; choose from {', '.join(PARAMETERS)}")
    return PARAMETERS[name]


def checked_value(name: str, value: float) -> float:
    """A value in the parameter's allowed range. Raises ValueError with value, range and unit if not."""
    p = parameter(name)
    low, high = p.allowed
    if not low <= value <= high:
        unit = "" if p.unit == "1" else f" {p.unit}"
        raise ValueError(
            f"{name} = {value:.9g}{unit} is not allowed; it must be in [{low:g}, {high:g}]{unit}"
        )
    return float(value)


def any_slides(names: Iterable[str]) -> bool:
    """True if naming one of these parameters makes the surfaces slide by Coulomb's law."""
    return any(PARAMETERS[name].slides for name in names if name in PARAMETERS)


def slides(interface: Interface, names: Iterable[str]) -> bool:
    """True if a surface slides with friction: as declared, or because a named parameter makes it so."""
    from explicit.contact import contact_law

    declared = (interface.faces, interface.side)
    return any_slides(names) or any(contact_law(law).needs_friction for law in declared)


def require_declared(names: Iterable[str], shot: Shot) -> None:
    """Raise ValueError for a constant of the relaxation that the shot's [relaxation] does not have."""
    for name in names:
        if parameter(name).belongs_to(shot):
            continue
        has = "no [relaxation]" if shot.relaxation is None else f"{shot.relaxation.words} in its [relaxation]"
        raise ValueError(
            f"{name} has no effect: the shot declares {has}; declare it there, or give --relaxation "
            'prony, "prony:2" or bergstrom_boyce'
        )


def has_effect(p: Parameter, laws: Iterable[str]) -> bool:
    """True if one of these contact laws, by name, uses the parameter, or if its effect needs none."""
    if not p.read_by:
        return True
    from explicit.contact import CONTACT_LAWS

    return any(name in CONTACT_LAWS and getattr(CONTACT_LAWS[name], p.read_by) for name in laws)


def require_effect(names: Iterable[str], faces: str, side: str) -> None:
    """Raise ValueError if a parameter has no effect with the contact laws of faces and side.

    That is so if no law reads it and nothing slides, or if it is named together with one that slides.
    """
    given = [parameter(name) for name in names]
    sliding = [p for p in given if p.slides]
    for p in given:
        if not p.read_by or p.slides:
            continue
        if sliding and not has_effect(p, [SLIDING_LAW]):
            raise ValueError(
                f"{p.name} has no effect together with {sliding[0].name}, with which all surfaces slide "
                "by Coulomb's law: name one of them"
            )
        if not sliding and not has_effect(p, [faces, side]):
            from explicit.contact import CONTACT_LAWS

            able = " or ".join(f'"{name}"' for name in CONTACT_LAWS if has_effect(p, [name]))
            raise ValueError(
                f"{p.name} has no effect with the interface that the shot declares (faces {faces}, side "
                f"{side}): choose the law {able} in its [interface]"
            )


def design_box(bounds: Mapping[str, tuple[float, float] | None]) -> Box:
    """The box of a design: given bounds, with default ones for None.

    Raises ValueError for an unknown name, or bounds that are outside the allowed range or not ascending.
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


START_STRENGTH = 0.2
"""Initial strength of a branch, or ratio of a network, in a search without a declared value [-]."""
START_SHARES = {1: (0.25,), 2: (0.08, 0.6), 3: (0.04, 0.2, 1.0)}
"""Initial relaxation times of a search, divided by the duration of the window [-], by number of branches."""
START_STRESS = 0.5
"""Initial resistance of a network in a search, divided by the largest stress of the curve [-]."""


def what_relaxes(fields: Fields, relaxation: Relaxation | None) -> tuple[Fields, tuple[RateDependence, ...]]:
    """Replace the constants of the relaxation in the samples' fields by an index of a material.

    ``fields``: of `explicit.Samples`, with a value, scalar or [n_samples], of every constant of
    ``relaxation``; None leaves them unchanged. Returns: the fields with "relaxation", an index per sample,
    and the different materials for `explicit.Model.relaxation`.
    """
    if relaxation is None:
        return fields, ()
    import numpy as np

    from explicit.relaxation import relaxation_of

    names = prony_names(relaxation.branches) if relaxation.kind == "prony" else NETWORK_CONSTANTS
    columns = np.broadcast_arrays(*(np.atleast_1d(np.asarray(fields[name], dtype=float)) for name in names))
    rows, index = np.unique(np.stack(columns, axis=1), axis=0, return_inverse=True)
    rest = {name: value for name, value in fields.items() if name not in names}
    choice = index.ravel() if len(index) > 1 else int(index.ravel()[0])
    return {**rest, "relaxation": choice}, tuple(relaxation_of(relaxation.kind, row.tolist()) for row in rows)


def with_relaxation(shot: Shot, kind: RelaxationKind, branches: int = 1) -> Shot:
    """The shot with a free relaxation instead of the declared one; initial values by window, curve.

    ``branches``: of a Prony series, 1 to `kolsky.base.apparatus.MOST_BRANCHES`, otherwise ValueError.
    """
    if kind == "bergstrom_boyce":
        largest = float(abs(shot.curve.stress).max())
        values = {
            "creep_ratio": START_STRENGTH,
            "creep_resistance": START_STRESS * largest,
            **NETWORK_DEFAULTS,
        }
        return replace(shot, relaxation=Relaxation(kind, values, free=True))
    if branches not in START_SHARES:
        raise ValueError(f"a Prony series needs 1 to {max(START_SHARES)} branches, got {branches}")
    span = shot.window[1] - shot.window[0]
    times = [share * span for share in START_SHARES[branches]]
    constants = (*[START_STRENGTH] * branches, *times)
    values = dict(zip(prony_names(branches), constants, strict=True))
    return replace(shot, relaxation=Relaxation(kind, values, free=True))


def same_bulk(poisson: ArrayLike, stiffer: ArrayLike) -> FloatArray:
    """Poisson's ratio that keeps the bulk modulus if the instantaneous stiffness increases by a factor [-].

    The bulk modulus, proportional to m (1 + c) / (1 - 2 nu) with the sum c of all strengths, determines the
    frequency of the ringing. If a branch changed it by one percent, the ringing would be out of phase within
    the shot. A free Poisson's ratio compensates this, so it is no effect of the branch.
    """
    import numpy as np  # imported here: the help of commands does not need it

    return np.asarray(0.5 - (0.5 - np.asarray(poisson)) * np.asarray(stiffer), dtype=np.float64)


def reference_words(names: Iterable[str]) -> str:
    """The curve that m refers to, in words, from all parameters of a result; empty without relaxation."""
    there = {name for name in names if name in PARAMETERS and PARAMETERS[name].relaxes}
    if not there:
        return ""
    what = "Bergström and Boyce's network creeps" if there & set(NETWORK_FREE) else "a Prony series relaxes"
    return f"the long-term curve, to which {what}: at high rate the specimen is stiffer than m states"


def parsed_kind(text: str) -> tuple[RelaxationKind, int]:
    """Parse "prony", "prony:2", "bergstrom_boyce". Raises ValueError for another text."""
    kind, _, number = text.partition(":")
    if kind == "prony" and (number or "1") in ("1", "2", "3"):
        return "prony", int(number or 1)
    if text == "bergstrom_boyce":
        return "bergstrom_boyce", 1
    raise ValueError(f'must be prony, prony:2, prony:3 or bergstrom_boyce, got "{text}"')
