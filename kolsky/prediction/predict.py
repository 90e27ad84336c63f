"""Prediction of a planned test.

Waves from the striker's impact, separation, arrest, second impact, results.

The law of a pulse shaper is that of a rubber disc, a measured table, or a law from a measured pulse. The
force F(t) on the incident bar's face is the incident wave at the face. This holds until the reflection from
the bar's far end returns. The velocities of the faces are

    v_bar = F(t) / Z_bar,    v_striker = V - [F(t) + 2 sum_k F(t - k T)] / Z_striker,          Eq. (PS.1)

with the striker's round trip T = 2 L / c_0. The free rear end of the striker reflects every wave with
opposite sign. The shaper's compression is the integral of v_striker - v_bar. The law is F over this
compression, without free parameters.
"""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid

import explicit
from dic.views import ResultViews
from explicit.bars import Apparatus, Joint, PulseShaper, Section, find_events, integrate_test, simulate_test
from explicit.bars.lines import Events, FlightHistory, SpecimenForce
from explicit.relaxation import uniaxial_stress
from explicit.response import Response
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import refused
from kolsky.base.toml import TomlFile, read_toml
from kolsky.prediction.schema import PartTable, ShaperTable, TestFile
from kolsky.readers.table import Column, read_table
from kolsky.virtual.material import law_of, relaxing

LEAST_POINTS = 8
"""Smallest number of points of a law's loading."""
LAW_POINTS = 400
"""Largest number of points of a law from a pulse, evenly spaced in compression."""
LOADED = (0.01, 0.03)
"""Shares of the largest force of a pulse. A line is fitted between them, and loading begins at its zero."""


def closing(
    time: FloatArray, force: FloatArray, *, striker: Section, incident: Section, speed: float
) -> FloatArray:
    """Compression of the shaper under a pulse [m], Eq. (PS.1), shape [n].

    ``time``: ascending, beginning at the striker's touch [s], shape [n]. ``force``: compressive force on the
    bar's face [N], shape [n]; zero before the first time. ``striker``, ``incident``: the bars of that test.
    ``speed``: impact speed of the striker [m/s].
    """
    round_trip = 2.0 * striker.travel_time
    returned = np.zeros(len(time))
    for k in range(1, int((time[-1] - time[0]) / round_trip) + 1):
        returned += np.interp(time - k * round_trip, time, force, left=0.0)
    velocity = speed - (force + 2.0 * returned) / striker.impedance - force / incident.impedance
    return np.asarray(cumulative_trapezoid(velocity, time, initial=0.0))


def from_pulse(
    time: FloatArray,
    force: FloatArray,
    *,
    striker: Section,
    incident: Section,
    speed: float,
    unloading: float | None = None,
) -> PulseShaper:
    """The shaper's law from a measured pulse. Arguments are those of `closing`.

    The loading curve ends at the largest force. If noise makes force or compression decrease earlier, the
    curve keeps the larger value. The unloading slope is the mean slope down to half the largest force, if the
    shaper unloads that far within the pulse. Otherwise it is the steepest loading slope.
    """
    compression = closing(time, force, striker=striker, incident=incident, speed=speed)
    top = int(np.argmax(force))
    if not force[top] > 0.0 or top < LEAST_POINTS:
        raise ValueError("the pulse has no rising force; is its sign compression-positive?")
    if not (np.diff(compression[: top + 1]) > 0.0).mean() > 0.9:
        raise ValueError(
            "the faces of the shaper move apart while the force rises: speed, bars or the force's scale are "
            "wrong"
        )
    x = np.maximum.accumulate(compression[: top + 1])
    rising = np.maximum.accumulate(force[: top + 1])
    grid = np.linspace(0.0, x[-1], LAW_POINTS + 1)
    law = np.interp(grid, x, rising)
    law[0] = 0.0
    keep = np.concatenate([[True], np.diff(np.maximum.accumulate(law)) > 1e-9 * law[-1]])
    if keep.sum() < LEAST_POINTS:
        raise ValueError(f"the pulse has {keep.sum()} points of loading, {LEAST_POINTS} are needed")
    found = loading(grid[keep], law[keep])
    springs = unloading if unloading is not None else _unloading(compression[top:], force[top:])
    return found if springs is None else loading(grid[keep], law[keep], max(springs, found.unloading))


