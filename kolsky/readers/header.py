"""Header of a recorder's text file: keys, values, units, and the clock that they declare."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from kolsky.base.errors import InputError
from kolsky.base.units import DIMENSIONS, dimension_of
from kolsky.readers.contents import Layout
from kolsky.readers.text import LONGEST_PAIR, Dialect, full_match

_PREFIXES = {"": 1.0, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6}
_WORDS = {
    "volt": "V", "volts": "V", "millivolt": "mV", "millivolts": "mV", "microvolts": "uV",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sekunden": "s", "sekunde": "s",
    "msec": "ms", "millisecond": "ms", "milliseconds": "ms",
    "usec": "us", "µsec": "us", "microsecond": "us", "microseconds": "us",
    "nsec": "ns", "nanosecond": "ns", "nanoseconds": "ns",
    "newton": "N", "newtons": "N", "pascal": "Pa", "ampere": "A", "amp": "A", "amps": "A",
    "strain": "1", "m/m": "1", "ustrain": "uε", "microstrain": "uε", "microstrains": "uε", "µstrain": "uε",
    "μstrain": "uε", "micro strain": "uε", "με": "uε", "µε": "uε", "ue": "uε", "µe": "uε", "μe": "uε",
    "um/m": "uε", "µm/m": "uε", "μm/m": "uε", "mm/m": "mε", "millistrain": "mε", "me": "mε", "%": "%",
}  # fmt: skip
_BASES = {"V": "V", "s": "s", "N": "N", "Pa": "Pa", "A": "A", "C": "C", "ε": "1", "m/s": "m/s"}
_PLAIN = {"1": ("1", 1.0), "-": ("1", 1.0), "%": ("1", 1e-2), "m/s^2": ("m/s^2", 1.0), "m/s²": ("m/s^2", 1.0)}
_BRACKETS = re.compile(r"(.*?)\s*[(\[]\s*([^()\[\]]+?)\s*[)\]]\s*")
_SLASH = re.compile(r"(.*\S)\s*/\s*(\S+)")
_TAIL = re.compile(r"(.*?[^\s_,])(?:_|\s*,\s*|\s+in\s+)([A-Za-zµμε%]+)")
"""A unit behind a last underscore, a comma or "in": time_s, "CH1, mV", "Zeit in ms"."""
_TIME_WORDS = re.compile(r"(.*[\s_])?(time|timestamp|zeit|temps|tiempo|tempo|t)", re.IGNORECASE)
_TAIL_UNITS = re.compile(r"([mµμuk]?V|[mk]?N|[kM]?Pa|(?:micro|[mµμu])?strain|[mµμu]?ε|volts?|millivolts?)")
"""Units that a tail may name in any column; of times they are those of time. CH_A is no current."""


def si_unit(text: str) -> tuple[str, float] | None:
    """The SI unit and the factor to it of a unit as instruments write it; None if it is not known.

    "mV" is ("V", 1e-3), "Volts" ("V", 1.0), "µs" ("s", 1e-6).
    """
    plain = text.strip().strip("()[]").strip()
    plain = _WORDS.get(plain.lower(), plain)
    if plain in _PLAIN:
        return _PLAIN[plain]
    for base, unit in _BASES.items():
        prefix = plain.removesuffix(base)
        if plain.endswith(base) and prefix in _PREFIXES:
            return unit, _PREFIXES[prefix]
    return None


def split_unit(heading: str) -> tuple[str, str | None]:
    """Name and unit of a column heading; None without a unit.

    "CH1 (mV)", "Time [s]", "Time/s", and by its last word "time_s", "strain_microstrain", "Zeit in ms".
    """
    match = full_match(_BRACKETS, heading) or full_match(_SLASH, heading)
    if match is not None and si_unit(match.group(2)) is not None:
        return match.group(1).strip(), match.group(2)
    tail = full_match(_TAIL, heading.strip())
    if tail is not None and (known := si_unit(tail.group(2))) is not None:
        name, unit = tail.groups()
        of_time = known[0] == "s" and _TIME_WORDS.fullmatch(name) is not None
        if of_time or _TAIL_UNITS.fullmatch(unit) is not None:
            return name, unit
    return heading.strip(), None


_BRACKETED = re.compile(r"(.*?)\s*[(\[]\s*([^()\[\]]*?)\s*[)\]]\s*")
_NAMED_UNIT = re.compile(r".*?(?:[(\[]\s*([^()\[\]]+?)\s*[)\]]|\s/\s*(\S+)|\s+in\s+(\S+)|_([A-Za-zµ%]+))\s*")
"""A unit in brackets, behind a stroke, "in", or a last underscore."""


def heading_unit(heading: str) -> str | None:
    """The unit of any kind that a heading has in brackets, "mm" of "Travel (mm)"; None if none is known."""
    match = full_match(_BRACKETED, heading)
    text = match.group(2) if match else ""
    return ("1" if text == "-" else text) if dimension_of(text, DIMENSIONS) else None


def likely_unit(heading: str) -> str:
    """The unit that a heading seems to name, of a quantity in a shot's tables; empty if none: for drafts."""
    match = full_match(_NAMED_UNIT, heading)
    text = next((group for group in match.groups() if group), "") if match else ""
    text = "1" if text == "-" else text
    return text if dimension_of(text) else ""


