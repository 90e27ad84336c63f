"""Load and check a bar test: its shot.toml and its files become the input of the reduction."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.bars.audit import CORRECTIONS, Switches
from kolsky.bars.guides.waveguide import PronyModulus
from kolsky.bars.records import BarSignal, Windows
from kolsky.bars.reduction.separation import on_one_clock, overlapping_windows
from kolsky.bars.reduction.varied_test import station_of
from kolsky.bars.reduction.windows import (
    FAR,
    NO_PART,
    SIDES,
    PulseCheck,
    StationInput,
    WavesInput,
    check_windows,
    find_windows,
    incident_arrival,
)
from kolsky.bars.signals.arrival import Arrival
from kolsky.bars.signals.bridge import Bridge, Calibration, Linear, Shunt, with_shunt
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.errors import refuse, refused
from kolsky.base.records import Recording
from kolsky.base.toml import TomlFile
from kolsky.base.units import in_us
from kolsky.readers.contents import clock_words
from kolsky.readers.header import si_unit
from kolsky.readers.recordings import read_recordings
from kolsky.schema.bars import BarsShotFile, GaugeSection, WavesShotFile
from kolsky.schema.shot_file import Source, parsed
from kolsky.shot.evidence import Evidence, entries, missing_files
from kolsky.shot.plausibility import gate


def _recordings_of(
    file: TomlFile, declared: BarsShotFile, gauges: Mapping[str, GaugeSection], folder: Path
) -> tuple[dict[str, tuple[Recording, ...]], dict[str, str]]:
    """The channels of all stations in their declared or stated units, and the hashes of their files."""
    found, hashes = {}, {}
    for key, gauge in gauges.items():
        wanted = "1" if gauge.strain else "V"
        channels = []
        for channel, recorder_name in zip(map(str, gauge.channels), gauge.recorders, strict=True):
            recorder = declared.recorders[recorder_name]
            layout = recorder.as_layout(full_scale=gauge.full_scale)
            recording = read_recordings(folder / recorder.file, [channel], layout=layout)[channel]
            hashes[recorder.file] = recording.sha256
            if recording.unit != wanted:
                raise file.error(
                    _shot_file_table(key),
                    f"needs a signal in {wanted!r}, channel {recording.channel!r} is in {recording.unit!r}",
                    cure="state the unit of the samples in the recorder's table, or strain = true",
                )
            channels.append(recording)
        if gauge.reflected is not None:
            channels = [_with_reflected(file, declared, gauge, channels[0])]
        found[key] = tuple(channels)
    return found, hashes


def _with_reflected(
    file: TomlFile, declared: BarsShotFile, gauge: GaugeSection, incident: Recording
) -> Recording:
    """One record of a gauge from exports of incident and reflected pulse, at its zero between them."""
    assert gauge.reflected is not None  # checked by the caller
    key, start = "gauges.incident.reflected", gauge.reflected.start
    bar = declared.bars.incident
    travel = 2.0 * gauge.distance / np.sqrt(bar.modulus / bar.density)
    if start is None:
        raise file.error(
            f"{key}.start",
            "is missing: it places the reflected pulse on the recorder's clock",
            cure=f'where both columns begin with the arrival of their pulse write start = "{in_us(travel)}", '
            "twice the gauge's distance over the wave speed; where they kept their times write the time that"
            " was taken off",
        )
    recorder, name = declared.recorders[gauge.recorders[0]], str(gauge.reflected.channel)
    layout = recorder.as_layout(full_scale=gauge.full_scale)
    pulse = read_recordings(incident.path, [name], layout=layout)[name]
    if pulse.unit != incident.unit:
        message = f"is in {pulse.unit!r}, the incident pulse in {incident.unit!r}"
        cure = "both pulses come from one gauge: export them in one unit"
        raise file.error(f"{key}.channel", message, cure=cure)
    first, interval = float(incident.time[0]), float(np.median(np.diff(incident.time)))
    place = (float(pulse.time[0]) + start - first) / interval
    row = round(place)
    if row < incident.value.size:
        raise file.error(
            f"{key}.start",
            f"places the reflected pulse at {in_us(float(pulse.time[0]) + start)}, on the incident pulse,"
            f" whose column ends at {in_us(float(incident.time[-1]))}",
            allowed=f"at least {in_us(float(incident.time[-1] - pulse.time[0]) + interval)}",
            cure="cut the incident pulse shorter, or correct start",
        )
    count = row + pulse.value.size
    time = incident.time + recorder.clock_offset
    rest = incident.value[(time >= gauge.baseline[0]) & (time <= gauge.baseline[1])]
    value = np.full(count, float(rest.mean()) if rest.size else 0.0)
    value[: incident.value.size], value[row:] = incident.value, pulse.value
    said = (
        f"channel '{incident.channel}' of {incident.path.name} was assembled from separate pulses, with "
        f"zero between them: the reflected pulse begins {in_us(row * interval)} after the first sample, "
        f"{in_us(abs(place - row) * interval)} from its declared place (whole samples)"
    )
    return replace(
        incident,
        time=np.asarray(first + interval * np.arange(count), dtype=np.float64),
        value=value,
        note="; ".join(part for part in (incident.note, said) if part),
        first_line=None,
    )


def _recording_notes(
    declared: BarsShotFile, recordings: Mapping[str, tuple[Recording, ...]]
) -> tuple[str, ...]:
    """Notes on declared units that contradict the file, and on channels interpolated to uniform times."""
    notes: list[str] = []
    for key, channels in recordings.items():
        gauge = getattr(declared.gauges, key.replace(" ", "_"))
        for recording, name in zip(channels, gauge.recorders, strict=True):
            stated = declared.recorders[name].unit
            notes += [recording.note] if recording.note else []
            if stated is None or recording.file_unit is None:
                continue
            taken, written = si_unit(stated), si_unit(recording.file_unit)
            if taken == written:
                continue
            notes.append(
                f"channel '{recording.channel}' of {recording.path.name} is in '{recording.file_unit}' by "
                f"the file and in '{stated}' by recorders.{name}.unit, which was taken; cure: remove "
                f"recorders.{name}.unit unless the file is wrong"
            )
    return tuple(dict.fromkeys(notes))


def _shot_file_table(key: str) -> str:
    """Name of a station's table in the shot file."""
    return "gauges." + key.replace(" ", "_")


