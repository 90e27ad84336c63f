"""Header of a recorder's text file: keys, values, units, and the declared clock."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from kolsky.base.errors import InputError
from kolsky.base.units import DIMENSIONS, SHOT_KINDS, dimension_of, unit_factor
from kolsky.readers.layout import Layout
from kolsky.readers.text import LONGEST_FIELD, LONGEST_PAIR, Dialect, full_match

_PREFIXES = {
    "": 1.0, "p": 1e-12, "n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "k": 1e3, "M": 1e6, "G": 1e9,
}  # fmt: skip
_WORDS = {
    "volt": "V", "volts": "V", "millivolt": "mV", "millivolts": "mV", "microvolts": "uV",
    "sec": "s", "secs": "s", "second": "s", "seconds": "s", "sekunden": "s", "sekunde": "s",
    "msec": "ms", "millisec": "ms", "millisecond": "ms", "milliseconds": "ms",
    "millisekunde": "ms", "millisekunden": "ms",
    "usec": "us", "µsec": "us", "μsec": "us", "microsec": "us", "microsecond": "us", "microseconds": "us",
    "mikrosekunde": "us", "mikrosekunden": "us",
    "nsec": "ns", "nanosec": "ns", "nanosecond": "ns", "nanoseconds": "ns",
    "nanosekunde": "ns", "nanosekunden": "ns",
    "newton": "N", "newtons": "N", "pascal": "Pa", "ampere": "A", "amp": "A", "amps": "A",
    "strain": "1", "m/m": "1", "ustrain": "uε", "microstrain": "uε", "microstrains": "uε", "µstrain": "uε",
    "μstrain": "uε", "micro strain": "uε", "με": "uε", "µε": "uε", "ue": "uε", "µe": "uε", "μe": "uε",
    "um/m": "uε", "µm/m": "uε", "μm/m": "uε", "mm/m": "mε", "millistrain": "mε", "me": "mε", "%": "%",
}  # fmt: skip
_BASES = {"V": "V", "s": "s", "N": "N", "Pa": "Pa", "A": "A", "C": "C", "ε": "1", "m/s": "m/s"}
_PLAIN = {"1": ("1", 1.0), "-": ("1", 1.0), "%": ("1", 1e-2), "m/s^2": ("m/s^2", 1.0), "m/s²": ("m/s^2", 1.0)}
_BRACKETED = re.compile(r"(.*?)\s*[(\[]\s*([^()\[\]]*?)\s*[)\]]\s*")
_SLASH = re.compile(r"(.*\S)\s*/\s*(\S+)")
_TAIL = re.compile(r"(.*?[^\s_,])(?:_|\s*,\s*|\s+in\s+)([A-Za-zµμε%]+)")
"""A unit behind a last underscore, a comma or "in": time_s, "CH1, mV", "Zeit in ms"."""
_ANY_TAIL = re.compile(r"(.*?\S)(?:\s*_\s*(?!1/)|\s*,\s*|\s+in\s+)(?!bar\b)((?:1/)?[A-Za-zµμε%][^\s_,]*)")
"""A unit of any kind behind the same: "Weg in mm", "Load, kgf/cm2", "force_kN"; no "incident_bar"."""
_KEY_TAIL = re.compile(r"(.*?[^\s_,])(?:[\s_,]+|[\s_,]+in\s+)([A-Za-zµμ/1]+)")
"""A unit after the last blank, underscore or "in" of a key of the clock: fs_kHz, "Sample interval in us"."""
_TIME_WORDS = re.compile(r"(.*[\s_])?(time|timestamp|zeit|temps|tiempo|tempo|t)", re.IGNORECASE)
_TAIL_UNITS = re.compile(
    r"([mµμuk]?V|[mk]?N|[kM]?Pa|(?:micro|[mµμu])?strain|[mµμu]?ε|volts?|millivolts?|kgf|gf|lbf|psi|ksi)"
)
"""Units that the end of any heading may have, of times only those of time. CH_A is not a current."""
_MECHANICAL = re.compile(r"(?:kgf|gf|kp|lbf|kip|psi|ksi|m?bar)\b|da?N\b|[kmc]?N\s*[/·⋅.*]", re.IGNORECASE)
"""Beginnings of units of force and stress that testing machines print and `_BASES` lacks."""


def si_unit(text: str) -> tuple[str, float] | None:
    """SI unit and factor of a unit as instruments write it, e.g. ("V", 1e-3) for "mV"; None if unknown."""
    plain = text.strip().strip("()[]").strip()
    plain = _WORDS.get(plain.lower(), plain)
    if plain in _PLAIN:
        return _PLAIN[plain]
    for base, unit in _BASES.items():
        prefix = plain.removesuffix(base)
        if plain.endswith(base) and prefix in _PREFIXES:
            return unit, _PREFIXES[prefix]
    kind = dimension_of(plain, ("N", "Pa")) if _MECHANICAL.match(plain) else ""
    return (kind, unit_factor(plain, kind)) if kind else None


def split_unit(heading: str) -> tuple[str, str | None]:
    """Name and unit of a column heading; None without a unit.

    "CH1 (mV)", "Time [s]", "Time/s". By the last word: "time_s", "strain_microstrain", "Zeit in ms".
    """
    tail = full_match(_TAIL, heading.strip())
    for name, unit in _unit_places(heading) if tail is None else ():
        if si_unit(unit) is not None:
            return name, unit
        if "/" in unit and dimension_of(unit, DIMENSIONS):  # "Rate/1/s" is in 1/s and is not a time
            return heading.strip(), None
    if tail is not None and (known := si_unit(tail.group(2))) is not None:
        name, unit = tail.groups()
        of_time = known[0] == "s" and _TIME_WORDS.fullmatch(name) is not None
        if of_time or _TAIL_UNITS.fullmatch(unit) is not None:
            return name, unit
    return heading.strip(), None


def _unit_places(heading: str) -> list[tuple[str, str]]:
    """Candidate names and units of a heading, by brackets or by slashes and its end; the longest first."""
    match = full_match(_BRACKETED, heading)
    if match is not None:
        return [(match.group(1).strip(), match.group(2))]
    places = []
    if len(heading) <= LONGEST_FIELD:
        parts = heading.split("/")
        places = [("/".join(parts[:i]).strip(), "/".join(parts[i:]).strip()) for i in range(1, len(parts))]
    tail = full_match(_ANY_TAIL, heading.strip())
    if tail is not None:
        places.append((tail.group(1), tail.group(2)))
    return sorted((place for place in places if all(place)), key=lambda place: -len(place[1]))


def _name_and_unit(heading: str, kinds: Iterable[str]) -> tuple[str, str | None]:
    """Name of a heading, and its unit of one of the given kinds, or None."""
    for name, text in _unit_places(heading):
        unit = "1" if text == "-" else text
        if dimension_of(unit, kinds):
            return name, unit
    return heading.strip(), None


def heading_unit(heading: str) -> str | None:
    """The unit of any kind in a heading ("Travel (mm)", "Weg/mm", "Kraft in N", "force_kN"), or None."""
    return _name_and_unit(heading, DIMENSIONS)[1]


def likely_unit(heading: str) -> str:
    """The likely unit of a heading in a shot's tables, for draft files. Empty if there is none."""
    return _name_and_unit(heading, SHOT_KINDS)[1] or ""


