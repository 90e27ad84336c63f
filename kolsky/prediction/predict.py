"""A planned test from the striker on: waves, separation, arrest, second impact, its numbers."""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np

import explicit
from dic.views import ResultViews
from explicit.bars import Apparatus, Joint, Section, find_events, integrate_test, simulate_test
from explicit.bars.lines import Events, FlightHistory, SpecimenForce
from explicit.response import Response
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.toml import TomlFile, read_toml
from kolsky.prediction.schema import PartTable, TestFile
from kolsky.prediction.shapers import shaper_of
from kolsky.virtual.material import law_of, relaxation_of, uniaxial_stress

FLATTEST = 0.04
"""Smallest stretch of the static curve [-]."""
RATE_TO = 0.9
"""The mean strain rate is taken from the separation to this share of the largest compression."""


@dataclass(frozen=True)
class PlannedTest:
    """A test file read."""

    file: TomlFile
    declared: TestFile
    """What it declares, in SI."""

    @property
    def folder(self) -> Path:
        """Where files that it names lie."""
        return self.file.path.parent

    def apparatus(self) -> Apparatus:
        """Striker, shaper, bars, joint and flyer.

        Raises InputError if the shaper's file holds no law.
        """
        test = self.declared
        striker, incident = _section_of(test.striker), _section_of(test.incident)
        return Apparatus(
            striker=(striker,),
            speed=test.striker.speed,
            shaper=shaper_of(test.shaper, self.folder, striker=striker, incident=incident),
            incident=(incident,),
            joint=Joint(test.joint.strength, test.joint.opening),
            flyer=tuple(map(_section_of, test.flyer.values())),
            transmission=tuple(map(_section_of, test.transmission.values())),
        )

    def static_curve(self) -> tuple[FloatArray, FloatArray]:
        """Compression [m] and force [N] of the specimen at rest, bonded, roughly: stiffer as it gets flat."""
        specimen, material = self.declared.specimen, self.declared.material
        law = law_of(material.law, material.parameters, material.shear_modulus)
        stretch = np.linspace(1.0, FLATTEST, 300)
        radius = 0.5 * specimen.diameter
        flat = 1.0 + 0.5 * (0.5 * radius / specimen.length) ** 2 / stretch**3
        stress = -material.stiffness_factor * uniaxial_stress(law, stretch)
        return specimen.length * (1.0 - stretch), stress * np.pi * radius**2 * flat

    def specimen(self) -> tuple[explicit.Model, explicit.Samples]:
        """The specimen for the solver; its motions are replaced."""
        test, m = self.declared, self.declared.material
        n_radial, n_axial = test.run.mesh
        rest = explicit.PlatenMotion(0.0, test.run.duration, np.zeros(2), np.zeros(2))
        model = explicit.Model(
            mesh=explicit.cylinder(
                0.5 * test.specimen.diameter, test.specimen.length, n_radial=n_radial, n_axial=n_axial
            ),
            density=test.specimen.density,
            materials=(law_of(m.law, m.parameters, m.shear_modulus),),
            motions=(rest,),
            faces=test.interface.faces,
            side=test.interface.side,
            relaxation=relaxation_of(m.prony_strengths, m.prony_times),
        )
        samples = explicit.Samples.of(
            stiffness_factor=m.stiffness_factor,
            poisson=m.poisson,
            damping=m.damping,
            mass_damping=m.mass_damping,
            friction=test.interface.friction,
        )
        return model, samples

    def sensor_depth(self) -> float:
        """Distance of the transmitted force's transducer's middle from the specimen [m]."""
        depth = 0.0
        for name, part in self.declared.transmission.items():
            if name == self.declared.sensor:
                return depth + 0.5 * part.length
            depth += part.length
        return 0.0


@dataclass(frozen=True)
class Numbers:
    """What a test is planned for; NaN for what did not happen."""

    flyer_speed: float
    """Velocity of the flyer's face over the transmission platen's, mean over the round trip of a wave in the
    flyer after the separation [m/s]."""
    start_rate: float
    """That over the specimen's length [1/s]."""
    mean_rate: float
    """Mean nominal strain rate from the separation to `RATE_TO` of the largest compression [1/s]."""
    largest_strain: float
    """Largest nominal compression before the second impact [-]."""
    peak_force: float
    """Largest transmitted force before it [N]."""
    flight: float
    """Time from separation to arrest [s]."""
    shaper_strain: float
    """Largest compression of the shaper [m]."""
    pulse_force: float
    """Largest force between striker and incident bar [N]."""


@dataclass(frozen=True)
class Prediction(ResultViews):
    """A planned test carried out."""

    test: PlannedTest
    bars: FlightHistory
    """What the bars did."""
    events: Events
    """What happened when."""
    numbers: Numbers
    """The numbers of the test."""
    response: Response | None
    """What the specimen did; None if its static curve stood in for it."""
    changes: FloatArray
    """Largest change of a force from each pass of bars and specimen to the next [N], shape [n_passes]."""


