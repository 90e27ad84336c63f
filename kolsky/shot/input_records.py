"""Record types for the inputs of a shot: their effects, and the test of each as the cause of a misfit.

The inputs are listed in `kolsky.shot.inputs`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import hypot, inf, isnan, nan
from typing import Any, Literal, Protocol

from kolsky.base.arrays import FloatArray
from kolsky.shot.records import Shot

RELATIVE = 0.0025
"""Relative step of an input that is a scale [-]. A larger step would shift the phase of oscillations. A
smaller one would resolve the roughness of the contact where the side surface rolls onto a platen."""
CLOCK = 1e-6
"""Step of a clock [s]."""
OFFSET = 1e-5
"""Step of a position [m]."""
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
"""Data that a shot must have for an input to have an effect."""


class Model(Protocol):
    """The model's force and outline at the optimum, for effects of inputs without a new simulation."""

    def change(self, *, transmitted: Any = 0.0, force: Any = 0.0, outline: Any = 0.0) -> FloatArray:
        """The change of prediction minus data, from the changes of its parts, shape [k]."""

    def transmitted(self) -> FloatArray:
        """The transmitted force in its bins [N]."""

    def force_rate(self) -> FloatArray:
        """Time derivative of every bin's force [N/s]."""

    def outline_rate(self) -> FloatArray:
        """Time derivative of the radius at every counted point's height [m/s]."""

    def higher(self, step: float) -> FloatArray:
        """Change of the predicted radius if the outline points lie higher by ``step`` [m], shape [k]."""


@dataclass(frozen=True)
class Change:
    """Effect of a changed input: on the simulation, and on the data predicted from it."""

    values: Mapping[str, float] = field(default_factory=dict)
    """Parameters of the simulation with values that differ from the shot's."""
    specimen: Mapping[str, float] = field(default_factory=dict)
    """Factors on fields of the specimen."""
    motion: float = 1.0
    """Factor on the motion of the front face."""
    force_factor: float = 1.0
    """Factor on the simulated force [-]."""
    force_offset: float = 0.0
    """Offset added to the force after the factor [N]."""
    force_lag: float = 0.0
    """Delay of the force [s]."""
    spread: float = 0.0
    """Half the spread of the force's arrival times, as over a tilted round face [s]."""
    outline_lag: float = 0.0
    """Delay of the outline [s]."""
    y_offset: float = 0.0
    """Height of the outline's points above their height in the file [m]."""
    Z_offset: float = 0.0
    """Increase of the points' distance from the axis [m]."""
    mirror: float = nan
    """If heights count down from the other end: that end's height minus the length at rest [m]; else NaN."""
    film: float = 1.0
    """Factor on the times of all frames, counted from the shot's zero."""
    picture: float = 1.0
    """Factor on all lengths in the pictures: the flyer's motion and the outline."""
    time_constant: float = 0.0
    """Time constant of a first-order low-pass filter of the force [s]."""
    leak: float = 0.0
    """Rate at which the charge of the force's transducer leaks [1/s]."""
    flyer_share: float = 0.0
    """Share of the force at the flyer's face that the transmitted force's channel contains [-]."""
    curve: Mapping[str, float] = field(default_factory=dict)
    """Changes of the quasi-static curve, see `kolsky.shot.corrections`."""

    def then(self, other: Change) -> Change:
        """Both changes combined.

        Parameters take the other's value. Factors multiply, the rest adds, spreads in quadrature.
        """
        factors = dict(self.specimen)
        for name, factor in other.specimen.items():
            factors[name] = factors.get(name, 1.0) * factor
        return Change(
            **{name: getattr(self, name) * getattr(other, name) for name in _FACTORS},
            **{name: getattr(self, name) + getattr(other, name) for name in _SUMS},
            values={**self.values, **other.values},
            specimen=factors,
            force_offset=self.force_offset * other.force_factor + other.force_offset,
            spread=hypot(self.spread, other.spread),
            mirror=self.mirror if isnan(other.mirror) else other.mirror,
            curve={**self.curve, **other.curve},
        )

    @property
    def sight(self) -> tuple[float, ...]:
        """Key of the radii that are compared with one simulation: times and places of the outline points."""
        mirror = inf if isnan(self.mirror) else self.mirror  # NaN differs from itself
        return self.outline_lag, self.y_offset, mirror, self.film, self.picture

    @property
    def path(self) -> tuple[float, float]:
        """Key of the motion of the front face: the factors on its displacement and on its times."""
        return self.motion * self.picture, self.film

    @property
    def seen(self) -> tuple[float, ...]:
        """Key of the data predicted from one simulation. Changes with equal predictions have equal keys."""
        force = self.force_factor, self.force_offset, self.force_lag, self.spread
        channel = self.time_constant, self.leak, self.flyer_share
        return *force, *channel, *self.sight, self.Z_offset


