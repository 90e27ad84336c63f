"""The record of a shot's input: what it is, what it changes, how it is tried as a cause.

`kolsky.shot.inputs` has the list.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import hypot, inf, isnan, nan
from typing import Any, Literal, Protocol

from kolsky.base.arrays import FloatArray
from kolsky.shot.records import Shot

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
    """The force is this many times the simulated one [-]."""
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
    """Changes of the quasi-static curve, see `kolsky.shot.corrections`."""

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
