"""National Instruments TDMS, through npTDMS (https://github.com/adamreeve/npTDMS)."""

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.readers.contents import Channel, Clock, Contents, check_samples, file_hash, head_of, stated_clock
from kolsky.readers.hdf5 import NamedArray, clock_of_array
from kolsky.readers.header import clock_of_numbers
from kolsky.readers.layout import Layout

_CLOCK = ("wf_increment", "wf_start_offset")
"""Properties of a waveform that declare its clock."""


def sniff(path: Path) -> bool:
    """True if a file begins with the tag of a TDMS segment."""
    return head_of(path, 4) == b"TDSm"


def read(path: Path, layout: Layout) -> Contents:
    """Read all numeric channels. The name of a channel is "group/channel".

    Raises InputError if npTDMS is missing, or if the file is damaged, cut off or without a numeric channel.
    """
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise InputError(path, "needs npTDMS", cure="pip install npTDMS") from None
    sha256 = file_hash(path)
    try:
        with _strict(), path.open("rb") as stream, TdmsFile.open(stream, raw_timestamps=True) as file:
            incomplete = file.file_status.incomplete_final_segment
            metadata = {str(k): str(v)[:500] for k, v in file.properties.items()}
            found = [
                (f"{group.name}/{channel.name}", len(channel), dict(channel.properties), channel.dtype)
                for group in file.groups()
                for channel in group.channels()
            ]
            waveforms = _waveforms(stream)
    except Exception as error:  # npTDMS raises any exception for damaged bytes
        raise _damaged(path, error) from None
    if incomplete:
        raise InputError(path, "ends inside a segment", cure="the file is cut off; copy it again")
    numeric = [entry for entry in found if np.dtype(entry[3]).kind in "fiu" and entry[1] > 0]
    if not numeric:
        message = f"has no numeric channel; it has {[name for name, *_ in found][:20]}"
        raise InputError(path, message, cure="save the record again")
    times = [name for name, *_ in numeric if name == layout.time]
    if layout.time is not None and not times:
        raise InputError(path, f"has no channel '{layout.time}'", cure="correct time in the layout")
    _check_joined(path, waveforms)
    begins = {name: waveforms[name][0].begin for name, *_ in numeric if waveforms.get(name)}
    # delay of each channel with a declared time after the earliest channel of the file [s]
    delays = {name: max(_since(begin, one) for one in begins.values()) for name, begin in begins.items()}
    channels = [
        _channel(path, name, number, samples, properties, layout, delays.get(name))
        for number, (name, samples, properties, _) in enumerate(numeric, start=1)
        if name not in times
    ]
    return Contents(path, sha256, tuple(channels), {"format": "tdms"}, metadata)


def _channel(
    path: Path,
    name: str,
    number: int,
    samples: int,
    properties: dict[str, Any],
    layout: Layout,
    delay: float | None,
) -> Channel:
    check_samples(path, name, samples)

    def clock() -> Clock:
        stated = {key: float(properties[key]) for key in _CLOCK if properties.get(key) is not None}
        header = clock_of_numbers(path, stated, layout)
        if header.interval is None and layout.time is not None:
            times = NamedArray(str(layout.time), samples, lambda: _values(path, str(layout.time)))
            return clock_of_array(path, times, layout, header)
        if header.interval is None:
            message = f"channel '{name}' has no wf_increment"
            raise InputError(path, message, cure='declare in the layout interval = "100 ns"')
        start, source = header.start, header.source
        if delay is not None and layout.start is None:
            start, source = (start or 0.0) + delay, f"{source}, wf_start_time"
        return stated_clock(header.interval, start, source)

    unit = properties.get("unit_string") or properties.get("NI_UnitDescription")
    return Channel(
        name=name,
        number=number,
        unit=str(unit) if unit else None,
        samples=samples,
        values=lambda: _values(path, name),
        clock=clock,
    )


@dataclass(frozen=True)
class _Waveform:
    """One continuous section of a channel's samples."""

    begin: Any
    """`wf_start_time`, with its fractions of 2^-64 s."""
    offset: float
    """`wf_start_offset` [s]."""
    interval: float
    """`wf_increment` [s]; 0 if there is none."""
    before: int
    """Number of the channel's samples before it."""