def name_without_unit(heading: str) -> str:
    """A heading without its unit or other text in brackets at its end."""
    match = full_match(_BRACKETED, heading)
    return match.group(1) if match else _name_and_unit(heading, DIMENSIONS)[0]


def time_factor(path: Path, unit: str | None, what: str) -> float:
    """Seconds per unit of a time.

    Raises InputError if the unit is missing, or if it is not a unit of time.
    """
    if unit is None:
        raise InputError(path, f"{what} has no unit", cure='declare it in the layout: time_unit = "s"')
    known = si_unit(unit)
    if known is None or known[0] != "s":
        message = f"{what} has the unit '{unit}'"
        allowed = 'a unit of time: "s", "ms", "us", "ns"'
        raise InputError(path, message, allowed=allowed, cure='declare it in the layout: time_unit = "s"')
    return known[1]


INTERVAL_KEYS = (
    "deltax", "increment", "xincrement", "xincr", "xinc", "tinc", "sampleinterval", "samplinginterval",
    "sampleperiod", "samplingperiod", "timeinterval", "timeincrement", "horizontalinterval",
    "horizontalincrement", "hresolution", "deltat", "dt", "tinterval", "wfincrement", "sampletime",
    "timestep", "timeperpoint", "timepersample", "abtastintervall", "abtastzeit", "zeitschritt",
)  # fmt: skip
"""Keys of the sampling interval, without case, blanks and signs."""
RATE_KEYS = (
    "samplerate", "samplingrate", "samplefrequency", "samplingfrequency", "samplefreq", "samplingfreq", "fs",
    "scanrate", "acquisitionrate", "samplespersecond", "samplessecond", "abtastrate", "abtastfrequenz",
    "messrate",
)  # fmt: skip
"""Keys of the sampling rate [1/s]."""
START_KEYS = (
    "x0", "t0", "start", "xorigin", "xorg", "xstart", "xzero", "hoffset", "tstart", "wfstartoffset",
    "firstsampletime", "horizontalstart",
)  # fmt: skip
"""Keys of the time of the first sample."""
PLAIN_KEYS = ("start", "x0", "t0", "rate")
"""Keys with other meanings too: the start of a travel, the rate of a test."""
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
"""Keys that are not column names."""

