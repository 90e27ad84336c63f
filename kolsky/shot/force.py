"""The recording of [force]: by the strict reader of scope exports, or by the layout that the shot says."""

from dataclasses import replace
from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.base.records import Recording
from kolsky.readers import scope_csv
from kolsky.shot.schema.measured import ForceSection

_SECONDS = {1.0: "s", 1e-3: "ms", 1e-6: "us", 1e-9: "ns"}


def force_recording(path: Path, section: ForceSection) -> Recording:
    """Read the channel that `section` names, in volts.

    Without a layout a file is comma-separated text with one header line, and its time column is taken as it
    is.

    Raises
    ------
    InputError
        As the reader; also if the layout's file is not in a unit of volts.
    """
    if section.layout is None:
        assert section.time is not None  # the section has one of the two
        return scope_csv.read(path, time=section.time.as_column(), voltage=section.voltage.as_column())
    from kolsky.readers.recordings import read_recordings

    time, unit = None, None
    if section.time is not None:
        time, unit = section.time.column, _SECONDS.get(section.time.unit)
        if unit is None:
            raise InputError(path, "force.time has an unusual unit", allowed='"s", "ms", "us" or "ns"')
    factor = section.voltage.unit
    layout = section.layout.as_layout(
        full_scale=section.full_scale / factor, unit="V", time=time, time_unit=unit
    )
    name = section.voltage.column
    recording = read_recordings(path, [name], layout=layout)[name]
    return recording if factor == 1.0 else replace(recording, value=recording.value * factor)
