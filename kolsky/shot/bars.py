"""A shot with bars and gauges: from its shot.toml and files to what `kolsky.bars.reduction.analyse`
reduces."""

import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from kolsky.bars.audit import Switches
from kolsky.bars.guides.polymer_waveguide import PronyModulus
from kolsky.bars.records import Windows
from kolsky.bars.reduction.inputs import FAR, NO_PART, SIDES, StationInput, WavesInput
from kolsky.base.apparatus import Bar, Specimen
from kolsky.base.errors import InputError, refuse
from kolsky.shot.bar_stations import gauges_of, recording_notes, recordings_of, shot_file_table, station_of
from kolsky.shot.schema.bars import BarsShotFile, GaugeSection, WaveBarSection, WavesShotFile
from kolsky.shot.schema.reading import Source, TomlFile, parsed

NOTHING = Specimen(diameter=0.0, length=0.0, density=0.0)
"""No specimen: the bars touch."""


def load_waves(source: Source) -> WavesInput:
    """Load and check what `kolsky waves` needs of a shot.

    Parameters
    ----------
    source
        The shot's folder with its shot.toml, the path of such a file, or the file parsed.

    Raises
    ------
    InputError
        If a file is missing or damaged, or a declaration is unknown, incomplete or impossible.
    """
    file = parsed(source)
    declared = file.validated(WavesShotFile)
    bars, stations, hashes, notes = _record(file, declared)
    specimen = Specimen(**declared.specimen.model_dump())
    _narrower(file, bars, specimen)
    waves = declared.waves
    windows = None
    if waves.incident is not None:
        assert waves.reflected is not None  # the schema saw to all three
        assert waves.transmitted is not None
        windows = Windows(waves.incident, waves.reflected, waves.transmitted, source="shot file")
    uncertainty = declared.uncertainty.for_waves()
    alike = bool(uncertainty.pop("bars_alike"))
    return WavesInput(
        name=declared.name or file.path.parent.resolve().name,
        specimen=specimen,
        bars=bars,
        stations=stations,
        polymers={
            side: PronyModulus(prony.long_term, tuple(prony.moduli), tuple(prony.times))
            for side in SIDES
            if (prony := getattr(declared.bars, side).prony) is not None
        },
        load=waves.load,
        windows=windows,
        analysis=waves.analysis,
        allowance=waves.balance,
        plateau=waves.plateau,
        share=waves.share,
        switches=_switches(file, waves.corrections, FAR in stations),
        uncertainty=uncertainty,
        alike=alike,
        inputs={file.path.name: file.sha256, **hashes},
        settings=declared_settings(file.content),
        notes=notes,
    )


def _switches(file: TomlFile, stated: Mapping[str, bool], two_stations: bool) -> Switches:
    """The switches; one that is on and cannot act is refused."""
    switches = Switches(stated)
    idle = dict(NO_PART)
    if not two_stations:
        idle["separation"] = "it needs a second station on the incident bar"
    elif switches["separation"]:
        idle["free end"] = "two stations tell the waves of the incident bar apart already"
        idle["reflected alignment"] = "two stations give the reflected wave on the incident wave's own clock"
    for key, why in idle.items():
        if switches.stated.get(key, False):
            raise file.error(
                "waves.corrections",
                f"switches {key!r} on, which has no part in this test: {why}",
                cure="remove it" if two_stations or key != "separation" else "add [gauges.incident_far]",
            )
    return switches


def load_bars(source: Source) -> WavesInput:
    """Load and check what `kolsky wavespeed` needs: bars and gauges, no specimen.

    The specimen of the result has no length and must not be used.

    Raises
    ------
    InputError
        As `load_waves`.
    """
    file = parsed(source)
    declared = file.validated(BarsShotFile)
    bars, stations, hashes, notes = _record(file, declared)
    return WavesInput(
        name=declared.name or file.path.parent.resolve().name,
        specimen=NOTHING,
        bars=bars,
        stations=stations,
        load=declared.waves.load,
        switches=Switches(declared.waves.corrections),
        inputs={file.path.name: file.sha256, **hashes},
        settings=declared_settings(file.content),
        notes=notes,
    )


