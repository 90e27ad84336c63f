"""Read channels of a recorder's file by name, with checks, in SI units, on an exactly uniform clock.

A new format is `sniff` and `read` in a module, and one line in `FORMATS`. Every channel is
checked. Its samples must be finite, must change, and must not be clipped.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.records import Recording
from kolsky.readers import delimited, hdf5, labview_lvm, lanl_raw, matlab, scope_binary, tdms, tektronix_csv
from kolsky.readers.contents import (
    LARGEST_SAMPLE,
    Channel,
    ChannelInfo,
    Clock,
    Contents,
    check_name,
    check_steps,
    find_column,
    head_of,
)
from kolsky.readers.excel import EXCEL, EXCEL_97
from kolsky.readers.header import si_unit
from kolsky.readers.layout import Layout
from kolsky.readers.table import Column, read_table


class RecorderFormat(Protocol):
    """The functions of a module that reads one format."""

    def sniff(self, path: Path, /) -> bool:
        """True if a file looks like this format, by its ending and first bytes."""

    def read(self, path: Path, layout: Layout) -> Contents:
        """Its channels; raises `InputError`."""


FORMATS: Mapping[str, RecorderFormat] = {
    "excel": EXCEL,
    "excel 97": EXCEL_97,
    "tdms": tdms,
    "matlab": matlab,
    "hdf5": hdf5,
    "lvm": labview_lvm,
    "tektronix": tektronix_csv,
    "lanl": lanl_raw,
    "scope": scope_binary,
    "delimited": delimited,
}
"""Name -> module or object. Each format is one line here. Text of any program comes last.