_NUMBER = re.compile(
    r"([+-]?(?:\d[\d.,]*|[.,]\d+)(?:[eE][+-]?\d+)?)\s*[,;\t]?\s*([A-Za-zµμ][A-Za-zµμ/ .]*|1/s)?"
)
"""A number followed by its unit."""
_POINT, _COMMA = r"\d+\.?\d*|\.\d+", r"\d+,?\d*|,\d+"
_GROUPED = {",": r"[1-9]\d{0,2}(?:,\d{3})+(?:\.\d+)?", ".": r"[1-9]\d{0,2}(?:\.\d{3})+(?:,\d+)?"}
"""Numbers with thousands separators, by separator."""
_TIME_OF_DAY = re.compile(r"\d:\d\d|\d{4}-\d\d-\d\d")
_RATE_UNIT = re.compile(
    r"([kKmMgG]?)(?:hz|hertz|s/s|sa/s|sps|smpl/s|samples?/s(?:ec(?:ond)?)?|sample/s|pts?/s|points?/s|1/s)",
    re.IGNORECASE,
)
_INTERVAL_UNIT = re.compile(r"(.+?)/(?:pts?|points?|samples?|sa|smpl)", re.IGNORECASE)
_RATE_PREFIXES = {"": 1.0, "k": 1e3, "m": 1e6, "g": 1e9}
_AGREE = 0.01
"""Largest relative difference of two declared intervals [-], if their printed digits would allow more."""


@dataclass(frozen=True)
class HeaderClock:
    """The clock declared by the header. Fields that it does not declare are None."""

    interval: float | None
    """Sampling interval [s]."""
    interval_digit: float
    """Half its last printed digit [s]."""
    start: float | None
    """Time of the first sample [s]."""
    source: str
    """The keys of these values."""
    doubt: str = ""
    """Reason why a declaration of the clock cannot be used. Empty if all can be used."""

    def declared(self, path: Path, layout: Layout) -> "HeaderClock":
        """This clock with the interval and the start of a layout, which take precedence.

        Raises InputError if the intervals differ by more than the header's printed digits, at most by 1 %.
        """
        start = self.start if layout.start is None else layout.start
        interval = layout.interval
        if interval is None:
            return replace(self, start=start)
        known = interval if self.interval is None else self.interval
        if abs(interval - known) > min(self.interval_digit, _AGREE * known) + 1e-9 * interval:
            raise InputError(
                path,
                f"is declared with the interval {interval:.9g} s, its header states {known:.9g} s"
                f" ({self.source})",
                cure="leave interval out, or correct it; where the header is wrong, correct it in the file",
            )
        return HeaderClock(interval, 0.0, start, "stated", self.doubt)