def _section_of(part: PartTable) -> Section:
    """A part as the bars' model takes it."""
    return Section(part.length, 0.5 * part.diameter, part.youngs_modulus, part.density, part.poisson)


def read_test(path: str | Path) -> PlannedTest:
    """Read and check a test file.

    Raises InputError if it cannot be read, is no TOML, or declares anything unknown or impossible.
    """
    return PlannedTest(*read_toml(Path(path), TestFile))


def predict(test: PlannedTest, *, quick: bool = False) -> Prediction:
    """Carry a planned test out, from the striker's touch on.

    Raises InputError if a part is too short for the step, a shaper's file holds no law, or the specimen's
    simulation does not complete or does not agree with the bars' in the passes that are allowed.

    Parameters
    ----------
    test
        A test file read.
    quick
        True to let the specimen's static curve stand in for its finite elements: a second, for scans.

    Examples
    --------
    >>> import kolsky
    >>> test = kolsky.read_test("runs/predict/paper.toml")
    >>> speed = kolsky.predict(test, quick=True).numbers.flyer_speed  # m/s
    >>> 1.0 < speed < 10.0
    True
    """
    run = test.declared.run
    try:
        apparatus, curve = test.apparatus(), test.static_curve()
        if quick:
            n = round(run.duration / run.step) + 1
            force = SpecimenForce(*curve, np.zeros(n), np.zeros(n))
            bars = integrate_test(apparatus, end=run.duration, step=run.step, specimen=force)
            response, changes = None, np.empty(0)
        else:
            done = simulate_test(
                apparatus,
                *test.specimen(),
                curve,
                end=run.duration,
                step=run.step,
                tolerance=run.tolerance,
                max_passes=run.passes,
            )
            bars, response, changes = done.bars, done.response, done.change
    except (ValueError, RuntimeError) as error:
        raise InputError(
            test.file.path, str(error), key="run", cure="correct the part that it names, or shorten run.step"
        ) from error
    events = find_events(bars)
    return Prediction(test, bars, events, numbers_of(test, bars, events), response, changes)


def numbers_of(test: PlannedTest, bars: FlightHistory, events: Events) -> Numbers:
    """The numbers of a test from what its bars did."""
    times, length = bars.times, test.declared.specimen.length
    step = float(times[1])
    strain = bars.compression / length
    end = len(times) if not isfinite(events.second_impact) else round(events.second_impact / step)
    speed = mean_rate = float("nan")
    largest = float(strain[:end].max())
    if isfinite(events.separation):
        apart = round(events.separation / step)
        ringing = 2.0 * sum(_section_of(part).travel_time for part in test.declared.flyer.values())
        after = min(apart + max(round(ringing / step), 1), len(times) - 1)
        speed = float((bars.compression[after] - bars.compression[apart]) / (times[after] - times[apart]))
        reached = np.flatnonzero(strain[apart:end] >= RATE_TO * largest)
        if reached.size and reached[0] > 0:
            late = apart + int(reached[0])
            mean_rate = float((strain[late] - strain[apart]) / (times[late] - times[apart]))
    return Numbers(
        flyer_speed=speed,
        start_rate=speed / length,
        mean_rate=mean_rate,
        largest_strain=largest,
        peak_force=float(bars.force_transmission[:end].max()),
        flight=events.arrest - events.separation,
        shaper_strain=float(bars.shaper_approach.max()),
        pulse_force=float(bars.shaper_force.max()),
    )


def doubts(found: Prediction) -> list[str]:
    """What to know before a prediction is used."""
    test, events, said = found.test.declared, found.events, []
    if not isfinite(events.separation):
        said.append(
            "the flyer does not separate before the end: the joint is too strong for the reflected tension, "
            "or [run] duration is too short; the flyer's speed and rate are not known"
        )
    elif not isfinite(events.arrest):
        said.append("the flyer is not arrested before the end: give a longer [run] duration")
    elif not isfinite(events.second_impact):
        said.append("there is no second impact before the end of [run] duration")
    platen = 0.5 * min(part.diameter for part in (*test.flyer.values(), *test.transmission.values()))
    if found.response is not None:
        before = np.searchsorted(found.response.surface_times, _end(found))
        widest = float(np.nanmax(found.response.surface_r[0, :before]))
        if widest > platen:
            said.append(
                f"the specimen grows to a diameter of {2e3 * widest:.1f} mm before the second impact, beyond "
                f"the {2e3 * platen:.1f} mm of the narrowest part beside it; the model's platens are wider"
            )
    height = test.shaper.height
    if height is not None and found.numbers.shaper_strain > 0.8 * height:
        said.append(
            f"the shaper is compressed by {found.numbers.shaper_strain / height:.0%} of its height; its law "
            "goes on along a straight line past 80 %"
        )
    return said


def _end(found: Prediction) -> float:
    again = found.events.second_impact
    return again if isfinite(again) else float(found.bars.times[-1])
