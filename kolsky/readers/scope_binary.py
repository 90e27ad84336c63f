"""Binary files of oscilloscopes, through RigolWFM (https://github.com/scottprahl/RigolWFM).

Tektronix .wfm and .isf, LeCroy .trc, Yokogawa .wfm and .hdr/.wvf, Rohde & Schwarz RTP .bin, Keysight .bin,
Rigol .wfm and .bin, Siglent .bin; the first bytes show the manufacturer.
"""

import contextlib
import gc
import hashlib
import io
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.errors import InputError
from kolsky.readers.contents import Channel, Clock, Contents, check_samples, file_hash, head_of
from kolsky.readers.layout import Layout

SUFFIXES = (".wfm", ".isf", ".trc", ".hdr", ".wvf", ".bin")
SCOPE_LIMIT = 400_000_000
"""Largest file that is read [bytes]."""


def sniff(path: Path) -> bool:
    """True if a file has the ending of a scope's binary file. `read` finds the manufacturer."""
    return path.suffix.lower() in SUFFIXES


def read(path: Path, layout: Layout) -> Contents:
    """Read all channels of a file.

    Raises InputError if RigolWFM is missing, or if the file is unknown, damaged, cut off or declares XML
    entities.
    """
    sha256 = file_hash(path, limit=SCOPE_LIMIT)
    names = (path.with_suffix(".Wfm.bin"), path.with_suffix(".wvf"), path.with_suffix(".WVF"))
    companion = next((name for name in names if name != path and name.is_file()), None)
    if companion is not None:
        sha256 = hashlib.sha256((sha256 + file_hash(companion, limit=SCOPE_LIMIT)).encode()).hexdigest()
    _refuse_entities(path)
    _check_curve(path)
    _check_yokogawa(path)
    waveform, problem = _parsed(path)
    if problem:
        message = f"is not a scope's file that can be read ({problem})"
        raise InputError(path, message, cure="is it complete? if so, export the record as CSV")
    if not waveform.channels:
        raise InputError(path, "has no analogue channel", cure="export a channel")
    facts = {
        "format": "scope",
        "make": str(waveform.header_name),
        "parser": str(waveform.parser_name),
        **({} if companion is None else {"samples in": companion.name, "sha256": "of both files' hashes"}),
        **({"frames": f"1 of {waveform.frame_count}"} if waveform.frame_count > 1 else {}),
    }
    channels = tuple(_channel(path, channel, layout) for channel in waveform.channels)
    return Contents(path, sha256, channels, facts)


def _parsed(path: Path) -> tuple[Any, str]:
    """A file parsed by the library, and the library's error message if it fails."""
    try:
        from RigolWFM.wfm import Wfm
    except ImportError:
        raise InputError(path, "needs RigolWFM", cure="pip install RigolWFM") from None
    said = io.StringIO()
    waveform, problem = None, ""
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            waveform = Wfm.from_file(str(path))
        except Exception as error:  # its parsers raise any exception for damaged bytes
            problem = " ".join(str(error).split())[:200] or type(error).__name__
        gc.collect()  # some of its parsers leave the file open
    return waveform, problem


def _channel(path: Path, channel: Any, layout: Layout) -> Channel:
    header = channel.waveform.header
    volts = np.asarray(channel.volts, dtype=np.float64)
    name = str(channel.name).replace(" ", "")
    unit = str(getattr(channel.unit, "name", "")).upper()  # V, A, W or "unknown"
    samples = volts.size
    check_samples(path, name, samples)
    promised = getattr(header, "n_pts", samples)  # the library does not always check it
    if isinstance(promised, int) and samples < promised:
        message = f"channel '{name}' ends after {samples} of {promised} samples"
        raise InputError(path, message, cure="the file is cut off; copy it again")

    def clock() -> Clock:
        start = float(channel.times[0]) if layout.start is None else layout.start
        if layout.interval is not None:
            return Clock(start, layout.interval, "stated; start from the header")
        shown = float(channel.times[1] - channel.times[0])
        increments = getattr(header, "x_increments", None)
        own = increments[channel.channel_number - 1] if isinstance(increments, list) else None
        interval = float(own if own is not None else header.seconds_per_point)
        if float(single := np.float32(interval)) == interval:
            interval = float(str(single))  # stored in single precision: the shortest decimal number
        # For some manufacturers, RigolWFM distributes n time steps over n - 1 intervals.
        if not interval > 0.0 or abs(shown - interval) > 1.5 / (samples - 1) * interval + 1e-9 * interval:
            raise InputError(
                path,
                f"channel '{name}' has the interval {interval:.6g} s in its header and {shown:.6g} s in its"
                " times",
                cure='state it in the layout: interval = "10 ns"',
            )
        return Clock(start, interval, "header")

    return Channel(
        name=name,
        number=channel.channel_number,
        unit=unit if unit in ("V", "A") else None,
        samples=samples,
        values=lambda: volts,
        clock=clock,
    )


def _check_curve(path: Path) -> None:
    """Check that the curve of an .isf file ("#510000..." and that many bytes) is complete."""
    if path.suffix.lower() != ".isf":
        return
    head = head_of(path, 4096)
    mark = head.find(b"#", head.find(b":CURV"))
    digits = int(head[mark + 1 : mark + 2]) if head[mark + 1 : mark + 2].isdigit() else 0
    count = head[mark + 2 : mark + 2 + digits]
    if head.find(b":CURV") < 0 or mark < 0 or not digits or not count.isdigit():
        raise InputError(path, "has no curve", cure="the file is cut off; copy or export it again")
    there = path.stat().st_size - (mark + 2 + digits)
    if there < int(count):
        message = f"ends after {there} of {int(count)} bytes of its curve"
        raise InputError(path, message, cure="it is cut off; copy it again")


def _check_yokogawa(path: Path) -> None:
    """Check that the samples of a Yokogawa .wfm do not overlap its header. They are counted from the end."""
    head = head_of(path, 4096)
    count, width = (re.search(rb"\b" + key + rb":\s*(\d+)", head) for key in (b"NR_PT", b"BYT"))
    if path.suffix.lower() != ".wfm" or count is None or width is None:
        return
    second_line = head.find(b"\n", head.find(b"\n") + 1) + 1
    missing = second_line + int(count[1]) * int(width[1]) - path.stat().st_size
    if missing > 0:
        raise InputError(path, f"lacks {missing} bytes of its samples", cure="it is cut off; copy it again")


def _refuse_entities(path: Path) -> None:
    """Raise InputError for XML entities. Headers of Rohde & Schwarz are XML without entities."""
    if not head_of(path, 64).lstrip(b"\xef\xbb\xbf").startswith(b"<?xml"):
        return
    if path.stat().st_size > 20_000_000:
        raise InputError(path, "is an XML header of more than 20 MB", cure="export the record as CSV")
    data = path.read_bytes()
    if b"<!DOCTYPE" in data or b"<!ENTITY" in data or b"\0" in data:
        raise InputError(path, "declares XML entities", cure="export the record as CSV")
