"""Description of a recorder's file: its declared layout, and its channels with samples and clock."""

import hashlib
import stat
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.files import regular
from kolsky.base.units import LARGEST

ColumnId = str | int
"""A column by its name in the file, or by its number, counted from 1."""


@dataclass(frozen=True)
class Layout:
    """Declared layout of a recorder's file; what is None is found in the file.

    Something that is said wins over what the file says. All that was found is in `Contents.facts`.
    """

    format: str | None = None
    """Name of the format, a key of `kolsky.readers.formats.FORMATS`."""
    encoding: str | None = None
    """Of a text file: one of `kolsky.readers.text.ENCODINGS`."""
    delimiter: str | None = None
    """Of a text file: ",", ";", "tab" or "blanks"."""
    decimal: str | None = None
    """Decimal sign of a text file: "." or ","."""
    comment: str | None = None
    """How a line begins that is no data, wherever it stands, e.g. "#"."""
    header_line: int | None = None
    """Line of the column names, counted from 1; 0 if the file has none."""
    units_line: int | None = None
    """Line of the columns' units, counted from 1; 0 if the file has none."""
    first_line: int | None = None
    """Line of the first samples, counted from 1; what stands above is metadata."""
    sheet: str | None = None
    """Sheet of a workbook."""
    time: ColumnId | Mapping[str, ColumnId] | None = None
    """The time column, or one for each channel: channel -> its time column."""
    time_unit: str | None = None
    """Unit of the time columns, e.g. "ms"."""
    interval: float | None = None
    """Time from sample to sample [s]."""
    start: float | None = None
    """Time of the first sample on the instrument's clock [s]."""
    unit: str | None = None
    """Unit of the samples, e.g. "mV"."""
    full_scale: float | None = None
    """Largest size that the recorder shows, in the SI unit of the samples; without it a clipped signal is
    recognised by its flat top."""


@dataclass(frozen=True)
class ChannelInfo:
    """One channel as its file describes it; its samples have not been judged."""

    name: str
    """Its name in the file, by which it is asked for."""
    number: int
    """Its number among the columns or channels of the file, counted from 1; it may be asked for by this."""
    unit: str | None
    """Unit of its samples as the file writes it; None if the file does not say."""
    samples: int
    """Number of its samples."""
    start: float | None
    """Time of the first sample [s]; None if it is not known."""
    interval: float | None
    """Time from sample to sample [s]; None if it is not known."""
    time: str
    """Where the times come from, or why they are not known and what to say."""
    facts: Mapping[str, str] = field(default_factory=dict)
    """What was found in the file: its format and, of text, encoding, delimiter, decimal sign, header line."""
    metadata: Mapping[str, str] = field(default_factory=dict)
    """What else the file says, by its own keys."""


BINARY_LIMIT = 1_000_000_000
"""Largest binary file that is read [bytes]."""
SAMPLES_LIMIT = 20_000_000
"""Most samples of one channel that are read; a compressed file may promise more than fits in memory."""

LARGEST_SAMPLE = LARGEST
"""Largest size of a sample that is read, in any unit."""


@dataclass(frozen=True)
class Clock:
    """Sample i was taken at ``start + i * interval``."""

    start: float
    """Time of the first sample [s]."""
    interval: float
    """Time from sample to sample [s]."""
    source: str
    """Where both come from, in words."""
    measured: FloatArray | None = field(default=None, compare=False)
    """Times of the samples where the steps between them vary [s], shape [samples]; None if they do not."""

    def times(self, samples: int) -> FloatArray:
        """Times of so many samples [s], shape [samples]."""
        return self.start + self.interval * np.arange(samples, dtype=np.float64)


@dataclass(frozen=True)
class Channel:
    """One channel of a file."""

    name: str
    """Its name in the file."""
    number: int
    """Its number among the columns or channels, counted from 1."""
    unit: str | None
    """Unit as the file writes it, or None."""
    samples: int
    """Number of samples."""
    values: Callable[[], FloatArray]
    """Reads the samples in `unit`, shape [samples]; raises `InputError`."""
    clock: Callable[[], Clock]
    """Finds the clock; raises `InputError` if it is not known."""
    place: Callable[[int], int | None] = lambda sample: None
    """Line of the file on which a sample stands; None in a binary file."""


@dataclass(frozen=True)
class Contents:
    """Channels, facts and metadata of a recorder's file."""

    path: Path
    """The file."""
    sha256: str
    """SHA-256 of it, hex."""
    channels: tuple[Channel, ...]
    """Its channels, without the time columns."""
    facts: Mapping[str, str]
    """What was found: "format" and, of text, "encoding", "delimiter", "decimal", "header"."""
    metadata: Mapping[str, str] = field(default_factory=dict)
    """What else the file says, by its own keys."""


def stated_clock(interval: float, start: float | None, source: str) -> Clock:
    """A clock whose interval is known; a file without a start begins at 0."""
    if start is None:
        return Clock(0.0, interval, f"{source}; start 0, the file gives none")
    return Clock(start, interval, source)


def file_hash(path: Path, *, limit: int = BINARY_LIMIT) -> str:
    """SHA-256 of a regular file of sensible size, hex.

    Raises
    ------
    InputError
        If there is no such file, it is not a regular file, is empty, larger than `limit` bytes, or may not
        be read.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError(path, "is not a file", cure="name the recorder's file")
        if status.st_size == 0:
            raise InputError(path, "is empty", cure="export it again")
        if status.st_size > limit:
            raise InputError(
                path,
                f"has {status.st_size / 1e6:.0f} MB, more than the {limit / 1e6:.0f} MB that are read",
                cure="export the time span of the test only",
            )
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except FileNotFoundError:
        raise InputError(path, "there is no such file", cure="put it there or correct its name") from None
    except OSError as error:
        raise InputError(
            path, f"cannot be read ({error.strerror})", cure="copy it again, and see that it may be read"
        ) from None


def head_of(path: Path, size: int = 4096) -> bytes:
    """The first bytes of a file, for `sniff`; nothing if it cannot be read."""
    try:
        with regular(path).open("rb") as stream:
            return stream.read(size)
    except OSError:
        return b""


def check_samples(path: Path, name: str, samples: int) -> None:
    """Refuse a channel with more samples than are read, or fewer than two.

    Raises
    ------
    InputError
        With the number found.
    """
    if samples > SAMPLES_LIMIT:
        raise InputError(
            path,
            f"channel '{name}' has {samples} samples, more than the {SAMPLES_LIMIT} that are read",
            cure="export the time span of the test only",
        )
    if samples < 2:
        raise InputError(
            path, f"channel '{name}' has {samples} samples", cure="name a record, at least two samples long"
        )