def _record(
    file: TomlFile, declared: BarsShotFile
) -> tuple[dict[str, Bar], dict[str, StationInput], dict[str, str], tuple[str, ...]]:
    """Bars, stations, the hashes of their files and notes about them."""
    folder = file.path.parent
    gauges = gauges_of(declared)
    _all_there(file, declared, gauges, folder)
    bars = {side: _bar(getattr(declared.bars, side)) for side in SIDES}
    _on_its_bar(file, gauges, bars)
    recordings, hashes = recordings_of(file, declared, gauges, folder)
    stations = {}
    for key, gauge in gauges.items():
        try:
            stations[key] = station_of(gauge, recordings[key], bars[key.removesuffix(" far")], declared)
        except ValueError as error:
            raise file.error(f"{shot_file_table(key)}.bridge", str(error)) from error
    return bars, stations, hashes, recording_notes(declared, recordings)


def _bar(section: WaveBarSection) -> Bar:
    return Bar(
        diameter=section.diameter,
        length=section.length,
        youngs_modulus=section.modulus,
        density=section.density,
        poisson=section.poisson,
        yield_strength=section.yield_strength,
    )


def _all_there(
    file: TomlFile, declared: BarsShotFile, gauges: Mapping[str, GaugeSection], folder: Path
) -> None:
    """Unknown recorders and missing files, all at once."""
    problems: list[InputError] = [
        file.error(
            f"{shot_file_table(key)}.recorder",
            f"names no recorder; there are {', '.join(declared.recorders)}",
            cure=f"add a table [recorders.{name}], or correct the name",
        )
        for key, gauge in gauges.items()
        for name in dict.fromkeys(gauge.recorders)
        if name not in declared.recorders
    ]
    problems += [
        file.error(
            f"recorders.{name}.file",
            f"names a missing file: {folder / recorder.file}",
            cure="put it there or correct its name",
        )
        for name, recorder in declared.recorders.items()
        if not (folder / recorder.file).exists()
    ]
    refuse(problems)


def _on_its_bar(file: TomlFile, gauges: Mapping[str, GaugeSection], bars: Mapping[str, Bar]) -> None:
    """Every gauge must sit on its bar."""
    refuse(
        [
            file.error(
                f"{shot_file_table(key)}.distance",
                "lies beyond the bar's other end",
                allowed=f"below the bar's length, {1e3 * bar.length:.6g} mm",
            )
            for key, gauge in gauges.items()
            if gauge.distance >= (bar := bars[key.removesuffix(" far")]).length
        ]
    )


def _narrower(file: TomlFile, bars: Mapping[str, Bar], specimen: Specimen) -> None:
    """The specimen must not be wider than a bar."""
    refuse(
        [
            file.error(
                "specimen.diameter",
                "is wider than a bar, which cannot press on what lies beside it",
                allowed=f"up to the {side} bar's diameter, {1e3 * bar.diameter:.6g} mm",
            )
            for side, bar in bars.items()
            if specimen.diameter > bar.diameter
        ][:1]
    )


def declared_settings(content: Mapping[str, Any]) -> dict[str, str]:
    """Declarations, key by key as written, and the versions."""
    kept = (
        "specimen",
        "bars",
        "recorders",
        "gauges",
        "force",
        "incident_force",
        "flyer",
        "waves",
        "uncertainty",
    )
    said = dict(_flat({name: content[name] for name in kept if name in content}))
    for package in ("kolsky", "numpy", "scipy"):
        try:
            said[package] = version(package)
        except PackageNotFoundError:
            said[package] = "not installed"
    return {**said, "python": platform.python_version()}


def _flat(table: Mapping[str, Any], above: str = "") -> list[tuple[str, str]]:
    rows: list[tuple[str, str]] = []
    for key, value in table.items():
        name = f"{above}.{key}" if above else key
        rows += _flat(value, name) if isinstance(value, Mapping) else [(name, str(value))]
    return rows
