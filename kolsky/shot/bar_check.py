"""A shot between bars as far as `kolsky check` reads it: files, gauges, arrivals and windows."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from kolsky.bars.audit import CORRECTIONS
from kolsky.bars.records import BarSignal, Windows
from kolsky.bars.reduction.inputs import FAR, NO_PART, SIDES, StationInput, WavesInput
from kolsky.bars.reduction.overlap import overlapping_windows
from kolsky.bars.reduction.pulse_checks import PulseCheck, check_windows
from kolsky.bars.reduction.varied_test import station_of
from kolsky.bars.reduction.windows import find_windows, incident_arrival
from kolsky.bars.signals.arrival import Arrival
from kolsky.bars.signals.bridge import Bridge, Linear
from kolsky.base.apparatus import Bar
from kolsky.base.errors import InputError
from kolsky.shot.bars import load_waves
from kolsky.shot.schema.reading import Source, parsed
from kolsky.shot.schema.uncertainty import REDUCED

WAVES = ("incident", "reflected", "transmitted")


@dataclass(frozen=True)
class CheckedBars:
    """What was understood of a shot between bars; nothing is reduced yet."""

    name: str
    """Name of the shot."""
    folder: Path
    """Its folder."""
    given: WavesInput
    """Everything declared, and the recordings."""
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

    @property
    def load(self) -> str:
        """ "compression" or "tension"."""
        return self.given.load


def check_bars(source: Source) -> CheckedBars:
    """Read a shot between bars and find its pulses.

    Raises
    ------
    InputError
        If a file is missing or damaged, a declaration is impossible, or the signals hold no such test.
    """
    file = parsed(source)
    given = load_waves(file)
    tension = given.load == "tension"
    try:
        incident, transmission = (station_of(given, side).signal for side in SIDES)
        arrival = incident_arrival(incident, tension=tension)
        if given.windows is None and FAR in given.stations and given.switches["separation"]:
            far = station_of(given, FAR).signal
            windows = overlapping_windows(incident, far, transmission, tension=tension)
        else:
            windows = find_windows(incident, transmission, tension=tension, manual=given.windows)
        checks = check_windows(incident, transmission, tension=tension)
    except ValueError as error:
        raise InputError(
            file.path.parent, str(error), cure="correct the distance, gauge or bar that it names in shot.toml"
        ) from error
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
    """What was understood, row by row, in the order of the shot file."""
    given = shot.given
    rows: list[Row] = [
        ("specimen", "diameter", given.specimen.diameter, "m"),
        ("specimen", "length", given.specimen.length, "m"),
        ("specimen", "density", given.specimen.density, "kg/m^3"),
    ]
    for side in SIDES:
        rows += _bar(f"bars.{side}", given.bars[side])
    for key, station in given.stations.items():
        signal = {"incident": shot.incident, "transmission": shot.transmission}.get(key)
        rows += _gauge(f"gauges.{key.replace(' ', '_')}", station, signal)
    rows += _waves(shot)
    rows += [("corrections", key, _switch(given, key), "") for key in CORRECTIONS]
    return rows


def _switch(given: WavesInput, key: str) -> str:
    """How a correction stands, in words."""
    if key in NO_PART or (key == "separation" and FAR not in given.stations):
        return "no part in this test"
    if key == "radial inertia" and key not in given.switches.stated:
        return "on where the specimen is soft"
    return "on" if given.switches[key] else "off"


def undeclared(shot: CheckedBars) -> list[str]:
    """Keys of [uncertainty] that count as exact; of modulus and wave speed one is enough."""
    stated = {key for key, value in shot.given.uncertainty.items() if value > 0.0}
    other = {"bar_modulus": "bar_wave_speed", "bar_wave_speed": "bar_modulus"}
    return [key for key in REDUCED if key not in stated and other.get(key) not in stated]


def _bar(section: str, bar: Bar) -> list[Row]:
    return [
        (section, "diameter", bar.diameter, "m"),
        (section, "length", bar.length, "m"),
        (section, "density", bar.density, "kg/m^3"),
        (section, "wave speed", bar.wave_speed, "m/s"),
        (section, "modulus", bar.youngs_modulus, "Pa"),
        (section, "poisson", bar.poisson, ""),
    ]


def _gauge(section: str, station: StationInput, signal: BarSignal | None) -> list[Row]:
    first = station.recordings[0]
    files = ", ".join(dict.fromkeys(r.path.name for r in station.recordings))
    signs = station.compression if isinstance(station.compression, tuple) else (station.compression,)
    rows: list[Row] = [
        (section, "file", files, ""),
        (section, "channels", ", ".join(r.channel for r in station.recordings), ""),
        (section, "unit, as read", first.unit, ""),
        (section, "samples", int(first.value.size), ""),
        (section, "sample interval", float(first.time[-1] - first.time[0]) / (first.time.size - 1), "s"),
        (section, "record start", float(first.time[0]) + station.clock_offset, "s"),
        (section, "record end", float(first.time[-1]) + station.clock_offset, "s"),
        (section, "distance", station.position, "m"),
        (section, "compression", ", ".join("positive" if s > 0 else "negative" for s in signs), ""),
        (section, "calibration", _calibration(station), ""),
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


def _calibration(station: StationInput) -> str:
    known = station.calibration
    if isinstance(known, Bridge):
        return f"bridge {known.kind}, {known.gauge_factor:g} at {known.excitation:g} V, gain {known.gain:g}"
    assert isinstance(known, Linear)  # there is no third kind
    return "strain in the file" if known.unit == "1" else f"{known.factor:g} 1/V"


def _waves(shot: CheckedBars) -> list[Row]:
    rows: list[Row] = [
        ("waves", "load", shot.load, ""),
        ("waves", "arrival at the incident gauge", shot.arrival.time, "s"),
        ("waves", "duration of the incident pulse", shot.arrival.end - shot.arrival.time, "s"),
    ]
    for name, check in zip(WAVES[1:], shot.checks, strict=True):
        rows.append(("waves", f"{name} pulse, predicted", check.predicted, "s"))
        rows.append(("waves", f"{name} pulse", check.reason, ""))
    rows.append(("waves", "windows by", shot.windows.source, ""))
    for name in WAVES:
        first, last = getattr(shot.windows, name)
        rows.append(("waves", f"{name} window", f"{1e6 * first:.6g} to {1e6 * last:.6g} us", ""))
    return rows
