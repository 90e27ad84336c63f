"""Channels out of named arrays: what MATLAB and HDF5 files have in common."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.readers.contents import Channel, Clock, Layout, check_samples, stated_clock
from kolsky.readers.header import INTERVAL_KEYS, RATE_KEYS, START_KEYS, bare_key
from kolsky.readers.signalunits import si_unit, time_factor
from kolsky.readers.timecolumn import array_clock


@dataclass(frozen=True)
class NamedArray:
    """A column of numbers that is read when it is asked for."""

    name: str
    """Path or name in the file; "signals[2]" is the second column of an array."""
    samples: int
    """Its length."""
    values: Callable[[], FloatArray]
    """Reads it."""
    unit: str | None = None
    """Its unit, if the file says it."""
    keys: Mapping[str, float] = field(default_factory=dict)
    """Numbers that belong to it: attributes of its own and of the groups around it."""


def array_channels(
    path: Path, arrays: list[NamedArray], scalars: Mapping[str, float], layout: Layout
) -> tuple[Channel, ...]:
    """The arrays that are no times, each with its clock.

    The clock comes from the layout, from keys such as "dt" and "t0", or from the array of times: the stated
    one, or one that is called "t" or "time" and is as long.

    Parameters
    ----------
    path
        The file.
    arrays
        What it holds.
    scalars
        Single numbers of the file, by name.
    layout
        What has been said of it.

    Raises
    ------
    InputError
        If there is nothing to read, or a stated array of times is missing.
    """
    by_name = {array.name: array for array in arrays}
    stated = layout.time
    wanted = (
        [str(t) for t in stated.values()] if isinstance(stated, Mapping) else [str(stated)] if stated else []
    )
    for name in wanted:
        if name not in by_name:
            names = ", ".join(f"'{array}'" for array in list(by_name)[:20])
            raise InputError(
                path, f"has no array '{name}'; it has {names}", cure="correct time in the layout"
            )
    times = wanted or [array.name for array in arrays if _last(array.name) in ("t", "time", "times")]
    signals = [array for array in arrays if array.name not in times]
    if not signals:
        raise InputError(path, "holds no array of numbers but times", cure="save the signals as plain arrays")

    def clock_of(signal: NamedArray) -> Clock:
        keys = {bare_key(_last(key)): (key, value) for key, value in {**scalars, **signal.keys}.items()}
        interval, source = layout.interval, "stated"
        if interval is None:
            found = next((keys[k] for k in INTERVAL_KEYS if k in keys), None)
            rate = next((keys[k] for k in RATE_KEYS if k in keys), None)
            interval, source = _interval(path, found, rate)
        begin = next((keys[k] for k in START_KEYS if k in keys), None)
        start = layout.start if layout.start is not None else None if begin is None else begin[1]
        if begin is not None and layout.start is None:
            source += f", {begin[0]}"
        name = stated.get(signal.name) if isinstance(stated, Mapping) else None
        near = [str(name)] if name is not None else [t for t in times if by_name[t].samples == signal.samples]
        if interval is not None and (start is not None or not near):
            return stated_clock(interval, start, source)
        if not near:
            raise InputError(
                path,
                f"has no times for '{signal.name}' ({signal.samples} samples) and no interval",
                cure='say in the layout time = "NAME", or interval = "100 ns"',
            )
        return _array_clock(path, by_name[near[0]], layout, interval, source)

    for signal in signals:
        check_samples(path, signal.name, signal.samples)
    return tuple(
        Channel(
            name=signal.name,
            number=number,
            unit=signal.unit,
            samples=signal.samples,
            values=signal.values,
            clock=lambda signal=signal: clock_of(signal),  # type: ignore[misc]
        )
        for number, signal in enumerate(signals, start=1)
    )


def _array_clock(path: Path, array: NamedArray, layout: Layout, interval: float | None, source: str) -> Clock:
    unit = layout.time_unit or array.unit or "s"
    factor = time_factor(path, unit, f"the array '{array.name}'")
    values = array.values()
    if not np.isfinite(values).all():
        raise InputError(path, f"'{array.name}' holds NaN or infinity", cure="state the interval")
    values = values * factor

    def fault(message: str, sample: int | None, cure: str) -> InputError:
        return InputError(path, message, cure=cure)

    clock = array_clock(values, name=array.name, fault=fault, interval=interval, source=source)
    words = clock.source if layout.time_unit or array.unit else f"{clock.source}, taken as seconds"
    start = clock.start if layout.start is None else layout.start
    measured = None if clock.measured is None else clock.measured + (start - clock.start)
    return Clock(start, clock.interval, words, measured)


def _interval(
    path: Path, found: tuple[str, float] | None, rate: tuple[str, float] | None
) -> tuple[float | None, str]:
    """Interval [s] and the key it comes from."""
    key, value = found or rate or ("", 1.0)
    if not key:
        return None, ""
    if not 0.0 < value < float("inf"):
        raise InputError(path, f"says {key} = {value:g}", allowed="> 0", cure="state the interval")
    return (value if found else 1.0 / value), key


def columns_of(name: str, shape: tuple[int, ...]) -> list[tuple[str, int, int | None]]:
    """Name, length and column (None for a vector) of the vectors in an array; nothing for other arrays.

    The longer side is the time; at most 64 columns, else it is no set of signals.
    """
    long = [n for n in shape if n > 1]
    if len(long) == 1 and len(shape) <= 2:
        return [(name, long[0], None)]
    if len(long) == 2 and len(shape) == 2 and min(long) <= 64 and max(long) > min(long):
        return [(f"{name}[{i + 1}]", max(long), i) for i in range(min(long))]
    return []


def column_of(array: np.ndarray, column: int | None) -> FloatArray:
    """One of the columns that `columns_of` names, as numbers."""
    if column is None:
        return np.asarray(array, dtype=np.float64).ravel()
    return np.asarray(array if array.shape[0] > array.shape[1] else array.T, dtype=np.float64)[
        :, column
    ].copy()


def known_unit(text: object) -> str | None:
    """A unit that a file gives as text or bytes; None if it is none."""
    if isinstance(text, bytes):
        text = text.decode("utf-8", "replace")
    return text.strip() if isinstance(text, str) and si_unit(text) is not None else None


def _last(name: str) -> str:
    return name.rsplit("/", 1)[-1].lower()
