"""What may be said about a recorder's file, and what is found in it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

ColumnId = str | int
"""A column by its name in the file, or by its number, counted from 1."""


@dataclass(frozen=True)
class Layout:
    """What a shot file says about a recorder's file; None leaves a thing to be found in the file.

    Something that is said wins over what the file says. All that was found is in `Contents.facts`.
    """

    format: str | None = None
    """Name of the format, a key of `kolsky.readers.formats.FORMATS`."""
    encoding: str | None = None
    """Of a text file: one of `kolsky.readers.encoding.ENCODINGS`."""
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
    """What a file says of one of its channels; its samples have not been judged."""

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