def _waveforms(stream: BinaryIO) -> dict[str, list[_Waveform]]:
    """The waveforms of each channel with a declared start time; npTDMS keeps the last properties only."""
    from nptdms.common import ObjectPath
    from nptdms.reader import TdmsReader

    class Segments(TdmsReader):  # type: ignore[misc]
        """Keeps the properties of each segment apart."""

        def __init__(self, file: BinaryIO) -> None:
            super().__init__(file)
            self.properties: list[dict[str, Any]] = []

        def _update_object_properties(self, segment_properties: dict[str, Any] | None) -> None:
            self.properties.append(dict(segment_properties or {}))
            super()._update_object_properties(segment_properties)

    stream.seek(0)
    reader = Segments(stream)
    reader.read_metadata()
    waveforms: dict[str, list[_Waveform]] = {}
    samples: dict[str, int] = {}
    properties: dict[str, dict[str, Any]] = {}
    for segment, stated in zip(reader._segments, reader.properties, strict=True):
        for item in segment.ordered_objects:
            restated = dict(stated.get(item.path) or {})
            properties.setdefault(item.path, {}).update(restated)
            parts = ObjectPath.from_string(item.path)
            if not item.has_data or parts.channel is None:
                continue
            name = f"{parts.group}/{parts.channel}"
            now = properties[item.path]
            if "wf_start_time" in now and ("wf_start_time" in restated or name not in waveforms):
                waveforms.setdefault(name, []).append(
                    _Waveform(
                        now["wf_start_time"],
                        float(now.get("wf_start_offset", 0.0)),
                        float(now.get("wf_increment", 0.0)),
                        samples.get(name, 0),
                    )
                )
            samples[name] = samples.get(name, 0) + item.number_values * segment.num_chunks
    return waveforms


def _since(begin: Any, origin: Any) -> float:
    """Seconds between two time stamps, exact to 2^-64 s."""
    fractions = int(begin.second_fractions) - int(origin.second_fractions)
    return float(int(begin.seconds) - int(origin.seconds)) + fractions * 2.0**-64


def _check_joined(path: Path, waveforms: dict[str, list[_Waveform]]) -> None:
    """Check that the waveforms of a channel follow each other without a gap."""
    for name, parts in waveforms.items():
        first = parts[0]
        for part in parts[1:]:
            begin = _since(part.begin, first.begin) + part.offset - first.offset
            gap = begin - part.before * first.interval
            if abs(gap) > 0.5 * first.interval or part.interval != first.interval:
                raise InputError(
                    path,
                    f"channel '{name}' holds several waveforms: sample {part.before + 1} was taken "
                    f"{gap:.6g} s later than wf_increment gives",
                    cure="save every waveform in a separate channel or file",
                )


def _values(path: Path, name: str) -> FloatArray:
    """Scaled samples of a channel."""
    from nptdms import TdmsFile

    try:
        with _strict(), path.open("rb") as stream, TdmsFile.open(stream) as file:
            for group in file.groups():
                for channel in group.channels():
                    if f"{group.name}/{channel.name}" == name:
                        return np.asarray(channel[:], dtype=np.float64)
    except Exception as error:
        raise _damaged(path, error) from None
    raise InputError(path, f"has no channel '{name}'", cure="correct its name")


class _Refusal(logging.Handler):
    """Turns log messages of npTDMS into errors: invalid text, or data that do not fill a chunk."""

    def emit(self, record: logging.LogRecord) -> None:
        raise ValueError(record.getMessage()[:200])


@contextmanager
def _strict() -> Iterator[None]:
    """Turn log messages and warnings of npTDMS into errors, and keep them off the terminal."""
    from nptdms.log import log_manager

    loggers = list(log_manager.loggers.values())
    before = [(logger.handlers, logger.propagate) for logger in loggers]
    for logger in loggers:
        logger.handlers, logger.propagate = [_Refusal(logging.WARNING)], False
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            yield
    finally:
        for logger, (handlers, propagate) in zip(loggers, before, strict=True):
            logger.handlers, logger.propagate = handlers, propagate


def _damaged(path: Path, error: Exception) -> InputError:
    return InputError(path, f"is not a TDMS file that can be read ({error})", cure="copy it again")
