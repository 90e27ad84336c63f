"""Classical reduction of bar tests, repeated tests, tests with touching bars, and flyer tests.

A flyer test gives forces after mass compensation, and strain from the flyer's motion. Its reduction is a
function of its input values. Each of them can therefore be varied for the uncertainty budget.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf, sqrt
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.bars.audit import AuditLog, Switches
from kolsky.bars.budget import budget_table, merge_quantities, propagate
from kolsky.bars.flyer.events import FlyerEvents, flyer_events
from kolsky.bars.flyer.path import FlyerPath, path_strain
from kolsky.bars.flyer.synchronisation import Agreement, synchronise
from kolsky.bars.guides.propagation import BarsTogether, wave_speed
from kolsky.bars.records import BarSignal, FlyerResult, History, Quantity, ReducedTest, Reduction, Signal
from kolsky.bars.reduction.analyse import analyse
from kolsky.bars.reduction.inertia import (
    axial_by_analysis,
    compensate_mass,
    correct_axial_inertia,
    correct_radial_inertia,
    path_acceleration,
)
from kolsky.bars.reduction.repeated_tests import RepeatedTests, repeated_tests
from kolsky.bars.reduction.validity import VALIDITY_SHARE, Validity, balanced_span, imbalance, validity
from kolsky.bars.reduction.varied_test import length_quantities, station_of, varied_specimen
from kolsky.bars.reduction.windows import SIDES, averaging_time, incident_arrival
from kolsky.bars.signals.transducers import ForceSignal, force_signal
from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError, refused
from kolsky.base.records import FlyerMotion
from kolsky.pictures.picture_set import Progress
from kolsky.schema.apparatus import UncertaintySection
from kolsky.schema.bars import WavesSection
from kolsky.schema.shot_file import Source, folder_of, is_bar_driven, parsed, shot_toml
from kolsky.shot.bars import declared_settings, load_bars, load_waves
from kolsky.shot.force import incident_channel
from kolsky.shot.load import load_shot
from kolsky.shot.records import ForceChannel, Shot

AVERAGE = 10e-6
"""Forces are averaged over this span before their balance is checked [s]."""


@dataclass(frozen=True)
class FlyerInput:
    """A flyer test, ready to be reduced."""

    shot: Shot
    """The shot."""
    incident: ForceChannel | None = None
    """The flyer's transducer; None if there is none."""
    mass: float = 0.0
    """Mass between its sensing plane and the specimen [kg]."""
    pictured: bool = False
    """True if pictures give the flyer's motion. They also give its direction."""
    share: float = VALIDITY_SHARE
    """Largest share of the stress that may come from inertia, or from the difference of the forces [-]."""
    switches: Switches = field(default_factory=Switches)
    """Which corrections are applied."""
    uncertainty: Mapping[str, float] = field(default_factory=dict)
    """Standard uncertainties (k = 1) by the keys of [uncertainty]."""
    settings: Mapping[str, str] = field(default_factory=dict)
    """The declared values and the software versions."""

    def reduced(
        self, path: FlyerPath, time: FloatArray, values: Mapping[str, float], log: AuditLog
    ) -> tuple[Reduction, Validity, History]:
        """Reduction at the given times, its validity, and the acceleration of the flyer with this path.

        ``values`` replace input quantities of the same name. Corrections are recorded in ``log``.
        """
        shot = self.shot
        specimen = varied_specimen(shot.specimen, values)
        strain, rate, second = path_strain(path, time, length=specimen.length)
        acceleration = path_acceleration(path, time)
        assert isinstance(shot.force, ForceChannel)  # checked by `analyse_flyer`
        back = _at(_channel_force("transmitted force", shot.force, self, values).signal, time)
        front = back
        if self.incident is not None:
            gauge = _at(_channel_force("incident force", self.incident, self, values).signal, time)
            front = gauge
            if self.mass > 0.0:
                mass = values.get("flyer, mass", self.mass)
                front, entry = compensate_mass(
                    gauge, acceleration, Quantity("flyer, mass", mass, 0.0, "kg", "B"),
                    apply=self.switches["mass"], source="the flyer's motion",
                )  # fmt: skip
                log.add(replace(entry, key="mass"))
        area = specimen.area
        stress = {
            "one wave": _scaled(back, 1.0 / area),
            "two waves": _scaled(front, 1.0 / area),
            "three waves": History(
                0.5 * (front.value + back.value) / area, 0.5 * np.hypot(front.sigma, back.sigma) / area, "Pa"
            ),
        }
        plain = stress["three waves"]
        corrected, radial = correct_radial_inertia(
            plain, strain, rate, second, specimen, apply=self.switches["radial inertia"]
        )
        log.add(replace(radial, key="radial inertia"))
        stress["one wave"], axial = correct_axial_inertia(
            stress["one wave"], second, specimen, apply=self.switches["axial inertia"]
        )
        log.add(replace(axial, key="axial inertia"))
        if axial.applied:  # the other analyses lack other shares of it
            change = axial_by_analysis(second.value, specimen, 0.0)
            two = stress["two waves"]
            stress["two waves"] = replace(two, value=two.value + change["two waves"])
            corrected = replace(corrected, value=corrected.value + change["three waves"])
        everything, _ = correct_radial_inertia(plain, strain, rate, second, specimen, apply=True)
        interval = float(time[1] - time[0])
        width = max(1, round(AVERAGE / interval))
        known = self.incident is not None  # with one force their balance is unknown
        ratio = np.full(time.size, np.inf)
        if known:
            ratio = imbalance(front.value, back.value, front.sigma[0], back.sigma[0], width=width)
        still = History(np.zeros(time.size), np.zeros(time.size), "m/s")
        reduction = Reduction(
            time=time,
            strain=dict.fromkeys(stress, strain),
            rate=dict.fromkeys(stress, rate),
            stress=stress | {"three waves": corrected},
            front_force=front,
            back_force=back,
            front_velocity=_scaled(rate, specimen.length),
            back_velocity=still,
            imbalance=ratio,
            balanced=balanced_span(time, ratio, allowance=self.share, bridge=width * interval),
        )
        window = validity(
            time, front, back, strain,
            inertial_stress=plain.value - everything.value, area=area, share=self.share, average=AVERAGE,
        )  # fmt: skip
        if not known:
            unknown = np.full(window.imbalance.shape, np.inf)
            window = replace(window, window=None, strain=None, covered=0.0, imbalance=unknown)
        return reduction, window, acceleration