:meta hide-value:
"""


SHORTEST_FLAT_TOP = 8
"""Shortest run of equal samples at an extreme that counts as clipping."""
LONGER_THAN_OTHERS = 4
"""Factor by which a clipped run is longer than any other run of equal samples in the record."""


def check_finite(path: Path, channel: Channel, values: FloatArray) -> None:
    """Check that no sample is NaN, infinite or too large for a measurement.

    Raises InputError with the first such sample and their number.
    """
    bad = np.flatnonzero(~(np.abs(values) <= LARGEST_SAMPLE))  # NaN compares false
    if bad.size:
        raise _channel_error(
            path,
            channel,
            int(bad[0]),
            f"is {values[bad[0]]}" + (f", the first of {bad.size}" if bad.size > 1 else ""),
            f"a recorder gives every sample a value of at most {LARGEST_SAMPLE:g}; export again without gaps",
        )


def check_changing(path: Path, channel: Channel, values: FloatArray) -> None:
    """Check that a channel is not constant."""
    if np.ptp(values) == 0.0:
        message = f"channel '{channel.name}' is {values[0]:.6g} in all {values.size} samples"
        cure = "is it the right channel, and was it connected?"
        raise InputError(path, message, line=channel.place(0), cure=cure)


def check_unclipped(
    path: Path, channel: Channel, values: FloatArray, unit: str, full_scale: float | None
) -> None:
    """Check that a channel is not clipped.

    With a full scale, no sample may reach it. Without one, clipping is detected by a flat top: a run of at
    least eight equal samples at the largest or smallest value. It must be four times longer than any run at
    another value. The signal must not begin at that value. (A quiet baseline can be an extreme, and coarse
    digits cause short runs.)
    """
    if full_scale is not None:
        clipped = np.flatnonzero(np.abs(values) >= full_scale)
        if clipped.size:
            raise _channel_error(
                path,
                channel,
                int(clipped[0]),
                f"is clipped: {values[clipped[0]]:.6g} {unit} in the first of {clipped.size} samples at or"
                f" beyond full scale ({full_scale:g} {unit})",
                "clipped samples cannot be restored; repeat the test at a coarser range, or correct "
                "full_scale",
            )
        return
    starts = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0.0]))
    lengths = np.diff(np.append(starts, values.size))
    levels = values[starts]
    low, high = float(values.min()), float(values.max())
    inner = lengths[(levels != low) & (levels != high)]
    longest_inner = int(inner.max()) if inner.size else 1
    beginning = float(np.median(values[: max(1, values.size // 50)]))
    for extreme in (high, low):
        if abs(beginning - extreme) < 0.2 * (high - low):
            continue
        runs = np.flatnonzero(levels == extreme)
        longest = int(lengths[runs].max())
        if longest >= max(SHORTEST_FLAT_TOP, LONGER_THAN_OTHERS * longest_inner):
            first = int(starts[runs[np.argmax(lengths[runs])]])
            raise _channel_error(
                path,
                channel,
                first,
                f"is clipped: {longest} equal samples at its extreme {extreme:.6g} {unit}, elsewhere at most"
                f" {longest_inner}",
                "clipped samples cannot be restored; repeat the test at a coarser range, or, if the "
                "signal is truly flat, state full_scale",
            )


def _channel_error(path: Path, channel: Channel, sample: int, message: str, cure: str) -> InputError:
    line = channel.place(sample)
    where = "" if line is not None else f", sample {sample + 1}"
    return InputError(path, f"channel '{channel.name}'{where} {message}", line=line, cure=cure)


_FOUND = Layout()


def read_recordings(path: Path, channels: Sequence[str], *, layout: Layout = _FOUND) -> dict[str, Recording]:
    """Read channels of a recorder's file.

    ``path``: the file. ``channels``: names of channels as in the file, or their numbers ("2"). ``layout``:
    the declared layout; other properties are detected. Returns: a recording for each requested name. Samples
    are in the SI unit of the file's or the declared unit, at ``start + i * interval``. Raises InputError if
    the file cannot be read or is cut off; if a channel is missing, not finite, constant or clipped; if its
    unit or times are unknown; or if its time column is rounded.
    """
    contents = read_contents(path, layout=layout)
    return {name: _recording(contents, _find(contents, name), layout) for name in channels}


def read_scope(path: Path, *, time: Column, voltage: Column) -> Recording:
    """One channel of a comma-separated oscilloscope export with one header line, at its printed times.

    ``path``: comma-separated text with one header line. ``time``: the time column; its factor converts to
    seconds. ``voltage``: the channel's column; its factor converts to volts. Returns: time as in the file [s]
    and volts [V], shape [n_samples]. Raises InputError if the file is not such a table, or if times repeat or
    are not sorted. The same error is raised if their steps differ by more than the printed digits explain (a
    gap). It is also raised if the printed digits are too few.
    """
    table = read_table(path)
    t, volts = table.values(time), table.values(voltage)
    table.check_increasing(time, t)
    if t.size < 3:
        raise table.error("has fewer than 3 samples", cure="export the whole record")
    digit = np.full(t.size, table.printed_digit(time))
    check_steps(t, digit, name=time.name, fault=table.error, largest_variation=0.0)
    return Recording(
        time=t,
        value=volts,
        channel=voltage.name,
        unit="V",
        path=path,
        sha256=table.sha256,
        first_line=table.first_line,
    )


def list_channels(path: Path, *, layout: Layout = _FOUND) -> list[ChannelInfo]:
    """The channels of a file, without checks of their samples. A channel without a clock gives the reason.

    Raises InputError if the file cannot be read.
    """
    contents, found = read_contents(path, layout=layout), []
    for channel in contents.channels:
        start, interval = None, None
        try:
            clock = _clock(contents, channel)
            start, interval, words = clock.start, clock.interval, clock.source
        except InputError as error:
            words = error.message if error.cure is None else f"{error.message}. Cure: {error.cure}"
        said = channel.name, channel.number, channel.unit, channel.samples
        found.append(ChannelInfo(*said, start, interval, words, contents.facts, contents.metadata))
    return found


def read_contents(path: Path, *, layout: Layout = _FOUND) -> Contents:
    """The unchecked channels of a file, with facts and metadata.

    Raises InputError if the file cannot be read, or if its format is unknown.
    """
    if layout.format is not None and layout.format not in FORMATS:
        message = f"is declared to have the format '{layout.format}'"
        raise InputError(path, message, allowed=f"one of {', '.join(FORMATS)}")
    if layout.interval is not None and not 0.0 < layout.interval < float("inf"):
        raise InputError(path, f"is declared with the interval {layout.interval} s", allowed="> 0 s")
    if layout.start is not None and not np.isfinite(layout.start):
        raise InputError(path, f"is declared to start at {layout.start} s", allowed="finite")
    if layout.full_scale is not None and not 0.0 < layout.full_scale < float("inf"):
        raise InputError(path, f"is declared to have the full scale {layout.full_scale}", allowed="> 0")
    if layout.format is not None:
        return FORMATS[layout.format].read(path, layout)
    if not path.is_file():
        raise InputError(path, "there is no such file", cure="put it there or correct its name")
    for form in FORMATS.values():
        if form.sniff(path):
            return form.read(path, layout)
    head = head_of(path)
    if not head.strip():
        raise InputError(path, "is empty", cure="export or copy it again")
    check_name(path)
    if head.count(0) == 0 and path.suffix.lower() not in delimited.SUFFIXES:
        raise InputError(
            path,
            f"seems to be text, and its name ends in '{path.suffix}'",
            cure=f"rename it to end in one of {', '.join(filter(None, delimited.SUFFIXES))}, or declare "
            'format = "delimited" in a layout',
        )
    cure = f"is it the right file? if so, give its format in a layout: {', '.join(FORMATS)}"
    raise InputError(path, "is of no known format", cure=cure)


def _find(contents: Contents, wanted: str) -> Channel:
    names, numbers = [c.name for c in contents.channels], [c.number for c in contents.channels]
    words = ", ".join(f"'{name}'" for name in names[:20]) + contents.without_numbers()
    return contents.channels[
        find_column(contents.path, names, wanted, "channel", numbers=numbers, listed=words)
    ]


def _recording(contents: Contents, channel: Channel, layout: Layout) -> Recording:
    unit, factor = _unit(contents, channel, layout)
    raw = channel.values()
    check_finite(contents.path, channel, raw)
    check_changing(contents.path, channel, raw)
    value = raw * factor
    check_unclipped(contents.path, channel, value, unit, layout.full_scale)
    clock = _clock(contents, channel)
    time, note = clock.times(channel.samples), ""
    if clock.measured is not None:
        value, note = _at_uniform_times(channel.name, clock.measured, value, time)
    return Recording(
        time=time,
        value=value,
        channel=channel.name,
        unit=unit,
        path=contents.path,
        sha256=contents.sha256,
        file_unit=channel.unit,
        note=note,
    )


def _at_uniform_times(
    name: str, measured: FloatArray, value: FloatArray, time: FloatArray
) -> tuple[FloatArray, str]:
    """Samples interpolated from times with varying steps to uniform times, and a note about it."""
    from scipy.interpolate import CubicSpline  # for such files only

    step = float(time[1] - time[0])
    varies = float(np.abs(np.diff(measured) / step - 1.0).max())
    return np.asarray(CubicSpline(measured, value)(time)), (
        f"the sampling steps of channel '{name}' vary by up to {100.0 * varies:.2g} %; its samples were "
        f"interpolated to uniform steps of {step:.6g} s (cubic spline); cure: none is needed where the "
        "recorder's clock does vary, else export the times with more digits"
    )


def _unit(contents: Contents, channel: Channel, layout: Layout) -> tuple[str, float]:
    """SI unit and factor of a channel."""
    text = layout.unit if layout.unit is not None else channel.unit
    if text is None:
        cure = 'give it in the layout (of bars: in the recorder): unit = "V", "mV", "microstrain", ...'
        raise InputError(contents.path, f"does not state the unit of channel '{channel.name}'", cure=cure)
    known = si_unit(text)
    if known is None:
        message = f"channel '{channel.name}' has the unit '{text}'"
        allowed = 'a unit such as "V", "mV", "N", "Pa", "strain"'
        cure = 'declare it in the layout: unit = "mV"'
        raise InputError(contents.path, message, allowed=allowed, cure=cure)
    return known


def _clock(contents: Contents, channel: Channel) -> Clock:
    """The clock of a channel, if its times can be counted."""
    clock = channel.clock()
    if not (abs(clock.start) <= LARGEST_SAMPLE and 0.0 < clock.interval <= LARGEST_SAMPLE):
        raise InputError(
            contents.path,
            f"channel '{channel.name}' starts at {clock.start:g} s with an interval of {clock.interval:g} s",
            allowed=f"finite times of at most {LARGEST_SAMPLE:g} s, and an interval > 0 s",
            cure="state start and interval in the layout",
        )
    return clock
