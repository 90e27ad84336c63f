"""The gauge stations of a shot with bars: channels, units, calibrations."""

from collections.abc import Mapping
from pathlib import Path

from kolsky.bars.reduction.common_clock import on_one_clock
from kolsky.bars.reduction.inputs import FAR, SIDES, StationInput
from kolsky.bars.signals.bridge import Bridge, Calibration, Linear
from kolsky.bars.signals.shunt import Shunt, with_shunt
from kolsky.base.apparatus import Bar
from kolsky.base.records import Recording
from kolsky.readers.recordings import read_recordings
from kolsky.readers.signalunits import si_unit
from kolsky.shot.schema.bars import BarsShotFile, GaugeSection
from kolsky.shot.schema.reading import TomlFile


def gauges_of(declared: BarsShotFile) -> dict[str, GaugeSection]:
    """The declared stations by the chain's keys."""
    found = {side: getattr(declared.gauges, side) for side in SIDES}
    return found if declared.gauges.incident_far is None else found | {FAR: declared.gauges.incident_far}


def recordings_of(
    file: TomlFile, declared: BarsShotFile, gauges: Mapping[str, GaugeSection], folder: Path
) -> tuple[dict[str, tuple[Recording, ...]], dict[str, str]]:
    """The channels of all stations, and the hashes of their files.

    A channel's unit is that of its file. One that the shot file states is taken instead; where both are
    there and differ, `recording_notes` says so.
    """
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
                    shot_file_table(key),
                    f"needs a signal in {wanted!r}, channel {recording.channel!r} is in {recording.unit!r}",
                    cure="state the unit of the samples in the recorder's table, or strain = true",
                )
            channels.append(recording)
        found[key] = tuple(channels)
    return found, hashes


def recording_notes(
    declared: BarsShotFile, recordings: Mapping[str, tuple[Recording, ...]]
) -> tuple[str, ...]:
    """Stated units that contradict their file's, and channels that were interpolated to uniform times."""
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


def shot_file_table(key: str) -> str:
    """The table of a station in the shot file."""
    return "gauges." + key.replace(" ", "_")


def station_of(
    gauge: GaugeSection, recordings: tuple[Recording, ...], bar: Bar, declared: BarsShotFile
) -> StationInput:
    """A station as the reduction takes it; channels of two recorders are brought to one clock.

    Raises
    ------
    ValueError
        If its bridge is impossible, or contradicts the shunt's step.
    """
    offsets = [declared.recorders[name].clock_offset for name in gauge.recorders]
    if len(set(gauge.recorders)) > 1:
        recordings = on_one_clock(recordings, offsets)
    return StationInput(
        recordings=recordings,
        calibration=_calibration(gauge, bar),
        position=gauge.distance,
        baseline=gauge.baseline,
        clock_offset=offsets[0],
        compression=gauge.signs,
        full_scale=gauge.full_scale,
    )


def _calibration(gauge: GaugeSection, bar: Bar) -> Calibration:
    if gauge.strain:
        return Linear(1.0, unit="1")
    if gauge.strain_per_volt is not None:
        return Linear(gauge.strain_per_volt)
    assert gauge.bridge is not None  # the validator saw to it
    across = "Poisson" in gauge.bridge.kind
    stated = gauge.bridge.model_dump(exclude={"shunt"})
    bridge = Bridge(**stated, poisson=bar.poisson if across else None)
    if gauge.bridge.shunt is None:
        return bridge
    found, check = with_shunt(bridge, Shunt(**gauge.bridge.shunt.model_dump()))
    if check.compression_sign not in gauge.signs:
        raise ValueError(
            f"the shunt's step of {gauge.bridge.shunt.step:g} V says that compression gives "
            f"{'positive' if check.compression_sign > 0 else 'negative'} volts, declared is "
            f"{gauge.compression!r}; correct the sign of the step or of compression"
        )
    return found