def _gauge_station(
    gauge: GaugeSection, recordings: tuple[Recording, ...], bar: Bar, declared: BarsShotFile
) -> StationInput:
    """A station as input of the reduction. Channels of two recorders are synchronized."""
    offsets = [declared.recorders[name].clock_offset for name in gauge.recorders]
    if len(set(gauge.recorders)) > 1:
        recordings = on_one_clock(recordings, offsets)
    return StationInput(
        recordings=recordings,
        calibration=_station_calibration(gauge, bar),
        position=gauge.distance,
        baseline=gauge.baseline,
        clock_offset=offsets[0],
        compression=gauge.signs,
        full_scale=gauge.full_scale,
    )


def _station_calibration(gauge: GaugeSection, bar: Bar) -> Calibration:
    if gauge.strain:
        return Linear(1.0, unit="1")
    if gauge.strain_per_volt is not None:
        return Linear(gauge.strain_per_volt)
    assert gauge.bridge is not None  # checked by the validator
    across = "Poisson" in gauge.bridge.kind
    stated = gauge.bridge.model_dump(exclude={"shunt"})
    bridge = Bridge(**stated, poisson=bar.poisson if across else None)
    if gauge.bridge.shunt is None:
        return bridge
    found, check = with_shunt(bridge, Shunt(**gauge.bridge.shunt.model_dump()))
    if check.compression_sign not in gauge.signs:
        raise ValueError(
            f"the shunt's step of {gauge.bridge.shunt.step:g} V shows that compression gives "
            f"{'positive' if check.compression_sign > 0 else 'negative'} volts, declared is "
            f"{gauge.compression!r}; correct the sign of the step or of compression"
        )
    return found