def bare_key(text: str) -> str:
    """A key without case, blanks, signs and unit: "sampleinterval"; empty for a text that is too long."""
    if len(text) > LONGEST_PAIR:
        return ""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"[(\[].*?[)\]]", "", text.lower()))


def clock_unit(text: str) -> tuple[str, float] | None:
    """The unit of a sampling interval or a sampling rate. None if it is neither.

    "ms" is ("s", 1e-3), "kHz", "kS/s" and "kSa/s" are ("1/s", 1e3), "us/pt" is ("s", 1e-6). A lower-case m is
    milli before s and in mHz. It is mega in mhz and msps. "mS/s" is ambiguous and gives None.
    """
    plain = text.strip().strip("()[].").strip()
    per_sample = _INTERVAL_UNIT.fullmatch(plain)
    unit = si_unit(per_sample.group(1) if per_sample else plain)
    if unit is not None and unit[0] == "s":
        return unit
    rate = _RATE_UNIT.fullmatch(plain.replace(" ", ""))
    if rate is None:
        return None
    prefix = rate.group(1)
    if prefix == "m" and any(letter.isupper() for letter in plain):
        return ("1/s", 1e-3) if plain == "mHz" else None
    return "1/s", _RATE_PREFIXES[prefix.lower()]


def _clock_key(text: str) -> tuple[str, str | None]:
    """The bare key of a header line, and the clock's unit at its end: "dt [ms]", "dt/ms", "fs_kHz"."""
    key = text.strip().rstrip(":=").strip()
    for pattern in (_BRACKETED, _SLASH, _KEY_TAIL):
        match = full_match(pattern, key)
        if match is not None and clock_unit(match.group(2)) is not None:
            return bare_key(match.group(1)), match.group(2)
    return bare_key(key), None


def header_clock(
    path: Path,
    metadata: Mapping[str, Sequence[str]],
    *,
    channel: int = 0,
    channels: int = 1,
    decimal: str = ".",
) -> HeaderClock:
    """The clock of one channel.

    ``path``: the file, for messages. ``metadata``: key as written -> the fields after it. ``channel``,
    ``channels``: index of the channel, counted from 0, and number of channels, if a key has one value per
    channel. ``decimal``: decimal sign of the file. A number with the other sign is read if it is unambiguous.
    Returns: the declared clock. Unreadable numbers or units, and contradicting keys, give no interval. The
    reason is in `HeaderClock.doubt`. Raises InputError if an interval is not positive, or if a key has
    neither one value nor one per channel.
    """
    written = time_unit(metadata)
    default = (None if written is None else si_unit(written)) or ("s", 1.0)
    start: float | None = None
    start_key, doubts, intervals = "", [], []
    for key, fields in metadata.items():
        bare, unit = _clock_key(key)
        starts, rates = bare in START_KEYS, bare in RATE_KEYS or bare == "rate"
        if not (starts or rates or bare in INTERVAL_KEYS):
            continue
        stated = _of_channel(path, key, fields, channel, channels, decimal, unit)
        if isinstance(stated, str):
            if bare not in PLAIN_KEYS:
                doubts.append(stated)
            continue
        if stated is None or (bare == "rate" and (stated.unit is None or stated.unit[0] != "1/s")):
            continue  # that of a test
        kind, factor = stated.unit or (("1/s", 1.0) if rates else default)
        if starts:
            if start is None and kind == "s":
                start, start_key = stated.number * factor, key
            continue
        if stated.number <= 0.0:
            message = f"says {key} = {stated.number:g}"
            raise InputError(path, message, allowed="> 0", cure="state the interval")
        quantity = stated.number * factor
        interval = 1.0 / quantity if kind == "1/s" else quantity
        intervals.append((key, interval, 0.5 * interval * stated.digit / stated.number))
    for key, interval, digit in intervals[1:]:
        first = intervals[0]
        if abs(interval - first[1]) > min(digit + first[2], _AGREE * first[1]) + 1e-9 * first[1]:
            doubts.append(f"{first[0]} ({first[1]:.9g} s) and {key} ({interval:.9g} s) contradict each other")
    if doubts or not intervals:
        return HeaderClock(None, 0.0, start, f"header: {start_key}" if start_key else "", "; ".join(doubts))
    sources, interval = [key for key in metadata if key in (start_key, intervals[0][0])], intervals[0][1]
    if start is None:
        for key, fields in metadata.items():
            index = _number(fields[0], decimal) if fields and bare_key(key) in ZERO_INDEX_KEYS else None
            if index is not None:
                start = -index.number * interval
                sources.append(key)
                break
    return HeaderClock(interval, intervals[0][2], start, "header: " + ", ".join(sources))