def _reported(reduction: Reduction) -> dict[str, History]:
    """The histories of the uncertainty budget."""
    stress = reduction.stress
    return {
        "largest strain": reduction.strain["three waves"],
        "back stress": stress["one wave"],
        "front stress": stress["two waves"],
    }


def _channel_force(
    name: str, channel: ForceChannel, given: FlyerInput, values: Mapping[str, float]
) -> ForceSignal:
    """The force of a transducer. Entries of ``values`` replace the input quantities of the same name."""
    relative = given.uncertainty.get("sensitivity", 0.0)
    return force_signal(
        channel.recording,
        channel.transducer,
        name=name,
        baseline=channel.baseline,
        clock_offset=channel.clock_offset,
        switches=given.switches,
        uncertainty={"sensitivity": relative * channel.transducer.sensitivity},
        values=values,
    )


def _at(signal: Signal, time: FloatArray) -> History:
    return History(np.interp(time, signal.time, signal.value), np.full(time.size, signal.sigma), "N")


def _scaled(history: History, factor: float) -> History:
    unit = {"N": "Pa", "1/s": "m/s"}[history.unit]
    return History(factor * history.value, factor * history.sigma, unit)


EARLY = 0.05
"""The clocks are compared up to this travel of the flyer, divided by the specimen's length [-]."""
UNJUDGED = (
    "whether the forces on the faces are balanced is not known, because only the force behind the "
    "specimen was measured; cure: declare the flyer's transducer in [incident_force], or use the inverse "
    "method (kolsky identify), which needs no balance"
)
"""Text for the validity window if the force on the front face is unknown."""