_FACTORS = ("motion", "force_factor", "film", "picture")
_SUMS = ("force_lag", "outline_lag", "y_offset", "Z_offset", "time_constant", "leak", "flyer_share")
UNCHANGED = Change()
"""No change: every input has its declared value."""


def _plain(u: float) -> float:
    return u


@dataclass(frozen=True, kw_only=True)
class Cause:
    """An input tested as the cause of a misfit; the response is nearly linear in its coordinate u."""

    key: str
    """Key of shot.toml, or a name for another error; used in results."""
    words: str
    """The changed quantity, as the start of a sentence: "a factor on the force"."""
    check: str
    """The advice, as the end of a sentence: "check force.sensitivity"."""
    changed: Callable[[float], Change]
    """The change at a coordinate."""
    needs: Needs = "nothing"
    """Data that a shot must have for this cause to be tested."""
    scan: tuple[float, ...] = ()
    """Coordinates far from the declared value. They are tried before the search."""
    step: float
    """Step of the coordinate for finite differences."""
    typical: float
    """Usual standard uncertainty if none is declared, in the value's unit; it ranks causes that are alike."""
    mistakes: tuple[float, ...] = ()
    """Values of common mistakes, in the value's unit: a factor of two or ten, another definition."""
    allowance: float = 0.0
    """Standard uncertainty added to the declared one. No laboratory can do better than this limit."""
    onset: bool = False
    """True if the uncertainty of the flyer's onset is added too. If no frame shows the onset, an equal delay
    of the force or the flyer is not a clock error."""
    value: Callable[[float], float] = _plain
    """Value at a coordinate."""
    coordinate: Callable[[float], float] = _plain
    """Coordinate of a value."""
    lowest: float = -inf
    """Smallest coordinate."""
    highest: float = inf
    """Largest coordinate."""
    exact: float = 0.0
    """The value without an error of the input: 1 for a factor, 0 for an offset."""
    simulated: bool = False
    """True if new simulations are needed."""
    unit: str = "1"
    """SI unit of the value. This field and the next two are those of the input."""
    declared: str = ""
    """Its key in [uncertainty], if there is one."""
    parameter: str = ""
    """Name of the simulation parameter, if the input is one; its held value then is that without an error."""


@dataclass(frozen=True)
class Laboratory:
    """Error of an input in a virtual test."""

    key: str
    """Dotted key in the laboratory's specification."""
    usual: str | float | None = None
    """Standard uncertainty in a careful laboratory. None if no error occurs in it."""
    order: int = 99
    """Order among the error sources of a careful laboratory. The random draws depend on this order."""
    words: str = ""
    """Its description in the virtual test. If empty, that of the input is used."""
    anew: bool = False
    """True if the error is drawn for each shot separately, although its declaration covers all shots."""


@dataclass(frozen=True, kw_only=True)
class Input:
    """One input: its description, its key in shot.toml, and the effect of an error."""

    key: str
    """Its key; the key of [uncertainty] if there is one."""
    words: str
    """Its description in tables and sentences."""
    place: str = ""
    """Table and key of shot.toml that declare it; empty if no key declares it."""
    unit: str = "1"
    """SI unit of its step; "1" for a plain number."""
    relative: bool = False
    """True if its step and its uncertainty are relative to its value."""
    shared: str = ""
    """Shots with this in common share the input: "rig", "curve" or "group"; empty if it is not shared."""
    needs: Needs = "nothing"
    """Data that a shot must have for the input's uncertainty to contribute to that of the result."""
    step: float = 0.0
    """Step for its finite difference, in its unit or relative; 0 if it is not varied. For a parameter, the
    step is a share of its scale. For a force, it is a share of the largest force."""
    parameter: str = ""
    """Name of the simulation parameter, if it is one."""
    specimen: str = ""
    """The field of the specimen that the input multiplies, if any."""
    seen: Callable[[Model, float], FloatArray] | None = None
    """Exact first-order change of prediction minus data for a step. None if it needs simulations."""
    applied: Callable[[Shot, float], Shot] | None = None
    """The shot with the input at an estimated value of its `cause`: a factor, a lag or an offset."""
    cause: Cause | None = None
    """Its test as a cause. None if its residual cannot be distinguished from others."""
    laboratory: Laboratory | None = None
    """Its error in a virtual laboratory."""
