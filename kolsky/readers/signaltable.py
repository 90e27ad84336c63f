"""From a table of text to channels with clocks."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from kolsky.base.arrays import FloatArray
from kolsky.readers.contents import Channel, Clock, Layout, check_samples, stated_clock
from kolsky.readers.header import header_clock, stated_samples, time_unit
from kolsky.readers.sheet import Sheet
from kolsky.readers.signalunits import si_unit, split_unit, time_factor
from kolsky.readers.text import matched
from kolsky.readers.timecolumn import column_clock, column_digits

_TIME_NAME = re.compile(
    r"(elapsed[\s_])?(time|timestamp|zeit|temps|tiempo|tempo|t|x_?value|x-axis|x axis|seconds?|secs?)\b.*",
    re.IGNORECASE,
)
FEWEST_STEPS = 100
"""Rows that a time column must have for its unit to be told from the header's interval."""
SAME_STEP = 1e-3
"""Largest relative difference of the column's mean step from the header's interval [-]."""


@dataclass(frozen=True)
class SignalTable:
    """Columns of a sheet as signals and their times."""

    sheet: Sheet
    """The table."""
    layout: Layout
    """What has been said of it."""
    times: tuple[int, ...]
    """The time columns, counted from 0."""
    _read: dict[int, tuple[FloatArray, FloatArray]] = field(default_factory=dict, compare=False, repr=False)
    """Time columns that were read already: channels share them."""

    def channels(self) -> tuple[Channel, ...]:
        """The columns of numbers that are no times.

        Raises
        ------
        InputError
            If the header promises more samples than there are, or there are too many or too few.
        """
        sheet = self.sheet
        self._check_count()
        # Rigol counts its samples in a column of the unit "Sequence".
        counts = [i for i, unit in enumerate(sheet.units) if unit is not None and unit.lower() == "sequence"]
        columns = [i for i in sheet.dialect.numeric if i not in (*self.times, *counts)]
        if not columns:
            raise sheet.error("has a time column but no signal", None, "export a channel, or correct time")
        check_samples(sheet.path, sheet.names[columns[0]], len(sheet.rows))
        return tuple(self._channel(column, order, len(columns)) for order, column in enumerate(columns))

    def _channel(self, column: int, order: int, count: int) -> Channel:
        sheet = self.sheet
        return Channel(
            name=sheet.names[column],
            number=column + 1,
            unit=sheet.units[column],
            samples=len(sheet.rows),
            values=lambda: sheet.values(column),
            clock=lambda: self._clock(column, order, count),
            place=lambda sample: sheet.first + sample,
        )

    def _clock(self, column: int, order: int, count: int) -> Clock:
        sheet, layout = self.sheet, self.layout
        header = header_clock(sheet.path, sheet.metadata, channel=order, channels=count)
        start = layout.start if layout.start is not None else header.start
        interval, tolerance, source = header.interval, header.interval_digit, header.source
        if layout.interval is not None:
            interval, tolerance, source = layout.interval, 0.0, "stated"
        number = self._time_column(column)
        if number is not None and interval is not None and start is not None and not self._time_unit(number):
            number = None  # the header says everything, and nobody says what the column counts
        if number is None:
            if interval is None:
                raise sheet.error(
                    "has no time column that is recognised and no interval in its header",
                    None,
                    'say in the layout time = "NAME", or interval = "100 ns"',
                )
            return stated_clock(interval, start, source)
        values, digit = self._times(number)
        return column_clock(
            values,
            digit,
            name=sheet.names[number],
            fault=sheet.error,
            interval=interval,
            tolerance=tolerance,
            start=start,
            source=source,
        )

    def _time_column(self, column: int) -> int | None:
        """The time column of a signal: the stated one, or the last one left of it, or the first."""
        stated = self.layout.time
        if isinstance(stated, Mapping):
            for channel, time in stated.items():
                if self.sheet.column(channel, "channel") == column:
                    return self.sheet.column(time, "time column")
            return None
        if not self.times:
            return None
        left = [time for time in self.times if time < column]
        return left[-1] if left else self.times[0]

    def _times(self, number: int) -> tuple[FloatArray, FloatArray]:
        """Times and their last digits [s]."""
        if number in self._read:
            return self._read[number]
        sheet = self.sheet
        what = f"the time column '{sheet.names[number]}'"
        factor = time_factor(sheet.path, self._time_unit(number), what)
        values = sheet.values(number)
        digits = column_digits(values, lambda row: sheet.field(number, row))
        # Dividing by 1e6 rounds once where multiplying by 1e-6 rounds twice: 25 us is 2.5e-5 s.
        inverse = round(1.0 / factor)
        seconds = values / inverse if factor < 1.0 else values * factor
        self._read[number] = seconds, digits * factor
        return self._read[number]

    def _time_unit(self, number: int) -> str | None:
        """The unit of a time column: stated, in the header, or its very name ("seconds")."""
        name = self.sheet.names[number]
        named = name if len(name) > 1 and si_unit(name) == ("s", 1.0) else None
        said = self.layout.time_unit or self.sheet.units[number] or named or time_unit(self.sheet.metadata)
        return said or self._unit_by_interval(number)

    def _unit_by_interval(self, number: int) -> str | None:
        """Seconds, where the column's steps are the very interval that the header states in seconds."""
        header = header_clock(self.sheet.path, self.sheet.metadata)
        rows = len(self.sheet.rows)
        if header.interval is None or rows < FEWEST_STEPS:
            return None
        first, last = (float(self.sheet.field(number, row)) for row in (0, rows - 1))
        return "s" if abs((last - first) / (rows - 1) / header.interval - 1.0) < SAME_STEP else None

    def _check_count(self) -> None:
        promised = stated_samples(self.sheet.metadata)
        rows = len(self.sheet.rows)
        if promised is not None and rows < promised[1]:
            raise self.sheet.error(
                f"ends after {rows} samples; its header promises {promised[0]} = {promised[1]}",
                rows - 1,
                "the file is cut off; copy or export it again",
            )


def signal_table(sheet: Sheet, layout: Layout) -> SignalTable:
    """Find the time columns: the stated ones, else the columns that are called time, or hold seconds.

    Raises
    ------
    InputError
        If a stated time column is missing.
    """
    stated = layout.time
    if isinstance(stated, Mapping):
        times = tuple(sorted({sheet.column(time, "time column") for time in stated.values()}))
    elif stated is not None:
        times = (sheet.column(stated, "time column"),)
    else:
        times = tuple(i for i in sheet.dialect.numeric if _is_time(sheet.names[i], sheet.units[i]))
    return SignalTable(sheet, layout, times)


def _is_time(name: str, unit: str | None) -> bool:
    if unit is not None:
        known = si_unit(unit)
        return known is not None and known[0] == "s"
    return matched(_TIME_NAME, split_unit(name)[0]) is not None