def name_without_unit(heading: str) -> str:
    """A heading without what stands in brackets at its end."""
    match = full_match(_BRACKETED, heading)
    return match.group(1) if match else heading


def time_factor(path: Path, unit: str | None, what: str) -> float:
    """Seconds per unit of a time.

    Raises InputError if the unit is not stated or is no unit of time.
    """
    if unit is None:
        raise InputError(path, f"{what} has no unit", cure='say it in the layout: time_unit = "s"')
    known = si_unit(unit)
    if known is None or known[0] != "s":
        raise InputError(
            path,
            f"{what} has the unit '{unit}'",
            allowed='a unit of time: "s", "ms", "us", "ns"',
            cure='say it in the layout: time_unit = "s"',
        )
    return known[1]


INTERVAL_KEYS = (
    "deltax", "increment", "xincrement", "xincr", "xinc", "tinc", "sampleinterval", "samplinginterval",
    "sampleperiod", "samplingperiod", "timeinterval", "timeincrement", "horizontalinterval",
    "horizontalincrement", "hresolution", "deltat", "dt", "tinterval", "wfincrement", "sampletime",
)  # fmt: skip
"""Keys of the time from sample to sample, without case, blanks and signs."""
RATE_KEYS = ("samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "fs")
"""Keys of its reciprocal [1/s]."""
START_KEYS = (
    "x0", "t0", "start", "xorigin", "xorg", "xstart", "xzero", "hoffset", "tstart", "wfstartoffset",
    "firstsampletime", "horizontalstart",
)  # fmt: skip
"""Keys of the time of the first sample."""
ZERO_INDEX_KEYS = ("zeroindex", "triggerpoint", "triggersample")
"""Keys of the sample at time 0."""
COUNT_KEYS = ("recordlength", "samples", "numpoints", "points", "blocksize", "segmentsize", "length")
"""Keys of the number of samples."""
UNIT_KEYS = ("horizontalunits", "hunit", "xunits", "xunit", "timeunit")
"""Keys of the unit of time."""
KEYS = frozenset(
    key
    for keys in (INTERVAL_KEYS, RATE_KEYS, START_KEYS, ZERO_INDEX_KEYS, COUNT_KEYS, UNIT_KEYS)
    for key in keys
    if key not in ("x0", "t0", "start", "length", "samples")  # these may be columns too
) | {"tracename", "vunit", "model", "firmwareversion"}
"""Keys that no column has."""

_NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-zµμ]*)")


@dataclass(frozen=True)
class HeaderClock:
    """The clock as the header states it; None for what it does not state."""

    interval: float | None
    """Time from sample to sample [s]."""
    interval_digit: float
    """Half the last printed digit of it [s]."""
    start: float | None
    """Time of the first sample [s]."""
    source: str
    """The keys they come from."""


def bare_key(text: str) -> str:
    """A key without case, blanks, signs and unit: "Sample Interval:" is "sampleinterval"; a text longer than
    `LONGEST_PAIR` is none, and nothing is left of it."""
    if len(text) > LONGEST_PAIR:
        return ""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"[(\[].*?[)\]]", "", text.lower()))


