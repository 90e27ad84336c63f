"""Oscilloscope export: one time column, one or more channels in volts."""

from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.records import Recording
from kolsky.readers.table import Column, Table, read_table

LARGEST_JITTER = 0.1
"""Largest spread of the steps of a rounded time column, as a share of the step [-]."""


def read(path: Path, *, time: Column, voltage: Column) -> Recording:
    """One channel of a scope export.

    Parameters
    ----------
    path
        Comma-separated text with one header line.
    time
        The time column; its factor leads to seconds.
    voltage
        The channel's column; its factor leads to volts.

    Returns
    -------
    Recording
        Time as the file gives it [s] and volts [V], shape [n_samples].

    Raises
    ------
    InputError
        If the file is not such a table, if times repeat or are not sorted, or if the steps between
        them differ by more than the printed digits explain (a gap) or because of them (too few digits).
    """
    table = read_table(path)
    t, volts = table.values(time), table.values(voltage)
    table.check_increasing(time, t)
    _check_uniform(table, time, t)
    return Recording(
        time=t,
        value=volts,
        channel=voltage.name,
        unit="V",
        path=path,
        sha256=table.sha256,
    )


def _check_uniform(table: Table, column: Column, time: FloatArray) -> None:
    """A scope samples at equal steps; anything else is a gap or a rounded column."""
    if time.size < 3:
        raise table.error("has fewer than 3 samples", cure="export the whole record")
    digit = table.printed_digit(column)
    steps = np.diff(time)
    step = float(np.median(steps))
    # Each printed time is off by half a digit at most, so a step by one digit (and the float's round-off).
    worst = int(np.argmax(np.abs(steps - step)))
    excess = abs(float(steps[worst]) - step)
    if excess > 1.001 * digit + 1e-9 * step:
        raise table.error(
            f"column '{column.name}': the step is {steps[worst]:.6g} s where the others are {step:.6g} s,"
            f" and the printed digit is only {digit:.0e} s",
            row=worst + 1,
            cure="export the record again without gaps",
        )
    if excess > LARGEST_JITTER * step:
        raise table.error(
            f"column '{column.name}' is rounded to {digit:.0e} s: steps between {steps.min():.6g} and"
            f" {steps.max():.6g} s in a uniform record",
            row=worst + 1,
            cure="export the times with more digits",
        )
