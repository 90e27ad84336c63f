"""A shot with bars and gauges: from its shot.toml and files to what `kolsky.waves.chain` reduces."""

import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from kolsky.apparatus import Bar, Specimen
from kolsky.errors import InputError, refuse
from kolsky.readers.recordings import read_recordings
from kolsky.records import Recording
from kolsky.shots import find_shot_file
from kolsky.shottoml import TomlFile, read_declared
from kolsky.waves.audit import Switches
from kolsky.waves.bridge import Bridge, Calibration, Linear
from kolsky.waves.chain import SIDES, StationInput, WavesInput
from kolsky.waves.records import Windows
from kolsky.wavesfile import GaugeSection, WaveBarSection, WavesShotFile


def load_waves(folder_or_toml: str | Path) -> WavesInput:
    """Load and check what `kolsky waves` needs of a shot.

    Parameters
    ----------
    folder_or_toml
        The shot's folder with its shot.toml, or the path of such a file.

    Raises
    ------
    InputError
        If a file is missing or damaged, or a declaration is unknown, incomplete or impossible.
    """
    file, declared = read_declared(find_shot_file(Path(folder_or_toml)), lambda content: WavesShotFile)
    folder = file.path.parent
    _all_there(file, declared, folder)
    recordings, hashes = _recordings(file, declared, folder)
    bars = {side: _bar(getattr(declared.bars, side)) for side in SIDES}
    specimen = Specimen(**declared.specimen.model_dump())
    _fits(file, declared, bars, specimen)
    waves = declared.waves
    windows = None
    if waves.incident is not None:
        windows = Windows(waves.incident, waves.reflected, waves.transmitted, source="shot file")
    uncertainty = declared.uncertainty.model_dump()
    alike = bool(uncertainty.pop("bars_alike"))
    return WavesInput(
        name=declared.name or folder.resolve().name,
        specimen=specimen,
        bars=bars,
        stations={
            side: _station(getattr(declared.gauges, side), recordings[side], bars[side], declared)
            for side in SIDES
        },
        load=waves.load,
        windows=windows,
        allowance=waves.balance,
        switches=Switches(waves.corrections),
        uncertainty=uncertainty,
        alike=alike,
        inputs={file.path.name: file.sha256, **hashes},
        settings=declared_settings(file.content),
    )


def _bar(section: WaveBarSection) -> Bar:
    return Bar(
        diameter=section.diameter,
        length=section.length,
        youngs_modulus=section.modulus,
        density=section.density,
        poisson=section.poisson,
    )


def _recordings(
    file: TomlFile, declared: WavesShotFile, folder: Path
) -> tuple[dict[str, tuple[Recording, ...]], dict[str, str]]:
    """The channels of both stations, and the hashes of their files."""
    found, hashes = {}, {}
    for side in SIDES:
        gauge: GaugeSection = getattr(declared.gauges, side)
        recorder = declared.recorders[gauge.recorder]
        unit = recorder.unit or ("1" if gauge.strain else "V")
        layout = recorder.as_layout(full_scale=gauge.full_scale, unit=unit)
        names = [str(channel) for channel in gauge.channels]
        read = read_recordings(folder / recorder.file, names, layout=layout)
        found[side] = tuple(read[name] for name in names)
        wanted = "1" if gauge.strain else "V"
        for recording in found[side]:
            hashes[recorder.file] = recording.sha256
            if recording.unit != wanted:
                raise file.error(
                    f"gauges.{side}",
                    f"needs a signal in {wanted!r}, channel {recording.channel!r} is in {recording.unit!r}",
                    cure="state the unit of the samples in the recorder's table, or strain = true",
                )
    return found, hashes


def _station(
    gauge: GaugeSection, recordings: tuple[Recording, ...], bar: Bar, declared: WavesShotFile
) -> StationInput:
    return StationInput(
        recordings=recordings,
        calibration=_calibration(gauge, bar),
        position=gauge.distance,
        baseline=gauge.baseline,
        clock_offset=declared.recorders[gauge.recorder].clock_offset,
        compression=1 if gauge.compression == "positive" else -1,
        full_scale=gauge.full_scale,
    )


def _calibration(gauge: GaugeSection, bar: Bar) -> Calibration:
    if gauge.strain:
        return Linear(1.0, unit="1")
    if gauge.strain_per_volt is not None:
        return Linear(gauge.strain_per_volt)
    assert gauge.bridge is not None  # the validator saw to it
    across = "Poisson" in gauge.bridge.kind
    return Bridge(**gauge.bridge.model_dump(), poisson=bar.poisson if across else None)


def _all_there(file: TomlFile, declared: WavesShotFile, folder: Path) -> None:
    """Unknown recorders and missing files, all at once."""
    problems: list[InputError] = []
    for side in SIDES:
        name = getattr(declared.gauges, side).recorder
        if name not in declared.recorders:
            problems.append(
                file.error(
                    f"gauges.{side}.recorder",
                    f"names no recorder; there are {', '.join(declared.recorders)}",
                    cure=f"add a table [recorders.{name}], or correct the name",
                )
            )
    for name, recorder in declared.recorders.items():
        if not (folder / recorder.file).exists():
            problems.append(
                file.error(
                    f"recorders.{name}.file",
                    f"names a missing file: {folder / recorder.file}",
                    cure="put it there or correct its name",
                )
            )
    refuse(problems)


def _fits(file: TomlFile, declared: WavesShotFile, bars: Mapping[str, Bar], specimen: Specimen) -> None:
    """What the tables say together must be possible."""
    problems = []
    for side, bar in bars.items():
        gauge: GaugeSection = getattr(declared.gauges, side)
        if gauge.distance >= bar.length:
            problems.append(
                file.error(
                    f"gauges.{side}.distance",
                    "lies beyond the bar's other end",
                    allowed=f"below the bar's length, {1e3 * bar.length:.6g} mm",
                )
            )
        if specimen.diameter > bar.diameter:
            problems.append(
                file.error(
                    "specimen.diameter",
                    "is wider than a bar, which cannot press on what lies beside it",
                    allowed=f"up to the {side} bar's diameter, {1e3 * bar.diameter:.6g} mm",
                )
            )
    refuse(problems)


def declared_settings(content: Mapping[str, Any]) -> dict[str, str]:
    """What was declared, key by key as written, and the versions."""
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