def header_clock(
    path: Path, metadata: Mapping[str, Sequence[str]], *, channel: int = 0, channels: int = 1
) -> HeaderClock:
    """The clock of one channel.

    ``path``: the file, for messages. ``metadata``: key as written -> the fields behind it. ``channel``: which
    of the channels, counted from 0, where a key has one value for each. ``channels``: number of channels.
    Raises InputError if an interval is not positive, or a key has neither one value nor one for each channel.
    """
    written = time_unit(metadata)
    known = None if written is None else si_unit(written)
    unit = 1.0 if known is None else known[1]
    interval, digit, start, sources = None, 0.0, None, []
    for key, fields in metadata.items():
        bare = bare_key(key)
        wanted = bare in INTERVAL_KEYS or bare in RATE_KEYS or bare in START_KEYS
        value = _of_channel(path, key, fields, channel, channels) if wanted else None
        if value is None:
            continue
        number, factor, last = value
        factor = factor or unit
        if bare in START_KEYS and start is None:
            start = number * factor
            sources.append(key)
        elif bare not in START_KEYS and interval is None:
            if number <= 0.0:
                raise InputError(path, f"says {key} = {number:g}", allowed="> 0", cure="state the interval")
            rate = bare in RATE_KEYS
            interval = 1.0 / number if rate else number * factor
            digit = 0.5 * interval * last / number
            sources.append(key)
    if start is None and interval is not None:
        for key, fields in metadata.items():
            index = _number(fields[0]) if fields and bare_key(key) in ZERO_INDEX_KEYS else None
            if index is not None:
                start = -index[0] * interval
                sources.append(key)
                break
    return HeaderClock(interval, digit, start, "header: " + ", ".join(sources) if sources else "")


def clock_of_numbers(path: Path, numbers: Mapping[str, float], layout: Layout) -> HeaderClock:
    """The clock that numbers state by their names, as "dt" and "t0" or "wf_increment" do, in seconds.

    ``numbers``: by name, or by path with the name last. ``layout``: what is declared counts before them.
    Raises InputError if an interval is not positive.
    """
    by_key = {bare_key(name.rsplit("/", 1)[-1].lower()): (name, value) for name, value in numbers.items()}

    def first(keys: Sequence[str]) -> tuple[str, float] | None:
        return next((by_key[key] for key in keys if key in by_key), None)

    interval, source = layout.interval, "stated"
    if interval is None:
        step, rate = first(INTERVAL_KEYS), first(RATE_KEYS)
        name, value = step or rate or ("", 1.0)
        if not 0.0 < value < float("inf"):
            raise InputError(path, f"says {name} = {value:g}", allowed="> 0", cure="state the interval")
        if name:
            interval = value if step else 1.0 / value
        source = name
    begin = first(START_KEYS)
    if layout.start is not None or begin is None:
        return HeaderClock(interval, 0.0, layout.start, source)
    return HeaderClock(interval, 0.0, begin[1], f"{source}, {begin[0]}")


def time_unit(metadata: Mapping[str, Sequence[str]]) -> str | None:
    """The unit of time that the header states, as it is written."""
    for key, fields in metadata.items():
        if bare_key(key) in UNIT_KEYS and fields:
            known = si_unit(fields[0])
            if known is not None and known[0] == "s":
                return fields[0]
    return None


def stated_samples(metadata: Mapping[str, Sequence[str]]) -> tuple[str, int] | None:
    """Key and value of the number of samples, if the header states one."""
    for key, fields in metadata.items():
        cells = [key, *fields]  # LeCroy: "Segments,1,SegmentSize,2500"
        for name, text in pairwise(cells):
            value = _number(text) if bare_key(name) in COUNT_KEYS else None
            if value is not None and value[0] > 0 and value[0] == int(value[0]):
                return name, int(value[0])
    return None


def _of_channel(
    path: Path, key: str, fields: Sequence[str], channel: int, channels: int
) -> tuple[float, float, float] | None:
    """Number, factor of its unit (0 if it has none) and last digit, for one channel."""
    values = [value for field in fields if (value := _number(field.rpartition(":")[2])) is not None]
    if not values:
        return None
    chosen = values[0]
    if any(value[0] != chosen[0] for value in values):
        if len(values) != channels:
            raise InputError(
                path,
                f"says {key} = {', '.join(f'{v[0]:g}' for v in values)} for {channels} channels",
                cure="state interval and start in the layout",
            )
        chosen = values[channel]
    number, word, last = chosen
    follower = next((f for f in fields if (known := si_unit(f)) is not None and known[0] == "s"), "")
    known = si_unit(word or follower) if word or follower else None
    return number, known[1] if known is not None and known[0] == "s" else 0.0, last