def load_waves(source: Source) -> WavesInput:
    """Load and check the input of `kolsky waves`.

    ``source``: the shot's folder with its shot.toml, the path of such a file, or the parsed file. Raises
    InputError if a file is missing or damaged. Also for a wrong declaration.
    """
    file = parsed(source)
    declared = file.validated(WavesShotFile)
    given = _waves_input(file, declared)
    specimen = Specimen(**declared.specimen.model_dump())
    for side, bar in given.bars.items():
        if specimen.diameter > bar.diameter:
            message = "is wider than the bar, which loads only the area of its face"
            allowed = f"up to the {side} bar's diameter, {1e3 * bar.diameter:.6g} mm"
            raise file.error("specimen.diameter", message, allowed=allowed)
    waves = declared.waves
    windows = None
    if waves.incident and waves.reflected and waves.transmitted:  # the schema requires all three
        windows = Windows(waves.incident, waves.reflected, waves.transmitted, source="shot file")
    uncertainty = declared.uncertainty.for_waves()
    alike = bool(uncertainty.pop("bars_alike"))
    return replace(
        given,
        specimen=specimen,
        polymers={
            side: PronyModulus(prony.long_term, tuple(prony.moduli), tuple(prony.times))
            for side in SIDES
            if (prony := getattr(declared.bars, side).prony) is not None
        },
        windows=windows,
        analysis=waves.analysis,
        allowance=waves.balance,
        plateau=waves.plateau,
        share=waves.share,
        switches=_switches(file, waves.corrections, FAR in given.stations),
        uncertainty=uncertainty,
        alike=alike,
    )


def _switches(file: TomlFile, stated: Mapping[str, bool], two_stations: bool) -> Switches:
    """The switches of the corrections. Raises InputError if a correction is on but cannot have an effect."""
    switches = Switches(stated)
    idle = dict(NO_PART)
    if not two_stations:
        idle["separation"] = "it needs a second station on the incident bar"
    elif switches["separation"]:
        idle["free end"] = "two stations separate the waves of the incident bar already"
        idle["reflected alignment"] = "two stations give the reflected wave on the clock of the incident wave"
    for key, why in idle.items():
        if switches.stated.get(key, False):
            message = f"switches {key!r} on, which has no effect in this test: {why}"
            cure = "remove it" if two_stations or key != "separation" else "add [gauges.incident_far]"
            raise file.error("waves.corrections", message, cure=cure)
    return switches


def load_bars(source: Source) -> WavesInput:
    """Load and check the input of `kolsky wavespeed`: bars and gauges, no specimen.

    The specimen of the result is a placeholder, not to be used. Raises InputError as `load_waves`.
    """
    file = parsed(source)
    return _waves_input(file, file.validated(BarsShotFile))