def clock_of_numbers(path: Path, numbers: Mapping[str, float], layout: Layout) -> HeaderClock:
    """The clock from named numbers such as "dt" and "t0" or "wf_increment", in seconds.

    ``numbers``: by name, or by path with the name last. ``layout``: its declarations take precedence. Raises
    InputError if an interval is not positive.
    """
    stated = header_clock(path, {name.rsplit("/", 1)[-1]: [repr(value)] for name, value in numbers.items()})
    found = stated.declared(path, layout)
    return replace(found, interval_digit=0.0, source=found.source.removeprefix("header: "))


def time_unit(metadata: Mapping[str, Sequence[str]]) -> str | None:
    """The unit of time in the header, as written."""
    for key, fields in metadata.items():
        if bare_key(key) in UNIT_KEYS and fields:
            known = si_unit(fields[0])
            if known is not None and known[0] == "s":
                return fields[0]
    return None


def stated_samples(metadata: Mapping[str, Sequence[str]]) -> tuple[str, int] | None:
    """Key and value of the number of samples, if the header contains one."""
    for key, fields in metadata.items():
        cells = [key, *fields]  # LeCroy: "Segments,1,SegmentSize,2500"
        for name, text in pairwise(cells):
            value = _number(text, ".") if bare_key(name) in COUNT_KEYS else None
            if value is not None and value.number > 0 and value.number == int(value.number):
                return name, int(value.number)
    return None


@dataclass(frozen=True)
class _Stated:
    """A number of the header as printed."""

    number: float
    digit: float
    """The last printed digit."""
    word: str
    """The text after the number."""
    unit: tuple[str, float] | None = None
    """Its unit, if it is a unit of a clock."""


def _of_channel(
    path: Path, key: str, fields: Sequence[str], channel: int, channels: int, decimal: str, unit: str | None
) -> "_Stated | str | None":
    """The number of a clock key for one channel. If it is unusable, the reason as text. None if absent."""
    texts = [field for field in fields if not _TIME_OF_DAY.search(field)]
    values = [v for field in texts if (v := _number(field.rpartition(":")[2], decimal)) is not None]
    if not values:
        digits = [field for field in texts if any(letter.isdecimal() for letter in field)]
        return f"{key} = {digits[0][:60]} is not a number that can be read" if digits else None
    chosen = values[0]
    if any(value.number != chosen.number for value in values):
        if len(values) != channels:
            message = f"says {key} = {', '.join(f'{v.number:g}' for v in values)} for {channels} channels"
            raise InputError(path, message, cure="state interval and start in the layout")
        chosen = values[channel]
    if chosen.digit != chosen.digit:
        return f"{key} = {fields[0][:60]} may have a decimal sign or one between thousands"
    beside = next((field for field in fields if clock_unit(field) is not None), None)
    words = [word for word in (chosen.word, beside, unit) if word]
    units = [clock_unit(word) for word in words]
    for word, clock in zip(words, units, strict=True):
        if clock is None:
            return f"{key} = {fields[0][:60]} has the unit '{word}', which is not a unit of time"
        if clock != units[0]:
            return f"{key} = {fields[0][:60]} has two units, {' and '.join(words)}"
    return replace(chosen, unit=units[0] if units else None)


