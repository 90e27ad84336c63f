"""The inputs that are tried as causes of a misfit: one record each, one entry makes a new one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import expm1, hypot, inf, log, log1p, nan
from typing import TYPE_CHECKING

from kolsky.base.apparatus import SLIDING_LAW
from kolsky.diagnosis.alterations import UNALTERED, Alteration
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
        return hypot(declared, self.allowance)


def _factor(name: str) -> Callable[[float], Changed]:
    return lambda u: Changed(specimen={name: 1.0 + u})


def _one_more(u: float) -> float:
    return 1.0 + u


def _one_less(value: float) -> float:
    return value - 1.0


_STEPS = tuple(5e-6 * n for n in range(-12, 13) if n)
"""Lags that are tried [s]."""
_SHARES = (-0.1, -0.05, -0.025, 0.025, 0.05, 0.1)
_RATIOS = (0.1, 0.2, 0.35, 0.5, 0.7, 0.85, 1.2, 1.45, 2.0, 3.0, 5.0, 10.0)

CANDIDATES: tuple[CandidateInput, ...] = (
    CandidateInput(
        key=SENSITIVITY,
        words="a force gain",
        check="check force.sensitivity",
        scan=_RATIOS,
        step=1e-3,
        typical=0.03,
        # The force that was evaluated, times the gain, is the simulated one.
        changed=lambda u: Changed(alteration=Alteration(force_factor=u)),
        declared="sensitivity",
        value=lambda u: 1.0 / u,
        coordinate=lambda value: 1.0 / value,
        lowest=0.01,
        highest=100.0,
        exact=1.0,
        force=True,
    ),
    CandidateInput(
        key=BASELINE,
        words="a zero of the force",
        unit="N",
        check="check force.baseline: no force may act in it",
        scan=(),
        step=0.1,
        typical=0.1,
        changed=lambda u: Changed(alteration=Alteration(force_offset=u)),
        force=True,
    ),
    CandidateInput(
        key=FORCE_CLOCK,
        words="a lag of the force",
        unit="s",
        check="check force.clock_offset and frames.clock_offset",
        scan=_STEPS,
        step=1e-6,
        typical=3e-6,
        changed=lambda u: Changed(alteration=Alteration(force_lag=u)),
        declared="clock_offset",
        force=True,
    ),
    CandidateInput(
        key=OUTLINE_CLOCK,
        words="a lag of the outline",
        unit="s",
        check="check the times and frame numbers of centre_line.file",
        scan=_STEPS,
        step=1e-6,
        typical=2e-6,
        changed=lambda u: Changed(alteration=Alteration(outline_lag=u)),
        outline=True,
    ),
    CandidateInput(
        key=FLYER_CLOCK,
        words="a lag of the flyer's record",
        unit="s",
        check="check the times and frame numbers of flyer.file",
        scan=_STEPS,
        step=1e-6,
        typical=2e-6,
        changed=lambda u: Changed(alteration=Alteration(force_lag=-u, outline_lag=-u)),
    ),
    CandidateInput(
        key=SCALE,
        words="a factor on the flyer's displacement",
        check="check flyer.displacement: its unit, and the scale of the pictures",
        scan=_SHARES,
        step=2e-3,
        typical=0.003,
        changed=lambda u: Changed(motion=1.0 + u),
        value=_one_more,
        coordinate=_one_less,
        lowest=-0.5,
        highest=0.5,
        exact=1.0,
        simulated=True,
    ),
    CandidateInput(
        key=POISSON,
        words="another Poisson's ratio",
        check="check model.poisson, or free it",
        scan=tuple(-8.3 + 0.2 * n for n in range(31)),
        finer=0.03,
        step=0.02,
        typical=0.0005,
        changed=lambda u: Changed(values={"poisson": -0.5 * expm1(u)}),
        declared="poisson",
        value=lambda u: -0.5 * expm1(u),
        coordinate=lambda value: log1p(-2.0 * value),
        lowest=log(2e-4 * (1.0 + 1e-9)),
        highest=log(0.3),
        parameter="poisson",
        simulated=True,
    ),
    CandidateInput(
        key=DAMPING,
        words="another damping",
        unit="s",
        check="check model.damping, or free it",
        scan=(0.0, 5e-6, 1e-5, 1.5e-5, 2e-5, 2.7e-5, 3.5e-5, 5e-5, 7e-5, 1e-4, 1.5e-4),
        step=1e-6,
        typical=1e-5,
        changed=lambda u: Changed(values={"damping": u}),
        declared="damping",
        lowest=0.0,
        highest=1e-3,
        parameter="damping",
        simulated=True,
    ),
    CandidateInput(
        key=KIND,
        words="a damping proportional to mass beside it",
        unit="1/s",
        check="the material may be damped otherwise than model.damping says",
        scan=(50.0, 150.0, 400.0, 1000.0, 2500.0),
        step=20.0,
        typical=20.0,
        changed=lambda u: Changed(values={"mass_damping": u}),
        lowest=0.0,
        highest=1e4,
        parameter="mass_damping",
        simulated=True,
    ),
    CandidateInput(
        key=LENGTH,
        words="a factor on the specimen's length",
        check="check specimen.length",
        scan=_SHARES,
        step=2e-3,
        typical=0.01,
        changed=_factor("length"),
        declared="specimen_length",
        value=_one_more,
        coordinate=_one_less,
        lowest=-0.3,
        highest=0.3,
        exact=1.0,
        simulated=True,
    ),
    CandidateInput(
        key=DIAMETER,
        words="a factor on the specimen's diameter",
        check="check specimen.diameter",
        scan=_SHARES,
        step=2e-3,
        typical=0.005,
        changed=_factor("diameter"),
        declared="specimen_diameter",
        value=_one_more,
        coordinate=_one_less,
        lowest=-0.3,
        highest=0.3,
        exact=1.0,
        simulated=True,
    ),
    CandidateInput(
        key=DENSITY,
        words="a factor on the specimen's density",
        check="check specimen.density",
        scan=(),
        step=0.01,
        typical=0.01,
        changed=_factor("density"),
        declared="specimen_density",
        value=_one_more,
        coordinate=_one_less,
        lowest=-0.9,
        highest=9.0,
        exact=1.0,
        simulated=True,
    ),
    CandidateInput(
        key=Y_OFFSET,
        words="an offset of the outline's height",
        unit="m",
        check="check centre_line.y_offset",
        scan=(-3e-4, -1e-4, 1e-4, 3e-4),
        step=1e-5,
        typical=1e-4,
        changed=lambda u: Changed(alteration=Alteration(y_offset=u)),
        declared="y_offset",
        lowest=-1e-3,
        highest=1e-3,
        outline=True,
    ),
    CandidateInput(
        key=Z_OFFSET,
        words="an offset of the outline from the axis",
        unit="m",
        check="check centre_line.Z_offset",
        scan=(),
        step=1e-5,
        typical=2e-5,
        changed=lambda u: Changed(alteration=Alteration(Z_offset=u)),
        declared="Z_offset",
        outline=True,
    ),
    CandidateInput(
        key=SPREAD,
        words="a contact that spreads over the face, or a slow force channel",
        unit="s",
        check="check the flyer's tilt, and the bandwidth of the force channel",
        scan=(2.5e-11, 1e-10, 4e-10, 1.6e-9),
        step=2.5e-11,
        allowance=8e-6,  # a frame: the flyer's onset between two of them is the fitted path's
        typical=5e-6,
        changed=lambda u: Changed(alteration=Alteration(spread=max(u, 0.0) ** 0.5)),
        value=lambda u: max(u, 0.0) ** 0.5,
        coordinate=lambda value: value**2,
        lowest=0.0,
        highest=1e-8,
        force=True,
    ),
    CandidateInput(
        key=INTERFACE,
        words="faces that slide, with a friction coefficient",
        check="check interface.faces: did the specimen stick?",
        scan=(0.1, 0.3, 1.0),
        step=0.02,
        typical=inf,
        changed=lambda u: Changed(values={"friction": u}),
        lowest=0.0,
        highest=3.0,
        exact=nan,
        simulated=True,
    ),
)
"""Every input that is tried, in the order of the tables; registry."""

WITHOUT_TRACE = (
    "The scale of the quasi-static curve leaves no residual: m times the curve is all that is seen. A curve "
    "5 % too low gives an m 5 % too high, and nothing here can tell.",
)
"""What no table of causes can show."""