def _from_touch(time: FloatArray, force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A recorded pulse from the striker's touch on, by a line through its passages of `LOADED`."""
    top = float(force.max(initial=0.0))
    passages = [np.flatnonzero(force >= share * top) for share in LOADED]
    first, second = (int(rows[0]) if top > 0.0 else 0 for rows in passages)
    if not second > first > 0:
        raise ValueError("the pulse does not rise from nothing: the record must begin before it")
    slope = (force[second] - force[first]) / (time[second] - time[first])
    touch = float(time[first] - force[first] / slope)
    return np.append(0.0, time[first:] - touch), np.append(0.0, force[first:])


def _unloading(compression: FloatArray, force: FloatArray) -> float | None:
    """Mean slope from the largest compression to half its force; None if it does not unload so far."""
    turn = int(np.argmax(compression))
    below = np.flatnonzero(force[turn:] <= 0.5 * force[turn])
    if not below.size:
        return None
    end = turn + int(below[0])
    back = float(compression[turn] - compression[end])
    return float((force[turn] - force[end]) / back) if back > 0.0 else None


def shaper_of(table: ShaperTable, folder: Path, *, striker: Section, incident: Section) -> PulseShaper | None:
    """The pulse shaper that a test declares. None for direct contact of the faces.

    ``table``: [shaper]. ``striker``, ``incident``: the bars; they are needed to read a pulse.
    """
    if table.kind == "none":
        return None
    if table.kind == "disc":
        assert table.diameter is not None  # the schema asks for them
        assert table.height is not None
        assert table.shear_modulus is not None
        law = disc(table.diameter, table.height, table.shear_modulus)
        return law if table.unloading is None else _made(law.compression, law.force, table, folder)
    assert table.file is not None
    path = folder / table.file
    contents = read_table(path)
    force = contents.values(Column("force (N)"))
    if table.kind == "table":
        return _made(contents.values(Column("compression (mm)", 1e-3)), force, table, path)
    time = contents.values(Column("time (us)", 1e-6))
    assert table.speed is not None
    with refused(path, key="shaper.file", cure="are its columns and units right?"):
        return from_pulse(
            *_from_touch(time, force),
            striker=striker,
            incident=incident,
            speed=table.speed,
            unloading=table.unloading,
        )


def disc(diameter: float, height: float, shear_modulus: float) -> PulseShaper:
    """A neo-Hookean disc that slides on the steel: F = mu A (lam^-2 - lam), down to a stretch of 0.2.

    ``diameter``, ``height``: before the test [m]. ``shear_modulus``: at the rate of the test [Pa].
    """
    stretch = np.linspace(1.0, 0.2, 161)
    force = shear_modulus * np.pi * (0.5 * diameter) ** 2 * (stretch**-2 - stretch)
    return loading(height * (1.0 - stretch), force)


def loading(compression: FloatArray, force: FloatArray, unloading: float | None = None) -> PulseShaper:
    """A law from its loading curve. It unloads along its steepest slope unless one is given [N/m]."""
    steepest = float((np.diff(force) / np.diff(compression)).max())
    return PulseShaper(compression, force, steepest if unloading is None else unloading)


def _made(compression: FloatArray, force: FloatArray, table: ShaperTable, path: Path) -> PulseShaper:
    cure = "give a pulse that was recorded with this shaper"
    with refused(path, key="shaper", cure=cure, errors=(ValueError, IndexError)):
        return loading(compression, force, table.unloading)


FLATTEST = 0.04
"""Smallest stretch of the static curve [-]."""
RATE_TO = 0.9
"""The mean strain rate is computed from the separation to this share of the largest compression."""


@dataclass(frozen=True)
class PlannedTest:
    """The contents of a test file."""

    file: TomlFile
    declared: TestFile
    """Its declared data, in SI."""

    @property
    def folder(self) -> Path:
        """Folder of the files that it names."""
        return self.file.path.parent

    def apparatus(self) -> Apparatus:
        """Striker, shaper, bars, joint and flyer. Raises InputError if the shaper's file contains no law."""
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
        """Approximate static compression [m] and force [N] of the bonded specimen. It includes the stiffening
        of a flat specimen."""
        specimen, material = self.declared.specimen, self.declared.material
        law = law_of(material.law, material.parameters, material.shear_modulus)
        stretch = np.linspace(1.0, FLATTEST, 300)
        radius = 0.5 * specimen.diameter
        flat = 1.0 + 0.5 * (0.5 * radius / specimen.length) ** 2 / stretch**3
        stress = -material.stiffness_factor * uniaxial_stress(law, stretch)
        return specimen.length * (1.0 - stretch), stress * np.pi * radius**2 * flat

    def specimen(self) -> tuple[explicit.Model, explicit.Samples]:
        """The specimen for the solver. Its motions are replaced later."""
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
            relaxation=relaxing(test.relaxation),
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
    """Results of a planned test; NaN for events that did not occur."""

    flyer_speed: float
    """Velocity of the flyer's face relative to the transmission platen [m/s]. It is a mean over the round
    trip of a wave in the flyer after the separation."""
    start_rate: float
    """Initial strain rate: this velocity divided by the specimen's length [1/s]."""
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
    """The simulation of a planned test."""

    test: PlannedTest
    bars: FlightHistory
    """Motion and forces of the bars."""
    events: Events
    numbers: Numbers
    response: Response | None
    """Response of the specimen; None if its static curve was used."""
    changes: FloatArray
    """Largest change of a force between two passes of bars and specimen [N], shape [n_passes]."""


def _section_of(part: PartTable) -> Section:
    """A part in the form of the bars' model."""
    return Section(part.length, 0.5 * part.diameter, part.youngs_modulus, part.density, part.poisson)


def read_test(path: str | Path) -> PlannedTest:
    """Read and check a test file.

    Raises InputError if it cannot be read, is not valid TOML, or declares anything unknown or impossible.
    """
    return PlannedTest(*read_toml(Path(path), TestFile))


def predict(test: PlannedTest, *, quick: bool = False) -> Prediction:
    """Simulate a planned test, beginning with the striker's impact.

    Raises InputError if a part is too short for the step, or if a shaper's file contains no law. The same
    error is raised if the specimen's simulation does not complete, or does not agree with that of the bars
    within the allowed passes.

    Parameters
    ----------
    test
        The contents of a test file.
    quick
        True to use the specimen's static curve instead of finite elements. This takes a second and is meant
        for scans.

    Examples
    --------
    >>> import kolsky
    >>> test = kolsky.read_test("runs/predict/paper.toml")
    >>> speed = kolsky.predict(test, quick=True).numbers.flyer_speed  # m/s
    >>> 1.0 < speed < 10.0
    True
    """
    run = test.declared.run
    cure = "correct the part that it names, or shorten run.step"
    with refused(test.file.path, key="run", cure=cure, errors=(ValueError, RuntimeError)):
        apparatus, curve = test.apparatus(), test.static_curve()
        if quick:
            n = round(run.duration / run.step) + 1
            force = SpecimenForce(*curve, np.zeros(n), np.zeros(n))
            bars = integrate_test(apparatus, end=run.duration, step=run.step, specimen=force)
            response, changes = None, np.empty(0)
        else:
            done = simulate_test(
                apparatus, *test.specimen(), curve, end=run.duration, step=run.step, tolerance=run.tolerance,
                max_passes=run.passes,
            )  # fmt: skip
            bars, response, changes = done.bars, done.response, done.change
    events = find_events(bars)
    return Prediction(test, bars, events, numbers_of(test, bars, events), response, changes)


def numbers_of(test: PlannedTest, bars: FlightHistory, events: Events) -> Numbers:
    """The results of a test from the motion and forces of its bars."""
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
    """Remarks on the use of a prediction."""
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
                f"the {2e3 * platen:.1f} mm of the narrowest part next to it; the model's platens are wider"
            )
    height = test.shaper.height
    if height is not None and found.numbers.shaper_strain > 0.8 * height:
        said.append(
            f"the shaper is compressed by {found.numbers.shaper_strain / height:.0%} of its height; its law "
            "is a straight line past 80 %"
        )
    return said


def _end(found: Prediction) -> float:
    again = found.events.second_impact
    return again if isfinite(again) else float(found.bars.times[-1])