def _number(field: str) -> tuple[float, str, float] | None:
    """Number, unit behind it and last printed digit of a field such as "4.0E-10" or "20 ns"."""
    match = full_match(_NUMBER, field.strip())
    if match is None:
        return None
    text, word = match.groups()
    mantissa, _, exponent = text.lower().partition("e")
    places = len(mantissa.partition(".")[2])
    return float(text), word, float(f"1e{int(exponent or 0) - places}")


COMMENTS = ("#", "%", "!", "//")
"""How commented lines above the samples usually begin."""

_PAIR = re.compile(r'"?([^:=;,\t"]+?)"?\s*[:=;,\t]\s*(.*)')
_BLANKS = re.compile(r"(\D.*?)\s+([-+.\d].*)")


def uncommented(line: str, comment: str | None) -> str:
    """A line without its sign of a comment."""
    for sign in (comment,) if comment else COMMENTS:
        if line.startswith(sign):
            return line.removeprefix(sign).lstrip()
    return line


def key_lines(dialect: Dialect, lines: Iterable[str]) -> dict[str, list[str]]:
    """Key -> fields of lines such as "Sample Interval,1e-7,s" or "tInc = 2e-9"; a key that comes again is
    numbered."""
    metadata: dict[str, list[str]] = {}
    separator = dialect.delimiter if dialect.delimiter != " " else None
    for line in lines:
        said = line.strip()
        match = full_match(_PAIR, said, longest=LONGEST_PAIR) or full_match(
            _BLANKS, said, longest=LONGEST_PAIR
        )
        if match is None:
            continue
        key, rest = match.groups()
        fields = [part.strip(' "') for part in (rest.split(separator) if separator else [rest])]
        add_key(metadata, key, [part for part in fields if part])
    return metadata


def add_key(metadata: dict[str, list[str]], key: str, fields: list[str]) -> None:
    """Add a key; one that is there already is numbered: "Date", "Date (2)"."""
    name, count = key, 1
    while name in metadata:
        count += 1
        name = f"{key} ({count})"
    metadata[name] = fields


def heading_keys(dialect: Dialect, lines: Sequence[str]) -> dict[str, list[str]]:
    """Start and increment that stand beside the column names: as columns of their own, or as "tInc = 2e-9".

    ``dialect``: how the lines are taken apart. ``lines``: the line of the names, and the line of the units if
    there is one.
    """
    rows = [dialect.split(line) for line in lines]
    metadata: dict[str, list[str]] = {}
    for i, cell in enumerate(rows[0] if rows else []):
        if "=" in cell:
            key, _, value = cell.partition("=")
            metadata[key.strip()] = [value.strip()]
        elif bare_key(cell) in (*START_KEYS, *INTERVAL_KEYS) and len(rows) > 1 and i < len(rows[1]):
            metadata[cell] = [rows[1][i]]
    return metadata


def names_by_key(
    metadata: Mapping[str, Sequence[str]],
    columns: Sequence[int],
    names: tuple[str, ...],
    units: tuple[str | None, ...],
) -> tuple[tuple[str, ...], tuple[str | None, ...]]:
    """Names and units where a header line gives them behind a key (Yokogawa: TraceName, VUnit)."""
    named, measured = list(names), list(units)
    for key, fields in metadata.items():
        bare = bare_key(key)
        if bare not in ("tracename", "vunit") or len(fields) != len(columns):
            continue
        for column, field in zip(columns, fields, strict=True):
            if bare == "tracename":
                named[column] = field
            else:
                measured[column] = field
    return tuple(named), tuple(measured)


def keys_beside(rows: list[list[str]]) -> dict[str, list[str]]:
    """Keys of the first column and what stands behind them."""
    metadata: dict[str, list[str]] = {}
    for row in rows:
        key = row[0].strip().rstrip(":")
        if key:
            add_key(metadata, key, [part.strip() for part in row[1:] if part.strip()])
    return metadata


def check_width(path: Path, lines: list[str], separator: str, least: int) -> None:
    """Refuse a line with too few fields.

    Raises InputError: with its number.
    """
    for number, line in enumerate(lines):
        fields = line.count(separator) + 1
        if fields < least:
            last = number == len(lines) - 1
            raise InputError(
                path,
                f"has {fields} fields, {least} are needed"
                + ("; the file seems to be cut off" if last else ""),
                line=number + 1,
                cure="copy or export the file again",
            )