def _waves_input(file: TomlFile, declared: BarsShotFile) -> WavesInput:
    """Bars, stations and their files, which are checked, with default settings of the reduction."""
    folder = file.path.parent
    gauges = {side: getattr(declared.gauges, side) for side in SIDES}
    gauges |= {} if declared.gauges.incident_far is None else {FAR: declared.gauges.incident_far}
    unknown = [
        file.error(
            f"{_shot_file_table(key)}.recorder",
            f"names no recorder; there are {', '.join(declared.recorders)}",
            cure=f"add a table [recorders.{name}], or correct the name",
        )
        for key, gauge in gauges.items()
        for name in dict.fromkeys(gauge.recorders)
        if name not in declared.recorders
    ]
    files = {f"recorders.{name}.file": recorder.file for name, recorder in declared.recorders.items()}
    refuse([*unknown, *missing_files(file, files)])
    gate(Evidence(file=file, declared=declared))
    bars = {}
    for side in SIDES:
        section = getattr(declared.bars, side)
        given = section.model_dump(exclude={"youngs_modulus", "wave_speed", "prony"})
        bars[side] = Bar(youngs_modulus=section.modulus, **given)
    refuse(
        [
            file.error(
                f"{_shot_file_table(key)}.distance",
                "lies beyond the bar's other end",
                allowed=f"below the bar's length, {1e3 * bar.length:.6g} mm",
            )
            for key, gauge in gauges.items()
            if gauge.distance >= (bar := bars[key.removesuffix(" far")]).length
        ]
    )
    recordings, hashes = _recordings_of(file, declared, gauges, folder)
    clocks = {
        f"recorders.{name}": recording.time
        for key, gauge in gauges.items()
        for name, recording in zip(gauge.recorders, recordings[key], strict=True)
    }
    transit = min(bar.length / bar.wave_speed for bar in bars.values())
    gate(Evidence(file=file, declared=declared, recorders=clocks, bar_transit=transit))
    stations = {}
    for key, gauge in gauges.items():
        try:
            stations[key] = _gauge_station(gauge, recordings[key], bars[key.removesuffix(" far")], declared)
        except ValueError as error:
            raise file.error(f"{_shot_file_table(key)}.bridge", str(error)) from error
    return WavesInput(
        name=declared.name or folder.resolve().name,
        specimen=Specimen(diameter=0.0, length=0.0, density=0.0),
        bars=bars,
        stations=stations,
        load=declared.waves.load,
        switches=Switches(declared.waves.corrections),
        inputs={file.path.name: file.sha256, **hashes},
        settings=declared_settings(file.content),
        notes=_recording_notes(declared, recordings),
    )


def declared_settings(content: Mapping[str, Any]) -> dict[str, str]:
    """The declared values by key, as written in the file, and the software versions."""
    of_bars, of_flyer = ("bars", "recorders", "gauges"), ("force", "incident_force", "flyer")
    kept = ("specimen", *of_bars, *of_flyer, "waves", "uncertainty")
    kept_tables = {name: content[name] for name in kept if name in content}
    said = {key: str(value) for key, value in entries(kept_tables) if not isinstance(value, Mapping)}
    for package in ("kolsky", "numpy", "scipy"):
        try:
            said[package] = version(package)
        except PackageNotFoundError:
            said[package] = "not installed"
    return {**said, "python": platform.python_version()}


WAVES = ("incident", "reflected", "transmitted")
SIZES = {"diameter": "m", "length": "m", "density": "kg/m^3"}
"""SI units of the sizes of a specimen or a bar."""


@dataclass(frozen=True)
class CheckedBars:
    """A bar test that was read and checked, but not reduced."""

    name: str
    """Name of the shot."""
    folder: Path
    """Its folder."""
    given: WavesInput
    """All declarations, and the recordings."""
    incident: BarSignal
    """Strain at the incident gauge."""
    transmission: BarSignal
    """Strain at the transmission gauge."""
    windows: Windows
    """Time windows of the pulses."""
    arrival: Arrival
    """Arrival of the incident pulse at its gauge."""
    checks: tuple[PulseCheck, PulseCheck]
    """Predicted and observed arrival of the reflected and the transmitted pulse."""

    @property
    def inputs(self) -> Mapping[str, str]:
        """SHA-256 of every file, by name."""
        return self.given.inputs


def check_bars(source: Source) -> CheckedBars:
    """Read a shot between bars and find its pulses.

    Raises InputError for a missing or damaged file, a wrong declaration, or signals without such a test.
    """
    file = parsed(source)
    given = load_waves(file)
    tension = given.load == "tension"
    with refused(file.path.parent, cure="correct the distance, gauge or bar that it names in shot.toml"):
        incident, transmission = (station_of(given, side).signal for side in SIDES)
        arrival = incident_arrival(incident, tension=tension)
        if given.windows is None and FAR in given.stations and given.switches["separation"]:
            far = station_of(given, FAR).signal
            windows = overlapping_windows(incident, far, transmission, tension=tension)
        else:
            windows = find_windows(incident, transmission, tension=tension, manual=given.windows)
        checks = check_windows(incident, transmission, tension=tension)
    return CheckedBars(
        name=given.name,
        folder=file.path.parent,
        given=given,
        incident=incident,
        transmission=transmission,
        windows=windows,
        arrival=arrival,
        checks=checks,
    )


