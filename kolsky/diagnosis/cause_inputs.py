"""Inputs that are tried as causes of a misfit: the list, what each changes, and the shot with one corrected.

A simulation does not know when its clock started: a flyer's record that is late by L makes every
prediction late by L, and needs no other run. So do scales and offsets of what was measured
(`Alteration`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import expm1, hypot, inf, isfinite, log, log1p, nan
from typing import TYPE_CHECKING

import numpy as np

from explicit import Response
from kolsky.base.apparatus import SLIDING_LAW
from kolsky.base.arrays import FloatArray
from kolsky.base.records import FlyerMotion
from kolsky.inverse.observations import Observations, radius_at
from kolsky.inverse.parameters import PARAMETERS, any_slides
from kolsky.inverse.problem import Settings
from kolsky.inverse.result import COVERAGE, CauseFinding
from kolsky.shot.records import ForceChannel, Shot

if TYPE_CHECKING:
    from kolsky.inverse.staged_runs import StagedRuns


SPREAD_NODES = 7
"""Nodes of the mean over a contact that spreads; exact for polynomials in time of degree 13."""


@dataclass(frozen=True)
class Alteration:
    """A change of the predictions of one run."""

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

    def then(self, other: Alteration) -> Alteration:
        """Both alterations: factors multiply, lags and offsets add, spreads add in quadrature."""
        return Alteration(
            force_factor=self.force_factor * other.force_factor,
            force_offset=self.force_offset * other.force_factor + other.force_offset,
            force_lag=self.force_lag + other.force_lag,
            spread=hypot(self.spread, other.spread),
            outline_lag=self.outline_lag + other.outline_lag,
            y_offset=self.y_offset + other.y_offset,
            Z_offset=self.Z_offset + other.Z_offset,
        )

    @property
    def sight(self) -> tuple[float, float]:
        """What tells the radii of `radii` under this alteration from those under another: lag and height."""
        return self.outline_lag, self.y_offset

    def vector(
        self,
        response: Response,
        observations: Observations,
        sample: int = 0,
        *,
        radii: FloatArray | None = None,
    ) -> FloatArray:
        """Force bins [N], then the radii at all outline points [m], shape [k]; NaN where none is known.

        `radii` are those of the same run under an alteration of the same `sight`, where they are known.
        """
        force = observations.of_forces(lambda bins, which: self._force(response, bins.edges, sample, which))
        if not observations.has_shape:
            return force
        known = self.radii(response, observations, sample) if radii is None else radii
        return np.concatenate([force, known - self.Z_offset])

    def _force(self, response: Response, edges: FloatArray, sample: int, which: str) -> FloatArray:
        """Means of a force between the edges, as altered [N]; the incident one has its own scale and zero."""
        t = response.force_times
        impulse, force = response.impulse_transmission[sample], response.force_transmission[sample]
        if which == "flyer":
            impulse, force = response.impulse_flyer[sample], response.force_flyer[sample]
        lags, weights = contact_spread(self.spread) if self.spread > 0.0 else (np.zeros(1), np.ones(1))
        mean = np.zeros(len(edges) - 1)
        for lag, weight in zip(lags, weights, strict=True):
            at = edges - self.force_lag - lag
            known = np.interp(at, t, impulse) + np.maximum(at - t[-1], 0.0) * force[-1]
            mean += weight * np.diff(known) / np.diff(edges)
        return mean if which == "flyer" else np.asarray(self.force_factor * mean + self.force_offset)

    def radii(self, response: Response, observations: Observations, sample: int = 0) -> FloatArray:
        """Radii at the points without the offset from the axis [m], linear in time between the frames and
        beyond the last; at rest before the first. None of a shot without an outline."""
        if not observations.has_shape:
            return np.zeros(0)
        line, times = observations.centre_line, response.surface_times
        r, y = response.surface_r[sample], response.surface_y[sample]
        at = np.maximum(line.time - self.outline_lag, times[0])
        row = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
        part = (at - times[row]) / (times[row + 1] - times[row])
        exact = np.abs(part - np.rint(part)) < 1e-6
        part = np.where(exact, np.rint(part), part)
        height = line.y + self.y_offset
        found = np.zeros(len(height))
        for step, weight in ((0, 1.0 - part), (1, part)):
            use = weight != 0.0
            radius, _ = radius_at(r, y, row[use] + step, height[use])
            found[use] += weight[use] * radius
        return found


UNALTERED = Alteration()


def contact_spread(half: float) -> tuple[FloatArray, FloatArray]:
    """Delays of the strips of a tilted round face, and their shares of its area.

    The face's chord at the distance x from the middle has the length 2 sqrt(R^2 - x^2): the delays have the
    density of a semicircle, whose Gauss quadrature is Chebyshev's of the second kind.
    """
    angle = np.pi * np.arange(1, SPREAD_NODES + 1) / (SPREAD_NODES + 1)
    return half * np.cos(angle), 2.0 * np.sin(angle) ** 2 / (SPREAD_NODES + 1)


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


def combined(first: Changed, second: Changed) -> Changed:
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


def _one_more(u: float) -> float:
    return 1.0 + u


def _one_less(value: float) -> float:
    return value - 1.0


def _of_specimen(
    name: str,
    key: str,
    *,
    scan: tuple[float, ...],
    step: float,
    typical: float,
    lowest: float,
    highest: float,
) -> CandidateInput:
    """A factor on a length or the density of the specimen; u is by how much it is not 1."""
    return CandidateInput(
        key=key,
        words=f"a factor on the specimen's {name}",
        check=f"check {key}",
        scan=scan,
        step=step,
        typical=typical,
        changed=lambda u: Changed(specimen={name: 1.0 + u}),
        declared=f"specimen_{name}",
        value=_one_more,
        coordinate=_one_less,
        lowest=lowest,
        highest=highest,
        exact=1.0,
        simulated=True,
    )


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
        onset=True,
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
        onset=True,
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
    _of_specimen("length", LENGTH, scan=_SHARES, step=2e-3, typical=0.01, lowest=-0.3, highest=0.3),
    _of_specimen("diameter", DIAMETER, scan=_SHARES, step=2e-3, typical=0.005, lowest=-0.3, highest=0.3),
    _of_specimen("density", DENSITY, scan=(), step=0.01, typical=0.01, lowest=-0.9, highest=9.0),
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


SPECIMEN_FIELDS = {LENGTH: "length", DIAMETER: "diameter", DENSITY: "density"}
"""Fields of the specimen by their keys."""
HELD_PARAMETERS = {
    POISSON: "poisson",
    DAMPING: "damping",
    KIND: "mass_damping",
    INTERFACE: "friction",
}
"""Parameters that are then held at the found value."""


def corrected(shot: Shot, settings: Settings, finding: CauseFinding) -> tuple[Shot, Settings] | None:
    """The shot and the settings with the found value; None where none can be given, as for a flyer's tilt."""
    key, value = finding.key, finding.value
    if key in SPECIMEN_FIELDS:
        specimen, name = shot.specimen, SPECIMEN_FIELDS[key]
        wrong = getattr(specimen, name)
        return replace(shot, specimen=replace(specimen, **{name: value * wrong})), settings
    if key in HELD_PARAMETERS:
        return shot, replace(settings, held={**settings.held, HELD_PARAMETERS[key]: value})
    if key not in CORRECTIONS:
        return None
    return CORRECTIONS[key](shot, value), settings


