"""Channels of a recorder's file, by name: found, judged, in SI units, on an exactly uniform clock."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.records import Recording
from kolsky.readers import judge
from kolsky.readers.contents import LARGEST_SAMPLE, Channel, ChannelInfo, Clock, Contents, Layout
from kolsky.readers.formats import FORMATS
from kolsky.readers.signalunits import si_unit
from kolsky.readers.table import Column, Table, read_table
from kolsky.readers.timecolumn import LARGEST_JITTER

_FOUND = Layout()


def read_recordings(path: Path, channels: Sequence[str], *, layout: Layout = _FOUND) -> dict[str, Recording]:
    """Read channels of a recorder's file.

    Parameters
    ----------
    path
        The file.
    channels
        Names of channels as the file has them, or their numbers ("2").
    layout
        What is said about the file; the rest is found in it.

    Returns
    -------
    dict
        A recording for each name asked for: samples in the SI unit that belongs to the file's or the stated
        unit, at ``start + i * interval``.

    Raises
    ------
    InputError
        If the file cannot be read, is cut off, or a channel is missing, holds anything but finite numbers,
        never changes or is clipped; if its unit or its times are not known, or its time column is rounded.
    """
    contents = read_contents(path, layout=layout)
    return {name: _recording(contents, _find(contents, name), layout) for name in channels}


def read_scope(path: Path, *, time: Column, voltage: Column) -> Recording:
    """One channel of an oscilloscope's export of commas and one header line, its times as they are printed.

    Parameters
    ----------
    path
        Comma-separated text with one header line.
    time
        The time column; its factor leads to seconds.
    voltage
        The channel's column; its factor leads to volts.

    Returns
    -------
    Recording
        Time as the file gives it [s] and volts [V], shape [n_samples].

    Raises
    ------
    InputError
        If the file is not such a table, if times repeat or are not sorted, or if the steps between
        them differ by more than the printed digits explain (a gap) or because of them (too few digits).
    """
    table = read_table(path)
    t, volts = table.values(time), table.values(voltage)
    table.check_increasing(time, t)
    _check_uniform(table, time, t)
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
    """The channels of a file, their samples not judged; one without a known clock says why.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    contents = read_contents(path, layout=layout)
    return [_info(contents, channel) for channel in contents.channels]


def read_contents(path: Path, *, layout: Layout = _FOUND) -> Contents:
    """The channels of a file before anything is asked of them, with facts and metadata.

    Raises
    ------
    InputError
        If the file cannot be read, or is of no known format.
    """
    _check_layout(path, layout)
    if layout.format is not None:
        return FORMATS[layout.format].read(path, layout)
    if not path.is_file():
        raise InputError(path, "there is no such file", cure="put it there or correct its name")
    for form in FORMATS.values():
        if form.sniff(path):
            return form.read(path, layout)
    if path.stat().st_size == 0:
        raise InputError(path, "is empty", cure="export or copy it again")
    raise InputError(
        path,
        "is of no known format",
        cure=f"is it the right file? if so, say its format in a layout: {', '.join(FORMATS)}",
    )


def _check_layout(path: Path, layout: Layout) -> None:
    if layout.format is not None and layout.format not in FORMATS:
        raise InputError(
            path, f"is said to have the format '{layout.format}'", allowed=f"one of {', '.join(FORMATS)}"
        )
    if layout.interval is not None and not 0.0 < layout.interval < float("inf"):
        raise InputError(path, f"is said to have the interval {layout.interval} s", allowed="> 0 s")
    if layout.start is not None and not np.isfinite(layout.start):
        raise InputError(path, f"is said to start at {layout.start} s", allowed="finite")
    if layout.full_scale is not None and not 0.0 < layout.full_scale < float("inf"):
        raise InputError(path, f"is said to have the full scale {layout.full_scale}", allowed="> 0")


