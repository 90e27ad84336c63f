"""An input that may be wrong, and what changing it does to a simulation and to what is made of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import hypot, inf, isfinite, nan
from typing import TYPE_CHECKING

from kolsky.base.apparatus import SLIDING_LAW
from kolsky.diagnosis.alterations import UNALTERED, Alteration
from kolsky.inverse.cause_results import COVERAGE
from kolsky.inverse.parameters import PARAMETERS, any_slides
from kolsky.shot.records import ForceChannel

if TYPE_CHECKING:
    from kolsky.inverse.staged_runs import StagedRuns

SENSITIVITY, DENSITY, LENGTH, DIAMETER = (
    "force.sensitivity",
    "specimen.density",
    "specimen.length",
    "specimen.diameter",
)
POISSON, DAMPING, KIND = "model.poisson", "model.damping", "model.mass_damping"
FORCE_CLOCK, OUTLINE_CLOCK, FLYER_CLOCK = "force.clock_offset", "centre_line.time", "flyer.time"
BASELINE, SCALE, SPREAD = "force.baseline", "flyer.displacement", "flyer tilt"
Y_OFFSET, Z_OFFSET, INTERFACE = "centre_line.y_offset", "centre_line.Z_offset", "interface.faces"


@dataclass(frozen=True)
class Changed:
    """An input at another value: what is simulated and what is made of it."""

    values: Mapping[str, float] = field(default_factory=dict)
    """Parameters of the simulation at other values than the shot's."""
    specimen: Mapping[str, float] = field(default_factory=dict)
    """Factors on fields of the specimen."""
    motion: float = 1.0
    """Factor on the motion of the front face."""
    alteration: Alteration = UNALTERED
    """Change of the predictions."""


def together(first: Changed, second: Changed) -> Changed:
    """Both changes at once; of what both change, the second's value holds, factors multiply."""
    factors = dict(first.specimen)
    for name, factor in second.specimen.items():
        factors[name] = factors.get(name, 1.0) * factor
    return Changed(
        values={**first.values, **second.values},
        specimen=factors,
        motion=first.motion * second.motion,
        alteration=first.alteration.then(second.alteration),
    )


DECLARED = Changed()
"""Everything as the shot declares it."""


def _plain(u: float) -> float:
    return u


@dataclass(frozen=True, kw_only=True)
class CandidateInput:
    """One input that may be wrong, as a coordinate u in which the response is nearly linear."""

    key: str
    """Key of shot.toml, or what else is wrong."""
    words: str
    """What is changed, as a sentence begins: "a factor on the force"."""
    unit: str = "1"
    """Unit of the value."""
    check: str
    """What to check, as a sentence ends: "check force.sensitivity"."""
    scan: tuple[float, ...]
    """Values of the coordinate that are tried before the search, far from what is declared."""
    finer: float = 0.0
    """Distance of the values tried about the best of those, where its basin is narrow; 0 for none."""
    step: float
    """Step of the coordinate for differences."""
    typical: float
    """Standard uncertainty that is usual where none is declared, in the value's unit; orders what the data
    cannot tell apart."""
    changed: Callable[[float], Changed]
    """The input at a coordinate."""
    allowance: float = 0.0
    """Standard uncertainty that is granted beside the declared one: what no laboratory can know better."""
    onset: bool = False
    """Whether what the flyer's path leaves open of its onset is granted too: where no frame shows it, a force
    or a flyer that seems late by as much is no wrong clock."""
    declared: str = ""
    """Its key in [uncertainty]; empty if it has none."""
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
    parameter: str = ""
    """The parameter of the simulation that it is; then `exact` is what is held."""
    simulated: bool = False
    """Whether other runs are needed."""
    force: bool = False
    """Whether it acts on the force alone."""
    outline: bool = False
    """Whether it acts on the outline alone."""

    def here(self, stages: StagedRuns) -> bool:
        """True if it can be tried on this shot: measured, held, and with an effect."""
        shot, settings = stages.prepared.forward.shot, stages.settings
        slides = any_slides([*stages.box.names, *settings.held]) or shot.interface.faces == SLIDING_LAW
        if self.parameter in stages.box.names:
            return False
        if self.outline and not stages.observations.has_shape:
            return False
        if self.key == BASELINE:
            return isinstance(shot.force, ForceChannel)
        if self.key == INTERFACE:
            return not slides
        return True

    def start(self, stages: StagedRuns) -> float:
        """Coordinate of what is declared; NaN where that is no value of it."""
        return nan if self.exact != self.exact else self.coordinate(self.held(stages))

    def held(self, stages: StagedRuns) -> float:
        """What is declared, in the value's unit."""
        if not self.parameter:
            return self.exact
        shot, held = stages.prepared.forward.shot, stages.settings.held
        return held.get(self.parameter, PARAMETERS[self.parameter].held(shot))

    def sigma(self, stages: StagedRuns) -> float:
        """Declared standard uncertainty in the value's unit, with what is granted; 0 if neither is."""
        declared = stages.prepared.forward.shot.uncertainty.get(self.declared, 0.0)
        return hypot(declared, self.allowance, stages.prepared.path.sigma_onset if self.onset else 0.0)

    def within(self, stages: StagedRuns) -> tuple[float, float] | None:
        """Coordinates, the smaller first, within k = 2 of what is declared; None where nothing is."""
        middle, half = self.held(stages), COVERAGE * self.sigma(stages)
        if not (half > 0.0 and isfinite(half) and isfinite(middle)):
            return None
        ends = sorted(self.value(u) for u in (self.lowest, self.highest))
        low, high = (min(max(v, ends[0]), ends[1]) for v in (middle - half, middle + half))
        one, other = sorted((self.coordinate(low), self.coordinate(high)))
        return (one, other) if one < other else None