def _corrected_gain(shot: Shot, value: float) -> Shot:
    force = shot.force
    if isinstance(force, ForceChannel):
        right = replace(force.transducer, sensitivity=force.transducer.sensitivity / value)
        return replace(shot, force=replace(force, transducer=right))
    history = force.history()
    right_history = replace(history, force=value * history.force, sigma=value * history.sigma)
    return replace(shot, force=replace(force, measured=right_history))


def _corrected_baseline(shot: Shot, value: float) -> Shot:
    """Volts taken off after the baseline, whose own mean is the zero."""
    force = shot.force
    assert isinstance(force, ForceChannel)  # it is not tried on another
    volts = force.transducer.compression_sign * force.transducer.sensitivity * value
    later = force.time > force.baseline[1]
    recording = replace(force.recording, value=force.recording.value - np.where(later, volts, 0.0))
    return replace(shot, force=replace(force, recording=recording))


def _force_clock(shot: Shot, lag: float) -> Shot:
    force = shot.force
    if isinstance(force, ForceChannel):
        return replace(shot, force=replace(force, clock_offset=force.clock_offset - lag))
    history = force.history()
    return replace(shot, force=replace(force, measured=replace(history, time=history.time - lag)))


def _outline_clock(shot: Shot, lag: float) -> Shot:
    line = shot.centre_line
    assert line is not None  # it is not tried without one
    return replace(shot, centre_line=replace(line, time=line.time - lag))


def _flyer_clock(shot: Shot, lag: float) -> Shot:
    """The motion is known until its last frame, and compared no longer."""
    motion = replace(shot.flyer, time=shot.flyer.time - lag)
    first, last = shot.window
    return replace(shot, flyer=motion, window=(first, min(last, float(motion.time[-1]))))


def _corrected_motion(shot: Shot, factor: float) -> Shot:
    motion = shot.flyer
    if isinstance(motion, FlyerMotion):
        return replace(shot, flyer=replace(motion, displacement=factor * motion.displacement))
    return replace(shot, flyer=replace(motion, velocity=factor * motion.velocity))


def _corrected_height(shot: Shot, offset: float) -> Shot:
    line = shot.centre_line
    assert line is not None  # as above
    return replace(shot, centre_line=replace(line, y=line.y + offset))


def _corrected_radius(shot: Shot, offset: float) -> Shot:
    line = shot.centre_line
    assert line is not None  # as above
    return replace(shot, centre_line=replace(line, Z=line.Z + offset))


CORRECTIONS: dict[str, Callable[[Shot, float], Shot]] = {
    SENSITIVITY: _corrected_gain,
    BASELINE: _corrected_baseline,
    FORCE_CLOCK: _force_clock,
    OUTLINE_CLOCK: _outline_clock,
    FLYER_CLOCK: _flyer_clock,
    SCALE: _corrected_motion,
    Y_OFFSET: _corrected_height,
    Z_OFFSET: _corrected_radius,
}
"""What puts a recording or a scale right, by the cause's key."""