def analyse_flyer(given: FlyerInput, *, progress: Progress = lambda stage, done, total: None) -> FlyerResult:
    """Forces, strain, stress, events, and the window in which stress and strain are a material curve.

    Raises ValueError if the shot has no flyer motion, or if the signals are not those of such a test.
    """
    shot, motion = given.shot, given.shot.flyer
    if not isinstance(motion, FlyerMotion) or not isinstance(shot.force, ForceChannel):
        raise ValueError("the shot's front face is moved by bar waves; `kolsky waves` reduces its gauges")
    progress("waves", 0, 3)
    transmitted = _channel_force("transmitted force", shot.force, given, {})
    incident = None if given.incident is None else _channel_force("incident force", given.incident, given, {})
    rest = shot.window[0]
    events = flyer_events(
        motion,
        rest=rest,
        incident=None if incident is None else incident.signal,
        transmitted=transmitted.signal,
        bar=shot.transmission_bar,
    )
    sync = None
    if incident is not None and given.mass > 0.0:
        zero = next(q for q in incident.quantities if q.name.endswith("zero"))
        travel = EARLY * shot.specimen.length
        sync = synchronise(
            motion, incident.signal, mass=given.mass, rest=rest, travel=travel, sigma_zero=zero.sigma
        )
    progress("waves", 1, 3)
    last = min(events.path.end, events.usable[0], inf if shot.symmetry_end is None else shot.symmetry_end)
    time = transmitted.signal.time
    time = time[(time >= rest) & (time <= last)]
    log = AuditLog(given.switches)
    forces = [force for force in (incident, transmitted) if force is not None]
    log.add(*(correction for force in forces for correction in force.corrections))
    r, judged, acceleration = given.reduced(events.path, time, {}, log)
    progress("waves", 2, 3)
    u = given.uncertainty
    quantities = [q for force in forces for q in force.quantities]
    quantities += length_quantities(shot.specimen, {}, u)
    if given.incident is not None and given.mass > 0.0:
        quantities.append(Quantity("flyer, mass", given.mass, given.mass * u.get("mass", 0.0), "kg", "B"))
    noise = {name: history.sigma for name, history in _reported(r).items()}

    def outputs(values: Mapping[str, float]) -> dict[str, FloatArray]:
        varied = given.reduced(events.path, time, values, AuditLog(given.switches))[0]
        return {name: history.value for name, history in _reported(varied).items()}

    budget = propagate(outputs, merge_quantities(quantities), noise=noise)
    last = int(np.argmax(np.abs(r.strain["three waves"].value)))
    rows = {"largest strain": ("largest strain", last, "1"), "back stress there": ("back stress", last, "Pa")}
    if given.incident is not None:
        rows["front stress there"] = ("front stress", last, "Pa")
    progress("waves", 3, 3)
    facts: dict[str, tuple[float, str]] = {
        "largest strain rate": (float(np.abs(r.rate["three waves"].value).max()), "1/s"),
        "largest acceleration of the flyer": (float(np.abs(acceleration.value).max()), "m/s^2"),
        **{f"noise, {force.signal.name}": (force.signal.sigma, "N") for force in forces},
    }
    if sync is not None:
        facts |= {"lag of the cameras": (sync.lag, "s"), "its standard uncertainty": (sync.sigma, "s")}
    window = judged.window  # of one averaging interval it is none
    sentence = judged.sentence if given.incident is not None else UNJUDGED
    remarks = [sentence] if judged.nearly_empty else []
    if sync is not None and sync.agreement is not Agreement.AGREES:
        remarks.append(sync.sentence)
    elif sync is not None and abs(sync.gain - 1.0) > 2.0 * sync.sigma_gain:
        remarks.append(
            f"the flyer moves {sync.gain:.3f} ± {2.0 * sync.sigma_gain:.3f} (k = 2) times as much as the "
            "incident transducer and the mass before it give; cure: check incident_force.sensitivity and mass"
        )
    return FlyerResult(
        name=shot.name,
        specimen=shot.specimen,
        load="compression",
        reduction=r,
        corrections=log.corrections,
        budget=budget_table(budget, rows),
        facts=facts,
        remarks=tuple(remarks),
        inputs=shot.inputs,
        settings=given.settings,
        signals=tuple(force.signal for force in forces),
        events=_flyer_events(events, shot, pictured=given.pictured),
        valid=window if window is not None and window[1] > window[0] else None,
        validity=sentence,
        synchronisation=None if sync is None else sync.sentence,
        inertia={"time": judged.time, "imbalance": judged.imbalance, "inertia": judged.inertia},
    )


