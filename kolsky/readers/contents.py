"""Contents of a recorder's file: its declared layout, its channels with samples, and their clock.

A printed time column gives a uniform clock within its printed digits, or the reason why there is none.
"""

import hashlib
import json
import math
import stat
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Context, Decimal
from pathlib import Path
from typing import Any

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.base.files import check_size, read_errors, regular
from kolsky.base.process import run_program
from kolsky.base.units import LARGEST
from kolsky.readers.header import HeaderClock
from kolsky.readers.layout import ColumnId


@dataclass(frozen=True)
class ChannelInfo:
    """One channel as described in its file. Its samples have not been checked."""

    name: str
    """Its name in the file. The name selects the channel."""
    number: int
    """Its number among the columns or channels, counted from 1. It selects the channel too."""
    unit: str | None
    """Unit of its samples as the file writes it; None if the file does not state it."""
    samples: int
    start: float | None
    """Time of the first sample [s]; None if unknown."""
    interval: float | None
    """Sampling interval [s]; None if unknown."""
    time: str
    """Source of the times. If they are unknown, the reason, and the key to declare."""
    facts: Mapping[str, str] = field(default_factory=dict)
    """The detected layout: format and, for text, encoding, delimiter, decimal sign and header line."""
    metadata: Mapping[str, str] = field(default_factory=dict)
    """Other entries of the file, by the keys in the file."""


BINARY_LIMIT = 1_000_000_000
"""Largest binary file that is read [bytes]."""
SAMPLES_LIMIT = 20_000_000
"""Maximum number of samples of one channel. A compressed file may declare more than fits into memory."""

LARGEST_SAMPLE = LARGEST
"""Largest accepted magnitude of a sample, in any unit."""


@dataclass(frozen=True)
class Clock:
    """Sampling times: sample i was taken at ``start + i * interval``."""

    start: float
    """Time of the first sample [s]."""
    interval: float
    """Sampling interval [s]."""
    source: str
    measured: FloatArray | None = field(default=None, compare=False)
    """Times of the samples if their intervals vary [s], shape [samples]; otherwise None."""

    def times(self, samples: int) -> FloatArray:
        """Times of the first ``samples`` samples [s], shape [samples]."""
        return self.start + self.interval * np.arange(samples, dtype=np.float64)


@dataclass(frozen=True)
class Channel:
    """One channel of a file."""

    name: str
    number: int
    """Its number among the columns or channels, counted from 1."""
    unit: str | None
    """Unit as the file writes it, or None."""
    samples: int
    values: Callable[[], FloatArray]
    """Reads the samples in `unit`, shape [samples]. Raises `InputError`."""
    clock: Callable[[], Clock]
    """Finds the clock. Raises `InputError` if it is unknown."""
    place: Callable[[int], int | None] = lambda sample: None
    """Line of a sample in the file; None in a binary file."""


@dataclass(frozen=True)
class Contents:
    """Channels, facts and metadata of a recorder's file."""

    path: Path
    sha256: str
    channels: tuple[Channel, ...]
    """Its channels, without the time columns."""
    facts: Mapping[str, str]
    """The detected layout: "format" and, for text, "encoding", "delimiter", "decimal", "header"."""
    metadata: Mapping[str, str] = field(default_factory=dict)
    """Other entries of the file, by the keys in the file."""
    times: tuple[Channel, ...] = ()
    """Its time columns, as signals."""

    def without_numbers(self) -> str:
        """The columns or variables without numbers, in words for a message; empty if there are none."""
        others = self.facts.get("without numbers")
        return f"; without numbers are {others}" if others else ""


def clock_words(interval: float, samples: int) -> str:
    """Sampling rate, number of samples and duration of a record: "800 kHz, 120 samples, 150 us"."""
    return f"{_prefixed(1.0 / interval, 'Hz')}, {samples} samples, {_prefixed(samples * interval, 's')}"


def _prefixed(value: float, unit: str) -> str:
    """A positive value of four figures with an SI prefix."""
    power = min(max(math.floor(math.log10(float(f"{value:.3e}")) / 3.0), -4), 3)
    return f"{value / 10.0 ** (3 * power):.4g} {'pnum kMG'[power + 4].strip()}{unit}"


def stated_clock(interval: float, start: float | None, source: str) -> Clock:
    """A clock with a declared interval. It begins at 0 if no start is declared."""
    if start is None:
        return Clock(0.0, interval, f"{source}; start 0, the file gives none")
    return Clock(start, interval, source)


def file_hash(path: Path, *, limit: int = BINARY_LIMIT) -> str:
    """SHA-256 of a regular file of sensible size, hex.

    Raises InputError if there is no such file, or if it is empty or not a regular file. The same error is
    raised if it is larger than `limit` bytes, or if it may not be read.
    """
    with read_errors(path):
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError(path, "is not a file", cure="name the recorder's file")
        if status.st_size == 0:
            raise InputError(path, "is empty", cure="export it again")
        check_size(path, status.st_size, limit)
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()