def _find(contents: Contents, wanted: str) -> Channel:
    named = [channel for channel in contents.channels if channel.name == wanted]
    if not named and wanted.isdecimal():
        named = [channel for channel in contents.channels if channel.number == int(wanted)]
    if len(named) == 1:
        return named[0]
    if named:
        numbers = ", ".join(str(channel.number) for channel in named)
        raise InputError(
            contents.path, f"has {len(named)} channels '{wanted}'", cure=f"ask by number: {numbers}"
        )
    names = ", ".join(f"'{channel.name}'" for channel in contents.channels[:20])
    raise InputError(
        contents.path,
        f"channel '{wanted}' is missing; the channels are {names}",
        cure="correct the name, or give its number; `kolsky channels FILE` shows what was found",
    )


def _recording(contents: Contents, channel: Channel, layout: Layout) -> Recording:
    unit, factor = _unit(contents, channel, layout)
    raw = channel.values()
    judge.finite(contents.path, channel, raw)
    judge.changing(contents.path, channel, raw)
    value = raw * factor
    judge.unclipped(contents.path, channel, value, unit, layout.full_scale)
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
    """Samples interpolated from times whose steps vary to uniform ones, and a sentence that says so."""
    from scipy.interpolate import CubicSpline  # for such files only

    step = float(time[1] - time[0])
    varies = float(np.abs(np.diff(measured) / step - 1.0).max())
    return np.asarray(CubicSpline(measured, value)(time)), (
        f"the sampling steps of channel '{name}' vary by up to {100.0 * varies:.2g} %, so that its samples "
        f"were interpolated to uniform steps of {step:.6g} s (cubic spline); cure: none is needed where the "
        "recorder's clock does vary, else export the times with more digits"
    )


def _unit(contents: Contents, channel: Channel, layout: Layout) -> tuple[str, float]:
    """SI unit and factor of a channel."""
    text = layout.unit if layout.unit is not None else channel.unit
    if text is None:
        raise InputError(
            contents.path,
            f"does not say the unit of channel '{channel.name}'",
            cure='say it in the layout (of bars: in the recorder): unit = "V", "mV", "microstrain", ...',
        )
    known = si_unit(text)
    if known is None:
        raise InputError(
            contents.path,
            f"channel '{channel.name}' has the unit '{text}'",
            allowed='a unit such as "V", "mV", "N", "Pa", "strain"',
            cure='say it in the layout: unit = "mV"',
        )
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


def _info(contents: Contents, channel: Channel) -> ChannelInfo:
    try:
        clock = _clock(contents, channel)
    except InputError as error:
        start, interval = None, None
        words = error.message if error.cure is None else f"{error.message}. Cure: {error.cure}"
    else:
        start, interval, words = clock.start, clock.interval, clock.source
    return ChannelInfo(
        name=channel.name,
        number=channel.number,
        unit=channel.unit,
        samples=channel.samples,
        start=start,
        interval=interval,
        time=words,
        facts=contents.facts,
        metadata=contents.metadata,
    )


def _check_uniform(table: Table, column: Column, time: FloatArray) -> None:
    """A scope samples at equal steps; anything else is a gap or a rounded column."""
    if time.size < 3:
        raise table.error("has fewer than 3 samples", cure="export the whole record")
    digit = table.printed_digit(column)
    steps = np.diff(time)
    step = float(np.median(steps))
    # Each printed time is off by half a digit at most, so a step by one digit (and the float's round-off).
    worst = int(np.argmax(np.abs(steps - step)))
    excess = abs(float(steps[worst]) - step)
    if excess > 1.001 * digit + 1e-9 * step:
        raise table.error(
            f"column '{column.name}': the step is {steps[worst]:.6g} s where the others are {step:.6g} s,"
            f" and the printed digit is only {digit:.0e} s",
            row=worst + 1,
            cure="export the record again without gaps",
        )
    if excess > LARGEST_JITTER * step:
        raise table.error(
            f"column '{column.name}' is rounded to {digit:.0e} s: steps between {steps.min():.6g} and"
            f" {steps.max():.6g} s in a uniform record",
            row=worst + 1,
            cure="export the times with more digits",
        )
