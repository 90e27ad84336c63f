"""A uniform clock from a printed time column, or the reason why the column does not give one."""

from collections.abc import Callable, Sequence
from decimal import Context, Decimal

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.readers.contents import Clock

LARGEST_JITTER = 0.1
"""Largest spread of the steps of a time column that still gives the interval, as a share of the step [-]."""
LARGEST_VARIATION = 0.05
"""Largest variation of single steps, as a share of the step, that is interpolated to uniform times [-]."""
SAMPLED = 5000
"""Rows of a column whose printed digits are looked at one by one."""
SINGLE = 2.0**-23
"""Resolution of single precision, in which many recorders compute the times that they print."""

_FIFTEEN = Context(prec=15)

Fault = Callable[[str, int | None, str], InputError]
"""Makes an error about the file: message, sample or None, cure."""


def printed_digits(fields: Sequence[str]) -> FloatArray:
    """The last digit printed of each number, in its unit, shape [n].

    Some programs print so many decimals, others so many figures, and many drop trailing zeros: numbers of one
    decade and one notation share the finest digit that one of them shows.
    """
    numbers = [_printed(field) for field in fields]
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
    """The last digit printed of each number of a long column: of `SAMPLED` rows as they are, of the others by
    their decade.

    Parameters
    ----------
    values
        The numbers, shape [n].
    field_of
        The text of a row.

    Returns
    -------
    NDArray
        In the unit of `values`, shape [n].
    """
    if values.size <= SAMPLED:
        return printed_digits([field_of(row) for row in range(values.size)])
    with np.errstate(divide="ignore"):
        decade = np.floor(np.log10(np.abs(values)))  # -inf for 0
    rows = np.linspace(0, values.size - 1, SAMPLED).astype(int)
    found = np.unique(decade)
    # A decade near 0 has few rows, which an even choice may miss.
    rows = np.unique(np.concatenate([rows, *(np.flatnonzero(decade == d)[:20] for d in found)]))
    digits = printed_digits([field_of(int(row)) for row in rows])
    coarsest = {d: float(digits[decade[rows] == d].max()) for d in found}
    return np.array([coarsest[d] for d in found])[np.searchsorted(found, decade)]


def column_clock(
    time: FloatArray,
    digit: FloatArray,
    *,
    name: str,
    fault: Fault,
    interval: float | None = None,
    tolerance: float = 0.0,
    start: float | None = None,
    source: str = "",
) -> Clock:
    """The clock that a time column shows.

    With a known interval dt every printed time t_i with last digit d_i says that the start lies in
    t_i - i dt ± d_i / 2; all of them together say more than the first alone. The middle of what all allow is
    the start, unless they leave less than a hundredth of dt: then the first time is.

    Parameters
    ----------
    time
        The printed times [s], shape [n].
    digit
        The last digit printed of each [s], shape [n].
    name
        The column, for messages.
    fault
        Makes an error about the file.
    interval
        The interval that the user or the header states [s]; without it the column has to show one.
    tolerance
        What the stated interval may be off by, being printed itself [s].
    start
        The start that is stated beside it [s].
    source
        Where the stated interval comes from, in words.

    Raises
    ------
    InputError
        If times fall, have gaps, are rounded too much for an interval, or contradict the stated one.
    """
    _sorted(time, name, fault)
    digit = np.maximum(digit, SINGLE * np.abs(time))
    last = time.size - 1
    shown = float(time[last] - time[0]) / last
    doubt = 0.5 * float(digit[0] + digit[last]) / last
    if interval is None:
        varies = _uniform(time, digit, shown, doubt, name, fault)
        shown = _without_noise(shown, doubt)
        first = float(time[0]) if start is None else start
        return Clock(first, shown, f"column '{name}'", first + (time - time[0]) if varies else None)
    index = np.arange(time.size)
    # Some programs cut digits off where others round: a whole digit instead of half of one.
    for share in (0.5, 1.0):
        slack = share * digit * 1.001 + 1e-12 * np.abs(time) + tolerance * index
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


def array_clock(
    time: FloatArray, *, name: str, fault: Fault, interval: float | None = None, source: str = ""
) -> Clock:
    """The clock of times stored as numbers, of which nobody knows the digits.

    Raises
    ------
    InputError
        As `column_clock`; a time may be off its uniform place by 5 % of the interval.
    """
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


def _printed(field: str) -> Decimal:
    """A number as it was printed. A binary number has 15 decimal figures; more are its representation."""
    number = Decimal(field)
    return number if len(number.as_tuple().digits) <= 15 else number.normalize(_FIFTEEN)


def _without_noise(interval: float, doubt: float) -> float:
    """The interval without its float's last bits: rounded by a thousandth of what the digits leave open."""
    figures = 15 if doubt <= 0.0 else int(np.ceil(np.log10(interval / doubt))) + 4
    return float(f"{interval:.{min(15, figures)}g}")


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
            else "every sample has its own, later time; export again, in order",
        )
    if time[-1] == time[0]:
        raise fault(f"column '{name}' has one time only, {time[0]:.9g} s", None, "is it the time column?")


def _uniform(
    time: FloatArray, digit: FloatArray, shown: float, doubt: float, name: str, fault: Fault
) -> bool:
    """Whether the steps vary by more than the printed digits; gaps and rounding that hides the interval are
    refused."""
    steps = np.diff(time)
    printed = 0.5 * (digit[1:] + digit[:-1])
    median = float(np.median(steps))
    # Most steps alike, or digits much finer than a step: then the median is the step, whatever a gap does to
    # the mean. A column of few digits has steps of 0 and 1 digit, and only the mean tells anything.
    alike = float(np.mean(np.abs(steps - median) <= 0.01 * median)) > 0.5 and median > 0.0
    fine = alike or bool(printed.max() < LARGEST_JITTER * median)
    step, of_step = (median, float(np.median(printed))) if fine else (shown, doubt)
    excess = np.abs(steps - step)
    # A step is off by a digit at most, half a digit for each of its times; so is the one it is held against.
    beyond = excess - 1.001 * (printed + of_step) - 1e-9 * step - 4e-16 * np.abs(time).max()
    row = int(np.argmax(beyond))
    if beyond[row] > 0.0 and float(excess.max()) <= LARGEST_VARIATION * step:
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