def head_of(path: Path, size: int = 4096) -> bytes:
    """The first bytes of a file, for `sniff`; empty if it cannot be read."""
    try:
        with regular(path).open("rb") as stream:
            return stream.read(size)
    except OSError:
        return b""


_FIRST_BYTES = (
    (b"PK\x03\x04", "an Excel workbook or another zip archive", "rename a workbook to end in .xlsx"),
    (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "an old Excel workbook", "rename it to end in .xls"),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file", "rename it to end in .h5"),
    (b"MATLAB 5.0 MAT", "a MATLAB file", "rename it to end in .mat"),
    (b"TDSm", "a TDMS file of LabVIEW", "rename it to end in .tdms"),
    (b"%PDF", "a PDF document", "export the numbers as CSV"),
)
"""First bytes of a file -> its format, and the remedy if its name is that of a text file."""


def check_name(path: Path) -> None:
    """Check that a file with a text ending does not have the first bytes of another format.

    Raises InputError that names the format and its correct ending.
    """
    head = head_of(path, 16)
    for start, kind, cure in _FIRST_BYTES:
        if head.startswith(start):
            raise InputError(path, f"is {kind} by its first bytes, and is named as text", cure=cure)


TIMEOUT = 9.0
"""Time limit of the program `kolsky.readers.child` for one file [s]."""


def read_in_child(path: Path, form: str, place: Path, damaged: Callable[[Path, str], InputError]) -> Any:
    """Read a file with `kolsky.readers.child` in a separate process, which a damaged file may crash.

    ``form``: "xls" or "mat". ``place``: folder for arrays. ``damaged``: makes the error for a damaged file.
    Raises InputError if the program fails, crashes or takes longer than `TIMEOUT`.
    """
    program = Path(__file__).with_name("child.py")
    try:
        done = run_program(program, form, str(path), str(place), timeout=TIMEOUT)
    except subprocess.TimeoutExpired:
        raise damaged(path, f"no answer after {TIMEOUT:g} s") from None
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if "memory allocation" in line or "Error" in line]
        raise damaged(path, lines[-1] if lines else f"its reader ended with code {done.returncode}")
    return json.loads(done.stdout)


def check_samples(path: Path, name: str, samples: int) -> None:
    """Check that a channel has at least two samples and at most `SAMPLES_LIMIT`.

    Raises InputError that gives the number found.
    """
    if samples > SAMPLES_LIMIT:
        message = f"channel '{name}' has {samples} samples, more than the {SAMPLES_LIMIT} that are read"
        raise InputError(path, message, cure="export the time span of the test only")
    if samples < 2:
        message = f"channel '{name}' has {samples} samples"
        raise InputError(path, message, cure="name a record, at least two samples long")


def find_column(
    path: Path,
    names: Sequence[str],
    wanted: ColumnId,
    what: str = "column",
    *,
    numbers: Sequence[int] = (),
    line: int | None = None,
    listed: str | None = None,
    purpose: str = "",
    cure: str = "correct its name, or give its number; `kolsky channels FILE` lists them",
) -> int:
    """Index of a column by its name (of an HDF5 path, without its slash too) or, failing that, its number.

    ``path``, ``line``, ``cure``: for messages. ``what``: the column's kind, e.g. "time column". ``numbers``:
    numbers of the columns, if a number identifies one. ``listed``: the columns in words, if not twenty names.
    ``purpose``: what it is for, e.g. " for the stress". Raises InputError if not one column has it.
    """
    found = [i for i, name in enumerate(names) if name in (wanted, f"/{wanted}")]
    if not found and str(wanted).isdecimal():
        found = [i for i, number in enumerate(numbers) if number == int(wanted)]
    if len(found) == 1:
        return found[0]
    if found:
        by_number = f"give the number of one: {', '.join(str(numbers[i]) for i in found)}" if numbers else ""
        message = f"{what} '{wanted}' is there {len(found)} times"
        raise InputError(path, message, line=line, cure=by_number or "give each column a different name")
    words = ", ".join(f"'{name}'" for name in names[:20]) if listed is None else listed
    missing = f"{what} '{wanted}'{purpose} is missing; the {what.split()[-1]}s are {words}"
    raise InputError(path, missing, line=line, cure=cure)


LARGEST_JITTER = 0.1
"""Largest spread of the steps of a time column, relative to the step, at which it defines an interval [-]."""
LARGEST_VARIATION = 0.05
"""Largest variation of single steps, relative to the step, that is interpolated to uniform times [-]."""
SAMPLED = 5000
"""Number of rows of a column for which the printed digits are examined one by one."""
SINGLE = 2.0**-23
"""Resolution of single precision. Many recorders compute their printed times in single precision."""

