"""Opposed gauges that were recorded in separate files, put on one clock."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from kolsky.bars.records import Signal
from kolsky.bars.reduction.faces import sampled_from
from kolsky.bars.signals.uniform_clock import LARGEST_JITTER, uniform_clock
from kolsky.base.arrays import FloatArray
from kolsky.base.records import Recording

LEAST = 50
"""Fewest samples that two recordings must have in common."""


def on_one_clock(recordings: Sequence[Recording], offsets: Sequence[float]) -> tuple[Recording, ...]:
    """Recordings of one station over the time that all of them cover, at the times of the first.

    Recordings of one time base stay as they are. Another recorder's samples are taken between its own where
    they fall between them, as of a band-limited signal, which changes neither its energy nor its noise.

    Parameters
    ----------
    recordings
        One for each channel, each on its recorder's clock.
    offsets
        Shot's clock minus recorder's clock of each [s].

    Returns
    -------
    tuple of Recording
        All on the first one's recorder's clock.

    Raises
    ------
    ValueError
        If the intervals differ, or the recordings have hardly a sample in common.
    """
    first = recordings[0]
    start, interval = uniform_clock(first)
    signals = [_shifted(r, offset - offsets[0]) for r, offset in zip(recordings, offsets, strict=True)]
    for other, signal in zip(recordings[1:], signals[1:], strict=True):
        if abs(signal.interval / interval - 1.0) * first.time.size > LARGEST_JITTER:
            raise ValueError(
                f"opposed gauges {first.channel} ({first.path.name}) and {other.channel} ({other.path.name}) "
                f"are sampled every {interval:.9g} s and every {signal.interval:.9g} s. Cure: record them "
                "with one rate, or state the interval of the file whose clock is off"
            )
    low = max(int(np.ceil((s.start - start) / interval - 1e-6)) for s in signals)
    high = min(int(np.floor((s.end - start) / interval + 1e-6)) for s in signals)
    count = high - low + 1
    if count < LEAST:
        spans = ", ".join(f"{s.start:.6g} to {s.end:.6g} s" for s in signals)
        raise ValueError(
            f"the opposed gauges' records have {max(count, 0)} samples in common ({spans}), need {LEAST}. "
            "Cure: correct the recorders' clock_offset"
        )
    time: FloatArray = start + interval * np.arange(low, high + 1, dtype=np.float64)
    begin = start + low * interval
    return tuple(
        replace(recording, time=time, value=sampled_from(signal, begin, count))
        for recording, signal in zip(recordings, signals, strict=True)
    )


def _shifted(recording: Recording, shift: float) -> Signal:
    start, interval = uniform_clock(recording)
    return Signal(start + shift, interval, recording.value, 0.0, recording.unit, recording.channel)