def _flyer_events(
    found: FlyerEvents, shot: Shot, *, pictured: bool
) -> tuple[tuple[str, float | None, float | None, str], ...]:
    """The events of the test. With pictures, the end of symmetry is found from the flyer's flight."""
    rows = [(e.name, e.time, e.sigma, e.how) for e in found.events]
    if not pictured or not isinstance(shot.flyer, FlyerMotion):
        return tuple(rows)
    rows = [row for row in rows if row[0] != "end of symmetry"]
    if shot.symmetry_end is None:
        kept = "the flyer keeps its first direction to the last frame"
        return (*rows, ("end of symmetry", None, None, kept))
    frame = float(np.median(np.diff(shot.flyer.time)))
    how = "the flyer leaves its first direction, by its flight in the pictures"
    return (*rows, ("end of symmetry", shot.symmetry_end, frame / sqrt(12.0), how))


__all__ = ["waves"]


def _load_flyer_test(source: Source, shot: Shot) -> FlyerInput:
    """Load a flyer test for `kolsky waves`."""
    toml = shot_toml(source)
    declared = toml.declared
    waves = declared.waves or WavesSection()
    if "analysis" in waves.model_fields_set:
        message = "is for tests between bars; a flyer test quotes the stress at each face"
        raise toml.error("waves.analysis", message, cure="remove it")
    return FlyerInput(
        shot=shot,
        incident=incident_channel(toml),
        mass=0.0 if declared.incident_force is None else declared.incident_force.mass,
        pictured=declared.flyer is None and declared.pictures is not None,
        share=waves.share,
        switches=Switches(waves.corrections),
        uncertainty={
            key: value
            for key, value in (declared.uncertainty or UncertaintySection()).for_waves().items()
            if not isinstance(value, bool)
        },
        settings=declared_settings(toml.content),
    )


CURE = "correct the gauge or bar that it names in shot.toml"


def waves(
    shot: str | Path, *, results: Path | None = None, progress: Progress = lambda stage, done, total: None
) -> ReducedTest:
    """Forces, strain, rate and stress of a test by classical means, with corrections and budget.

    Parameters
    ----------
    shot
        A shot's folder, or its shot.toml.
    results
        Folder for the stored surfaces of a shot with pictures; by default the folder "results" of the shot.
    progress
        Called with the number of steps done in each stage.

    Returns
    -------
    ReducedTest
        `kolsky.bars.records.WavesResult` for a test between bars, `kolsky.bars.records.FlyerResult` for a
        flyer test.

    Raises
    ------
    InputError
        If the shot or its files cannot be used.

    Examples
    --------
    >>> import kolsky
    >>> result = kolsky.waves("runs/bar-01")
    >>> result.analysis
    'three waves'
    """
    file = parsed(shot)
    with refused(file.path.parent, cure=CURE):
        if "gauges" in file.content or is_bar_driven(file):
            return analyse(load_waves(file), progress=progress)
        from kolsky.shot.optical_data import measured  # imports image correlation: for pictures only

        loaded = load_shot(file, measure=lambda pictures: measured(pictures, results, progress=progress))
        return analyse_flyer(_load_flyer_test(loaded.file or file, loaded), progress=progress)


@dataclass(frozen=True)
class RepeatedShots:
    """Repeats of one test, with their mean."""

    names: tuple[str, ...]
    """Names of the shots, in the order of the rows of `mean.values`."""
    mean: RepeatedTests
    """Mean stress over strain, with its band."""

    def columns(self) -> dict[str, list[float]]:
        """The mean, its 95 % band and every test over strain, as columns of a table."""
        together = self.mean
        low, high = together.band()
        return {
            "strain (1)": together.axis.tolist(),
            "mean stress (Pa)": together.mean.tolist(),
            "low end of the 95 % band (Pa)": low.tolist(),
            "high end of the 95 % band (Pa)": high.tolist(),
            "scatter between tests (Pa)": together.scatter.tolist(),
            "shared standard uncertainty (Pa)": together.shared.tolist(),
            **{f"{name} (Pa)": row.tolist() for name, row in zip(self.names, together.values, strict=True)},
        }

    def summary(self) -> dict[str, Any]:
        """The largest mean stress with its band, for JSON, SI."""
        together = self.mean
        low, high = together.band()
        at = int(abs(together.mean).argmax())
        return {
            "tests": list(self.names),
            "strain_range": [float(together.axis[0]), float(together.axis[-1])],
            "largest_mean_stress": {
                "value": float(together.mean[at]),
                "band": [float(low[at]), float(high[at])],
                "strain": float(together.axis[at]),
                "scatter": float(together.scatter[at]),
                "unit": "Pa",
            },
            "remarks": list(together.remarks),
        }