_FIFTEEN = Context(prec=15)

Fault = Callable[[str, int | None, str], InputError]
"""Makes an error about the file: message, sample or None, remedy."""


def _printed_digits(fields: Sequence[str]) -> FloatArray:
    """The last printed digit of each number; the finest one among numbers of one decade and notation."""
    plain = [Decimal(field) for field in fields]
    # figures after the 15th come from the binary representation
    numbers = [n if len(n.as_tuple().digits) <= 15 else n.normalize(_FIFTEEN) for n in plain]
    kinds = [
        (number.adjusted() if number else None, "e" in field.lower())
        for number, field in zip(numbers, fields, strict=True)
    ]
    finest: dict[tuple[int | None, bool], int] = {}
    for kind, number in zip(kinds, numbers, strict=True):
        finest[kind] = min(int(number.as_tuple().exponent), finest.get(kind, 1000))
    least = min(finest.values())
    return np.array([10.0 ** (least if kind[0] is None else finest[kind]) for kind in kinds])


def column_digits(values: FloatArray, field_of: Callable[[int], str]) -> FloatArray:
    """The last printed digit of each number of a long column.

    `SAMPLED` rows are examined. The others get the digit of their decade.

    ``values``: the numbers, shape [n]. ``field_of``: the text of a row. Returns: in their unit, shape [n].
    """
    if values.size <= SAMPLED:
        return _printed_digits([field_of(row) for row in range(values.size)])
    with np.errstate(divide="ignore"):
        decade = np.floor(np.log10(np.abs(values)))  # -inf for 0
    rows = np.linspace(0, values.size - 1, SAMPLED).astype(int)
    found = np.unique(decade)
    # A decade near 0 has few rows. Evenly spaced samples may miss them.
    rows = np.unique(np.concatenate([rows, *(np.flatnonzero(decade == d)[:20] for d in found)]))
    digits = _printed_digits([field_of(int(row)) for row in rows])
    coarsest = {d: float(digits[decade[rows] == d].max()) for d in found}
    return np.array([coarsest[d] for d in found])[np.searchsorted(found, decade)]


def column_clock(
    time: FloatArray, digit: FloatArray, header: HeaderClock, *, name: str, fault: Fault
) -> Clock:
    """The clock defined by a time column.

    With a known interval dt, each printed time t_i with last digit d_i limits the start to t_i - i dt ± d_i /
    2. All times together constrain the start better than the first time. The start is the middle of the
    common range. If that range is smaller than dt / 100, the start is the first time.

    ``time``: the printed times [s], shape [n]. ``digit``: the last printed digit of each time [s], shape [n].
    ``header``: the declared clock. Without an interval in it, the column must define one. ``name``: the
    column, for messages. Raises InputError if times decrease or have gaps. The same error is raised if they
    are rounded too much to define an interval, or if they contradict the declared interval.
    """
    interval, start, source = header.interval, header.start, header.source
    _sorted(time, name, fault)
    digit = np.maximum(digit, SINGLE * np.abs(time))
    shown, doubt = _mean_step(time, digit)
    if interval is None:
        varies = check_steps(time, digit, name=name, fault=fault)
        # rounded to 1/1000 of its uncertainty by digits, without round-off in its last bits
        figures = 15 if doubt <= 0.0 else int(np.ceil(np.log10(shown / doubt))) + 4
        shown = float(f"{shown:.{min(15, figures)}g}")
        first = float(time[0]) if start is None else start
        return Clock(first, shown, f"column '{name}'", first + (time - time[0]) if varies else None)
    index = np.arange(time.size)
    # Some programs truncate instead of rounding. The error is then a whole digit instead of half a digit.
    for share in (0.5, 1.0):
        slack = share * digit * 1.001 + 1e-12 * np.abs(time) + header.interval_digit * index
        low, high = (
            float((time - slack - interval * index).max()),
            float((time + slack - interval * index).min()),
        )
        if low <= high:
            break
    else:
        raise fault(
            f"column '{name}' contradicts the interval {interval:.9g} s ({source}):"
            f" its first and last time suggest {shown:.6g} s (± {max(doubt, 0.0):.1g} s)",
            None,
            "correct the interval, or leave out the samples before or behind a gap",
        )
    if start is not None:
        return Clock(start, interval, source)
    exact = high - low < 0.01 * interval
    found = float(time[0]) if exact and low <= time[0] <= high else 0.5 * (low + high)
    known = "" if exact else f" (± {0.5 * (high - low):.1g} s, its digits allow no more)"
    return Clock(found, interval, f"{source}; start from column '{name}'{known}")