Row = tuple[str, str, float | int | str, str]
"""Section, name, value in SI, unit."""


def bar_rows(shot: CheckedBars) -> list[Row]:
    """The checked values as rows, in the order of the shot file."""
    given = shot.given
    rows: list[Row] = [("specimen", key, getattr(given.specimen, key), unit) for key, unit in SIZES.items()]
    for side, bar in given.bars.items():
        section = f"bars.{side}"
        rows += [(section, key, getattr(bar, key), unit) for key, unit in SIZES.items()]
        rows += [
            (section, "wave speed", bar.wave_speed, "m/s"),
            (section, "modulus", bar.youngs_modulus, "Pa"),
            (section, "poisson", bar.poisson, ""),
        ]
    for key, station in given.stations.items():
        signal = {"incident": shot.incident, "transmission": shot.transmission}.get(key)
        rows += _gauge_rows(_shot_file_table(key), station, signal)
    rows += [
        ("waves", "load", given.load, ""),
        ("waves", "arrival at the incident gauge", shot.arrival.time, "s"),
        ("waves", "duration of the incident pulse", shot.arrival.end - shot.arrival.time, "s"),
    ]
    for name, check in zip(WAVES[1:], shot.checks, strict=True):
        rows.append(("waves", f"{name} pulse, predicted", check.predicted, "s"))
        rows.append(("waves", f"{name} pulse", check.reason, ""))
    rows.append(("waves", "windows by", shot.windows.source, ""))
    for name in WAVES:
        first, last = getattr(shot.windows, name)
        rows.append(("waves", f"{name} window", f"{in_us(first)} to {in_us(last)}", ""))
    for key in CORRECTIONS:
        words = "on" if given.switches[key] else "off"
        if key in NO_PART or (key == "separation" and FAR not in given.stations):
            words = "no part in this test"
        elif key == "radial inertia" and key not in given.switches.stated:
            words = "on where the specimen is soft"
        rows.append(("corrections", key, words, ""))
    return rows


def _gauge_rows(section: str, station: StationInput, signal: BarSignal | None) -> list[Row]:
    first = station.recordings[0]
    files = ", ".join(dict.fromkeys(r.path.name for r in station.recordings))
    signs = station.compression if isinstance(station.compression, tuple) else (station.compression,)
    interval = float(first.time[-1] - first.time[0]) / (first.time.size - 1)
    known = station.calibration
    if isinstance(known, Bridge):
        calibration = (
            f"bridge {known.kind}, {known.gauge_factor:g} at {known.excitation:g} V, gain {known.gain:g}"
        )
    else:
        assert isinstance(known, Linear)  # there is no third kind
        calibration = "strain in the file" if known.unit == "1" else f"{known.factor:g} 1/V"
    rows: list[Row] = [
        (section, "file", files, ""),
        (section, "channels", ", ".join(r.channel for r in station.recordings), ""),
        (section, "unit, as read", first.unit, ""),
        (section, "samples", int(first.value.size), ""),
        (section, "clock", clock_words(interval, int(first.value.size)), ""),
        (section, "sample interval", interval, "s"),
        (section, "record start", float(first.time[0]) + station.clock_offset, "s"),
        (section, "record end", float(first.time[-1]) + station.clock_offset, "s"),
        (section, "distance", station.position, "m"),
        (section, "compression", ", ".join("positive" if s > 0 else "negative" for s in signs), ""),
        (section, "calibration", calibration, ""),
        (section, "baseline start", station.baseline[0], "s"),
        (section, "baseline end", station.baseline[1], "s"),
    ]
    if signal is not None:
        value = signal.strain.value
        rows += [
            (section, "largest strain", float(value[np.abs(value).argmax()]), "1"),
            (section, "noise of the strain", signal.strain.sigma, "1"),
        ]
    return rows