def repeats(
    shots: Sequence[str | Path], *, progress: Progress = lambda stage, done, total: None
) -> RepeatedShots:
    """Reduce repeats of one test between bars and average their stress at equal strain.

    Parameters
    ----------
    shots
        Shots' folders, or their shot.toml files; two or more.
    progress
        Called with the number of shots done.

    Raises
    ------
    InputError
        If two shots have the same name, or a shot cannot be used.
    ValueError
        If there are fewer than two shots, or they have no strains in common.
    """
    paths = [Path(shot) for shot in shots]
    given = [load_waves(path) for path in paths]  # reject invalid input before any computation
    found: dict[str, Reduction] = {}
    for number, (path, one) in enumerate(zip(paths, given, strict=True)):
        progress("repeats", number, len(paths))
        if one.name in found:
            message = f"another shot is called {one.name!r} too"
            raise InputError(folder_of(path), message, cure="give each its own name")
        with refused(folder_of(path), cure=CURE):
            found[one.name] = analyse(one).reduction
    progress("repeats", len(paths), len(paths))
    return RepeatedShots(tuple(found), repeated_tests(found))


def wave_speed_of(shot: str | Path) -> tuple[str, BarsTogether, tuple[str, ...]]:
    """Name, wave speed and relative gain of a shot with touching bars, and notes on its files.

    ``shot``: a shot's folder, or its shot.toml with the tables bars, recorders and gauges. Raises InputError
    if the shot or its files cannot be used.
    """
    given = load_bars(Path(shot))
    with refused(folder_of(Path(shot)), cure=CURE):
        incident, transmission = (station_of(given, side).signal for side in SIDES)
        found = _fit_first_pulse(incident, transmission, tension=given.load == "tension")
    return given.name, found, given.notes


def _fit_first_pulse(incident: BarSignal, transmission: BarSignal, *, tension: bool) -> BarsTogether:
    """Fit wave speed and gain over the pulse up to its first echo, whose time depends on the fitted speed."""
    speed = incident.bar.wave_speed
    for _ in range(2):
        arrival = incident_arrival(incident, tension=tension)
        lead = 2.0 * averaging_time(incident)
        first = min(arrival.time, arrival.onset) - lead
        way = (incident.position + transmission.position) / speed
        # The pulse returns from the nearer far end. No other wave reaches a gauge earlier.
        free = min(2.0 * (s.bar.length - s.position) for s in (incident, transmission)) / speed
        last = min(arrival.time + free - lead, transmission.strain.end - way)
        found = wave_speed(
            incident,
            transmission,
            incident_window=(incident.strain.start, incident.strain.end),  # later samples are not compared
            transmitted_window=(first + way, last + way),
        )
        speed = found.wave_speed
    return found


def residual_columns(found: BarsTogether) -> dict[str, list[float]]:
    """The measured strain and the residual of the fit over time, as named columns."""
    return {
        "time (s)": found.time.tolist(),
        "measured strain": found.measured.tolist(),
        "fitted less measured": found.residual.tolist(),
    }


def wave_speed_summary(found: BarsTogether) -> dict[str, object]:
    """The numbers of the fit for JSON, SI."""
    return {
        "wave_speed": {
            "value": found.wave_speed,
            "sigma": found.wave_speed_sigma,
            "unit": "m/s",
            "by_poisson": found.by_poisson,
        },
        "gain": {"value": found.gain, "sigma": found.gain_sigma, "unit": "1"},
        "rms": found.rms,
        "largest": found.largest,
        "plain_rms": found.plain_rms,
        "plain_wave_speed": found.plain_wave_speed,
        "band": found.band if found.band < float("inf") else None,
    }