def array_clock(time: FloatArray, header: HeaderClock, *, name: str, fault: Fault) -> Clock:
    """The clock of times stored as binary numbers. Their printed digits are unknown.

    Arguments and errors are those of `column_clock`. A time may be off by 5 % of the interval.
    """
    interval, source = header.interval, header.source
    _sorted(time, name, fault)
    last = time.size - 1
    shown = float(time[last] - time[0]) / last
    dt = shown if interval is None else interval
    off = np.abs(time - time[0] - dt * np.arange(time.size))
    if interval is not None:
        if off.max() > max(0.5 * dt, 2e-6 * abs(float(time[last] - time[0]))) and abs(shown - dt) > 1e-6 * dt:
            raise fault(
                f"'{name}' contradicts the interval {dt:.9g} s ({source}): its first and last time suggest"
                f" {shown:.6g} s",
                None,
                "correct the interval",
            )
        return Clock(float(time[0]), dt, f"{source}; start from '{name}'")
    worst = int(np.argmax(off))
    if off[worst] > 0.05 * dt and np.abs(np.diff(time) / dt - 1.0).max() <= LARGEST_VARIATION:
        return Clock(float(time[0]), dt, f"'{name}'", time)
    if off[worst] > 0.05 * dt:
        raise fault(
            f"'{name}' is not uniform: sample {worst + 1} is {off[worst]:.3g} s off its place; the times are"
            f" rounded or have a gap. First and last time suggest an interval of {shown:.6g} s",
            worst,
            f'if the record has no gap, state the interval: interval = "{shown:.6g} s"',
        )
    return Clock(float(time[0]), shown, f"'{name}'")


def _sorted(time: FloatArray, name: str, fault: Fault) -> None:
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0.0)
    if back.size:
        swapped = back.size > 0.05 * steps.size and back.size > 2
        raise fault(
            f"column '{name}' is not sorted: {time[back[0] + 1]:.9g} s after {time[back[0]]:.9g} s"
            + (f" ({back.size} such samples)" if back.size > 1 else ""),
            int(back[0]) + 1,
            "is it the time column? the layout names it: time"
            if swapped
            else "every sample needs a later time than the one before; export again, in order",
        )
    if time[-1] == time[0]:
        raise fault(f"column '{name}' has one time only, {time[0]:.9g} s", None, "is it the time column?")


def _mean_step(time: FloatArray, digit: FloatArray) -> tuple[float, float]:
    """Mean step of a time column, and its uncertainty by the printed digits [s]."""
    last = time.size - 1
    return float(time[last] - time[0]) / last, 0.5 * float(digit[0] + digit[last]) / last


def check_steps(
    time: FloatArray,
    digit: FloatArray,
    *,
    name: str,
    fault: Fault,
    largest_variation: float = LARGEST_VARIATION,
) -> bool:
    """Check that a time column has equal steps within its printed digits. True if they vary slightly.

    ``largest_variation``: largest accepted variation of single steps, relative to the step [-]. Other
    arguments are those of `column_clock`. Raises InputError for gaps, and if rounding hides the interval.
    """
    shown, doubt = _mean_step(time, digit)
    steps = np.diff(time)
    printed = 0.5 * (digit[1:] + digit[:-1])
    median = float(np.median(steps))
    # If most steps are equal, or digits are much finer than a step, the median is the step. A gap may change
    # the mean. A column of few digits has steps of 0 and 1 digit. Only the mean is then useful.
    alike = float(np.mean(np.abs(steps - median) <= 0.01 * median)) > 0.5 and median > 0.0
    fine = alike or bool(printed.max() < LARGEST_JITTER * median)
    step, of_step = (median, float(np.median(printed))) if fine else (shown, doubt)
    excess = np.abs(steps - step)
    # The error of a step is at most one digit, half a digit for each time. The same holds for the reference
    # step.
    beyond = excess - 1.001 * (printed + of_step) - 1e-9 * step - 4e-16 * np.abs(time).max()
    row = int(np.argmax(beyond))
    if beyond[row] > 0.0 and float(excess.max()) <= largest_variation * step:
        return True
    if beyond[row] > 0.0:
        raise fault(
            f"column '{name}': the step is {steps[row]:.6g} s where the others are {step:.6g} s, and the"
            f" printed digit is only {printed[row]:.0e} s",
            row + 1,
            "export the record again without gaps",
        )
    worst = int(np.argmax(excess))
    if excess[worst] > LARGEST_JITTER * step:
        raise fault(
            f"column '{name}' is rounded to {digit[worst + 1]:.0e} s: steps between {steps.min():.6g} and"
            f" {steps.max():.6g} s in a uniform record. First and last time suggest an interval of"
            f" {shown:.6g} s (± {doubt:.1g} s)",
            worst + 1,
            "state the recorder's interval in the layout, or export the times with more digits",
        )
    return False