def _number(field: str, decimal: str) -> _Stated | None:
    """Number, last digit (NaN for an ambiguous "1,000") and following word of a field such as "20 ns"."""
    match = full_match(_NUMBER, field.strip())
    if match is None:
        endless = field.strip().lower().lstrip("+-") in ("inf", "nan")  # of a binary file; refused as a clock
        return _Stated(float(field), 0.0, "") if endless else None
    text, word = match.groups()
    mantissa, exponential, exponent = text.lower().partition("e")
    digits = mantissa.lstrip("+-").rstrip(",." if word else ".")
    other = "," if decimal == "." else "."
    grouped = any(re.fullmatch(_GROUPED[sign], digits) for sign in ",.")
    single = digits.count(",") + digits.count(".") == 1
    if grouped and not (single and decimal in digits):
        if single and other in digits and not exponential:
            return _Stated(float("nan"), float("nan"), (word or "").strip())
        if not single:
            between = min(",.", key=lambda sign: digits.find(sign) if sign in digits else len(digits))
            digits = digits.replace(between, "")
    if not (re.fullmatch(_POINT, digits) or re.fullmatch(_COMMA, digits)):
        return None
    digits = digits.replace(",", ".")
    places = len(digits.partition(".")[2])
    power = int(exponent or 0)
    number = float(f"{'-' if mantissa.startswith('-') else ''}{digits}e{power}")
    return _Stated(number, float(f"1e{power - places}"), (word or "").strip())


COMMENTS = ("#", "%", "!", "//")
"""Usual comment signs of lines above the samples."""
_PER_CENT = re.compile(r"%\s*[\t;,]")

_PAIR = re.compile(r'"?([^:=;,\t"]+?)"?\s*[:=;,\t]\s*(.*)')
_BLANKS = re.compile(r"(\D.*?)\s+([-+.\d].*)")


def uncommented(line: str, comment: str | None) -> str:
    """A line without its comment sign. A first field "%" is a unit."""
    for sign in (comment,) if comment else COMMENTS:
        if line.startswith(sign) and not _PER_CENT.match(line):
            return line.removeprefix(sign).lstrip()
    return line


def key_lines(dialect: Dialect, lines: Iterable[str]) -> dict[str, list[str]]:
    """Key -> fields of lines such as "Sample Interval,1e-7,s" or "tInc = 2e-9". Repeated keys get numbers."""
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
    """Add a key. A repeated key gets a number: "Date", "Date (2)"."""
    name, count = key, 1
    while name in metadata:
        count += 1
        name = f"{key} ({count})"
    metadata[name] = fields


def heading_keys(dialect: Dialect, lines: Sequence[str]) -> dict[str, list[str]]:
    """Start and increment in the line of the column names.

    They are separate columns, or have the form "tInc = 2e-9".

    ``dialect``: division of lines into fields. ``lines``: that of the names and, if present, of the units.
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
    """Names and units from header lines with a key (Yokogawa: TraceName, VUnit)."""
    found: dict[str, list[Any]] = {"tracename": list(names), "vunit": list(units)}
    for key, fields in metadata.items():
        if bare_key(key) in found and len(fields) == len(columns):
            for column, field in zip(columns, fields, strict=True):
                found[bare_key(key)][column] = field
    return tuple(found["tracename"]), tuple(found["vunit"])


def keys_beside(rows: list[list[str]]) -> dict[str, list[str]]:
    """Keys of the first column and the fields after them."""
    metadata: dict[str, list[str]] = {}
    for row in rows:
        key = row[0].strip().rstrip(":")
        if key:
            add_key(metadata, key, [part.strip() for part in row[1:] if part.strip()])
    return metadata


def check_width(path: Path, lines: list[str], separator: str, least: int) -> None:
    """Check that no line has too few fields. Raises InputError with the number of the line."""
    for number, line in enumerate(lines, start=1):
        fields = line.count(separator) + 1
        if fields < least:
            cut = "; the file seems to be cut off" if number == len(lines) else ""
            message = f"has {fields} fields, {least} are needed{cut}"
            raise InputError(path, message, line=number, cure="copy or export the file again")
