"""Checks that the samples of a channel can be a measurement: finite, changing, not clipped."""

from pathlib import Path

import numpy as np

from kolsky.base.arrays import FloatArray
from kolsky.base.errors import InputError
from kolsky.readers.contents import LARGEST_SAMPLE, Channel

SHORTEST_FLAT_TOP = 8
"""Shortest run of equal samples at an extreme that counts as clipping."""
LONGER_THAN_OTHERS = 4
"""How many times longer it is than any run of equal samples elsewhere in the record."""


def finite(path: Path, channel: Channel, values: FloatArray) -> None:
    """Refuse NaN, infinity and what is larger than anything measured.

    Raises
    ------
    InputError
        With the first such sample and their number.
    """
    bad = np.flatnonzero(~(np.abs(values) <= LARGEST_SAMPLE))  # NaN compares false
    if bad.size:
        raise _error(
            path,
            channel,
            int(bad[0]),
            f"is {values[bad[0]]}" + (f", the first of {bad.size}" if bad.size > 1 else ""),
            f"a recorder gives every sample a value of at most {LARGEST_SAMPLE:g}; export again without gaps",
        )


def changing(path: Path, channel: Channel, values: FloatArray) -> None:
    """Refuse a channel that never changes.

    Raises
    ------
    InputError
        With its value.
    """
    if np.ptp(values) == 0.0:
        raise InputError(
            path,
            f"channel '{channel.name}' is {values[0]:.6g} in all {values.size} samples",
            line=channel.place(0),
            cure="is it the right channel, and was it connected?",
        )


def unclipped(path: Path, channel: Channel, values: FloatArray, unit: str, full_scale: float | None) -> None:
    """Refuse a channel that ran into the end of its range.

    With a full scale no sample may reach it. Without one, a flat top gives it away: a run of at least eight
    equal samples at the largest or smallest value, four times longer than any run of equal samples at another
    value, of a signal that did not begin there. (A quiet baseline can be an extreme, and coarse digits make
    short runs anywhere.)

    Parameters
    ----------
    path
        The file, for messages.
    channel
        The channel.
    values
        Its samples, shape [n].
    unit
        Their unit.
    full_scale
        Largest size that the recorder shows, in `unit`.

    Raises
    ------
    InputError
        With the first clipped sample and their number.
    """
    if full_scale is not None:
        clipped = np.flatnonzero(np.abs(values) >= full_scale)
        if clipped.size:
            raise _error(
                path,
                channel,
                int(clipped[0]),
                f"is clipped: {values[clipped[0]]:.6g} {unit} in the first of {clipped.size} samples at or"
                f" beyond full scale ({full_scale:g} {unit})",
                "what lies beyond is lost; repeat the test at a coarser range, or correct full_scale",
            )
        return
    starts = np.flatnonzero(np.concatenate([[True], np.diff(values) != 0.0]))
    lengths = np.diff(np.append(starts, values.size))
    levels = values[starts]
    low, high = float(values.min()), float(values.max())
    inner = lengths[(levels != low) & (levels != high)]
    longest_inner = int(inner.max()) if inner.size else 1
    beginning = float(np.median(values[: max(1, values.size // 50)]))
    for extreme in (high, low):
        if abs(beginning - extreme) < 0.2 * (high - low):
            continue
        runs = np.flatnonzero(levels == extreme)
        longest = int(lengths[runs].max())
        if longest >= max(SHORTEST_FLAT_TOP, LONGER_THAN_OTHERS * longest_inner):
            first = int(starts[runs[np.argmax(lengths[runs])]])
            raise _error(
                path,
                channel,
                first,
                f"is clipped: {longest} equal samples at its extreme {extreme:.6g} {unit}, elsewhere at most"
                f" {longest_inner}",
                "what lies beyond is lost; repeat the test at a coarser range, or, if the signal is truly"
                " flat, state full_scale",
            )


def _error(path: Path, channel: Channel, sample: int, message: str, cure: str) -> InputError:
    line = channel.place(sample)
    where = "" if line is not None else f", sample {sample + 1}"
    return InputError(path, f"channel '{channel.name}'{where} {message}", line=line, cure=cure)
